//! MGH of FreeSurfer: `.mgh`, and `.mgz` with gzip.
//!
//! Its coordinates are RAS millimetres, and `c_ras` is the place of the voxel index size / 2. What follows the voxels
//! (times of the scan, tags with commands and names) is never read.

use std::path::Path;

use nalgebra::{Matrix3, Point3, Vector3};

use super::bytes::ByteStream;
use super::fields::Fields;
use super::placing::{Unplaced, in_lps, unplaced, within_reason};
use super::scalar::{Kind, Rescale, Stored};
use super::segments::Segments;
use super::voxels::{Header, StoredVoxels};
use super::{DAMAGED, ReadOptions};
use crate::{Remark, VolumeError, VoxelGrid};

/// Bytes before the voxels.
const BYTES: usize = 284;
/// Of the header with numbers.
const NUMBERS: usize = 90;

const VERSION: usize = 0;
const SIZE: usize = 4;
const FRAMES: usize = 16;
const TYPE: usize = 20;
const IS_PLACED: usize = 28;
const SPACING: usize = 30;
const DIRECTIONS: usize = 42;
const CENTRE: usize = 78;

/// Whether bytes begin as a header: version 1, lengths that are some, and a type of the format.
pub(super) fn begins_as_header(first: &[u8]) -> bool {
    let fields = fields(first);
    first.len() >= IS_PLACED + 2
        && fields.i32(VERSION) == 1
        && (0..4).all(|axis| (1..1 << 24).contains(&fields.i32(SIZE + 4 * axis)))
        && (0..=20).contains(&fields.i32(TYPE))
        && (0..=1).contains(&fields.i16(IS_PLACED))
}

/// Whether it is called `.mgh` or `.mgz`.
pub(super) fn has_name(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let name = name.to_ascii_lowercase();
    [".mgh", ".mgz", ".mgh.gz"]
        .iter()
        .any(|end| name.ends_with(end))
}

fn fields(bytes: &[u8]) -> Fields<'_> {
    Fields {
        bytes,
        is_big_endian: true,
    }
}

/// Reads the header of a file.
pub(super) fn open(path: &Path, options: &ReadOptions) -> Result<StoredVoxels, VolumeError> {
    let mut stream = ByteStream::open(path)?;
    let mut bytes = [0; NUMBERS];
    let length = stream.fill(&mut bytes)?;
    if length < NUMBERS {
        return Err(VolumeError::refused(format!(
            "the file is truncated: it ends after {length} of the {BYTES} bytes of its header"
        ))
        .hint("copy or export it again"));
    }
    let fields = fields(&bytes);
    if fields.i32(VERSION) != 1 {
        return Err(
            VolumeError::refused("not an MGH file: it does not begin with its version, 1")
                .hint("convert it to NIfTI with FreeSurfer's mri_convert"),
        );
    }
    let mut remarks = Vec::new();
    let size = size(&fields)?;
    let stored = Stored {
        kind: kind(&fields)?,
        is_big_endian: true,
        bits: None,
    };
    let grid = grid(&fields, size, options, &mut remarks)?;
    let header = Header {
        format: "MGH".to_owned(),
        stored,
        rescale: Rescale::NONE,
        data_offset: BYTES as u64,
        grid,
        remarks,
        has_trailer: true,
        segments: Segments::NONE,
    };
    Ok(StoredVoxels::new(header, stream, path))
}

fn size(fields: &Fields) -> Result<[usize; 3], VolumeError> {
    let mut size = [1; 3];
    for (axis, (place, name)) in size
        .iter_mut()
        .zip(["width", "height", "depth"])
        .enumerate()
    {
        let voxels = fields.i32(SIZE + 4 * axis);
        *place = usize::try_from(voxels)
            .ok()
            .filter(|voxels| *voxels > 0)
            .ok_or_else(|| {
                VolumeError::refused(format!("it is {voxels} voxels long"))
                    .at(name)
                    .hint(DAMAGED)
            })?;
    }
    let frames = fields.i32(FRAMES);
    if frames > 1 {
        return Err(
            VolumeError::refused(format!("it has {frames} volumes, a CT has one"))
                .at("nframes")
                .hint("write the required one to its own file: `mri_convert --frame 0`"),
        );
    }
    Ok(size)
}

fn kind(fields: &Fields) -> Result<Kind, VolumeError> {
    let code = fields.i32(TYPE);
    let what = match code {
        0 => return Ok(Kind::U8),
        1 => return Ok(Kind::I32),
        3 => return Ok(Kind::F32),
        4 => return Ok(Kind::I16),
        10 => return Ok(Kind::U16),
        5 => "single bits",
        6 => "tensors",
        _ => "of a type that is not read",
    };
    Err(
        VolumeError::refused(format!("the voxels are {what} (code {code})"))
            .at("type")
            .hint("write them as integers or floats: `mri_convert -odt float`"),
    )
}

fn grid(
    fields: &Fields,
    size: [usize; 3],
    options: &ReadOptions,
    remarks: &mut Vec<Remark>,
) -> Result<VoxelGrid, VolumeError> {
    let vector = |at: usize| Vector3::from([0, 1, 2].map(|row| fields.f32(at + 4 * row)));
    let spacing = vector(SPACING);
    let grid = if fields.i16(IS_PLACED) == 0 {
        let voxels = Unplaced {
            what: "the flag goodRASFlag is 0: left and right of the patient are unknown",
            place: "goodRASFlag",
            spacing_m: Some([0, 1, 2].map(|axis| spacing[axis].abs() / 1e3)),
            size,
        };
        unplaced(&voxels, options, remarks)?
    } else {
        let steps = Matrix3::from_columns(
            &[0, 1, 2].map(|axis| vector(DIRECTIONS + 12 * axis) * spacing[axis]),
        );
        let half = Vector3::from(size.map(|voxels| voxels as f64 / 2.0));
        let first = Point3::from(vector(CENTRE) - steps * half);
        in_lps(size, [-1.0, -1.0, 1.0], &steps, &first, 1e-3).map_err(|problem| {
            VolumeError::refused(problem.to_string())
                .at("x_r to c_s")
                .hint(DAMAGED)
        })?
    };
    within_reason(&grid, None, remarks)?;
    Ok(grid)
}
