//! Static cases give the numbers of the commands that look at one posture at a time.

use std::path::{Path, PathBuf};

use needlebench_cell::ClearanceClass;
use needlebench_clearance::ClearanceModel;
use needlebench_evaluation::metric::MetricKey;
use needlebench_evaluation::report::ConfigurationReport;
use needlebench_input::Finding;
use needlebench_kinematics::ik::Configuration;
use needlebench_kinematics::trajectory::JointTrajectory;
use needlebench_parallel::in_parallel;
use needlebench_planning::{Planner, needle_route};
use needlebench_scenario::study::{
    Distribution, FactorValues, Role, SamplingMethod, StudyFactor, StudyMode, load_study,
};
use needlebench_scenario::{Change, KeyPath, Overrides, ResolvedScenario, ScenarioFamily, Setting};
use needlebench_study::{CaseEvaluator as _, CaseResult, Design, FactorValue, Outcome};

use super::robustness::{RESOLUTION, RobustnessSettings, robustness};
use super::{
    CaseRow, PreparedStudy, StaticWorker, StudyCase, StudyColumns, StudyEvaluator,
    rows_without_scenario, static_rows,
};
use crate::probability::probabilities;
use crate::real_cell::RealCell;
use crate::setup::Setup;

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

/// Names of the classes' clearances in a static case.
const CLASSES: [(ClearanceClass, &str); 9] = [
    (ClearanceClass::RobotPhantom, "arm_to_skin_static"),
    (ClearanceClass::RobotTable, "to_table_static"),
    (ClearanceClass::RobotGantry, "to_gantry_static"),
    (ClearanceClass::RobotMount, "to_mount_static"),
    (ClearanceClass::RobotObstacle, "to_obstacles_static"),
    (ClearanceClass::SelfCollision, "self_clearance_static"),
    (ClearanceClass::ToolPhantom, "tool_to_skin_static"),
    (ClearanceClass::GuideStandoff, "guide_to_skin_static"),
    (ClearanceClass::NeedleCorridor, "needle_corridor_static"),
];

/// What a row has to hold, worked out anew the long way.
fn agrees(resolved: &ResolvedScenario, row: &CaseRow, configuration: Configuration) {
    let model = ClearanceModel::new(&resolved.cell);
    let planner = Planner::new(resolved, &model).unwrap();
    let goal = &resolved.goals[0];
    let plan = planner.plan(goal);
    let planned = &plan.configurations[configuration.index()];
    let member = planner.posture(goal, configuration);
    assert_eq!(row.get("roll_static"), Some(member.roll_rad));
    let Some(candidate) = member.candidate else {
        assert_eq!(row.get("q1_static"), None);
        assert_eq!(row.outcome, Outcome::Rejected);
        let rule = row.detail.split(' ').next().unwrap();
        assert_eq!(rule, planned.rejections[0].rule.name());
        return;
    };
    let minima = model.minimum_per_class(&candidate.joints);
    for (class, key) in CLASSES {
        let found = minima.get(class);
        let distance_m = found.map(|pair| pair.separation.distance_m);
        assert_eq!(row.get(key), distance_m, "{class:?}");
    }
    let least_m = CLASSES[..5]
        .iter()
        .chain(&CLASSES[6..7])
        .filter_map(|(class, _)| minima.get(*class))
        .map(|pair| pair.separation.distance_m)
        .fold(f64::INFINITY, f64::min);
    assert_eq!(row.get("clearance_static"), Some(least_m));
    let placed = resolved.phantom.as_ref().unwrap();
    let route = needle_route(resolved, placed, goal);
    assert_eq!(
        row.get("needle_route"),
        route.map(|route| route.separation.distance_m)
    );
    assert_eq!(
        row.get("wrist_sine_static"),
        Some(candidate.margins.wrist_sine)
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
                assert_eq!(row, alone);
                assert_eq!(*row, worker.row(&resolved, configuration));
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

/// The two predictions set the arm up anew.
const ROUNDING_M: f64 = 1e-12;

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
    let real = RealCell::new(&resolved, &model).unwrap();
    let rows = static_rows(&resolved);
    let mut compared = 0;
    for configuration in Configuration::ALL {
        let member = planner.posture(&resolved.goals[0], configuration);
        let Some(candidate) = member.candidate else {
            continue;
        };
        let motion = JointTrajectory::starting_at(candidate.joints);
        let Some(predicted) = real.predicted(0, &motion) else {
            continue;
        };
        let error_m = (predicted.tip_m - real.goal(0).target_m).norm();
        let row = &rows[configuration.index()];
        let tip_m = row.get("tip_error_static").unwrap();
        assert!((tip_m - error_m).abs() < ROUNDING_M, "{tip_m} {error_m}");
        let [lateral, axial] =
            ["lateral_error_static", "depth_error_static"].map(|key| row.get(key).unwrap());
        // Across and along are not of the same axis, but milliradians apart.
        let both = libm::hypot(lateral, axial);
        assert!((both / tip_m - 1.0).abs() < 0.01);
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
    let standoff_mm = 1e3 * ok[index].get("guide_to_skin_static").unwrap();
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
    let findings = family.vary(goal, &changes).unwrap_err();
    let rows = rows_without_scenario(&findings, StudyMode::Static);
    for (index, row) in rows.iter().enumerate() {
        assert_eq!(row.measured.label, Configuration::ALL[index].label());
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
        "arm_to_skin_static",
        "tool_to_skin_static",
        "guide_to_skin_static",
    ]
    .map(|key| 1e3 * rows[index].get(key).unwrap_or(f64::INFINITY))
    .into_iter()
    .fold(f64::INFINITY, f64::min);
    let settings = RobustnessSettings {
        max_tilt_deg: 0.0,
        shift_directions: 12,
        points_per_axis: 6,
        ..RobustnessSettings::default()
    };
    let configuration = Configuration::ALL[index];
    let found = robustness(&family, "pose", &changes, configuration, &settings, None)
        .unwrap()
        .unwrap();
    let stays = found.unaware.unwrap().shift.found.unwrap();
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
    let roll_deg = free[index].get("roll_static").unwrap().to_degrees();
    let changes = [set("goal.roll_deg", roll_deg)];
    let settings = RobustnessSettings {
        max_shift_mm: 200.0,
        step_mm: 10.0,
        shift_directions: 6,
        tilt_directions: 4,
        max_tilt_deg: 5.0,
        points_per_axis: 4,
        ..RobustnessSettings::default()
    };
    let configuration = Configuration::ALL[index];
    let found = robustness(&family, goal, &changes, configuration, &settings, None)
        .unwrap()
        .unwrap();
    let again = robustness(&family, goal, &changes, configuration, &settings, None)
        .unwrap()
        .unwrap();
    assert_eq!(found, again);
    let shift = found.shift.found.expect("an arm does not reach everywhere");
    let outcome = |share: f64| {
        let mut moved = changes.to_vec();
        for (k, by) in shift.offset.iter().enumerate() {
            moved.push(add(&format!("phantom.position_mm[{k}]"), by * share));
        }
        let resolved = family.vary(goal, &moved);
        resolved.map(|resolved| StaticWorker::default().row(&resolved, configuration))
    };
    // A layout that exists.
    assert_eq!(outcome(1.0).unwrap().detail, shift.detail);
    assert_eq!(outcome(0.5).unwrap().outcome, Outcome::Ok);
    // The keys are the same case.
    let mut by_keys = changes.to_vec();
    by_keys.extend(shift.keys.iter().map(|(path, value)| set(path, *value)));
    if let (Ok(a), Ok(b)) = (family.vary(goal, &by_keys), outcome(1.0)) {
        let row = StaticWorker::default().row(&a, configuration);
        assert_eq!(row.detail, b.detail);
    }
}

/// Sobol points of the cube about a layout, moved by `radius` at most.
fn sobol_points_of_a_ball(radius: f64) -> Vec<[f64; 3]> {
    let factor = |name: &str| StudyFactor {
        name: name.to_owned(),
        unit: "mm".to_owned(),
        role: Role::Noise,
        sampled: true,
        values: FactorValues::Continuum {
            key: key("phantom.position_mm[0]"),
            relative: true,
            distribution: Distribution::Uniform {
                low: -radius,
                high: radius,
            },
        },
    };
    let factors = ["x", "y", "z"].map(factor);
    let goals = ["g".to_owned()];
    let design = Design::of(&goals, &factors, SamplingMethod::Sobol, Some(2048), 77).unwrap();
    let points = (0..design.cases()).map(|case| match design.values(case)[1..] {
        [
            FactorValue::Number(x),
            FactorValue::Number(y),
            FactorValue::Number(z),
        ] => [x, y, z],
        _ => unreachable!("three continua"),
    });
    let inside = |point: &[f64; 3]| point.iter().map(|x| x * x).sum::<f64>() < radius * radius;
    points.filter(inside).collect()
}

#[test]
fn sobol_points_of_the_ball_refute_no_radius() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/studies/chest.toml");
    let family = ScenarioFamily::load(&path, &Overrides::default()).unwrap();
    let settings = RobustnessSettings {
        max_shift_mm: 150.0,
        max_tilt_deg: 0.0,
        ..RobustnessSettings::default()
    };
    let goal = "left_upper_anterior";
    let mut looked_at = 0;
    for configuration in Configuration::ALL {
        let found = robustness(&family, goal, &[], configuration, &settings, None)
            .unwrap()
            .unwrap();
        let shift = found.shift;
        assert!(shift.settled);
        let Some(smallest) = shift.found.filter(|found| found.radius > 0.0) else {
            continue;
        };
        assert!(shift.points == settings.points_per_axis.pow(3) && shift.directions > 64);
        let mut worker = StaticWorker::default();
        // What is within the width of the bisection is the break itself.
        let points = sobol_points_of_a_ball(smallest.radius - RESOLUTION);
        assert!(points.len() > 1000);
        for point in points {
            let moves: Vec<_> = (0..3)
                .map(|axis| add(&format!("phantom.position_mm[{axis}]"), point[axis]))
                .collect();
            let Ok(resolved) = family.vary(goal, &moves) else {
                continue;
            };
            let row = worker.row(&resolved, configuration);
            let mut rolls = (0..360).map(|roll_deg| f64::from(roll_deg).to_radians());
            assert!(
                matches!(row.outcome, Outcome::Ok | Outcome::Invalid)
                    // Not at the roll that was chosen, but at another.
                    || rolls.any(|roll_rad| {
                        let row = worker.row_at(&resolved, configuration, roll_rad);
                        row.outcome == Outcome::Ok
                    }),
                "{}: {} at {point:?}, within {}",
                configuration.label(),
                row.detail,
                smallest.radius
            );
        }
        looked_at += 1;
        if looked_at == 2 {
            break;
        }
    }
    assert_eq!(looked_at, 2, "there are radii to refute");
}

#[test]
fn static_rows_have_static_columns_alone() {
    let family = family("table3");
    let rows = static_rows(&family.vary("pose", &[]).unwrap());
    let modes = [StudyMode::Static, StudyMode::Dynamic];
    let columns = StudyColumns::new(&modes, &["rapier"]);
    let described = columns.described();
    let place = |key: &str| described.iter().position(|each| each.key == key).unwrap();
    for (index, row) in rows.iter().enumerate() {
        let made = columns.row(index, row);
        for (column, key) in described.iter().zip(columns.keys()) {
            let of_static = key.is_measured_in(StudyMode::Static);
            let value = made.get(place(&column.key));
            assert!(of_static || value.is_none(), "{}", column.key);
        }
        assert!(made.get(place("clearance_static")).is_some());
        assert_eq!(made.get(place("clearance_attained")), None);
        // In the unit that the column's name says.
        let roll_deg = row.measured.roll_rad.unwrap().to_degrees();
        let column = f64::from(made.get(place("roll_static")).unwrap());
        assert!((column - roll_deg).abs() < 1e-5 * roll_deg.abs().max(1.0));
        assert_eq!(described[place("roll_static")].name, "roll_static_deg");
    }
}

/// A study of the paper's pose, with such a head and such imperfections.
fn prepared(head: &str, imperfections: &str) -> Result<PreparedStudy, Vec<Finding>> {
    let scenarios = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(scenarios.join("table3.toml")).unwrap();
    let scenario = format!("{text}\n[imperfections]\n{imperfections}");
    std::fs::write(folder.path().join("scenario.toml"), scenario).unwrap();
    let study = format!(
        "name = \"likely\"\nscenario = \"scenario.toml\"\n{head}\n[[factors]]\nname = \"height\"\n\
         key = \"robot.base_position_mm[2]\"\nvalues = [799, 800, 801]\n"
    );
    let file = folder.path().join("study.toml");
    std::fs::write(&file, study).unwrap();
    PreparedStudy::new(load_study(&file, &Overrides::default()).unwrap())
}

/// Nothing of it knows how joints came to rest.
const WITHOUT_FRICTION: &str = "[imperfections.calibration]\n[imperfections.hand_eye]\n\
                                translation_mm = 2.5\n[imperfections.guide]\n";

const PROBABILITIES: [&str; 4] = [
    "lesion_probability",
    "bone_probability",
    "vessel_probability",
    "organ_probability",
];

/// The rows of a case, and the keys of its columns.
fn evaluated(prepared: &PreparedStudy, case: u64) -> (Vec<String>, CaseResult) {
    let (study, design) = (&prepared.study, &prepared.design);
    let evaluator = StudyEvaluator::new(study, design, &prepared.columns);
    let result = evaluator.worker().evaluate(case).unwrap();
    let described = prepared.columns.described();
    (described.into_iter().map(|each| each.key).collect(), result)
}

/// The posture of this pose is that of its plan, and without friction the motion does not matter.
#[test]
fn probabilities_of_static_and_planned_cases_are_those_of_a_run() {
    let heads = ["static", "planned"];
    let heads = heads.map(|mode| format!("mode = \"{mode}\"\nprobabilities = true"));
    let [fixed, planned] = heads.map(|head| prepared(&head, WITHOUT_FRICTION).unwrap());
    let (_, of_static) = evaluated(&fixed, 1);
    let (keys, of_planned) = evaluated(&planned, 1);
    let static_keys = evaluated(&fixed, 1).0;
    // What a run does: all configurations of its plan.
    let layout = StudyCase::new(&planned.study, &planned.design, 1);
    let resolved = layout.scenario(&planned.study).unwrap();
    let model = ClearanceModel::new(&resolved.cell);
    let setup = Setup::new(&resolved, &model).unwrap();
    let plan = setup.planner.plan(&resolved.goals[0]);
    let of_run = probabilities(&setup, std::slice::from_ref(&plan), 2, false);
    let place = |keys: &[String], key: &str| keys.iter().position(|each| each == key).unwrap();
    let mut compared = 0;
    for (index, found) in of_run[0].iter().enumerate() {
        let Some(Ok(found)) = found else {
            continue;
        };
        let mut report = ConfigurationReport::new("");
        report.probability = Some(found.clone());
        for key in PROBABILITIES {
            let expected = MetricKey::named(key, &[]).unwrap().read(&report);
            let value = of_planned.rows[index].get(place(&keys, key));
            #[expect(clippy::cast_possible_truncation, reason = "as columns are")]
            let in_column = expected.map(|each| each as f32);
            assert_eq!(value, in_column, "{index} {key}");
            let row = &of_static.rows[index];
            let value = row.get(place(&static_keys, &format!("{key}_static")));
            if row.outcome == Outcome::Rejected {
                assert_eq!(value, None, "{index} {key}");
            } else {
                // By rounding a draw or two more are in or out.
                let [value, expected] = [value.unwrap().into(), expected.unwrap()];
                assert!(
                    (value - expected).abs() < 1e-3,
                    "{index} {key}: {value} {expected}"
                );
                compared += 1;
            }
        }
    }
    assert!(compared >= 16, "{compared}");
}

/// Columns are there where they are asked for alone, and nothing else changes with them.
#[test]
fn only_studies_that_ask_for_probabilities_have_columns_of_them() {
    let asked = prepared("mode = \"static\"\nprobabilities = true", WITHOUT_FRICTION).unwrap();
    let plain = prepared("mode = \"static\"", WITHOUT_FRICTION).unwrap();
    let (keys, with) = evaluated(&asked, 0);
    let (others, without) = evaluated(&plain, 0);
    let more: Vec<&str> = keys
        .iter()
        .filter(|key| !others.contains(key))
        .map(|key| key.trim_end_matches("_static"))
        .collect();
    assert_eq!(more, PROBABILITIES);
    let place = keys
        .iter()
        .position(|key| key == "lesion_probability_static");
    let told = with.rows.iter().filter_map(|row| row.get(place.unwrap()));
    assert!(told.count() > 0);
    for (with, without) in with.rows.iter().zip(&without.rows) {
        assert_eq!(
            (with.outcome, &with.detail),
            (without.outcome, &without.detail)
        );
        for (index, key) in others.iter().enumerate() {
            let place = keys.iter().position(|each| each == key).unwrap();
            assert_eq!(with.get(place), without.get(index), "{key}");
        }
    }
}

/// Whatever a worker evaluated before, and on however many threads.
#[test]
fn probabilities_depend_on_the_layout_alone() {
    let asked = prepared("mode = \"static\"\nprobabilities = true", WITHOUT_FRICTION).unwrap();
    let evaluator = StudyEvaluator::new(&asked.study, &asked.design, &asked.columns);
    let mut worker = evaluator.worker();
    let cases = [2, 0, 1];
    // What is missing is no number, which no number equals.
    let in_words = |result: CaseResult| format!("{:?}", result.rows);
    let in_turn = cases.map(|case| in_words(worker.evaluate(case).unwrap()));
    let at_once = in_parallel(2, &cases, |case| in_words(evaluated(&asked, *case).1));
    assert_eq!(in_turn.as_slice(), at_once);
}

#[test]
fn probabilities_of_a_perfect_arm_are_refused() {
    let findings = prepared("probabilities = true", "").unwrap_err();
    assert_eq!(findings[0].key.as_deref(), Some("probabilities"));
    assert!(
        findings[0].message.contains("does not define"),
        "{findings:?}"
    );
    prepared("", "").unwrap();
}
