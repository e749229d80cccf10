//! Exact Euclidean distances from a set of voxels.
//!
//! An axis at a time, as squares of distances allow: along k by counting, then slice by slice along j and i the least
//! sum of a square and of the squared way to it. Ways are looked at from the shortest one on until none can be less,
//! which at the distances in a body takes fewer operations, side by side, than lower envelopes of parabolas do
//! (Felzenszwalb and Huttenlocher, *Distance transforms of sampled functions*, Theory of Computing 8, 2012). Counts and
//! results share one array of 16 bits, so that a field takes two bytes a voxel of its box.

use std::sync::atomic::AtomicBool;

use nalgebra::Point3;
use needlebench_volume::{VolumeError, VoxelGrid, in_slices};

use crate::mask::{IndexBox, Mask};
use crate::spacing::{orthogonal, whole};

/// Distances from voxels to the nearest voxel of a set, centre to centre, within a box of the grid.
#[derive(Debug, Clone)]
pub struct DistanceField {
    grid: VoxelGrid,
    spacing_m: [f64; 3],
    within: IndexBox,
    cap_m: f64,
    /// In steps of `cap_m / STEPS`.
    steps: Vec<i16>,
}

/// Steps from 0 to the cap: the largest value of 16 bits.
const STEPS: i16 = i16::MAX;

/// How far to go, and how.
#[derive(Debug, Clone, Copy)]
pub struct DistanceOptions<'a> {
    /// Farthest distance that is told; beyond it the field is this.
    pub cap_m: f64,
    /// Threads to use; the field does not depend on it.
    pub threads: usize,
    /// Set by another thread to give up.
    pub cancel: &'a AtomicBool,
}

/// What of a voxel of the set a distance goes to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum To {
    /// Its centre.
    Centre,
    /// The nearest point of its box.
    Box,
}

impl To {
    /// The way along an axis to a voxel that is so many steps away, m.
    fn way_m(self, steps: f64, step_m: f64) -> f64 {
        match self {
            Self::Centre => steps * step_m,
            Self::Box => (steps - 0.5).max(0.0) * step_m,
        }
    }
}

impl DistanceField {
    /// Distances to a set of voxels; zero in it.
    pub fn new(
        grid: &VoxelGrid,
        set: &Mask,
        within: IndexBox,
        options: &DistanceOptions<'_>,
    ) -> Result<Self, VolumeError> {
        Self::to(To::Centre, grid, set, within, options)
    }

    /// Distances from voxels' centres to the space that the voxels of a set fill: to the nearest point of their boxes, not
    /// to their centres.
    pub fn to_boxes(
        grid: &VoxelGrid,
        set: &Mask,
        within: IndexBox,
        options: &DistanceOptions<'_>,
    ) -> Result<Self, VolumeError> {
        Self::to(To::Box, grid, set, within, options)
    }

    fn to(
        to: To,
        grid: &VoxelGrid,
        set: &Mask,
        within: IndexBox,
        options: &DistanceOptions<'_>,
    ) -> Result<Self, VolumeError> {
        let spacing_m = orthogonal(grid)?;
        // What is outside the box counts as far as the cap reaches.
        let reach = [0, 1, 2].map(|axis| whole(options.cap_m / spacing_m[axis]) + 1);
        let around = within.widened(reach, grid.size());
        let wide = match set.bounds() {
            Some(bounds) => within.joined(&bounds).common(&around),
            None => within,
        };
        let part = set.cropped(&wide);
        let steps = distances(&part, to, spacing_m, options)?;
        let field = Self {
            grid: grid.clone(),
            spacing_m,
            within: wide,
            cap_m: options.cap_m,
            steps,
        };
        Ok(if wide == within {
            field
        } else {
            field.cropped(within)
        })
    }

    /// Distances to a set of voxels, positive outside, and minus the distance to the nearest voxel that is not of the
    /// set inside. Centre to centre: the set's surface lies between, half a voxel from either, and no value is 0.
    pub fn signed(
        grid: &VoxelGrid,
        set: &Mask,
        within: IndexBox,
        options: &DistanceOptions<'_>,
    ) -> Result<Self, VolumeError> {
        let mut field = Self::new(grid, set, within, options)?;
        let inside = Self::new(grid, &set.complement(), within, options)?;
        for (outside, inside) in field.steps.iter_mut().zip(inside.steps) {
            *outside -= inside;
        }
        Ok(field)
    }

    fn cropped(&self, within: IndexBox) -> Self {
        let size = within.size();
        let mut steps = Vec::with_capacity(size.iter().product());
        for k in within.first[2]..=within.last[2] {
            for j in within.first[1]..=within.last[1] {
                let from = self.offset([within.first[0], j, k]);
                steps.extend_from_slice(&self.steps[from..from + size[0]]);
            }
        }
        Self {
            grid: self.grid.clone(),
            spacing_m: self.spacing_m,
            within,
            cap_m: self.cap_m,
            steps,
        }
    }

    fn offset(&self, [i, j, k]: [usize; 3]) -> usize {
        let [nx, ny, _] = self.within.size();
        let [i0, j0, k0] = self.within.first;
        ((k - k0) * ny + (j - j0)) * nx + (i - i0)
    }

    /// The box that it covers.
    pub fn within(&self) -> IndexBox {
        self.within
    }

    /// Distances are told up to this one.
    pub fn cap_m(&self) -> f64 {
        self.cap_m
    }

    /// By how much a value may be rounded, at most: half a step of 16 bits.
    pub(crate) fn rounding_m(&self) -> f64 {
        0.5 * self.cap_m / f64::from(STEPS)
    }

    /// Distance in m at a voxel of its box; none outside.
    pub(crate) fn at_voxel(&self, voxel: [usize; 3]) -> Option<f64> {
        self.within
            .contains(voxel)
            .then(|| self.metres(self.steps[self.offset(voxel)]))
    }

    fn metres(&self, steps: i16) -> f64 {
        f64::from(steps) * self.cap_m / f64::from(STEPS)
    }

    /// Distance in m at a place in `ct`, interpolated between the eight voxels around it; none outside the box.
    ///
    /// Distances change by at most the way, so that it is within half a voxel's diagonal of the distance to the
    /// nearest voxel's centre.
    pub fn at(&self, point_m: &Point3<f64>) -> Option<f64> {
        let index = self.grid.index_from_ct(point_m);
        let mut low = [0; 3];
        let mut part = [0.0; 3];
        for axis in 0..3 {
            let [first, last] = [self.within.first[axis], self.within.last[axis]];
            let beyond = index[axis] - first as f64;
            if !(0.0..=(last - first) as f64).contains(&beyond) {
                return None;
            }
            let step = whole(beyond).min((last - first).saturating_sub(1));
            low[axis] = first + step;
            part[axis] = beyond - step as f64;
        }
        let mut sum = 0.0;
        for corner in 0..8 {
            let mut voxel = low;
            let mut weight = 1.0;
            for axis in 0..3 {
                if corner >> axis & 1 == 1 {
                    voxel[axis] = (low[axis] + 1).min(self.within.last[axis]);
                    weight *= part[axis];
                } else {
                    weight *= 1.0 - part[axis];
                }
            }
            sum += weight * f64::from(self.steps[self.offset(voxel)]);
        }
        Some(sum * self.cap_m / f64::from(STEPS))
    }

    /// A lower bound of the distance from a place in `ct` to the set, m.
    ///
    /// The square of the distance to a point, or to a box, less the square of the place itself is concave, and so is the
    /// least over all of the set. Between the eight voxels around a place it is therefore at least what is
    /// interpolated: `d^2 >= sum w d_i^2 - sum w |c_i - p|^2`, and the last sum is `s^2 f (1 - f)` along each axis, with
    /// `f` the place between two voxels. What is lost: that last sum across the way, half a voxel's diagonal squared
    /// at most, where one thing is nearest to all eight voxels; up to `2 d` times its root, thus half a diagonal, where
    /// they have different things nearest, as in the middle between two ribs. Rounding is taken off; outside the box, the
    /// way to it.
    pub fn at_least(&self, point_m: &Point3<f64>) -> f64 {
        self.at_least_of_index(&self.grid.index_from_ct(point_m))
    }

    /// The same of a place by its index, which need not be whole.
    pub fn at_least_of_index(&self, index: &Point3<f64>) -> f64 {
        let mut low = [0; 3];
        let mut part = [0.0; 3];
        let (mut spread_m2, mut outside_m2) = (0.0, 0.0);
        for axis in 0..3 {
            let [first, last] = [self.within.first[axis], self.within.last[axis]];
            let inside = index[axis].clamp(first as f64, last as f64);
            let step_m = self.spacing_m[axis];
            outside_m2 += ((index[axis] - inside) * step_m).powi(2);
            low[axis] = whole(inside).min(last.saturating_sub(1)).max(first);
            part[axis] = inside - low[axis] as f64;
            spread_m2 += step_m * step_m * part[axis] * (1.0 - part[axis]);
        }
        let [nx, ny, _] = self.within.size();
        // The next voxel along each axis, where there is one.
        let next = [1, nx, nx * ny];
        let on = [0, 1, 2].map(|axis| {
            if low[axis] < self.within.last[axis] {
                next[axis]
            } else {
                0
            }
        });
        let from = self.offset(low);
        let rounding_m = self.rounding_m();
        let square_m2 = |corner: usize| {
            let at =
                from + (corner & 1) * on[0] + (corner >> 1 & 1) * on[1] + (corner >> 2) * on[2];
            (self.metres(self.steps[at]) - rounding_m).max(0.0).powi(2)
        };
        let mix = |share: f64, a: f64, b: f64| a + share * (b - a);
        let [x, y, z] = part;
        let along_x = |corner: usize| mix(x, square_m2(corner), square_m2(corner + 1));
        let along_y = |corner: usize| mix(y, along_x(corner), along_x(corner + 2));
        let mixed_m2 = mix(z, along_y(0), along_y(4));
        (mixed_m2 - spread_m2).max(0.0).sqrt() - outside_m2.sqrt()
    }

    /// All values in m, columns fastest, of the box.
    pub fn values_m(&self) -> impl Iterator<Item = f64> + '_ {
        self.steps.iter().map(|&steps| self.metres(steps))
    }
}

/// Distances in steps to the voxels of a mask.
fn distances(
    mask: &Mask,
    to: To,
    spacing_m: [f64; 3],
    options: &DistanceOptions<'_>,
) -> Result<Vec<i16>, VolumeError> {
    let [nx, ny, _] = mask.size();
    let far = whole(options.cap_m / spacing_m[2]).min(i16::MAX as usize - 2) + 2;
    let far = i16::try_from(far).unwrap_or(i16::MAX);
    let mut steps = counts_along_k(mask, far);
    in_slices(
        &mut steps,
        nx * ny,
        options.threads,
        options.cancel,
        || InSlice::new([nx, ny], to, spacing_m, options.cap_m),
        |own, _, slice| own.finish(slice),
    )?;
    Ok(steps)
}

/// Slices to the nearest voxel of the mask in the same column, at most `far`.
fn counts_along_k(mask: &Mask, far: i16) -> Vec<i16> {
    let [nx, ny, nz] = mask.size();
    let mut counts = vec![far; nx * ny * nz];
    // Of a byte of the mask: all bits of a count but where the mask is.
    let keep: Vec<[i16; 8]> = (0..256)
        .map(|byte| std::array::from_fn(|bit| if byte >> bit & 1 == 1 { 0 } else { -1 }))
        .collect();
    for k in 0..nz {
        let (before, rest) = counts.split_at_mut(k * nx * ny);
        let here = &mut rest[..nx * ny];
        if let Some(from) = k.checked_sub(1) {
            let before = &before[from * nx * ny..];
            for (count, &before) in here.iter_mut().zip(before) {
                *count = (before + 1).min(far);
            }
        }
        for (j, row) in here.chunks_exact_mut(nx).enumerate() {
            let bytes = mask.row(j, k).iter().flat_map(|word| word.to_le_bytes());
            for (eight, byte) in row.chunks_mut(8).zip(bytes) {
                for (count, &keep) in eight.iter_mut().zip(&keep[usize::from(byte)]) {
                    *count &= keep;
                }
            }
        }
    }
    for k in (0..nz - 1).rev() {
        let (head, after) = counts.split_at_mut((k + 1) * nx * ny);
        for (count, &after) in head[k * nx * ny..].iter_mut().zip(&*after) {
            *count = (*count).min(after + 1);
        }
    }
    counts
}

/// Voxels beside each other that are taken at a time: those of a cache line.
const LANES: usize = 16;

/// Ways that are looked at before it is asked whether the next one can matter.
const AT_ONCE: usize = 4;

/// What one slice needs.
struct InSlice {
    size: [usize; 2],
    /// What of a way a voxel's own half takes, in steps.
    own_half: f32,
    step_k_squared: f32,
    cap_squared: f32,
    steps_per_m: f32,
    along_i: Ways,
    along_j: Ways,
    /// Squares of the slice, and then those of the columns that are taken at a time, or of a row, with what is beyond.
    slice: Vec<f32>,
    columns: Vec<[f32; LANES]>,
    row: Vec<f32>,
    /// Which lines of the columns have something within the cap.
    near: Vec<bool>,
}

impl InSlice {
    fn new([nx, ny]: [usize; 2], to: To, spacing_m: [f64; 3], cap_m: f64) -> Self {
        let [along_i, along_j] = [(nx, spacing_m[0]), (ny, spacing_m[1])]
            .map(|(n, step_m)| Ways::new(n, to, step_m, cap_m));
        let cap_squared = single(cap_m * cap_m);
        Self {
            size: [nx, ny],
            own_half: single(1.0 - to.way_m(1.0, 1.0)),
            step_k_squared: single(spacing_m[2] * spacing_m[2]),
            cap_squared,
            steps_per_m: single(f64::from(STEPS) / cap_m),
            slice: vec![0.0; nx * ny],
            columns: vec![[cap_squared; LANES]; ny + 2 * along_j.reach()],
            row: vec![cap_squared; nx.next_multiple_of(LANES) + 2 * along_i.reach()],
            near: vec![false; ny],
            along_i,
            along_j,
        }
    }

    /// Turns counts of slices into distances.
    fn finish(&mut self, counts: &mut [i16]) {
        let [nx, _] = self.size;
        for (square, &count) in self.slice.iter_mut().zip(&*counts) {
            let way = f32::from(count) - self.own_half;
            let way = if way > 0.0 { way } else { 0.0 };
            *square = lower(way * way * self.step_k_squared, self.cap_squared);
        }
        self.lower_along_j();
        let reach = self.along_i.reach();
        let rows = self.slice.chunks_exact(nx);
        for (row, out) in rows.zip(counts.chunks_exact_mut(nx)) {
            self.row[reach..reach + nx].copy_from_slice(row);
            for (block, out) in out.chunks_mut(LANES).enumerate() {
                let at = reach + LANES * block;
                let before = side_by_side(&self.row[at - reach..at + LANES - 1]).rev();
                let mut after = side_by_side(&self.row[at..at + reach + LANES]);
                let here = after.next().expect("it is in the row");
                let least = self.along_i.least(*here, before, after, 0);
                let steps = least.map(|squared| rounded(squared.sqrt() * self.steps_per_m));
                out.copy_from_slice(&steps[..out.len()]);
            }
        }
    }

    fn lower_along_j(&mut self) {
        let [nx, ny] = self.size;
        let reach = self.along_j.reach();
        for first in (0..nx).step_by(LANES) {
            let wide = LANES.min(nx - first);
            let rows = self.slice.chunks_exact(nx);
            let lines = &mut self.columns[reach..reach + ny];
            for ((line, near), row) in lines.iter_mut().zip(&mut self.near).zip(rows) {
                line[..wide].copy_from_slice(&row[first..first + wide]);
                *near = line.iter().any(|&square| square < self.cap_squared);
            }
            let none = far_lines(&self.near);
            for (j, row) in self.slice.chunks_exact_mut(nx).enumerate() {
                let at = reach + j;
                let before = self.columns[at - reach..at].iter().rev();
                let after = self.columns[at + 1..=at + reach].iter();
                let least = self.along_j.least(self.columns[at], before, after, none[j]);
                row[first..first + wide].copy_from_slice(&least[..wide]);
            }
        }
    }
}

/// For each line, how many of those next to it, on either side, are not near.
fn far_lines(near: &[bool]) -> Vec<usize> {
    let count = |far: &mut usize, near: &bool| {
        let before = *far;
        *far = if *near { 0 } else { before + 1 };
        Some(before)
    };
    let mut none: Vec<usize> = near.iter().scan(near.len(), count).collect();
    let after: Vec<usize> = near.iter().rev().scan(near.len(), count).collect();
    for (none, after) in none.iter_mut().zip(after.into_iter().rev()) {
        *none = after.min(*none);
    }
    none
}

/// All that many values in a row.
fn side_by_side(values: &[f32]) -> impl DoubleEndedIterator<Item = &[f32; LANES]> {
    values
        .windows(LANES)
        .map(|window| window.first_chunk().expect("a window has its width"))
}

/// To the nearest whole number, of 0 to 2^15 - 1: adding 2^23 leaves it in the lowest bits.
#[expect(
    clippy::cast_possible_truncation,
    reason = "the lowest 16 bits are meant"
)]
fn rounded(value: f32) -> i16 {
    (value + 8_388_608.0).to_bits() as i16
}

#[expect(clippy::cast_possible_truncation, reason = "rounded, not cut")]
fn single(value: f64) -> f32 {
    value as f32
}

/// The lower one of two numbers; one instruction, unlike `f32::min`.
fn lower(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The ways along an axis up to the cap.
struct Ways {
    /// Squared ways of 1, 2, ... voxels: so many that all which are below the cap, and within the line, are among them.
    squares: Vec<[f32; AT_ONCE]>,
}

impl Ways {
    fn new(length: usize, to: To, step_m: f64, cap_m: f64) -> Self {
        let reach = (whole(cap_m / step_m) + 1).min(length - 1);
        let squares = (0..reach.div_ceil(AT_ONCE)).map(|group| {
            std::array::from_fn(|at| {
                single(to.way_m((AT_ONCE * group + at + 1) as f64, step_m).powi(2))
            })
        });
        Self {
            squares: squares.collect(),
        }
    }

    /// Voxels that have to be there on both sides of one whose distance is looked for.
    fn reach(&self) -> usize {
        AT_ONCE * self.squares.len()
    }

    /// Least sums of a value and of the squared way to it, for voxels side by side, from those before and after them
    /// along the axis, the nearest ones first. Of the nearest `none` nothing is within the cap.
    fn least<'a>(
        &self,
        mut least: [f32; LANES],
        before: impl Iterator<Item = &'a [f32; LANES]>,
        after: impl Iterator<Item = &'a [f32; LANES]>,
        none: usize,
    ) -> [f32; LANES] {
        let skipped = none / AT_ONCE;
        let mut sides = before.zip(after).skip(AT_ONCE * skipped);
        for squares in self.squares.iter().skip(skipped) {
            // No farther value can be less than its way.
            let farther = |any, &value: &f32| any | u32::from(value > squares[0]);
            if least.iter().fold(0, farther) == 0 {
                break;
            }
            for (&square, (before, after)) in squares.iter().zip(&mut sides) {
                for ((least, &before), &after) in least.iter_mut().zip(before).zip(after) {
                    *least = lower(lower(before, after) + square, *least);
                }
            }
        }
        least
    }
}

#[cfg(test)]
mod tests {
    use needlebench_numerics::random::SplitMix64;

    use super::*;

    static GO: AtomicBool = AtomicBool::new(false);

    fn options(cap_m: f64, threads: usize) -> DistanceOptions<'static> {
        DistanceOptions {
            cap_m,
            threads,
            cancel: &GO,
        }
    }

    fn random_mask(size: [usize; 3], one_in: u32, seed: u64) -> Mask {
        let mut random = SplitMix64::new(seed);
        let values: Vec<u32> = (0..size.iter().product())
            .map(|_| random.below(one_in))
            .collect();
        Mask::of(size, &values, |value| value == 0)
    }

    /// Single precision of the squares.
    const RELATIVE: f64 = 1e-6;

    #[test]
    fn field_is_the_brute_force_distance_up_to_its_stated_rounding() {
        for (seed, size, spacing_m, one_in, cap_m) in [
            (1, [20, 17, 9], [0.7e-3, 0.7e-3, 1e-3], 40, 40e-3),
            (2, [33, 5, 12], [0.5e-3, 0.9e-3, 5e-3], 200, 8e-3),
            (3, [1, 25, 1], [1e-3; 3], 9, 40e-3),
            (4, [70, 1, 8], [0.3e-3, 1e-3, 2e-3], 500, 12e-3),
            (5, [9, 9, 9], [1e-3; 3], 2000, 40e-3),
        ] {
            let grid = VoxelGrid::aligned(size, spacing_m, Point3::origin()).unwrap();
            let mask = random_mask(size, one_in, seed);
            let set: Vec<_> = mask
                .voxels()
                .map(|v| grid.ct_from_index(&place(v)))
                .collect();
            let field = DistanceField::new(&grid, &mask, IndexBox::whole(size), &options(cap_m, 1))
                .unwrap();
            for voxel in Mask::empty(size).complement().voxels() {
                let here = grid.ct_from_index(&place(voxel));
                let nearest = set.iter().map(|p| (p - here).norm()).fold(cap_m, f64::min);
                let told = field.at_voxel(voxel).unwrap();
                let allowed = field.rounding_m() + RELATIVE * nearest;
                assert!((told - nearest).abs() <= allowed, "{told} {nearest}");
            }
            let whole = IndexBox::whole(size);
            let boxes = DistanceField::to_boxes(&grid, &mask, whole, &options(cap_m, 1)).unwrap();
            for voxel in Mask::empty(size).complement().voxels() {
                let nearest = mask.voxels().map(|other| {
                    let way = |axis: usize| {
                        let steps = (voxel[axis] as f64 - other[axis] as f64).abs();
                        (steps - 0.5).max(0.0) * spacing_m[axis]
                    };
                    libm::hypot(libm::hypot(way(0), way(1)), way(2))
                });
                let nearest = nearest.fold(cap_m, f64::min);
                let told = boxes.at_voxel(voxel).unwrap();
                let allowed = boxes.rounding_m() + RELATIVE * nearest;
                assert!((told - nearest).abs() <= allowed, "{told} {nearest}");
            }
            let threaded =
                DistanceField::new(&grid, &mask, IndexBox::whole(size), &options(cap_m, 3))
                    .unwrap();
            assert_eq!(threaded.steps, field.steps);
        }
    }

    #[test]
    fn lower_bounds_between_voxels_hold_and_are_close() {
        let (size, spacing_m) = ([24, 20, 12], [0.7e-3, 0.7e-3, 2e-3]);
        let grid = VoxelGrid::aligned(size, spacing_m, Point3::new(0.1, -0.2, 0.3)).unwrap();
        let mask = random_mask(size, 400, 6);
        let within = IndexBox {
            first: [2, 1, 1],
            last: [20, 18, 10],
        };
        let field = DistanceField::to_boxes(&grid, &mask, within, &options(40e-3, 1)).unwrap();
        let half_diagonal_m = 0.5 * nalgebra::Vector3::from(spacing_m).norm();
        let mut random = SplitMix64::new(7);
        for _ in 0..2000 {
            let index = [0, 1, 2].map(|axis| {
                let [first, last] = [within.first[axis] as f64, within.last[axis] as f64];
                first + (last - first) * random.open_unit()
            });
            let point = grid.ct_from_index(&index.into());
            let exact_m = mask.voxels().map(|other| {
                let way = |axis: usize| {
                    let steps = (index[axis] - other[axis] as f64).abs();
                    (steps - 0.5).max(0.0) * spacing_m[axis]
                };
                libm::hypot(libm::hypot(way(0), way(1)), way(2))
            });
            let exact_m = exact_m.fold(40e-3, f64::min);
            let told_m = field.at_least(&point);
            assert!(told_m <= exact_m + 1e-12, "{told_m} {exact_m}");
            assert!(
                exact_m - told_m <= 2.0 * half_diagonal_m,
                "{told_m} {exact_m}"
            );
        }
        // Outside its box, too.
        let outside = grid.ct_from_index(&Point3::new(-30.0, 4.0, 4.0));
        assert!(field.at_least(&outside) <= 40e-3 - 30.0 * 0.7e-3);
    }

    fn place([i, j, k]: [usize; 3]) -> Point3<f64> {
        Point3::new(i as f64, j as f64, k as f64)
    }

    #[test]
    fn field_of_a_box_knows_what_is_outside_the_box() {
        let size = [40, 30, 20];
        let grid = VoxelGrid::aligned(size, [1e-3; 3], Point3::origin()).unwrap();
        let mask = random_mask(size, 3000, 8);
        let within = IndexBox {
            first: [10, 8, 3],
            last: [25, 20, 11],
        };
        let whole =
            DistanceField::new(&grid, &mask, IndexBox::whole(size), &options(15e-3, 1)).unwrap();
        let part = DistanceField::new(&grid, &mask, within, &options(15e-3, 2)).unwrap();
        assert_eq!(part.within(), within);
        for voxel in Mask::empty(size).complement().voxels() {
            let wanted = within
                .contains(voxel)
                .then(|| whole.at_voxel(voxel).unwrap());
            assert_eq!(part.at_voxel(voxel), wanted);
        }
    }

    #[test]
    fn signed_field_changes_sign_at_the_surface_and_is_interpolated() {
        let size = [30; 3];
        let grid = VoxelGrid::aligned(size, [1e-3; 3], Point3::origin()).unwrap();
        let mut ball = Mask::empty(size);
        for voxel in Mask::empty(size).complement().voxels() {
            if (place(voxel) - Point3::new(15.0, 15.0, 15.0)).norm() <= 9.0 {
                ball.insert(voxel);
            }
        }
        let field =
            DistanceField::signed(&grid, &ball, IndexBox::whole(size), &options(40e-3, 2)).unwrap();
        assert!((field.at_voxel([15; 3]).unwrap() + 9.0e-3).abs() < 1.1e-3);
        assert!((field.at_voxel([27, 15, 15]).unwrap() - 3e-3).abs() < 2.0 * field.rounding_m());
        // Between the last voxel inside, at -1, and the first one outside, at +1.
        let between = field.at(&Point3::new(24.5e-3, 15e-3, 15e-3)).unwrap();
        assert!(between.abs() < 2.0 * field.rounding_m(), "{between}");
        assert_eq!(field.at(&Point3::new(29.1e-3, 0.0, 0.0)), None);
        assert!(field.at(&Point3::new(29e-3, 0.0, 29e-3)).is_some());
    }

    #[test]
    fn stops_when_told_to() {
        let grid = VoxelGrid::aligned([4; 3], [1e-3; 3], Point3::origin()).unwrap();
        let stop = AtomicBool::new(true);
        let options = DistanceOptions {
            cap_m: 1e-2,
            threads: 1,
            cancel: &stop,
        };
        let field = DistanceField::new(
            &grid,
            &Mask::empty([4; 3]),
            IndexBox::whole([4; 3]),
            &options,
        );
        assert_eq!(field.err(), Some(VolumeError::Interrupted));
    }
}
