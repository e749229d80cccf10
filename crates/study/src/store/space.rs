//! Free disk space, checked before a table of gigabytes is begun.

use std::path::Path;

use super::error::StudyError;
use super::folder::RESULTS_FILE;
use super::manifest::Manifest;
use super::parquet_write::GROUP_CASES;
use crate::FactorKind;

/// Bytes that a table takes at most, as far as one can tell from those that its blocks have in journals.
///
/// A journal compresses less: blocks of at most 64 cases, at a lower level. Only numbers that are sampled are
/// longer in a table, which has them once a row; and every row group describes its columns.
pub(crate) fn table_bytes(manifest: &Manifest, journal_bytes: u64) -> u64 {
    /// Value, its index and the index's repetition.
    const DRAWN: u64 = 24;
    const COLUMN: u64 = 256;
    let continuous = |kind: &FactorKind| matches!(kind, FactorKind::Continuous { .. });
    let factors = manifest.factors.iter();
    let drawn = factors.filter(|each| continuous(&each.kind)).count() as u64;
    let columns = (manifest.factors.len() + manifest.columns.len() + 4) as u64;
    let groups = manifest.cases.div_ceil(GROUP_CASES);
    let said = serde_json::to_vec(manifest).map_or(0, |json| json.len() as u64);
    journal_bytes + manifest.cases * drawn * DRAWN + (groups + 2) * columns * COLUMN + 2 * said
}

/// Bytes that a table in a folder, which need not be there yet, may take. `None` where the system does not
/// say.
pub(crate) fn free_bytes(folder: &Path) -> Option<u64> {
    let existing = folder.ancestors().find(|each| each.exists());
    let existing = match existing {
        Some(path) if !path.as_os_str().is_empty() => path,
        _ => Path::new("."),
    };
    // What a killed process left of the table is overwritten.
    let left = std::fs::metadata(folder.join(format!(".{RESULTS_FILE}.tmp")));
    Some(free(existing)? + left.map_or(0, |left| left.len()))
}

#[cfg(unix)]
fn free(folder: &Path) -> Option<u64> {
    let disk = rustix::fs::statvfs(folder).ok()?;
    disk.f_bavail.checked_mul(disk.f_frsize)
}

#[cfg(not(unix))]
fn free(_: &Path) -> Option<u64> {
    None
}

/// # Errors
/// [`StudyError::Space`] if there is less free space than needed.
pub(crate) fn check(folder: &Path, needed: u64, free: Option<u64>) -> Result<(), StudyError> {
    match free {
        Some(free) if free < needed => Err(StudyError::Space {
            folder: folder.to_owned(),
            needed_bytes: needed,
            free_bytes: free,
        }),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_that_is_not_there_yet_has_the_room_of_the_disk_that_it_will_be_on() {
        let place = tempfile::tempdir().unwrap();
        let free = free_bytes(&place.path().join("a/b"));
        assert_eq!(free.is_some(), cfg!(unix));
        // Also relative to where the process is.
        assert_eq!(
            free_bytes(Path::new("no_such_folder")).is_some(),
            cfg!(unix)
        );
        // A leftover counts as room.
        let sparse = std::fs::File::create(place.path().join(".results.parquet.tmp")).unwrap();
        sparse.set_len(1 << 40).unwrap();
        assert!(free_bytes(place.path()) >= Some(1 << 40) || !cfg!(unix));
    }

    #[test]
    fn too_little_room_is_refused_with_both_numbers() {
        let folder = Path::new("out");
        assert!(check(folder, 7_000_000_000, Some(7_000_000_000)).is_ok());
        assert!(check(folder, 7_000_000_000, None).is_ok());
        let error = check(folder, 7_012_345_678, Some(91_200_000)).unwrap_err();
        assert!(!error.is_input());
        assert_eq!(
            error.to_string(),
            "out: the table requires about 7.01 GB, 91.2 MB are free\n\
             hint: free some space, or choose another folder; nothing was written"
        );
    }
}
