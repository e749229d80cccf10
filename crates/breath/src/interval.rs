//! Values with 95 % intervals, from breaths that are not independent of each other.

use needlebench_numerics::{chi_square, student};
use serde::Serialize;

/// Probability above, and below, a 95 % interval.
const TAIL: f64 = 0.025;

/// Values from which a correlation from one to the next is told.
const LEAST_CORRELATED: usize = 8;

/// Correlation at most: beyond it a mean of a recording says nothing.
const MOST_CORRELATION: f64 = 0.9;

/// A value and how far it is known.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Estimate {
    /// The value, in the unit of its name.
    pub value: f64,
    /// Its 95 % interval; none where the recording does not tell it.
    pub interval_95: Option<[f64; 2]>,
}

impl Estimate {
    pub(crate) fn symmetric(value: f64, half: f64) -> Self {
        let is_told = half.is_finite() && half > 0.0;
        Self {
            value,
            interval_95: is_told.then_some([value - half, value + half]),
        }
    }

    /// With an interval that ends where the value cannot go on.
    fn between(self, least: f64, most: f64) -> Self {
        let interval_95 = self
            .interval_95
            .map(|each| each.map(|bound| bound.clamp(least, most)));
        Self {
            interval_95,
            ..self
        }
    }

    /// Of a positive value whose logarithm is known.
    pub(crate) fn of_logarithm(value: f64, half: f64) -> Self {
        let is_told = half.is_finite() && half > 0.0 && value > 0.0;
        let factor = libm::exp(half);
        Self {
            value,
            interval_95: is_told.then_some([value / factor, value * factor]),
        }
    }
}

/// Student's 97.5 % quantile.
pub(crate) fn student(degrees_of_freedom: f64) -> f64 {
    student::exceeded_with(TAIL, degrees_of_freedom)
}

pub(crate) fn mean_of(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Mean of the powers of what is off the mean, of a degree.
fn moment(values: &[f64], degree: i32) -> f64 {
    let mean = mean_of(values);
    values
        .iter()
        .map(|value| (value - mean).powi(degree))
        .sum::<f64>()
        / values.len() as f64
}

/// Correlation of each value with the next: that of the sample, less its bias of -(1 + 4 rho) / n (Kendall, Biometrika
/// 41 (1954) 403); none of negative ones, which would make intervals narrower, and none of fewer than 8 values.
fn correlation(values: &[f64]) -> f64 {
    let (count, spread) = (values.len() as f64, moment(values, 2));
    if values.len() < LEAST_CORRELATED || spread <= 0.0 {
        return 0.0;
    }
    let mean = mean_of(values);
    let products = values
        .windows(2)
        .map(|pair| (pair[0] - mean) * (pair[1] - mean));
    let sample = products.sum::<f64>() / (count * spread);
    ((count * sample + 1.0) / (count - 4.0)).clamp(0.0, MOST_CORRELATION)
}

/// As many independent values have a mean as good as these have.
fn independent(values: &[f64]) -> f64 {
    let rho = correlation(values);
    values.len() as f64 * (1.0 - rho) / (1.0 + rho)
}

/// Half of the interval of a sum of residuals over a count, which are those of a mean or of a ratio.
fn half_interval(residuals: &[f64], over: f64) -> f64 {
    let count = residuals.len() as f64;
    let independent = independent(residuals);
    let variance = moment(residuals, 2) * count / (count - 1.0);
    // Of the sum: the variance of one times their number, times what the correlation adds.
    let deviation = (variance * count * count / independent).sqrt() / over;
    student((independent - 1.0).max(1.0)) * deviation
}

/// Mean of positive values: Student's interval with the number of independent values.
pub(crate) fn mean(values: &[f64]) -> Estimate {
    if values.is_empty() {
        return Estimate::symmetric(f64::NAN, f64::NAN);
    }
    let half = half_interval(values, values.len() as f64);
    Estimate::symmetric(mean_of(values), half).between(0.0, f64::INFINITY)
}

/// Standard deviation over mean, of positive values. The interval is that of the logarithm, with the variance of the
/// standard deviation by the kurtosis of the values and by their correlation, and that of the mean.
pub(crate) fn variation(values: &[f64]) -> Estimate {
    let count = values.len() as f64;
    let (mean, spread) = (mean_of(values), moment(values, 2));
    let value = (spread * count / (count - 1.0)).sqrt() / mean;
    if value.is_nan() || value <= 0.0 {
        return Estimate::symmetric(value, f64::NAN);
    }
    let excess = (moment(values, 4) / (spread * spread) - 3.0).max(0.0);
    let rho = correlation(values);
    let correlated = (1.0 + rho * rho) / (1.0 - rho * rho);
    let degrees = 2.0 / (correlated * (excess / count + 2.0 / (count - 1.0)));
    let variance = 1.0 / (2.0 * degrees) + value * value / independent(values);
    Estimate::of_logarithm(value, student(degrees.max(1.0)) * variance.sqrt())
}

/// Sum over sum, of one pair for each breath, and half of Student's interval of the linearised ratio (Cochran, *Sampling
/// Techniques*, 1977, 6.4).
fn linearised(pairs: &[[f64; 2]]) -> (f64, f64) {
    let [above, below] = [0, 1].map(|part| pairs.iter().map(|pair| pair[part]).sum::<f64>());
    let value = above / below;
    let residuals: Vec<f64> = pairs.iter().map(|pair| pair[0] - value * pair[1]).collect();
    (value, half_interval(&residuals, below))
}

/// Share that the first of each pair is of the second.
pub(crate) fn share(pairs: &[[f64; 2]]) -> Estimate {
    let (value, half) = linearised(pairs);
    Estimate::symmetric(value, half).between(0.0, 1.0)
}

/// Root of a ratio that is a variance.
pub(crate) fn root_of_ratio(pairs: &[[f64; 2]]) -> Estimate {
    let (value, half) = linearised(pairs);
    // The logarithm of the root changes by half of that of the variance.
    Estimate::of_logarithm(value.sqrt(), 0.5 * half / value)
}

/// Root of the mean square of differences of mean zero, of which so many are independent: chi-square interval.
pub(crate) fn root_mean_square(values: &[f64], independent: f64) -> Estimate {
    let square = values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64;
    let bound = |p: f64| (independent * square / chi_square::exceeded_with(p, independent)).sqrt();
    let is_told = independent >= 1.0 && square > 0.0;
    Estimate {
        value: square.sqrt(),
        interval_95: is_told.then(|| [bound(TAIL), bound(1.0 - TAIL)]),
    }
}
