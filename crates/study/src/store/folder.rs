//! A study's folder: begun, continued, completed.

use std::io;
use std::num::NonZeroU64;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use super::atomic::sync_folder;
use super::codec::Packer;
use super::columns::Columns;
use super::error::StudyError;
use super::journal::{CheckedJournal, JOURNAL_FILE, Journal, Key, Places, Readers, kept, scan};
use super::manifest::{MANIFEST_FILE, Manifest, Status};
use super::parquet_read::ParquetResults;
use super::parquet_write::{self, WriteError};
use super::progress::Progress;
use super::salvage::sound_blocks;

/// Name of the table in a study's folder.
pub const RESULTS_FILE: &str = "results.parquet";

/// Name of the table as CSV in a study's folder.
pub const CSV_FILE: &str = "results.csv";

/// A folder that this process alone writes to.
#[derive(Debug)]
pub(crate) struct Folder {
    pub(crate) path: PathBuf,
    pub(crate) manifest: Manifest,
    pub(crate) journal: Journal,
    pub(crate) places: Places,
}

/// What is in a folder.
#[derive(Debug)]
pub(crate) enum Opened {
    /// All of it.
    Complete,
    /// Some blocks, or none.
    Running(Box<Folder>),
}

impl Folder {
    /// Begins a study in a folder, or goes on with it.
    pub(crate) fn open(
        path: &Path,
        manifest: &Manifest,
        resume: bool,
        watch: &(dyn Fn(Progress) + Sync),
    ) -> Result<Opened, StudyError> {
        std::fs::create_dir_all(path).map_err(StudyError::io("create", path))?;
        // Who only reads needs no lock.
        if check(path, manifest, resume)? == Some(Status::Complete)
            && unsound(path, manifest)?.is_none()
        {
            return Ok(Opened::Complete);
        }
        let mut journal = Journal::lock(path)?;
        // Another process may have completed the study while this one waited for its turn.
        let mut damaged = None;
        if check(path, manifest, true)? == Some(Status::Complete) {
            damaged = unsound(path, manifest)?;
            let Some(reason) = &damaged else {
                if manifest.shard.is_none() {
                    remove_journal(path)?;
                }
                return Ok(Opened::Complete);
            };
            watch(Progress::Unsound {
                file: &path.join(data_file(manifest)),
                reason,
            });
        }
        let mut manifest = manifest.clone();
        manifest.status = Status::Running;
        manifest.write(path)?;
        let journal_path = path.join(JOURNAL_FILE);
        let scan = journal.prepare(&journal_path, &manifest)?;
        let extent = &scan.extent;
        for damage in &extent.damages {
            watch(Progress::Damage {
                journal: &journal_path,
                offset: damage.offset,
                bytes: damage.bytes,
            });
        }
        if extent.tail_bytes > 0 {
            watch(Progress::CutOff {
                journal: &journal_path,
                offset: extent.end,
                bytes: extent.tail_bytes,
            });
        }
        let mut folder = Self {
            path: path.to_owned(),
            manifest,
            journal,
            places: scan.places,
        };
        if damaged.is_some() && folder.manifest.shard.is_none() {
            folder.salvage()?;
        }
        Ok(Opened::Running(Box::new(folder)))
    }

    /// Puts what is sound of the damaged table back into the journal.
    fn salvage(&mut self) -> Result<(), StudyError> {
        let (key, manifest) = (Key::new(&self.manifest), self.manifest.clone());
        let table = self.path.join(RESULTS_FILE);
        let mut packer = Packer::new().map_err(StudyError::Worker)?;
        let salvaged = sound_blocks(&table, &manifest, |block, columns| {
            let packed = packer.pack(columns)?;
            self.append(block, &key.record(block, columns.cases, &packed))
        });
        salvaged.map_err(|source| {
            let kept = kept(&manifest, &self.places);
            self.write_error(JOURNAL_FILE, source, kept)
        })
    }

    /// Adds a block.
    pub(crate) fn append(&mut self, block: u64, record: &[u8]) -> io::Result<()> {
        let place = self.journal.append(record)?;
        let index = usize::try_from(block).expect("blocks are indexed in memory");
        self.places[index] = NonZeroU64::new(place);
        Ok(())
    }

    /// An error of writing, with what is kept.
    pub(crate) fn write_error(&self, file: &str, source: io::Error, kept: u64) -> StudyError {
        StudyError::Write {
            path: self.path.join(file),
            source,
            kept,
            total: self.manifest.own_cases(),
            folder: self.path.clone(),
        }
    }

    /// Makes the folder complete, once all blocks are there.
    pub(crate) fn complete(
        self,
        threads: usize,
        watch: &(dyn Fn(Progress) + Sync),
    ) -> Result<(), StudyError> {
        if self.manifest.shard.is_none() {
            let blocks = Blocks {
                journals: vec![CheckedJournal {
                    folder: self.path.clone(),
                    shard: None,
                    length: None,
                }],
                places: self
                    .places
                    .iter()
                    .map(|place| place.map(|at| (0, at)))
                    .collect(),
            };
            write_results(&self.path, &blocks, &self.manifest, threads, watch).map_err(
                |error| match error {
                    WriteError::Source(error) => error,
                    WriteError::File(source) => {
                        let kept = kept(&self.manifest, &self.places);
                        self.write_error(RESULTS_FILE, source, kept)
                    }
                },
            )?;
        }
        self.completed()
    }

    /// Says that the folder is complete.
    pub(crate) fn completed(mut self) -> Result<(), StudyError> {
        self.manifest.status = Status::Complete;
        self.manifest.write(&self.path)?;
        // A shard's journal is its result.
        if self.manifest.shard.is_none() {
            remove_journal(&self.path)?;
        }
        Ok(())
    }
}

/// Refuses a folder that must not be touched; otherwise says how far it is.
fn check(path: &Path, manifest: &Manifest, resume: bool) -> Result<Option<Status>, StudyError> {
    let exists = |what: &str| StudyError::Exists {
        folder: path.to_owned(),
        what: what.to_owned(),
    };
    let Some(found) = Manifest::read(path)? else {
        if path.join(RESULTS_FILE).exists() {
            let message = format!(
                "is there without {MANIFEST_FILE}: its study is unknown\n\
                 hint: choose another folder"
            );
            return Err(StudyError::file(&path.join(RESULTS_FILE), message));
        }
        if path.join(JOURNAL_FILE).exists() && !resume {
            return Err(exists("an unfinished study"));
        }
        return Ok(None);
    };
    if let Some(error) = manifest.other_study(path, &found) {
        return Err(error);
    }
    let part = |manifest: &Manifest| {
        manifest
            .shard
            .map_or("the whole".to_owned(), |shard| format!("shard {shard}"))
    };
    if found.shard != manifest.shard {
        let message = format!(
            "holds {} of this study, not {}\nhint: every shard requires its own folder",
            part(&found),
            part(manifest)
        );
        return Err(StudyError::file(&path.join(MANIFEST_FILE), message));
    }
    if !resume {
        return Err(exists(match found.status {
            Status::Complete => "this study (complete)",
            Status::Running => "this study (incomplete)",
        }));
    }
    Ok(Some(found.status))
}

/// The file that has the results of a complete folder: a shard's journal is its result.
fn data_file(manifest: &Manifest) -> &'static str {
    if manifest.shard.is_some() {
        JOURNAL_FILE
    } else {
        RESULTS_FILE
    }
}

/// What is wrong with a folder that says that it is complete, if anything is: all of it is read.
fn unsound(path: &Path, manifest: &Manifest) -> Result<Option<String>, StudyError> {
    let file = path.join(data_file(manifest));
    if !file.exists() {
        return Ok(Some("is missing".to_owned()));
    }
    if manifest.shard.is_none() {
        return Ok(match ParquetResults::open(&file) {
            Ok(results) => results.other_than(manifest).map(str::to_owned),
            Err(error) => {
                let (message, _) = error
                    .message
                    .split_once('\n')
                    .unwrap_or((&error.message, ""));
                Some(message.to_owned())
            }
        });
    }
    let found = match scan(&file, manifest) {
        Ok(found) => found,
        Err(error @ StudyError::Io { .. }) => return Err(error),
        Err(error) => return Ok(Some(error.to_string())),
    };
    let (kept, total) = (kept(manifest, &found.places), manifest.own_cases());
    // What is no record between records is left of a damage that was computed again.
    Ok((kept < total).then(|| {
        let lost = total - kept;
        format!("{lost} of {total} cases are damaged or missing")
    }))
}

fn remove_journal(folder: &Path) -> Result<(), StudyError> {
    let path = folder.join(JOURNAL_FILE);
    std::fs::remove_file(&path)
        .and_then(|()| sync_folder(&path))
        .map_err(StudyError::io("remove", &path))
}

/// All blocks of a study, in the journals of some folders.
pub(crate) struct Blocks {
    pub(crate) journals: Vec<CheckedJournal>,
    /// Index of the journal and place of each block's record.
    pub(crate) places: Vec<Option<(u32, NonZeroU64)>>,
}

/// Writes the table of a study whose blocks are all there.
pub(crate) fn write_results(
    folder: &Path,
    blocks: &Blocks,
    manifest: &Manifest,
    threads: usize,
    watch: &(dyn Fn(Progress) + Sync),
) -> Result<(), WriteError<StudyError>> {
    // Every thread takes readers from here and puts them back.
    let idle = Mutex::new(Vec::new());
    let idle = || idle.lock().unwrap_or_else(PoisonError::into_inner);
    let source = |first: u64, count: u64| -> Result<Columns, StudyError> {
        let taken = idle().pop();
        let mut readers =
            taken.unwrap_or_else(|| Readers::new(&blocks.journals, manifest, threads));
        let mut columns = Columns::new(&manifest.factors, manifest.columns.len());
        let (mut case, end) = (first, first + count);
        while case < end {
            let block = case / u64::from(manifest.block_cases);
            let cases = manifest.block(block);
            let index = usize::try_from(block).expect("blocks are indexed in memory");
            let (journal, place) = blocks.places[index].expect("all blocks are there");
            let content = readers.read(journal as usize, place)?;
            let until = cases.end.min(end);
            let place = |case: u64| usize::try_from(case - cases.start).expect("within a block");
            columns.extend(&content, place(case)..place(until));
            case = until;
        }
        idle().push(readers);
        Ok(columns)
    };
    let mut done = 0;
    parquet_write::write(
        &folder.join(RESULTS_FILE),
        manifest,
        threads,
        source,
        |cases| {
            done += cases;
            watch(Progress::Table {
                done,
                total: manifest.cases,
            });
        },
    )
}
