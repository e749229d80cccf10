use super::*;
use crate::statistics::synthetic::{Synthetic, columns, continuous, goal, ok, rejected, uniform};
use crate::{FactorValue, Outcome, Role, Row};

/// Layouts in which configuration 3 has a clearance from `shift` to `shift + 100` mm, ok above 20, and
/// configuration 0 an error of `error` mm; each `unlucky`-th layout has lost both.
fn study(seed: u64, cases: u64, shift: f64, error: f64, unlucky: u64) -> Synthetic {
    Synthetic {
        columns: columns().to_vec(),
        factors: vec![goal(), continuous("x", Role::Noise, 0.0, 1.0)],
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

/// What a threshold is on, by whose quantile, and its limit in the column's unit or in per cent.
type Limit<'a> = (StudySubject, &'a str, StudyLimit);

fn rate(rate: StudyRate, of: &str, limit: f64) -> Limit<'_> {
    (StudySubject::Rate(rate), of, StudyLimit::Absolute(limit))
}

fn quantile<'a>(key: &str, p: f64, of: &'a str, limit_mm: f64) -> Limit<'a> {
    let subject = StudySubject::Metric(key.to_owned(), p);
    (subject, of, StudyLimit::Absolute(limit_mm))
}

fn compared(a: &Synthetic, b: &Synthetic, thresholds: &[Limit<'_>]) -> StudyComparison {
    let side = |source, results| ComparedStudy {
        source,
        name: "study",
        study_id: "id",
        results,
    };
    let options = StudyCompareOptions {
        thresholds: thresholds
            .iter()
            .map(|(subject, of, limit)| StudyThreshold {
                subject: subject.clone(),
                of: (!of.is_empty()).then(|| (*of).to_owned()),
                limit: *limit,
                key: "key".to_owned(),
                text: "limit".to_owned(),
            })
            .collect(),
        ..StudyCompareOptions::default()
    };
    let pair = StudyPair::read(side("a", a), side("b", b), &[]).unwrap();
    assert_eq!(pair.have("clearance"), [true, true]);
    assert_eq!(pair.have("tip_rms"), [false, false]);
    pair.compare(&options)
}

const NEVER: u64 = u64::MAX;

#[test]
fn study_against_itself_passes_whatever_the_thresholds() {
    let a = study(1, 1500, 0.0, 0.1, NEVER);
    let all = [
        rate(WORKING_LAYOUTS, "", 0.0),
        rate(SUCCESS_RATE, EVERY, 0.0),
        quantile("clearance", 0.05, BEST, 0.0),
        quantile("tip_error", 0.95, EVERY, 0.0),
    ];
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
        (failure.metric.as_str(), failure.threshold.as_deref()),
        ("success_rate", None)
    );
    assert_eq!(failure.of.as_deref(), Some("Right-Up-Unfold"));
    assert_eq!(failure.cases, change.lost_cases);
}

#[test]
fn thresholds_are_on_quantiles_and_rates() {
    let a = study(1, 1500, 0.0, 0.1, NEVER);
    let b = study(1, 1500, -3.0, 0.3, NEVER);
    let allowed = || rate(SUCCESS_RATE, EVERY, 0.05);
    let pass = |limit| compared(&a, &b, &[allowed(), limit]).pass;
    assert!(pass(quantile("clearance", 0.5, "Right-Up-Unfold", 3.01)));
    assert!(!pass(quantile("clearance", 0.5, "Right-Up-Unfold", 2.99)));
    assert!(!pass(quantile("tip_error", 0.95, EVERY, 0.1)));
    assert!(pass(quantile("tip_error", 0.95, EVERY, 0.21)));
    assert!(pass(rate(SUCCESS_RATE, "Right-Up-Unfold", 0.05)));
    assert!(!compared(&a, &b, &[rate(SUCCESS_RATE, "Right-Up-Unfold", 0.01)]).pass);
    // What was not measured fails, and says so, whether there is a column of it or not.
    for key in ["tip_rms", "nothing"] {
        let found = compared(&a, &b, &[allowed(), quantile(key, 0.95, BEST, 1.0)]);
        assert!(
            found.failures[0]
                .detail
                .contains("neither study has values")
        );
    }
    // Better is no loss.
    let better = [
        quantile("clearance", 0.05, BEST, 0.0),
        quantile("tip_error", 0.95, BEST, 0.0),
    ];
    assert!(compared(&b, &a, &better).pass);
}

#[test]
fn metrics_are_matched_by_their_keys_wherever_their_columns_stand() {
    let a = study(1, 800, 0.0, 0.1, NEVER);
    let mut b = study(1, 800, 0.0, 0.1, NEVER);
    let case = b.case;
    b.columns.swap(0, 2);
    b.columns[0].unit = "m".to_owned();
    b.case = Box::new(move |number| {
        let (values, mut rows) = case(number);
        for row in &mut rows {
            row.values.resize(3, f32::NAN);
            row.values.swap(0, 2);
        }
        (values, rows)
    });
    let found = compared(&a, &b, &[quantile("clearance", 0.05, BEST, 0.0)]);
    assert!(found.pass, "{:?}", found.failures);
    let paired = found.paired.unwrap();
    let mut compared: Vec<&str> = paired.differences.iter().map(|each| &*each.words).collect();
    compared.sort_unstable();
    compared.dedup();
    assert_eq!(compared, ["clearance", "tip error"]);
    assert!(paired.differences.iter().all(|each| each.mean == 0.0));
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
            .contains("1500 and 1000 cases")
    );
    // Every fifth layout lost is more than chance without pairs too.
    let found = compared(&a, &study(2, 1500, 0.0, 0.1, 5), &[]);
    let lost: Vec<&str> = found.failures.iter().map(|each| &*each.metric).collect();
    assert_eq!(lost, ["working_layouts", "success_rate", "success_rate"]);
}
