//! What is finished is kept, whatever stops a run.

use std::path::Path;
use std::process::Command;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use needlebench_study::{
    CaseError, CaseEvaluator, CaseResult, CaseWorker, JOURNAL_FILE, MANIFEST_FILE, Progress,
    RunEnd, StudyError, StudyRun,
};

use super::folder::{Request, files, tables};
use super::synthetic::{SyntheticDesign, SyntheticEvaluator};

const CASES: u64 = 400;
const BLOCK: u32 = 8;
const BLOCKS: u64 = CASES / BLOCK as u64;

/// Remembers what was computed.
#[derive(Default)]
struct Recorder(Mutex<Vec<u64>>);

struct RecordingWorker<'a>(&'a Recorder, Box<dyn CaseWorker>);

impl CaseEvaluator for Recorder {
    fn worker(&self) -> Box<dyn CaseWorker + '_> {
        let worker = RecordingWorker(self, SyntheticEvaluator::FAST.worker());
        Box::new(worker)
    }
}

impl CaseWorker for RecordingWorker<'_> {
    fn evaluate(&mut self, case: u64) -> Result<CaseResult, CaseError> {
        self.0.0.lock().unwrap().push(case);
        self.1.evaluate(case)
    }
}

impl Recorder {
    /// Indices of the blocks that were computed, in order.
    fn blocks(self) -> Vec<u64> {
        let cases = self.0.into_inner().unwrap().into_iter();
        let mut blocks: Vec<u64> = cases.map(|case| case / u64::from(BLOCK)).collect();
        blocks.sort_unstable();
        for block in blocks.chunk_by(|a, b| a == b) {
            assert_eq!(block.len(), BLOCK as usize);
        }
        blocks.dedup();
        blocks
    }
}

/// Runs with resume; returns the blocks that were computed and the lines.
fn resume(folder: &Path) -> (Vec<u64>, Vec<String>) {
    let recorder = Recorder::default();
    let request = Request {
        resume: true,
        evaluator: &recorder,
        ..Request::new(CASES, BLOCK)
    };
    let (end, lines) = request.run_watched(folder);
    end.unwrap();
    (recorder.blocks(), lines)
}

fn expected() -> [Vec<u8>; 2] {
    let folder = tempfile::tempdir().unwrap();
    Request::new(CASES, BLOCK).run(folder.path()).unwrap();
    tables(folder.path())
}

/// A folder of which the run was cancelled after so many cases, by one thread.
fn cancelled(folder: &Path, cases: u64) {
    let design = SyntheticDesign::new(CASES);
    let run = StudyRun {
        manifest: design.manifest(BLOCK),
        design: &design,
        evaluator: &SyntheticEvaluator::FAST,
        threads: 1,
        resume: false,
    };
    let cancel = AtomicBool::new(false);
    let end = run.run(folder, &cancel, &|progress| {
        if matches!(progress, Progress::Cases { done, .. } if done >= cases) {
            cancel.store(true, Ordering::Relaxed);
        }
    });
    let partial = RunEnd::Partial {
        done: cases,
        total: CASES,
    };
    assert_eq!(end.unwrap(), partial);
}

#[test]
fn a_cancelled_run_says_how_far_it_came_and_goes_on_from_there() {
    let folder = tempfile::tempdir().unwrap();
    cancelled(folder.path(), 160);
    assert_eq!(files(folder.path()), [JOURNAL_FILE, MANIFEST_FILE]);
    let (blocks, lines) = resume(folder.path());
    assert_eq!(blocks, (20..BLOCKS).collect::<Vec<_>>());
    assert_eq!(lines[0], "160 of 400 cases already computed");
    assert!(tables(folder.path()) == expected());
}

#[test]
fn a_failing_environment_stops_the_run_and_keeps_what_is_done() {
    let folder = tempfile::tempdir().unwrap();
    let failing = SyntheticEvaluator {
        delay: Duration::ZERO,
        failing: Some(203),
    };
    let request = Request {
        threads: 1,
        evaluator: &failing,
        ..Request::new(CASES, BLOCK)
    };
    let error = request.run(folder.path()).unwrap_err();
    let text = error.to_string();
    assert!(
        text.starts_with("case 203: the engine has left\n200 of 400 cases are kept in "),
        "{text}"
    );
    let (blocks, _) = resume(folder.path());
    assert_eq!(blocks, (25..BLOCKS).collect::<Vec<_>>());
    assert!(tables(folder.path()) == expected());
}

#[test]
fn a_complete_study_is_not_computed_again() {
    let folder = tempfile::tempdir().unwrap();
    Request::new(CASES, BLOCK).run(folder.path()).unwrap();
    let (blocks, lines) = resume(folder.path());
    assert!(blocks.is_empty() && lines.is_empty(), "{lines:?}");
}

#[test]
fn a_run_that_died_before_its_first_word_begins_again() {
    let folder = tempfile::tempdir().unwrap();
    // The journal is made, locked, and then the manifest is written.
    std::fs::write(folder.path().join(JOURNAL_FILE), "NBJ").unwrap();
    let (blocks, _) = resume(folder.path());
    assert_eq!(blocks.len() as u64, BLOCKS);
    assert!(tables(folder.path()) == expected());
}

/// Offsets of records: their marks, with the index of the block behind them.
fn records(journal: &[u8]) -> Vec<usize> {
    let marks = journal.windows(4).enumerate();
    marks
        .filter(|(_, bytes)| bytes == b"NBJB")
        .map(|(at, _)| at)
        .collect()
}

#[test]
fn damage_is_found_and_only_its_blocks_are_computed_again() {
    let expected = expected();
    // One thread writes blocks in their order.
    for (damaged, lines) in [(vec![7], 1), (vec![7, 8], 1), (vec![3, 9], 2), (vec![0], 1)] {
        let folder = tempfile::tempdir().unwrap();
        cancelled(folder.path(), 160);
        let path = folder.path().join(JOURNAL_FILE);
        let mut journal = std::fs::read(&path).unwrap();
        let records = records(&journal);
        assert_eq!(records.len(), 20);
        // In a header, and in a payload.
        for (index, block) in damaged.iter().enumerate() {
            journal[records[*block] + 17 + 100 * index] ^= 0x10;
        }
        std::fs::write(&path, &journal).unwrap();
        let (blocks, said) = resume(folder.path());
        let again = damaged.iter().map(|block| *block as u64);
        assert_eq!(blocks, again.chain(20..BLOCKS).collect::<Vec<_>>());
        let bytes = records[damaged[0] + 1] - records[damaged[0]];
        let bytes = if lines == 1 {
            bytes * damaged.len()
        } else {
            bytes
        };
        // Records are not all equally long: look at the offset, and at the length of a single one.
        let line = &said[0];
        let offset = format!("from byte {} on are damaged", records[damaged[0]]);
        assert!(line.contains(&offset), "{line}");
        assert!(
            damaged.len() > 1 || line.contains(&format!(": {bytes} bytes ")),
            "{line}"
        );
        let count = said.iter().filter(|line| line.contains("damaged")).count();
        assert_eq!(count, lines, "{said:?}");
        assert!(tables(folder.path()) == expected);
    }
}

#[test]
fn a_damaged_header_costs_no_block() {
    let folder = tempfile::tempdir().unwrap();
    cancelled(folder.path(), 160);
    let path = folder.path().join(JOURNAL_FILE);
    let mut journal = std::fs::read(&path).unwrap();
    journal[17] ^= 1;
    std::fs::write(&path, &journal).unwrap();
    let (blocks, said) = resume(folder.path());
    assert_eq!(blocks, (20..BLOCKS).collect::<Vec<_>>());
    assert!(said[0].contains("from byte 0 on are damaged"), "{said:?}");
    assert!(tables(folder.path()) == expected());
}

#[test]
fn a_tail_of_garbage_is_cut_off() {
    let folder = tempfile::tempdir().unwrap();
    cancelled(folder.path(), 160);
    let path = folder.path().join(JOURNAL_FILE);
    let mut journal = std::fs::read(&path).unwrap();
    let end = journal.len();
    journal.extend(b"NBJB and something that a failing disk has left here");
    std::fs::write(&path, &journal).unwrap();
    let (blocks, said) = resume(folder.path());
    assert_eq!(blocks, (20..BLOCKS).collect::<Vec<_>>());
    let line = format!("ends within a block; 52 bytes from byte {end} on are discarded");
    assert!(said[0].ends_with(&line), "{said:?}");
}

const LIMITED_FOLDER: &str = "NEEDLEBENCH_TEST_LIMITED_FOLDER";

/// The system refuses to let the journal grow, as a full disk does.
#[cfg(unix)]
#[test]
fn a_full_disk_damages_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let shell = "trap '' XFSZ; ulimit -f 200; exec \"$0\" --exact store::interrupted::limited --ignored --nocapture";
    let output = Command::new("bash")
        .args(["-c", shell])
        .arg(std::env::current_exe().unwrap())
        .env(LIMITED_FOLDER, folder.path())
        .output()
        .unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let kept: u64 = text
        .lines()
        .find_map(|line| line.split_once(" of 400 cases are kept in "))
        .unwrap_or_else(|| panic!("{text}"))
        .0
        .parse()
        .unwrap();
    assert!((1..CASES).contains(&kept), "{text}");
    assert!(text.contains("journal.nbj: File too large"), "{text}");
    let (blocks, lines) = resume(folder.path());
    // Nothing to be cut off: the half of a record was taken back.
    assert_eq!(lines[0], format!("{kept} of 400 cases already computed"));
    assert_eq!(blocks.len() as u64, BLOCKS - kept / u64::from(BLOCK));
    assert!(tables(folder.path()) == expected());
}

/// What the test above runs with a limit.
#[test]
#[ignore = "no test by itself"]
fn limited() {
    let Some(folder) = std::env::var_os(LIMITED_FOLDER) else {
        return;
    };
    let error = Request::new(CASES, BLOCK)
        .run(Path::new(&folder))
        .unwrap_err();
    assert!(matches!(error, StudyError::Write { .. }));
    println!("\n{error}");
}
