//! Where the voxels are, and how they are written.

use crate::VolumeError;
use crate::read::text_header::{Entries, Entry, shown};

/// Where the voxels are.
#[derive(Debug)]
pub(super) struct Layout {
    /// The field that names a file of their own.
    pub(super) file: Option<Entry>,
    pub(super) is_gzip: bool,
    /// Lines before them.
    pub(super) lines: u64,
    /// Bytes before them; none where they are the last ones of the file.
    pub(super) skip: Option<u64>,
}

impl Layout {
    pub(super) fn of(fields: &Entries) -> Result<Self, VolumeError> {
        let encoding = fields.wanted("encoding")?;
        let is_gzip = match encoding.value.to_ascii_lowercase().as_str() {
            "raw" => false,
            "gzip" | "gz" => true,
            "bzip2" | "bz2" => return Err(other(encoding, "bzip2")),
            "zrl" => return Err(other(encoding, "runs of zeros (zrl)")),
            "hex" => return Err(other(encoding, "hexadecimal digits")),
            "ascii" | "text" | "txt" => return Err(other(encoding, "text")),
            _ => {
                return Err(encoding
                    .refused(format!(
                        "`{}` is an unknown encoding",
                        shown(&encoding.value)
                    ))
                    .hint("raw and gzip are read"));
            }
        };
        let lines = match fields.get("line skip") {
            None => 0,
            Some(entry) => entry.whole()?,
        };
        let skip = match fields.get("byte skip") {
            None => Some(0),
            Some(entry) if entry.value == "-1" => None,
            Some(entry) => Some(entry.whole()?),
        };
        Ok(Self {
            file: fields.get("data file").cloned(),
            is_gzip,
            lines,
            skip,
        })
    }
}

fn other(entry: &Entry, what: &str) -> VolumeError {
    entry
        .refused(format!("the voxels are written as {what}, which is not read"))
        .hint("save it with encoding gzip or raw, e.g. with 3D Slicer, or with `unu save -e gzip -f nrrd`")
}

/// Whether a field names several files: one by one, or by a pattern with first and last number.
pub(super) fn is_list(key: &str, value: &str) -> bool {
    let mut words = value.split_whitespace();
    key == "data file"
        && match words.next() {
            Some("LIST") => true,
            Some(pattern) => {
                pattern.contains('%')
                    && words.filter(|word| word.parse::<i64>().is_ok()).count() >= 3
            }
            None => false,
        }
}
