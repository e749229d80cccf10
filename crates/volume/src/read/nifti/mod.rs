//! NIfTI-1 and -2: `.nii`, `.nii.gz`, and `.hdr` beside `.img`.
//!
//! Free texts of the header (`descrip`, `db_name`, `aux_file`, `intent_name`) are never read: some writers put
//! names there. Of extensions, only a table of label names is.

mod header;
mod label_table;
mod orientation;
mod pair;
mod version;

use std::path::Path;

use super::ReadOptions;
use super::bytes::ByteStream;
use super::voxels::StoredVoxels;
use crate::VolumeError;

pub(super) use self::version::begins_as_header;

/// Whether it is called `.nii`, `.nii.gz`, `.hdr` or `.img`, with or without `.gz`.
pub(super) fn has_name(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let name = name.to_ascii_lowercase();
    let name = name.strip_suffix(".gz").unwrap_or(&name);
    [".nii", ".hdr", ".img"]
        .iter()
        .any(|end| name.ends_with(end))
}

/// Reads the header of a file, or of a pair.
pub(super) fn open(path: &Path, options: &ReadOptions) -> Result<StoredVoxels, VolumeError> {
    let (header_path, data_path) = pair::pair(path);
    let mut stream = opened(
        &header_path,
        "the header must be next to the voxels, in a file of the same name ending in .hdr",
    )?;
    let (header, is_pair) = header::read(&mut stream, options)?;
    if is_pair && header_path == data_path {
        return Err(VolumeError::refused(
            "it is the header of a file pair (.hdr and .img), but is not named .hdr",
        )
        .hint("rename it to .hdr, with the voxels in .img; or convert the pair to .nii"));
    }
    if is_pair {
        stream = opened(
            &data_path,
            "the voxels must be next to the header, in a file of the same name ending in .img",
        )?;
    }
    let path = if is_pair { &data_path } else { &header_path };
    Ok(StoredVoxels::new(header, stream, path))
}

/// One of a pair, with what to do where it is missing.
fn opened(path: &Path, hint: &str) -> Result<ByteStream, VolumeError> {
    let mut stream = ByteStream::open(path).map_err(|problem| {
        if path.exists() {
            problem
        } else {
            problem.hint(hint)
        }
    })?;
    let says_gzip = path
        .extension()
        .is_some_and(|end| end.eq_ignore_ascii_case("gz"));
    // Read as it is where it begins as a header: that decides whether it makes sense.
    if says_gzip
        && stream
            .first_as_they_are()?
            .is_some_and(|first| !first.is_empty() && !begins_as_header(first))
    {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        return Err(VolumeError::refused(
            "it is named .gz, but its first bytes are not those of gzip",
        )
        .at(name)
        .hint("copy or export it again"));
    }
    Ok(stream)
}
