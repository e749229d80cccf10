//! Verdicts on made-up measurements.

use std::collections::BTreeMap;
use std::path::Path;

use needlebench_evaluation::probability::EventProbability;
use needlebench_evaluation::report::{
    ClassClearance, ClearanceReport, ConfigurationReport, GoalReport, MarginsReport,
    RejectionReport, Status, Verdict,
};
use needlebench_evaluation::{
    NeedleMeasurement, check_configuration, first_missed_by_posture, judge,
};
use needlebench_kinematics::ik::Configuration;
use needlebench_scenario::scenario::{ClearanceCriteria, CriteriaSection};
use needlebench_scenario::study::StudyMode;
use needlebench_scenario::{Expectation, Goal, Overrides, load_scenario};

use crate::likely::{event, probability_report};

/// Configuration `index` with a least clearance to the skin and a joint margin, not yet judged.
fn configuration(index: usize, clearance_m: f64, margin: f64) -> ConfigurationReport {
    let found = ClassClearance {
        minimum_m: clearance_m,
        certified_lower_bound_m: None,
        breath_allowance_m: None,
        behind_cuts_m: None,
        pair: ["forearm.2".into(), "skin".into()],
        witness_points_m: [[0.0; 3], [clearance_m, 0.0, 0.0]],
        phase: "transfer",
        time_s: Some(1.0),
        engine: Some("rapier".into()),
    };
    ConfigurationReport {
        status: Status::Ok,
        joints_rad: Some([0.0; 6]),
        roll_rad: Some(0.0),
        margins: Some(MarginsReport {
            joint_limit: margin,
            wrist_sine: 1.0,
            elbow_sine: 1.0,
            shoulder_m: 0.3,
            manipulability_m3: 0.01,
        }),
        clearance: ClearanceReport::new(BTreeMap::from([("robot_phantom", found)])),
        ..ConfigurationReport::new(Configuration::ALL[index].label())
    }
}

fn rejected(index: usize) -> ConfigurationReport {
    let mut made = configuration(index, -0.01, 0.5);
    made.status = Status::Rejected;
    made.rejections = vec![RejectionReport {
        rule: "collision",
        value: -0.01,
        limit: 0.0,
        unit: "m",
        detail: "forearm.2 and skin".into(),
    }];
    made
}

fn goal() -> Goal {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/table3.toml");
    let resolved = load_scenario(&path, &Overrides::default()).unwrap();
    Goal {
        expected: BTreeMap::new(),
        ..resolved.goals[0].clone()
    }
}

fn report(configurations: Vec<ConfigurationReport>) -> Vec<GoalReport> {
    vec![GoalReport {
        name: "pose".into(),
        lesion: None,
        entry_m: None,
        target_m: [0.0; 3],
        true_target_m: None,
        axis: [0.0, 0.0, 1.0],
        insertion_length_m: 0.1,
        standoff_m: None,
        needle_route: None,
        fissures_crossed: Vec::new(),
        needle: None,
        configurations,
        recommended: None,
        ranking: None,
    }]
}

#[test]
fn what_no_engine_measured_is_not_judged() {
    let mut goals = report(vec![configuration(0, 0.05, 0.5)]);
    let engines = ["rapier", "mujoco"];
    let (verdict, judged) = judge(&mut goals, &[goal()], &CriteriaSection::default(), &engines);
    assert_eq!(verdict, Verdict::Incomplete);
    assert_eq!(goals[0].configurations[0].status, Status::Failed);
    assert_eq!(judged.results, []);
    for engine in engines {
        let mut all = judged.not_judged.iter();
        assert!(
            all.any(|each| each.engine.as_deref() == Some(engine)),
            "{engine}"
        );
    }
    let goal_itself = judged.not_judged.last().unwrap();
    assert_eq!(goal_itself.criterion, "min_working_configurations");
}

#[test]
fn what_is_missed_goes_before_what_is_not_judged() {
    // Two are asked for, but one at most can come to work.
    let mut goals = report(vec![configuration(0, 0.05, 0.5), rejected(1)]);
    let criteria = CriteriaSection {
        min_working_configurations: 2,
        ..Default::default()
    };
    let (verdict, judged) = judge(&mut goals, &[goal()], &criteria, &["rapier"]);
    assert_eq!(verdict, Verdict::Fail);
    assert!(!judged.not_judged.is_empty());
}

#[test]
fn rejections_alone_do_not_fail_a_goal_that_asks_for_no_configuration() {
    let mut goals = report((0..8).map(rejected).collect());
    let criteria = CriteriaSection {
        min_working_configurations: 0,
        ..Default::default()
    };
    let (verdict, judged) = judge(&mut goals, &[goal()], &criteria, &["rapier", "mujoco"]);
    assert_eq!(verdict, Verdict::Pass);
    assert!(judged.results.iter().all(|result| result.pass));
}

#[test]
fn an_expected_rejection_that_does_not_come_fails() {
    let mut expecting = goal();
    expecting.expected.insert(
        Configuration::ALL[0],
        Expectation::Rejected("unreachable".into()),
    );
    let mut goals = report(vec![rejected(0)]);
    let criteria = CriteriaSection {
        min_working_configurations: 0,
        ..Default::default()
    };
    let (verdict, judged) = judge(&mut goals, &[expecting], &criteria, &["rapier", "mujoco"]);
    assert_eq!(verdict, Verdict::Fail);
    let missed = judged
        .results
        .iter()
        .find(|result| result.criterion == "expected")
        .unwrap();
    assert!(
        !missed.pass && missed.detail.contains("got collision"),
        "{}",
        missed.detail
    );
}

/// What a static case would make of the same criteria.
#[test]
fn a_criterion_is_judged_by_what_is_known_and_in_one_order() {
    let criteria = CriteriaSection {
        max_tip_position_error_mm: Some(1.0),
        max_tip_rms_mm: Some(1.0),
        min_clearance_mm: ClearanceCriteria {
            robot_phantom: Some(60.0),
            robot_table: Some(1.0),
            ..ClearanceCriteria::default()
        },
        ..CriteriaSection::default()
    };
    let mut made = configuration(0, 0.05, 0.5);
    made.posture_clearance_m = BTreeMap::from([("robot_phantom", 0.08)]);
    // What is not judged comes last, with neither.
    let keys = |mode: StudyMode, made: &ConfigurationReport| -> Vec<(String, Option<bool>)> {
        let judged = check_configuration("pose", made, &criteria, mode, &[]);
        let results = judged.results.into_iter();
        let results = results.map(|result| (result.criterion, Some(result.pass)));
        let open = judged.not_judged.into_iter();
        results
            .chain(open.map(|each| (each.criterion, None)))
            .collect()
    };
    let (rms, skin) = ("max_tip_rms_mm", "min_clearance_mm.robot_phantom");
    // There is no engine, no budget and no table. The motion comes nearer than the posture.
    let missed = [(skin.to_owned(), Some(false)), (rms.to_owned(), None)];
    assert_eq!(keys(StudyMode::Dynamic, &made), missed);
    assert_eq!(first_missed_by_posture(&made, &criteria), None);
    made.posture_clearance_m.insert("robot_phantom", 0.055);
    assert_eq!(first_missed_by_posture(&made, &criteria), Some(skin));
    // A proven bound goes before the nearest approach.
    let found = made.clearance.classes.get_mut("robot_phantom").unwrap();
    (found.minimum_m, found.certified_lower_bound_m) = (0.07, Some(0.065));
    assert_eq!(
        keys(StudyMode::Dynamic, &made)[0],
        (skin.to_owned(), Some(true))
    );
    // Without engines the needle is judged where it is predicted.
    made.predicted = Some(NeedleMeasurement {
        tip_position_error_m: 2e-3,
        lateral_error_m: 2e-3,
        ..NeedleMeasurement::default()
    });
    let tip = "max_tip_position_error_mm";
    assert_eq!(first_missed_by_posture(&made, &criteria), Some(tip));
    assert_eq!(
        keys(StudyMode::Planned, &made)[0],
        (tip.to_owned(), Some(false))
    );
    assert_eq!(keys(StudyMode::Dynamic, &made)[1].0, rms);
}

/// Predicted alone, and simulated.
#[test]
fn a_limit_on_true_targets_says_nothing_of_goals_without_one() {
    let criteria = CriteriaSection {
        max_tip_position_error_mm: None,
        max_true_target_error_mm: Some(3.0),
        max_true_target_lateral_mm: Some(1.0),
        ..CriteriaSection::default()
    };
    let needle = NeedleMeasurement {
        true_target_error_m: Some(2e-3),
        true_target_lateral_m: Some(1.5e-3),
        ..NeedleMeasurement::default()
    };
    let judged = |needle: NeedleMeasurement, mode, engines: &[&str]| {
        let mut made = configuration(0, 0.05, 0.5);
        made.predicted = Some(needle);
        let judged = check_configuration("pose", &made, &criteria, mode, engines);
        let is_of_lesion = |key: &str| key.contains("true_target");
        let results = judged.results.into_iter();
        let results = results.map(|each| (each.criterion, Some(each.pass)));
        let open = judged.not_judged.into_iter();
        let open = open.map(|each| (each.criterion, None));
        let mut all: Vec<(String, Option<bool>)> = results.chain(open).collect();
        all.retain(|(key, _)| is_of_lesion(key));
        all
    };
    let (tip, lateral) = ("max_true_target_error_mm", "max_true_target_lateral_mm");
    assert_eq!(
        judged(needle, StudyMode::Planned, &[]),
        [
            (tip.to_owned(), Some(true)),
            (lateral.to_owned(), Some(false))
        ]
    );
    // What was to be simulated, and was not.
    assert_eq!(
        judged(needle, StudyMode::Dynamic, &["rapier"]),
        [(tip.to_owned(), None), (lateral.to_owned(), None)]
    );
    for (mode, engines) in [
        (StudyMode::Planned, [].as_slice()),
        (StudyMode::Dynamic, &["rapier"]),
    ] {
        assert_eq!(judged(NeedleMeasurement::default(), mode, engines), []);
    }
}

/// What the criteria on probabilities make of a lesion and a vessel with these estimates.
fn judged_probabilities(lesion: EventProbability, vessel: EventProbability) -> [Option<bool>; 2] {
    let mut found = configuration(0, 0.05, 0.5);
    found.probability = Some(probability_report(lesion, vessel));
    let mut criteria = CriteriaSection {
        min_lesion_probability: Some(0.9),
        ..CriteriaSection::default()
    };
    criteria.max_structure_probability.vessel = Some(1e-3);
    criteria.max_structure_probability.bone = Some(1e-3);
    let judged = check_configuration("g", &found, &criteria, StudyMode::Dynamic, &[]);
    let result = |key: &str| {
        let open = judged.not_judged.iter().any(|each| each.criterion == key);
        let result = judged.results.iter().find(|each| each.criterion == key);
        assert!(open != result.is_some(), "{key}");
        result.map(|each| each.pass)
    };
    // No bone is near: its bound says so.
    assert_eq!(result("max_structure_probability.bone"), Some(true));
    ["min_lesion_probability", "max_structure_probability.vessel"].map(result)
}

#[test]
fn probabilities_are_judged_by_their_intervals_and_bounds() {
    let lesion = |value, low, high| event(Some(value), [low, high], None);
    let vessel = |value, low, high, most| event(Some(value), [low, high], Some(most));
    let met = judged_probabilities(lesion(0.95, 0.94, 0.96), vessel(1e-4, 0.9e-4, 1.1e-4, 0.1));
    assert_eq!(met, [Some(true), Some(true)]);
    let missed = judged_probabilities(lesion(0.8, 0.79, 0.81), vessel(5e-3, 4e-3, 6e-3, 0.1));
    assert_eq!(missed, [Some(false), Some(false)]);
    // The limit is in the interval, on either side of the estimate: neither a pass nor a fail.
    let open = judged_probabilities(
        lesion(0.91, 0.89, 0.93),
        vessel(1.1e-3, 0.9e-3, 1.3e-3, 0.1),
    );
    assert_eq!(open, [None, None]);
    let open = judged_probabilities(
        lesion(0.89, 0.88, 0.91),
        vessel(0.9e-3, 0.8e-3, 1.1e-3, 0.1),
    );
    assert_eq!(open, [None, None]);
    // The bound decides what the interval does not.
    let bound = judged_probabilities(
        lesion(0.95, 0.94, 0.96),
        vessel(0.9e-3, 0.8e-3, 1.1e-3, 1e-3),
    );
    assert_eq!(bound, [Some(true), Some(true)]);
    // No draw hit: all that is known is an upper end.
    let none = event(None, [0.0, 3.7e-5], Some(0.1));
    let found = judged_probabilities(lesion(0.95, 0.94, 0.96), none);
    assert_eq!(found, [Some(true), Some(true)]);
    // The planned path does it already, and nothing was drawn.
    let at_plan = event(None, [0.0, 1.0], Some(1.0));
    let found = judged_probabilities(lesion(0.95, 0.94, 0.96), at_plan);
    assert_eq!(found, [Some(true), None]);
}
