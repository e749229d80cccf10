//! The same input gives the same bytes, however many threads work.

use crate::support::{Bench, SMALL, mujoco_is_ready, small_run, with_edit, without_times};

/// The text of a report without its only part that may differ.
pub fn without_timings(bench: &Bench, folder: &str) -> String {
    let text = bench.text(&format!("{folder}/small/report.json"));
    let timings = text.find("  \"timings\": {").unwrap();
    let end = timings + text[timings..].find('}').unwrap() + 1;
    format!("{}{}", &text[..timings], &text[end..])
}

#[test]
fn repeated_runs_write_identical_files_apart_from_the_timings() {
    mujoco_is_ready();
    let text = with_edit(SMALL, "pictures = false", "pictures = true");
    let bench = Bench::with_scenario(&text);
    for (folder, jobs) in [("a", "1"), ("b", "2"), ("c", "2")] {
        let answer = bench.run(format!("run s.toml --out {folder} --jobs {jobs}"));
        answer.exits_with(0);
    }
    let files = bench.tree("a");
    for extension in ["json", "html", "csv", "png", "svg", "xml", "md"] {
        let has = |file: &&std::path::PathBuf| file.extension().is_some_and(|e| e == extension);
        assert!(files.iter().any(|file| has(&file)), "no .{extension} file");
    }
    for other in ["b", "c"] {
        assert_eq!(files, bench.tree(other));
        assert_eq!(without_timings(&bench, "a"), without_timings(&bench, other));
        for file in &files {
            if file.ends_with("report.json") {
                continue;
            }
            if file.ends_with("junit.xml") {
                let junit = |folder: &str| bench.read(&format!("{folder}/{}", file.display()));
                assert_eq!(without_times(&junit("a")), without_times(&junit(other)));
                continue;
            }
            let file = file.display();
            let same = bench.read(&format!("a/{file}")) == bench.read(&format!("{other}/{file}"));
            assert!(same, "{file} differs between a and {other}");
        }
    }
}

#[test]
fn printed_report_is_the_written_one() {
    let (bench, answer) = small_run();
    assert_eq!(answer.json(), bench.read_json("out/small/report.json"));
}
