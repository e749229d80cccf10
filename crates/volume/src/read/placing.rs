//! Grids that are assumed, and what no grid of a CT can be.

use nalgebra::{Matrix3, Point3, Vector3};

use super::{DAMAGED, ReadOptions};
use crate::{NotAGrid, Orientation, Remark, VolumeError, VoxelGrid};

/// Distances between voxels that CT scanners have, from micro-CT to scouts.
const SPACING_M: [f64; 2] = [1e-6, 0.05];

/// No CT is longer.
const EXTENT_M: f64 = 5.0;

/// A grid whose axes run as `orientation` says, around the origin.
fn centred(
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
) -> Result<(), VolumeError> {
    let spacing_m = grid.spacing_m();
    for (axis, name) in ["i", "j", "k"].into_iter().enumerate() {
        let extent_m = spacing_m[axis] * grid.size()[axis] as f64;
        if !(SPACING_M[0]..=SPACING_M[1]).contains(&spacing_m[axis]) || extent_m > EXTENT_M {
            return Err(VolumeError::refused(format!(
                "a voxel spacing of {:.6} mm along {name}, {:.3} m in total, is implausible for a \
                 CT",
                spacing_m[axis] * 1e3,
                extent_m
            ))
            .hint(match unit_key {
                None => {
                    "correct the distances between voxels in the header, which are in mm".to_owned()
                }
                Some(key) => format!(
                    "correct the unit of length in the header ({key}): most files are in mm"
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

/// A grid in LPS metres: `steps` along its axes as columns and the centre of its first voxel, both in a unit of
/// `unit_m` and in axes that become LPS by `signs`.
pub(super) fn in_lps(
    size: [usize; 3],
    signs: [f64; 3],
    steps: &Matrix3<f64>,
    first: &Point3<f64>,
    unit_m: f64,
) -> Result<VoxelGrid, NotAGrid> {
    // Rounded the same way as a plain division by 1000 where the unit is mm.
    let scaled = |each: f64| {
        if unit_m == 1e-3 {
            each / 1e3
        } else {
            each * unit_m
        }
    };
    let to_lps = Matrix3::from_diagonal(&Vector3::from(signs));
    VoxelGrid::new(
        size,
        to_lps * steps.map(scaled),
        Point3::from(to_lps * first.coords.map(scaled)),
    )
}

/// Voxels whose header does not say how they lie in the patient.
pub(super) struct Unplaced<'a> {
    /// What is wrong with that.
    pub(super) what: &'a str,
    /// Where the header should say it.
    pub(super) place: &'a str,
    /// Distances between voxels, where they are known.
    pub(super) spacing_m: Option<[f64; 3]>,
    pub(super) size: [usize; 3],
}

/// The grid that the options assume; refused where they assume none.
pub(super) fn unplaced(
    voxels: &Unplaced,
    options: &ReadOptions,
    remarks: &mut Vec<Remark>,
) -> Result<VoxelGrid, VolumeError> {
    let Some(assumed) = &options.assume_orientation else {
        return Err(VolumeError::refused(voxels.what).at(voxels.place).hint(
            "write the directions of the voxel axes into the header; or, if you know them, give \
             them, e.g. --assume-orientation LPS: columns to the patient's left, rows to posterior, \
             slices to superior",
        ));
    };
    let Some(spacing_m) = voxels.spacing_m else {
        return Err(
            VolumeError::refused("the distances between voxels are not stated")
                .at(voxels.place)
                .hint("write them into the header"),
        );
    };
    remarks.push(
        Remark::new(format!(
            "no orientation in the header: voxel axes {assumed} assumed, with the origin at the \
             volume's centre"
        ))
        .at(voxels.place),
    );
    centred(assumed, spacing_m, voxels.size).map_err(|problem| {
        VolumeError::refused(problem.to_string())
            .at(voxels.place)
            .hint(DAMAGED)
    })
}
