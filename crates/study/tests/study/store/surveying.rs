//! How far shards are, while they are computed and afterwards.

use std::path::{Path, PathBuf};
use std::sync::Barrier;
use std::sync::atomic::AtomicBool;

use needlebench_study::{
    CaseError, CaseEvaluator, CaseResult, CaseWorker, JOURNAL_FILE, Shard, ShardState, StudyError,
    StudyRun, Survey, survey,
};

use super::folder::{Request, nested_shard};
use super::synthetic::{SyntheticDesign, SyntheticEvaluator};

const CASES: u64 = 100;
const BLOCK: u32 = 8;

fn shard(place: &Path, part: u32, parts: u32) -> PathBuf {
    nested_shard(place, [part, parts], CASES, BLOCK)
}

fn surveyed(place: &Path, parts: Option<u32>) -> Survey {
    let manifest = SyntheticDesign::new(CASES).manifest(BLOCK);
    survey(&manifest, &[place.to_owned()], parts, 2).unwrap()
}

#[test]
fn shards_done_stopped_and_missing_are_told_apart() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    for part in [1, 2, 4] {
        shard(place, part, 5);
    }
    // Of one thread, so that the journal has its blocks in their order and not as they were finished.
    let request = Request {
        shard: Shard::new(3, 5),
        threads: 1,
        ..Request::new(CASES, BLOCK)
    };
    request.run(&place.join("3/synthetic")).unwrap();
    let journal = place.join("3/synthetic").join(JOURNAL_FILE);
    // A kill in the middle of the last block.
    let stopped = place.join("3/synthetic/study.json");
    let text = std::fs::read_to_string(&stopped).unwrap();
    std::fs::write(&stopped, text.replace("complete", "running")).unwrap();
    let length = std::fs::metadata(&journal).unwrap().len();
    std::fs::File::options()
        .write(true)
        .open(&journal)
        .unwrap()
        .set_len(length - 10)
        .unwrap();
    let found = surveyed(place, None);
    assert_eq!(found.parts, Some(5));
    assert_eq!(found.missing, [3, 5]);
    assert!(found.running.is_empty() && found.mixed.is_empty() && !found.is_complete());
    let states: Vec<ShardState> = found.shards.iter().map(|each| each.state).collect();
    let (done, stopped) = (ShardState::Done, ShardState::Stopped);
    assert_eq!(states, [done, done, stopped, done]);
    // Thirteen blocks, of which the last, number 12, has four cases and is of shard 3.
    let third = &found.shards[2];
    assert_eq!((third.done, third.cases), (16, 20));
    assert_eq!(found.done, 3 * 8 + 3 * 8 + 16 + 2 * 8);
    shard(place, 5, 5);
    assert_eq!(surveyed(place, None).missing, [3]);
    // Nobody was kept out, and it goes on.
    let resumed = Request {
        resume: true,
        ..request
    };
    resumed.run(&place.join("3/synthetic")).unwrap();
    let found = surveyed(place, None);
    assert!(found.is_complete() && found.missing.is_empty());
}

#[test]
fn parts_of_several_numbers_count_together_and_are_said() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    shard(&place.join("a"), 1, 2);
    for part in [2, 3] {
        shard(&place.join("b"), part, 4);
    }
    let found = surveyed(place, None);
    assert_eq!(found.parts, Some(4));
    assert_eq!(found.mixed.into_iter().collect::<Vec<_>>(), [(2, 1)]);
    // 1/2 has all of 1/4 and 3/4.
    assert_eq!(found.missing, [4]);
    assert_eq!(surveyed(place, Some(2)).missing, [2]);
    assert_eq!(surveyed(place, Some(13)).missing, [4, 8, 12]);
}

#[test]
fn nothing_is_there_before_anything_is() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    for folder in [place.to_owned(), place.join("nowhere")] {
        let found = surveyed(&folder, None);
        assert_eq!((found.parts, found.done), (None, 0));
        assert_eq!(surveyed(&folder, Some(3)).missing, [1, 2, 3]);
    }
    shard(place, 1, 3);
    let other = SyntheticDesign::new(CASES + 1).manifest(BLOCK);
    let error = survey(&other, &[place.to_owned()], None, 1).unwrap_err();
    assert!(matches!(error, StudyError::OtherStudy { .. }), "{error}");
}

/// Waits in its twentieth case.
struct Waiting<'a>(&'a Barrier);

struct WaitingWorker<'a>(&'a Barrier, Box<dyn CaseWorker>);

impl CaseEvaluator for Waiting<'_> {
    fn worker(&self) -> Box<dyn CaseWorker + '_> {
        let worker = SyntheticEvaluator::FAST.worker();
        Box::new(WaitingWorker(self.0, worker))
    }
}

impl CaseWorker for WaitingWorker<'_> {
    fn evaluate(&mut self, case: u64) -> Result<CaseResult, CaseError> {
        // The second block of shard 1/2.
        if case == 20 {
            self.0.wait();
            self.0.wait();
        }
        self.1.evaluate(case)
    }
}

#[test]
fn a_shard_that_is_being_computed_is_running_and_not_missing() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let barrier = Barrier::new(2);
    let evaluator = Waiting(&barrier);
    let design = SyntheticDesign::new(CASES);
    let mut manifest = design.manifest(BLOCK);
    manifest.shard = Shard::new(1, 2);
    let run = StudyRun {
        design: &design,
        manifest,
        evaluator: &evaluator,
        threads: 1,
        resume: true,
    };
    std::thread::scope(|scope| {
        let run = scope.spawn(|| run.run(&place.join("1"), &AtomicBool::new(false), &|_| {}));
        barrier.wait();
        let found = surveyed(place, None);
        assert_eq!(found.shards[0].state, ShardState::Running);
        assert_eq!(found.shards[0].done, 8);
        assert_eq!(
            (&found.missing[..], &found.running[..]),
            (&[2][..], &[1][..])
        );
        barrier.wait();
        run.join().unwrap().unwrap();
    });
    assert_eq!(surveyed(place, None).count(ShardState::Done), 1);
}

#[test]
fn who_looks_keeps_nobody_out() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    shard(place, 1, 2);
    let manifest = place.join("1/synthetic/study.json");
    let text = std::fs::read_to_string(&manifest).unwrap();
    // Locked for a moment, as by a survey.
    let journal = std::fs::File::open(place.join("1/synthetic").join(JOURNAL_FILE)).unwrap();
    journal.try_lock_shared().unwrap();
    std::fs::write(&manifest, text.replace("complete", "running")).unwrap();
    let release = std::thread::spawn(move || {
        std::thread::sleep(std::time::Duration::from_millis(60));
        drop(journal);
    });
    let request = Request {
        shard: Shard::new(1, 2),
        resume: true,
        ..Request::new(CASES, BLOCK)
    };
    request.run(&place.join("1/synthetic")).unwrap();
    release.join().unwrap();
}
