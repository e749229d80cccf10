//! Files that are either whole or not there.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use tempfile::Builder;

use crate::VolumeError;

/// Writes a file beside its place and then renames it, so that nobody ever sees half of it; an error leaves what was there.
pub(super) fn write_whole(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), VolumeError> {
    stream(path, write).map_err(|error| match error.kind() {
        io::ErrorKind::Interrupted => VolumeError::Interrupted,
        _ => VolumeError::refused(format!("cannot be written: {error}"))
            .at(path.display().to_string()),
    })
}

/// Writes a file of these bytes, whole or not at all.
///
/// # Errors
/// A file that cannot be written.
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), VolumeError> {
    write_whole(path, |file| file.write_all(bytes))
}

/// How the names of files begin that are being written; they end with `.tmp`. A killed writer leaves them behind.
pub const TEMPORARY_PREFIX: &str = ".needlebench-";

/// Writes a file bit by bit, whole or not at all.
///
/// # Errors
/// What the system says, or what `write` does; what was there stays.
pub fn stream(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> io::Result<()> {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let mut builder = Builder::new();
    builder.prefix(TEMPORARY_PREFIX).suffix(".tmp");
    #[cfg(unix)]
    {
        // As any file: the user's mask decides who may read it.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let (file, place) = builder.tempfile_in(folder)?.into_parts();
    let mut file = BufWriter::new(file);
    write(&mut file)?;
    file.flush()?;
    place.persist(path)?;
    Ok(())
}

/// An error of kind `Interrupted` once `cancel` is set.
pub(super) fn go_on(cancel: &AtomicBool) -> io::Result<()> {
    if cancel.load(Ordering::Relaxed) {
        return Err(io::ErrorKind::Interrupted.into());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_whole_or_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ct.nii");
        write_whole(&path, |file| file.write_all(b"first")).unwrap();
        let cancel = AtomicBool::new(true);
        let stopped = write_whole(&path, |file| {
            file.write_all(b"half")?;
            go_on(&cancel)
        });
        assert_eq!(stopped, Err(VolumeError::Interrupted));
        assert_eq!(std::fs::read(&path).unwrap(), b"first");
        assert_eq!(folder.path().read_dir().unwrap().count(), 1);
    }

    #[test]
    fn a_folder_that_is_not_there_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("missing").join("ct.nii");
        let error = write_whole(&path, |_| Ok(())).unwrap_err();
        let VolumeError::Refused { place, .. } = error else {
            panic!("{error}");
        };
        assert_eq!(place.as_deref(), path.to_str());
    }
}
