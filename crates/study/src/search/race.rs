//! Multiple comparisons with the best: which candidates are not significantly different from it.

use needlebench_numerics::order::quantile_position;
use needlebench_numerics::random::SplitMix64;

use super::objective::{CaseWorth, Objective};

/// Resamples of the bootstrap.
const RESAMPLES: usize = 1000;

/// Fewer cases give no significant differences: resamples of so few have too few values.
const FEWEST_CASES: usize = 16;

/// Lower limit of a margin, mm: that of an invalid layout is minus infinity, and differences of infinities are
/// undefined.
const LEAST_MARGIN_MM: f64 = -1e4;

/// All pairs of candidates are compared at once, by a paired bootstrap.
///
/// Candidates have the same cases, so that common effects of a case cancel in their differences: cases are resampled
/// with replacement, the same ones for all candidates, and differences of scores are compared with their bootstrap
/// variation, each in units of its own standard deviation. The critical value is that of the largest deviation of any
/// pair: it is exceeded with a probability of at most `alpha` (family-wise). That is Hsu's comparison with the best
/// (The Annals of Statistics 9 (1981) 1026) with the critical value of all pairs, so that it does not matter that the
/// best was found with the same cases. Candidates beyond it are eliminated, and the rest is compared again, as in the
/// model confidence set of Hansen, Lunde and Nason (Econometrica 79 (2011) 453). Bonferroni's correction would be valid
/// too, but ignores the correlation of candidates: neighbouring base placements have nearly the same outcomes.
///
/// Asymptotic in the number of cases, and tested: over 300 synthetic sets the best is in it in 95 %.
pub(crate) struct Race<'a> {
    objective: Objective,
    values: Vec<&'a [CaseWorth]>,
    /// By candidate.
    scores: Vec<f64>,
    /// By candidate and resample.
    resampled: Vec<Vec<f64>>,
}

impl<'a> Race<'a> {
    /// Of candidates that all have the same cases.
    ///
    /// # Panics
    /// If their numbers of cases differ.
    pub(crate) fn new(objective: Objective, values: Vec<&'a [CaseWorth]>, seed: u64) -> Self {
        let cases = values.first().map_or(0, |first| first.len());
        assert!(values.iter().all(|each| each.len() == cases));
        let mut race = Self {
            objective,
            scores: Vec::new(),
            resampled: Vec::new(),
            values,
        };
        race.scores = (0..race.values.len())
            .map(|index| {
                let score = objective.score(race.values[index]);
                if matches!(objective, Objective::Margin { .. }) {
                    score.max(LEAST_MARGIN_MM)
                } else {
                    score
                }
            })
            .collect();
        if cases >= FEWEST_CASES {
            race.resample(cases, seed);
        }
        race
    }

    fn resample(&mut self, cases: usize, seed: u64) {
        let order: Vec<Vec<u32>> = self
            .values
            .iter()
            .map(|values| {
                let mut order: Vec<u32> = (0..).take(cases).collect();
                order.sort_by(|&a, &b| {
                    let [a, b] = [a, b].map(|at| values[at as usize].margin_mm);
                    a.total_cmp(&b)
                });
                order
            })
            .collect();
        self.resampled = vec![Vec::with_capacity(RESAMPLES); self.values.len()];
        let bound = u32::try_from(cases).expect("far fewer cases than 2^32");
        let mut random = SplitMix64::new(seed ^ 0x5bd1_e995_9d1b_54a3);
        let mut counts = vec![0_u32; cases];
        for _ in 0..RESAMPLES {
            counts.fill(0);
            for _ in 0..cases {
                counts[random.below(bound) as usize] += 1;
            }
            for (candidate, scores) in self.resampled.iter_mut().enumerate() {
                let values = self.values[candidate];
                scores.push(match self.objective {
                    Objective::Margin { quantile } => {
                        counted_quantile(values, &order[candidate], &counts, quantile)
                    }
                    Objective::Rate => {
                        counted_mean(values, &counts, |each| f64::from(u8::from(each.works)))
                    }
                    Objective::TipError { without_mm } => -counted_mean(values, &counts, |each| {
                        each.tip_error_mm.unwrap_or(without_mm)
                    }),
                    Objective::LesionProbability => {
                        counted_mean(values, &counts, CaseWorth::in_lesion)
                    }
                });
            }
        }
    }

    /// Whether `a` is significantly better than `b`, at a critical value.
    fn is_better(&self, a: usize, b: usize, yardstick: f64) -> bool {
        if self.resampled.is_empty() {
            return false;
        }
        let difference = self.scores[a] - self.scores[b];
        difference > 0.0 && difference > yardstick * self.deviation(a, b)
    }

    /// Standard deviation of the difference of two scores.
    fn deviation(&self, a: usize, b: usize) -> f64 {
        let difference = self.scores[a] - self.scores[b];
        let squares = self
            .differences(a, b)
            .map(|each| (each - difference).powi(2));
        (squares.sum::<f64>() / RESAMPLES as f64).sqrt()
    }

    fn differences(&self, a: usize, b: usize) -> impl Iterator<Item = f64> {
        let pairs = self.resampled[a].iter().zip(&self.resampled[b]);
        pairs.map(|(a, b)| a - b)
    }

    /// The value that the largest deviation of any pair of some candidates exceeds with a probability of `alpha`, in
    /// units of its own standard deviation.
    fn yardstick(&self, among: &[usize], alpha: f64) -> f64 {
        if self.resampled.is_empty() {
            return f64::INFINITY;
        }
        let mut largest = vec![0.0_f64; RESAMPLES];
        for (index, &a) in among.iter().enumerate() {
            for &b in &among[..index] {
                let deviation = self.deviation(a, b);
                if deviation == 0.0 {
                    continue;
                }
                let difference = self.scores[a] - self.scores[b];
                for (largest, each) in largest.iter_mut().zip(self.differences(a, b)) {
                    *largest = largest.max((each - difference).abs() / deviation);
                }
            }
        }
        largest.sort_unstable_by(f64::total_cmp);
        super::objective::lower_quantile(&largest, 1.0 - alpha)
    }

    /// Whether each candidate is not significantly different from the best, family-wise error rate `alpha`.
    pub(crate) fn equals(&self, alpha: f64) -> Vec<bool> {
        let mut among: Vec<usize> = (0..self.values.len()).collect();
        loop {
            let yardstick = self.yardstick(&among, alpha);
            let best = among.iter().copied().reduce(|a, b| {
                if self.scores[b] > self.scores[a] {
                    b
                } else {
                    a
                }
            });
            let Some(best) = best else { break };
            // Whoever is told from any is told from the best or from who is: the best decides.
            let kept: Vec<usize> = among
                .iter()
                .copied()
                .filter(|&each| !self.is_better(best, each, yardstick))
                .collect();
            if kept.len() == among.len() {
                break;
            }
            among = kept;
        }
        let mut equals = vec![false; self.values.len()];
        for index in among {
            equals[index] = true;
        }
        equals
    }

    /// For each pair whether the first is significantly better, by the critical value of all pairs.
    pub(super) fn told_apart(&self, alpha: f64) -> Vec<Vec<bool>> {
        let all: Vec<usize> = (0..self.values.len()).collect();
        let yardstick = self.yardstick(&all, alpha);
        all.iter()
            .map(|&a| {
                all.iter()
                    .map(|&b| self.is_better(a, b, yardstick))
                    .collect()
            })
            .collect()
    }
}

fn counted_quantile(values: &[CaseWorth], order: &[u32], counts: &[u32], p: f64) -> f64 {
    let (index, share) = quantile_position(values.len() as u64, p);
    let mut passed = 0;
    let mut low = None;
    for &at in order {
        let count = u64::from(counts[at as usize]);
        if count == 0 {
            continue;
        }
        passed += count;
        let value = values[at as usize].margin_mm.max(LEAST_MARGIN_MM);
        if low.is_none() && passed > index {
            low = Some(value);
        }
        if passed > index + 1 || (passed > index && share == 0.0) {
            let low = low.unwrap_or(value);
            return low + share * (value - low);
        }
    }
    low.unwrap_or(LEAST_MARGIN_MM)
}

fn counted_mean(values: &[CaseWorth], counts: &[u32], of: impl Fn(&CaseWorth) -> f64) -> f64 {
    let pairs = values.iter().zip(counts);
    let sum: f64 = pairs
        .map(|(value, &count)| f64::from(count) * of(value))
        .sum();
    sum / values.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Margins of candidates that share most of what varies: a common part and one of their own.
    fn cases(truths: &[f64], cases: usize, seed: u64) -> Vec<Vec<CaseWorth>> {
        let mut random = SplitMix64::new(seed);
        let mut all = vec![Vec::new(); truths.len()];
        for _ in 0..cases {
            let common = 3.0 * random.standard_normal();
            for (truth, values) in truths.iter().zip(&mut all) {
                let margin_mm = truth + common + random.standard_normal();
                values.push(CaseWorth {
                    margin_mm,
                    works: margin_mm >= 0.0,
                    tip_error_mm: Some(10.0 - margin_mm),
                    lesion_probability: None,
                });
            }
        }
        all
    }

    fn slices(values: &[Vec<CaseWorth>]) -> Vec<&[CaseWorth]> {
        values.iter().map(Vec::as_slice).collect()
    }

    const OBJECTIVES: [Objective; 3] = [
        Objective::Margin { quantile: 0.05 },
        Objective::Rate,
        Objective::TipError { without_mm: 10.0 },
    ];

    /// The best is in the set in 95 % of the sets, within chance; and the set is no list of all.
    #[test]
    fn the_set_has_the_best_as_often_as_it_says() {
        const SETS: u64 = 300;
        // 0.95 of 300 less two standard deviations of a binomial distribution.
        const LEAST: usize = 277;
        let truths: Vec<f64> = (0..12).map(|k| 4.0 - 0.25 * f64::from(k)).collect();
        for objective in OBJECTIVES {
            let (mut has_best, mut size) = (0, 0);
            for seed in 0..SETS {
                let cases = cases(&truths, 128, 1000 + seed);
                let equals = Race::new(objective, slices(&cases), seed).equals(0.05);
                has_best += usize::from(equals[0]);
                size += equals.iter().filter(|&&each| each).count();
            }
            assert!(has_best >= LEAST, "{objective:?}: {has_best}");
            assert!(size < 10 * 300, "{objective:?}: {size}");
        }
    }

    #[test]
    fn equals_stay_together_and_what_is_worse_falls() {
        let cases = cases(&[5.0, 5.0, 5.0, 1.0], 128, 3);
        for objective in OBJECTIVES {
            let found = Race::new(objective, slices(&cases), 1).equals(0.05);
            assert_eq!(found, [true, true, true, false], "{objective:?}");
        }
    }

    #[test]
    fn few_cases_tell_nothing_apart() {
        let cases = cases(&[50.0, 0.0], FEWEST_CASES - 1, 3);
        let race = Race::new(OBJECTIVES[0], slices(&cases), 1);
        assert_eq!(race.equals(0.05), [true, true]);
    }

    #[test]
    fn layouts_that_cannot_exist_are_told_apart() {
        let mut cases = cases(&[5.0, 5.0], 64, 3);
        for value in &mut cases[1] {
            value.margin_mm = f64::NEG_INFINITY;
        }
        let race = Race::new(OBJECTIVES[0], slices(&cases), 1);
        assert_eq!(race.equals(0.05), [true, false]);
    }
}
