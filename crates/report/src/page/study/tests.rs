mod synthetic;

use needlebench_study::FactorValue;
use serde_json::{Value, json};
use synthetic::Synthetic;

use super::{CasePictures, StudyPage};
use crate::page::pack::unpack::{Unpacked, of_page};

/// Largest page of a study.
const MOST_BYTES: usize = 10_000_000;

fn page(results: &Synthetic, summary: &Value) -> String {
    let page = StudyPage {
        name: "synthetic </script><img src=x>",
        description: "A table made up for tests.",
        file: "studies/synthetic.toml",
        results,
        summary,
        manifest: &json!({"seed": 1}),
        pictures: None,
    };
    page.html().unwrap()
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "small codes"
)]
fn code(value: f64) -> usize {
    value as usize
}

fn index_of_case(unpacked: &Unpacked, case: u64) -> Option<usize> {
    let numbers = &unpacked.document["numbers"];
    if numbers.is_null() {
        return usize::try_from(case).ok();
    }
    let mut sum = 0.0;
    unpacked.column(numbers).iter().position(|step| {
        sum += step;
        sum == case as f64
    })
}

#[test]
fn columns_come_back_within_half_a_step() {
    let results = Synthetic::new(600);
    let back = of_page(&page(&results, &json!({})));
    let document = &back.document;
    assert_eq!(document["kept"], 600);
    let (values, result) = results.case(123);
    let tools = back.column(&document["factors"][1]["column"]);
    assert_eq!(FactorValue::Level(code(tools[123])), values[1]);
    for metric in document["metrics"].as_array().unwrap() {
        let column = &metric["column"];
        let step = column["step"].as_f64().unwrap();
        let read = back.column(column);
        let name = metric["name"].as_str().unwrap();
        let mut columns = results.columns.iter();
        let index = columns.position(|each| each.name == name).unwrap();
        for (row, expected) in result.rows.iter().enumerate() {
            let expected = expected.get(index).map_or(f64::NAN, f64::from);
            let found = read[row * 600 + 123];
            assert!(
                (found - expected).abs() <= 0.5001 * step || found.is_nan() && expected.is_nan(),
                "{name}: {found} for {expected}"
            );
        }
    }
    let outcomes = back.column(&document["outcomes"]);
    let code = code(outcomes[3 * 600 + 123]);
    assert_eq!(
        document["outcomeNames"][code][0],
        result.rows[3].outcome.name()
    );
    assert_eq!(document["outcomeNames"][code][1], *result.rows[3].detail);
}

#[test]
fn a_page_keeps_its_size_and_the_cases_that_are_noted() {
    let results = Synthetic::new(250_000);
    let noted = 123_457;
    let html = page(&results, &json!({"evidence": {"worst": [{"case": noted}]}}));
    assert!(html.len() < MOST_BYTES, "{} bytes", html.len());
    let back = of_page(&html);
    let kept = back.document["kept"].as_u64().unwrap();
    assert!((70_000..=100_001).contains(&kept), "{kept}");
    let index = index_of_case(&back, noted).unwrap();
    let posed = back.column(&back.document["postures"]["cases"]);
    assert!(posed.contains(&(index as f64)));
    // No level is preferred by the choice of cases: a third each, give or take four deviations.
    let tools = back.column(&back.document["factors"][1]["column"]);
    let first = tools.iter().filter(|tool| **tool == 0.0).count() as f64;
    assert!((first - kept as f64 / 3.0).abs() < 4.0 * (kept as f64 * 2.0 / 9.0).sqrt());
}

#[test]
fn names_stay_texts_and_bytes_stay_the_same() {
    let results = Synthetic::new(60);
    let html = page(&results, &json!({}));
    assert!(!html.contains("<img"));
    assert!(!html.contains("offset </script>"));
    assert_eq!(html, page(&results, &json!({})));
}

#[test]
fn an_empty_table_has_a_page() {
    let results = Synthetic::new(0);
    let back = of_page(&page(&results, &json!({})));
    assert_eq!(back.document["kept"], 0);
}

#[test]
fn a_case_looks_like_itself() {
    use needlebench_scenario::{Change, KeyPath, Overrides, ScenarioFamily, Setting};
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let scenario = root.join("scenarios/studies/chest.toml");
    let family = ScenarioFamily::load(&scenario, &Overrides::default()).unwrap();
    let goal = family.goals().next().unwrap().to_owned();
    let vary = |key: &str, value: &str| {
        let change = Change::Set(Setting::from(value));
        family.vary(&goal, &[(KeyPath::parse(key).unwrap(), change)])
    };
    let results = Synthetic::new(6);
    let scenarios = |case: u64| match case {
        0 | 1 => family.vary(&goal, &[]).ok(),
        2 | 3 => vary("tool.urdf", "inline").ok(),
        4 => vary("phantom.model", "male-p95").ok(),
        // A layout that cannot exist.
        _ => None,
    };
    let page = StudyPage {
        name: "looks",
        description: "",
        file: "looks.toml",
        results: &results,
        summary: &json!({}),
        manifest: &json!({}),
        pictures: Some(CasePictures {
            base: family.base(),
            scenario_of: &scenarios,
        }),
    };
    let back = of_page(&page.html().unwrap());
    let looks = &back.document["looks"];
    // The tool of each case, none of a layout that cannot exist; base, patient and what else stands there.
    assert_eq!(
        back.column(&looks["toolOf"]),
        [0.0, 0.0, 1.0, 1.0, 0.0, 255.0]
    );
    let tools = looks["tools"].as_array().unwrap();
    assert_eq!(tools.len(), 2);
    assert_ne!(tools[0]["guide"], tools[1]["guide"]);
    let slots = usize::try_from(looks["slots"].as_u64().unwrap()).unwrap();
    let limbs = family.base().phantom.as_ref().unwrap().limbs.len();
    assert_eq!(slots, 2 + limbs + family.base().fixtures.len());
    let codes = back.column(&looks["things"]);
    let of = |case: usize| &codes[slots * case..slots * (case + 1)];
    assert_eq!(of(0), of(2));
    assert_ne!(of(0)[1], of(4)[1]);
    assert_eq!(of(0)[2 + limbs..], of(4)[2 + limbs..]);
    assert!(of(5).iter().all(|code| *code == 254.0));
    let groups = |kind: f64| -> Vec<String> {
        let parts = looks["kinds"][code(kind)].as_array().unwrap().iter();
        parts
            .map(|part| part["group"].as_str().unwrap().to_owned())
            .collect()
    };
    assert!(groups(of(0)[0]).iter().all(|group| group == "robot"));
    for tissue in ["skin", "bone", "lesion"] {
        assert!(groups(of(4)[1]).iter().any(|group| group == tissue));
    }
}

#[test]
fn an_obstacle_stands_where_its_case_has_it_or_not_at_all() {
    use needlebench_scenario::{Change, KeyPath, Overrides, ScenarioFamily, Setting};
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let scenario = root.join("scenarios/hanging.toml");
    let family = ScenarioFamily::load(&scenario, &Overrides::default()).unwrap();
    let goal = family.goals().next().unwrap().to_owned();
    let vary = |key: &str, value: Setting| {
        let change = Change::Set(value);
        family.vary(&goal, &[(KeyPath::parse(key).unwrap(), change)])
    };
    let results = Synthetic::new(3);
    let scenarios = |case: u64| match case {
        0 => family.vary(&goal, &[]).ok(),
        1 => vary("obstacles[0].position_mm[0]", Setting::from(120.0)).ok(),
        _ => vary("obstacles[0].present", Setting::from(false)).ok(),
    };
    let page = StudyPage {
        name: "obstacles",
        description: "",
        file: "obstacles.toml",
        results: &results,
        summary: &json!({}),
        manifest: &json!({}),
        pictures: Some(CasePictures {
            base: family.base(),
            scenario_of: &scenarios,
        }),
    };
    let back = of_page(&page.html().unwrap());
    let looks = &back.document["looks"];
    let slots = usize::try_from(looks["slots"].as_u64().unwrap()).unwrap();
    let (codes, places) = (back.column(&looks["things"]), back.column(&looks["places"]));
    let obstacle = |case: usize| {
        let here = slots * case..slots * (case + 1);
        here.filter(|&at| codes[at] < 254.0)
            .filter(|&at| looks["kinds"][code(codes[at])][0]["group"] == "obstacle")
            .map(|at| (codes[at], places[7 * at]))
            .collect::<Vec<_>>()
    };
    // The same pole elsewhere, and none; the other obstacle stays.
    assert_eq!(obstacle(0)[0].0, obstacle(1)[0].0);
    assert_ne!(obstacle(0)[0].1, obstacle(1)[0].1);
    assert_eq!(obstacle(0)[1], obstacle(1)[1]);
    assert_eq!(obstacle(2), obstacle(0)[1..]);
}
