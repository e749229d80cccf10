//! Motions in the formats of other tools: written the same again, or refused with why.

use serde_json::Value;

use crate::support::{Bench, workspace};

fn scenario(name: &str) -> String {
    let path = workspace().join("scenarios").join(name);
    path.canonicalize().unwrap().display().to_string()
}

#[test]
fn a_configuration_that_does_not_work_is_refused_with_its_reason() {
    let bench = Bench::new();
    let answer = bench
        .run(&[
            "export",
            &scenario("table3.toml"),
            "--as",
            "urscript",
            "--configuration",
            "Left-Up-Unfold",
            "--out",
            "left.script",
        ])
        .exits_with(2);
    answer.complains([
        "Left-Up-Unfold does not work for goal `pose`",
        "forearm",
        "those that work: ",
        "Right-Up-Fold",
    ]);
    assert!(!bench.path("left.script").exists());
}

#[test]
fn a_recording_is_the_same_from_an_export_and_from_a_run_and_again() {
    let bench = Bench::new();
    let table3 = scenario("table3.toml");
    let export = ["export", &table3, "--as", "mcap", "--json"];
    let answer: Value = bench.run(&export).exits_with(0).json();
    let file = answer["files"][0]["name"].as_str().unwrap().to_owned();
    assert_eq!(file, "out/table3/export/pose/Right-Up-Fold.rapier.mcap");
    let first = bench.read(&file);
    assert!(first.starts_with(b"\x89MCAP"));
    bench.run(&export).exits_with(0);
    assert_eq!(bench.read(&file), first);
    bench
        .run(&[
            "run",
            &table3,
            "--engine",
            "rapier",
            "--record",
            "mcap",
            "--jobs",
            "1",
            "--no-page",
            "--no-pictures",
            "--quiet",
            "--out",
            "results",
        ])
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
        let all = report["goals"][0]["configurations"].as_array().unwrap();
        let files = all
            .iter()
            .flat_map(|each| each["files"].as_array().unwrap());
        files
            .filter(|name| name.as_str().unwrap().ends_with(extension))
            .count()
    };
    assert_eq!(recorded(".rapier.mcap"), recorded(".rapier.csv"));
    assert!(recorded(".rapier.mcap") >= 6);
    // The next run without it leaves none that could be taken for its own.
    bench
        .run(&[
            "run",
            &table3,
            "--engine",
            "rapier",
            "--no-page",
            "--no-pictures",
            "--quiet",
            "--out",
            "results",
        ])
        .exits_with(0);
    assert!(!bench.path(beside).exists());
}

#[test]
fn a_trajectory_is_named_by_its_file_and_a_program_says_that_it_never_ran() {
    let bench = Bench::new();
    let table3 = scenario("table3.toml");
    let text = |name: &str| String::from_utf8(bench.read(name)).unwrap();
    bench
        .run(&[
            "export",
            &table3,
            "--as",
            "trajectory",
            "--out",
            "motion.yml",
        ])
        .exits_with(0);
    assert_eq!(bench.tree("."), [std::path::PathBuf::from("motion.yml")]);
    assert!(text("motion.yml").contains("\npoints:\n- positions: ["));
    bench
        .run(&[
            "export",
            &table3,
            "--as",
            "urscript",
            "--out",
            "motion.script",
        ])
        .exits_with(0);
    let script = text("motion.script");
    for part in [
        "def needlebench_motion():",
        "NEVER RUN ON A ROBOT",
        "set_payload(",
        "set_tcp(p[",
        "nb_check_start()",
        "robot_phantom: ",
    ] {
        assert!(script.contains(part), "no `{part}`");
    }
}
