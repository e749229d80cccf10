//! `--log`: told on standard error, and nowhere else.

use crate::determinism::without_timings;
use crate::support::{Bench, SMALL, without_times};

#[test]
fn a_log_tells_what_was_read_and_decided_and_changes_no_result() {
    let bench = Bench::with_scenario(SMALL);
    let silent = bench.run("run s.toml --engine rapier --quiet --out silent");
    assert_eq!(silent.stderr, "");
    let told = bench.run("run s.toml --engine rapier --quiet --log debug --out told");
    assert_eq!(told.status, silent.status);
    told.complains([
        "DEBUG read file=s.toml bytes=",
        "INFO resolve{file=\"s.toml\"}: scenario resolved goals=1",
        "INFO run{scenario=\"small\"}: begins engines=[\"rapier\"]",
        "start{engine=\"rapier\"}: engine started",
        "plan{goal=",
        "feasible configuration=",
        "DEBUG written file=told/small/report.json bytes=",
    ]);
    // Each line has the seconds since the start, not the time of day.
    for line in told.stderr.lines() {
        let [seconds, level] = [0, 1].map(|at| line.split_whitespace().nth(at).unwrap());
        assert!(
            seconds.trim_end_matches('s').parse::<f64>().is_ok(),
            "{line}"
        );
        assert!(
            ["ERROR", "WARN", "INFO", "DEBUG"].contains(&level),
            "{line}"
        );
    }
    let names = |answer: &str| answer.replace("told", "silent");
    assert_eq!(names(&told.stdout), silent.stdout);
    let files = bench.tree("silent");
    assert_eq!(files, bench.tree("told"));
    for file in files.iter().map(|file| file.display().to_string()) {
        let [a, b] = ["silent", "told"].map(|folder| bench.read(&format!("{folder}/{file}")));
        match file.rsplit('/').next() {
            Some("report.json") => assert_eq!(
                without_timings(&bench, "silent"),
                without_timings(&bench, "told")
            ),
            Some("junit.xml") => assert_eq!(without_times(&a), without_times(&b)),
            _ => assert!(a == b, "{file} differs"),
        }
    }
}

#[test]
fn a_level_chooses_what_is_told() {
    let bench = Bench::with_scenario(SMALL);
    let answer = bench.run("--log info check s.toml").exits_with(0);
    answer.complains(["INFO resolve{file=\"s.toml\"}: scenario resolved"]);
    assert!(!answer.stderr.contains("DEBUG"), "{}", answer.stderr);
    let answer = bench.run("check s.toml --log loud").exits_with(2);
    answer.complains(["loud", "[possible values: error, warn, info, debug, trace]"]);
}
