//! Motions in the formats of other tools: written the same again, or refused with why.

use std::path::Path;

use serde_json::Value;

use crate::support::{Bench, Json, holds, workspace};

/// A folder with the paper's scenario.
fn bench() -> Bench {
    let bench = Bench::new();
    let text = std::fs::read(workspace().join("scenarios/table3.toml"));
    bench.write("table3.toml", text.unwrap());
    bench
}

#[test]
fn a_configuration_that_does_not_work_is_refused_with_its_reason() {
    let bench = bench();
    let answer = bench
        .run("export table3.toml --as urscript --configuration Left-Up-Unfold --out left.script")
        .exits_with(2);
    answer.complains([
        "Left-Up-Unfold is not feasible for goal `pose`",
        "forearm",
        "feasible: ",
        "Right-Up-Fold",
    ]);
    assert!(!bench.path("left.script").exists());
}

#[test]
fn a_recording_is_the_same_from_an_export_and_from_a_run_and_again() {
    let bench = bench();
    let export = "export table3.toml --as mcap --json";
    let answer: Value = bench.run(export).exits_with(0).json();
    let file = answer["files"][0]["name"].word().to_owned();
    assert_eq!(file, "out/table3/export/pose/Right-Up-Fold.rapier.mcap");
    let first = bench.read(&file);
    assert!(first.starts_with(b"\x89MCAP"));
    bench.run(export).exits_with(0);
    assert_eq!(bench.read(&file), first);
    bench
        .run("run table3.toml --engine rapier --record mcap --jobs 1 --no-page --no-pictures --quiet --out results")
        .exits_with(0);
    // What a run says of a configuration stands in its recording.
    let holds = |name: &str, word: &str| {
        let bytes = bench.read(name);
        bytes
            .windows(word.len())
            .any(|each| each == word.as_bytes())
    };
    assert!(holds(&file, "status\u{2}\0\0\0ok"));
    let beside = "results/table3/pose/Right-Up-Fold.rapier.mcap";
    assert_eq!(bench.read(beside), first);
    let report = bench.read_json("results/table3/report.json");
    // Beside each CSV recording.
    let recorded = |extension: &str| {
        let all = report["goals"][0]["configurations"].list();
        let files = all.iter().flat_map(|each| each["files"].list());
        files
            .filter(|name| name.word().ends_with(extension))
            .count()
    };
    assert_eq!(recorded(".rapier.mcap"), recorded(".rapier.csv"));
    assert!(recorded(".rapier.mcap") >= 6);
    // The next run without it leaves none that could be taken for its own.
    bench
        .run("run table3.toml --engine rapier --no-page --no-pictures --quiet --out results")
        .exits_with(0);
    assert!(!bench.path(beside).exists());
}

#[test]
fn a_trajectory_is_named_by_its_file_and_a_program_says_that_it_never_ran() {
    let bench = bench();
    let text = |name: &str| bench.text(name);
    bench
        .run("export table3.toml --as trajectory --out motion.yml")
        .exits_with(0);
    let files = bench.tree(".");
    assert_eq!(files, ["motion.yml", "table3.toml"].map(Path::new));
    assert!(text("motion.yml").contains("\npoints:\n- positions: ["));
    bench
        .run("export table3.toml --as urscript --out motion.script")
        .exits_with(0);
    let script = text("motion.script");
    holds(
        &script,
        [
            "def needlebench_motion():",
            "NEVER RUN ON A ROBOT",
            "set_payload(",
            "set_tcp(p[",
            "nb_check_start()",
            "robot_phantom: ",
        ],
    );
}
