//! Space cut into cubes.

use nalgebra::{Point3, Vector3};

/// A box along the world's axes, cut into cubes; x runs fastest.
#[derive(Debug, Clone, PartialEq)]
pub struct VoxelGrid {
    /// Lower corner in the world, m.
    pub corner_m: Point3<f64>,
    /// Cubes along x, y and z.
    pub cells: [usize; 3],
    /// Edge of a cube, m.
    pub voxel_m: f64,
}

impl VoxelGrid {
    /// The cube with a side of at least `2 half_width_m` about a point, which is a corner of voxels.
    pub fn about(center_m: &Point3<f64>, half_width_m: f64, voxel_m: f64) -> Self {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a few dozen"
        )]
        let half = (half_width_m / voxel_m).ceil() as usize;
        Self {
            corner_m: center_m - Vector3::repeat(half as f64 * voxel_m),
            cells: [2 * half; 3],
            voxel_m,
        }
    }

    /// Number of voxels.
    pub fn len(&self) -> usize {
        self.cells.iter().product()
    }

    /// Whether there is no voxel.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Column, row and layer of a voxel.
    pub fn place(&self, index: usize) -> [usize; 3] {
        let [across, deep, _] = self.cells;
        [
            index % across,
            index / across % deep,
            index / (across * deep),
        ]
    }

    /// Inverse of [`VoxelGrid::place`].
    pub fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.cells[1] + y) * self.cells[0] + x
    }

    /// Centre of the voxel at a place, m.
    pub(crate) fn center_at_m(&self, place: [usize; 3]) -> Point3<f64> {
        self.corner_m + Vector3::from(place.map(|each| (each as f64 + 0.5) * self.voxel_m))
    }

    /// Centre of a voxel, m.
    pub fn center_m(&self, index: usize) -> Point3<f64> {
        self.center_at_m(self.place(index))
    }
}
