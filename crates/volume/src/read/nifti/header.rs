//! The header: 348 bytes of NIfTI-1, 540 of NIfTI-2.

use super::label_table;
use super::orientation::{self, Placement};
use super::version::{BYTES_1, BYTES_2, version_of};
use crate::read::bytes::ByteStream;
use crate::read::fields::Fields;
use crate::read::scalar::{Kind, Rescale, Stored};
use crate::read::segments::{Segment, Segments};
use crate::read::voxels::Header;
use crate::read::{DAMAGED, ReadOptions};
use crate::{Remark, VolumeError};

/// Reads it from the beginning of a stream, and whether the voxels are in a file of their own.
pub(super) fn read(
    stream: &mut ByteStream,
    options: &ReadOptions,
) -> Result<(Header, bool), VolumeError> {
    let mut bytes = [0; BYTES_2];
    let mut length = stream.fill(&mut bytes[..BYTES_1])?;
    let Some((version, is_big_endian)) = version_of(&bytes[..length]) else {
        return Err(VolumeError::refused(
            "not a NIfTI file: it does not begin with the header size, 348 or 540",
        )
        .hint("a CT is read from .nii, .nii.gz, .hdr with .img, or DICOM"));
    };
    if version == 2 && length == BYTES_1 {
        length += stream.fill(&mut bytes[BYTES_1..])?;
    }
    let wanted = if version == 1 { BYTES_1 } else { BYTES_2 };
    if length < wanted {
        return Err(VolumeError::refused(format!(
            "the file is truncated: it ends after {length} of the {wanted} bytes of its \
                 header"
        ))
        .hint("copy or export it again"));
    }
    let fields = Fields {
        bytes: &bytes[..wanted],
        is_big_endian,
    };
    let (mut header, is_pair) = parse(&fields, version, options)?;
    let end = if is_pair {
        u64::MAX
    } else {
        header.data_offset
    };
    let names = label_table::names(stream, end, is_big_endian, &mut header.remarks)?;
    let segments = names.into_iter();
    let segments = segments.map(|(label, name)| Segment::new(name, 0, label));
    header.segments = Segments::new(1, segments.collect(), &mut header.remarks)?;
    Ok((header, is_pair))
}

fn parse(
    fields: &Fields,
    version: u8,
    options: &ReadOptions,
) -> Result<(Header, bool), VolumeError> {
    let is_first = version == 1;
    let is_pair = is_pair(fields, version)?;
    let size = size(fields, is_first)?;
    let stored = Stored {
        kind: kind(fields, is_first)?,
        is_big_endian: fields.is_big_endian,
        bits: None,
    };
    let mut remarks = Vec::new();
    let rescale = rescale(fields, is_first)?;
    let least = match (is_pair, is_first) {
        (true, _) => 0,
        (false, true) => BYTES_1 as u64 + 4,
        (false, false) => BYTES_2 as u64 + 4,
    };
    let data_offset = data_offset(fields, is_first, least, &mut remarks)?;
    let placement = Placement::read(fields, is_first);
    let grid = orientation::grid(&placement, size, options, &mut remarks)?;
    let header = Header {
        format: format!("NIfTI-{version}"),
        stored,
        rescale,
        data_offset,
        grid,
        remarks,
        has_trailer: false,
        segments: Segments::NONE,
    };
    Ok((header, is_pair))
}

fn is_pair(fields: &Fields, version: u8) -> Result<bool, VolumeError> {
    let (place, pair, single): (_, &[u8], &[u8]) = if version == 1 {
        (344, b"ni1\0", b"n+1\0")
    } else {
        (4, b"ni2\0", b"n+2\0")
    };
    let magic = &fields.bytes[place..place + 4];
    if magic == pair {
        Ok(true)
    } else if magic == single {
        Ok(false)
    } else {
        Err(VolumeError::refused(
            "it has an ANALYZE 7.5 header, which does not state left and right, or a damaged NIfTI \
             header",
        )
        .at("magic")
        .hint("convert it to NIfTI with a program that knows its orientation"))
    }
}

fn size(fields: &Fields, is_first: bool) -> Result<[usize; 3], VolumeError> {
    let dimension = |index: usize| {
        if is_first {
            fields.i16(40 + 2 * index)
        } else {
            fields.i64(16 + 8 * index)
        }
    };
    let count = dimension(0);
    if !(1..=7).contains(&count) {
        return Err(
            VolumeError::refused(format!("it has {count} dimensions, 1 to 7 allowed"))
                .at("dim[0]")
                .hint(DAMAGED),
        );
    }
    let mut size = [1; 3];
    for (index, place) in (1..).zip(&mut size) {
        if index > count {
            break;
        }
        let index = usize::try_from(index).unwrap_or(0);
        let voxels = dimension(index);
        *place = usize::try_from(voxels)
            .ok()
            .filter(|voxels| *voxels > 0)
            .ok_or_else(|| {
                VolumeError::refused(format!("it is {voxels} voxels long"))
                    .at(format!("dim[{index}]"))
                    .hint(DAMAGED)
            })?;
    }
    for index in 4..=usize::try_from(count).unwrap_or(0) {
        let length = dimension(index);
        if length > 1 {
            let of = if index == 4 {
                "volumes"
            } else {
                "values a voxel"
            };
            return Err(
                VolumeError::refused(format!("it has {length} {of}, a CT has one"))
                    .at(format!("dim[{index}]"))
                    .hint(
                        "write the required one to its own file, e.g. with nibabel's four_to_three",
                    ),
            );
        }
    }
    Ok(size)
}

fn kind(fields: &Fields, is_first: bool) -> Result<Kind, VolumeError> {
    let (code, bits) = if is_first {
        (fields.i16(70), fields.i16(72))
    } else {
        (fields.i16(12), fields.i16(14))
    };
    let refused = |what: &str| {
        VolumeError::refused(format!("the voxels are {what} (code {code})"))
            .at("datatype")
            .hint("write them as integers or floats, one number per voxel")
    };
    let kind = match code {
        2 => Kind::U8,
        4 => Kind::I16,
        8 => Kind::I32,
        16 => Kind::F32,
        64 => Kind::F64,
        256 => Kind::I8,
        512 => Kind::U16,
        768 => Kind::U32,
        1024 => Kind::I64,
        1280 => Kind::U64,
        128 | 2304 => return Err(refused("colours, not numbers")),
        32 | 1792 | 2048 => return Err(refused("complex numbers")),
        1536 => return Err(refused("128-bit floats")),
        1 => return Err(refused("single bits")),
        _ => return Err(refused("of a type unknown in NIfTI")),
    };
    let expected = kind.bytes() * 8;
    if usize::try_from(bits) != Ok(expected) {
        return Err(VolumeError::refused(format!(
            "it states {bits} bits, but {} numbers have {expected}",
            kind.name()
        ))
        .at("bitpix")
        .hint(DAMAGED));
    }
    Ok(kind)
}

fn rescale(fields: &Fields, is_first: bool) -> Result<Rescale, VolumeError> {
    let (slope, intercept) = if is_first {
        (fields.f32(112), fields.f32(116))
    } else {
        (fields.f64(176), fields.f64(184))
    };
    // The standard: a slope of 0 means none.
    if slope == 0.0 || !slope.is_finite() {
        return Ok(Rescale::NONE);
    }
    if !intercept.is_finite() {
        return Err(
            VolumeError::refused(format!("the intercept is {intercept}"))
                .at("scl_inter")
                .hint("set it to 0 if the stored values are HU"),
        );
    }
    Ok(Rescale { slope, intercept })
}

fn data_offset(
    fields: &Fields,
    is_first: bool,
    least: u64,
    remarks: &mut Vec<Remark>,
) -> Result<u64, VolumeError> {
    let given = if is_first {
        fields.f32(108)
    } else {
        fields.i64(168) as f64
    };
    if given == 0.0 && least > 0 {
        remarks.push(
            Remark::new(format!(
                "is 0; voxels assumed to follow the header, from byte {least}"
            ))
            .at("vox_offset"),
        );
        return Ok(least);
    }
    let is_sane = given >= least as f64 && given.fract() == 0.0 && given < 1e15;
    if !is_sane {
        return Err(VolumeError::refused(format!(
            "the voxels begin at byte {given}, but the header takes the first {least}"
        ))
        .at("vox_offset")
        .hint(DAMAGED));
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "checked above"
    )]
    let offset = given as u64;
    Ok(offset)
}
