//! Where the voxels are: the space, its directions and its origin, which is the centre of the first voxel.

use nalgebra::{Matrix3, Point3, Vector3};

use super::axes::{Axes, vector};
use crate::read::placing::{Unplaced, in_lps, unplaced, within_reason};
use crate::read::text_header::{Entries, Entry, shown};
use crate::read::{DAMAGED, ReadOptions};
use crate::{Remark, VolumeError, VoxelGrid};

/// Signs by which a space becomes LPS; none for one that is not the patient's.
fn to_lps(space: &Entry) -> Result<Option<[f64; 3]>, VolumeError> {
    let name = space.value.to_ascii_lowercase().replace(['_', ' '], "-");
    match name.as_str() {
        "left-posterior-superior" | "lps" => Ok(Some([1.0, 1.0, 1.0])),
        "right-anterior-superior" | "ras" => Ok(Some([-1.0, -1.0, 1.0])),
        "left-anterior-superior" | "las" => Ok(Some([1.0, -1.0, 1.0])),
        "scanner-xyz" | "3d-right-handed" | "3d-left-handed" => Ok(None),
        name if name.ends_with("-time") || matches!(name, "rast" | "last" | "lpst") => Err(space
            .refused("the space has time as its fourth axis: a CT has one volume")
            .hint("write the required one to its own file, e.g. with 3D Slicer")),
        _ => Err(space
            .refused(format!("`{}` is a space unknown in NRRD", shown(&space.value)))
            .hint("left-posterior-superior, right-anterior-superior and left-anterior-superior are read")),
    }
}

/// Metres in the unit of the space.
fn unit_m(fields: &Entries, remarks: &mut Vec<Remark>) -> Result<f64, VolumeError> {
    let Some(entry) = fields.get("space units") else {
        return Ok(1e-3);
    };
    let units: Vec<&str> = entry
        .value
        .split('"')
        .map(str::trim)
        .filter(|unit| !unit.is_empty())
        .collect();
    let [first, others @ ..] = units.as_slice() else {
        return Ok(1e-3);
    };
    if others.iter().any(|unit| unit != first) {
        return Err(entry
            .refused("the axes of the space have different units")
            .hint("write the directions in mm"));
    }
    match first.to_ascii_lowercase().as_str() {
        "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" | "???" => Ok(1e-3),
        "m" | "meter" | "meters" | "metre" | "metres" => {
            remarks.push(Remark::new("the header uses metres").at("space units"));
            Ok(1.0)
        }
        "um" | "\u{b5}m" | "\u{3bc}m" | "micron" | "microns" | "micrometer" | "micrometre" => {
            remarks.push(Remark::new("the header uses micrometres").at("space units"));
            Ok(1e-6)
        }
        "cm" => {
            remarks.push(Remark::new("the header uses centimetres").at("space units"));
            Ok(1e-2)
        }
        _ => Err(entry
            .refused(format!("`{}` is not a unit of length", shown(first)))
            .hint("write the directions in mm, with `space units: \"mm\" \"mm\" \"mm\"`")),
    }
}

pub(super) fn grid(
    fields: &Entries,
    axes: &Axes,
    options: &ReadOptions,
    remarks: &mut Vec<Remark>,
) -> Result<VoxelGrid, VolumeError> {
    let unit_m = unit_m(fields, remarks)?;
    let signs = match fields.get("space") {
        Some(space) => to_lps(space)?,
        None => None,
    };
    let grid = match (signs, &axes.steps) {
        (Some(signs), Some(steps)) => {
            let origin = if let Some(entry) = fields.get("space origin") {
                vector(&entry.value, entry)?
            } else {
                remarks.push(
                    Remark::new("no origin of the voxels is given: 0, 0, 0 assumed")
                        .at("space origin"),
                );
                [0.0; 3]
            };
            let steps = Matrix3::from_columns(&steps.map(Vector3::from));
            in_lps(axes.size, signs, &steps, &Point3::from(origin), unit_m).map_err(|problem| {
                VolumeError::refused(problem.to_string())
                    .at("space directions")
                    .hint(DAMAGED)
            })?
        }
        (signs, steps) => {
            let (what, place) = if signs.is_some() {
                (
                    "the directions of the voxel axes are not stated",
                    "space directions",
                )
            } else {
                (
                    "the space of the header is not the patient's (LPS, RAS or LAS): left and right of the patient \
                     are unknown",
                    "space",
                )
            };
            let spacing = steps
                .map(|steps| steps.map(|step| Vector3::from(step).norm()))
                .or(axes.spacings);
            let unplaced_voxels = Unplaced {
                what,
                place,
                spacing_m: spacing.map(|spacing| spacing.map(|each| each * unit_m)),
                size: axes.size,
            };
            unplaced(&unplaced_voxels, options, remarks)?
        }
    };
    let unit_key = (unit_m != 1e-3).then_some("space units");
    within_reason(&grid, unit_key, remarks)?;
    Ok(grid)
}
