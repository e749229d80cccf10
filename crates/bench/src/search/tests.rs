//! Margins and reach of real layouts.

use std::path::Path;

use needlebench_scenario::Overrides;
use needlebench_scenario::study::load_study;
use needlebench_study::search::{Generation, GenerationDesign, Purpose, Stream};
use needlebench_study::{CaseEvaluator as _, Outcome};

use super::*;
use crate::study::MARGIN_COLUMN;

fn prepared(text: &str) -> PreparedSearch {
    let studies = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/studies");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("search.toml");
    let scenario = studies.join("chest.toml").canonicalize().unwrap();
    let text = text.replace("CHEST", &scenario.display().to_string());
    std::fs::write(&path, text).unwrap();
    let study = load_study(&path, &Overrides::default()).unwrap();
    PreparedSearch::new(study).unwrap()
}

const BASES: &str = r#"
name = "bases"
scenario = "CHEST"
[sampling]
samples = 16
[[factors]]
name = "x"
key = "robot.base_position_mm[0]"
role = "control"
values = [-900, -480, -280, 200]
[[factors]]
name = "z"
key = "robot.base_position_mm[2]"
role = "control"
values = [1050, 1500]
[[factors]]
name = "size"
key = "phantom.model"
values = ["female-p5-supine", "male-p95-supine"]
[[factors]]
name = "along"
key = "phantom.position_mm[0]"
range = [-40, 40]
relative = true
"#;

fn all(search: &PreparedSearch, count: u64) -> Generation {
    let choices = search.space.choices();
    let combinations = choices.combinations().unwrap();
    Generation {
        number: 0,
        purpose: Purpose::Final,
        stream: Stream::Common,
        first: 0,
        count,
        ids: (0..combinations).collect(),
        candidates: (0..combinations)
            .map(|each| choices.candidate(each, &[]))
            .collect(),
    }
}

/// A margin is not negative where a configuration is ok, negative everywhere else, and what reach rules out has
/// nothing that works, and the margin that it says.
#[test]
fn margins_say_what_works_and_reach_knows_them_before() {
    let search = prepared(BASES);
    let generation = all(&search, 12);
    let design = GenerationDesign {
        space: &search.space,
        generation: &generation,
    };
    let evaluator = GenerationEvaluator {
        search: &search,
        design,
    };
    let columns = search.columns.described();
    let margin = columns
        .iter()
        .position(|each| each.name == MARGIN_COLUMN)
        .unwrap();
    let mut worker = evaluator.worker();
    let reach = out_of_reach(&search, &generation, 2);
    let (mut ok, mut broken, mut out, mut most_mm) = (0, 0, 0, 0.0_f32);
    for (candidate, of_candidate) in reach.iter().enumerate() {
        for (circumstance, &of_case) in of_candidate.iter().enumerate() {
            let case = candidate as u64 * generation.count + circumstance as u64;
            let result = worker.evaluate(case).unwrap();
            for row in &result.rows {
                let margin_mm = row.get(margin).expect("every row has one");
                assert_eq!(
                    margin_mm >= 0.0,
                    row.outcome == Outcome::Ok,
                    "{case}: {row:?}"
                );
                if row.outcome == Outcome::Ok {
                    most_mm = most_mm.max(margin_mm);
                    ok += 1;
                } else {
                    broken += 1;
                }
            }
            let worth = worth_of(&columns, &result);
            let none_reaches = result.rows.iter().all(|row| row.detail == "unreachable");
            assert_eq!(of_case.is_some(), none_reaches, "{case}: {of_case:?}");
            if let Some(expected_mm) = of_case {
                out += 1;
                assert_eq!(worth.margin_mm, expected_mm);
                assert!(!worth.works);
            }
        }
    }
    // Beyond the 13 mm that the arm keeps from itself, which do not count.
    assert!(most_mm > 15.0, "{most_mm}");
    assert!(ok > 20 && broken > 100 && out > 5, "{ok} {broken} {out}");
}

/// Moving the base away from a patient out of reach makes it worse by as much.
#[test]
fn out_of_reach_is_measured() {
    let away = BASES.replace("[-900, -480, -280, 200]", "[-1300, -1400, -1500]");
    let away = away.replace("[1050, 1500]", "[1050, 1100]");
    let search = prepared(&away);
    let generation = all(&search, 4);
    for of_case in (0..4).map(|k| {
        out_of_reach(&search, &generation, 1)
            .into_iter()
            .map(move |each| each[k].unwrap())
    }) {
        // Of each height the three places, z fastest.
        let margins: Vec<f64> = of_case.step_by(2).collect();
        for pair in margins.windows(2) {
            let worse_mm = pair[0] - pair[1];
            assert!((80.0..=101.0).contains(&worse_mm), "{margins:?}");
        }
    }
}

#[test]
fn what_nothing_can_be_chosen_from_says_what_is_missing() {
    let studies = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/studies");
    let study = load_study(&studies.join("equipment.toml"), &Overrides::default()).unwrap();
    let findings = PreparedSearch::new(study).unwrap_err();
    assert!(
        findings[0]
            .message
            .contains("no factor has `role = \"control\"`"),
        "{findings:?}"
    );
    assert!(findings[0].hint.as_ref().unwrap().contains("role"));
}
