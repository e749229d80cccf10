//! Verdicts on made-up measurements.

use std::collections::BTreeMap;
use std::path::Path;

use needlebench_cell::scenario::CriteriaSection;
use needlebench_cell::{Expectation, Goal, Overrides, load_scenario};
use needlebench_evaluation::judge;
use needlebench_evaluation::report::{
    ClassClearance, ClearanceReport, ConfigurationReport, GoalReport, MarginsReport,
    RejectionReport, Status, Verdict,
};
use needlebench_kinematics::ik::Configuration;

/// Configuration `index` with a least clearance to the skin and a joint margin, not yet judged.
fn configuration(index: usize, clearance_m: f64, margin: f64) -> ConfigurationReport {
    let found = ClassClearance {
        minimum_m: clearance_m,
        certified_lower_bound_m: None,
        pair: ["forearm.2".into(), "skin".into()],
        witness_points_m: [[0.0; 3], [clearance_m, 0.0, 0.0]],
        phase: "transfer",
        time_s: Some(1.0),
        engine: Some("rapier".into()),
    };
    ConfigurationReport {
        label: Configuration::ALL[index].label(),
        status: Status::Ok,
        rejections: Vec::new(),
        joints_rad: Some([0.0; 6]),
        roll_rad: Some(0.0),
        wrap: Some([0; 6]),
        ik_residual_m: Some(0.0),
        ik_residual_rad: Some(0.0),
        free_joint: None,
        margins: Some(MarginsReport {
            joint_limit: margin,
            wrist_sine: 1.0,
            elbow_sine: 1.0,
            shoulder_m: 0.3,
            manipulability_m3: 0.01,
        }),
        motion: Vec::new(),
        retreat: Vec::new(),
        search: None,
        commanded: None,
        engines: BTreeMap::new(),
        engine_difference: None,
        adjudication: None,
        referee: None,
        clearance: ClearanceReport {
            classes: BTreeMap::from([("robot_phantom", found)]),
            minimum_m: Some(clearance_m),
            minimum_certified_m: None,
        },
        room: None,
        tip_sensitivity_m_per_rad: None,
        pareto: false,
        dominated_by: None,
        ranking: None,
        events: None,
        budget: None,
        budget_failure: None,
        files: Vec::new(),
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
        axis: [0.0, 0.0, 1.0],
        insertion_length_m: 0.1,
        standoff_m: None,
        configurations,
        recommended: None,
        ranking: None,
    }]
}

#[test]
fn a_configuration_that_no_engine_measured_has_failed() {
    let mut goals = report(vec![configuration(0, 0.05, 0.5)]);
    let (verdict, _) = judge(&mut goals, &[goal()], &CriteriaSection::default(), false);
    assert_eq!(verdict, Verdict::Fail);
    assert_eq!(goals[0].configurations[0].status, Status::Failed);
}

#[test]
fn rejections_alone_do_not_fail_a_goal_that_asks_for_no_configuration() {
    let mut goals = report((0..8).map(rejected).collect());
    let criteria = CriteriaSection {
        min_working_configurations: 0,
        ..Default::default()
    };
    let (verdict, results) = judge(&mut goals, &[goal()], &criteria, true);
    assert_eq!(verdict, Verdict::Pass);
    assert!(results.iter().all(|result| result.pass));
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
    let (verdict, results) = judge(&mut goals, &[expecting], &criteria, true);
    assert_eq!(verdict, Verdict::Fail);
    let missed = results
        .iter()
        .find(|result| result.criterion == "expected")
        .unwrap();
    assert!(
        !missed.pass && missed.detail.contains("got collision"),
        "{}",
        missed.detail
    );
}
