use needlebench_scenario::study_criteria::{LowerQuantile, StudyCriteria, UpperQuantile};

use super::synthetic::{Synthetic, columns, continuous, goal, levels, ok, rejected, uniform};
use super::*;
use crate::{Outcome, Role, Row};

fn summary(results: &Synthetic) -> Summary {
    summarise(results, &SummaryOptions::default()).unwrap()
}

/// A hundred layouts: every tenth cannot exist; of the others configuration 1 is ok in every third
/// with a clearance of the case's number, configuration 2 always fails.
fn hundred() -> Synthetic {
    Synthetic {
        columns: columns().to_vec(),
        factors: vec![goal()],
        cases: 100,
        case: Box::new(|case| {
            let mut rows = rejected();
            if case % 10 == 0 {
                for row in &mut rows {
                    *row = Row::new(row.configuration, Outcome::Invalid, "phantom.position_mm");
                }
            } else {
                if case % 3 == 0 {
                    rows[1] = ok(1, case as f64, 0.5);
                }
                rows[2] = ok(2, 2.0 * case as f64, 1.0);
                rows[2].outcome = Outcome::Failed;
                rows[2].detail = "max_tip_position_error_mm".into();
            }
            (vec![FactorValue::Level(0)], rows)
        }),
    }
}

#[test]
fn layouts_that_cannot_exist_are_in_no_rate() {
    let found = summary(&hundred());
    let overall = &found.overall;
    assert_eq!(
        (overall.cases, overall.invalid, overall.layouts),
        (100, 10, 90)
    );
    assert_eq!(overall.invalid_details[0].detail, "phantom.position_mm");
    // 33 multiples of 3 below 100 and without 0, less 30, 60, 90.
    let right_up = &overall.configurations[1];
    assert_eq!(
        (right_up.ok, right_up.rejected, right_up.best),
        (30, 60, 30)
    );
    assert_eq!(right_up.success.rate, Some(30.0 / 90.0));
    assert_eq!(
        (overall.at_least[0].successes, overall.at_least[1].successes),
        (30, 0)
    );
    assert_eq!(overall.working[..2], [60, 30]);
    let failed = &overall.configurations[2];
    assert_eq!((failed.ok, failed.failed), (0, 90));
    assert_eq!(failed.details[0].detail, "max_tip_position_error_mm");
    assert!(
        failed
            .success
            .remark
            .as_ref()
            .unwrap()
            .contains("0 successes")
    );
    assert_eq!(found.evidence.invalid, [0, 10, 20, 30, 40]);
    assert_eq!(found.evidence.configurations[1].not_ok, [1, 2, 4, 5, 7]);
}

#[test]
fn quantiles_are_over_rows_that_have_numbers_and_are_not_rejected() {
    let found = summary(&hundred());
    let failed = found.spread("Right-Down-Unfold", "clearance_mm").unwrap();
    assert_eq!(failed.count, 90);
    assert_eq!(failed.quantile(0.0).unwrap().value, 2.0);
    assert_eq!(failed.quantile(1.0).unwrap().value, 198.0);
    // What fails is not the best, though its clearance is larger.
    let best = found.spread(BEST, "clearance_mm").unwrap();
    assert_eq!((best.count, best.quantile(1.0).unwrap().value), (30, 99.0));
    assert!(found.spread("Left-Up-Fold", "clearance_mm").is_none());
    let worst = &found.evidence.configurations[8].worst[0];
    assert_eq!(worst.metric, "clearance_mm");
    let cases: Vec<u64> = worst.cases.iter().map(|each| each.case).collect();
    assert_eq!(cases, [3, 6, 9, 12, 15]);
    assert_eq!(worst.cases[0].value, 3.0);
    let errors = &found.evidence.configurations[2].worst[1];
    assert_eq!(errors.metric, "tip_error_mm");
    assert_eq!(errors.cases[0].case, 1);
}

#[test]
fn summary_survives_json() {
    let found = summary(&choices());
    let text = serde_json::to_string(&found).unwrap();
    let read: Summary = serde_json::from_str(&text).unwrap();
    assert_eq!(read.evidence.fewer_than, found.evidence.fewer_than);
    assert_eq!(read.notes, found.notes);
    // The last bits of numbers apart.
    assert_eq!(
        serde_json::to_string(&read).unwrap().len() / 1000,
        text.len() / 1000
    );
}

/// Points of the additive recurrence on the plastic number's relative in three dimensions (Roberts,
/// 2018): evenly spread.
fn even(case: u64, column: i32) -> f64 {
    const G: f64 = 1.220_744_084_605_759_5;
    (0.5 + (case + 1) as f64 * G.powi(-(column + 1))).fract()
}

/// The function of Ishigami and Homma (1990) with a = 7, b = 0.1, as clearance and as tip error.
fn ishigami(cases: u64) -> Synthetic {
    use std::f64::consts::PI;
    Synthetic {
        columns: columns().to_vec(),
        factors: vec![
            goal(),
            continuous("x1", Role::Noise, -PI, PI),
            continuous("x2", Role::Noise, -PI, PI),
            continuous("x3", Role::Noise, -PI, PI),
        ],
        cases,
        case: Box::new(|case| {
            let x = [0, 1, 2].map(|column| PI * (2.0 * even(case, column) - 1.0));
            let y = libm::sin(x[0])
                + 7.0 * libm::sin(x[1]).powi(2)
                + 0.1 * x[2].powi(4) * libm::sin(x[0]);
            let mut rows = rejected();
            rows[4] = ok(4, y, -y);
            let mut values = vec![FactorValue::Level(0)];
            values.extend(x.map(FactorValue::Number));
            (values, rows)
        }),
    }
}

/// Sixteen bins hide that much of the fastest of Ishigami's terms.
const BINNING: f64 = 0.025;

#[test]
fn effects_are_the_sobol_indices_of_ishigamis_function() {
    let found = summary(&ishigami(50_000));
    let response = &found.effects.responses[2];
    assert_eq!(response.response, "best_clearance_mm");
    // Exact indices: Sobol and Levitan, Comput. Phys. Commun. 117 (1999) 52.
    for (main, exact) in response.main.iter().zip([0.3139, 0.4424, 0.0]) {
        let share = main.share.unwrap();
        assert!((share - exact).abs() < BINNING, "{share} {exact}");
    }
    let pair = |axes: [usize; 2]| {
        let mut all = response.interactions.iter();
        all.find(|each| each.axes == axes).unwrap().share
    };
    assert!((pair([0, 2]) - 0.2437).abs() < BINNING, "{}", pair([0, 2]));
    assert!(pair([0, 1]).abs() < 0.01 && pair([1, 2]).abs() < 0.01);
    assert_eq!(response.interactions[0].axes, [0, 2]);
    // A constant has no effects.
    let constant = &found.effects.responses[0];
    assert_eq!((constant.mean, constant.main[0].share), (Some(1.0), None));
    assert!(constant.interactions.is_empty());
}

#[test]
fn factors_without_effect_have_none_in_small_samples_too() {
    const SETS: u64 = 60;
    let (mut sum, mut above) = (0.0, 0);
    for seed in 0..SETS {
        let results = Synthetic {
            columns: columns().to_vec(),
            factors: vec![
                goal(),
                continuous("a", Role::Noise, 0.0, 1.0),
                continuous("b", Role::Noise, 0.0, 1.0),
            ],
            cases: 200,
            case: Box::new(move |case| {
                let u = |column| uniform(seed, case, column);
                let mut rows = rejected();
                rows[0] = ok(0, u(2), 0.0);
                let values = vec![
                    FactorValue::Level(0),
                    FactorValue::Number(u(0)),
                    FactorValue::Number(u(1)),
                ];
                (values, rows)
            }),
        };
        let found = summary(&results);
        let response = &found.effects.responses[2];
        for main in &response.main {
            sum += main.share.unwrap();
            above += usize::from(main.share > main.noise);
        }
        sum += response.interactions[0].share;
    }
    // Each share has a standard deviation of up to sqrt(2 * 35) / 200 = 0.04.
    assert!((sum / (3.0 * SETS as f64)).abs() < 0.01, "{sum}");
    // 5 % of 120, with room for chance and for the normal approximation.
    assert!(above <= 15, "{above}");
}

#[test]
fn repeated_points_do_not_pass_for_independent_layouts() {
    // Forty points, each in fifty layouts that all share its fate: a third works.
    let names: Vec<String> = (0..50).map(|index| format!("l{index}")).collect();
    let mut covered = 0;
    for seed in 0..200 {
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let results = Synthetic {
            columns: columns().to_vec(),
            factors: vec![
                levels("goal", Role::Noise, &names),
                continuous("x", Role::Noise, 0.0, 1.0),
            ],
            cases: 2000,
            case: Box::new(move |case| {
                let x = uniform(seed, case % 40, 0);
                let mut rows = rejected();
                if x < 1.0 / 3.0 {
                    rows[0] = ok(0, 1.0, 1.0);
                }
                let goal = usize::try_from(case / 40).unwrap();
                (vec![FactorValue::Level(goal), FactorValue::Number(x)], rows)
            }),
        };
        let options = SummaryOptions {
            factors: false,
            ..SummaryOptions::default()
        };
        let found = summarise(&results, &options).unwrap();
        let interval = found.overall.at_least[0].interval.unwrap();
        covered += usize::from(interval.low <= 1.0 / 3.0 && 1.0 / 3.0 <= interval.high);
    }
    // 190 of 200; as many independent layouts would cover 30.
    assert!(covered >= 178, "{covered}");
}

/// `x` decides who is the best, and a choice of three who works: tools `a` and `b` are alike, `c` fails
/// where `y` is above 0.8.
fn choices() -> Synthetic {
    Synthetic {
        columns: columns().to_vec(),
        factors: vec![
            goal(),
            levels("tool", Role::Control, &["c", "a", "b"]),
            continuous("x", Role::Noise, -1.0, 1.0),
            continuous("y", Role::Noise, 0.0, 1.0),
        ],
        cases: 3000,
        case: Box::new(|case| {
            let (sample, tool) = (case % 1000, usize::try_from(case / 1000).unwrap());
            let x = 2.0 * uniform(5, sample, 0) - 1.0;
            let y = uniform(5, sample, 1);
            let mut rows = rejected();
            let works = match tool {
                0 => y < 0.8,
                // One layout apart.
                1 => sample != 17,
                _ => sample != 17 && sample != 18,
            };
            if works {
                rows[0] = ok(0, 10.0 - 5.0 * x, 1.0);
                rows[5] = ok(5, 10.0 + 5.0 * x, 2.0);
            }
            let values = vec![
                FactorValue::Level(0),
                FactorValue::Level(tool),
                FactorValue::Number(x),
                FactorValue::Number(y),
            ];
            (values, rows)
        }),
    }
}

#[test]
fn choices_are_ranked_and_told_apart_where_they_differ() {
    let found = summary(&choices());
    let ranking = found.choices.unwrap();
    assert!(ranking.paired && !ranking.validity_differs);
    let labels: Vec<&str> = ranking
        .choices
        .iter()
        .map(|each| each.label.as_str())
        .collect();
    assert_eq!(labels, ["a", "b", "c"]);
    assert_eq!(ranking.choices[0].works.rate, Some(0.999));
    assert_eq!(ranking.choices[0].works_k.rate, Some(0.999));
    assert!(ranking.choices[0].against_first.is_none());
    assert!(!ranking.choices[1].against_first.unwrap().distinguishable);
    let c = ranking.choices[2].against_first.unwrap();
    let interval = c.interval.unwrap();
    assert!(c.distinguishable && interval.low < c.difference && c.difference < interval.high);
    // Paired standard error of a share of 0.2 of 1000, within a third: 0.2 -+ 0.025.
    assert!(
        (0.5 * (interval.high - interval.low) - 0.025).abs() < 0.008,
        "{interval:?}"
    );
    assert_eq!(ranking.choices[0].failing, [1017]);
    let clearance = ranking.choices[0].best_clearance_mm.as_ref().unwrap();
    // 10 + 5 |x|, |x| uniform: 10.25, with a standard error of 5 sqrt(0.05 * 0.95 / 1000) = 0.034.
    assert!((clearance.value - 10.25).abs() < 0.12, "{clearance:?}");
    assert!((1.0..=2.0).contains(&ranking.choices[0].tip_error_mm.as_ref().unwrap().value));
}

#[test]
fn the_best_configuration_of_a_region_is_found() {
    let found = summary(&choices());
    let regions = &found.regions;
    let axis = regions
        .axes
        .iter()
        .position(|axis| axis.name == "x")
        .unwrap();
    let map = regions.maps.iter().find(|map| map.axes == [axis]).unwrap();
    let bins = &regions.axes[axis].bins;
    assert!(bins.len() >= 4 && bins.len() <= 12);
    for (bin, cell) in bins.iter().zip(&map.cells) {
        let expected = match (bin.low.unwrap(), bin.high.unwrap()) {
            (_, high) if high <= 0.0 => Some("Right-Down-Fold"),
            (low, _) if low >= 0.0 => Some("Left-Up-Fold"),
            _ => None,
        };
        if expected.is_some() {
            assert_eq!(cell.winner.as_deref(), expected, "{bin:?} {cell:?}");
        }
    }
    // By `y` alone neither wins.
    let axis = regions
        .axes
        .iter()
        .position(|axis| axis.name == "y")
        .unwrap();
    let map = regions.maps.iter().find(|map| map.axes == [axis]).unwrap();
    assert!(map.cells.iter().all(|cell| cell.winner.is_none()));
    let total: u64 = map.cells.iter().map(|cell| cell.layouts).sum();
    assert_eq!(total, 3000);
}

#[test]
fn criteria_are_judged_on_the_estimate_or_on_the_interval() {
    let criteria = StudyCriteria {
        min_layouts_working: Some(0.92),
        min_success_rate: [("Right-Down-Fold".to_owned(), 0.95)].into(),
        max_invalid_layouts: Some(0.2),
        min_clearance_mm: Some(LowerQuantile {
            quantile: 0.1,
            at_least: 10.2,
            of: "best".to_owned(),
        }),
        max_tip_error_mm: Some(UpperQuantile {
            quantile: 0.95,
            at_most: 1.5,
            of: "every".to_owned(),
        }),
        ..StudyCriteria::default()
    };
    let options = SummaryOptions::default().judged_by(&criteria);
    let found = summarise(&choices(), &options).unwrap();
    let judged = judge_study(&found, &criteria);
    let verdicts: Vec<(&str, Option<&str>, bool)> = judged
        .iter()
        .map(|each| (each.criterion.as_str(), each.of.as_deref(), each.pass))
        .collect();
    assert_eq!(
        verdicts,
        [
            // 999 of 1000, of the best choice.
            ("min_layouts_working", None, true),
            ("min_success_rate", Some("Right-Down-Fold"), true),
            ("max_invalid_layouts", None, true),
            ("min_clearance_mm", Some("best"), true),
            ("max_tip_error_mm", Some("Right-Down-Fold"), true),
            ("max_tip_error_mm", Some("Left-Up-Fold"), false),
        ]
    );
    assert!(!judged[0].cases.is_empty() && judged[0].interval.is_some());
    let strict = StudyCriteria {
        confidence: true,
        min_layouts_working: Some(judged[0].value.unwrap() - 1e-6),
        ..criteria
    };
    assert!(!judge_study(&found, &strict)[0].pass);
}

#[test]
fn values_that_no_factor_has_are_an_error() {
    let mut results = hundred();
    results.case = Box::new(|_| (vec![FactorValue::Level(1)], rejected()));
    let error = summarise(&results, &SummaryOptions::default()).unwrap_err();
    assert!(error.to_string().contains("case 0"), "{error}");
}

#[test]
fn nothing_gives_an_empty_summary() {
    let mut results = hundred();
    results.cases = 0;
    let found = summary(&results);
    assert_eq!(found.overall.at_least[0].rate, None);
    assert!(
        found
            .notes
            .iter()
            .any(|note| note.contains("no layout is valid"))
    );
    assert!(
        serde_json::to_string(&found)
            .unwrap()
            .contains("\"rate\":null")
    );
}

/// Three tools over the same 128 points: `good` always works, `bad` never does, `fair` in most.
fn one_good_choice() -> Synthetic {
    Synthetic {
        columns: columns().to_vec(),
        factors: vec![
            goal(),
            levels("tool", Role::Control, &["bad", "good", "fair"]),
            continuous("x", Role::Noise, 0.0, 1.0),
        ],
        cases: 384,
        case: Box::new(|case| {
            let (sample, tool) = (case % 128, usize::try_from(case / 128).unwrap());
            let x = uniform(9, sample, 0);
            let mut rows = rejected();
            if tool == 1 || tool == 2 && x < 0.6 {
                rows[3] = ok(3, 10.0 + tool as f64, 1.0);
            }
            let values = vec![
                FactorValue::Level(0),
                FactorValue::Level(tool),
                FactorValue::Number(x),
            ];
            (values, rows)
        }),
    }
}

#[test]
fn a_study_is_judged_by_its_best_choice_and_not_by_all_of_them_together() {
    let criteria = StudyCriteria {
        min_layouts_working: Some(0.95),
        min_success_rate: [("Right-Up-Unfold".to_owned(), 0.95)].into(),
        min_clearance_mm: Some(LowerQuantile {
            quantile: 0.05,
            at_least: 10.9,
            of: "best".to_owned(),
        }),
        ..StudyCriteria::default()
    };
    let options = SummaryOptions::default().judged_by(&criteria);
    let found = summarise(&one_good_choice(), &options).unwrap();
    let best = found.of_choice.as_ref().unwrap();
    assert_eq!((best.label.as_str(), best.of, best.as_good), ("good", 3, 0));
    assert_eq!((found.overall.cases, found.repeats), (128, 1));
    assert_eq!(found.overall.at_least[0].rate, Some(1.0));
    assert_eq!(found.spread(BEST, "clearance_mm").unwrap().count, 128);
    // Two other halves of the points know of it too: it stays at 100 %.
    assert_eq!(best.held_out, Some(1.0));
    let pooled = found.over_all_choices.as_ref().unwrap();
    assert!(pooled.cases == 384 && pooled.at_least[0].rate.unwrap() < 0.6);
    for result in judge_study(&found, &criteria) {
        assert!(result.pass, "{result:?}");
        assert_eq!(result.choice.as_deref(), Some("good"));
        assert!(
            result.detail.contains("best of 3 candidates, good"),
            "{result:?}"
        );
    }
    // With the interval that holds for three choices at once: 1 - (0.025 / 3)^(1/128) may fail.
    let low = found.overall.at_least[0].interval.unwrap().low;
    assert!(
        (low - libm::pow(0.025_f64 / 3.0, 1.0 / 128.0)).abs() < 1e-9,
        "{low}"
    );
}

#[test]
fn picking_the_best_of_many_equal_choices_is_seen_on_the_other_half() {
    // Two hundred choices that all work in half of the layouts, each in its own: the best of them looks
    // better than it is.
    let names: Vec<String> = (0..200).map(|index| format!("c{index}")).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let results = Synthetic {
        columns: columns().to_vec(),
        factors: vec![
            goal(),
            levels("place", Role::Control, &names),
            continuous("x", Role::Noise, 0.0, 1.0),
        ],
        cases: 200 * 64,
        case: Box::new(|case| {
            let (sample, place) = (case % 64, usize::try_from(case / 64).unwrap());
            let mut rows = rejected();
            if uniform(4, case, 1) < 0.5 {
                rows[0] = ok(0, 10.0, 1.0);
            }
            let values = vec![
                FactorValue::Level(0),
                FactorValue::Level(place),
                FactorValue::Number(uniform(4, sample, 0)),
            ];
            (values, rows)
        }),
    };
    let found = summary(&results);
    let rate = &found.overall.at_least[0];
    let held_out = found.of_choice.unwrap().held_out.unwrap();
    // The largest of 200 shares of 64 lies about 2.7 standard errors of 6 % above their mean; the other
    // halves have 64 layouts together, two standard errors of which are 13 %.
    assert!(rate.rate.unwrap() > 0.6, "{rate:?}");
    assert!((held_out - 0.5).abs() < 0.13, "{held_out}");
    let interval = rate.interval.unwrap();
    assert!(interval.low < 0.5, "{interval:?}");
}

#[test]
fn what_cannot_exist_with_a_choice_counts_against_it() {
    let mut results = one_good_choice();
    let as_before = results.case;
    results.case = Box::new(move |case| {
        let (values, mut rows) = as_before(case);
        // With `good` all layouts but one cannot exist.
        if (129..256).contains(&case) {
            for row in &mut rows {
                *row = Row::new(
                    row.configuration,
                    Outcome::Invalid,
                    "robot.base_position_mm",
                );
            }
        }
        (values, rows)
    });
    let found = summary(&results);
    assert_eq!(found.of_choice.unwrap().label, "fair");
}

#[test]
fn choices_that_are_too_many_to_be_ranked_are_not_judged_together() {
    let labels: Vec<String> = (0..1100).map(|index| index.to_string()).collect();
    let labels: Vec<&str> = labels.iter().map(String::as_str).collect();
    let results = Synthetic {
        columns: columns().to_vec(),
        factors: vec![goal(), levels("place", Role::Control, &labels)],
        cases: 1100,
        case: Box::new(|case| {
            let mut rows = rejected();
            rows[0] = ok(0, 10.0, 1.0);
            let place = usize::try_from(case).unwrap();
            (vec![FactorValue::Level(0), FactorValue::Level(place)], rows)
        }),
    };
    let criteria = StudyCriteria {
        min_layouts_working: Some(0.5),
        ..StudyCriteria::default()
    };
    let found = summary(&results);
    let judged = judge_study(&found, &criteria);
    assert!(!judged[0].pass && judged[0].value.is_none(), "{judged:?}");
    assert!(judged[0].detail.contains("not ranked"), "{judged:?}");
}
