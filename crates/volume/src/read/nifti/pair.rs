//! Files of a pair.

use std::path::{Path, PathBuf};

/// Header and voxels of what a path names: one file, or a pair.
#[expect(
    clippy::case_sensitive_file_extension_comparisons,
    reason = "of a name in small letters"
)]
pub(super) fn pair(path: &Path) -> (PathBuf, PathBuf) {
    let text = path.to_string_lossy();
    let lower = text.to_ascii_lowercase();
    let (stem, end) = match lower.strip_suffix(".gz") {
        Some(stem) => (stem, ".gz"),
        None => (lower.as_str(), ""),
    };
    let is_header = stem.ends_with(".hdr");
    if !is_header && !stem.ends_with(".img") {
        return (path.to_owned(), path.to_owned());
    }
    let base = &text[..stem.len() - 4];
    let beside = |extension: &str| {
        // The other file may be compressed where this one is not, and written in capitals.
        let upper = extension.to_ascii_uppercase();
        [
            format!("{base}.{extension}{end}"),
            format!("{base}.{extension}"),
            format!("{base}.{extension}.gz"),
            format!("{base}.{upper}"),
        ]
        .into_iter()
        .map(PathBuf::from)
        .find(|candidate| candidate.is_file())
        .unwrap_or_else(|| PathBuf::from(format!("{base}.{extension}{end}")))
    };
    if is_header {
        (path.to_owned(), beside("img"))
    } else {
        (beside("hdr"), path.to_owned())
    }
}
