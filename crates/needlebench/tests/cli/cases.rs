//! The cases of `tests/cmd`: what is typed, and all that is printed.
//!
//! After a change of what the program prints, look at what `TRYCMD=overwrite cargo test -p needlebench --test cli cases` makes
//! of them, and commit it if it is what people should see.

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::made;
use crate::support::{SMALL, workspace};

/// What whoever runs the tests has set does not matter.
const ENVIRONMENT: [(&str, &str); 5] = [
    ("COLUMNS", "100"),
    ("CI", ""),
    ("NO_COLOR", "1"),
    ("NEEDLEBENCH_PROGRESS", "off"),
    // In which names are sorted.
    ("LC_ALL", "C"),
];

/// Programs of the system that cases call.
const TOOLS: [&str; 4] = ["cp", "find", "ls", "mkdir"];

const LONGEST: Duration = Duration::from_mins(10);

fn folder() -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cmd");
    folder.canonicalize().unwrap()
}

fn cases() -> Vec<PathBuf> {
    let entries = fs::read_dir(folder()).unwrap();
    let paths = entries.map(|entry| entry.unwrap().path());
    let mut cases: Vec<PathBuf> = paths
        .filter(|path| path.extension().is_some_and(|extension| extension == "md"))
        .collect();
    cases.sort();
    cases
}

fn of_the_system(tool: &str) -> PathBuf {
    let path = std::env::var_os("PATH").unwrap();
    let mut places = std::env::split_paths(&path).map(|folder| folder.join(tool));
    let found = places.find(|place| place.is_file());
    found.unwrap_or_else(|| panic!("there is no `{tool}`"))
}

/// Copies are run, each in an empty folder of its own, which trycmd looks for beside it.
#[test]
fn commands_print_what_their_cases_say() {
    let temporary = tempfile::tempdir().unwrap();
    let place = temporary.path().canonicalize().unwrap();
    let made = place.join("made");
    fs::create_dir(&made).unwrap();
    let workspace = workspace().canonicalize().unwrap();
    let ur3 = fs::read_to_string(workspace.join("models/ur3/ur3.urdf")).unwrap();
    made::write_into(&made, &ur3);
    fs::write(made.join("small.toml"), SMALL).unwrap();
    let tests = trycmd::TestCases::new();
    for (name, value) in ENVIRONMENT {
        tests.env(name, value);
    }
    for (name, value) in [
        ("PROGRAM", Path::new(env!("CARGO_BIN_EXE_needlebench"))),
        ("FIXTURES", &folder().join("fixtures")),
        ("MADE", &made),
        ("WORKSPACE", &workspace),
    ] {
        tests.env(name, value.to_str().unwrap());
    }
    tests.register_bin("needlebench", folder().join("program").as_path());
    tests.register_bin("edit", folder().join("edit").as_path());
    for tool in TOOLS {
        tests.register_bin(tool, of_the_system(tool).as_path());
    }
    for case in cases() {
        let copy = place.join(case.file_name().unwrap());
        fs::copy(&case, &copy).unwrap();
        fs::create_dir(copy.with_extension("in")).unwrap();
        tests.case(copy);
    }
    let passed = catch_unwind(AssertUnwindSafe(|| tests.timeout(LONGEST).run())).is_ok();
    if std::env::var_os("TRYCMD").is_some_and(|mode| mode == "overwrite") {
        for case in cases() {
            fs::copy(place.join(case.file_name().unwrap()), &case).unwrap();
        }
    }
    assert!(passed, "not what the cases in tests/cmd say");
}

/// What trycmd does not know it leaves out without a word.
#[test]
fn every_command_of_a_case_is_run() {
    let mut count = 0;
    for case in cases() {
        let text = fs::read_to_string(&case).unwrap();
        for line in text.lines().filter_map(|line| line.strip_prefix("$ ")) {
            let program = line.split(' ').next().unwrap();
            let is_known = ["needlebench", "edit"].contains(&program) || TOOLS.contains(&program);
            assert!(is_known, "{}: {line}", case.display());
            count += 1;
        }
    }
    assert!(count > 500, "{count}");
}
