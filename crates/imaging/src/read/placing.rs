//! Grids that are assumed, and what no grid of a CT can be.

use nalgebra::{Matrix3, Point3, Vector3};

use crate::{ImagingError, NotAGrid, Orientation, Remark, VoxelGrid};

/// Distances between voxels that CT scanners have, from micro-CT to scouts.
const SPACING_M: [f64; 2] = [1e-6, 0.05];

/// No CT is longer.
const EXTENT_M: f64 = 5.0;

/// For people.
pub(super) fn letters_of(orientation: &Orientation) -> String {
    orientation.to_string()
}

/// A grid whose axes run as `orientation` says, around the origin.
pub(super) fn centred(
    orientation: &Orientation,
    spacing_m: [f64; 3],
    size: [usize; 3],
) -> Result<VoxelGrid, NotAGrid> {
    let mut steps = Matrix3::zeros();
    for (axis, (row, direction)) in orientation.axes().into_iter().enumerate() {
        steps[(row, axis)] = direction * spacing_m[axis];
    }
    let half = Vector3::from(size.map(|voxels| (voxels as f64 - 1.0) / 2.0));
    VoxelGrid::new(size, steps, Point3::from(-(steps * half)))
}

/// Rejects spacings of another unit, and remarks on those that are probably defaults. `unit_key` is where the header
/// states a unit other than mm.
pub(super) fn within_reason(
    grid: &VoxelGrid,
    unit_key: Option<&str>,
    remarks: &mut Vec<Remark>,
) -> Result<(), ImagingError> {
    let spacing_m = grid.spacing_m();
    for (axis, name) in ["i", "j", "k"].into_iter().enumerate() {
        let extent_m = spacing_m[axis] * grid.size()[axis] as f64;
        if !(SPACING_M[0]..=SPACING_M[1]).contains(&spacing_m[axis]) || extent_m > EXTENT_M {
            return Err(ImagingError::refused(format!(
                "a voxel spacing of {:.6} mm along {name}, {:.3} m in total, is implausible for a \
                 CT",
                spacing_m[axis] * 1e3,
                extent_m
            ))
            .hint(match unit_key {
                None => "correct the affine in the header, which is in mm".to_owned(),
                Some(key) => format!(
                    "correct the unit of length in the header ({key}): most affines are in mm"
                ),
            }));
        }
    }
    if spacing_m.iter().all(|each| (each - 1e-3).abs() < 1e-9) {
        remarks.push(Remark::new(
            "voxels are exactly 1 x 1 x 1 mm, which some programs write for an unknown spacing: \
             check a known length",
        ));
    }
    Ok(())
}
