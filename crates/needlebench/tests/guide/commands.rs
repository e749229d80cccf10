//! Commands in the guide.
//!
//! Blocks in `console` are run, and what they print is compared. What takes too long for that stands in a block
//! in `sh`, and has to be a command line that the program understands.

use std::fmt::Write as _;
use std::fs;
use std::os::unix::fs::symlink;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use sha2::{Digest, Sha256};

use crate::book::{blocks, chapters, workspace};

/// What a reader sees who is in the checkout's top folder, at 80 columns.
const ENVIRONMENT: [(&str, &str); 4] = [
    ("COLUMNS", "80"),
    ("CI", ""),
    ("NO_COLOR", "1"),
    ("NEEDLEBENCH_PROGRESS", "off"),
];
const LONGEST: Duration = Duration::from_mins(10);

#[test]
fn commands_print_what_the_guide_says() {
    let mut failed = Vec::new();
    for chapter in chapters() {
        if !blocks(&chapter)
            .iter()
            .any(|block| block.language == "console")
        {
            continue;
        }
        let folder = tempfile::tempdir().unwrap();
        for name in ["scenarios", "models", "guide"] {
            symlink(workspace().join(name), folder.path().join(name)).unwrap();
        }
        if catch_unwind(AssertUnwindSafe(|| run(&chapter, folder.path()))).is_err() {
            failed.push(chapter);
        }
    }
    assert!(failed.is_empty(), "not what these chapters say: {failed:?}");
}

/// Runs the commands of a chapter, one after the other, in a folder of its own.
fn run(chapter: &Path, folder: &Path) {
    // Where commands run that have no folder of their own.
    std::env::set_current_dir(folder).unwrap();
    let cases = trycmd::TestCases::new();
    cases.register_bin("needlebench", Path::new(env!("CARGO_BIN_EXE_needlebench")));
    for (name, value) in ENVIRONMENT {
        cases.env(name, value);
    }
    // The same in every build.
    cases.insert_var("[BUILD]", build()).unwrap();
    cases.insert_var("[LOCK]", lock_hash()).unwrap();
    cases.timeout(LONGEST).case(chapter).run();
}

/// SHA-256 of the lock file, which changes with every dependency.
fn lock_hash() -> String {
    let bytes = std::fs::read(workspace().join("Cargo.lock")).unwrap();
    Sha256::digest(bytes)
        .iter()
        .fold(String::new(), |mut text, byte| {
            let _ = write!(text, "{byte:02x}");
            text
        })
}

/// What stands in brackets behind the program's version.
fn build() -> String {
    let mut program = Command::new(env!("CARGO_BIN_EXE_needlebench"));
    let said = program.arg("--version").output().unwrap().stdout;
    let said = String::from_utf8(said).unwrap();
    let (_, build) = said
        .trim_end()
        .trim_end_matches(')')
        .split_once('(')
        .unwrap();
    build.to_owned()
}

/// Command lines in blocks that are not run.
fn others(text: &str) -> impl Iterator<Item = Vec<String>> {
    let lines = text
        .lines()
        .map(|line| line.split(" #").next().unwrap_or_default());
    lines
        .filter_map(|line| line.trim().strip_prefix("needlebench "))
        .map(|line| {
            let before = line.split([';', '|', '>']).next().unwrap_or_default();
            let words = before.split_whitespace().map(str::to_owned);
            std::iter::once("needlebench".to_owned())
                .chain(words)
                .collect()
        })
}

#[test]
fn the_program_understands_command_lines_that_are_not_run() {
    let mut seen = 0;
    let mut files = chapters();
    files.push(workspace().join("README.md"));
    for file in files {
        for block in blocks(&file)
            .iter()
            .filter(|block| block.language != "console")
        {
            let text = block
                .text
                .replace("cargo run --release -- ", "needlebench ")
                // A line that goes on in the next.
                .replace("\\\n", " ");
            for words in others(&text) {
                if let Err(error) = needlebench::command_line().try_get_matches_from(&words) {
                    panic!("{}: {words:?}: {error}", file.display());
                }
                seen += 1;
            }
        }
    }
    assert!(seen > 3, "{seen} command lines");
}

#[test]
fn every_command_of_the_program_is_in_the_guide() {
    let text = fs::read_to_string(workspace().join("guide/src/commands.md")).unwrap();
    for command in needlebench::command_line().get_subcommands() {
        let name = command.get_name();
        let run = format!("$ needlebench {name} --help\n");
        assert!(
            name == "help" || text.contains(&run),
            "commands.md lacks {name}"
        );
    }
}
