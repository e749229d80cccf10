//! Folders and requests that are refused, and in which words.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use needlebench_study::{
    CaseDesign, Factor, FactorKind, FactorValue, JOURNAL_FILE, Level, MANIFEST_FILE, Manifest,
    RESULTS_FILE, RunEnd, Shard, StudyError, StudyRun,
};

use super::folder::Request;
use super::synthetic::{SyntheticDesign, SyntheticEvaluator, columns};

const CASES: u64 = 40;
const BLOCK: u32 = 8;

fn refused(request: &Request, folder: &Path) -> String {
    let text = request.run(folder).unwrap_err().to_string();
    text.replace(&folder.display().to_string(), "FOLDER")
}

/// Runs with a manifest that a test has changed.
fn run_changed(folder: &Path, change: impl FnOnce(&mut Manifest)) -> Result<RunEnd, StudyError> {
    let design = SyntheticDesign::new(CASES);
    let mut manifest = design.manifest(BLOCK);
    change(&mut manifest);
    let run = StudyRun {
        manifest,
        design: &design,
        evaluator: &SyntheticEvaluator::FAST,
        threads: 1,
        resume: true,
    };
    run.run(folder, &AtomicBool::new(false), &|_| {})
}

#[test]
fn results_are_never_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    Request::new(CASES, BLOCK).run(folder.path()).unwrap();
    let before = std::fs::read(folder.path().join(RESULTS_FILE)).unwrap();
    assert_eq!(
        refused(&Request::new(CASES, BLOCK), folder.path()),
        "FOLDER: already holds this study (complete)\n\
         hint: continue with --resume, or choose another folder"
    );
    std::fs::remove_file(folder.path().join(MANIFEST_FILE)).unwrap();
    let text = refused(&Request::new(CASES, BLOCK), folder.path());
    assert!(
        text.starts_with("FOLDER/results.parquet: is there without study.json"),
        "{text}"
    );
    let request = Request {
        resume: true,
        ..Request::new(CASES, BLOCK)
    };
    let text = refused(&request, folder.path());
    assert!(
        text.starts_with("FOLDER/results.parquet: is there without study.json"),
        "{text}"
    );
    assert!(std::fs::read(folder.path().join(RESULTS_FILE)).unwrap() == before);
}

#[test]
fn another_study_is_named_with_what_differs() {
    let folder = tempfile::tempdir().unwrap();
    run_changed(folder.path(), |manifest| {
        manifest
            .inputs
            .insert("study.toml".to_owned(), "aa".to_owned());
        manifest
            .inputs
            .insert("arm.urdf".to_owned(), "bb".to_owned());
    })
    .unwrap();
    let error = run_changed(folder.path(), |manifest| {
        manifest.study_id = "0ther".to_owned();
        manifest.name = "second".to_owned();
        manifest.provenance["program"]["version"] = "0.2.0".into();
        manifest
            .inputs
            .insert("study.toml".to_owned(), "cc".to_owned());
        manifest
            .inputs
            .insert("arm.urdf".to_owned(), "bb".to_owned());
    });
    let text = error.unwrap_err().to_string();
    assert_eq!(
        text.replace(&folder.path().display().to_string(), "FOLDER"),
        "FOLDER: holds the results of another study\n  \
         there: \"synthetic\" (5eed)\n  \
         here:  \"second\" (0ther)\n  \
         different: study.toml\n  \
         different: provenance.program.version: \"0.1.0\" there, \"0.2.0\" here\n\
         hint: choose another folder"
    );
}

#[test]
fn every_shard_has_a_folder_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let shard = |part, parts| Request {
        shard: Shard::new(part, parts),
        resume: true,
        ..Request::new(CASES, BLOCK)
    };
    shard(1, 3).run(folder.path()).unwrap();
    assert_eq!(
        refused(&shard(2, 3), folder.path()),
        "FOLDER/study.json: holds shard 1/3 of this study, not shard 2/3\n\
         hint: every shard requires its own folder"
    );
    assert_eq!(
        refused(&shard(1, 6), tempfile::tempdir().unwrap().path()),
        "shard 1/6: the study has only 5 blocks of 8 cases\nhint: use fewer shards"
    );
}

#[test]
fn two_processes_do_not_share_a_folder() {
    let folder = tempfile::tempdir().unwrap();
    let journal = std::fs::File::create(folder.path().join(JOURNAL_FILE)).unwrap();
    journal.try_lock().unwrap();
    let request = Request {
        resume: true,
        ..Request::new(CASES, BLOCK)
    };
    assert_eq!(
        refused(&request, folder.path()),
        "FOLDER: another process is writing here\n\
         hint: wait for it or choose another folder"
    );
}

#[test]
fn a_journal_of_another_study_is_refused() {
    let [one, two] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let shard = |cases| Request {
        shard: Shard::new(1, 1),
        resume: true,
        ..Request::new(cases, BLOCK)
    };
    shard(CASES).run(one.path()).unwrap();
    std::fs::copy(one.path().join(JOURNAL_FILE), two.path().join(JOURNAL_FILE)).unwrap();
    assert_eq!(
        refused(&shard(CASES + 1), two.path()),
        "FOLDER/journal.nbj: is the journal of another study (5eed) or shard"
    );
}

#[test]
fn a_garbled_manifest_and_one_of_the_future_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let request = Request {
        resume: true,
        ..Request::new(CASES, BLOCK)
    };
    let path = folder.path().join(MANIFEST_FILE);
    for (text, message) in [
        (
            "{",
            "FOLDER/study.json: is not a study manifest: EOF while parsing",
        ),
        ("[]", "FOLDER/study.json: is not a study manifest: "),
        (
            "{\"schema_version\": 3, \"surprise\": true}",
            "FOLDER/study.json: has schema version 3; this program reads version 2",
        ),
    ] {
        std::fs::write(&path, text).unwrap();
        let text = refused(&request, folder.path());
        assert!(text.starts_with(message), "{text}");
    }
}

struct Odd(Vec<Factor>);

impl CaseDesign for Odd {
    fn factors(&self) -> &[Factor] {
        &self.0
    }

    fn cases(&self) -> u64 {
        1
    }

    fn values(&self, _: u64) -> Vec<FactorValue> {
        vec![FactorValue::Level(0); self.0.len()]
    }
}

#[test]
fn factors_that_make_no_table_are_refused() {
    let level = |label: &str, number| Level {
        label: label.to_owned(),
        number,
    };
    let factor = |name: &str, levels: &[Level]| Factor {
        name: name.to_owned(),
        unit: String::new(),
        role: needlebench_study::Role::Control,
        sampled: false,
        kind: FactorKind::Levels(levels.to_vec()),
    };
    let one = [level("a", None)];
    for (factors, message) in [
        (
            vec![factor("outcome", &one)],
            "factor outcome: duplicate column name",
        ),
        (
            vec![factor("clearance_static_mm", &one)],
            "factor clearance_static_mm: duplicate column name",
        ),
        (vec![factor("goal", &[])], "factor goal: has no levels"),
        (
            vec![factor("goal x", &one)],
            "factor \"goal x\": names consist of letters, digits and _ only",
        ),
        (
            vec![factor("goal", &[level("a", None), level("a", Some(1.0))])],
            "factor goal: a is listed twice",
        ),
        (
            vec![factor(
                "goal",
                &[level("0", Some(0.0)), level("-0", Some(-0.0))],
            )],
            "factor goal: -0 is listed twice",
        ),
        (
            vec![factor("goal", &[level("x", Some(f64::NAN))])],
            "factor goal: x is not a finite number",
        ),
    ] {
        let design = Odd(factors);
        let run = StudyRun {
            manifest: Manifest::new("1d", "odd", &design, columns(), 1, serde_json::Value::Null),
            design: &design,
            evaluator: &SyntheticEvaluator::FAST,
            threads: 1,
            resume: false,
        };
        let folder = tempfile::tempdir().unwrap();
        let error = run.run(folder.path(), &AtomicBool::new(false), &|_| {});
        assert_eq!(error.unwrap_err().to_string(), message);
    }
}

#[test]
fn shards_are_counted_from_one() {
    for text in ["0/3", "4/3", "1/0", "1", "a/b", "-1/2", ""] {
        assert!(
            text.parse::<Shard>().unwrap_err().contains("expected k/n"),
            "{text}"
        );
    }
    assert_eq!("2/7".parse::<Shard>().unwrap().to_string(), "2/7");
}
