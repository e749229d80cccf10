//! Means, variances, and what repeated points make of them.

use needlebench_numerics::random::SplitMix64;
use needlebench_numerics::student;

use crate::{Factor, FactorKind, FactorValue, Role};

/// Count, mean and variance of a stream, about its first value so that nothing cancels.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Moments {
    count: u64,
    shift: f64,
    sum: f64,
    square: f64,
}

impl Moments {
    pub(crate) fn push(&mut self, value: f64) {
        if self.count == 0 {
            self.shift = value;
        }
        self.count += 1;
        let d = value - self.shift;
        self.sum += d;
        self.square += d * d;
    }

    pub(crate) fn count(&self) -> u64 {
        self.count
    }

    pub(crate) fn mean(&self) -> Option<f64> {
        (self.count > 0).then(|| self.shift + self.sum / self.count as f64)
    }

    /// Sum of the squared deviations from the mean.
    pub(crate) fn deviations(&self) -> f64 {
        if self.count == 0 {
            return 0.0;
        }
        (self.square - self.sum * self.sum / self.count as f64).max(0.0)
    }

    /// Standard deviation of the sample, with `n - 1`.
    pub(crate) fn standard_deviation(&self) -> Option<f64> {
        (self.count > 1).then(|| (self.deviations() / (self.count - 1) as f64).sqrt())
    }
}

/// Random groups that the sampled points are put into.
pub(crate) const GROUPS: usize = 256;

/// Which cases come from the same sampled point, and how many there are of each.
#[derive(Debug, Clone)]
pub(crate) struct Points {
    /// Factors whose values together are a point.
    keys: Vec<usize>,
    /// Cases of a point.
    pub repeats: u64,
}

impl Points {
    /// Points of sampled noise factors; without such, of whatever is sampled; without any, of all
    /// noise factors, or of all factors. Sampled factors have the same points in each combination of the
    /// crossed ones, so that each point appears in as many cases as there are combinations.
    pub(crate) fn new(factors: &[Factor]) -> Self {
        Self::repeated(factors, |_| true)
    }

    /// The points of the cases of one candidate.
    pub(crate) fn of_one_choice(factors: &[Factor]) -> Self {
        Self::repeated(factors, |factor| factor.role == Role::Noise)
    }

    /// Points that are repeated in the combinations of those crossed factors that vary.
    fn repeated(factors: &[Factor], vary: impl Fn(&Factor) -> bool) -> Self {
        let some = |wanted: &dyn Fn(&Factor) -> bool| -> Vec<usize> {
            let found = factors.iter().enumerate().filter(|(_, each)| wanted(each));
            found.map(|(index, _)| index).collect()
        };
        let circumstance = |factor: &Factor| factor.role == Role::Noise;
        let repeats = if factors.iter().any(Factor::is_sampled) {
            combinations(factors, |factor| !factor.is_sampled() && vary(factor))
        } else {
            1
        };
        let keys = [
            some(&|factor| factor.is_sampled() && circumstance(factor)),
            some(&Factor::is_sampled),
            some(&circumstance),
            some(&|_| true),
        ];
        Self {
            keys: keys
                .into_iter()
                .find(|keys| !keys.is_empty())
                .unwrap_or_default(),
            repeats,
        }
    }

    /// All noise factors together.
    pub(crate) fn of_circumstances(factors: &[Factor]) -> Self {
        let all = factors.iter().enumerate();
        let keys = all.filter(|(_, factor)| factor.role == Role::Noise);
        Self {
            keys: keys.map(|(index, _)| index).collect(),
            repeats: 1,
        }
    }

    /// All factors together.
    pub(crate) fn of_everything(factors: &[Factor]) -> Self {
        Self {
            keys: (0..factors.len()).collect(),
            repeats: 1,
        }
    }

    /// Group of a case: the same for all cases of a point.
    pub(crate) fn group(&self, values: &[FactorValue]) -> usize {
        usize::try_from(self.hash(values) % GROUPS as u64).expect("below the number of groups")
    }

    /// What identifies the point of a case.
    pub(crate) fn hash(&self, values: &[FactorValue]) -> u64 {
        self.keys.iter().fold(0, |hash, &key| {
            let value = match values[key] {
                FactorValue::Level(level) => level as u64,
                FactorValue::Number(number) => number.to_bits(),
            };
            SplitMix64::new(hash ^ value).next_u64()
        })
    }
}

/// Combinations of the levels of the selected factors.
pub(crate) fn combinations(factors: &[Factor], wanted: impl Fn(&Factor) -> bool) -> u64 {
    let levels = factors.iter().filter(|each| wanted(each));
    levels.fold(1_u64, |product, factor| match &factor.kind {
        FactorKind::Levels(levels) => product.saturating_mul(levels.len().max(1) as u64),
        FactorKind::Continuous { .. } => product,
    })
}

/// Sums of a response over random groups of the sampled points.
#[derive(Debug, Clone)]
pub(crate) struct Grouped {
    count: [f64; GROUPS],
    sum: [f64; GROUPS],
}

impl Default for Grouped {
    fn default() -> Self {
        Self {
            count: [0.0; GROUPS],
            sum: [0.0; GROUPS],
        }
    }
}

impl Grouped {
    pub(crate) fn push(&mut self, group: usize, value: f64) {
        self.count[group] += 1.0;
        self.sum[group] += value;
    }

    pub(crate) fn add(&mut self, other: &Self) {
        for group in 0..GROUPS {
            self.count[group] += other.count[group];
            self.sum[group] += other.sum[group];
        }
    }

    /// Number of cases.
    pub(crate) fn count(&self) -> f64 {
        self.count.iter().sum()
    }

    /// Sum of their values.
    pub(crate) fn total(&self) -> f64 {
        self.sum.iter().sum()
    }

    /// Count and sum of every other group: of the even ones, or of the odd ones.
    pub(crate) fn of_half(&self, half: usize) -> [f64; 2] {
        let sum = |values: &[f64]| values.iter().skip(half).step_by(2).sum();
        [sum(&self.count), sum(&self.sum)]
    }

    /// How much larger the variance of the mean is than that of as many independent cases: from the
    /// spread of the groups, at least 1. A sample of which no point appears twice has 1; where nothing
    /// can be seen of the repetition, all cases of a point are one.
    pub(crate) fn design_effect(&self, variance: f64, repeats: u64) -> f64 {
        let count = self.count();
        if repeats <= 1 || count < 2.0 {
            return 1.0;
        }
        let Some((squared_error, _)) = self.squared_error() else {
            // All that there is comes from one point.
            return count;
        };
        if variance <= 0.0 {
            return repeats as f64;
        }
        (squared_error / (variance / count)).clamp(1.0, repeats as f64)
    }

    /// Independent cases that tell as much about a share as these, of which `repeats` come from each
    /// point. Never more than the cases, never fewer than the points.
    ///
    /// Korn and Graubard's: cases over the design effect, times the squared ratio of Student's quantiles,
    /// which makes up for the few points that the design effect is estimated from. It is estimated with
    /// one more point, all of whose cases have the rarer outcome: that a sample shows no point that fails
    /// as a whole does not mean that there is none. Agresti and Coull add such trials to a binomial sample,
    /// Am. Stat. 52 (1998) 119. Where a share is 0 or 1 this counts points.
    pub(crate) fn effective_size(&self, repeats: u64, tail: f64) -> f64 {
        let count = self.count();
        if repeats <= 1 || count < 2.0 {
            return count;
        }
        let of_point = (repeats as f64).min(count);
        let points = count / of_point;
        let added = if 2.0 * self.total() < count {
            of_point
        } else {
            0.0
        };
        let all = count + of_point;
        let share = (self.total() + added) / all;
        let groups = self.count.iter().zip(&self.sum);
        let groups = groups.filter(|(count, _)| **count > 0.0);
        let squares = groups
            .clone()
            .map(|(count, sum)| (sum - share * count).powi(2))
            .sum::<f64>()
            + (added - share * of_point).powi(2);
        let groups = groups.count() as f64;
        let squared_error = (groups + 1.0) / groups * squares / (all * all);
        let effect = (squared_error * all / (share * (1.0 - share))).clamp(1.0, of_point);
        let small =
            student::exceeded_with(tail, count - 1.0) / student::exceeded_with(tail, groups - 1.0);
        (count / effect * small * small).clamp(points, count)
    }

    /// Squared standard error of the mean, from the spread of the groups, with its degrees of
    /// freedom; none of a single group.
    pub(crate) fn squared_error(&self) -> Option<(f64, usize)> {
        spread_of_groups(&[(self, 1.0)])
    }

    /// Squared standard error of the difference of two means over the same points.
    pub(crate) fn squared_error_of_difference(a: &Self, b: &Self) -> Option<(f64, usize)> {
        spread_of_groups(&[(a, 1.0), (b, -1.0)])
    }
}

/// Linearised ratio means over random groups: Wolter, Introduction to Variance Estimation, 2007,
/// chapters 2 and 6.
fn spread_of_groups(terms: &[(&Grouped, f64)]) -> Option<(f64, usize)> {
    let mut residuals = [0.0; GROUPS];
    let mut used = [false; GROUPS];
    for (grouped, sign) in terms {
        let count: f64 = grouped.count.iter().sum();
        if count == 0.0 {
            return None;
        }
        let mean = grouped.sum.iter().sum::<f64>() / count;
        for group in 0..GROUPS {
            residuals[group] += sign * (grouped.sum[group] - mean * grouped.count[group]) / count;
            used[group] |= grouped.count[group] > 0.0;
        }
    }
    let groups = used.iter().filter(|used| **used).count();
    if groups < 2 {
        return None;
    }
    let correction = groups as f64 / (groups - 1) as f64;
    let squares: f64 = residuals.iter().map(|residual| residual * residual).sum();
    Some((correction * squares, groups - 1))
}
