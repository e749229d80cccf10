//! Writes the page of a study of a hundred thousand cases that nobody has to compute.
//!
//! ```text
//! cargo run --release -p needlebench-programs-study --bin study_page -- FILE.html
//! ```
//!
//! Names in it try to break out of the page.

use std::error::Error;
use std::path::Path;

use needlebench_input::Finding;
use needlebench_kinematics::ik::Configuration;
use needlebench_report::page::study::{CasePictures, StudyPage};
use needlebench_scenario::{Change, KeyPath, Overrides, ScenarioFamily, Setting};
use needlebench_study::{FactorValue, Outcome, Results};
use serde_json::{Value, json};
use synthetic::Synthetic;

#[path = "../../../../../crates/report/src/page/study/tests/synthetic.rs"]
mod synthetic;

fn main() -> Result<(), Box<dyn Error>> {
    let file = std::env::args().nth(1).ok_or("names no file to write")?;
    let results = Synthetic::new(100_000);
    let family = ScenarioFamily::load(
        Path::new("scenarios/studies/chest.toml"),
        &Overrides::default(),
    )
    .map_err(|findings| in_words(&findings))?;
    let goal = family
        .goals()
        .next()
        .ok_or("chest.toml has no goal")?
        .to_owned();
    let mut tools = Vec::new();
    for tool in ["perpendicular", "inline", "offset"] {
        let change = Change::Set(Setting::from(tool));
        let changes = [(KeyPath::parse("tool.urdf")?, change)];
        tools.push(
            family
                .vary(&goal, &changes)
                .map_err(|findings| in_words(&findings))?,
        );
    }
    let scenario_of = |case: u64| Some(tools[usize::try_from(case / 2 % 3).ok()?].clone());
    let page = StudyPage {
        name: "synthetic </script><img src=x>",
        description: "A table made up for tests </script><script>window.attacked = true</script>",
        file: "studies/synthetic.toml",
        results: &results,
        summary: &summary(&results),
        manifest: &json!({"seed": 1}),
        pictures: Some(CasePictures {
            base: family.base(),
            scenario_of: &scenario_of,
        }),
    };
    std::fs::write(file, page.html()?)?;
    Ok(())
}

fn in_words(findings: &[Finding]) -> String {
    let lines: Vec<String> = findings.iter().map(ToString::to_string).collect();
    lines.join("\n")
}

/// A summary with the keys that the page draws, from the table itself.
fn summary(results: &Synthetic) -> Value {
    let mut ok = [0_u64; 8];
    results
        .visit(&mut |_, result| {
            for (count, row) in ok.iter_mut().zip(&result.rows) {
                *count += u64::from(row.outcome == Outcome::Ok);
            }
        })
        .unwrap();
    let configurations: Vec<Value> = Configuration::ALL
        .iter()
        .zip(ok)
        .map(|(configuration, ok)| {
            let rate = ok as f64 / results.cases as f64;
            json!({
                "label": configuration.label(), "ok": ok, "failed": 0, "rejected": results.cases - ok, "best": 0,
                "success": {"successes": ok, "of": results.cases, "rate": rate,
                    "interval": {"low": rate - 0.004, "high": rate + 0.004}, "effective_size": 1e4, "remark": null},
            })
        })
        .collect();
    let choices = choices(results);
    json!({
        "schema_version": 1,
        "confidence": 0.95,
        "verdict": "fail",
        "postures_only": "all",
        "headline": "Postures only, motions not planned, not even in a sample of cases",
        "answer": {
            "sentence": "best of 3 candidates: perpendicular; at least one configuration is feasible in 93.0 % of 33334 \
                layouts (simultaneous 95 % CI 92.7 to 93.3 %)",
            "remarks": ["next: inline, 3.0 percentage points lower (95 % CI 2.0 to 4.0)"],
            "compared": [],
        },
        "criteria": [
            {"criterion": "min_layouts_working", "of": null, "choice": "perpendicular", "pass": false, "value": 0.93,
                "interval": {"low": 0.927, "high": 0.933}, "limit": 0.95, "unit": "1", "confidence": false,
                "detail": "layouts with at least one feasible configuration", "cases": [12, 18], "requirement": "SRS-1 <b>"},
            {"criterion": "max_tip_error_mm", "of": "best", "choice": "perpendicular", "pass": true, "value": 2.243e-13,
                "interval": {"low": 2.1e-13, "high": 2.4e-13}, "limit": 2.7, "unit": "mm", "confidence": false,
                "detail": "P95 tip error of the best configuration over 33334 layouts", "cases": [77], "requirement": null},
        ],
        "not_judged": [],
        "choices": choices,
        "overall": {"goal": null, "cases": results.cases, "invalid": 0, "configurations": configurations},
        "evidence": {"invalid": [12, 18], "configurations": [
            {"of": "best", "worst": [{"metric": "clearance_static_mm", "cases": [{"case": 77, "value": 6.01}, {"case": 78, "value": 6.02}]}]}]},
        "notes": ["A table made up for tests <b>"],
    })
}

/// The tools, ranked as a study's summary has them.
fn choices(results: &Synthetic) -> Value {
    let mut counts = [[0_u64; 2]; 3];
    results
        .visit(&mut |values, result| {
            let FactorValue::Level(tool) = values[1] else {
                unreachable!("a tool is a level")
            };
            let works = result.rows.iter().any(|row| row.outcome == Outcome::Ok);
            counts[tool][0] += u64::from(works);
            counts[tool][1] += u64::from(result.rows[0].outcome != Outcome::Invalid);
        })
        .unwrap();
    let labels = ["perpendicular", "inline", "offset </script>"];
    let choices: Vec<Value> = labels
        .iter()
        .zip(counts)
        .enumerate()
        .map(|(bin, (label, [ok, of]))| {
            let rate = ok as f64 / of as f64;
            let works = json!({"successes": ok, "of": of, "rate": rate, "effective_size": of, "remark": null,
                "interval": {"low": rate - 0.01, "high": rate + 0.01}});
            let against = (bin > 0).then(|| {
                json!({"difference": 0.03, "interval": {"low": 0.02, "high": 0.04}, "distinguishable": bin == 2})
            });
            json!({"bins": [bin], "label": label, "cases": of, "invalid": 0, "works": works, "works_k": works,
                "best_clearance_mm": {"p": 0.05, "value": 6.1, "interval": {"low": 6.0, "high": 6.2}, "remark": null},
                "tip_error_mm": null, "against_first": against, "failing": [2, 8]})
        })
        .collect();
    json!({
        "axes": [{"factor": 1, "name": "tool", "unit": "", "role": "choice", "coarse": false,
            "bins": labels.map(|label| json!({"label": label, "low": null, "high": null}))}],
        "working_configurations": 2,
        "ranked_by": "the share of cases with at least one feasible configuration",
        "held_out": null,
        "paired": true,
        "validity_differs": false,
        "choices": choices,
    })
}
