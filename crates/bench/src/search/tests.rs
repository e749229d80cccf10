//! Margins and reach of real layouts.

use std::path::Path;

use needlebench_input::Finding;
use needlebench_scenario::Overrides;
use needlebench_scenario::study::load_study;
use needlebench_study::search::{Generation, GenerationDesign, Objective, Purpose, Stream};
use needlebench_study::{CaseDesign as _, CaseEvaluator as _, Outcome};

use super::*;
use crate::study::{Likely, MARGIN_COLUMN, StaticWorker, StudyCase};

fn prepared(text: &str) -> PreparedSearch {
    try_prepared(text).unwrap()
}

fn try_prepared(text: &str) -> Result<PreparedSearch, Vec<Finding>> {
    let studies = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/studies");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("search.toml");
    let scenario = studies.join("chest.toml").canonicalize().unwrap();
    let text = text.replace("CHEST", &scenario.display().to_string());
    std::fs::write(&path, text).unwrap();
    let study = load_study(&path, &Overrides::default()).unwrap();
    PreparedSearch::new(study)
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

/// The lesion of a search is told by fewer needles than that of a study, and is the same lesion.
#[test]
fn lesion_probabilities_of_a_search_are_those_of_a_study() {
    let text =
        format!("{BASES}[search]\nobjective = \"lesion_probability\"\nheld_out_layouts = 16\n");
    let search = prepared(&text);
    assert_eq!(search.plan.objective, Objective::LesionProbability);
    let generation = all(&search, 4);
    let design = GenerationDesign {
        space: &search.space,
        generation: &generation,
    };
    let evaluator = GenerationEvaluator {
        search: &search,
        design,
    };
    let columns = search.columns.described();
    let named: Vec<&str> = columns
        .iter()
        .map(|each| each.key.as_str())
        .filter(|key| key.contains("probability"))
        .collect();
    assert_eq!(named, ["lesion_probability_static"]);
    let (mut worker, mut compared) = (evaluator.worker(), 0);
    for case in 0..generation.cases() {
        let result = worker.evaluate(case).unwrap();
        let worth = worth_of(&columns, &result);
        assert_eq!(worth.lesion_probability.is_some(), worth.works, "{case}");
        let Some(found) = worth.lesion_probability.filter(|_| compared < 2) else {
            continue;
        };
        compared += 1;
        let layout = StudyCase::of_values(&search.study, case, evaluator.design.values(case));
        let resolved = layout.scenario(&search.study).unwrap();
        let rows = StaticWorker::default()
            .asking(Likely::AsReported)
            .rows(&resolved);
        let of_study = rows
            .iter()
            .filter(|row| row.outcome == Outcome::Ok)
            .filter_map(|row| row.get("lesion_probability_static"))
            .reduce(f64::max);
        // Four standard deviations of a share of 10 000 draws.
        let sd = (found * (1.0 - found) / 1e4).sqrt();
        assert!(
            (found - of_study.unwrap()).abs() < 4.0 * sd + 1e-4,
            "{case}: {found} {of_study:?}"
        );
    }
    assert_eq!(compared, 2);
}

#[test]
fn lesion_probabilities_need_a_lesion_and_something_that_spreads_needles() {
    let objective = "[search]\nobjective = \"lesion_probability\"\nheld_out_layouts = 16\n";
    let scenarios = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
    let table3 = std::fs::read_to_string(scenarios.join("table3.toml")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let searched = |scenario: &str| {
        let path = folder.path().join("scenario.toml");
        std::fs::write(&path, scenario).unwrap();
        let text = BASES
            .replace("CHEST", &path.display().to_string())
            .replace("phantom.model", "seed")
            .replace("[\"female-p5-supine\", \"male-p95-supine\"]", "[1, 2]");
        try_prepared(&format!("{text}{objective}"))
    };
    searched(&table3).unwrap();
    let perfect = format!("{table3}\n[imperfections]\n");
    // Ends 26 mm before the point in the lesion.
    let short = table3.replace("insertion_length_mm = 86", "insertion_length_mm = 60");
    for (scenario, why) in [(perfect, "does not define"), (short, "goal `pose`")] {
        let findings = searched(&scenario).unwrap_err();
        assert_eq!(findings[0].key.as_deref(), Some("search.objective"));
        assert!(findings[0].message.contains(why), "{findings:?}");
    }
}
