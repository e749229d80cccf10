//! Folders of results: created, checked to be writable, and locked for one writer at a time.

use std::fs::{File, TryLockError};
use std::io::ErrorKind;
use std::path::Path;

use needlebench_input::Finding;
use needlebench_volume::write::TEMPORARY_PREFIX;

use crate::exit::ExitStatus;
use crate::failure::Failure;

/// Number of and time between attempts to lock a folder: a process that has just ended may still hold the lock.
const LOOKS: u32 = 10;
const LOOK: std::time::Duration = std::time::Duration::from_millis(50);

/// Depth of subfolders in which unfinished files are removed: `ct/surfaces`.
const DEEPEST: u32 = 2;

/// An exclusive lock on a folder of results. The system releases it however the program ends; no file is left in the
/// folder.
#[derive(Debug)]
#[must_use = "others may write into the folder once it is dropped"]
pub(crate) struct ResultsFolder {
    /// None if folders cannot be locked.
    _lock: Option<File>,
}

impl ResultsFolder {
    /// Creates a folder, checks that it can be written, locks it, and removes unfinished files of killed processes.
    ///
    /// # Errors
    /// It cannot be made or written; another process writes into it.
    pub(crate) fn take(folder: &Path) -> Result<Self, Failure> {
        prepare_folder(folder)?;
        let taken = Self {
            _lock: lock(folder)?,
        };
        clear(folder, 0);
        Ok(taken)
    }

    /// The same for patient data: a new folder is accessible to its owner only.
    ///
    /// # Errors
    /// As [`ResultsFolder::take`].
    pub(crate) fn take_private(folder: &Path) -> Result<Self, Failure> {
        make_private(folder);
        Self::take(folder)
    }
}

/// Locks the folder itself with the system's lock, if it supports folders.
fn lock(folder: &Path) -> Result<Option<File>, Failure> {
    let Ok(file) = File::open(folder) else {
        return Ok(None);
    };
    for _ in 0..LOOKS {
        match file.try_lock() {
            Ok(()) => return Ok(Some(file)),
            Err(TryLockError::WouldBlock) => std::thread::sleep(LOOK),
            Err(TryLockError::Error(_)) => return Ok(None),
        }
    }
    Err(Failure::Ended {
        status: ExitStatus::EnvironmentFailed,
        message: format!(
            "error: {}: another process is writing here\nhint: wait for it or choose another folder",
            folder.display()
        ),
    })
}

/// Removes unfinished files and folders, as far as possible.
fn clear(folder: &Path, depth: u32) {
    for entry in folder.read_dir().into_iter().flatten().flatten() {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        let is_unfinished = name.starts_with(TEMPORARY_PREFIX) && name.ends_with(".tmp");
        match entry.file_type() {
            Ok(kind) if kind.is_dir() && is_unfinished => {
                let _ = std::fs::remove_dir_all(entry.path());
            }
            Ok(kind) if kind.is_dir() && depth < DEEPEST => {
                // Another process may be writing there.
                let inner = File::open(entry.path());
                let is_taken = inner
                    .is_ok_and(|inner| matches!(inner.try_lock(), Err(TryLockError::WouldBlock)));
                if !is_taken {
                    clear(&entry.path(), depth + 1);
                }
            }
            Ok(kind) if kind.is_file() && is_unfinished => {
                let _ = std::fs::remove_file(entry.path());
            }
            _ => {}
        }
    }
}

/// Creates a folder and checks that it can be written.
///
/// # Errors
/// The folder cannot be created; the disk is full or unavailable, which is temporary.
pub(crate) fn prepare_folder(folder: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(folder)
        .and_then(|()| probe_folder(folder))
        .map_err(|error| {
            let message = format!("the results folder cannot be written: {error}");
            let passes = matches!(
                error.kind(),
                ErrorKind::StorageFull
                    | ErrorKind::QuotaExceeded
                    | ErrorKind::StaleNetworkFileHandle
                    | ErrorKind::TimedOut
                    | ErrorKind::ResourceBusy
                    | ErrorKind::Interrupted
            );
            if passes {
                return Failure::Ended {
                    status: ExitStatus::EnvironmentFailed,
                    message: format!(
                        "error: {}: {message}\nhint: free disk space, or choose another folder with --out DIR",
                        folder.display()
                    ),
                };
            }
            Finding::new(folder.display().to_string(), message)
                .key("--out")
                .hint("choose another folder with --out DIR")
                .into()
        })
}

fn make_private(folder: &Path) {
    #[cfg(unix)]
    if !folder.exists() {
        use std::os::unix::fs::DirBuilderExt;
        // An error is reported later.
        let _ = folder.parent().map_or(Ok(()), std::fs::create_dir_all);
        let _ = std::fs::DirBuilder::new().mode(0o700).create(folder);
    }
    #[cfg(not(unix))]
    let _ = folder;
}

/// Checks that a file named by an argument can be written, before a long run.
///
/// # Errors
/// It cannot.
pub(crate) fn probe_file(path: &Path, argument: &str) -> Result<(), Finding> {
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let writable = if path.is_dir() {
        Err(ErrorKind::IsADirectory.into())
    } else {
        probe_folder(folder)
    };
    writable.map_err(|error| {
        Finding::new(
            path.display().to_string(),
            format!("the file cannot be written: {error}"),
        )
        .key(argument)
        .hint("choose a file in an existing, writable folder")
    })
}

fn probe_folder(folder: &Path) -> std::io::Result<()> {
    let probe = folder.join(format!(".probe-{}", std::process::id()));
    std::fs::write(&probe, [])?;
    std::fs::remove_file(&probe)
}
