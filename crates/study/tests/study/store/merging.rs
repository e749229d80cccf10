//! Shards that make up a study, and shards that do not.

use std::path::{Path, PathBuf};

use std::sync::Mutex;

use needlebench_study::{
    CaseError, CaseEvaluator, CaseResult, CaseWorker, JOURNAL_FILE, MANIFEST_FILE, Progress,
    RESULTS_FILE, RunEnd, Shard, StudyError, merge,
};

use super::folder::{Request, files, nested_shard, tables};
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
    let text = merge(&out, None, folders, 1, false, &|_| {})
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
         shard 2/4 has no folder\n  \
         shard 4/4 has no folder\n\
         hint: `needlebench study STUDY --shard K/N --resume` completes a shard and \
          recomputes damaged cases"
    );
    assert_eq!(refused(place, &[]), "nothing to merge");
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
         /2of2: shard 2/2 is damaged\n\
         hint: `needlebench study STUDY --shard K/N --resume` completes a shard and \
          recomputes damaged cases"
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
    let end = merge(&out, None, &folders, 2, false, &|_| {}).unwrap();
    assert!(matches!(end, RunEnd::Finished { cases: CASES, .. }));
    assert_eq!(files(&out), ["results.parquet", "study.json"]);
    assert!(tables(&out) == tables(&whole));
    // Again: refused, unless it is to go on.
    assert!(merge(&out, None, &folders, 2, false, &|_| {}).is_err());
    assert!(merge(&out, None, &folders, 2, true, &|_| {}).is_ok());
}

/// Computes every case as if it were the next.
struct Shifted;

struct ShiftedWorker(Box<dyn CaseWorker>);

impl CaseEvaluator for Shifted {
    fn worker(&self) -> Box<dyn CaseWorker + '_> {
        Box::new(ShiftedWorker(SyntheticEvaluator::FAST.worker()))
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
        "/1of2 and /other differ in cases 0 to 7: one of them was not computed by this program"
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

#[test]
fn shards_are_found_below_a_folder_and_results_beside_them_are_none() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let whole = place.join("whole");
    Request::new(CASES, BLOCK).run(&whole).unwrap();
    let out = place.join("synthetic");
    let shards = out.join("shards");
    for part in 1..=12 {
        nested_shard(&shards, [part, 12], CASES, BLOCK);
    }
    // Twelve of thirteen blocks, the last of which has another's.
    for given in [
        vec![shards.clone()],
        vec![out.clone()],
        vec![shards.join("12"), out.clone()],
    ] {
        merge(&out, None, &given, 3, true, &|_| {}).unwrap();
        assert!(tables(&out)[0] == tables(&whole)[0]);
        for file in [RESULTS_FILE, MANIFEST_FILE] {
            std::fs::remove_file(out.join(file)).unwrap();
        }
    }
    // One of another study, which has another name, is left out and said.
    let other = shards.join("3/other");
    let copied = nested_shard(&place.join("elsewhere"), [3, 12], CASES, BLOCK);
    std::fs::rename(copied, &other).unwrap();
    let manifest = other.join(MANIFEST_FILE);
    let text = std::fs::read_to_string(&manifest).unwrap();
    std::fs::write(&manifest, text.replace("\"synthetic\"", "\"other\"")).unwrap();
    let said = Mutex::new(Vec::new());
    merge(
        &out,
        None,
        std::slice::from_ref(&shards),
        2,
        true,
        &|event| {
            if let Progress::OtherStudies { .. } = event {
                said.lock().unwrap().push(event.to_string());
            }
        },
    )
    .unwrap();
    let said = said.into_inner().unwrap();
    assert_eq!(
        said,
        [format!(
            "skipped folders of other studies: {}",
            other.display()
        )]
    );
    // Named by itself it is refused.
    let error = merge(
        &place.join("new"),
        None,
        &[shards.join("1"), other],
        2,
        true,
        &|_| {},
    );
    assert!(
        matches!(error, Err(StudyError::OtherStudy { .. })),
        "{error:?}"
    );
}

#[test]
fn neither_order_nor_threads_nor_numbers_of_parts_matter() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let whole = place.join("whole");
    Request::new(CASES, BLOCK).run(&whole).unwrap();
    let expected = std::fs::read(whole.join(RESULTS_FILE)).unwrap();
    // Of halves and of fifths.
    let mut folders = vec![shard(place, 2, 2)];
    folders.extend((1..=5).map(|part| shard(place, part, 5)));
    for (turn, threads) in [(0, 1), (1, 2), (3, 5)] {
        folders.rotate_left(turn);
        let out = place.join(format!("out{turn}"));
        merge(&out, None, &folders, threads, false, &|_| {}).unwrap();
        assert!(std::fs::read(out.join(RESULTS_FILE)).unwrap() == expected);
    }
}

#[test]
fn many_missing_shards_are_a_list_and_not_a_page() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let shards = |cases, part, parts| {
        let folder = place.join(format!("{part}of{parts}"));
        let request = Request {
            shard: Shard::new(part, parts),
            ..Request::new(cases, 1)
        };
        request.run(&folder).unwrap();
        folder
    };
    let folders = [shards(300, 3, 300), shards(300, 17, 300)];
    let text = refused(place, &folders);
    assert_eq!(
        text.lines().nth(1).unwrap(),
        "  298 shards of 300 have no folder: 1,2,4-16,18-300"
    );
    assert_eq!(text.lines().count(), 3);
}

/// Merges two shards, to one of which something happens once all have been looked through.
fn disturbed(happens: impl Fn(&Path) + Sync) -> (StudyError, String) {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let folders = [shard(place, 1, 2), shard(place, 2, 2)];
    let out = place.join("out");
    let error = merge(&out, None, &folders, 2, false, &|event| {
        if let Progress::Space { .. } = event {
            happens(&folders[1].join(JOURNAL_FILE));
        }
    })
    .unwrap_err();
    assert!(!out.join(RESULTS_FILE).exists());
    // Asked for again, when nobody writes, it goes well.
    assert!(!error.is_input(), "{error}");
    let text = error.to_string().replace(&place.display().to_string(), "");
    (error, text)
}

#[test]
fn a_shard_that_somebody_goes_on_writing_is_refused_when_it_is_read() {
    let (_, text) = disturbed(|journal| {
        use std::io::Write as _;
        let mut file = std::fs::File::options().append(true).open(journal).unwrap();
        file.write_all(b"more").unwrap();
    });
    assert!(
        text.starts_with("/2of2/journal.nbj: has grown from "),
        "{text}"
    );
    let (_, text) = disturbed(|journal| {
        let bytes = std::fs::read(journal).unwrap();
        let changed: Vec<u8> = bytes.iter().map(|byte| byte ^ 0x55).collect();
        std::fs::write(journal, changed).unwrap();
    });
    assert!(
        text.starts_with("/2of2/journal.nbj: has changed at byte "),
        "{text}"
    );
    let held = Mutex::new(None);
    let (error, _) = disturbed(|journal| {
        let file = std::fs::File::open(journal).unwrap();
        file.try_lock().unwrap();
        *held.lock().unwrap() = Some(file);
    });
    assert!(matches!(error, StudyError::Locked { .. }), "{error}");
}

#[test]
fn room_for_the_table_is_asked_for_and_is_enough() {
    for (cases, block) in [(1, 1), (300, 1), (3000, 64), (20_000, 64)] {
        let place = tempfile::tempdir().unwrap();
        let place = place.path();
        let folder = place.join("1of1");
        let request = Request {
            shard: Shard::new(1, 1),
            ..Request::new(cases, block)
        };
        request.run(&folder).unwrap();
        let room = Mutex::new(None);
        merge(
            &place.join("out"),
            None,
            std::slice::from_ref(&folder),
            2,
            false,
            &|event| {
                if let Progress::Space {
                    journal_bytes,
                    table_bytes,
                    ..
                } = event
                {
                    assert!(!place.join("out").exists());
                    *room.lock().unwrap() = Some((journal_bytes, table_bytes));
                }
            },
        )
        .unwrap();
        let (journal, table) = room.into_inner().unwrap().unwrap();
        let length = |path: PathBuf| std::fs::metadata(path).unwrap().len();
        let real = length(folder.join(JOURNAL_FILE));
        assert!(journal <= real && real < journal + 200);
        let real = length(place.join("out").join(RESULTS_FILE));
        assert!(
            real <= table,
            "{cases} cases: {real} bytes, {table} asked for"
        );
        if cases == 20_000 {
            // No more than a quarter in vain.
            assert!(table < real + real / 4, "{real} bytes, {table} asked for");
        }
    }
}
