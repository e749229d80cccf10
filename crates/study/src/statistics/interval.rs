//! Confidence intervals, all of 95 %.

use serde::{Deserialize, Serialize};

/// Confidence of every interval.
pub const CONFIDENCE: f64 = 0.95;

/// 97.5 % quantile of the standard normal distribution.
const Z: f64 = 1.959_963_984_540_054;

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
    /// Wilson score interval of the share.
    pub interval: Option<Interval>,
    /// Independent layouts that tell as much: less than `of` where the same sampled points appear
    /// in several layouts.
    pub effective_size: f64,
    /// What to keep in mind, in words; none for a sample that is large enough.
    pub remark: Option<String>,
}

impl Rate {
    /// A rate of layouts that are `design_effect` times less worth than independent ones.
    pub fn new(successes: u64, of: u64, design_effect: f64) -> Self {
        let effective_size = of as f64 / design_effect.max(1.0);
        let rate = (of > 0).then(|| successes as f64 / of as f64);
        let failures = of - successes;
        let remark = if of == 0 {
            Some("no layouts".to_owned())
        } else if effective_size < SMALL_SAMPLE {
            Some(format!(
                "small sample: worth {effective_size:.0} independent layouts"
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
            interval: rate.map(|rate| wilson(rate, effective_size)),
            effective_size,
            remark,
        }
    }
}

/// Wilson's score interval of a share that was seen in `size` independent trials.
pub fn wilson(share: f64, size: f64) -> Interval {
    if size <= 0.0 {
        return Interval {
            low: 0.0,
            high: 1.0,
        };
    }
    let z2 = Z * Z;
    let scale = 1.0 + z2 / size;
    let centre = (share + z2 / (2.0 * size)) / scale;
    let half = Z / scale * (share * (1.0 - share) / size + z2 / (4.0 * size * size)).sqrt();
    // Rounding must not push the end of an observed 0 or 1 off it.
    Interval {
        low: if share <= 0.0 {
            0.0
        } else {
            (centre - half).max(0.0)
        },
        high: if share >= 1.0 {
            1.0
        } else {
            (centre + half).min(1.0)
        },
    }
}

/// 97.5 % quantile of Student's distribution. Tabulated to 10 degrees of freedom, above that the
/// expansion of Abramowitz and Stegun 26.7.5 to its third term, right to 1e-4.
pub(crate) fn student(degrees_of_freedom: usize) -> f64 {
    const TABLE: [f64; 10] = [
        12.7062, 4.3027, 3.1824, 2.7764, 2.5706, 2.4469, 2.3646, 2.3060, 2.2622, 2.2281,
    ];
    if degrees_of_freedom == 0 {
        return f64::INFINITY;
    }
    if let Some(value) = TABLE.get(degrees_of_freedom - 1) {
        return *value;
    }
    let n = degrees_of_freedom as f64;
    let z = Z;
    let (z3, z5, z7) = (z.powi(3), z.powi(5), z.powi(7));
    z + (z3 + z) / (4.0 * n)
        + (5.0 * z5 + 16.0 * z3 + 3.0 * z) / (96.0 * n * n)
        + (3.0 * z7 + 19.0 * z5 + 17.0 * z3 - 15.0 * z) / (384.0 * n * n * n)
}

/// Interval of a mean from its standard error.
pub(crate) fn about_mean(mean: f64, standard_error: f64, degrees_of_freedom: usize) -> Interval {
    let half = student(degrees_of_freedom) * standard_error;
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
/// with at least 95 %: each end is outside with at most 2.5 %. None for an end that the sample is
/// too small for.
pub(crate) fn quantile_ranks(n: u64, p: f64) -> (Option<u64>, Option<u64>) {
    const TAIL: f64 = 0.5 * (1.0 - CONFIDENCE);
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
        if below > TAIL {
            break;
        }
        low = Some(k + 1);
    }
    // The upper end x_(u) is below the quantile where at least u values are: B >= u.
    let mut above = 0.0;
    let mut high = None;
    for (k, term) in terms.iter().rev() {
        above += term / all;
        if above > TAIL {
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
    fn wilson_is_that_of_the_literature() {
        // Newcombe, Statistics in Medicine 17 (1998), Table I, method 3: to its four digits.
        for (successes, of, low, high) in [
            (81, 263, 0.2553, 0.3662),
            (15, 148, 0.0624, 0.1605),
            (0, 20, 0.0, 0.1611),
            (1, 29, 0.0061, 0.1718),
        ] {
            let found = wilson(f64::from(successes) / f64::from(of), f64::from(of));
            assert!((found.low - low).abs() < 5e-5, "{found:?}");
            assert!((found.high - high).abs() < 5e-5, "{found:?}");
        }
    }

    #[test]
    fn small_samples_are_called_so() {
        let remark = |successes, of, effect| Rate::new(successes, of, effect).remark;
        assert_eq!(remark(50, 100, 1.0), None);
        assert!(remark(10, 20, 1.0).unwrap().contains("20 independent"));
        assert!(remark(50, 100, 10.0).unwrap().contains("10 independent"));
        assert!(remark(99, 100, 1.0).unwrap().contains("1 failures"));
        assert!(remark(2, 100, 1.0).unwrap().contains("2 successes"));
        assert_eq!(Rate::new(0, 0, 1.0).rate, None);
    }

    #[test]
    fn student_is_that_of_the_tables() {
        for (n, expected) in [(1, 12.7062), (11, 2.2010), (30, 2.0423), (63, 1.9983)] {
            assert!((student(n) - expected).abs() < 2e-4, "{n}: {}", student(n));
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
        assert_eq!(quantile_ranks(20, 0.5), (Some(6), Some(15)));
        // (1 - 0.05)^72 = 0.0249 is the first below 2.5 %.
        assert_eq!(quantile_ranks(71, 0.05).0, None);
        assert_eq!(quantile_ranks(72, 0.05).0, Some(1));
        assert_eq!(quantile_ranks(5, 0.5), (None, None));
        let (low, high) = quantile_ranks(1_000_000, 0.5);
        // Normal approximation 500 000 -+ 980.
        assert!(low.unwrap().abs_diff(499_020) < 3 && high.unwrap().abs_diff(500_981) < 3);
    }
}
