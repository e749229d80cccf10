//! Help, version, completions, and the answer of `doctor`.

use crate::support::{Bench, Json, has_keys, holds, mujoco_is_ready};

const COMMANDS: [&str; 26] = [
    "init",
    "suggest",
    "run",
    "check",
    "ik",
    "fk",
    "clearance",
    "roll-map",
    "export",
    "compare",
    "ct",
    "view",
    "iso9283",
    "plan-excitation",
    "replay",
    "robot",
    "needle",
    "breath",
    "pairs",
    "paper",
    "report",
    "schema",
    "search",
    "doctor",
    "licences",
    "completions",
];

#[test]
fn help_of_every_command_has_an_example_that_starts_with_it() {
    let bench = Bench::new();
    for command in COMMANDS {
        let help = bench.run(format!("{command} --help")).exits_with(0).stdout;
        let example = format!("Example: needlebench {command}");
        assert!(help.contains(&example), "{help}");
    }
}

#[test]
fn help_of_the_program_lists_every_command_and_exit_status() {
    let help = Bench::new().run("--help").exits_with(0).stdout;
    for command in COMMANDS {
        assert!(help.contains(&format!("\n  {command} ")), "{help}");
    }
    let words: Vec<&str> = help.split_whitespace().collect();
    let help = words.join(" ");
    holds(
        &help,
        [
            "0 all",
            "1 a criterion",
            "2 invalid input",
            "3 environment",
            "130",
        ],
    );
}

#[test]
fn former_names_are_accepted_with_a_note() {
    let answer = Bench::new().run("atlas nosuch.toml").exits_with(2);
    answer.complains(["note: atlas is now roll-map", "nosuch.toml"]);
}

#[test]
fn version_says_which_revision_it_is() {
    let version = Bench::new().run("--version").exits_with(0).stdout;
    let expected = concat!("needlebench ", env!("CARGO_PKG_VERSION"), " (");
    assert!(version.starts_with(expected), "{version}");
}

#[test]
fn licences_name_what_is_inside_and_only_what_needs_naming() {
    let notices = Bench::new().run("licences").exits_with(0).stdout;
    holds(
        &notices,
        [
            "three.js",
            "Noto Sans Mono",
            "Zstandard",
            "pip-",
            "crate rapier3d-f64 ",
            "musl",
        ],
    );
    assert!(
        !notices.contains("crate needlebench"),
        "our own are no third party's"
    );
}

#[test]
fn completions_of_every_shell_know_every_command() {
    let bench = Bench::new();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = bench
            .run(format!("completions {shell}"))
            .exits_with(0)
            .stdout;
        for command in COMMANDS {
            assert!(script.contains(command), "{shell} does not know {command}");
        }
    }
}

#[test]
fn doctor_reports_the_versions_of_a_working_mujoco() {
    mujoco_is_ready();
    let answer = Bench::new().run("doctor --json").exits_with(0).json();
    has_keys(&answer, "schema_version ok checks");
    assert_eq!(answer["ok"], true);
    let checks = answer["checks"].list();
    for check in checks {
        has_keys(check, "name ok detail");
    }
    let harness = checks
        .iter()
        .find(|check| check["name"] == "mujoco harness")
        .unwrap();
    let detail = harness["detail"].word();
    assert!(detail.starts_with("MuJoCo 4.0.0, Python 3."), "{detail}");
}

#[test]
fn doctor_prints_a_line_per_check() {
    mujoco_is_ready();
    let answer = Bench::new().run("doctor").exits_with(0);
    assert!(
        answer.stdout.lines().all(|line| line.starts_with("ok   ")),
        "{answer:#?}"
    );
}
