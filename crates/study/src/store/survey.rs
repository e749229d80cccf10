//! How far the shards of a study are, while they are computed or afterwards.

use std::collections::BTreeMap;
use std::path::PathBuf;

use super::error::{LOCK, StudyError};
use super::journal::{JOURNAL_FILE, lock_to_read, open, scan_blocks};
use super::manifest::{Manifest, Shard, Status};
use super::ordered::in_order;
use super::shards::{EmptyFolder, ShardFolder, shard_folders};

/// How far a shard is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ShardState {
    /// It says that all of it is there.
    Done,
    /// A process writes to it.
    Running,
    /// It was begun, and no process writes to it.
    Stopped,
}

/// A shard that was begun.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ShardSurvey {
    /// Its folder.
    pub folder: PathBuf,
    /// Which part of the study it is; all of it without one.
    pub shard: Option<Shard>,
    /// How far it is.
    pub state: ShardState,
    /// Cases that are there.
    pub done: u64,
    /// Cases that it is to have.
    pub cases: u64,
}

/// How far a study is whose shards may be of several numbers of parts.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Survey {
    /// Cases of the study.
    pub cases: u64,
    /// Cases that are in some shard.
    pub done: u64,
    /// Most shards that the study may have.
    pub blocks: u64,
    /// Shards that were begun, in the order of their folders.
    pub shards: Vec<ShardSurvey>,
    /// Number of parts of which the rest is counted: what was asked for, or else what most folders have.
    /// `None` if no folder is of a part.
    pub parts: Option<u32>,
    /// Other numbers of parts, and how many folders there are of each.
    pub mixed: BTreeMap<u32, usize>,
    /// Parts of `parts` whose cases are not all there and that no process writes to, in order.
    pub missing: Vec<u32>,
    /// Parts of `parts` whose cases are not all there and that a process writes to, in order.
    pub running: Vec<u32>,
    /// Folders that are of studies of other names.
    pub others: Vec<PathBuf>,
}

impl Survey {
    /// Whether all cases are there.
    pub fn is_complete(&self) -> bool {
        self.done == self.cases
    }

    /// Number of shards in a state.
    pub fn count(&self, state: ShardState) -> usize {
        self.shards
            .iter()
            .filter(|each| each.state == state)
            .count()
    }
}

/// Says how far the shards of a study are. Those that say that they are complete are believed; of others
/// every block is checked. Nobody is kept from writing.
///
/// `folders` are as for [`merge`](super::merge::merge); folders that are not there, or hold nothing yet, are
/// those of a study of which nothing is there. `parts` is of how many shards the study is to be, if the folders
/// are not to say it.
///
/// # Errors
/// [`StudyError::OtherStudy`] if a folder is of another study; what cannot be read.
pub fn survey(
    study: &Manifest,
    folders: &[PathBuf],
    parts: Option<u32>,
    threads: usize,
) -> Result<Survey, StudyError> {
    let threads = threads.max(1);
    let found = shard_folders(folders, None, Some(study), EmptyFolder::LeftOut, threads)?
        .expect("the study is known");
    let manifest = found.manifest;
    let blocks = usize::try_from(manifest.blocks()).expect("blocks are indexed in memory");
    // Whether each block is there, and whether somebody computes it.
    let mut done = vec![false; blocks];
    let mut running = vec![false; blocks];
    let mut shards = Vec::new();
    in_order(
        found.folders.len() as u64,
        threads,
        |index| {
            let folder = &found.folders[usize::try_from(index).expect("an index of a list")];
            Ok((folder, look(folder, &manifest)?))
        },
        |(folder, (state, found))| {
            let own = own_blocks(folder.shard, blocks);
            match &found {
                None => own.clone().for_each(|block| done[block] = true),
                Some(found) => found.iter().for_each(|block| done[*block] = true),
            }
            if state == ShardState::Running {
                own.for_each(|block| running[block] = true);
            }
            let cases = manifest.cases_of(folder.shard);
            let found_cases = found.map(|found| {
                let lengths = found.iter().map(|block| manifest.block_len(*block as u64));
                lengths.sum::<usize>() as u64
            });
            shards.push(ShardSurvey {
                folder: folder.path.clone(),
                shard: folder.shard,
                state,
                done: found_cases.unwrap_or(cases),
                cases,
            });
            Ok::<(), StudyError>(())
        },
    )?;
    let mut counts: BTreeMap<u32, usize> = BTreeMap::new();
    for shard in shards.iter().filter_map(|each: &ShardSurvey| each.shard) {
        *counts.entry(shard.parts()).or_default() += 1;
    }
    let most = counts.iter().max_by_key(|(_, count)| **count);
    let parts = parts.or(most.map(|(parts, _)| *parts));
    counts.retain(|each, _| Some(*each) != parts);
    let (mut missing, mut computed) = (Vec::new(), Vec::new());
    for shard in (1..=parts.unwrap_or(0)).filter_map(|part| Shard::new(part, parts?)) {
        let mut lacking = own_blocks(Some(shard), blocks).filter(|block| !done[*block]);
        if lacking.clone().any(|block| !running[block]) {
            missing.push(shard.part());
        } else if lacking.next().is_some() {
            computed.push(shard.part());
        }
    }
    let lengths = (0..).zip(&done).filter(|(_, done)| **done);
    Ok(Survey {
        cases: manifest.cases,
        done: lengths
            .map(|(block, _)| manifest.block_len(block) as u64)
            .sum(),
        blocks: manifest.blocks(),
        shards,
        parts,
        mixed: counts,
        missing,
        running: computed,
        others: found.others,
    })
}

/// Blocks of a part of a study that has so many.
fn own_blocks(shard: Option<Shard>, blocks: usize) -> impl Iterator<Item = usize> + Clone {
    let (first, step) = shard.map_or((0, 1), |shard| (shard.part() - 1, shard.parts()));
    (first as usize..blocks).step_by(step as usize)
}

/// State of a shard and the blocks that are there, each once; `None` if it says that all are.
fn look(
    folder: &ShardFolder,
    manifest: &Manifest,
) -> Result<(ShardState, Option<Vec<usize>>), StudyError> {
    let path = folder.path.join(JOURNAL_FILE);
    if !path.exists() {
        // The whole study leaves no journal; a shard without one has nothing.
        let whole = folder.shard.is_none() && folder.status == Status::Complete;
        return Ok(if whole {
            (ShardState::Done, None)
        } else {
            (ShardState::Stopped, Some(Vec::new()))
        });
    }
    let file = open(&path)?;
    // For this moment alone: who wants to write tries again.
    let is_written = match lock_to_read(&file, &folder.path) {
        Ok(()) => {
            file.unlock().map_err(StudyError::io(LOCK, &path))?;
            false
        }
        Err(StudyError::Locked { .. }) => true,
        Err(error) => return Err(error),
    };
    if folder.status == Status::Complete && !is_written {
        return Ok((ShardState::Done, None));
    }
    let mut found = Vec::new();
    scan_blocks(file, &path, manifest, folder.shard, |block| {
        found.push(usize::try_from(block.block).expect("blocks are indexed in memory"));
    })?;
    found.sort_unstable();
    found.dedup();
    let state = if is_written {
        ShardState::Running
    } else {
        ShardState::Stopped
    };
    Ok((state, Some(found)))
}
