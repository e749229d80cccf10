//! NRRD: `.nrrd`, `.nhdr` with a file of voxels beside it, and the `.seg.nrrd` of 3D Slicer.
//!
//! Free texts (`content`, comments, and all keys but those of segments) are never read: some writers put names there.

mod axes;
mod kind;
mod layout;
mod place;
mod segments;

use std::path::Path;

use self::layout::Layout;
use super::bytes::{ByteStream, Compression};
use super::scalar::Rescale;
use super::text_header::{Entries, Entry, Lines, beside, shown};
use super::voxels::{Header, StoredVoxels};
use super::{DAMAGED, ReadOptions};
use crate::VolumeError;

/// What a file begins with, before the digit of its version.
const MAGIC: &[u8] = b"NRRD000";

/// Longest line before the voxels that is skipped where the header says so, bytes.
const LONGEST_SKIPPED: usize = 1 << 20;

/// Whether bytes begin as a header.
pub(super) fn begins_as_header(first: &[u8]) -> bool {
    first.starts_with(MAGIC)
}

/// Whether it is called `.nrrd` or `.nhdr`.
pub(super) fn has_name(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let name = name.to_ascii_lowercase();
    [".nrrd", ".nhdr", ".nrrd.gz"]
        .iter()
        .any(|end| name.ends_with(end))
}

/// Fields of the format, and keys of 3D Slicer's segments.
#[derive(Debug, Default)]
struct Text {
    fields: Entries,
    keys: Vec<Entry>,
}

/// Reads the header of a file, or of a file with its voxels beside it.
pub(super) fn open(path: &Path, options: &ReadOptions) -> Result<StoredVoxels, VolumeError> {
    let mut stream = ByteStream::open(path)?;
    let text = read_text(&mut stream)?;
    let mut remarks = Vec::new();
    let axes = axes::axes(&text.fields)?;
    let grid = place::grid(&text.fields, &axes, options, &mut remarks)?;
    // Before the byte order, which text has none of.
    let layout = Layout::of(&text.fields)?;
    let stored = kind::stored(&text.fields)?;
    let segments = segments::segments(&text.keys, &axes, &mut remarks)?;
    let data_path = match &layout.file {
        Some(entry) => {
            let data = beside(path, entry)?;
            stream = ByteStream::open(&data)?;
            data
        }
        None => path.to_owned(),
    };
    let is_gzip_file = layout.file.is_some() && stream.plain_bytes().is_none();
    for _ in 0..layout.lines {
        if stream.line(LONGEST_SKIPPED)?.is_none() {
            break;
        }
    }
    if layout.is_gzip && !is_gzip_file {
        stream = stream.inflated(Compression::Gzip)?;
    }
    let mut header = Header {
        format: "NRRD".to_owned(),
        stored,
        rescale: Rescale::NONE,
        data_offset: 0,
        grid,
        remarks,
        has_trailer: false,
        segments,
    };
    header.data_offset = match (layout.skip, stream.plain_bytes()) {
        (Some(bytes), _) => stream.at().checked_add(bytes),
        (None, Some(all)) if !layout.is_gzip => all.checked_sub(header.wanted_bytes()),
        (None, _) => {
            return Err(VolumeError::refused(
                "the voxels are counted from the end of the file, which is compressed",
            )
            .at("byte skip")
            .hint("save it with encoding raw, or with byte skip 0"));
        }
    }
    .unwrap_or(u64::MAX);
    Ok(StoredVoxels::new(header, stream, &data_path))
}

fn read_text(stream: &mut ByteStream) -> Result<Text, VolumeError> {
    let mut lines = Lines::of(stream);
    let magic = lines.next_line()?.map(|(_, line)| line).unwrap_or_default();
    let version = magic
        .strip_prefix("NRRD000")
        .and_then(|digit| digit.trim_end().parse::<u8>().ok());
    if !version.is_some_and(|version| (1..=5).contains(&version)) {
        return Err(VolumeError::refused(
            "not a NRRD file of a known version: it does not begin with NRRD0001 to NRRD0005",
        )
        .hint("copy or export it again, e.g. with 3D Slicer"));
    }
    let mut text = Text::default();
    while let Some((line, content)) = lines.next_line()? {
        if content.is_empty() {
            break;
        }
        if content.starts_with('#') {
            continue;
        }
        // Of a key the value may hold a colon, and of a field an equals sign.
        let split = content.find(':').map(|at| content.split_at(at));
        let Some((key, rest)) = split else {
            return Err(VolumeError::refused(
                "it is neither a field (`key: value`), nor a key (`key:=value`), nor a comment",
            )
            .at(format!("line {line}"))
            .hint(DAMAGED));
        };
        if let Some(value) = rest.strip_prefix(":=") {
            if key.starts_with("Segment") {
                text.keys.push(Entry {
                    line,
                    key: key.trim().to_owned(),
                    value: value.to_owned(),
                });
            }
            continue;
        }
        let Some(value) = rest.strip_prefix(": ").or(rest.strip_prefix(':')) else {
            continue;
        };
        let key = field(key);
        if layout::is_list(&key, value) {
            return Err(VolumeError::refused(
                "the voxels are in a list of files, which is not supported",
            )
            .at(format!("line {line}, {key}"))
            .hint("save it to one file, e.g. with 3D Slicer, or with `unu save -f nrrd`"));
        }
        if key == "content" {
            continue;
        }
        text.fields.add(Entry {
            line,
            key,
            value: value.trim().to_owned(),
        })?;
    }
    Ok(text)
}

/// The one spelling of a field's name that is used here.
fn field(name: &str) -> String {
    let name = name.trim().to_ascii_lowercase();
    let one = match name.as_str() {
        "lineskip" => "line skip",
        "byteskip" => "byte skip",
        "datafile" => "data file",
        "centers" => "centerings",
        "axismins" => "axis mins",
        "axismaxs" => "axis maxs",
        "blocksize" => "block size",
        _ => return shown(&name),
    };
    one.to_owned()
}
