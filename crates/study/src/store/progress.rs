//! What happens while a study is computed or merged.

use std::path::{Path, PathBuf};

use super::error::in_words;

/// What happens in a run. `Display` gives a line for people.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(missing_docs, reason = "fields are named in the messages")]
pub enum Progress<'a> {
    /// The journal ends within a record, as after a kill; its block is recomputed.
    CutOff {
        journal: &'a Path,
        offset: u64,
        bytes: u64,
    },
    /// The journal is damaged; the damaged blocks are recomputed.
    Damage {
        journal: &'a Path,
        offset: u64,
        bytes: u64,
    },
    /// A folder marked complete is damaged: damaged cases are recomputed.
    Unsound { file: &'a Path, reason: &'a str },
    /// The given folders contain studies of other names, which are skipped.
    OtherStudies { folders: &'a [PathBuf] },
    /// So many shards are looked through.
    Shards { done: u64, total: u64 },
    /// The table will take so many bytes, beside those of the journals.
    Space {
        journal_bytes: u64,
        table_bytes: u64,
        free_bytes: Option<u64>,
    },
    /// So many cases were there at the beginning.
    Begin { kept: u64, total: u64 },
    /// So many cases are in the journal.
    Cases { done: u64, total: u64 },
    /// So many cases are in the table.
    Table { done: u64, total: u64 },
}

impl std::fmt::Display for Progress<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::CutOff {
                journal,
                offset,
                bytes,
            } => write!(
                f,
                "{}: ends within a block; {bytes} bytes from byte {offset} on are discarded",
                journal.display()
            ),
            Self::Damage {
                journal,
                offset,
                bytes,
            } => write!(
                f,
                "{}: {bytes} bytes from byte {offset} on are damaged; their cases are recomputed",
                journal.display()
            ),
            Self::Unsound { file, reason } => write!(
                f,
                "{}: {reason}; the study was complete, damaged cases are recomputed",
                file.display()
            ),
            Self::OtherStudies { folders } => write!(
                f,
                "skipped folders of other studies: {}{}",
                folders[0].display(),
                match folders.len() {
                    1 => String::new(),
                    more => format!(" and {} more", more - 1),
                }
            ),
            Self::Shards { done, total } => write!(f, "{done} of {total} shards scanned"),
            Self::Space {
                journal_bytes,
                table_bytes,
                free_bytes,
            } => {
                let [journals, table] = [*journal_bytes, *table_bytes].map(in_words);
                write!(
                    f,
                    "the table requires about {table} in addition to {journals} of journals"
                )?;
                match free_bytes {
                    Some(free) => write!(f, "; {} are free", in_words(*free)),
                    None => Ok(()),
                }
            }
            Self::Begin { kept, total } => write!(f, "{kept} of {total} cases already computed"),
            Self::Cases { done, total } => write!(f, "{done} of {total} cases"),
            Self::Table { done, total } => write!(f, "{done} of {total} cases in the table"),
        }
    }
}
