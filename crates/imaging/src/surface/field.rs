//! What a surface is the zero of.

use nalgebra::Vector3;

use crate::mask::{IndexBox, Mask, set_bits};

/// A structure on a grid: which voxels are inside, and values that say where between two voxels its surface runs.
#[derive(Debug, Clone, Copy)]
pub struct Field<'a> {
    /// The box that the mask covers.
    pub bounds: IndexBox,
    /// Voxels inside, of the box. It alone decides about topology.
    pub inside: &'a Mask,
    /// What says where the surface runs.
    pub values: Values<'a>,
}

/// What says where between two voxels a surface runs.
#[derive(Debug, Clone, Copy)]
pub enum Values<'a> {
    /// Hounsfield units, trilinear between voxels.
    Hounsfield {
        /// Of the whole grid.
        hu: &'a [i16],
        /// Voxels of the whole grid.
        size: [usize; 3],
        /// Where the surface is, HU.
        level: Level<'a>,
        /// Typical of the inside and the outside, HU: stand for voxels that are on the other side of the level than
        /// the mask says, such as a couch's or a vessel's in the lung.
        typical: [f32; 2],
    },
    /// Nothing but the mask, which is smoothed by (1 2 1)/4 along each axis: the surface of a voxel mask is known to
    /// half a voxel only.
    MaskOnly,
}

/// The level of a surface.
#[derive(Debug, Clone, Copy)]
pub enum Level<'a> {
    /// One for all.
    Everywhere(f32),
    /// One that varies.
    Local(&'a LocalLevel),
}

/// A level that varies slowly: one value per block of voxels of a box, trilinear between the blocks' middles.
#[derive(Debug, Clone)]
pub struct LocalLevel {
    /// First voxel of the box in the grid.
    first: [usize; 3],
    /// Blocks.
    size: [usize; 3],
    /// A level per block, HU.
    levels_hu: Vec<f32>,
    /// For every voxel of the box along each axis the block whose middle is before it, the next one, and the share of
    /// the latter.
    between: [Vec<(usize, usize, f32)>; 3],
}

impl LocalLevel {
    /// Of the blocks of a box whose first voxel is `first`; a block has `block` voxels, and there are `size` of them.
    pub fn new(
        first: [usize; 3],
        block: [usize; 3],
        size: [usize; 3],
        levels_hu: Vec<f32>,
    ) -> Self {
        let between = std::array::from_fn(|axis| {
            let last = size[axis] - 1;
            let places = (0..block[axis] * size[axis]).map(|along| {
                let place = ((along as f32 + 0.5) / block[axis] as f32 - 0.5).max(0.0);
                let low = floor(place).min(last);
                (low, (low + 1).min(last), (place - low as f32).min(1.0))
            });
            places.collect()
        });
        Self {
            first,
            size,
            levels_hu,
            between,
        }
    }

    /// Median of the blocks, HU.
    pub fn median(&self) -> Option<f64> {
        let mut levels = self.levels_hu.clone();
        levels.sort_by(f32::total_cmp);
        levels.get(levels.len() / 2).map(|&level| f64::from(level))
    }

    /// Level at a voxel of the grid, HU; beyond the box that of its nearest voxel.
    pub fn at(&self, voxel: [usize; 3]) -> f32 {
        let [(i, next_i, x), (j, next_j, y), (k, next_k, z)] = [0, 1, 2].map(|axis| {
            let between = &self.between[axis];
            let along = voxel[axis].saturating_sub(self.first[axis]);
            between[along.min(between.len() - 1)]
        });
        let along_i = |j: usize, k: usize| {
            let row = &self.levels_hu[(k * self.size[1] + j) * self.size[0]..];
            row[i] + x * (row[next_i] - row[i])
        };
        let along_j = |k: usize| {
            let (low, high) = (along_i(j, k), along_i(next_j, k));
            low + y * (high - low)
        };
        let (low, high) = (along_j(k), along_j(next_k));
        low + z * (high - low)
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "an index, which is never negative"
)]
fn floor(place: f32) -> usize {
    place as usize
}

/// The eight voxels around a place, as far as they have been looked at.
#[derive(Debug, Clone, Copy)]
pub struct Around {
    low: [isize; 3],
    values: [f64; 8],
}

impl Field<'_> {
    /// Voxels of the whole grid.
    fn grid_size(&self) -> [usize; 3] {
        match self.values {
            Values::Hounsfield { size, .. } => size,
            Values::MaskOnly => [usize::MAX; 3],
        }
    }

    /// Whether a voxel of the grid, which need not be in it, is inside.
    pub fn is_inside(&self, at: [isize; 3]) -> bool {
        self.in_bounds(at)
            .is_some_and(|voxel| self.inside.get(voxel))
    }

    /// The voxel of the mask, if it is one.
    fn in_bounds(&self, at: [isize; 3]) -> Option<[usize; 3]> {
        let mut voxel = [0; 3];
        for axis in 0..3 {
            let shifted = at[axis].checked_sub_unsigned(self.bounds.first[axis])?;
            voxel[axis] = usize::try_from(shifted).ok()?;
            if voxel[axis] >= self.inside.size()[axis] {
                return None;
            }
        }
        Some(voxel)
    }

    /// Positive inside, negative outside, 0 on the surface; never 0 at a voxel. Beyond the volume's end the solid is
    /// mirrored in sign, which closes it half a voxel beyond the last one.
    pub(crate) fn at_voxel(&self, at: [isize; 3]) -> f32 {
        let size = self.grid_size();
        let nearest: [isize; 3] = std::array::from_fn(|axis| {
            let last = size[axis].min(isize::MAX as usize).cast_signed() - 1;
            at[axis].clamp(0, last)
        });
        let value = self.value_in_grid(nearest);
        if nearest == at { value } else { -value.abs() }
    }

    fn value_in_grid(&self, at: [isize; 3]) -> f32 {
        let inside = self.is_inside(at);
        match self.values {
            Values::Hounsfield {
                hu,
                size,
                level,
                typical,
            } => {
                let voxel = at.map(isize::unsigned_abs);
                let level = match level {
                    Level::Everywhere(level) => level,
                    Level::Local(levels) => levels.at(voxel),
                };
                // Lungs are emptier than what is around them.
                let sign = if typical[0] < typical[1] { -1.0 } else { 1.0 };
                let offset = (voxel[2] * size[1] + voxel[1]) * size[0] + voxel[0];
                let value = sign * (f32::from(hu[offset]) - level);
                if (value > 0.0) == inside && value != 0.0 {
                    value
                } else {
                    let instead = sign * (typical[usize::from(!inside)] - level);
                    if inside {
                        instead.max(1.0)
                    } else {
                        instead.min(-1.0)
                    }
                }
            }
            Values::MaskOnly => {
                let smooth = self.smoothed(at) - 0.5;
                // A quarter of a voxel from either at most: thin structures stay.
                if inside {
                    smooth.max(0.125)
                } else {
                    smooth.min(-0.125)
                }
            }
        }
    }

    fn smoothed(&self, at: [isize; 3]) -> f32 {
        let mut sum = 0;
        for step in 0..27_isize {
            let offset = [step % 3 - 1, step / 3 % 3 - 1, step / 9 - 1];
            let weight: i16 = offset.iter().map(|&o| if o == 0 { 2 } else { 1 }).product();
            let voxel = [0, 1, 2].map(|axis| at[axis] + offset[axis]);
            sum += weight * i16::from(self.is_inside(voxel));
        }
        f32::from(sum) / 64.0
    }

    /// Where the surface crosses the line from a voxel to the next one along an axis, which are on its two sides; as an
    /// index of the grid.
    pub fn crossing(&self, at: [isize; 3], axis: usize) -> Vector3<f64> {
        let mut next = at;
        next[axis] += 1;
        let [a, b] = [self.at_voxel(at), self.at_voxel(next)].map(f64::from);
        let mut place = Vector3::from(at.map(|index| index as f64));
        place[axis] += (a / (a - b)).clamp(0.0, 1.0);
        place
    }

    /// Visits the voxels that the surface parts from the next one along an axis, with the axis; also those that the
    /// volume's end or that of the box cuts.
    pub(crate) fn for_each_crossed_line(&self, mut visit: impl FnMut([isize; 3], usize)) {
        let [_, ny, nz] = self.inside.size();
        let first = self.bounds.first.map(usize::cast_signed);
        let empty = vec![0; self.inside.words_per_row()];
        let row = |j: Option<usize>, k: Option<usize>| match j.zip(k) {
            Some((j, k)) if j < ny && k < nz => self.inside.row(j, k),
            _ => &empty[..],
        };
        let mut changed = empty.clone();
        for k in 0..=nz {
            for j in 0..=ny {
                let here = row(Some(j), Some(k));
                for (axis, before) in [
                    (1, row(j.checked_sub(1), Some(k))),
                    (2, row(Some(j), k.checked_sub(1))),
                ] {
                    for ((to, a), b) in changed.iter_mut().zip(here).zip(before) {
                        *to = a ^ b;
                    }
                    for i in set_bits(&changed) {
                        let mut at = [i, j, k].map(usize::cast_signed);
                        at[axis] -= 1;
                        visit([0, 1, 2].map(|axis| at[axis] + first[axis]), axis);
                    }
                }
                if j < ny && k < nz {
                    for i in self.inside.runs(j, k).flatten() {
                        let at = [i, j, k].map(usize::cast_signed);
                        visit(
                            [at[0] - 1 + first[0], at[1] + first[1], at[2] + first[2]],
                            0,
                        );
                    }
                }
            }
        }
    }

    /// Value and gradient per voxel at a place between voxels of the grid, trilinear. What was looked at for a place
    /// before is used where it can be.
    pub fn at(&self, place: &Vector3<f64>, known: &mut Option<Around>) -> (f64, Vector3<f64>) {
        let low = [0, 1, 2].map(|axis| index(place[axis]));
        let around = known
            .filter(|around| around.low == low)
            .unwrap_or_else(|| Around {
                low,
                values: std::array::from_fn(|corner| {
                    let at = [0, 1, 2].map(|axis| low[axis] + (corner >> axis & 1).cast_signed());
                    f64::from(self.at_voxel(at))
                }),
            });
        *known = Some(around);
        let [x, y, z] = [0, 1, 2].map(|axis| place[axis] - low[axis] as f64);
        let v = &around.values;
        // Along x on the four lines, along y on the two faces, along z.
        let lines = [0, 2, 4, 6].map(|at| (v[at] + x * (v[at + 1] - v[at]), v[at + 1] - v[at]));
        let faces = [0, 2].map(|at| {
            let [(low, low_slope), (high, high_slope)] = [lines[at], lines[at + 1]];
            (
                low + y * (high - low),
                low_slope + y * (high_slope - low_slope),
                high - low,
            )
        });
        let [low, high] = faces;
        (
            low.0 + z * (high.0 - low.0),
            Vector3::new(
                low.1 + z * (high.1 - low.1),
                low.2 + z * (high.2 - low.2),
                high.0 - low.0,
            ),
        )
    }
}

/// The voxel at or before a place, which may lie outside the grid.
#[expect(
    clippy::cast_possible_truncation,
    reason = "places are within a voxel of the grid"
)]
fn index(place: f64) -> isize {
    let towards_zero = place as isize;
    towards_zero - isize::from(place < towards_zero as f64)
}
