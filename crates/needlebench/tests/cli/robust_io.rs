//! Files that are none, output that nobody takes, and texts that are commands.

use std::fs::File;
use std::process::Stdio;

use crate::support::{Bench, SMALL, with_edit};

/// One line of each command that fails at once.
const FAILING: [&str; 10] = [
    "check nosuch.toml",
    "run nosuch.toml",
    "study nosuch.toml",
    "merge nosuch.toml shard",
    "compare nosuch nosuch",
    "roll-map nosuch.toml",
    "iso9283 --csv nosuch --commanded nosuch",
    "pairs nosuch.toml",
    "servo nosuch.toml",
    "ik nosuch.toml --goal pose",
];

#[cfg(target_os = "linux")]
#[test]
fn a_full_standard_error_changes_no_exit_status() {
    let bench = Bench::new();
    for arguments in FAILING {
        let full = || File::options().write(true).open("/dev/full").unwrap();
        let mut command = bench.command(arguments);
        let status = command.stdout(full()).stderr(full()).status().unwrap();
        assert_eq!(status.code(), Some(2), "{arguments:?}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_standard_output_is_an_error_that_is_told() {
    let bench = Bench::with_scenario(SMALL);
    for arguments in ["check s.toml", "schema scenario", "completions bash"] {
        let full = File::options().write(true).open("/dev/full").unwrap();
        let mut command = bench.command(arguments);
        let output = command
            .stdout(full)
            .stderr(Stdio::piped())
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(3), "{arguments:?}");
        let text = String::from_utf8_lossy(&output.stderr);
        assert!(text.contains("cannot write to standard output"), "{text}");
    }
}

/// Every argument that names a file to read, with `FILE` in its place.
const READING: [&str; 11] = [
    "check FILE",
    "run FILE",
    "study FILE",
    "compare FILE FILE",
    "compare s.toml s.toml --thresholds FILE",
    "iso9283 --csv FILE --commanded FILE",
    "fk --joints 0,0,0,0,0,0 --calibration FILE",
    "fk --joints 0,0,0,0,0,0 --robot FILE",
    "pairs s.toml --srdf FILE",
    "check mesh.toml",
    "check tool.toml",
];

/// Runs all of them on a file; each says why it is refused, and exits with 2.
#[track_caller]
fn refused_everywhere(bench: &Bench, file: &str, part: &str) {
    let section =
        format!("[[phantom.parts]]\nname = \"part\"\ntissue = \"organ\"\nfile = \"{file}\"\n");
    bench.write("mesh.toml", format!("{SMALL}\n{section}"));
    let tool = format!("[tool]\nurdf = \"{file}\"");
    bench.write("tool.toml", with_edit(SMALL, "[tool]", &tool));
    bench.write("s.toml", SMALL);
    for arguments in READING {
        let answer = bench.run(arguments.replace("FILE", &format!("'{file}'")));
        assert_eq!(answer.status, Some(2), "{arguments:?}: {answer:#?}");
        assert!(answer.stderr.contains(part), "{arguments:?}: {answer:#?}");
    }
}

#[cfg(unix)]
#[test]
fn a_device_without_end_is_no_file() {
    refused_everywhere(
        &Bench::new(),
        "/dev/zero",
        "it is a device, not a regular file",
    );
}

#[cfg(unix)]
#[test]
fn a_pipe_that_nobody_writes_to_is_no_file() {
    let bench = Bench::new();
    let pipe = bench.path("pipe");
    let made = std::process::Command::new("mkfifo")
        .arg(&pipe)
        .status()
        .unwrap();
    assert!(made.success());
    let pipe = pipe.display().to_string();
    refused_everywhere(&bench, &pipe, "it is a pipe, not a regular file");
}

#[test]
fn a_file_beyond_all_measure_is_refused_by_its_size() {
    let bench = Bench::new();
    // Holes take no room on the disk.
    File::create(bench.path("huge"))
        .unwrap()
        .set_len(1 << 34)
        .unwrap();
    refused_everywhere(&bench, "huge", "MiB, the limit for such a file");
}

#[test]
fn the_manifest_of_a_study_that_is_no_text_is_bad_input() {
    let bench = Bench::with_scenario(SMALL);
    bench.write("study.toml", "name = \"one\"\nscenario = \"s.toml\"\n[[factors]]\nname = \"a\"\nkey = \"phantom.position_mm[0]\"\nvalues = [1, 2]\n");
    std::fs::create_dir_all(bench.path("out/one")).unwrap();
    bench.write("out/one/study.json", b"\xff\xfe{}");
    let answer = bench.run("study study.toml --resume").exits_with(2);
    answer.complains(["study.json", "not UTF-8 text"]);
}

#[cfg(unix)]
#[test]
fn what_a_terminal_takes_for_a_command_is_written_out() {
    let bench = Bench::new();
    let name = "a\u{1b}[31m\u{7}.toml";
    let missing = bench.run(format!("check {name}")).exits_with(2);
    missing.complains(["a\\u{1b}[31m\\u{7}.toml"]);
    bench.write(name, SMALL);
    let found = bench.run(format!("check {name}")).exits_with(0);
    assert!(
        found.stdout.starts_with("a\\u{1b}[31m\\u{7}.toml: ok"),
        "{found:#?}"
    );
}

#[test]
fn the_summary_takes_no_markup_from_a_description() {
    let bench = Bench::new();
    let description = "description = \"<b>bold</b> **x**\\n# head \\u001b[31m\"\n";
    bench.write(
        "s.toml",
        with_edit(
            SMALL,
            "name = \"small\"",
            &format!("{description}name = \"small\""),
        ),
    );
    let run = "run s.toml --engine rapier --no-pictures --no-page";
    bench.run(run).exits_with(0);
    let summary = bench.text("out/small/summary.md");
    let line = summary.lines().nth(2).unwrap();
    assert_eq!(line, "\\<b>bold\\</b> \\*\\*x\\*\\* # head \\\\u{1b}[31m");
}

#[cfg(unix)]
#[test]
fn a_folder_of_results_has_one_writer_and_keeps_nothing_of_killed_ones() {
    let bench = Bench::with_scenario(SMALL);
    bench.run("run s.toml --no-pictures --quiet");
    let results = bench.path("out/small");
    assert!(results.is_dir());
    let unfinished = results.join(".needlebench-Ab12Cd.tmp");
    std::fs::write(&unfinished, "half").unwrap();
    let folder = File::open(&results).unwrap();
    folder.lock().unwrap();
    let written = results.join("report.json").metadata().unwrap().modified();
    for arguments in [
        "run s.toml --no-pictures --quiet",
        "ct synth s.toml --out out/small",
    ] {
        let answer = bench.run(arguments).exits_with(3);
        answer.complains(["another process is writing here", "hint: wait for it"]);
    }
    let now = results.join("report.json").metadata().unwrap().modified();
    assert_eq!(written.unwrap(), now.unwrap());
    assert!(unfinished.exists());
    drop(folder);
    bench.run("run s.toml --no-pictures --quiet");
    assert!(!unfinished.exists());
}
