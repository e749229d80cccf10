//! `report --credibility`, and requirements on criteria.

use crate::support::{Bench, Json, SMALL, holds};

const RUN: &str = "run s.toml --engine rapier --quiet";

fn with_requirements() -> String {
    format!(
        "{SMALL}[requirements]\n\
         max_tip_position_error_mm = \"SRS-12: tip within <1> mm\"\n\
         max_tip_rms_mm = \"SRS-13: over all arms\"\n\
         min_working_configurations = \"SRS-12: tip within <1> mm\"\n"
    )
}

#[test]
fn requirements_are_carried_to_every_report() {
    let bench = Bench::with_scenario(&with_requirements());
    bench.run(RUN).exits_with(0);
    let report = bench.read_json("out/small/report.json");
    let trace = report["trace"].list();
    assert_eq!(trace.len(), 3);
    assert_eq!(trace[0]["requirement"], "SRS-12: tip within <1> mm");
    assert_eq!(trace[0]["criterion"], "max_tip_position_error_mm");
    assert_eq!(trace[0]["outcome"], "met");
    // No limit is set for it: nothing of the run is judged by it.
    assert_eq!(trace[2]["outcome"], "not_judged");
    assert_eq!(trace[2]["met"], 0);
    for result in report["criteria"].list() {
        let has = result.get("requirement").is_some();
        let criterion = result["criterion"].word();
        let named = ["max_tip_position_error_mm", "min_working_configurations"];
        assert_eq!(has, named.contains(&criterion), "{criterion}");
    }
    let junit = bench.text("out/small/junit.xml");
    assert!(junit.contains("<property name=\"requirement\""), "{junit}");
    assert!(junit.contains("SRS-12: tip within &lt;1&gt; mm (max_tip_position_error_mm: met)"));
    let summary = bench.text("out/small/summary.md");
    assert!(summary.contains("## Requirements"), "{summary}");
    assert!(
        summary
            .contains("| SRS-13: over all arms | max_tip_rms_mm | **not evaluated** | 0 | 0 | 0 |")
    );
}

#[test]
fn credibility_is_collected_from_a_run_and_a_replay() {
    let bench = Bench::with_scenario(&with_requirements());
    bench.run(RUN).exits_with(0);
    let template = bench.run("report --template").exits_with(0).stdout;
    let filled = template.replace(
        "question_of_interest = \"\"",
        "question_of_interest = \"Does it reach?\"",
    );
    bench.write("judgement.toml", filled);
    let report = "report out/small --credibility --judgement judgement.toml";
    let text = bench.run(report).exits_with(0).stdout;
    holds(
        &text,
        [
            "claims no conformity",
            "Does it reach?",
            "*not stated*",
            "No comparator",
            "time step not halved",
            "SRS-12: tip within <1> mm",
            "fewer than two measured the same motion",
        ],
    );
    assert!(!text.to_lowercase().contains("validated"), "{text}");
    let json = bench.read_json("out/small/credibility.json");
    assert_eq!(json["judgement"]["question_of_interest"], "Does it reach?");
    assert_eq!(
        json["runs"][0]["provenance"]["inputs"],
        bench.read_json("out/small/report.json")["provenance"]["inputs"]
    );
    bench.write(
        "out/small/replay.json",
        "{\"log\": {\"file\": \"arm.csv\", \"sha256\": \"0f\"}, \"calibration\": {\"held_out\": {\"rms_m\": 8.2e-5}}}",
    );
    let text = bench
        .run("report out/small --credibility")
        .exits_with(0)
        .stdout;
    assert!(
        text.contains("at held-out poses: 0.082 mm") && !text.contains("No comparator"),
        "{text}"
    );
}
