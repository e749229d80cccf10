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
        /// the mask says, such as a bed's or a vessel's in the lung.
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
    pub first: [usize; 3],
    /// Voxels of a block.
    pub block: [usize; 3],
    /// Blocks.
    pub size: [usize; 3],
    /// A level per block, HU.
    pub levels_hu: Vec<f32>,
}

impl LocalLevel {
    /// Median of the blocks, HU.
    pub fn median(&self) -> Option<f64> {
        let mut levels = self.levels_hu.clone();
        levels.sort_by(f32::total_cmp);
        levels.get(levels.len() / 2).map(|&level| f64::from(level))
    }

    /// Level at a voxel of the grid, HU.
    pub fn at(&self, voxel: [usize; 3]) -> f32 {
        let mut low = [0; 3];
        let mut part = [0.0; 3];
        for axis in 0..3 {
            let along = voxel[axis].saturating_sub(self.first[axis]) as f32 + 0.5;
            let place = (along / self.block[axis] as f32 - 0.5).max(0.0);
            let last = self.size[axis] - 1;
            low[axis] = floor(place).min(last);
            part[axis] = (place - low[axis] as f32).min(1.0);
        }
        let mut sum = 0.0;
        for corner in 0..8 {
            let mut at = low;
            let mut weight = 1.0;
            for axis in 0..3 {
                if corner >> axis & 1 == 1 {
                    at[axis] = (low[axis] + 1).min(self.size[axis] - 1);
                    weight *= part[axis];
                } else {
                    weight *= 1.0 - part[axis];
                }
            }
            sum += weight * self.levels_hu[(at[2] * self.size[1] + at[1]) * self.size[0] + at[0]];
        }
        sum
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
    pub fn at_voxel(&self, at: [isize; 3]) -> f32 {
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
    pub fn for_each_crossed_line(&self, mut visit: impl FnMut([isize; 3], usize)) {
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

    /// Value and gradient per voxel at a place between voxels of the grid, trilinear.
    pub fn at(&self, place: &Vector3<f64>) -> (f64, Vector3<f64>) {
        let low = place.map(f64::floor);
        let part = place - low;
        let low = [0, 1, 2].map(|axis| index(low[axis]));
        let mut value = 0.0;
        let mut gradient = Vector3::zeros();
        for corner in 0..8_usize {
            let bit = |axis: usize| corner >> axis & 1;
            let at = [0, 1, 2].map(|axis| low[axis] + bit(axis).cast_signed());
            let here = f64::from(self.at_voxel(at));
            let weight = |axis: usize| {
                if bit(axis) == 1 {
                    part[axis]
                } else {
                    1.0 - part[axis]
                }
            };
            let [x, y, z] = [weight(0), weight(1), weight(2)];
            value += x * y * z * here;
            let slope = |axis: usize| if bit(axis) == 1 { here } else { -here };
            gradient += Vector3::new(slope(0) * y * z, slope(1) * x * z, slope(2) * x * y);
        }
        (value, gradient)
    }
}

/// Of a voxel, which may lie outside the grid.
#[expect(
    clippy::cast_possible_truncation,
    reason = "places are within a voxel of the grid"
)]
fn index(place: f64) -> isize {
    place as isize
}
