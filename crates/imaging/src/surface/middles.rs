//! What thick slices leave between them.

use needlebench_volume::Volume;

use crate::mask::IndexBox;

/// Thinner slices are as good as points.
const THICK_M: f64 = 1.5e-3;

/// More would make more of noise than of edges.
const MOST: f64 = 0.25;

/// Values at the middles of thick slices of which the line from one to the next has the measured means over the
/// thickness, to first order: a line's mean over thickness T about a middle adds T / (8 step) of the second difference
/// to the value there. Only within a box; none if slices are thin.
pub(crate) fn at_middles(volume: &Volume, within: &IndexBox) -> Option<Vec<i16>> {
    let [_, _, step_m] = volume.grid.spacing_m();
    let thickness_m = volume.slice_thickness_m.unwrap_or(step_m);
    let [nx, ny, nz] = volume.grid.size();
    if thickness_m < THICK_M || nz < 3 {
        return None;
    }
    let share = single((thickness_m / step_m / 8.0).min(MOST));
    let mut values = volume.hu.clone();
    let slice = nx * ny;
    for k in within.first[2].max(1)..=within.last[2].min(nz - 2) {
        for j in within.first[1]..=within.last[1] {
            let [from, to] = [within.first[0], within.last[0] + 1].map(|i| k * slice + j * nx + i);
            let sides = volume.hu[from - slice..to - slice]
                .iter()
                .zip(&volume.hu[from + slice..to + slice]);
            for (value, (&before, &after)) in values[from..to].iter_mut().zip(sides) {
                let here = f32::from(*value);
                let second = f32::from(before) + f32::from(after) - 2.0 * here;
                *value = rounded(here - share * second);
            }
        }
    }
    Some(values)
}

#[expect(clippy::cast_possible_truncation, reason = "rounded, not cut")]
fn single(value: f64) -> f32 {
    value as f32
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "beyond 16 bits it saturates"
)]
fn rounded(value: f32) -> i16 {
    value.round() as i16
}
