//! Shards that make up a study, and shards that do not.

use std::path::{Path, PathBuf};

use needlebench_study::{
    CaseError, CaseEvaluator, CaseResult, CaseWorker, MANIFEST_FILE, RunEnd, Shard, merge,
};

use super::folder::{Request, files, tables};
use super::synthetic::SyntheticEvaluator;

const CASES: u64 = 100;
const BLOCK: u32 = 8;

/// Runs a shard into a folder of its name.
fn shard(place: &Path, part: u32, parts: u32) -> PathBuf {
    let folder = place.join(format!("{part}of{parts}"));
    let request = Request {
        shard: Shard::new(part, parts),
        ..Request::new(CASES, BLOCK)
    };
    request.run(&folder).unwrap();
    folder
}

fn refused(place: &Path, folders: &[PathBuf]) -> String {
    let out = place.join("out");
    let text = merge(&out, folders, 1, false, &|_| {})
        .unwrap_err()
        .to_string();
    assert!(!out.exists(), "{text}");
    text.replace(&place.display().to_string(), "")
}

#[test]
fn missing_shards_are_listed() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let folders = [shard(place, 1, 4), shard(place, 3, 4)];
    assert_eq!(
        refused(place, &folders),
        "48 of 100 cases are missing\n  \
         shard 2/4 is not among the folders\n  \
         shard 4/4 is not among the folders\n\
         hint: `needlebench study STUDY --shard K/N --resume` finishes a shard, and \
          computes what is damaged again"
    );
    assert_eq!(refused(place, &[]), "there is nothing to merge");
    let text = refused(place, &[place.join("nowhere")]);
    assert!(text.starts_with("/nowhere: holds no study"), "{text}");
}

#[test]
fn a_shard_that_is_not_complete_is_named() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let folders = [shard(place, 1, 2), shard(place, 2, 2)];
    let journal = folders[1].join("journal.nbj");
    let bytes = std::fs::read(&journal).unwrap();
    std::fs::write(&journal, &bytes[..bytes.len() - 1]).unwrap();
    assert_eq!(
        refused(place, &folders),
        "8 of 100 cases are missing\n  \
         /2of2: shard 2/2 was complete and is damaged\n\
         hint: `needlebench study STUDY --shard K/N --resume` finishes a shard, and \
          computes what is damaged again"
    );
}

#[test]
fn shards_that_agree_may_overlap() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let whole = place.join("whole");
    Request::new(CASES, BLOCK).run(&whole).unwrap();
    let folders = [
        shard(place, 1, 2),
        shard(place, 1, 3),
        shard(place, 2, 2),
        shard(place, 3, 3),
    ];
    let out = place.join("out");
    let end = merge(&out, &folders, 2, false, &|_| {}).unwrap();
    assert!(matches!(end, RunEnd::Finished { cases: CASES, .. }));
    assert_eq!(files(&out), ["results.parquet", "study.json"]);
    assert!(tables(&out) == tables(&whole));
    // Again: refused, unless it is to go on.
    assert!(merge(&out, &folders, 2, false, &|_| {}).is_err());
    assert!(merge(&out, &folders, 2, true, &|_| {}).is_ok());
}

/// Computes every case as if it were the next.
struct Shifted;

struct ShiftedWorker(Box<dyn CaseWorker>);

impl CaseEvaluator for Shifted {
    fn worker(&self) -> Result<Box<dyn CaseWorker + '_>, String> {
        Ok(Box::new(ShiftedWorker(SyntheticEvaluator::FAST.worker()?)))
    }
}

impl CaseWorker for ShiftedWorker {
    fn evaluate(&mut self, case: u64) -> Result<CaseResult, CaseError> {
        let result = self.0.evaluate(case + 1)?;
        Ok(CaseResult { case, ..result })
    }
}

#[test]
fn shards_that_contradict_each_other_are_refused() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let one = shard(place, 1, 2);
    let other = place.join("other");
    // A program that draws other numbers and says it is the same study.
    let shifted = Shifted;
    let request = Request {
        shard: Shard::new(1, 1),
        evaluator: &shifted,
        ..Request::new(CASES, BLOCK)
    };
    request.run(&other).unwrap();
    let text = refused(place, &[one, other]);
    assert_eq!(
        text,
        "/1of2 and /other contradict each other in cases 0 to 7: one of them was not computed by this \
         program"
    );
}

#[test]
fn shards_of_two_studies_are_refused() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let one = shard(place, 1, 2);
    let two = shard(place, 2, 2);
    let path = two.join(MANIFEST_FILE);
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, text.replace("5eed", "0ther")).unwrap();
    let text = refused(place, &[one, two]);
    assert!(
        text.starts_with("/2of2: holds the results of another study\n"),
        "{text}"
    );
}

#[test]
fn a_shard_that_is_being_written_is_not_merged() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let folders = [shard(place, 1, 2), shard(place, 2, 2)];
    let journal = std::fs::File::open(folders[1].join("journal.nbj")).unwrap();
    journal.try_lock().unwrap();
    let text = refused(place, &folders);
    assert!(
        text.starts_with("/2of2: another process is writing here"),
        "{text}"
    );
}
