//! `needlebench view`: what it refuses before it listens.

use std::fs;

use crate::support::{Bench, workspace};

#[test]
fn a_scenario_without_a_scan_is_told_how_to_get_one() {
    let text = fs::read_to_string(workspace().join("scenarios/supine_suite.toml")).unwrap();
    let bench = Bench::with_scenario(&text);
    let refused = bench.run(&["view", "s.toml", "--no-open"]).exits_with(2);
    refused.complains(["no scan to show", "synth", "build"]);
}

#[test]
fn a_folder_that_was_not_built_is_refused() {
    let bench = Bench::new();
    fs::create_dir(bench.path("empty")).unwrap();
    let refused = bench.run(&["view", "empty", "--no-open"]).exits_with(2);
    refused.complains(["report.json", "build"]);
}
