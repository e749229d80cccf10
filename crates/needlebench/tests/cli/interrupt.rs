//! Ctrl-C in the middle of a run.

use crate::process::{LongRun, is_alive, signal};

/// The run ends with 130 and leaves a partial report, and neither temporary files nor processes.
#[track_caller]
fn ends_cleanly(mut run: LongRun) {
    assert_eq!(run.end().code(), Some(130));
    assert!(!is_alive(run.harness), "the harness still runs");
    let report = run.bench.read_json("out/small/report.json");
    let configurations = report["goals"][0]["configurations"].as_array().unwrap();
    assert_eq!(configurations.len(), 8);
    let measured = configurations
        .iter()
        .filter(|each| !each["engines"].as_object().unwrap().is_empty())
        .count();
    assert!(measured < 6, "the run was over before the interrupt");
    assert_eq!(
        report["verdict"], "incomplete",
        "what is missing is not passed"
    );
    assert_ne!(report["not_judged"].as_array().unwrap().len(), 0);
    assert_eq!(report["engine_failures"].as_array().unwrap().len(), 0);
    let notes = report["notes"].to_string();
    assert!(notes.contains("interrupted"), "{notes}");
    for file in run.bench.tree("out") {
        let name = file.file_name().unwrap().to_string_lossy();
        let temporary = name.starts_with('.') || file.extension().is_some_and(|e| e == "tmp");
        assert!(!temporary, "{name} is left behind");
    }
}

#[test]
fn interrupted_run_keeps_what_is_finished_and_leaves_nothing_else() {
    let run = LongRun::start();
    signal("INT", run.id());
    ends_cleanly(run);
}

#[test]
fn interrupt_from_the_keyboard_reaches_the_harness_too_and_harms_nothing() {
    let run = LongRun::start();
    // A terminal signals the whole process group.
    signal("INT", -run.id());
    ends_cleanly(run);
}

#[test]
fn terminated_run_ends_like_an_interrupted_one() {
    let run = LongRun::start();
    signal("TERM", run.id());
    ends_cleanly(run);
}
