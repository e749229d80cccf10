//! How far a needle is off along one axis, and along itself.

use nalgebra::Vector3;
use needlebench_numerics::normal;

use super::mixture::{Cells, Fullness, Normal, PHASES, binned, fullnesses, normals};
use crate::breath::Body;
use crate::case::{Anatomy, Case};

/// Standard deviations, and more than what lies beyond.
const FAR: f64 = 9.0;
const BEYOND_FAR: f64 = 2e-19;

/// Cells of the mean of what is normal.
const POOLED: usize = 128;

/// How far a needle is off along itself.
#[expect(clippy::struct_field_names, reason = "all are in metres")]
pub(super) struct Along {
    /// Largest over states of the breath and both ends, m.
    mean_m: f64,
    sd_m: f64,
    failed_m: f64,
}

impl Along {
    pub fn new<A: Anatomy>(case: &Case<'_, A>, body: Body) -> Self {
        let mut along = Self {
            mean_m: 0.0,
            sd_m: 0.0,
            failed_m: 0.0,
        };
        for fraction in [0.0, case.end()] {
            for state in normals(case.law, fraction, body) {
                along.mean_m = along.mean_m.max(state.mean_m.x.abs());
                along.sd_m = along.sd_m.max(state.covariance_m2[(0, 0)].max(0.0).sqrt());
                let failed_m = state.failed_m.map_or(0.0, |full| full.x.abs());
                along.failed_m = along.failed_m.max(failed_m);
            }
        }
        along
    }

    /// Shifts to try, m.
    pub fn shifts_m(&self, times: f64) -> Vec<f64> {
        let held_m = self.mean_m + times * self.sd_m;
        if self.failed_m > 0.0 {
            vec![held_m, held_m + self.failed_m]
        } else {
            vec![held_m]
        }
    }

    /// How likely a station is off by more.
    pub fn beyond<A: Anatomy>(&self, case: &Case<'_, A>, body: Body, shift_m: f64) -> f64 {
        if self.sd_m <= 0.0 && shift_m >= self.mean_m + self.failed_m {
            return 0.0;
        }
        let axes = [Vector3::x(), -Vector3::x()];
        let at = |fraction: f64| -> f64 {
            let states = normals(case.law, fraction, body);
            let each = axes
                .iter()
                .map(|axis| tail(&states, axis, &[(1.0, 0.0)], shift_m, 0.0));
            each.sum()
        };
        at(0.0) + at(case.end())
    }
}

/// How likely a needle and a boundary are off along an axis by a distance or more.
pub(super) fn tail(
    states: &[Normal],
    axis: &Vector3<f64>,
    bends: &[(f64, f64)],
    distance_m: f64,
    boundary_sd_m: f64,
) -> f64 {
    let fullnesses = fullnesses(PHASES);
    tail_of(
        states,
        axis,
        (bends, &fullnesses),
        distance_m,
        boundary_sd_m,
    )
}

/// The same with these cells of the bend, and of the fullness of a failed hold.
pub(super) fn tail_of(
    states: &[Normal],
    axis: &Vector3<f64>,
    (bends, fullnesses): (&[(f64, f64)], &[Fullness]),
    distance_m: f64,
    boundary_sd_m: f64,
) -> f64 {
    // Cells of the mean by variance: states that differ in their means alone, such as levels of a held breath, are one.
    let mut pools: Vec<((u64, bool), Cells)> = Vec::new();
    for state in states {
        let variance_m2 = axis.dot(&(state.covariance_m2 * axis)) + boundary_sd_m * boundary_sd_m;
        let mean_m = axis.dot(&state.mean_m);
        let failed: Cells = state.failed_m.map_or_else(
            || vec![(1.0, 0.0)],
            |full| {
                let most_m = axis.dot(&full);
                let cells = fullnesses.iter();
                let largest =
                    cells.map(|(share, ends)| (*share, (most_m * ends[0]).max(most_m * ends[1])));
                largest.collect()
            },
        );
        let pairs = failed.iter().flat_map(|(share, by_m)| {
            bends
                .iter()
                .map(move |(other, more_m)| (state.weight * share * other, mean_m + by_m + more_m))
        });
        let key = (variance_m2.to_bits(), state.failed_m.is_some());
        match pools.iter_mut().find(|(other, _)| *other == key) {
            Some((_, cells)) => cells.extend(pairs),
            None => pools.push((key, pairs.collect())),
        }
    }
    let of_pool = |((variance_m2, _), cells): &((u64, bool), Cells)| -> f64 {
        let sd_m = f64::from_bits(*variance_m2).max(0.0).sqrt();
        let above = |left_m: f64| {
            if left_m > FAR * sd_m {
                BEYOND_FAR
            } else if sd_m > 0.0 {
                normal::probability_below(-left_m / sd_m)
            } else {
                f64::from(u8::from(left_m <= 0.0))
            }
        };
        let sum = |cells: &Cells| -> f64 {
            let each = cells.iter();
            each.map(|(share, by_m)| share * above(distance_m - by_m))
                .sum()
        };
        if cells.len() > POOLED {
            sum(&binned(cells.iter().copied(), POOLED))
        } else {
            sum(cells)
        }
    };
    pools.iter().map(of_pool).sum()
}
