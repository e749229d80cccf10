use std::borrow::Cow;

use needlebench_bench::study::StudyColumns;
use needlebench_cell::study::StudyMode;
use needlebench_kinematics::random::SplitMix64;
use needlebench_study::{
    CaseResult, Factor, FactorKind, FactorValue, Level, MetricColumn, Outcome, Results,
    ResultsError, Role, Row,
};
use serde_json::{Value, json};

use super::{CasePictures, StudyPage};
use crate::page::pack::unpack::{Unpacked, of_page};

/// Largest page of a study.
const MOST_BYTES: usize = 10_000_000;

/// A table that is made as it is read: two goals, a tool, a level of calibration and six numbers.
pub struct Synthetic {
    pub columns: Vec<MetricColumn>,
    pub factors: Vec<Factor>,
    pub cases: u64,
}

impl Synthetic {
    pub fn new(cases: u64) -> Self {
        let levels = |name: &str, labels: &[&str], role| Factor {
            name: name.to_owned(),
            unit: String::new(),
            role,
            sampled: false,
            kind: FactorKind::Levels(
                labels
                    .iter()
                    .map(|label| Level {
                        label: (*label).to_owned(),
                        number: None,
                    })
                    .collect(),
            ),
        };
        let number = |name: &str, unit: &str, low, high| Factor {
            name: name.to_owned(),
            unit: unit.to_owned(),
            role: Role::Circumstance,
            sampled: false,
            kind: FactorKind::Continuous { low, high },
        };
        let factors = vec![
            levels(
                "goal",
                &["left_upper_anterior", "right_pleural_lateral"],
                Role::Circumstance,
            ),
            levels(
                "tool",
                &["perpendicular", "inline", "offset </script>"],
                Role::Choice,
            ),
            number("phantom_x", "mm", -60.0, 60.0),
            number("phantom_y", "mm", -60.0, 60.0),
            number("phantom_yaw", "deg", -15.0, 15.0),
            number("chest_depth", "mm", 190.0, 280.0),
            number("base_x", "mm", -100.0, 100.0),
            number("base_y", "mm", -100.0, 100.0),
        ];
        let columns = StudyColumns::new(&[StudyMode::Static], &[]).described();
        Self {
            columns,
            factors,
            cases,
        }
    }

    #[expect(
        clippy::cast_possible_truncation,
        reason = "columns of single precision"
    )]
    fn case(&self, case: u64) -> (Vec<FactorValue>, CaseResult) {
        let mut random = SplitMix64::new(case / 6);
        let mut values = vec![
            FactorValue::Level((case % 2) as usize),
            FactorValue::Level((case / 2 % 3) as usize),
        ];
        let mut numbers = Vec::new();
        for factor in &self.factors[2..] {
            let FactorKind::Continuous { low, high } = factor.kind else {
                continue;
            };
            let number = random.uniform(low, high);
            numbers.push((number - low) / (high - low) - 0.5);
            values.push(FactorValue::Number(number));
        }
        let tool = (case / 2 % 3) as f64;
        let mut noise = SplitMix64::new(case);
        let rows = std::array::from_fn(|index| {
            let side = if index % 2 == 0 { 1.0 } else { -1.0 };
            let reach = numbers[0] * side + 0.5 * numbers[1] - 0.3 * numbers[2] * numbers[5];
            let clearance_mm =
                25.0 + 60.0 * reach - 8.0 * tool - 4.0 * index as f64 + noise.uniform(-4.0, 4.0);
            let outcome = if numbers[3] > 0.49 {
                Outcome::Invalid
            } else if clearance_mm < 0.0 {
                Outcome::Rejected
            } else if clearance_mm < 6.0 {
                Outcome::Failed
            } else {
                Outcome::Ok
            };
            let detail = match outcome {
                Outcome::Ok => "",
                Outcome::Failed => "min_clearance_mm.robot_phantom",
                Outcome::Rejected => "collision robot_phantom",
                Outcome::Invalid => "phantom.position_mm",
            };
            let index = u8::try_from(index).unwrap();
            let mut row = Row::new(index, outcome, Cow::Borrowed(detail));
            if outcome != Outcome::Invalid {
                row.values = vec![f32::NAN; self.columns.len()];
                let mut set = |key: &str, value: f64| {
                    let mut columns = self.columns.iter();
                    let place = columns.position(|column| column.key == key).unwrap();
                    row.values[place] = value as f32;
                };
                set("clearance_static", clearance_mm);
                set(
                    "tip_error_static",
                    1.2 + numbers[4].abs() + noise.uniform(0.0, 0.8),
                );
                set("surplus_static", clearance_mm - 5.0);
                set("self_clearance_static", 9.0 + noise.uniform(0.0, 20.0));
                for (joint, start) in [-85.0, -105.0, 30.0, 40.0, 100.0, 10.0]
                    .into_iter()
                    .enumerate()
                {
                    set(
                        &format!("q{}_static", joint + 1),
                        start + 30.0 * numbers[joint] + 4.0 * f64::from(index),
                    );
                }
            }
            row
        });
        (values, CaseResult { case, rows })
    }
}

impl Results for Synthetic {
    fn factors(&self) -> &[Factor] {
        &self.factors
    }

    fn columns(&self) -> &[MetricColumn] {
        &self.columns
    }

    fn cases(&self) -> u64 {
        self.cases
    }

    fn visit(
        &self,
        visit: &mut dyn FnMut(&[FactorValue], &CaseResult),
    ) -> Result<(), ResultsError> {
        for case in 0..self.cases {
            let (values, result) = self.case(case);
            visit(&values, &result);
        }
        Ok(())
    }
}

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
    use needlebench_cell::{Change, KeyPath, Overrides, ScenarioFamily, Setting};
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
    use needlebench_cell::{Change, KeyPath, Overrides, ScenarioFamily, Setting};
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
    let configurations: Vec<Value> = needlebench_kinematics::ik::Configuration::ALL
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
        "headline": "postures only: whether a motion gets there is not known",
        "answer": {
            "sentence": "best tool of 3: perpendicular; with it at least one configuration works in 93.0 % of 33334 \
                layouts (95 % interval 92.7 to 93.3 %, which holds for all 3 at once)",
            "remarks": ["the next, inline, works in 3.0 points fewer (95 % interval 2.0 to 4.0)"],
            "compared": [],
        },
        "criteria": [
            {"criterion": "min_layouts_working", "of": null, "choice": "perpendicular", "pass": false, "value": 0.93,
                "interval": {"low": 0.927, "high": 0.933}, "limit": 0.95, "unit": "1", "confidence": false,
                "detail": "layouts in which at least one configuration is ok", "cases": [12, 18], "requirement": "SRS-1 <b>"},
            {"criterion": "max_tip_error_mm", "of": "best", "choice": "perpendicular", "pass": true, "value": 2.243e-13,
                "interval": {"low": 2.1e-13, "high": 2.4e-13}, "limit": 2.7, "unit": "mm", "confidence": false,
                "detail": "95 % quantile of the tip error", "cases": [77], "requirement": null},
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
        "ranked_by": "the share of its cases that work",
        "held_out": null,
        "paired": true,
        "validity_differs": false,
        "choices": choices,
    })
}

#[test]
#[ignore = "writes the page that tests/page opens, to the file that PAGE_OUT names"]
fn a_page_of_a_hundred_thousand_cases_for_the_browser() {
    let path = std::env::var_os("PAGE_OUT").expect("PAGE_OUT names the file to write");
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let results = Synthetic::new(100_000);
    let family = needlebench_cell::ScenarioFamily::load(
        &root.join("scenarios/studies/chest.toml"),
        &needlebench_cell::Overrides::default(),
    )
    .unwrap();
    let goal = family.goals().next().unwrap().to_owned();
    let tools = ["perpendicular", "inline", "offset"].map(|tool| {
        let key = needlebench_cell::KeyPath::parse("tool.urdf").unwrap();
        let change = needlebench_cell::Change::Set(needlebench_cell::Setting::from(tool));
        family.vary(&goal, &[(key, change)]).unwrap()
    });
    let scenario_of = |case: u64| Some(tools[usize::try_from(case / 2 % 3).unwrap()].clone());
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
    std::fs::write(path, page.html().unwrap()).unwrap();
}
