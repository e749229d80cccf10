//! Confidence intervals, all of 95 %.

use serde::{Deserialize, Serialize};

use needlebench_numerics::{beta, student};

/// Confidence of every interval.
pub const CONFIDENCE: f64 = 0.95;

/// Probability that the true value is beyond one end of an interval.
pub(crate) const TAIL: f64 = 0.5 * (1.0 - CONFIDENCE);

/// Below this many layouts a rate is called a small sample.
pub const SMALL_SAMPLE: f64 = 30.0;

/// Below this many successes or failures a rate is called a small sample.
pub const FEW_EVENTS: u64 = 5;

/// Both ends of a confidence interval, in the unit of what it is of.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Interval {
    /// Whether two intervals have a point in common.
    pub fn overlaps(self, other: Self) -> bool {
        self.low <= other.high && other.low <= self.high
    }
}

/// A share of layouts, with its interval.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rate {
    /// Layouts where it holds.
    pub successes: u64,
    /// Layouts in all.
    pub of: u64,
    /// The share, 0 to 1; none of no layouts.
    pub rate: Option<f64>,
    /// Clopper and Pearson's interval of the share, of [`Rate::effective_size`] trials.
    pub interval: Option<Interval>,
    /// Effective sample size: less than `of` where the same sampled points appear in several
    /// layouts.
    pub effective_size: f64,
    /// A remark, in words; none for a sample that is large enough.
    pub remark: Option<String>,
}

impl Rate {
    /// A rate with an effective sample size.
    pub fn new(successes: u64, of: u64, effective_size: f64) -> Self {
        Self::with_tail(successes, of, effective_size, TAIL)
    }

    /// The same with another probability that the true value is beyond each end of the interval.
    pub(crate) fn with_tail(successes: u64, of: u64, effective_size: f64, tail: f64) -> Self {
        let effective_size = effective_size.min(of as f64);
        let rate = (of > 0).then(|| successes as f64 / of as f64);
        let failures = of - successes;
        let remark = if of == 0 {
            Some("no layouts".to_owned())
        } else if effective_size < SMALL_SAMPLE {
            Some(format!(
                "small sample: effective sample size {effective_size:.0}"
            ))
        } else if successes < FEW_EVENTS {
            Some(format!("small sample: {successes} successes"))
        } else if failures < FEW_EVENTS {
            Some(format!("small sample: {failures} failures"))
        } else {
            None
        };
        Self {
            successes,
            of,
            rate,
            interval: rate.map(|rate| clopper_pearson_with(rate, effective_size, tail)),
            effective_size,
            remark,
        }
    }
}

/// Clopper and Pearson's interval of a share that was seen in `size` independent trials, which need
/// not be a whole number: Biometrika 26 (1934) 404, by quantiles of the beta distribution.
pub fn clopper_pearson(share: f64, size: f64) -> Interval {
    clopper_pearson_with(share, size, TAIL)
}

/// The same with another probability that the true value is beyond each end.
pub(crate) fn clopper_pearson_with(share: f64, size: f64, tail: f64) -> Interval {
    let [low, high] = beta::clopper_pearson(share, size, tail);
    Interval { low, high }
}

/// Interval of a mean from its standard error.
pub(crate) fn about_mean(mean: f64, standard_error: f64, degrees_of_freedom: usize) -> Interval {
    let half = student::exceeded_with(TAIL, degrees_of_freedom as f64) * standard_error;
    Interval {
        low: mean - half,
        high: mean + half,
    }
}

/// Visits the probabilities of a binomial distribution from its mode downwards, then upwards, as
/// far as they are not negligible; relative to the mode's.
fn binomial_terms(n: u64, p: f64, mut visit: impl FnMut(u64, f64)) {
    const NEGLIGIBLE: f64 = 1e-40;
    let odds = p / (1.0 - p);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 0 and n"
    )]
    let mode = (((n + 1) as f64 * p).floor() as u64).min(n);
    let mut term = 1.0;
    let mut k = mode;
    visit(k, term);
    while k > 0 && term > NEGLIGIBLE {
        term *= k as f64 / ((n - k + 1) as f64 * odds);
        k -= 1;
        visit(k, term);
    }
    term = 1.0;
    k = mode;
    while k < n && term > NEGLIGIBLE {
        term *= (n - k) as f64 * odds / (k + 1) as f64;
        k += 1;
        visit(k, term);
    }
}

/// Probability of at most `k` successes in `n` trials of probability `p`, strictly between 0 and 1.
pub(crate) fn binomial_at_most(k: u64, n: u64, p: f64) -> f64 {
    let (mut below, mut all) = (0.0, 0.0);
    binomial_terms(n, p, |at, term| {
        all += term;
        if at <= k {
            below += term;
        }
    });
    below / all
}

/// Exact two-sided McNemar test: the probability of at least so lopsided a split of the pairs that
/// differ, if either way were as likely.
pub fn mcnemar(one_way: u64, other_way: u64) -> f64 {
    let n = one_way + other_way;
    if n == 0 {
        return 1.0;
    }
    (2.0 * binomial_at_most(one_way.min(other_way), n, 0.5)).min(1.0)
}

/// Ranks, from 1, of the order statistics of `n` independent values between which the quantile lies
/// but for a chance of at most `tail` beyond each end. None for an end that the sample is too small
/// for.
pub(crate) fn quantile_ranks(n: u64, p: f64, tail: f64) -> (Option<u64>, Option<u64>) {
    if n == 0 || p <= 0.0 || p >= 1.0 {
        return (None, None);
    }
    let mut terms = Vec::new();
    binomial_terms(n, p, |k, term| terms.push((k, term)));
    terms.sort_unstable_by_key(|(k, _)| *k);
    let all: f64 = terms.iter().map(|(_, term)| term).sum();
    // The lower end x_(l) is above the quantile where fewer than l values are below it: B <= l - 1.
    let mut below = 0.0;
    let mut low = None;
    for (k, term) in &terms {
        below += term / all;
        if below > tail {
            break;
        }
        low = Some(k + 1);
    }
    // The upper end x_(u) is below the quantile where at least u values are: B >= u.
    let mut above = 0.0;
    let mut high = None;
    for (k, term) in terms.iter().rev() {
        above += term / all;
        if above > tail {
            break;
        }
        high = Some(*k);
    }
    (low.filter(|low| *low <= n), high.filter(|high| *high >= 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clopper_and_pearson_are_those_of_the_literature() {
        // Newcombe, Statistics in Medicine 17 (1998), Table I, method 5: to its four digits.
        for (successes, of, low, high) in [
            (81, 263, 0.2527, 0.3676),
            (15, 148, 0.0578, 0.1617),
            (0, 20, 0.0, 0.1684),
            (1, 29, 0.0009, 0.1776),
        ] {
            let found = clopper_pearson(f64::from(successes) / f64::from(of), f64::from(of));
            assert!((found.low - low).abs() < 5e-5, "{found:?}");
            assert!((found.high - high).abs() < 5e-5, "{found:?}");
        }
    }

    #[test]
    fn ends_are_where_the_binomial_distribution_has_its_tails() {
        // By the sum of the distribution's terms, which know no beta function.
        const ROUNDING: f64 = 1e-9;
        for (k, n) in [(1, 3), (7, 16), (31, 32), (200, 256), (1535, 1536)] {
            let found = clopper_pearson(k as f64 / n as f64, n as f64);
            let above = 1.0 - binomial_at_most(k - 1, n, found.low);
            let below = binomial_at_most(k, n, found.high);
            assert!((above - TAIL).abs() < ROUNDING, "{k} of {n}: {above}");
            assert!((below - TAIL).abs() < ROUNDING, "{k} of {n}: {below}");
        }
    }

    #[test]
    fn small_samples_are_called_so() {
        let remark = |successes, of, size| Rate::new(successes, of, size).remark;
        assert_eq!(remark(50, 100, 100.0), None);
        assert!(remark(10, 20, 20.0).unwrap().contains("sample size 20"));
        assert!(remark(50, 100, 10.0).unwrap().contains("sample size 10"));
        assert!(remark(99, 100, 100.0).unwrap().contains("1 failures"));
        assert!(remark(2, 100, 100.0).unwrap().contains("2 successes"));
        assert_eq!(Rate::new(0, 0, 0.0).rate, None);
    }

    #[test]
    fn student_is_that_of_the_tables() {
        for (n, expected) in [(1, 12.7062), (11, 2.2010), (30, 2.0423), (63, 1.9983)] {
            let found = student::exceeded_with(TAIL, f64::from(n));
            assert!((found - expected).abs() < 5e-5, "{n}: {found}");
        }
    }

    #[test]
    fn mcnemar_is_the_sign_test() {
        assert_eq!(mcnemar(0, 0), 1.0);
        assert!((mcnemar(0, 5) - 0.0625).abs() < 1e-14);
        // 2 (1 + 10 + 45) / 2^10.
        assert!((mcnemar(8, 2) - 112.0 / 1024.0).abs() < 1e-14);
        assert_eq!(mcnemar(500_000, 500_000), 1.0);
        assert!(mcnemar(400_000, 600_000) < 1e-30);
    }

    #[test]
    fn ranks_of_the_median_are_those_of_the_literature() {
        // Conover, Practical Nonparametric Statistics, Table A3: n = 20: 6 and 15.
        assert_eq!(quantile_ranks(20, 0.5, TAIL), (Some(6), Some(15)));
        // (1 - 0.05)^72 = 0.0249 is the first below 2.5 %.
        assert_eq!(quantile_ranks(71, 0.05, TAIL).0, None);
        assert_eq!(quantile_ranks(72, 0.05, TAIL).0, Some(1));
        assert_eq!(quantile_ranks(5, 0.5, TAIL), (None, None));
        let (low, high) = quantile_ranks(1_000_000, 0.5, TAIL);
        // Normal approximation 500 000 -+ 980.
        assert!(low.unwrap().abs_diff(499_020) < 3 && high.unwrap().abs_diff(500_981) < 3);
    }
}
