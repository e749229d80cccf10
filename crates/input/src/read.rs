//! Files that users name: the one place where they are opened and read.
//!
//! Only regular files are: a pipe would wait for ever, a device has no end. What is larger than any file of
//! its kind is refused before memory is spent on it.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Largest text that is read: scenario, study, thresholds, calibration, SRDF, URDF, parameters.
pub(crate) const MOST_TEXT_BYTES: u64 = 16 << 20;

/// Largest file of data that is read: meshes, logs, reports, manifests. A mesh of ten million triangles has
/// 500 MB.
pub(crate) const MOST_DATA_BYTES: u64 = 1 << 30;

/// Why a file cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum InputError {
    /// The system refuses.
    #[error("{0}")]
    Io(#[from] io::Error),
    /// It is none that has a beginning and an end.
    #[error("it is {what}, not a regular file")]
    NotRegular {
        /// What it is.
        what: &'static str,
    },
    /// It is larger than any of its kind.
    #[error("it is larger than {} MiB, the limit for such a file", limit >> 20)]
    TooLarge {
        /// The limit, bytes.
        limit: u64,
    },
    /// It is no text.
    #[error("it is not UTF-8 text: first invalid byte {at}")]
    NotText {
        /// Offset of the first byte that is wrong.
        at: usize,
    },
}

impl InputError {
    /// Whether there is no such file.
    pub fn is_not_found(&self) -> bool {
        matches!(self, Self::Io(error) if error.kind() == io::ErrorKind::NotFound)
    }

    /// How to fix it; `otherwise` where the error says nothing of that.
    pub fn hint<'a>(&self, otherwise: &'a str) -> &'a str {
        match self {
            Self::NotText { .. } => "save the file as UTF-8 text",
            Self::NotRegular { .. } => "give a file; write the output of a pipe to a file first",
            Self::Io(_) | Self::TooLarge { .. } => otherwise,
        }
    }
}

/// Opens a regular file.
///
/// # Errors
/// If there is none, or it is something else.
pub fn open_input(path: &Path) -> Result<File, InputError> {
    // Before it is opened, because opening a pipe waits for who writes to it.
    regular(&std::fs::metadata(path)?)?;
    let file = File::open(path)?;
    regular(&file.metadata()?)?;
    Ok(file)
}

/// Reads a regular file of data, up to `MOST_DATA_BYTES`.
///
/// # Errors
/// See [`InputError`].
pub fn read_data(path: &Path) -> Result<Vec<u8>, InputError> {
    read(path, MOST_DATA_BYTES)
}

/// Reads a regular file of text, up to `MOST_TEXT_BYTES`.
///
/// # Errors
/// See [`InputError`].
pub fn read_text(path: &Path) -> Result<String, InputError> {
    text(read(path, MOST_TEXT_BYTES)?)
}

/// Reads a regular file of data that is text, up to `MOST_DATA_BYTES`.
///
/// # Errors
/// See [`InputError`].
pub fn read_data_text(path: &Path) -> Result<String, InputError> {
    text(read(path, MOST_DATA_BYTES)?)
}

fn read(path: &Path, limit: u64) -> Result<Vec<u8>, InputError> {
    let file = open_input(path)?;
    if file.metadata()?.len() > limit {
        return Err(InputError::TooLarge { limit });
    }
    let mut bytes = Vec::new();
    // Some files grow while they are read, and some say that they are empty and are not.
    file.take(limit + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit {
        return Err(InputError::TooLarge { limit });
    }
    tracing::debug!(file = %path.display(), bytes = bytes.len(), "read");
    Ok(bytes)
}

fn text(bytes: Vec<u8>) -> Result<String, InputError> {
    String::from_utf8(bytes).map_err(|error| InputError::NotText {
        at: error.utf8_error().valid_up_to(),
    })
}

fn regular(metadata: &std::fs::Metadata) -> Result<(), InputError> {
    if metadata.is_file() {
        return Ok(());
    }
    let what = if metadata.is_dir() {
        "a folder"
    } else {
        kind(metadata.file_type())
    };
    Err(InputError::NotRegular { what })
}

#[cfg(unix)]
fn kind(kind: std::fs::FileType) -> &'static str {
    use std::os::unix::fs::FileTypeExt;
    match (kind.is_fifo(), kind.is_socket()) {
        (true, _) => "a pipe",
        (_, true) => "a socket",
        _ => "a device",
    }
}

#[cfg(not(unix))]
fn kind(_: std::fs::FileType) -> &'static str {
    "something else"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_regular_file_is_refused_by_what_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let refused = |path: &Path| read_text(path).unwrap_err().to_string();
        assert_eq!(refused(folder.path()), "it is a folder, not a regular file");
        if cfg!(unix) {
            let device = refused(Path::new("/dev/zero"));
            assert_eq!(device, "it is a device, not a regular file");
        }
        assert!(
            read_text(&folder.path().join("none"))
                .unwrap_err()
                .is_not_found()
        );
    }

    #[test]
    fn a_file_of_its_limit_is_read_and_a_larger_one_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("large");
        // Holes take no room on the disk.
        let file = File::create(&path).unwrap();
        file.set_len(MOST_TEXT_BYTES).unwrap();
        assert_eq!(read_text(&path).unwrap().len() as u64, MOST_TEXT_BYTES);
        file.set_len(MOST_TEXT_BYTES + 1).unwrap();
        let error = read_text(&path).unwrap_err();
        assert!(matches!(
            error,
            InputError::TooLarge {
                limit: MOST_TEXT_BYTES
            }
        ));
        assert!(error.to_string().contains("16 MiB"), "{error}");
    }

    #[test]
    fn bytes_that_are_no_text_are_found_where_they_begin() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("text");
        std::fs::write(&path, b"ab\xffc").unwrap();
        assert!(matches!(
            read_text(&path),
            Err(InputError::NotText { at: 2 })
        ));
        assert_eq!(read_data(&path).unwrap(), b"ab\xffc");
    }
}
