//! Where voxels are.

use nalgebra::{Matrix3, Point3, Vector3};

/// A lattice of voxels in `ct`: any affine one, also sheared (a tilted gantry) or left-handed.
#[derive(Debug, Clone, PartialEq)]
pub struct VoxelGrid {
    size: [usize; 3],
    ct_from_index: Matrix3<f64>,
    first_m: Point3<f64>,
    index_from_ct: Matrix3<f64>,
}

/// Why there is no such lattice.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NotAGrid {
    /// A direction without voxels.
    #[error("it is {} x {} x {} voxels", .0[0], .0[1], .0[2])]
    Empty([usize; 3]),
    /// More voxels than memory can hold.
    #[error("{} x {} x {} voxels are too many", .0[0], .0[1], .0[2])]
    TooLarge([usize; 3]),
    /// Steps that are not finite, or that do not span space.
    #[error("the voxel axes are linearly dependent or not finite")]
    Flat,
}

/// Volume of a voxel over the product of its steps below which steps count as flat: sin(0.06 deg).
const FLAT: f64 = 1e-3;

impl VoxelGrid {
    /// Of `size` voxels: columns, rows, slices. The columns of `ct_from_index` are the steps in m from one voxel's centre
    /// to the next one's along i, j and k; `first_m` is the centre of voxel (0, 0, 0).
    pub fn new(
        size: [usize; 3],
        ct_from_index: Matrix3<f64>,
        first_m: Point3<f64>,
    ) -> Result<Self, NotAGrid> {
        if size.contains(&0) {
            return Err(NotAGrid::Empty(size));
        }
        let count = size[0]
            .checked_mul(size[1])
            .and_then(|plane| plane.checked_mul(size[2]));
        if count.is_none_or(|count| count > isize::MAX as usize / 8) {
            return Err(NotAGrid::TooLarge(size));
        }
        let steps: f64 = ct_from_index
            .column_iter()
            .map(|step| step.norm())
            .product();
        let is_flat = ct_from_index.determinant().abs() < FLAT * steps || steps <= 0.0;
        let finite = |value: &f64| value.is_finite();
        if !ct_from_index.iter().all(finite) || !first_m.iter().all(finite) || is_flat {
            return Err(NotAGrid::Flat);
        }
        let index_from_ct = ct_from_index.try_inverse().ok_or(NotAGrid::Flat)?;
        Ok(Self {
            size,
            ct_from_index,
            first_m,
            index_from_ct,
        })
    }

    /// With its axes along those of `ct`: `spacing_m` between centres, `first_m` the centre of voxel (0, 0, 0).
    pub fn aligned(
        size: [usize; 3],
        spacing_m: [f64; 3],
        first_m: Point3<f64>,
    ) -> Result<Self, NotAGrid> {
        Self::new(
            size,
            Matrix3::from_diagonal(&Vector3::from(spacing_m)),
            first_m,
        )
    }

    /// Columns, rows, slices.
    pub fn size(&self) -> [usize; 3] {
        self.size
    }

    /// Number of voxels.
    pub fn len(&self) -> usize {
        self.size.iter().product()
    }

    /// Never: a grid has at least one voxel.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Steps in m from a voxel's centre to the next one's along i, j and k, as columns.
    pub fn steps_m(&self) -> &Matrix3<f64> {
        &self.ct_from_index
    }

    /// Centre of voxel (0, 0, 0), in `ct`.
    pub fn first_m(&self) -> Point3<f64> {
        self.first_m
    }

    /// Distance in m between neighbours along i, j and k.
    pub fn spacing_m(&self) -> [f64; 3] {
        [0, 1, 2].map(|axis| self.ct_from_index.column(axis).norm())
    }

    /// Whether i, j and k run along +x, +y and +z of `ct`, up to rounding: 1e-9 of a step.
    pub fn is_aligned(&self) -> bool {
        let spacing_m = self.spacing_m();
        (0..3).all(|axis| {
            let step = self.ct_from_index.column(axis);
            (0..3).all(|row| {
                let wanted = if row == axis { spacing_m[axis] } else { 0.0 };
                (step[row] - wanted).abs() <= 1e-9 * spacing_m[axis]
            })
        })
    }

    /// Place in `ct` of an index, which may lie between voxels and outside.
    pub fn ct_from_index(&self, index: &Point3<f64>) -> Point3<f64> {
        self.first_m + self.ct_from_index * index.coords
    }

    /// Index of a place in `ct`; not rounded, and outside the volume where the place is.
    pub fn index_from_ct(&self, point_m: &Point3<f64>) -> Point3<f64> {
        Point3::from(self.index_from_ct * (point_m - self.first_m))
    }

    /// Centres of the eight voxels at the corners, in `ct`.
    pub fn corners_m(&self) -> [Point3<f64>; 8] {
        std::array::from_fn(|corner| {
            let at = |axis: usize| {
                let last = (self.size[axis] - 1) as f64;
                if corner >> axis & 1 == 1 { last } else { 0.0 }
            };
            self.ct_from_index(&Point3::new(at(0), at(1), at(2)))
        })
    }

    /// The largest distance in m between corresponding corners of two grids.
    pub fn farthest_corners_m(&self, other: &Self) -> f64 {
        let pairs = self.corners_m().into_iter().zip(other.corners_m());
        pairs.map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
    }

    /// Angle in rad between the step from slice to slice and the normal of the slices: a tilted gantry's. 0 for
    /// slices that lie straight above one another.
    pub fn tilt_rad(&self) -> f64 {
        let [i, j, k] = [0, 1, 2].map(|axis| self.ct_from_index.column(axis).into_owned());
        let normal = i.cross(&j);
        let along = normal.dot(&k).abs();
        libm::atan2(normal.cross(&k).norm(), along)
    }

    /// The voxel that an index is in; none outside the grid.
    pub fn voxel_at(&self, index: &Point3<f64>) -> Option<[usize; 3]> {
        let mut voxel = [0; 3];
        for (axis, size) in self.size().into_iter().enumerate() {
            let at = index[axis].round();
            if !(0.0..size as f64).contains(&at) {
                return None;
            }
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "within the grid"
            )]
            {
                voxel[axis] = at as usize;
            }
        }
        Some(voxel)
    }

    /// Offset of a voxel in the data: columns run fastest, slices slowest.
    pub fn offset(&self, [i, j, k]: [usize; 3]) -> usize {
        (k * self.size[1] + j) * self.size[0] + i
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of coordinates below a metre: some roundings of 1e-16.
    const ROUNDING: f64 = 1e-12;

    #[test]
    fn places_and_indices_go_back_and_forth_on_a_sheared_left_handed_grid() {
        let steps = Matrix3::new(
            7e-4, 1e-5, 0.0, //
            0.0, -7e-4, 4e-4, //
            2e-5, 0.0, 1e-3,
        );
        let grid = VoxelGrid::new([512, 512, 300], steps, Point3::new(-0.1, 0.2, 0.3)).unwrap();
        let index = Point3::new(17.25, 400.0, 299.5);
        let back = grid.index_from_ct(&grid.ct_from_index(&index));
        assert!((back - index).norm() < 1e3 * ROUNDING, "{back}");
        assert!(!grid.is_aligned());
        assert_eq!(grid.offset([3, 2, 1]), 3 + 512 * (2 + 512));
    }

    #[test]
    fn what_is_no_lattice_is_refused() {
        let first = Point3::origin();
        assert_eq!(
            VoxelGrid::aligned([4, 0, 4], [1e-3; 3], first),
            Err(NotAGrid::Empty([4, 0, 4]))
        );
        assert_eq!(
            VoxelGrid::aligned([4; 3], [1e-3, 0.0, 1e-3], first),
            Err(NotAGrid::Flat)
        );
        assert_eq!(
            VoxelGrid::aligned([4; 3], [1e-3, f64::NAN, 1e-3], first),
            Err(NotAGrid::Flat)
        );
        let same = Matrix3::new(1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0);
        assert_eq!(VoxelGrid::new([4; 3], same, first), Err(NotAGrid::Flat));
        let huge = [usize::MAX / 2, 3, 1];
        assert_eq!(
            VoxelGrid::aligned(huge, [1e-3; 3], first),
            Err(NotAGrid::TooLarge(huge))
        );
    }
}
