//! Static cases give the numbers of the commands that look at one posture at a time.

use std::path::{Path, PathBuf};

use needlebench_cell::{
    Change, ClearanceClass, KeyPath, Overrides, ResolvedScenario, ScenarioFamily, Setting,
};
use needlebench_clearance::ClearanceModel;
use needlebench_evaluation::needle_route;
use needlebench_kinematics::ik::Configuration;
use needlebench_kinematics::trajectory::JointTrajectory;
use needlebench_planning::Planner;
use needlebench_study::{Metric, Outcome, Row};

use super::robustness::{RobustnessSettings, robustness};
use super::{StaticWorker, invalid_rows, static_rows};
use crate::reality::Reality;

fn family(name: &str) -> ScenarioFamily {
    let path: PathBuf =
        Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../scenarios/{name}.toml"));
    ScenarioFamily::load(&path, &Overrides::default()).unwrap()
}

fn key(path: &str) -> KeyPath {
    KeyPath::parse(path).unwrap()
}

fn set(path: &str, setting: impl Into<Setting>) -> (KeyPath, Change) {
    (key(path), Change::Set(setting.into()))
}

fn add(path: &str, by: f64) -> (KeyPath, Change) {
    (key(path), Change::Add(by))
}

/// As a row holds it.
#[expect(clippy::cast_possible_truncation, reason = "what rows do")]
fn as_column(value: f64) -> f32 {
    value as f32
}

const CLASSES: [(ClearanceClass, Metric); 8] = [
    (ClearanceClass::RobotPhantom, Metric::RobotPhantom),
    (ClearanceClass::RobotTable, Metric::RobotTable),
    (ClearanceClass::RobotGantry, Metric::RobotGantry),
    (ClearanceClass::RobotMount, Metric::RobotMount),
    (ClearanceClass::SelfCollision, Metric::SelfClearance),
    (ClearanceClass::ToolPhantom, Metric::ToolPhantom),
    (ClearanceClass::GuideStandoff, Metric::GuideStandoff),
    (ClearanceClass::NeedleCorridor, Metric::NeedleCorridor),
];

/// What a row has to hold, worked out anew the long way.
fn agrees(resolved: &ResolvedScenario, row: &Row, configuration: Configuration) {
    let model = ClearanceModel::new(&resolved.cell);
    let planner = Planner::new(resolved, &model).unwrap();
    let goal = &resolved.goals[0];
    let plan = planner.plan(goal);
    let planned = &plan.configurations[configuration.index()];
    let roll_deg = row.get(Metric::Roll).unwrap();
    let member = planner.posture(goal, configuration);
    assert_eq!(as_column(member.roll_rad.to_degrees()), roll_deg);
    let Some(candidate) = member.candidate else {
        assert_eq!(row.get(Metric::Joint1), None);
        assert_eq!(row.outcome, Outcome::Rejected);
        let rule = row.detail.split(' ').next().unwrap();
        assert_eq!(rule, planned.rejections[0].rule.name());
        return;
    };
    let minima = model.minimum_per_class(&candidate.joints);
    for (class, metric) in CLASSES {
        let found = minima.get(class);
        assert_eq!(
            row.get(metric),
            found.map(|pair| as_column(pair.separation.distance_m * 1e3)),
            "{class:?}"
        );
    }
    let least_m = CLASSES[..4]
        .iter()
        .chain(&CLASSES[5..6])
        .filter_map(|(class, _)| minima.get(*class))
        .map(|pair| pair.separation.distance_m)
        .fold(f64::INFINITY, f64::min);
    assert_eq!(row.get(Metric::Clearance), Some(as_column(least_m * 1e3)));
    let placed = resolved.phantom.as_ref().unwrap();
    let route = needle_route(&resolved.cell, placed, goal);
    assert_eq!(
        row.get(Metric::NeedleRoute),
        route.map(|route| as_column(route.minimum_m * 1e3))
    );
    assert_eq!(
        row.get(Metric::WristSine),
        Some(as_column(candidate.margins.wrist_sine))
    );
    // What rejects the posture rejects the plan, unless a motion does; what works is tried first.
    match member.rejections.first() {
        Some(rejection) => {
            assert_eq!(row.outcome, Outcome::Rejected);
            assert!(row.detail.starts_with(rejection.rule.name()));
            assert!(!planned.rejections.is_empty());
        }
        None => assert!(matches!(row.outcome, Outcome::Ok | Outcome::Failed)),
    }
}

#[test]
fn rows_of_moved_layouts_are_those_of_each_layout_alone() {
    for (name, roll) in [("table3", None), ("supine_suite", Some(90.0))] {
        let family = family(name);
        let goal = family.goals().next().unwrap().to_owned();
        let mut worker = StaticWorker::default();
        for k in 0..6 {
            let by = f64::from(k) * 3.5 - 9.0;
            let mut changes = vec![
                add("phantom.position_mm[0]", by),
                add("robot.base_position_mm[1]", -0.5 * by),
            ];
            if k % 3 == 2 {
                changes.push(set("phantom.breadth_mm", 312.0 + by));
                changes.push(set("tool.urdf", "inline"));
            }
            changes.extend(roll.map(|deg| set("goal.roll_deg", deg)));
            let Ok(resolved) = family.vary(&goal, &changes) else {
                continue;
            };
            let rows = worker.rows(&resolved);
            let alone = static_rows(&resolved);
            for ((row, alone), configuration) in rows.iter().zip(&alone).zip(Configuration::ALL) {
                // NaN is not equal to itself.
                let bits = |row: &Row| row.metrics.map(f32::to_bits);
                assert_eq!(bits(row), bits(alone));
                assert_eq!((row.outcome, &row.detail), (alone.outcome, &alone.detail));
                let one = worker.row(&resolved, configuration);
                assert_eq!((bits(&one), &one.detail), (bits(row), &row.detail));
                if k == 1 {
                    agrees(&resolved, row, configuration);
                }
            }
        }
    }
}

#[test]
fn a_free_roll_is_the_one_that_a_plan_tries_first() {
    let family = family("supine_suite");
    let changes = [
        set("planning.roll_samples", 8.0),
        // No motions are searched for in this test's plans.
        set("planning.motion_checks", 0.0),
    ];
    let resolved = family.vary("right_pleural_lateral", &changes).unwrap();
    let model = ClearanceModel::new(&resolved.cell);
    let planner = Planner::new(&resolved, &model).unwrap();
    let plan = planner.plan(&resolved.goals[0]);
    let rows = static_rows(&resolved);
    let mut working = 0;
    for (row, planned) in rows.iter().zip(&plan.configurations) {
        if !planned.rejections.is_empty() {
            continue;
        }
        working += 1;
        assert_ne!(row.outcome, Outcome::Rejected);
    }
    assert!(working > 0, "there is something to compare");
    for configuration in Configuration::ALL {
        agrees(&resolved, &rows[configuration.index()], configuration);
    }
}

#[test]
fn a_settled_tip_without_friction_is_that_of_a_run() {
    let family = family("imperfect");
    let goal = family.goals().next().unwrap().to_owned();
    let resolved = {
        let mut resolved = family.vary(&goal, &[]).unwrap();
        let imperfections = resolved.imperfections.as_mut().unwrap();
        imperfections.friction = None;
        resolved
    };
    let model = ClearanceModel::new(&resolved.cell);
    let planner = Planner::new(&resolved, &model).unwrap();
    let reality = Reality::new(&resolved, &model).unwrap();
    let rows = static_rows(&resolved);
    let mut compared = 0;
    for configuration in Configuration::ALL {
        let member = planner.posture(&resolved.goals[0], configuration);
        let Some(candidate) = member.candidate else {
            continue;
        };
        let motion = JointTrajectory::starting_at(candidate.joints);
        let Some(tip) = reality.predicted_tip(0, &motion) else {
            continue;
        };
        let error_m = (tip - reality.goal(0).target_m).norm();
        let row = &rows[configuration.index()];
        assert_eq!(row.get(Metric::TipError), Some(as_column(error_m * 1e3)));
        let [lateral, axial] = [Metric::TipLateral, Metric::TipAxial].map(|m| row.get(m).unwrap());
        // Across and along are not of the same axis, but milliradians apart.
        let both = lateral.hypot(axial);
        assert!((both / row.get(Metric::TipError).unwrap() - 1.0).abs() < 0.01);
        compared += 1;
    }
    assert!(compared > 0);
}

#[test]
fn a_missed_criterion_has_its_name() {
    let family = family("table3");
    let rows = |changes: &[(KeyPath, Change)]| static_rows(&family.vary("pose", changes).unwrap());
    let ok = rows(&[]);
    let index = ok
        .iter()
        .position(|row| row.outcome == Outcome::Ok)
        .unwrap();
    let standoff_mm = f64::from(ok[index].get(Metric::GuideStandoff).unwrap());
    let path = "criteria.min_clearance_mm.guide_standoff";
    let missed = &rows(&[set(path, standoff_mm + 0.5)])[index];
    assert_eq!(missed.outcome, Outcome::Failed);
    assert_eq!(missed.detail, "min_clearance_mm.guide_standoff");
    let met = &rows(&[set(path, standoff_mm - 0.5)])[index];
    assert_eq!(met.outcome, Outcome::Ok);
}

#[test]
fn a_layout_that_cannot_exist_names_its_key() {
    let family = family("supine_suite");
    let goal = family.goals().next().unwrap();
    let changes = [set("phantom.position_mm[1]", 900.0)];
    let rows = invalid_rows(&family.vary(goal, &changes).unwrap_err());
    for (index, row) in rows.iter().enumerate() {
        assert_eq!(usize::from(row.configuration), index);
        assert_eq!(row.outcome, Outcome::Invalid);
        assert_eq!(row.detail, "phantom.position_mm");
    }
}

/// Width of a break's bisection, and what the last turn of the direction leaves at 20 mm.
const RADIUS_TOLERANCE_MM: f64 = 0.02;

#[test]
fn an_arm_that_stays_is_met_after_its_clearance() {
    let family = family("table3");
    let changes = [
        set("criteria.min_clearance_mm.guide_standoff", 0.0),
        set("criteria.min_clearance_mm.tool_phantom", 0.0),
        set("criteria.min_clearance_mm.robot_phantom", 0.0),
    ];
    let resolved = family.vary("pose", &changes).unwrap();
    let rows = static_rows(&resolved);
    let index = rows
        .iter()
        .position(|row| row.outcome == Outcome::Ok)
        .unwrap();
    // Both bodies are convex, so a shift along the shortest way between them uses it up, and no
    // other shift does so sooner.
    let least_mm = [
        Metric::RobotPhantom,
        Metric::ToolPhantom,
        Metric::GuideStandoff,
    ]
    .map(|metric| f64::from(rows[index].get(metric).unwrap_or(f32::INFINITY)))
    .into_iter()
    .fold(f64::INFINITY, f64::min);
    let settings = RobustnessSettings {
        max_tilt_deg: 0.0,
        shift_directions: 12,
        ..RobustnessSettings::default()
    };
    let configuration = Configuration::ALL[index];
    let found = robustness(&family, "pose", &changes, configuration, &settings).unwrap();
    let stays = found.unaware.unwrap().shift.unwrap();
    assert!(
        (stays.radius - least_mm).abs() < RADIUS_TOLERANCE_MM,
        "{} and {least_mm}",
        stays.radius
    );
}

#[test]
fn the_breaking_case_breaks_and_half_of_it_does_not() {
    let family = family("supine_suite");
    let goal = "right_pleural_lateral";
    let free = static_rows(
        &family
            .vary(goal, &[set("planning.roll_samples", 8.0)])
            .unwrap(),
    );
    let index = free
        .iter()
        .position(|row| row.outcome == Outcome::Ok)
        .unwrap();
    let roll_deg = f64::from(free[index].get(Metric::Roll).unwrap());
    let changes = [set("goal.roll_deg", roll_deg)];
    let settings = RobustnessSettings {
        max_shift_mm: 200.0,
        step_mm: 10.0,
        shift_directions: 6,
        tilt_directions: 4,
        max_tilt_deg: 5.0,
        ..RobustnessSettings::default()
    };
    let configuration = Configuration::ALL[index];
    let found = robustness(&family, goal, &changes, configuration, &settings).unwrap();
    let again = robustness(&family, goal, &changes, configuration, &settings).unwrap();
    assert_eq!(found, again);
    let shift = found.shift.expect("an arm does not reach everywhere");
    let outcome = |share: f64| {
        let mut moved = changes.to_vec();
        for (k, by) in shift.offset.iter().enumerate() {
            moved.push(add(&format!("phantom.position_mm[{k}]"), by * share));
        }
        let resolved = family.vary(goal, &moved);
        resolved.map(|resolved| StaticWorker::default().row(&resolved, configuration))
    };
    match outcome(1.0) {
        Ok(row) => assert_eq!(row.detail, shift.detail),
        Err(findings) => assert_eq!(findings[0].key.as_deref(), Some(shift.detail.as_str())),
    }
    assert_eq!(outcome(0.5).unwrap().outcome, Outcome::Ok);
    // The keys are the same case.
    let mut by_keys = changes.to_vec();
    by_keys.extend(shift.keys.iter().map(|(path, value)| set(path, *value)));
    if let (Ok(a), Ok(b)) = (family.vary(goal, &by_keys), outcome(1.0)) {
        let row = StaticWorker::default().row(&a, configuration);
        assert_eq!(row.detail, b.detail);
    }
}
