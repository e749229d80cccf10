//! Cases computed in parallel, block by block, into a folder.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use super::case_design::CaseDesign;
use super::codec::Packer;
use super::columns::Columns;
use super::error::StudyError;
use super::folder::{Folder, Opened, RESULTS_FILE};
use super::journal::{JOURNAL_FILE, Key, kept};
use super::manifest::Manifest;
use super::progress::Progress;
use super::schema;
use crate::{CaseError, CaseEvaluator};

/// How a run ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum RunEnd {
    /// Everything is there.
    Finished {
        /// Number of cases of the folder.
        cases: u64,
        /// The table; a shard has none.
        results: Option<PathBuf>,
    },
    /// It was cancelled. What is done is kept.
    Partial {
        /// Number of cases that are in the journal.
        done: u64,
        /// Number of cases of the folder.
        total: u64,
    },
}

/// A study, or a shard of it, to be computed.
pub struct StudyRun<'a> {
    /// Which cases there are.
    pub design: &'a dyn CaseDesign,
    /// What the results are results of; its status is of no interest.
    pub manifest: Manifest,
    /// What computes the cases.
    pub evaluator: &'a dyn CaseEvaluator,
    /// Number of threads, at least one. The results do not depend on it.
    pub threads: usize,
    /// Whether to go on where an earlier run has stopped.
    pub resume: bool,
}

impl StudyRun<'_> {
    /// Computes all cases that are not yet in the folder, then writes the table. `watch` is called from
    /// any thread, one at a time.
    ///
    /// # Errors
    /// See [`StudyError`]. Blocks that were finished are kept, whatever happens.
    pub fn run(
        &self,
        folder: &Path,
        cancel: &AtomicBool,
        watch: &(dyn Fn(Progress) + Sync),
    ) -> Result<RunEnd, StudyError> {
        self.check()?;
        let total = self.manifest.own_cases();
        let finished = || RunEnd::Finished {
            cases: total,
            results: self
                .manifest
                .shard
                .is_none()
                .then(|| folder.join(RESULTS_FILE)),
        };
        let mut folder = match Folder::open(folder, &self.manifest, self.resume, watch)? {
            Opened::Complete => {
                tracing::info!(total, "the study is complete");
                return Ok(finished());
            }
            Opened::Running(folder) => folder,
        };
        let kept = kept(&folder.manifest, &folder.places);
        tracing::info!(kept, total, threads = self.threads, "cases of the study");
        watch(Progress::Begin { kept, total });
        let end = self.compute(&mut folder, cancel, watch);
        let lasts = self.manifest.shard.is_some() || !matches!(end, Ok(done) if done == total);
        // A journal that a table will soon replace need not outlast a power failure.
        let synced = if lasts { folder.journal.sync() } else { Ok(()) };
        let done = end?;
        synced.map_err(|source| folder.write_error(JOURNAL_FILE, source, done))?;
        if done < total {
            return Ok(RunEnd::Partial { done, total });
        }
        folder.complete(self.threads.max(1), watch)?;
        Ok(finished())
    }

    fn check(&self) -> Result<(), StudyError> {
        let manifest = &self.manifest;
        schema::check(&manifest.factors, &manifest.columns).map_err(StudyError::Request)?;
        if manifest.factors != self.design.factors() || manifest.cases != self.design.cases() {
            let message = "the manifest does not match the design";
            return Err(StudyError::Request(message.to_owned()));
        }
        if manifest.block_cases == 0 {
            let message = "a block has at least one case";
            return Err(StudyError::Request(message.to_owned()));
        }
        if let Some(shard) = manifest
            .shard
            .filter(|shard| u64::from(shard.parts()) > manifest.blocks())
        {
            return Err(StudyError::Request(format!(
                "shard {shard}: the study has only {} blocks of {} cases\nhint: use fewer shards",
                manifest.blocks(),
                manifest.block_cases
            )));
        }
        Ok(())
    }

    /// Computes what is missing; returns the number of cases that are there then.
    fn compute(
        &self,
        folder: &mut Folder,
        cancel: &AtomicBool,
        watch: &(dyn Fn(Progress) + Sync),
    ) -> Result<u64, StudyError> {
        let manifest = folder.manifest.clone();
        let missing: Vec<u64> = (0..manifest.blocks())
            .zip(&folder.places)
            .filter(|(block, place)| place.is_none() && manifest.owns(*block))
            .map(|(block, _)| block)
            .collect();
        let key = Key::new(&manifest);
        let total = manifest.own_cases();
        let done = kept(&manifest, &folder.places);
        let next = AtomicUsize::new(0);
        let stop = AtomicBool::new(false);
        let shared = Mutex::new(Shared {
            folder,
            done,
            failure: None,
        });
        let work = || {
            let failed = |failure: Failure| {
                stop.store(true, Ordering::Relaxed);
                let mut shared = shared.lock().unwrap_or_else(PoisonError::into_inner);
                shared.fail(failure);
            };
            let mut worker = self.evaluator.worker();
            let mut packer = match Packer::new() {
                Ok(packer) => packer,
                Err(error) => return failed(Failure::Worker(error)),
            };
            let stopped = || stop.load(Ordering::Relaxed) || cancel.load(Ordering::Relaxed);
            while let Some(block) = missing.get(next.fetch_add(1, Ordering::Relaxed)) {
                let mut columns = Columns::new(&manifest.factors, manifest.columns.len());
                for case in manifest.block(*block) {
                    if stopped() {
                        return;
                    }
                    match worker.evaluate(case) {
                        Ok(result) => columns.push(&self.design.values(case), &result),
                        // Asked to stop, a worker may well not finish.
                        Err(_) if cancel.load(Ordering::Relaxed) => return,
                        Err(error) => return failed(Failure::Case(error)),
                    }
                }
                let record = match packer.pack(&columns) {
                    Ok(packed) => key.record(*block, columns.cases, &packed),
                    Err(error) => return failed(Failure::Write(error)),
                };
                let mut shared = shared.lock().unwrap_or_else(PoisonError::into_inner);
                if let Err(error) = shared.folder.append(*block, &record) {
                    stop.store(true, Ordering::Relaxed);
                    shared.fail(Failure::Write(error));
                    return;
                }
                shared.done += columns.cases as u64;
                watch(Progress::Cases {
                    done: shared.done,
                    total,
                });
            }
        };
        std::thread::scope(|scope| {
            for _ in 1..self.threads {
                scope.spawn(work);
            }
            work();
        });
        let shared = shared.into_inner().unwrap_or_else(PoisonError::into_inner);
        match shared.failure {
            None => Ok(shared.done),
            Some(failure) => Err(failure.into_error(shared.folder, shared.done)),
        }
    }
}

/// What threads share.
struct Shared<'a> {
    folder: &'a mut Folder,
    done: u64,
    failure: Option<Failure>,
}

impl Shared<'_> {
    /// Keeps the failure of the first case, so that the message does not depend on the threads more
    /// than it must.
    fn fail(&mut self, failure: Failure) {
        if self
            .failure
            .as_ref()
            .is_none_or(|known| failure.rank() < known.rank())
        {
            self.failure = Some(failure);
        }
    }
}

enum Failure {
    Worker(std::io::Error),
    Write(std::io::Error),
    Case(CaseError),
}

impl Failure {
    fn rank(&self) -> (u8, u64) {
        match self {
            Self::Worker(_) => (0, 0),
            Self::Write(_) => (1, 0),
            Self::Case(error) => (2, error.case),
        }
    }

    fn into_error(self, folder: &Folder, kept: u64) -> StudyError {
        match self {
            Self::Worker(source) => StudyError::Worker(source),
            Self::Write(source) => folder.write_error(JOURNAL_FILE, source, kept),
            Self::Case(source) => StudyError::Case {
                source,
                kept,
                total: folder.manifest.own_cases(),
                folder: folder.path.clone(),
            },
        }
    }
}
