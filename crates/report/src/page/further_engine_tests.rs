//! A further engine is a module and a line: whatever shows engines shows it.

use std::path::Path;

use needlebench_bench::{RunOptions, run_scenario};
use needlebench_engine::{ENGINES, Engine};
use needlebench_kinematics::ik::Configuration;
use needlebench_scenario::{Overrides, load_scenario};
use serde_json::Value;

use super::pack::unpack::of_page;
use super::run_page;
use crate::csv::recording_name;
use crate::replay::Replay;
use crate::{markdown, report_text};

/// What the line adds.
static MORE: [&dyn Engine; 3] = [ENGINES[0], ENGINES[1], &Replay];

#[test]
fn further_engine_has_its_columns_files_and_motions() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../needlebench/tests/cli/small.toml");
    let resolved = load_scenario(&path, &Overrides::default()).unwrap();
    let run = |engines: &[&str]| {
        let options = RunOptions {
            known_engines: &MORE,
            engines: Some(engines.iter().map(|name| (*name).into()).collect()),
            jobs: 2,
            referee: false,
        };
        run_scenario(&resolved, &options).unwrap()
    };
    let finished = run(&["replay", "rapier"]);
    let page = of_page(&run_page(&resolved, &finished, &finished.report));
    let mut simulated = 0;
    for (index, runs) in finished.runs[0].iter().enumerate() {
        let Some(last) = runs.last() else { continue };
        simulated += 1;
        let shown = &page.document["goals"][0]["configurations"][index]["runs"];
        let shown: Vec<&Value> = shown.as_array().unwrap().iter().collect();
        let engines: Vec<&Value> = shown.iter().map(|run| &run["engine"]).collect();
        assert_eq!(engines, ["rapier", "replay"]);
        let name = recording_name(Configuration::ALL[index], last.engine);
        assert!(name.ends_with(".replay.csv"), "{name}");
    }
    assert_eq!(simulated, 6);
    let table = report_text(&finished.report, &MORE);
    let heading = table.lines().find(|line| line.contains("MuJoCo")).unwrap();
    assert!(
        heading.contains("rapier") && heading.contains("Replay"),
        "{heading}"
    );
    assert!(markdown(&finished.report, &MORE).contains("| Residual Replay |"));
    // Those who do not know it show it by its name.
    assert!(markdown(&finished.report, ENGINES).contains("| Residual replay |"));
    // Where it did not run, nothing is left of it.
    assert!(!report_text(&run(&["rapier"]).report, &MORE).contains("Replay"));
}
