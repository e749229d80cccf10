//! Planned and dynamic cases of a study: their numbers are those of a run, whatever ran before.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use needlebench_bench::study::{
    CaseRow, Likely, StaticWorker, StudyColumns, dynamic_case, dynamic_rows, planned_case,
    planned_rows,
};
use needlebench_bench::{RunOptions, run_scenario};
use needlebench_clearance::ClearanceModel;
use needlebench_engine::{
    Actuation, ENGINES, Engine, EnginePool, Hooks, RapierPlant, RapierSettings, Servo, ServoGains,
    choose_engines, simulate,
};
use needlebench_evaluation::metric::set_measured;
use needlebench_evaluation::probability::ProbabilityReport;
use needlebench_evaluation::report::{ConfigurationReport, GoalReport, Status};
use needlebench_evaluation::{certify_recording, measure_clearance, recorded_clearance};
use needlebench_kinematics::Joints;
use needlebench_planning::Planner;
use needlebench_scenario::study::StudyMode;
use needlebench_scenario::{Overrides, ResolvedScenario, load_scenario};
use needlebench_study::{Outcome, Row};
use tempfile::TempDir;

const SMALL: &str = include_str!("../../../needlebench/tests/cli/small.toml");

/// Both engines that run by default.
fn both() -> Vec<&'static dyn Engine> {
    choose_engines::<&str>(ENGINES, None).unwrap()
}

fn only(engine: &str) -> Vec<&'static dyn Engine> {
    choose_engines(ENGINES, Some(&[engine])).unwrap()
}

fn pool() -> EnginePool {
    EnginePool::new(ENGINES)
}

const IMPERFECT: &str = "
[imperfections]
budget_samples = 2
[imperfections.calibration]
class = \"nominal_kinematics\"
[imperfections.encoder]
[imperfections.payload]
[imperfections.friction]
[imperfections.registration]
[imperfections.breathing]
";

const EVENTS: &str = "
[events]
retreat = true
[events.stop]
category = 0
max_tip_distance_mm = 1
[[events.press]]
class = \"robot_gantry\"
depth_mm = 0.5
[gantry]
isocentre_mm = [1300, -598, 900]
";

/// The text as a scenario file.
fn resolved(text: &str) -> ResolvedScenario {
    let folder = TempDir::new().unwrap();
    let path: PathBuf = folder.path().join("s.toml");
    fs::write(&path, text).unwrap();
    load_scenario(&path, &Overrides::default()).unwrap()
}

/// The same with the patient elsewhere.
fn shifted() -> String {
    let edited = SMALL.replace("[155.0, -609.5, 0]", "[159.0, -602.0, 0]");
    assert_ne!(edited, SMALL);
    edited
}

fn of_run(scenario: &ResolvedScenario) -> GoalReport {
    let options = RunOptions {
        jobs: 2,
        ..RunOptions::default()
    };
    let run = run_scenario(scenario, &options).unwrap();
    assert_eq!(run.report.engine_failures, []);
    run.report.goals.into_iter().next().unwrap()
}

/// Columns of all kinds of cases.
fn columns() -> StudyColumns {
    let modes = [StudyMode::Static, StudyMode::Planned, StudyMode::Dynamic];
    StudyColumns::new(&modes, &["rapier", "mujoco"])
}

/// Every number of a row is the number of that name in the run's report, to the column's precision, and
/// the row lacks none that its columns could hold.
fn has_the_numbers_of(row: &Row, columns: &StudyColumns, report: &ConfigurationReport) -> usize {
    let mut shared = 0;
    for (index, key) in columns.keys().iter().enumerate() {
        let name = key.key();
        let Some(value) = row.get(index) else {
            continue;
        };
        let in_report = report.metrics.get(&*name);
        let in_report = in_report.unwrap_or_else(|| panic!("{name} is in no report"));
        #[expect(clippy::cast_possible_truncation, reason = "as columns are")]
        let expected = (in_report / key.metric().unit.si) as f32;
        assert_eq!(
            value.to_bits(),
            expected.to_bits(),
            "{} {name}",
            report.label
        );
        shared += 1;
    }
    shared
}

/// Rows that a run has to confirm, by how they were computed.
fn is_that_of_a_run(text: &str) -> ([CaseRow; 8], GoalReport) {
    let scenario = resolved(text);
    let report = of_run(&scenario);
    let rows = dynamic_rows(&scenario, &both(), &pool()).unwrap();
    let planned = planned_rows(&scenario).unwrap();
    let columns = columns();
    for (index, configuration) in report.configurations.iter().enumerate() {
        let label = configuration.label;
        let row = &rows[index];
        // Whatever a run measures, but for the room and probabilities, which nobody asked the case for, a dynamic
        // case measures too.
        let shared = has_the_numbers_of(&columns.row(index, row), &columns, configuration);
        let mut without_room = ConfigurationReport {
            room: None,
            probability: None,
            ..configuration.clone()
        };
        set_measured(&mut without_room);
        assert_eq!(shared, without_room.metrics.len(), "{label}");
        // A planned case shares what is not of the motion in the engines.
        let planned = columns.row(index, &planned[index]);
        let keys = columns.keys().iter().enumerate();
        for (column, key) in keys.filter(|(_, key)| !key.key().contains("_planned")) {
            let [of_planned, of_dynamic] =
                [&planned, &columns.row(index, row)].map(|row| row.get(column));
            if of_planned.is_some() {
                let bits = |value: Option<f32>| value.map(f32::to_bits);
                assert_eq!(bits(of_planned), bits(of_dynamic), "{label} {key:?}");
            }
        }
        let outcome = match configuration.status {
            Status::Ok => Outcome::Ok,
            Status::Failed => Outcome::Failed,
            Status::Rejected => Outcome::Rejected,
        };
        assert_eq!(row.outcome, outcome, "{label} {}", row.detail);
        assert_eq!(row.detail.is_empty(), outcome == Outcome::Ok, "{label}");
    }
    (rows, report)
}

/// A run's probabilities without the counts under larger errors, which no study has a column of.
fn as_in_studies(report: Option<&ProbabilityReport>) -> Option<ProbabilityReport> {
    let mut report = report?.clone();
    let lesion = report.in_lesion.iter_mut().map(|each| &mut each.event);
    let structures = report.structures.iter_mut().map(|each| &mut each.event);
    let others = [Some(&mut report.within_2_mm), report.any.as_mut()];
    for event in lesion.chain(structures).chain(others.into_iter().flatten()) {
        assert!(event.assumed_larger.take().is_some());
    }
    Some(report)
}

#[test]
fn a_criterion_on_a_probability_is_judged_in_a_case_as_in_a_run() {
    let text = SMALL.replace(
        "[criteria]",
        "[criteria]\nmax_structure_probability = { bone = 0.5 }",
    );
    assert_ne!(text, SMALL);
    let scenario = resolved(&text);
    let report = of_run(&scenario);
    let rows = dynamic_rows(&scenario, &both(), &pool()).unwrap();
    let known = report.configurations.iter().zip(&rows);
    let known = known.filter(|(configuration, row)| {
        let expected = as_in_studies(configuration.probability.as_ref());
        assert_eq!(expected, row.measured.probability);
        assert_eq!(
            configuration.status == Status::Ok,
            row.outcome == Outcome::Ok
        );
        configuration.probability.is_some()
    });
    assert!(known.count() > 0);
}

/// All numbers, and of a static case but for the draws that rounding counts otherwise.
#[test]
fn probabilities_that_a_study_asks_for_are_those_of_a_run() {
    let scenario = resolved(SMALL);
    let report = of_run(&scenario);
    let asked = Likely::AsReported;
    let simulated = dynamic_case(&scenario, &both(), &pool(), asked).unwrap();
    let planned = planned_case(&scenario, asked).unwrap();
    let fixed = StaticWorker::default().asking(asked).rows(&scenario);
    let mut told = 0;
    for (index, configuration) in report.configurations.iter().enumerate() {
        let expected = as_in_studies(configuration.probability.as_ref());
        assert_eq!(expected, simulated.rows[index].measured.probability);
        assert_eq!(expected, planned[index].measured.probability);
        let (Some(expected), Some(found)) = (&expected, &fixed[index].measured.probability) else {
            continue;
        };
        let names = |report: &ProbabilityReport| -> BTreeSet<String> {
            let structures = report.structures.iter();
            structures.map(|each| each.structure.clone()).collect()
        };
        assert_eq!(names(expected), names(found));
        told += 1;
    }
    assert!(told >= 4, "{told}");
}

#[test]
fn numbers_of_a_dynamic_case_are_those_of_a_run() {
    let (rows, _) = is_that_of_a_run(SMALL);
    let count = |outcome| rows.iter().filter(|row| row.outcome == outcome).count();
    assert_eq!((count(Outcome::Ok), count(Outcome::Rejected)), (6, 2));
    let rejected = rows.iter().find(|row| row.outcome == Outcome::Rejected);
    assert_eq!(rejected.unwrap().detail, "needle_corridor");
}

#[test]
fn numbers_of_an_imperfect_arm_are_those_of_a_run() {
    let (rows, _) = is_that_of_a_run(&format!("{SMALL}{IMPERFECT}"));
    // It misses by more than the millimetre that is allowed.
    let missed = |row: &&CaseRow| row.detail == "max_tip_position_error_mm";
    assert!(rows.iter().filter(missed).count() > 0, "{rows:?}");
}

#[test]
fn events_of_a_case_are_judged_as_those_of_a_run() {
    let (rows, _) = is_that_of_a_run(&format!("{SMALL}{EVENTS}"));
    let missed = |row: &&CaseRow| row.detail.starts_with("events.");
    assert!(rows.iter().filter(missed).count() > 0, "{rows:?}");
}

#[test]
fn rows_do_not_depend_on_what_ran_before_nor_on_the_process() {
    let (here, there) = (resolved(SMALL), resolved(&shifted()));
    let rows = |case: &ResolvedScenario, pool: &EnginePool| -> Vec<CaseRow> {
        dynamic_rows(case, &both(), pool).unwrap().into()
    };
    let served_by = |pool: &EnginePool| pool.process_id(only("mujoco")[0]);
    // One thread in this order, the other in that, each with a process of its own.
    let ([one, other, again], [other_first, one_last]) = std::thread::scope(|scope| {
        let reused = scope.spawn(|| {
            let pool = pool();
            let first = rows(&here, &pool);
            let served = served_by(&pool);
            let rest = [rows(&there, &pool), rows(&here, &pool)];
            assert!(served.is_some() && served == served_by(&pool));
            let [second, third] = rest;
            [first, second, third]
        });
        let swapped = scope.spawn(|| {
            let pool = pool();
            [rows(&there, &pool), rows(&here, &pool)]
        });
        (reused.join().unwrap(), swapped.join().unwrap())
    });
    assert_ne!(one, other);
    assert_eq!(one, again);
    assert_eq!(one, one_last);
    assert_eq!(other, other_first);
}

#[test]
fn process_that_died_is_replaced() {
    let case = resolved(SMALL);
    let (pool, mujoco) = (pool(), only("mujoco"));
    let before = dynamic_rows(&case, &mujoco, &pool).unwrap();
    let dead = pool.process_id(mujoco[0]).unwrap();
    let killed = Command::new("kill")
        .args(["-9", &dead.to_string()])
        .status();
    assert!(killed.unwrap().success());
    let after = dynamic_rows(&case, &mujoco, &pool).unwrap();
    assert_ne!(pool.process_id(mujoco[0]), Some(dead));
    assert_eq!(before, after);
}

#[test]
fn motion_that_an_engine_cannot_carry_out_is_not_judged_and_has_no_numbers() {
    let text =
        format!("{SMALL}[controller]\ndamping_nms_rad = [6000, 6000, 6000, 6000, 6000, 6000]\n");
    let case = resolved(&text);
    let rows = dynamic_rows(&case, &only("rapier"), &pool()).unwrap();
    for row in rows.iter().filter(|row| row.outcome != Outcome::Rejected) {
        assert_eq!(row.outcome, Outcome::NotJudged);
        assert_eq!(row.detail, "engine_failure rapier");
        assert_eq!(row.get("tip_error"), None);
        assert_eq!(row.get("peak_torque"), None);
        assert!(row.get("motion_time").is_some());
    }
}

/// Tracking errors of the nominal arm move no clearance by more.
const TRACKING_M: f64 = 0.2e-3;

#[test]
fn planned_rows_say_what_the_engines_will_confirm() {
    let case = resolved(SMALL);
    let planned = planned_rows(&case).unwrap();
    let dynamic = dynamic_rows(&case, &only("rapier"), &pool()).unwrap();
    for (planned, dynamic) in planned.iter().zip(&dynamic) {
        assert_eq!(planned.outcome, dynamic.outcome, "{}", planned.detail);
        assert_eq!(planned.detail, dynamic.detail);
        for key in ["q1", "surplus", "motion_time"] {
            assert!(planned.get(key).is_some());
            assert_eq!(planned.get(key), dynamic.get(key), "{key}");
        }
        assert!(planned.get("tip_error_predicted").unwrap() < 1e-9);
        let least = planned.get("clearance_planned_attained").unwrap();
        let seen = ["clearance_attained", "clearance_planned_attained"];
        let seen = seen.into_iter().find_map(|key| dynamic.get(key)).unwrap();
        assert!((least - seen).abs() < TRACKING_M, "{least} {seen}");
        assert!(planned.get("clearance_planned").unwrap() <= least);
    }
}

#[test]
fn scenario_of_several_goals_is_no_case() {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../scenarios/supine_suite.toml"
    );
    let whole = load_scenario(path.as_ref(), &Overrides::default()).unwrap();
    let message = planned_rows(&whole).unwrap_err();
    assert!(message.to_string().contains("has 4"), "{message}");
}

/// The distances' own error: the two ways place the solids in different frames. Seen: 2e-11 m.
const DISTANCE_M: f64 = 1e-9;

#[test]
fn least_over_a_recording_is_that_of_its_series_and_its_certificate() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/table3.toml");
    let resolved = load_scenario(&path, &Overrides::default()).unwrap();
    let (cell, model) = (&resolved.cell, ClearanceModel::new(&resolved.cell));
    let plan = Planner::new(&resolved, &model)
        .unwrap()
        .plan(&resolved.goals[0]);
    // Soft enough to sway and to come nearer than planned.
    let servo = Servo {
        dynamics: cell.dynamics(),
        gains: ServoGains {
            kp_nm_per_rad: [150.0; 6],
            kd_nms_per_rad: [1.0; 6],
        },
        effort_limit_nm: Joints::repeat(1e3),
    };
    let mut plant = RapierPlant::new(cell, 2e-3, &RapierSettings::default()).unwrap();
    let mut between = 0;
    for configuration in &plan.configurations[..3] {
        let trajectory = configuration.trajectory.as_ref().unwrap();
        let actuation = Actuation::default();
        let hooks = Hooks::default();
        let recording = simulate(&mut plant, &servo, &actuation, trajectory, hooks).unwrap();
        for (period_s, tolerance_m) in [(0.01, 1e-4), (0.1, 1e-2), (0.002, 1e-4)] {
            let mut series = measure_clearance(cell, &model, trajectory, &recording, period_s);
            let sampled = series.minima.clone();
            certify_recording(
                &mut series,
                cell,
                &model,
                trajectory,
                &recording,
                tolerance_m,
            );
            let found =
                recorded_clearance(cell, &model, trajectory, &recording, period_s, tolerance_m);
            assert!(found.keys().eq(series.minima.keys()));
            for (class, least) in &series.minima {
                let found = &found[class];
                let apart_m = (found.minimum_m - least.minimum_m).abs();
                assert!(apart_m < DISTANCE_M, "{class:?} {apart_m}");
                let bounds = [found, least].map(|each| each.certified_lower_bound_m.unwrap());
                assert!((bounds[0] - bounds[1]).abs() < DISTANCE_M);
                // The series alone undercuts what the certificate attains, or the other way.
                between += usize::from(sampled[class].minimum_m < least.minimum_m + 1e-15);
            }
        }
    }
    assert!(between > 5, "{between}");
}
