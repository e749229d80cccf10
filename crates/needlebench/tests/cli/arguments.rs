//! Command lines that are refused.

use crate::support::{Bench, SMALL};

const POSTURE: &str = "0,0,0,0,0,0";

/// Runs in a folder with a sound scenario; the exit status has to be that of bad input.
#[track_caller]
fn refused<const N: usize>(arguments: &[&str], complaints: [&str; N]) {
    let bench = Bench::with_scenario(SMALL);
    let answer = bench.run(arguments).exits_with(2);
    answer.complains(complaints);
    assert_eq!(answer.stdout, "");
    assert!(!bench.path("out").exists(), "a refused run writes nothing");
}

#[test]
fn six_numbers_are_six_finite_numbers() {
    for (option, command) in [("--joints", "fk"), ("--pose", "ik")] {
        let needs = "needs six numbers separated by commas, got 3";
        refused(&[command, option, "1,2,3"], [option, needs]);
        let needs = "needs six numbers separated by commas, got 7";
        refused(&[command, option, "1,2,3,4,5,6,7"], [option, needs]);
        refused(&[command, option, "1,2,3,4,5,nan"], ["`nan` is not finite"]);
        refused(&[command, option, "1,2,-inf,4,5,6"], ["not finite"]);
        refused(&[command, option, "1,2,1e999,4,5,6"], ["not finite"]);
        refused(&[command, option, "1,2,x,4,5,6"], ["`x` is not a number"]);
        refused(&[command, option, "1,2,,4,5,6"], ["`` is not a number"]);
    }
    refused(
        &["clearance", "s.toml", "--joints", "1,2"],
        ["--joints", "got 2"],
    );
    refused(
        &["ik", "--pose", POSTURE, "--seed", "1,2,3,4,5,nan"],
        ["--seed", "not finite"],
    );
}

#[test]
fn pose_in_millimetres_is_recognised() {
    refused(
        &["ik", "--pose", "194.2,-359.3,170.1,-0.8567,2.7197,-1.1407"],
        ["--pose", "194.2", "hint: x, y and z are in metres"],
    );
}

#[test]
fn unknown_engine_is_refused_with_the_known_ones() {
    refused(
        &["run", "s.toml", "--engine", "bullet"],
        ["'bullet'", "--engine", "rapier, mujoco, both"],
    );
}

#[test]
fn package_path_needs_a_name_and_a_folder_that_exists() {
    refused(
        &[
            "fk",
            "--joints",
            POSTURE,
            "--package-path",
            "ur_description",
        ],
        [
            "--package-path",
            "`ur_description` is not NAME=DIR",
            "hint: ",
        ],
    );
    refused(
        &["check", "s.toml", "--package-path", "ur=none/here"],
        ["--package-path", "`none/here` of package `ur`", "hint: "],
    );
}

#[test]
fn incomplete_command_lines_say_what_is_missing() {
    refused(&["run"], ["<SCENARIO>"]);
    refused(&["ik"], ["--pose"]);
    refused(&["ik", "s.toml"], ["--goal"]);
    refused(
        &["ik", "s.toml", "--goal", "pose", "--pose", POSTURE],
        ["--pose"],
    );
    refused(&["fk"], ["--joints"]);
    refused(&["clearance", "s.toml"], ["--joints"]);
    refused(&["schema", "recipe"], ["'recipe'", "scenario"]);
    refused(&["completions", "tcsh"], ["'tcsh'", "bash"]);
    refused(&["frobnicate"], ["'frobnicate'"]);
    refused(&["run", "s.toml", "--jobs", "0"], ["'0'", "--jobs"]);
}

#[test]
fn results_folder_that_cannot_be_made_is_refused_before_the_run() {
    // Below a file no folder can be made, not even by the superuser.
    refused(
        &["run", "s.toml", "--out", "s.toml/out"],
        ["--out", "cannot be written", "s.toml/out/small", "hint: "],
    );
}

#[test]
fn junit_file_that_cannot_be_written_is_refused_before_the_run() {
    let bench = Bench::with_scenario(SMALL);
    for path in ["s.toml/junit.xml", "none/junit.xml", "."] {
        let answer = bench.run(&["run", "s.toml", "--engine", "rapier", "--junit", path]);
        let answer = answer.exits_with(2);
        answer.complains(["--junit", "cannot be written", path, "hint: "]);
        assert!(!bench.path("out/small/report.json").exists());
    }
}

#[test]
fn two_scenarios_of_one_name_are_refused() {
    let bench = Bench::with_scenario(SMALL);
    bench.write("again.toml", SMALL);
    let answer = bench.run(&["run", "s.toml", "again.toml"]).exits_with(2);
    answer.complains(["again.toml", "`small` is the name of s.toml too", "hint: "]);
}
