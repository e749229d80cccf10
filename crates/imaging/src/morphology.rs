//! Growing, shrinking, opening and closing by a distance.
//!
//! A voxel is within reach if its centre is at most the distance from the centre of a voxel of the mask: what a
//! threshold of the exact distance field says. The ball is taken apart into rows of voxels, and rows are shifted as
//! words of 64, so that a voxel costs less than a bit's work per row of the ball.

use crate::mask::Mask;
use crate::spacing::whole;

/// Rows of a ball: how far along j and k, and its half width along i.
fn ball_rows(radius_m: f64, spacing_m: [f64; 3]) -> Vec<(usize, [isize; 2])> {
    // Rounding must not decide about voxels that are exactly as far as the radius.
    let squared = radius_m * radius_m * (1.0 + 1e-9);
    let reach = |axis: usize| whole(radius_m * (1.0 + 1e-9) / spacing_m[axis]).cast_signed();
    let mut rows = Vec::new();
    for dk in -reach(2)..=reach(2) {
        for dj in -reach(1)..=reach(1) {
            let beside = (dj as f64 * spacing_m[1]).powi(2) + (dk as f64 * spacing_m[2]).powi(2);
            if beside <= squared {
                rows.push((whole((squared - beside).sqrt() / spacing_m[0]), [dj, dk]));
            }
        }
    }
    rows.sort_unstable();
    rows
}

/// Sets every bit within `by` of one that is set; `scratch` is as long as `row`.
fn spread(row: &mut [u64], by: usize, last: u64, scratch: &mut [u64]) {
    scratch.copy_from_slice(row);
    // Shifts add up: 1, 2, 4, ... and the rest.
    let mut done = 0;
    while done < by {
        let step = (done + 1).min(by - done);
        or_shifted_up(row, step);
        or_shifted_down(scratch, step);
        done += step;
    }
    for (word, &other) in row.iter_mut().zip(scratch.iter()) {
        *word |= other;
    }
    if let Some(word) = row.last_mut() {
        *word &= last;
    }
}

fn or_shifted_up(row: &mut [u64], by: usize) {
    let (words, bits) = (by / 64, by % 64);
    for at in (words..row.len()).rev() {
        let mut shifted = row[at - words] << bits;
        if bits > 0 && at > words {
            shifted |= row[at - words - 1] >> (64 - bits);
        }
        row[at] |= shifted;
    }
}

fn or_shifted_down(row: &mut [u64], by: usize) {
    let (words, bits) = (by / 64, by % 64);
    for at in 0..row.len().saturating_sub(words) {
        let mut shifted = row[at + words] >> bits;
        if bits > 0 && at + words + 1 < row.len() {
            shifted |= row[at + words + 1] << (64 - bits);
        }
        row[at] |= shifted;
    }
}

/// All voxels within a distance of the mask's.
#[must_use]
pub fn dilated(mask: &Mask, radius_m: f64, spacing_m: [f64; 3]) -> Mask {
    let [_, ny, nz] = mask.size();
    let rows = ball_rows(radius_m.max(0.0), spacing_m);
    let last = mask.last_word();
    let mut out = Mask::empty(mask.size());
    let mut scratch = vec![0; mask.words_per_row()];
    let mut wide = vec![0; mask.words_per_row()];
    for (j, k) in (0..nz).flat_map(|k| (0..ny).map(move |j| (j, k))) {
        let row = mask.row(j, k);
        if row.iter().all(|&word| word == 0) {
            continue;
        }
        let covered = Covered::new(mask, j, k);
        for group in rows.chunk_by(|a, b| a.0 == b.0) {
            let mut is_spread = false;
            for &(by, [dj, dk]) in group {
                let to_j = j.checked_add_signed(dj).filter(|&j| j < ny);
                let to_k = k.checked_add_signed(dk).filter(|&k| k < nz);
                let Some((to_j, to_k)) = to_j.zip(to_k).filter(|_| !covered.has([dj, dk])) else {
                    continue;
                };
                if !is_spread {
                    wide.copy_from_slice(row);
                    spread(&mut wide, by, last, &mut scratch);
                    is_spread = true;
                }
                for (to, &from) in out.row_mut(to_j, to_k).iter_mut().zip(&wide) {
                    *to |= from;
                }
            }
        }
    }
    out
}

/// Directions in which the next row has all that a row has. It is nearer to what lies there, and a ball's rows are
/// the wider the nearer they are: nothing has to be carried from this row in such a direction.
struct Covered {
    along_j: [bool; 2],
    along_k: [bool; 2],
}

impl Covered {
    fn new(mask: &Mask, j: usize, k: usize) -> Self {
        let [_, ny, nz] = mask.size();
        let row = mask.row(j, k);
        let has_all = |j: Option<usize>, k: Option<usize>| {
            let next = j.filter(|&j| j < ny).zip(k.filter(|&k| k < nz));
            next.is_some_and(|(j, k)| {
                let pairs = row.iter().zip(mask.row(j, k));
                pairs.fold(0, |lacks, (here, there)| lacks | (here & !there)) == 0
            })
        };
        Self {
            along_j: [j.checked_sub(1), Some(j + 1)].map(|j| has_all(j, Some(k))),
            along_k: [k.checked_sub(1), Some(k + 1)].map(|k| has_all(Some(j), k)),
        }
    }

    fn has(&self, [dj, dk]: [isize; 2]) -> bool {
        dj < 0 && self.along_j[0]
            || dj > 0 && self.along_j[1]
            || dk < 0 && self.along_k[0]
            || dk > 0 && self.along_k[1]
    }
}

/// Voxels that are farther than a distance from all that are not in the mask. What is beyond the volume does not
/// count, so that what a volume's end cuts is not worn away there.
#[must_use]
pub fn eroded(mask: &Mask, radius_m: f64, spacing_m: [f64; 3]) -> Mask {
    dilated(&mask.complement(), radius_m, spacing_m).complement()
}

/// What a ball of this radius reaches while it stays in the mask: what is thinner than it goes.
#[must_use]
pub fn opened(mask: &Mask, radius_m: f64, spacing_m: [f64; 3]) -> Mask {
    dilated(&eroded(mask, radius_m, spacing_m), radius_m, spacing_m)
}

/// Fills what a ball of this radius does not reach from outside.
#[must_use]
pub fn closed(mask: &Mask, radius_m: f64, spacing_m: [f64; 3]) -> Mask {
    eroded(&dilated(mask, radius_m, spacing_m), radius_m, spacing_m)
}

/// Fills gaps of at most `gap` voxels between voxels of the mask along one axis.
#[must_use]
pub(crate) fn bridged(mask: &Mask, axis: usize, gap: usize) -> Mask {
    let [nx, ny, nz] = mask.size();
    let mut out = mask.clone();
    match axis {
        0 => {
            for (j, k) in (0..nz).flat_map(|k| (0..ny).map(move |j| (j, k))) {
                let mut end = None;
                for [from, to] in mask.runs(j, k) {
                    if let Some(end) = end.filter(|end| from - end <= gap) {
                        out.insert_run([end, from], j, k);
                    }
                    end = Some(to);
                }
            }
        }
        // Along j in each slice, along k in each row.
        1 => {
            for k in 0..nz {
                bridge_lines(mask, &mut out, gap, ny, &|at| (at, k));
            }
        }
        _ => {
            for j in 0..ny {
                bridge_lines(mask, &mut out, gap, nz, &|at| (j, at));
            }
        }
    }
    debug_assert!(nx > 0);
    out
}

/// A word of columns at a time: what has the mask before and after within the gap.
fn bridge_lines(
    mask: &Mask,
    out: &mut Mask,
    gap: usize,
    length: usize,
    row: &dyn Fn(usize) -> (usize, usize),
) {
    for word in 0..mask.words_per_row() {
        // Where each column's mask was last seen.
        let mut last = [usize::MAX; 64];
        let mut before = 0;
        for at in 0..length {
            let (j, k) = row(at);
            let here = mask.row(j, k)[word];
            // Columns whose mask begins here again.
            let mut starts = here & !before;
            while starts != 0 {
                let bit = starts.trailing_zeros() as usize;
                starts &= starts - 1;
                if last[bit] != usize::MAX && at - last[bit] - 1 <= gap {
                    for between in last[bit] + 1..at {
                        let (j, k) = row(between);
                        out.row_mut(j, k)[word] |= 1 << bit;
                    }
                }
            }
            let mut ends = before & !here;
            while ends != 0 {
                last[ends.trailing_zeros() as usize] = at - 1;
                ends &= ends - 1;
            }
            before = here;
        }
    }
}

#[cfg(test)]
mod tests {
    use needlebench_numerics::random::SplitMix64;

    use super::*;

    const SPACING_M: [f64; 3] = [0.7e-3, 0.8e-3, 1.5e-3];

    fn random_mask(size: [usize; 3], one_in: u32, seed: u64) -> Mask {
        let mut random = SplitMix64::new(seed);
        let values: Vec<u32> = (0..size.iter().product())
            .map(|_| random.below(one_in))
            .collect();
        Mask::of(size, &values, |value| value == 0)
    }

    fn distance_m(a: [usize; 3], b: [usize; 3]) -> f64 {
        let squared: f64 = (0..3)
            .map(|axis| (a[axis].abs_diff(b[axis]) as f64 * SPACING_M[axis]).powi(2))
            .sum();
        squared.sqrt()
    }

    #[test]
    fn growing_and_shrinking_are_thresholds_of_the_distance() {
        let size = [90, 12, 6];
        for (seed, radius_m) in [(1, 0.0), (2, 1e-3), (3, 3e-3), (4, 60e-3)] {
            let mask = random_mask(size, 300, seed);
            let grown = dilated(&mask, radius_m, SPACING_M);
            let shrunk = eroded(&mask.complement(), radius_m, SPACING_M);
            let everywhere = Mask::empty(size).complement();
            for voxel in everywhere.voxels() {
                let near = mask
                    .voxels()
                    .any(|other| distance_m(voxel, other) <= radius_m);
                assert_eq!(grown.get(voxel), near, "{voxel:?} {radius_m}");
                assert_eq!(shrunk.get(voxel), !near);
            }
        }
    }

    #[test]
    fn opening_removes_a_thin_plate_and_closing_fills_a_gap() {
        let size = [80, 40, 30];
        let mut mask = Mask::empty(size);
        for k in 0..30 {
            for j in 0..40 {
                // A block of 20 voxels and a plate of 2 voxels; a gap of 3 voxels in the block.
                if !(18..21).contains(&j) {
                    mask.insert_run([5, 30], j, k);
                }
                mask.insert_run([60, 62], j, k);
            }
        }
        let open = opened(&mask, 3e-3, SPACING_M);
        assert!(open.get([15, 5, 10]) && !open.get([60, 20, 10]));
        let close = closed(&mask, 3e-3, SPACING_M);
        assert!(close.get([15, 19, 10]) && !close.get([45, 20, 10]));
        // Nothing is worn away at the volume's ends.
        assert!(open.get([15, 5, 0]) && open.get([15, 0, 29]));
    }

    #[test]
    fn gaps_up_to_the_limit_are_bridged_along_the_axis() {
        let size = [130, 20, 15];
        let mask = random_mask(size, 6, 9);
        for (axis, gap) in [(0, 4), (1, 4), (2, 3)] {
            let bridged = bridged(&mask, axis, gap);
            let everywhere = Mask::empty(size).complement();
            for voxel in everywhere.voxels() {
                let seen = |forward: bool| {
                    (1..=gap + 1).find(|&step| {
                        let mut at = voxel;
                        at[axis] = if forward {
                            at[axis] + step
                        } else {
                            at[axis].wrapping_sub(step)
                        };
                        at[axis] < size[axis] && mask.get(at)
                    })
                };
                let between = seen(true)
                    .zip(seen(false))
                    .is_some_and(|(on, back)| on + back <= gap + 1);
                assert_eq!(
                    bridged.get(voxel),
                    mask.get(voxel) || between,
                    "{axis} {voxel:?}"
                );
            }
        }
    }
}
