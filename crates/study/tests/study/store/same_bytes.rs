//! The tables of a study are the same however it was computed.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use needlebench_numerics::random::SplitMix64;
use needlebench_study::{
    JOURNAL_FILE, MANIFEST_FILE, Manifest, RESULTS_FILE, RunEnd, Shard, Status, StudyRun, merge,
};

use super::folder::{Request, files, tables};
use super::synthetic::{SyntheticDesign, SyntheticEvaluator};

/// More than one row group, and a last block that is not full.
const CASES: u64 = 9000;
const BLOCK: u32 = 64;

/// Names the folder that [`child`] is to work in.
const CHILD_FOLDER: &str = "NEEDLEBENCH_TEST_FOLDER";
/// Cases of a study that is killed.
const CHILD_CASES: u64 = 2000;
const CHILD_BLOCK: u32 = 4;

fn whole(cases: u64, block_cases: u32) -> (tempfile::TempDir, [Vec<u8>; 2]) {
    let folder = tempfile::tempdir().unwrap();
    let end = Request::new(cases, block_cases).run(folder.path()).unwrap();
    let results = Some(folder.path().join(RESULTS_FILE));
    assert_eq!(end, RunEnd::Finished { cases, results });
    let tables = tables(folder.path());
    (folder, tables)
}

#[test]
fn threads_and_shards_leave_no_trace() {
    let (folder, expected) = whole(CASES, BLOCK);
    assert_eq!(
        files(folder.path()),
        ["results.csv", "results.parquet", "study.json"]
    );
    let manifest = std::fs::read(folder.path().join(MANIFEST_FILE)).unwrap();

    let single = tempfile::tempdir().unwrap();
    let request = Request {
        threads: 1,
        ..Request::new(CASES, BLOCK)
    };
    request.run(single.path()).unwrap();
    assert!(tables(single.path()) == expected);

    for parts in [1, 3, 7] {
        let place = tempfile::tempdir().unwrap();
        let folders: Vec<PathBuf> = (1..=parts)
            .map(|part| {
                let folder = place.path().join(format!("shard{part}"));
                let request = Request {
                    shard: Shard::new(part, parts),
                    threads: 1 + part as usize % 2,
                    ..Request::new(CASES, BLOCK)
                };
                let end = request.run(&folder).unwrap();
                assert!(matches!(end, RunEnd::Finished { results: None, .. }));
                assert_eq!(files(&folder), ["journal.nbj", "study.json"]);
                let status = Manifest::read(&folder).unwrap().unwrap().status;
                assert_eq!(status, Status::Complete);
                folder
            })
            .collect();
        let out = place.path().join("merged");
        merge(&out, None, &folders, 2, false, &|_| {}).unwrap();
        let results = std::fs::read(out.join(RESULTS_FILE)).unwrap();
        assert!(results == expected[0], "{parts} shards");
        assert!(std::fs::read(out.join(MANIFEST_FILE)).unwrap() == manifest);
        // The CSV is made of the table.
        assert!(parts < 7 || tables(&out) == expected);
    }
}

#[test]
fn journals_cut_off_anywhere_are_continued() {
    let (_folder, expected) = whole(500, 8);
    let place = tempfile::tempdir().unwrap();
    let shard = Request {
        shard: Shard::new(1, 1),
        resume: true,
        ..Request::new(500, 8)
    };
    let mut random = SplitMix64::new(6);
    let journal = place.path().join(JOURNAL_FILE);
    for _ in 0..20 {
        shard.run(place.path()).unwrap();
        let bytes = std::fs::read(&journal).unwrap();
        let cut = random.below(u32::try_from(bytes.len()).unwrap()) as usize;
        std::fs::write(&journal, &bytes[..cut]).unwrap();
        running(place.path());
    }
    shard.run(place.path()).unwrap();
    let out = place.path().join("merged");
    merge(&out, None, &[place.path().to_owned()], 2, false, &|_| {}).unwrap();
    assert!(tables(&out) == expected);
}

/// Says in a folder's manifest that it is not complete.
fn running(folder: &Path) {
    let path = folder.join(MANIFEST_FILE);
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, text.replace("\"complete\"", "\"running\"")).unwrap();
}

#[test]
fn twenty_kills_at_random_moments_lose_nothing() {
    let (_folder, expected) = whole(CHILD_CASES, CHILD_BLOCK);
    let folder = tempfile::tempdir().unwrap();
    let mut random = SplitMix64::new(20);
    let mut kept = Vec::new();
    for _ in 0..20 {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args([
                "--exact",
                "store::same_bytes::child",
                "--ignored",
                "--nocapture",
            ])
            .env(CHILD_FOLDER, folder.path())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        // Once it works, for some moments.
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let begin = lines.find_map(|line| {
            let line = line.unwrap();
            line.split_once(" of 2000 cases already computed")
                .map(|(count, _)| {
                    let count = count.rsplit(' ').next().unwrap();
                    count.parse::<u64>().unwrap()
                })
        });
        // A machine that takes long to kill may let it finish.
        kept.push(begin.unwrap_or(CHILD_CASES));
        std::thread::sleep(Duration::from_micros(random.below(30_000).into()));
        child.kill().unwrap();
        child.wait().unwrap();
    }
    assert!(kept.is_sorted(), "{kept:?}");
    assert!(
        kept.iter().any(|kept| (1..CHILD_CASES).contains(kept)),
        "{kept:?}"
    );
    let request = Request {
        resume: true,
        ..Request::new(CHILD_CASES, CHILD_BLOCK)
    };
    request.run(folder.path()).unwrap();
    assert!(tables(folder.path()) == expected);
}

/// What the test above kills.
#[test]
#[ignore = "no test by itself"]
fn child() {
    let Some(folder) = std::env::var_os(CHILD_FOLDER) else {
        return;
    };
    let slow = SyntheticEvaluator {
        delay: Duration::from_millis(1),
        failing: None,
    };
    let design = SyntheticDesign::new(CHILD_CASES);
    let run = StudyRun {
        manifest: design.manifest(CHILD_BLOCK),
        design: &design,
        evaluator: &slow,
        threads: 2,
        resume: true,
    };
    let never = std::sync::atomic::AtomicBool::new(false);
    run.run(Path::new(&folder), &never, &|progress| {
        println!("{progress}");
    })
    .unwrap();
}
