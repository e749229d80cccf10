//! Drift: the slope of the ends of expiration over time.

use crate::breaths::End;
use crate::interval::{Estimate, student};

/// Ratios of the variance that a random walk gains in a breath to that of single ends: from hardly any walk to hardly
/// anything else, by half a decade.
const FROM: f64 = 1e-4;
const STEP: f64 = 3.162_277_660_168_379_5;
const STEPS: u32 = 17;

/// One ratio: what the slope is by it, and how likely it makes the ends.
struct Fit {
    slope: f64,
    variance: f64,
    log_likelihood: f64,
}

/// Slope of a line through ends of expiration, m/s, whose level walks at random besides: displacement = line + random
/// walk + what is of one end alone (Harvey, *Forecasting, Structural Time Series Models and the Kalman Filter*, 1989,
/// 2.4).
///
/// For each ratio of both variances the slope by generalised least squares, by a Kalman filter that begins with the
/// first end; ratios are averaged by their restricted likelihood, so that the interval has what is not known of them.
/// The interval is Student's with two degrees of freedom fewer than ends.
pub(crate) fn drift_m_per_s(ends: &[End], period_s: f64) -> Estimate {
    if ends.len() < 4 {
        return Estimate::symmetric(f64::NAN, f64::NAN);
    }
    let degrees = ends.len() as f64 - 2.0;
    let ratios = (0..STEPS).scan(FROM, |ratio, _| {
        let here = *ratio;
        *ratio *= STEP;
        Some(here)
    });
    let fits: Vec<Fit> = ratios
        .map(|ratio| fit(ends, ratio / period_s, degrees))
        .collect();
    let best = fits
        .iter()
        .map(|fit| fit.log_likelihood)
        .fold(f64::NEG_INFINITY, f64::max);
    let weights: Vec<f64> = fits
        .iter()
        .map(|fit| libm::exp(fit.log_likelihood - best))
        .collect();
    let all: f64 = weights.iter().sum();
    let average = |value: &dyn Fn(&Fit) -> f64| {
        let both = fits.iter().zip(&weights);
        both.map(|(fit, weight)| weight * value(fit)).sum::<f64>() / all
    };
    let slope = average(&|fit| fit.slope);
    let variance = average(&|fit| fit.variance + (fit.slope - slope) * (fit.slope - slope));
    Estimate::symmetric(slope, student(degrees) * variance.sqrt())
}

/// With the variance of single ends as the unit: the walk gains `per_s` in a second.
fn fit(ends: &[End], per_s: f64, degrees: f64) -> Fit {
    let (first, mut before_s) = (ends[0], ends[0].time_s);
    // Level by the ends so far, and the same of their times; its variance.
    let (mut level, mut time, mut variance) = (first.displacement_m, 0.0, 1.0);
    let (mut tt, mut tx, mut xx, mut log_variances) = (0.0, 0.0, 0.0, 0.0);
    for end in &ends[1..] {
        variance += per_s * (end.time_s - before_s);
        before_s = end.time_s;
        let (off, off_time) = (end.displacement_m - level, end.time_s - first.time_s - time);
        let predicted = variance + 1.0;
        tt += off_time * off_time / predicted;
        tx += off_time * off / predicted;
        xx += off * off / predicted;
        log_variances += libm::log(predicted);
        let gain = variance / predicted;
        level += gain * off;
        time += gain * off_time;
        variance *= 1.0 - gain;
    }
    let slope = tx / tt;
    let scale = ((xx - slope * tx) / degrees).max(f64::MIN_POSITIVE);
    Fit {
        slope,
        variance: scale / tt,
        log_likelihood: -0.5 * (degrees * libm::log(scale) + log_variances + libm::log(tt)),
    }
}
