//! Shards put together.

use std::fs::File;
use std::path::{Path, PathBuf};

use needlebench_cell::{InputError, open_input};

use super::error::StudyError;
use super::folder::{Blocks, Folder, Opened, RESULTS_FILE, write_results};
use super::journal::{BlockReader, JOURNAL_FILE, kept, scan};
use super::manifest::{Manifest, Shard, Status};
use super::parquet_write::WriteError;
use super::progress::Progress;
use super::run::RunEnd;

/// Writes the table of a study, the blocks of which are in the journals of shards. Its bytes are those
/// that the study has without shards.
///
/// Folders may overlap if they agree. `out` is a folder of its own; with `resume` it may be one of an
/// earlier, interrupted merge.
///
/// # Errors
/// [`StudyError::OtherStudy`] if the folders are not of one study, [`StudyError::Merge`] if blocks are
/// missing or folders contradict each other.
pub fn merge(
    out: &Path,
    folders: &[PathBuf],
    threads: usize,
    resume: bool,
    watch: &(dyn Fn(Progress) + Sync),
) -> Result<RunEnd, StudyError> {
    let shards = manifests(folders)?;
    let Some((_, first)) = shards.first() else {
        return Err(StudyError::Merge("there is nothing to merge".to_owned()));
    };
    let manifest = Manifest {
        shard: None,
        ..first.clone()
    };
    // Nobody may go on with a shard while it is read.
    let _locks = lock(&shards)?;
    let places = collect(&manifest, &shards, watch)?;
    let end = RunEnd::Finished {
        cases: manifest.cases,
        results: Some(out.join(RESULTS_FILE)),
    };
    let folder = match Folder::open(out, &manifest, resume, watch)? {
        Opened::Complete => return Ok(end),
        Opened::Running(folder) => folder,
    };
    let blocks = Blocks {
        folders: shards,
        places,
    };
    write_results(out, &blocks, &manifest, threads.max(1), watch).map_err(|error| match error {
        WriteError::Source(error) => error,
        WriteError::File(source) => StudyError::io("write", &out.join(RESULTS_FILE))(source),
    })?;
    folder.completed()?;
    Ok(end)
}

/// The manifests of all folders, which are of one study.
fn manifests(folders: &[PathBuf]) -> Result<Vec<(PathBuf, Manifest)>, StudyError> {
    let mut shards: Vec<(PathBuf, Manifest)> = Vec::new();
    for folder in folders {
        let manifest = Manifest::read(folder)?.ok_or_else(|| {
            StudyError::file(
                folder,
                "holds no study\nhint: give the folders of its shards",
            )
        })?;
        let first = shards.first().map(|(_, first)| first);
        if let Some(error) = first.and_then(|first| first.other_study(folder, &manifest)) {
            return Err(error);
        }
        if manifest.shard.is_none() && manifest.status == Status::Complete {
            return Err(StudyError::Merge(format!(
                "{}: holds the whole study already; there is nothing to merge",
                folder.display()
            )));
        }
        shards.push((folder.clone(), manifest));
    }
    Ok(shards)
}

fn lock(shards: &[(PathBuf, Manifest)]) -> Result<Vec<File>, StudyError> {
    let mut locks = Vec::new();
    for (folder, _) in shards {
        let path = folder.join(JOURNAL_FILE);
        let file = match open_input(&path) {
            Ok(file) => file,
            Err(error) if error.is_not_found() => {
                let message = "is not there\nhint: `needlebench study STUDY --shard K/N --resume` computes it again";
                return Err(StudyError::file(&path, message));
            }
            Err(InputError::Io(error)) => return Err(StudyError::io("open", &path)(error)),
            Err(error) => return Err(StudyError::file(&path, format!("is no journal: {error}"))),
        };
        match file.try_lock_shared() {
            Ok(()) => locks.push(file),
            Err(std::fs::TryLockError::WouldBlock) => {
                return Err(StudyError::Locked {
                    folder: folder.clone(),
                });
            }
            Err(std::fs::TryLockError::Error(error)) => {
                return Err(StudyError::io("lock", &path)(error));
            }
        }
    }
    Ok(locks)
}

type SharedPlaces = Vec<Option<(usize, std::num::NonZeroU64)>>;

/// Where all blocks are.
fn collect(
    manifest: &Manifest,
    shards: &[(PathBuf, Manifest)],
    watch: &(dyn Fn(Progress) + Sync),
) -> Result<SharedPlaces, StudyError> {
    let mut places: SharedPlaces = Vec::new();
    for (index, (folder, shard)) in shards.iter().enumerate() {
        let path = folder.join(JOURNAL_FILE);
        let scan = scan(&path, shard)?;
        // Of what was computed again nothing is missing.
        let lost = kept(shard, &scan.places) < shard.own_cases();
        for damage in scan.damages.iter().filter(|_| lost) {
            watch(Progress::Damage {
                journal: &path,
                offset: damage.offset,
                bytes: damage.bytes,
            });
        }
        places.resize(scan.places.len(), None);
        for (block, place) in (0..).zip(scan.places) {
            let known = usize::try_from(block).expect("blocks are indexed in memory");
            match (places[known], place) {
                (None, Some(place)) => places[known] = Some((index, place)),
                (Some((other, there)), Some(place)) => {
                    let (other_folder, other_manifest) = &shards[other];
                    let first =
                        BlockReader::open(other_folder, other_manifest)?.read(there, manifest)?;
                    let second = BlockReader::open(folder, shard)?.read(place, manifest)?;
                    if !first.same(&second) {
                        let cases = manifest.block(block);
                        return Err(StudyError::Merge(format!(
                            "{} and {} contradict each other in cases {} to {}: one of them was not \
                             computed by this program",
                            other_folder.display(),
                            folder.display(),
                            cases.start,
                            cases.end - 1
                        )));
                    }
                }
                (_, None) => {}
            }
        }
    }
    let missing = (0..manifest.blocks())
        .zip(&places)
        .filter(|(_, place)| place.is_none());
    let missing: Vec<u64> = missing.map(|(block, _)| block).collect();
    if missing.is_empty() {
        Ok(places)
    } else {
        Err(StudyError::Merge(missing_message(
            manifest, shards, &missing,
        )))
    }
}

/// Which shards to compute or to finish.
fn missing_message(manifest: &Manifest, shards: &[(PathBuf, Manifest)], missing: &[u64]) -> String {
    let cases: u64 = missing
        .iter()
        .map(|block| manifest.block_len(*block) as u64)
        .sum();
    let mut lines = vec![format!("{cases} of {} cases are missing", manifest.cases)];
    for (folder, shard) in shards {
        if missing.iter().any(|block| shard.owns(*block)) {
            let part = shard
                .shard
                .map_or("the study".to_owned(), |part| format!("shard {part}"));
            let damaged = if shard.status == Status::Complete {
                "was complete and is damaged"
            } else {
                "is not complete"
            };
            lines.push(format!("  {}: {part} {damaged}", folder.display()));
        }
    }
    let parts: std::collections::BTreeSet<u32> = shards
        .iter()
        .filter_map(|(_, shard)| shard.shard.map(Shard::parts))
        .collect();
    for parts in parts {
        for part in (1..=parts).filter_map(|part| Shard::new(part, parts)) {
            let given = shards.iter().any(|(_, shard)| shard.shard == Some(part));
            if !given && missing.iter().any(|block| part.owns(*block)) {
                lines.push(format!("  shard {part} is not among the folders"));
            }
        }
    }
    lines.push(
        "hint: `needlebench study STUDY --shard K/N --resume` finishes a shard, and computes what is damaged \
         again"
            .to_owned(),
    );
    lines.join("\n")
}
