//! What a path holds, by its first bytes, and by its name where those say nothing.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use flate2::read::GzDecoder;

use super::foreign::{READ, foreign};
use super::voxels::StoredVoxels;
use super::{ReadOptions, dicom, metaimage, mgh, nifti, nrrd, unreadable};
use crate::VolumeError;

/// What is read of a path: of DICOM, or of a header with its voxels after it or beside it.
pub(super) enum Format {
    Dicom,
    /// What reads the header.
    Stored(Open),
}

/// Reads a header.
type Open = fn(&Path, &ReadOptions) -> Result<StoredVoxels, VolumeError>;

/// First bytes, of what is in a gzip file, that are looked at.
const FIRST_BYTES: u64 = 1024;

/// A format whose header begins like this.
fn header(first: &[u8]) -> Option<Open> {
    if nifti::begins_as_header(first) {
        Some(nifti::open)
    } else if nrrd::begins_as_header(first) {
        Some(nrrd::open)
    } else if mgh::begins_as_header(first) {
        Some(mgh::open)
    } else if metaimage::begins_as_header(first) {
        Some(metaimage::open)
    } else {
        None
    }
}

/// A format whose files are called like this.
fn named(path: &Path) -> Option<Open> {
    if nifti::has_name(path) {
        Some(nifti::open)
    } else if nrrd::has_name(path) {
        Some(nrrd::open)
    } else if mgh::has_name(path) {
        Some(mgh::open)
    } else if metaimage::has_name(path) {
        Some(metaimage::open)
    } else {
        None
    }
}

/// The first bytes of what a gzip file holds: few or none of one that is damaged.
fn inflated(first: &[u8]) -> Vec<u8> {
    let mut inner = Vec::new();
    // What was inflated before an error counts.
    let _ = GzDecoder::new(first)
        .take(FIRST_BYTES)
        .read_to_end(&mut inner);
    inner
}

/// What a path holds; refused by its name where that is not read.
pub(super) fn format_of(path: &Path) -> Result<Format, VolumeError> {
    if path.metadata().map_err(unreadable)?.is_dir() {
        return Ok(Format::Dicom);
    }
    let mut first = Vec::new();
    let file = File::open(path).map_err(unreadable)?;
    file.take(dicom::FIRST_BYTES.max(FIRST_BYTES))
        .read_to_end(&mut first)
        .map_err(unreadable)?;
    if first.is_empty() {
        return Err(VolumeError::refused("the file is empty").hint("copy or export it again"));
    }
    // Bytes count before names: DICOM files are called .img, too.
    if dicom::has_mark(&first) {
        return Ok(Format::Dicom);
    }
    let is_gzip = first.starts_with(&[0x1f, 0x8b]);
    let inner = if is_gzip {
        inflated(&first)
    } else {
        Vec::new()
    };
    let shown = if is_gzip { &inner } else { &first };
    if let Some(open) = header(shown) {
        return Ok(Format::Stored(open));
    }
    let beginning = usize::try_from(dicom::FIRST_BYTES)
        .unwrap_or(0)
        .min(first.len());
    if dicom::is_dicom(&first[..beginning]) {
        return Ok(Format::Dicom);
    }
    if let Some(open) = named(path) {
        return Ok(Format::Stored(open));
    }
    // Before pictures: a preamble of DICOM may be that of a TIFF.
    if dicom::has_mark(&inner) {
        return Err(VolumeError::refused("it is a gzip file of a DICOM file")
            .hint("decompress it with gunzip"));
    }
    let refused = match (foreign(shown, path), is_gzip) {
        (Some((what, hint)), false) => VolumeError::refused(format!("it is {what}")).hint(hint),
        (Some((what, hint)), true) => {
            VolumeError::refused(format!("it is a gzip file of {what}")).hint(hint)
        }
        (None, true) => {
            VolumeError::refused("it is a gzip file, but not of a format that is read").hint(READ)
        }
        (None, false) => VolumeError::refused(
            "its first bytes are those of no format that is read: neither DICOM, NIfTI, NRRD, MetaImage nor MGH",
        )
        .hint(READ),
    };
    Err(refused)
}
