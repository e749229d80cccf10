//! Files that are either whole or not there, even after a power failure.
//!
//! Not through `tempfile`: what a killed process leaves of a table of gigabytes is overwritten by the next
//! one under the same name, and file and folder are on the disk before anything relies on them.

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// A file under a temporary name in the folder of the final one. Dropped before
/// [`AtomicFile::commit`], it leaves nothing.
pub(crate) struct AtomicFile {
    path: PathBuf,
    /// `None` once committed.
    temporary: Option<PathBuf>,
    file: File,
}

impl AtomicFile {
    /// The temporary name is always the same: what a killed process left is overwritten by the next.
    pub(crate) fn create(path: &Path) -> io::Result<Self> {
        let mut name = std::ffi::OsString::from(".");
        name.push(path.file_name().unwrap_or_default());
        name.push(".tmp");
        let temporary = path.with_file_name(name);
        Ok(Self {
            path: path.to_owned(),
            file: File::options()
                .read(true)
                .write(true)
                .create(true)
                .truncate(true)
                .open(&temporary)?,
            temporary: Some(temporary),
        })
    }

    /// To write to, and to read what is written.
    pub(crate) fn file(&self) -> &File {
        &self.file
    }

    /// Renames the file into place once all of it is on the disk.
    pub(crate) fn commit(mut self) -> io::Result<()> {
        self.file.sync_all()?;
        if let Some(temporary) = &self.temporary {
            std::fs::rename(temporary, &self.path)?;
            self.temporary = None;
        }
        sync_folder(&self.path)
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        if let Some(temporary) = &self.temporary {
            // Nothing more can be done about a leftover than to report the first error.
            let _ = std::fs::remove_file(temporary);
        }
    }
}

/// Writes a small file.
pub(crate) fn write_atomically(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let file = AtomicFile::create(path)?;
    file.file().write_all(bytes)?;
    file.commit()
}

/// Makes the folder remember that a file has come or gone.
pub(crate) fn sync_folder(file: &Path) -> io::Result<()> {
    // Only Unix opens folders.
    if cfg!(unix) {
        let folder = file
            .parent()
            .filter(|folder| !folder.as_os_str().is_empty());
        File::open(folder.unwrap_or(Path::new(".")))?.sync_all()?;
    }
    Ok(())
}
