//! Speeds and accelerations of what was recorded without them.

use std::ops::Range;

use nalgebra::{Matrix4, Vector4};
use needlebench_kinematics::Joints;

/// Rows on each side of the one whose slope is taken.
const REACH: usize = 4;

/// Slope of values over time at every row: of the cubic that fits best to nine rows, fewer at the ends
/// of a stretch (Savitzky and Golay, Analytical Chemistry 36, 1964, for uneven times).
///
/// Exact for cubics; a stretch of fewer than four rows has the slope of its ends.
pub(crate) fn slopes(time_s: &[f64], values: &[Joints], stretches: &[Range<usize>]) -> Vec<Joints> {
    let mut slopes = vec![Joints::zeros(); values.len()];
    for rows in stretches {
        for row in rows.clone() {
            let from = row.saturating_sub(REACH).max(rows.start);
            let to = (row + REACH + 1).min(rows.end);
            slopes[row] = slope(time_s, values, row, from..to);
        }
    }
    slopes
}

fn slope(time_s: &[f64], values: &[Joints], row: usize, window: Range<usize>) -> Joints {
    let span_s = time_s[window.end - 1] - time_s[window.start];
    if span_s <= 0.0 {
        return Joints::zeros();
    }
    let powers = |at: usize| {
        let u = (time_s[at] - time_s[row]) / span_s;
        Vector4::new(1.0, u, u * u, u * u * u)
    };
    if window.len() < 4 {
        return (values[window.end - 1] - values[window.start]) / span_s;
    }
    let normal: Matrix4<f64> = window
        .clone()
        .map(|at| powers(at) * powers(at).transpose())
        .sum();
    let Some(inverse) = normal.try_inverse() else {
        return (values[window.end - 1] - values[window.start]) / span_s;
    };
    // Weight of each row in the linear coefficient.
    let linear = inverse.row(1).transpose();
    window
        .map(|at| values[at] * (linear.dot(&powers(at)) / span_s))
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cubics_have_their_slopes_at_uneven_times() {
        let time_s: Vec<f64> = (0..40)
            .map(|k| 0.01 * f64::from(k) + 0.002 * f64::from(k % 3))
            .collect();
        let value = |t: f64| Joints::from_fn(|i, _| i as f64 + t - 3.0 * t * t + 2.0 * t.powi(3));
        let values: Vec<Joints> = time_s.iter().map(|t| value(*t)).collect();
        let found = slopes(&time_s, &values, &[0..25, 25..40]);
        for (t, slope) in time_s.iter().zip(found) {
            let wanted = 1.0 - 6.0 * t + 6.0 * t * t;
            assert!((slope - Joints::repeat(wanted)).amax() < 1e-8);
        }
    }
}
