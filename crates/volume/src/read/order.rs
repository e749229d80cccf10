//! Label maps on the voxels of a CT whose axes run otherwise, or that have a part of them.

use super::{ReadOptions, zeroed};
use crate::orientation::PERMUTATIONS;
use crate::{Remark, VolumeError, VoxelGrid};

/// Distance between corners up to which two grids are the same.
const SAME_CORNERS_M: f64 = 1e-5;

/// Which axis of another grid runs along each axis of ours, whether the other way, and from which voxel on.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Order {
    /// Of the other grid, along its axes.
    size: [usize; 3],
    axes: [(usize, bool); 3],
    /// The voxel of ours at which the other grid begins.
    first: [usize; 3],
}

impl Order {
    pub(super) fn between(own: &VoxelGrid, wanted: &VoxelGrid) -> Result<Self, VolumeError> {
        let mut nearest_m = f64::INFINITY;
        for permutation in PERMUTATIONS {
            let size = permutation.map(|axis| own.size()[axis]);
            if (0..3).any(|axis| size[axis] > wanted.size()[axis]) {
                continue;
            }
            for flips in 0..8 {
                let mut order = Self {
                    size: own.size(),
                    axes: [0, 1, 2].map(|axis| (permutation[axis], flips >> axis & 1 == 1)),
                    first: [0; 3],
                };
                order.first = order.nearest_first(own, wanted);
                let apart_m = order.farthest_corners_m(own, wanted);
                if apart_m <= SAME_CORNERS_M {
                    return Ok(order);
                }
                if size == wanted.size() {
                    nearest_m = nearest_m.min(apart_m);
                }
            }
        }
        let [a, b] = [own, wanted].map(|grid| words(grid.size()));
        let what = if nearest_m.is_finite() {
            format!(
                "its voxel corners are up to {:.3} mm from the CT's",
                nearest_m * 1e3
            )
        } else {
            format!("it has {a} voxels, the CT {b}")
        };
        Err(
            VolumeError::refused(format!("the label map belongs to another volume: {what}"))
                .hint("export it in the geometry of the CT"),
        )
    }

    /// Voxels of the other grid along our axes.
    fn lengths(&self) -> [usize; 3] {
        self.axes.map(|(axis, _)| self.size[axis])
    }

    /// The voxel of ours that is nearest to where the other grid begins, so that all of it is in ours.
    fn nearest_first(&self, own: &VoxelGrid, wanted: &VoxelGrid) -> [usize; 3] {
        let index = wanted.index_from_ct(&place(own, self.index([0; 3])));
        let lengths = self.lengths();
        [0, 1, 2].map(|axis| {
            let most = (wanted.size()[axis] - lengths[axis]) as f64;
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "within the grid; 0 where it is not finite"
            )]
            let first = index[axis].round().clamp(0.0, most) as usize;
            first
        })
    }

    /// Index in the other grid of one in ours, counted from its first voxel there.
    fn index(&self, index: [usize; 3]) -> [usize; 3] {
        let mut other = [0; 3];
        for ((axis, is_flipped), at) in self.axes.into_iter().zip(index) {
            other[axis] = if is_flipped {
                self.size[axis] - 1 - at
            } else {
                at
            };
        }
        other
    }

    fn farthest_corners_m(&self, own: &VoxelGrid, wanted: &VoxelGrid) -> f64 {
        let lengths = self.lengths();
        (0..8)
            .map(|corner| {
                let at = [0, 1, 2].map(|axis| {
                    if corner >> axis & 1 == 1 {
                        lengths[axis] - 1
                    } else {
                        0
                    }
                });
                let ours = [0, 1, 2].map(|axis| self.first[axis] + at[axis]);
                (place(own, self.index(at)) - place(wanted, ours)).norm()
            })
            .fold(0.0, f64::max)
    }

    pub(super) fn is_same(&self, grid: &VoxelGrid) -> bool {
        self.axes == [(0, false), (1, false), (2, false)] && self.size == grid.size()
    }

    pub(super) fn applied(
        &self,
        values: &[u16],
        grid: &VoxelGrid,
        options: &ReadOptions,
    ) -> Result<Vec<u16>, VolumeError> {
        options.check_memory(grid, (grid.len() * size_of::<u16>()) as u64)?;
        let mut labels = zeroed(grid.len())?;
        let [columns, rows, slices] = self.lengths();
        for k in 0..slices {
            for j in 0..rows {
                let start = grid.offset([self.first[0], self.first[1] + j, self.first[2] + k]);
                for (i, label) in labels[start..start + columns].iter_mut().enumerate() {
                    let [a, b, c] = self.index([i, j, k]);
                    *label = values[(c * self.size[1] + b) * self.size[0] + a];
                }
            }
        }
        Ok(labels)
    }

    /// Where the other grid's first voxel is in our data, and how far each of its axes steps there.
    pub(super) fn steps(&self, grid: &VoxelGrid) -> (usize, [isize; 3]) {
        let [nx, ny, _] = grid.size();
        let mut first = self.first;
        let mut steps = [0; 3];
        for (at, (axis, is_flipped)) in self.axes.into_iter().enumerate() {
            let step = [1, nx, nx * ny][at].cast_signed();
            steps[axis] = if is_flipped { -step } else { step };
            if is_flipped {
                first[at] += self.size[axis] - 1;
            }
        }
        (grid.offset(first), steps)
    }

    /// That the other grid has a part of our voxels.
    pub(super) fn part(&self, grid: &VoxelGrid) -> Option<Remark> {
        let lengths = self.lengths();
        (lengths != grid.size()).then(|| {
            let [i, j, k] = self.first;
            Remark::new(format!(
                "it has {} of the CT's {} voxels, from voxel {i}, {j}, {k} on: the others have no label",
                words(lengths),
                words(grid.size())
            ))
        })
    }
}

fn words([i, j, k]: [usize; 3]) -> String {
    format!("{i} x {j} x {k}")
}

/// Of a voxel, in `ct`.
fn place(grid: &VoxelGrid, index: [usize; 3]) -> nalgebra::Point3<f64> {
    let index = index.map(|each| each as f64);
    grid.ct_from_index(&nalgebra::Point3::from(nalgebra::Vector3::from(index)))
}
