//! Level: how far the end of expiration moves with time.

use serde::Serialize;

use crate::breaths::End;
use crate::interval::{Estimate, root_mean_square};

/// Times after which the level is compared, s.
const AFTER_S: [f64; 5] = [5.0, 15.0, 30.0, 60.0, 120.0];

/// Level against that of some time before.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LevelChange {
    /// The time, s.
    pub after_s: f64,
    /// Pairs of ends of expiration that are so far apart.
    pub pairs: usize,
    /// Root mean square of the differences, m. No interval where the recording is shorter than twice the time.
    pub rms_m: Estimate,
    /// Largest difference, m.
    pub worst_m: f64,
    /// The differences, m.
    #[serde(skip)]
    pub changes_m: Vec<f64>,
}

/// Standard deviation of the level a time after it was seen: `sqrt(at_once^2 + (per_s t)^2)`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LevelLaw {
    /// At once: from one end of expiration to the next; m, or share of the amplitude.
    pub at_once: f64,
    /// Growth, per second of the same.
    pub per_s: f64,
}

/// Differences of each end of expiration to that which is nearest to a time before it, at most half a period off.
///
/// The interval is that of a chi-square variable. Differences overlap, so fewer are independent: of `n` differences
/// over `k` breaths, `n / (3/2 + 2 sum (1 - j/n) (1 - j/k)^2)`, `j` from 1 to `k`. The sum is of a random walk, whose
/// differences correlate by `1 - j/k`; the half is of independent ends, which two differences share.
pub(crate) fn level_changes(ends: &[End], duration_s: f64, period_s: f64) -> Vec<LevelChange> {
    let changes = AFTER_S.iter().filter_map(|&after_s| {
        let mut nearest = 0;
        let changes_m: Vec<f64> = ends
            .iter()
            .enumerate()
            .filter_map(|(index, end)| {
                let before_s = end.time_s - after_s;
                let off_s = |at: usize| (ends[at].time_s - before_s).abs();
                while nearest + 1 < index && off_s(nearest + 1) <= off_s(nearest) {
                    nearest += 1;
                }
                let fits = nearest < index && off_s(nearest) <= 0.5 * period_s;
                fits.then(|| end.displacement_m - ends[nearest].displacement_m)
            })
            .collect();
        if changes_m.is_empty() {
            return None;
        }
        let count = changes_m.len() as f64;
        let breaths = (after_s / period_s).max(1.0);
        let mut overlap = 0.0;
        let mut j = 1.0;
        while j < breaths.min(count) {
            overlap += (1.0 - j / count) * (1.0 - j / breaths) * (1.0 - j / breaths);
            j += 1.0;
        }
        let mut independent = count / (1.5 + 2.0 * overlap);
        if duration_s < 2.0 * after_s {
            independent = 0.0;
        }
        Some(LevelChange {
            after_s,
            pairs: changes_m.len(),
            rms_m: root_mean_square(&changes_m, independent),
            worst_m: changes_m
                .iter()
                .map(|change| change.abs())
                .fold(0.0, f64::max),
            changes_m,
        })
    });
    changes.collect()
}

impl LevelLaw {
    /// The law whose squares are nearest to those of root mean squares at their times, relative to these; neither term
    /// is below zero. None of fewer than two.
    pub(crate) fn fitted(points: &[[f64; 2]]) -> Option<Self> {
        if points.len() < 2 || points.iter().any(|[_, rms]| *rms <= 0.0 || rms.is_nan()) {
            return None;
        }
        // Minimises the sum of ((x + y t^2) / rms^2 - 1)^2.
        let (mut xx, mut xy, mut yy, mut x, mut y) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for [time_s, rms] in points {
            let (one, square) = (1.0 / (rms * rms), time_s * time_s / (rms * rms));
            xx += one * one;
            xy += one * square;
            yy += square * square;
            x += one;
            y += square;
        }
        let determinant = xx * yy - xy * xy;
        let (at_once, per_s) = (
            (x * yy - y * xy) / determinant,
            (y * xx - x * xy) / determinant,
        );
        let (at_once, per_s) = if per_s < 0.0 {
            (x / xx, 0.0)
        } else if at_once < 0.0 {
            (0.0, y / yy)
        } else {
            (at_once, per_s)
        };
        Some(Self {
            at_once: at_once.sqrt(),
            per_s: per_s.sqrt(),
        })
    }

    /// Standard deviation a time after the level was seen.
    pub fn after(&self, time_s: f64) -> f64 {
        libm::hypot(self.at_once, self.per_s * time_s)
    }
}
