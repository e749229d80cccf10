//! Errors of studies.

use std::io;
use std::path::{Path, PathBuf};

use crate::{CaseError, ResultsError};

/// What fails where a file system has no locks.
pub(crate) const LOCK: &str = "lock";

/// Why a study cannot be begun, continued or merged.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "fields are named in the messages")]
pub enum StudyError {
    /// The operating system reported an error.
    #[error(
        "cannot {action} {}: {source}{}",
        path.display(),
        if *action == LOCK {
            "\nhint: the file system does not support locks (flock); use another one"
        } else {
            ""
        }
    )]
    Io {
        action: &'static str,
        path: PathBuf,
        source: io::Error,
    },
    /// The disk is full or failed while results were written.
    #[error(
        "cannot write {}: {source}\n{kept} of {total} cases are kept in {}; nothing is damaged\n\
         hint: {}continue with --resume",
        path.display(),
        folder.display(),
        if source.kind() == io::ErrorKind::StorageFull { "free some space and " } else { "" }
    )]
    Write {
        path: PathBuf,
        source: io::Error,
        kept: u64,
        total: u64,
        folder: PathBuf,
    },
    /// The environment failed in a case.
    #[error(
        "{source}\n{kept} of {total} cases are kept in {}\nhint: continue with --resume",
        folder.display()
    )]
    Case {
        source: CaseError,
        kept: u64,
        total: u64,
        folder: PathBuf,
    },
    /// Memory for packing rows cannot be had.
    #[error("cannot start a worker: {0}")]
    Worker(std::io::Error),
    /// Another process writes to the folder.
    #[error(
        "{}: another process is writing here\nhint: wait for it or choose another folder",
        folder.display()
    )]
    Locked { folder: PathBuf },
    /// A journal has changed since it was scanned.
    #[error(
        "{}: {change} since it was checked\nhint: merge again when no process writes to it",
        path.display()
    )]
    Changed { path: PathBuf, change: String },
    /// The disk is too small for what would be written.
    #[error(
        "{}: the table requires about {}, {} are free\n\
         hint: free some space, or choose another folder; nothing was written",
        folder.display(),
        in_words(*needed_bytes),
        in_words(*free_bytes)
    )]
    Space {
        folder: PathBuf,
        needed_bytes: u64,
        free_bytes: u64,
    },
    /// Results exist, and `--resume` was not given.
    #[error(
        "{}: already holds {what}\nhint: continue with --resume, or choose another folder",
        folder.display()
    )]
    Exists { folder: PathBuf, what: String },
    /// The folder holds results of another study.
    #[error(
        "{}: holds the results of another study\n  there: {found}\n  here:  {expected}{}\n\
         hint: choose another folder",
        folder.display(),
        lines(differences)
    )]
    OtherStudy {
        folder: PathBuf,
        found: String,
        expected: String,
        differences: Vec<String>,
    },
    /// A file of a study that cannot be understood.
    #[error("{}: {message}", path.display())]
    File { path: PathBuf, message: String },
    /// An invalid request.
    #[error("{0}")]
    Request(String),
    /// Shards that do not make up a study.
    #[error("{0}")]
    Merge(String),
    /// Results that cannot be read.
    #[error(transparent)]
    Results(#[from] ResultsError),
}

fn lines(differences: &[String]) -> String {
    let lines = differences
        .iter()
        .map(|each| format!("\n  different: {each}"));
    lines.collect::<Vec<_>>().concat()
}

/// Bytes as people say them: three digits.
pub(crate) fn in_words(bytes: u64) -> String {
    let bytes = bytes as f64;
    let (unit, size) = [("GB", 1e9), ("MB", 1e6), ("kB", 1e3)]
        .into_iter()
        .find(|(_, size)| bytes >= *size)
        .unwrap_or(("bytes", 1.0));
    let number = bytes / size;
    let decimals = if size == 1.0 || number >= 100.0 {
        0
    } else if number >= 10.0 {
        1
    } else {
        2
    };
    format!("{number:.decimals$} {unit}")
}

impl StudyError {
    /// Whether folders, files or the request are at fault: a retry gives the same error. All others may be
    /// transient.
    pub fn is_input(&self) -> bool {
        match self {
            Self::Exists { .. }
            | Self::OtherStudy { .. }
            | Self::File { .. }
            | Self::Request(_)
            | Self::Merge(_)
            | Self::Results(_) => true,
            Self::Io { .. }
            | Self::Write { .. }
            | Self::Case { .. }
            | Self::Worker(_)
            | Self::Locked { .. }
            | Self::Changed { .. }
            | Self::Space { .. } => false,
        }
    }

    /// For `map_err`.
    pub(crate) fn io(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io {
            action,
            path,
            source,
        }
    }

    pub(crate) fn file(path: &Path, message: impl Into<String>) -> Self {
        Self::File {
            path: path.to_owned(),
            message: message.into(),
        }
    }
}
