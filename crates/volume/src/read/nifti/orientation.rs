//! Where the voxels are: sform, qform, and what to do when they are missing or disagree.
//!
//! NIfTI's world is RAS: +x to the patient's right, +y anterior. Ours is LPS.

use nalgebra::{Matrix3, Matrix3x4, Point3, Vector3};

use crate::read::ReadOptions;
use crate::read::fields::Fields;
use crate::read::placing::{Unplaced, in_lps, unplaced, within_reason};
use crate::{NotAGrid, Remark, VolumeError, VoxelGrid};

/// Distance between places by sform and qform above which they disagree.
const AGREEMENT_M: f64 = 1e-5;

/// Bytes at which the fields of the two versions stand.
struct Places {
    pixdim: usize,
    qform_code: usize,
    quatern: usize,
    srow: usize,
    units: usize,
    real: fn(&Fields, usize) -> f64,
    real_bytes: usize,
    code: fn(&Fields, usize) -> i64,
    code_bytes: usize,
}

const PLACES_1: Places = Places {
    pixdim: 76,
    qform_code: 252,
    quatern: 256,
    srow: 280,
    units: 123,
    real: |fields, at| fields.f32(at),
    real_bytes: 4,
    code: |fields, at| fields.i16(at),
    code_bytes: 2,
};

const PLACES_2: Places = Places {
    pixdim: 104,
    qform_code: 344,
    quatern: 352,
    srow: 400,
    units: 500,
    real: |fields, at| fields.f64(at),
    real_bytes: 8,
    code: |fields, at| fields.i32(at),
    code_bytes: 4,
};

/// What a header says of place.
#[derive(Debug)]
pub(super) struct Placement {
    /// Of the voxels, in the header's unit.
    spacing: [f64; 3],
    qfac: f64,
    qform_code: i64,
    sform_code: i64,
    quaternion_bcd: [f64; 3],
    /// Of the quaternion's square, as its numbers are written.
    rounding: f64,
    offset: [f64; 3],
    sform: Matrix3x4<f64>,
    unit: i64,
}

impl Placement {
    pub(super) fn read(fields: &Fields, is_first: bool) -> Self {
        let places = if is_first { &PLACES_1 } else { &PLACES_2 };
        let real =
            |start: usize, index: usize| (places.real)(fields, start + index * places.real_bytes);
        let unit = if is_first {
            fields.byte(places.units).into()
        } else {
            fields.i32(places.units)
        };
        Self {
            spacing: [1, 2, 3].map(|index| real(places.pixdim, index)),
            qfac: if real(places.pixdim, 0) < 0.0 {
                -1.0
            } else {
                1.0
            },
            qform_code: (places.code)(fields, places.qform_code),
            sform_code: (places.code)(fields, places.qform_code + places.code_bytes),
            quaternion_bcd: [0, 1, 2].map(|index| real(places.quatern, index)),
            rounding: if is_first {
                3.0 * f64::from(f32::EPSILON)
            } else {
                3.0 * f64::EPSILON
            },
            offset: [3, 4, 5].map(|index| real(places.quatern, index)),
            sform: Matrix3x4::from_fn(|row, column| real(places.srow, 4 * row + column)),
            unit: unit & 7,
        }
    }

    /// World from index by the quaternion, in the header's unit; none where it is no rotation.
    fn qform(&self) -> Option<Matrix3x4<f64>> {
        let [b, c, d] = self.quaternion_bcd;
        let rest = 1.0 - (b * b + c * c + d * d);
        // What 32 bits leave of a half turn; nibabel allows as much.
        if rest < -1e-5 || !rest.is_finite() {
            return None;
        }
        // Of a half turn the rest is rounding, and its root a turn of a hundredth of a degree.
        let a = if rest < self.rounding {
            0.0
        } else {
            rest.sqrt()
        };
        let norm = (a * a + b * b + c * c + d * d).sqrt();
        let [a, b, c, d] = [a, b, c, d].map(|each| each / norm);
        let turn = Matrix3::new(
            a * a + b * b - c * c - d * d,
            2.0 * (b * c - a * d),
            2.0 * (b * d + a * c),
            2.0 * (b * c + a * d),
            a * a + c * c - b * b - d * d,
            2.0 * (c * d - a * b),
            2.0 * (b * d - a * c),
            2.0 * (c * d + a * b),
            a * a + d * d - b * b - c * c,
        );
        let [i, j, k] = self.spacing.map(f64::abs);
        let steps = turn * Matrix3::from_diagonal(&Vector3::new(i, j, k * self.qfac));
        let mut world_from_index = Matrix3x4::zeros();
        world_from_index.fixed_columns_mut::<3>(0).copy_from(&steps);
        world_from_index
            .fixed_columns_mut::<1>(3)
            .copy_from_slice(&self.offset);
        Some(world_from_index)
    }

    /// Metres in the header's unit of length.
    fn unit_m(&self, remarks: &mut Vec<Remark>) -> f64 {
        match self.unit {
            1 => {
                remarks.push(Remark::new("the header uses metres").at("xyzt_units"));
                1.0
            }
            2 => 1e-3,
            3 => {
                remarks.push(Remark::new("the header uses micrometres").at("xyzt_units"));
                1e-6
            }
            unit => {
                let what = if unit == 0 {
                    "no unit of length is given".to_owned()
                } else {
                    format!("{unit} is not a unit of length")
                };
                remarks.push(Remark::new(format!("{what}: mm assumed")).at("xyzt_units"));
                1e-3
            }
        }
    }
}

/// In LPS metres.
fn in_ct(
    world_from_index: &Matrix3x4<f64>,
    unit_m: f64,
    size: [usize; 3],
) -> Result<VoxelGrid, NotAGrid> {
    in_lps(
        size,
        [-1.0, -1.0, 1.0],
        &world_from_index.fixed_columns::<3>(0).into_owned(),
        &Point3::from(world_from_index.column(3).into_owned()),
        unit_m,
    )
}

const AFFINE: &str = "write the affine into the header again, e.g. with nibabel";

fn not_a_grid(problem: &NotAGrid, place: &str) -> VolumeError {
    VolumeError::refused(problem.to_string())
        .at(place)
        .hint(AFFINE)
}

/// The grid of the header, by the form that counts.
pub(super) fn grid(
    placement: &Placement,
    size: [usize; 3],
    options: &ReadOptions,
    remarks: &mut Vec<Remark>,
) -> Result<VoxelGrid, VolumeError> {
    let unit_m = placement.unit_m(remarks);
    let of_form = |form: &Matrix3x4<f64>, name: &str| {
        in_ct(form, unit_m, size).map_err(|problem| not_a_grid(&problem, name))
    };
    let has_sform = placement.sform_code > 0;
    let has_qform = placement.qform_code > 0;
    let by_sform = has_sform.then(|| of_form(&placement.sform, "sform"));
    let by_qform = has_qform.then(|| match placement.qform() {
        Some(form) => of_form(&form, "qform"),
        None => Err(
            VolumeError::refused("the quaternion has a norm above 1: not a rotation")
                .at("qform")
                .hint(AFFINE),
        ),
    });
    let grid = match (by_sform, by_qform) {
        (Some(by_sform), by_qform) => {
            let by_sform = by_sform?;
            compare(&by_sform, by_qform, remarks);
            by_sform
        }
        (None, Some(by_qform)) => by_qform?,
        (None, None) => unplaced(
            &Unplaced {
                what: "neither sform nor qform: left and right of the patient are unknown",
                place: "sform_code, qform_code",
                spacing_m: Some(placement.spacing.map(|each| each.abs() * unit_m)),
                size,
            },
            options,
            remarks,
        )?,
    };
    let unit_key = (unit_m != 1e-3).then_some("xyzt_units");
    within_reason(&grid, unit_key, remarks)?;
    let differs = grid
        .spacing_m()
        .into_iter()
        .zip(placement.spacing)
        .any(|(spacing_m, stated)| (stated.abs() * unit_m - spacing_m).abs() > 1e-3 * spacing_m);
    if has_sform && differs {
        remarks.push(
            Remark::new(format!(
                "states a voxel spacing of {} mm, the sform {} mm: the sform is used",
                in_mm(placement.spacing.map(|each| each.abs() * unit_m)),
                in_mm(grid.spacing_m()),
            ))
            .at("pixdim"),
        );
    }
    Ok(grid)
}

fn in_mm(lengths_m: [f64; 3]) -> String {
    let [i, j, k] = lengths_m.map(|each| each * 1e3);
    format!("{i:.4} x {j:.4} x {k:.4}")
}

fn compare(
    by_sform: &VoxelGrid,
    by_qform: Option<Result<VoxelGrid, VolumeError>>,
    remarks: &mut Vec<Remark>,
) {
    let message = match by_qform {
        None => return,
        Some(Err(_)) => "the qform is not a rigid transform: the sform is used".to_owned(),
        Some(Ok(by_qform)) => {
            let apart_m = by_sform.farthest_corners_m(&by_qform);
            if apart_m <= AGREEMENT_M {
                return;
            }
            format!(
                "sform and qform differ by {:.3} mm at a corner: the sform is used",
                apart_m * 1e3
            )
        }
    };
    remarks.push(Remark::new(message).at("qform"));
}
