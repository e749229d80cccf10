//! Shards put together.
//!
//! There may be more shards than a process may have files. So each journal is locked, looked through and
//! closed again; where its blocks are stays in memory, and the few that are read at a time are opened anew:
//! one that has changed meanwhile, or that a process writes to, is rejected.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use needlebench_input::{InputError, open_input};

use super::error::StudyError;
use super::folder::{Blocks, Folder, Opened, RESULTS_FILE, write_results};
use super::journal::{
    CheckedJournal, Damage, FoundBlock, JOURNAL_FILE, Readers, lock_to_read, scan_blocks,
};
use super::manifest::{Manifest, Shard, Status};
use super::ordered::in_order;
use super::parquet_write::WriteError;
use super::progress::Progress;
use super::run::RunEnd;
use super::shards::{EmptyFolder, ShardFolder, ranges, shard_folders};
use super::space;

/// Writes the table of a study, the blocks of which are in the journals of shards. Its bytes are those
/// that the study has without shards.
///
/// `shards` are their folders, or folders that they are in, at most three levels below. They may be of
/// any numbers of parts, and may overlap if they agree. `study` is what they have to be of; that of the first
/// if it is left out. `out` is a folder of its own; with `resume` it may be one of an earlier, interrupted
/// merge.
///
/// # Errors
/// [`StudyError::OtherStudy`] if the folders are not of one study, [`StudyError::Merge`] if blocks are
/// missing or folders contradict each other, [`StudyError::Locked`] and [`StudyError::Changed`] if somebody
/// writes to one, [`StudyError::Space`] if the table would not fit the disk.
pub fn merge(
    out: &Path,
    study: Option<&Manifest>,
    shards: &[PathBuf],
    threads: usize,
    resume: bool,
    watch: &(dyn Fn(Progress) + Sync),
) -> Result<RunEnd, StudyError> {
    let threads = threads.max(1);
    let nothing = || StudyError::Merge("nothing to merge".to_owned());
    if shards.is_empty() {
        return Err(nothing());
    }
    let found = shard_folders(shards, Some(out), study, EmptyFolder::Refused, threads)?
        .ok_or_else(nothing)?;
    let (manifest, shards) = (found.manifest, found.folders);
    if !found.others.is_empty() {
        watch(Progress::OtherStudies {
            folders: &found.others,
        });
    }
    let whole = |each: &&ShardFolder| each.shard.is_none() && each.status == Status::Complete;
    if let Some(whole) = shards.iter().find(whole) {
        return Err(StudyError::Merge(format!(
            "{}: already holds the whole study; nothing to merge",
            whole.path.display()
        )));
    }
    if shards.is_empty() {
        return Err(nothing());
    }
    let end = RunEnd::Finished {
        cases: manifest.cases,
        results: Some(out.join(RESULTS_FILE)),
    };
    let collected = collect(&manifest, &shards, threads, watch)?;
    tracing::info!(
        shards = shards.len(),
        bytes = collected.bytes,
        skipped = found.others.len(),
        "shards of the study"
    );
    if !out.join(RESULTS_FILE).exists() {
        let table_bytes = space::table_bytes(&manifest, collected.bytes);
        let free_bytes = space::free_bytes(out);
        watch(Progress::Space {
            journal_bytes: collected.bytes,
            table_bytes,
            free_bytes,
        });
        space::check(out, table_bytes, free_bytes)?;
    }
    let folder = match Folder::open(out, &manifest, resume, watch)? {
        Opened::Complete => return Ok(end),
        Opened::Running(folder) => folder,
    };
    write_results(out, &collected.blocks, &manifest, threads, watch).map_err(
        |error| match error {
            WriteError::Source(error) => error,
            WriteError::File(source) => StudyError::io("write", &out.join(RESULTS_FILE))(source),
        },
    )?;
    folder.completed()?;
    Ok(end)
}

/// Where all blocks are.
struct Collected {
    blocks: Blocks,
    /// What they take in the journals.
    bytes: u64,
}

/// What is in a shard's journal.
struct Scanned {
    /// Each once, by number.
    blocks: Vec<FoundBlock>,
    damages: Vec<Damage>,
    length: u64,
}

/// Looks through all journals.
fn collect(
    manifest: &Manifest,
    shards: &[ShardFolder],
    threads: usize,
    watch: &(dyn Fn(Progress) + Sync),
) -> Result<Collected, StudyError> {
    let blocks = usize::try_from(manifest.blocks()).expect("blocks are indexed in memory");
    let mut journals: Vec<CheckedJournal> = Vec::new();
    let mut places = vec![None; blocks];
    let mut bytes = 0;
    let total = shards.len() as u64;
    in_order(
        total,
        threads,
        |index| {
            let index = usize::try_from(index).expect("an index of a list");
            scan_shard(&shards[index], manifest)
        },
        |scanned: Scanned| {
            let folder = &shards[journals.len()];
            let path = folder.path.join(JOURNAL_FILE);
            // Of what was computed again nothing is missing.
            let lost = (scanned.blocks.len() as u64) < manifest.blocks_of(folder.shard);
            for damage in scanned.damages.iter().filter(|_| lost) {
                watch(Progress::Damage {
                    journal: &path,
                    offset: damage.offset,
                    bytes: damage.bytes,
                });
            }
            let index = u32::try_from(journals.len()).expect("a study has fewer than 2^32 shards");
            journals.push(CheckedJournal {
                folder: folder.path.clone(),
                shard: folder.shard,
                length: Some(scanned.length),
            });
            let mut readers = Readers::new(&journals, manifest, 2 * threads);
            for found in scanned.blocks {
                let known = usize::try_from(found.block).expect("blocks are indexed in memory");
                if let Some((other, there)) = places[known] {
                    let other = other as usize;
                    let first = readers.read(other, there)?;
                    let second = readers.read(index as usize, found.place)?;
                    if !first.same(&second) {
                        let cases = manifest.block(found.block);
                        return Err(StudyError::Merge(format!(
                            "{} and {} differ in cases {} to {}: one of them was not computed by this \
                             program",
                            shards[other].path.display(),
                            folder.path.display(),
                            cases.start,
                            cases.end - 1
                        )));
                    }
                } else {
                    places[known] = Some((index, found.place));
                    bytes += found.bytes;
                }
            }
            watch(Progress::Shards {
                done: journals.len() as u64,
                total,
            });
            Ok(())
        },
    )?;
    let missing = (0..manifest.blocks())
        .zip(&places)
        .filter(|(_, place)| place.is_none());
    let missing: Vec<u64> = missing.map(|(block, _)| block).collect();
    if missing.is_empty() {
        Ok(Collected {
            blocks: Blocks { journals, places },
            bytes,
        })
    } else {
        Err(StudyError::Merge(missing_message(
            manifest, shards, &missing,
        )))
    }
}

/// Looks through a shard's journal, which no process may write to meanwhile.
fn scan_shard(shard: &ShardFolder, manifest: &Manifest) -> Result<Scanned, StudyError> {
    let path = shard.path.join(JOURNAL_FILE);
    let file = match open_input(&path) {
        Ok(file) => file,
        Err(error) if error.is_not_found() => {
            let message =
                "is missing\nhint: `needlebench study STUDY --shard K/N --resume` recomputes it";
            return Err(StudyError::file(&path, message));
        }
        Err(InputError::Io(error)) => return Err(StudyError::io("open", &path)(error)),
        Err(error) => {
            return Err(StudyError::file(
                &path,
                format!("is not a journal: {error}"),
            ));
        }
    };
    lock_to_read(&file, &shard.path)?;
    let length = file.metadata().map_err(StudyError::io("read", &path))?;
    let mut blocks = Vec::new();
    let extent = scan_blocks(file, &path, manifest, shard.shard, |found| {
        blocks.push(found);
    })?;
    // Of one that was computed again the first counts.
    blocks.sort_by_key(|found| found.block);
    blocks.dedup_by_key(|found| found.block);
    Ok(Scanned {
        blocks,
        damages: extent.damages,
        length: length.len(),
    })
}

/// Folders and shards that are named one by one.
const NAMED: usize = 12;

/// Which shards to compute or to finish.
fn missing_message(manifest: &Manifest, shards: &[ShardFolder], missing: &[u64]) -> String {
    let cases: u64 = missing
        .iter()
        .map(|block| manifest.block_len(*block) as u64)
        .sum();
    let mut lines = vec![format!("{cases} of {} cases are missing", manifest.cases)];
    // By number of parts: those that lack something, and those that are there.
    let mut lacking: BTreeMap<u32, BTreeSet<u32>> = BTreeMap::new();
    let mut given: BTreeSet<Shard> = BTreeSet::new();
    for shard in shards.iter().filter_map(|folder| folder.shard) {
        given.insert(shard);
        lacking.entry(shard.parts()).or_insert_with(|| {
            let part = |block: &u64| block % u64::from(shard.parts()) + 1;
            let parts = missing.iter().map(part);
            parts
                .map(|part| u32::try_from(part).expect("at most the number of parts"))
                .collect()
        });
    }
    let lacks = |shard: Option<Shard>| {
        shard.is_none_or(|shard| lacking[&shard.parts()].contains(&shard.part()))
    };
    let incomplete: Vec<&ShardFolder> = shards.iter().filter(|each| lacks(each.shard)).collect();
    for folder in incomplete.iter().take(NAMED) {
        let part = folder
            .shard
            .map_or("the study".to_owned(), |part| format!("shard {part}"));
        let damaged = if folder.status == Status::Complete {
            "is damaged"
        } else {
            "is incomplete"
        };
        lines.push(format!("  {}: {part} {damaged}", folder.path.display()));
    }
    if let Some(more) = incomplete.len().checked_sub(NAMED).filter(|more| *more > 0) {
        lines.push(format!("  and {more} more that are incomplete or damaged"));
    }
    for (parts, lacking) in &lacking {
        let absent = lacking
            .iter()
            .filter(|part| Shard::new(**part, *parts).is_some_and(|shard| !given.contains(&shard)));
        let absent: Vec<u32> = absent.copied().collect();
        if absent.len() <= NAMED {
            for part in absent {
                lines.push(format!("  shard {part}/{parts} has no folder"));
            }
        } else {
            lines.push(format!(
                "  {} shards of {parts} have no folder: {}",
                absent.len(),
                ranges(absent.iter().copied())
            ));
        }
    }
    lines.push(
        "hint: `needlebench study STUDY --shard K/N --resume` completes a shard and recomputes damaged cases"
            .to_owned(),
    );
    lines.join("\n")
}
