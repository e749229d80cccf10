use super::*;
use crate::statistics::synthetic::{Synthetic, continuous, goal, ok, rejected, uniform};
use crate::{FactorValue, Outcome, Role, Row};

/// Layouts in which configuration 3 has a clearance from `shift` to `shift + 100` mm, ok above 20, and
/// configuration 0 an error of `error` mm; each `unlucky`-th layout has lost both.
fn study(seed: u64, cases: u64, shift: f64, error: f64, unlucky: u64) -> Synthetic {
    Synthetic {
        factors: vec![goal(), continuous("x", Role::Circumstance, 0.0, 1.0)],
        cases,
        case: Box::new(move |case| {
            let x = uniform(seed, case, 0);
            let mut rows = rejected();
            let clearance = shift + 100.0 * x;
            if case % unlucky != unlucky - 1 {
                rows[0] = ok(0, 5.0, error);
                rows[3] = ok(3, clearance, 1.0);
                if clearance < 20.0 {
                    rows[3].outcome = Outcome::Failed;
                }
            }
            if x > 0.99 {
                for row in &mut rows {
                    *row = Row::new(row.configuration, Outcome::Invalid, "phantom.tilt_deg");
                }
            }
            (vec![FactorValue::Level(0), FactorValue::Number(x)], rows)
        }),
    }
}

fn compared(a: &Synthetic, b: &Synthetic, thresholds: &[(&str, &str)]) -> StudyComparison {
    let side = |source, results| ComparedStudy {
        source,
        name: "study",
        study_id: "id",
        results,
    };
    let options = StudyCompareOptions {
        thresholds: thresholds
            .iter()
            .map(|(key, limit)| StudyThreshold::parse(key, limit).unwrap())
            .collect(),
        allow_status_change: false,
    };
    compare_studies(side("a", a), side("b", b), &options).unwrap()
}

const NEVER: u64 = u64::MAX;

#[test]
fn study_against_itself_passes_whatever_the_thresholds() {
    let a = study(1, 1500, 0.0, 0.1, NEVER);
    let all: Vec<(&str, &str)> = STUDY_METRICS
        .iter()
        .filter(|metric| {
            ["success_rate", "clearance", "tip_error", "working_layouts"].contains(&metric.name)
        })
        .map(|metric| (metric.name, "0%"))
        .collect();
    let found = compared(&a, &a, &all);
    assert!(found.pass, "{:?}", found.failures);
    let paired = found.paired.unwrap();
    assert_eq!((paired.working.lost, paired.working.gained), (0, 0));
    assert!(
        paired
            .differences
            .iter()
            .all(|each| each.mean == 0.0 && each.losses.is_empty())
    );
    assert_eq!(paired.cases, 1500);
    assert!(paired.layouts < 1500 && paired.became_invalid == 0);
}

#[test]
fn same_cases_are_compared_one_by_one() {
    let a = study(1, 1500, 0.0, 0.1, NEVER);
    let b = study(1, 1500, -3.0, 0.3, NEVER);
    let found = compared(&a, &b, &[]);
    let paired = found.paired.as_ref().unwrap();
    let change = &paired.configurations[3].success;
    // Lost between 20 and 23 mm: 3 % of the layouts.
    assert!(
        (change.lost_share.unwrap() - 0.03).abs() < 0.015,
        "{change:?}"
    );
    assert_eq!(change.gained, 0);
    assert!(change.worse && !change.better && change.p < 1e-6);
    let clearance = paired.differences.iter();
    let clearance = clearance
        .clone()
        .find(|each| each.of == "Right-Up-Unfold" && each.metric == "clearance_mm")
        .unwrap();
    // To the rounding of f32 at 100 mm.
    assert!(
        clearance
            .quantiles
            .iter()
            .all(|each| (each.value + 3.0).abs() < 2e-5)
    );
    assert!((clearance.mean + 3.0).abs() < 1e-5);
    assert_eq!(clearance.losses.len(), 5);
    // The success of one configuration fell by more than chance, and no threshold allows it.
    assert!(!found.pass);
    let failure = &found.failures[0];
    assert_eq!(
        (failure.metric, failure.threshold.as_deref()),
        ("success_rate", None)
    );
    assert_eq!(failure.of.as_deref(), Some("Right-Up-Unfold"));
    assert_eq!(failure.cases, change.lost_cases);
}

#[test]
fn thresholds_are_on_quantiles_and_rates() {
    let a = study(1, 1500, 0.0, 0.1, NEVER);
    let b = study(1, 1500, -3.0, 0.3, NEVER);
    let allowed = ("success_rate", "0.05");
    let pass = |key, limit| compared(&a, &b, &[allowed, (key, limit)]).pass;
    assert!(pass("clearance@50:Right-Up-Unfold", "3.01mm"));
    assert!(!pass("clearance@50:Right-Up-Unfold", "2.99mm"));
    assert!(!pass("tip_error@95:every", "0.1mm"));
    assert!(pass("tip_error@95:every", "0.21mm"));
    assert!(pass("success_rate:Right-Up-Unfold", "0.05"));
    assert!(!compared(&a, &b, &[("success_rate:Right-Up-Unfold", "0.01")]).pass);
    // What was not measured fails, and says so.
    let found = compared(&a, &b, &[allowed, ("tip_rms", "1mm")]);
    assert!(
        found.failures[0]
            .detail
            .contains("neither study has values")
    );
    // Better is no loss.
    assert!(compared(&b, &a, &[("clearance", "0mm"), ("tip_error", "0mm")]).pass);
}

#[test]
fn other_cases_are_compared_by_their_intervals() {
    let a = study(1, 1500, 0.0, 0.1, NEVER);
    let other_points = study(2, 1500, 0.0, 0.1, NEVER);
    let found = compared(&a, &other_points, &[]);
    assert!(found.paired.is_none() && found.pass, "{:?}", found.failures);
    assert!(found.unpaired_because.unwrap().contains("case 0"));
    let fewer = compared(&a, &study(1, 1000, 0.0, 0.1, NEVER), &[]);
    assert!(
        fewer
            .unpaired_because
            .unwrap()
            .contains("1500 cases against 1000")
    );
    // Every fifth layout lost is more than chance without pairs too.
    let found = compared(&a, &study(2, 1500, 0.0, 0.1, 5), &[]);
    let lost: Vec<&str> = found.failures.iter().map(|each| each.metric).collect();
    assert_eq!(lost, ["working_layouts", "success_rate", "success_rate"]);
}
