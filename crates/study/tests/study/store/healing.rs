//! Folders that say that they are complete, and are damaged.

use std::path::{Path, PathBuf};
use std::sync::Mutex;

use needlebench_study::{
    CaseError, CaseEvaluator, CaseResult, CaseWorker, JOURNAL_FILE, MANIFEST_FILE, RESULTS_FILE,
    RunEnd, Shard, StudyError, merge,
};

use super::folder::{Request, files};
use super::synthetic::SyntheticEvaluator;

/// Two row groups and a bit; blocks lie across their borders.
const CASES: u64 = 2 * 8192 + 100;
const BLOCK: u32 = 600;
const BLOCKS: u64 = CASES.div_ceil(BLOCK as u64);

/// Remembers which cases were computed.
#[derive(Default)]
struct Recorder(Mutex<Vec<u64>>);

struct RecordingWorker<'a> {
    inner: Box<dyn CaseWorker + 'a>,
    recorder: &'a Recorder,
}

impl CaseEvaluator for Recorder {
    fn worker(&self) -> Box<dyn CaseWorker + '_> {
        Box::new(RecordingWorker {
            inner: SyntheticEvaluator::FAST.worker(),
            recorder: self,
        })
    }
}

impl CaseWorker for RecordingWorker<'_> {
    fn evaluate(&mut self, case: u64) -> Result<CaseResult, CaseError> {
        self.recorder.0.lock().unwrap().push(case);
        self.inner.evaluate(case)
    }
}

/// Resumes a study; gives the blocks that were computed and what was said.
fn resume(folder: &Path, shard: Option<Shard>) -> (Vec<u64>, Vec<String>) {
    let recorder = Recorder::default();
    let request = Request {
        resume: true,
        shard,
        evaluator: &recorder,
        ..Request::new(CASES, BLOCK)
    };
    let (end, lines) = request.run_watched(folder);
    assert!(matches!(end.unwrap(), RunEnd::Finished { cases, .. } if cases > 0));
    let cases = recorder.0.into_inner().unwrap();
    let mut blocks: Vec<u64> = cases.iter().map(|case| case / u64::from(BLOCK)).collect();
    blocks.sort_unstable();
    blocks.dedup();
    (blocks, lines)
}

fn complete(shard: Option<Shard>) -> (tempfile::TempDir, Vec<u8>) {
    let folder = tempfile::tempdir().unwrap();
    let request = Request {
        shard,
        ..Request::new(CASES, BLOCK)
    };
    request.run(folder.path()).unwrap();
    let name = if shard.is_some() {
        JOURNAL_FILE
    } else {
        RESULTS_FILE
    };
    let bytes = std::fs::read(folder.path().join(name)).unwrap();
    (folder, bytes)
}

fn flipped(bytes: &[u8], at: usize) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    bytes[at] ^= 0x10;
    bytes
}

#[test]
fn a_damaged_table_is_made_whole_again() {
    let (folder, bytes) = complete(None);
    let table = folder.path().join(RESULTS_FILE);
    let footer = u32::from_le_bytes(bytes[bytes.len() - 8..][..4].try_into().unwrap()) as usize;
    let in_footer = bytes.len() - 8 - footer / 2;
    let manifest = std::fs::read(folder.path().join(MANIFEST_FILE)).unwrap();
    let damaged: [(&str, Option<Vec<u8>>); 5] = [
        ("cut off", Some(bytes[..bytes.len() / 2].to_vec())),
        ("empty", Some(Vec::new())),
        ("flipped in the rows", Some(flipped(&bytes, 1000))),
        ("flipped in the footer", Some(flipped(&bytes, in_footer))),
        ("missing", None),
    ];
    for (how, damaged) in damaged {
        match damaged {
            Some(damaged) => std::fs::write(&table, damaged).unwrap(),
            None => std::fs::remove_file(&table).unwrap(),
        }
        let (_, lines) = resume(folder.path(), None);
        assert!(
            lines[0].contains("results.parquet: is "),
            "{how}: {lines:?}"
        );
        assert!(
            lines[0].contains("damaged cases are recomputed"),
            "{how}: {lines:?}"
        );
        assert!(std::fs::read(&table).unwrap() == bytes, "{how}");
        assert!(std::fs::read(folder.path().join(MANIFEST_FILE)).unwrap() == manifest);
        assert_eq!(files(folder.path()), [RESULTS_FILE, MANIFEST_FILE]);
        assert_eq!(resume(folder.path(), None), (vec![], vec![]), "{how}");
    }
}

#[test]
fn of_a_damaged_table_only_the_damaged_row_group_is_computed_again() {
    let (folder, bytes) = complete(None);
    let table = folder.path().join(RESULTS_FILE);
    std::fs::write(&table, flipped(&bytes, 1000)).unwrap();
    let (blocks, lines) = resume(folder.path(), None);
    // Those that reach into the first row group, by their first case or by their last.
    let expected: Vec<u64> = (0..BLOCKS)
        .filter(|block| block * u64::from(BLOCK) < 8192)
        .collect();
    assert_eq!(blocks, expected);
    let kept = CASES - expected.len() as u64 * u64::from(BLOCK);
    assert_eq!(
        lines[1],
        format!("{kept} of {CASES} cases already computed")
    );
    assert!(std::fs::read(&table).unwrap() == bytes);
}

fn sharded() -> [(tempfile::TempDir, Shard); 2] {
    [1, 2].map(|part| {
        let shard = Shard::new(part, 2).unwrap();
        (complete(Some(shard)).0, shard)
    })
}

#[test]
fn a_damaged_shard_is_refused_by_merge_and_made_whole_by_resume() {
    let shards = sharded();
    let folders: Vec<PathBuf> = shards
        .iter()
        .map(|(each, _)| each.path().to_owned())
        .collect();
    let journal = folders[0].join(JOURNAL_FILE);
    let bytes = std::fs::read(&journal).unwrap();
    let merged = || -> Result<Vec<u8>, StudyError> {
        let out = tempfile::tempdir().unwrap();
        merge(out.path(), None, &folders, 2, true, &|_| {})?;
        Ok(std::fs::read(out.path().join(RESULTS_FILE)).unwrap())
    };
    let expected = complete(None).1;
    let damaged = [
        Some(flipped(&bytes, bytes.len() / 3)),
        Some(bytes[..bytes.len() - 10].to_vec()),
        Some(Vec::new()),
        None,
    ];
    for damaged in damaged {
        match damaged {
            Some(damaged) => std::fs::write(&journal, damaged).unwrap(),
            None => std::fs::remove_file(&journal).unwrap(),
        }
        let error = merged().unwrap_err();
        assert!(error.is_input(), "{error}");
        let text = error.to_string();
        assert!(text.contains("--resume"), "{text}");
        let (blocks, lines) = resume(&folders[0], Some(shards[0].1));
        assert!(!blocks.is_empty());
        assert!(
            lines[0].contains("damaged cases are recomputed"),
            "{lines:?}"
        );
        assert!(merged().unwrap() == expected);
        assert_eq!(resume(&folders[0], Some(shards[0].1)), (vec![], vec![]));
    }
}

#[test]
fn of_a_damaged_shard_only_the_damaged_block_is_computed_again() {
    let shard = Shard::new(1, 2).unwrap();
    let (folder, bytes) = complete(Some(shard));
    // Within the payload of one record, far from both ends.
    std::fs::write(
        folder.path().join(JOURNAL_FILE),
        flipped(&bytes, bytes.len() / 2),
    )
    .unwrap();
    let (blocks, lines) = resume(folder.path(), Some(shard));
    assert_eq!(blocks.len(), 1, "{blocks:?} {lines:?}");
    assert!(lines[0].contains("600 of "), "{lines:?}");
}

#[test]
fn a_table_of_another_study_in_a_complete_folder_is_not_taken_for_ours() {
    let (folder, bytes) = complete(None);
    let other = tempfile::tempdir().unwrap();
    Request::new(CASES - 1, BLOCK).run(other.path()).unwrap();
    let table = folder.path().join(RESULTS_FILE);
    std::fs::copy(other.path().join(RESULTS_FILE), &table).unwrap();
    let (_, lines) = resume(folder.path(), None);
    assert!(lines[0].contains("is of another study"), "{lines:?}");
    assert!(std::fs::read(&table).unwrap() == bytes);
}
