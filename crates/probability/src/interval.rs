//! Confidence intervals, all of 95 %.

use needlebench_numerics::beta;

/// Confidence of every interval.
pub const CONFIDENCE: f64 = 0.95;

/// No probability below this is printed as a number.
pub const LEAST_PRINTED: f64 = 1e-6;

/// Probability that the true value is beyond one end.
const TAIL: f64 = 0.5 * (1.0 - CONFIDENCE);

/// Quantile of the normal distribution that belongs to it.
pub(crate) const SIDES: f64 = 1.959_963_984_540_054;

/// Both ends of a confidence interval of a probability, or of a difference of two.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Interval {
    /// Whether a value is inside.
    pub fn contains(self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }
}

/// Of a probability from `hits` of `draws` plain draws: Clopper and Pearson, Biometrika 26 (1934) 404. No hit of n: up
/// to 3.7/n. It is never too narrow; draws in strata make it too wide.
pub fn share_interval(hits: u64, draws: u64) -> Interval {
    let [low, high] = beta::clopper_pearson(hits as f64 / draws as f64, draws as f64, TAIL);
    Interval { low, high }
}

/// Of a probability from weighted draws: their mean and its standard error, from the sum of the weights of all hits,
/// that of their squares, and how many draws there were. Normal in the logarithm, as a probability has no negative
/// part; [0, 1] without hits.
pub fn weighted_interval(sum: f64, sum_of_squares: f64, draws: u64) -> Interval {
    let count = draws as f64;
    let mean = sum / count;
    let error = standard_error(sum, sum_of_squares, draws);
    if mean <= 0.0 || !error.is_finite() {
        return Interval {
            low: 0.0,
            high: 1.0,
        };
    }
    let factor = libm::exp(SIDES * error / mean);
    Interval {
        low: mean / factor,
        high: (mean * factor).min(1.0),
    }
}

/// Of the mean of weights, 0 for misses.
pub(crate) fn standard_error(sum: f64, sum_of_squares: f64, draws: u64) -> f64 {
    let count = draws as f64;
    let mean = sum / count;
    ((sum_of_squares / count - mean * mean).max(0.0) / (count - 1.0)).sqrt()
}

/// How much likelier an event is in a first case than in a second one, on the same draws.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Difference {
    /// Draws in which it happens in the first case only.
    pub only_first: u64,
    /// Draws in which it happens in the second case only.
    pub only_second: u64,
    /// Draws.
    pub draws: u64,
}

impl Difference {
    /// Probability in the first case less that in the second one.
    pub fn value(&self) -> f64 {
        (self.only_first as f64 - self.only_second as f64) / self.draws as f64
    }

    /// Its interval: Clopper and Pearson's of each share with half the error each; never too narrow.
    pub fn interval(&self) -> Interval {
        let share = |count: u64| {
            let size = self.draws as f64;
            beta::clopper_pearson(count as f64 / size, size, 0.5 * TAIL)
        };
        let ([first_low, first_high], [second_low, second_high]) =
            (share(self.only_first), share(self.only_second));
        Interval {
            low: first_low - second_high,
            high: first_high - second_low,
        }
    }

    /// Whether the two are not significantly different: 0 is within the interval.
    pub fn is_tied(&self) -> bool {
        self.interval().contains(0.0)
    }
}
