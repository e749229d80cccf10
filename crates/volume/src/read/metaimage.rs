//! MetaImage: `.mha`, and `.mhd` with a file of voxels beside it.
//!
//! Its coordinates are LPS millimetres; `Offset` is the centre of the first voxel, and each row of `TransformMatrix` the
//! direction of an axis. Free texts (`Comment`, `Name` and what else there may be) are never read.

use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Point3};

use super::bytes::{ByteStream, Compression};
use super::placing::{Unplaced, in_lps, unplaced, within_reason};
use super::scalar::{Kind, Rescale, Stored};
use super::segments::Segments;
use super::text_header::{Entries, Entry, Lines, beside, shown};
use super::voxels::{Header, StoredVoxels};
use super::{DAMAGED, ReadOptions};
use crate::{Remark, VolumeError, VoxelGrid};

/// Keys of the format that are read; no others.
const KEYS: &[&str] = &[
    "ObjectType",
    "NDims",
    "DimSize",
    "BinaryData",
    "BinaryDataByteOrderMSB",
    "ElementByteOrderMSB",
    "CompressedData",
    "TransformMatrix",
    "Rotation",
    "Orientation",
    "Offset",
    "Origin",
    "Position",
    "ElementSpacing",
    "ElementSize",
    "DistanceUnits",
    "HeaderSize",
    "ElementNumberOfChannels",
    "ElementType",
    "ElementToIntensityFunctionSlope",
    "ElementToIntensityFunctionOffset",
    DATA_FILE,
];

/// The last key: after it come the voxels.
const DATA_FILE: &str = "ElementDataFile";

/// Most axes that a file may have.
const MOST_AXES: usize = 10;

/// Whether bytes begin as a header: with a key of the format.
pub(super) fn begins_as_header(first: &[u8]) -> bool {
    let line = first
        .split(|byte| *byte == b'\n')
        .next()
        .unwrap_or_default();
    let Some((key, _)) = std::str::from_utf8(line)
        .ok()
        .and_then(|line| line.split_once('='))
    else {
        return false;
    };
    matches!(
        key.trim(),
        "ObjectType" | "NDims" | "ObjectSubType" | "Comment" | "DimSize"
    )
}

/// Whether it is called `.mha` or `.mhd`.
pub(super) fn has_name(path: &Path) -> bool {
    path.extension()
        .is_some_and(|end| end.eq_ignore_ascii_case("mha") || end.eq_ignore_ascii_case("mhd"))
}

/// Reads the header of a file, or of a file with its voxels beside it.
pub(super) fn open(path: &Path, options: &ReadOptions) -> Result<StoredVoxels, VolumeError> {
    let mut stream = ByteStream::open(path)?;
    let entries = read_text(&mut stream)?;
    let mut remarks = Vec::new();
    check_values(&entries)?;
    let (size, axes) = size(&entries)?;
    let grid = grid(&entries, size, axes, options, &mut remarks)?;
    let mut header = Header {
        format: "MetaImage".to_owned(),
        stored: stored(&entries)?,
        rescale: Rescale::NONE,
        data_offset: 0,
        grid,
        remarks,
        has_trailer: false,
        segments: Segments::NONE,
    };
    let data_path = data_path(path, entries.wanted(DATA_FILE)?)?;
    if let Some(data) = &data_path {
        stream = ByteStream::open(data)?;
    }
    let begins: i64 = match entries.get("HeaderSize") {
        None => 0,
        Some(entry) => entry.whole()?,
    };
    let is_compressed = flag(&entries, "CompressedData")?.unwrap_or(false);
    let skip = match u64::try_from(begins) {
        Ok(0) => stream.at(),
        Ok(bytes) => bytes,
        Err(_) => match stream.plain_bytes() {
            Some(all) if begins == -1 && !is_compressed => {
                all.saturating_sub(header.wanted_bytes())
            }
            _ => {
                return Err(VolumeError::refused(format!(
                    "{begins} bytes before the voxels: they cannot be found"
                ))
                .at("HeaderSize")
                .hint("give the bytes before the voxels, or 0"));
            }
        },
    };
    if is_compressed {
        stream.skip_to(skip)?;
        stream = stream.inflated(Compression::Zlib)?;
    } else {
        header.data_offset = skip;
    }
    let path = data_path.as_deref().unwrap_or(path);
    Ok(StoredVoxels::new(header, stream, path))
}

fn read_text(stream: &mut ByteStream) -> Result<Entries, VolumeError> {
    let mut lines = Lines::of(stream);
    let mut entries = Entries::default();
    while let Some((line, content)) = lines.next_line()? {
        let Some((key, value)) = content.split_once('=') else {
            if content.trim().is_empty() {
                continue;
            }
            return Err(VolumeError::refused("it is not `key = value`")
                .at(format!("line {line}"))
                .hint(DAMAGED));
        };
        let key = key.trim();
        if KEYS.contains(&key) {
            entries.add(Entry {
                line,
                key: key.to_owned(),
                value: value.trim().to_owned(),
            })?;
        }
        if key == DATA_FILE {
            break;
        }
    }
    if let Some(entry) = entries.get("ObjectType")
        && !entry.value.eq_ignore_ascii_case("image")
    {
        return Err(entry
            .refused(format!("it holds `{}`, not an image", shown(&entry.value)))
            .hint("a volume has ObjectType = Image"));
    }
    Ok(entries)
}

/// The file of the voxels; none where they follow the header.
fn data_path(path: &Path, entry: &Entry) -> Result<Option<PathBuf>, VolumeError> {
    let mut words = entry.value.split_whitespace();
    let first = words.next().unwrap_or_default();
    if first.eq_ignore_ascii_case("local") {
        return Ok(None);
    }
    let numbers = words.filter(|word| word.parse::<i64>().is_ok()).count();
    if first == "LIST" || (first.contains('%') && numbers >= 2) {
        return Err(entry
            .refused("the voxels are in a list of files, which is not supported")
            .hint("save it as one .mha, e.g. with 3D Slicer or SimpleITK"));
    }
    beside(path, entry).map(Some)
}

fn flag(entries: &Entries, key: &str) -> Result<Option<bool>, VolumeError> {
    let Some(entry) = entries.get(key) else {
        return Ok(None);
    };
    match entry.value.to_ascii_lowercase().as_str() {
        "true" | "t" | "1" => Ok(Some(true)),
        "false" | "f" | "0" => Ok(Some(false)),
        _ => Err(entry
            .refused(format!(
                "`{}` is neither True nor False",
                shown(&entry.value)
            ))
            .hint(DAMAGED)),
    }
}

/// Lengths of the three axes in space, and how many axes the header speaks of.
fn size(entries: &Entries) -> Result<([usize; 3], usize), VolumeError> {
    let dims = entries.wanted("NDims")?;
    let count: usize = dims.whole()?;
    if !(3..=MOST_AXES).contains(&count) {
        return Err(dims
            .refused(format!("it has {count} axes: not a volume"))
            .hint("write a volume with three axes, e.g. with 3D Slicer or SimpleITK"));
    }
    let entry = entries.wanted("DimSize")?;
    let lengths = entry.lengths(Some(count))?;
    if let Some(length) = lengths[3..].iter().find(|length| **length > 1) {
        return Err(entry
            .refused(format!("it has {length} volumes, a CT has one"))
            .hint("write the required one to its own file, e.g. with SimpleITK's Extract"));
    }
    if let Some(entry) = entries.get("ElementNumberOfChannels") {
        let channels: usize = entry.whole()?;
        if channels != 1 {
            return Err(entry
                .refused(format!(
                    "it has {channels} numbers a voxel, a CT has one: colours or vectors"
                ))
                .hint(
                    "write one number per voxel, e.g. with SimpleITK's VectorIndexSelectionCast",
                ));
        }
    }
    Ok(([lengths[0], lengths[1], lengths[2]], count))
}

/// Refuses a slope and an offset, which some programs apply and others do not.
fn check_values(entries: &Entries) -> Result<(), VolumeError> {
    for (key, none) in [
        ("ElementToIntensityFunctionSlope", 1.0),
        ("ElementToIntensityFunctionOffset", 0.0),
    ] {
        if let Some(entry) = entries.get(key)
            && entry.numbers(1)? != [none]
        {
            return Err(entry
                .refused(format!(
                    "it is {}: some programs apply it to the values, and others, as ITK, do not",
                    shown(&entry.value)
                ))
                .hint(format!("set it to {none} if the stored values are HU")));
        }
    }
    Ok(())
}

fn stored(entries: &Entries) -> Result<Stored, VolumeError> {
    if flag(entries, "BinaryData")? == Some(false) {
        return Err(
            VolumeError::refused("the voxels are written as text, which is not read")
                .at("BinaryData")
                .hint("save it again as .mha, e.g. with 3D Slicer or SimpleITK"),
        );
    }
    let entry = entries.wanted("ElementType")?;
    let refused = |what: String| {
        entry
            .refused(what)
            .hint("write them as integers or floats, one number per voxel")
    };
    let kind = match entry.value.as_str() {
        "MET_CHAR" => Kind::I8,
        "MET_UCHAR" => Kind::U8,
        "MET_SHORT" => Kind::I16,
        "MET_USHORT" => Kind::U16,
        // Of 32 bits, whatever the machine's are.
        "MET_INT" | "MET_LONG" => Kind::I32,
        "MET_UINT" | "MET_ULONG" => Kind::U32,
        "MET_LONG_LONG" => Kind::I64,
        "MET_ULONG_LONG" => Kind::U64,
        "MET_FLOAT" => Kind::F32,
        "MET_DOUBLE" => Kind::F64,
        name if name.starts_with("MET_") && name.ends_with("_ARRAY") => {
            return Err(refused("the voxels are arrays, not numbers".to_owned()));
        }
        _ => {
            return Err(refused(format!(
                "`{}` is not a type of numbers in MetaImage",
                shown(&entry.value)
            )));
        }
    };
    let of_elements = flag(entries, "ElementByteOrderMSB")?;
    let of_data = flag(entries, "BinaryDataByteOrderMSB")?;
    if let (Some(one), Some(other)) = (of_elements, of_data)
        && one != other
        && kind.bytes() > 1
    {
        return Err(
            VolumeError::refused("the two byte orders of the header are not the same")
                .at("ElementByteOrderMSB, BinaryDataByteOrderMSB")
                .hint(DAMAGED),
        );
    }
    Ok(Stored {
        kind,
        is_big_endian: of_elements.or(of_data).unwrap_or(false),
        bits: None,
    })
}

/// Metres in the unit of length.
fn unit_m(entries: &Entries) -> Result<f64, VolumeError> {
    let Some(entry) = entries.get("DistanceUnits") else {
        return Ok(1e-3);
    };
    match entry.value.as_str() {
        "mm" | "?" | "" => Ok(1e-3),
        "cm" => Ok(1e-2),
        "um" => Ok(1e-6),
        _ => Err(entry
            .refused(format!("`{}` is not a unit of length", shown(&entry.value)))
            .hint("write the spacing in mm")),
    }
}

fn grid(
    entries: &Entries,
    size: [usize; 3],
    axes: usize,
    options: &ReadOptions,
    remarks: &mut Vec<Remark>,
) -> Result<VoxelGrid, VolumeError> {
    let unit_m = unit_m(entries)?;
    let Some(spacing) = entries.any(&["ElementSpacing", "ElementSize"]) else {
        return Err(VolumeError::refused(
            "ElementSpacing is missing: the distances between voxels are unknown",
        )
        .at("ElementSpacing")
        .hint("write it into the header, in mm: `ElementSpacing = 0.7 0.7 1`"));
    };
    let numbers = spacing.numbers(axes)?;
    let spacing = [numbers[0], numbers[1], numbers[2]];
    let directions = entries.any(&["TransformMatrix", "Rotation", "Orientation"]);
    let Some(directions) = directions else {
        let voxels = Unplaced {
            what: "TransformMatrix is missing: left and right of the patient are unknown",
            place: "TransformMatrix",
            spacing_m: Some(spacing.map(|each| each.abs() * unit_m)),
            size,
        };
        let grid = unplaced(&voxels, options, remarks)?;
        within_reason(&grid, (unit_m != 1e-3).then_some("DistanceUnits"), remarks)?;
        return Ok(grid);
    };
    let numbers = directions.numbers(axes * axes)?;
    let mut steps = Matrix3::from_fn(|row, axis| numbers[axis * axes + row]);
    let is_apart = (0..3).all(|axis| (3..axes).all(|other| numbers[axis * axes + other] == 0.0));
    if !is_apart {
        return Err(directions
            .refused("the directions of the volume have parts beyond its three axes")
            .hint("write a volume with three axes, e.g. with 3D Slicer or SimpleITK"));
    }
    for (axis, step) in spacing.into_iter().enumerate() {
        steps.column_mut(axis).scale_mut(step);
    }
    let origin = if let Some(entry) = entries.any(&["Offset", "Origin", "Position"]) {
        let numbers = entry.numbers(axes)?;
        Point3::new(numbers[0], numbers[1], numbers[2])
    } else {
        remarks.push(
            Remark::new("no place of the first voxel is given: 0, 0, 0 assumed").at("Offset"),
        );
        Point3::origin()
    };
    let grid = in_lps(size, [1.0; 3], &steps, &origin, unit_m)
        .map_err(|problem| directions.refused(problem.to_string()).hint(DAMAGED))?;
    within_reason(&grid, (unit_m != 1e-3).then_some("DistanceUnits"), remarks)?;
    Ok(grid)
}
