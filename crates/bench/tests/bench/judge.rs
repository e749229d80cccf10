//! Motions from files, judged: a plan's own, one that leaves it between two points, one that goes on.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use needlebench_bench::judge::{JudgeError, JudgeOptions, JudgedRun, judge};
use needlebench_bench::{RunOptions, run_scenario};
use needlebench_cell::ClearanceClass;
use needlebench_clearance::ClearanceModel;
use needlebench_evaluation::report::{Status, Verdict};
use needlebench_kinematics::Joints;
use needlebench_kinematics::trajectory::{JointState, JointTrajectory};
use needlebench_parallel::Silent;
use needlebench_planning::ConfigurationPlan;
use needlebench_recorded::{Known, MotionFile, MotionSource};
use needlebench_scenario::scenario::EngineName;
use needlebench_scenario::{Overrides, ResolvedScenario, load_scenario};

/// Clearances of a plan and of the points that it is written as, m: what quintics between them are off.
const SAME_M: f64 = 1e-6;

fn options() -> RunOptions {
    RunOptions {
        engines: Some(vec![EngineName::from("rapier")]),
        ..RunOptions::default()
    }
}

/// The scenario of Table 3, and the plan that its run recommends.
fn planned() -> (ResolvedScenario, ConfigurationPlan) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/table3.toml");
    let resolved = load_scenario(&path, &Overrides::default()).unwrap();
    let run = run_scenario(&resolved, &options()).unwrap();
    let label = &run.report.goals[0].recommended.as_ref().unwrap().label;
    let plans = run.plans[0].configurations.iter();
    let mut plans = plans.filter(|plan| plan.configuration.label() == *label);
    (resolved, plans.next().unwrap().clone())
}

/// A motion by its points every 10 ms, and at the ends of its phases.
fn points(motion: &JointTrajectory) -> (Vec<f64>, Vec<JointState>) {
    let mut times_s: Vec<f64> = (0..100_000)
        .map(|k| 0.01 * f64::from(k))
        .take_while(|time_s| *time_s < motion.duration_s())
        .collect();
    times_s.extend(motion.phases().iter().map(|(_, _, end_s)| *end_s));
    times_s.sort_by(f64::total_cmp);
    times_s.dedup_by(|a, b| *a - *b < 1e-6);
    let states = times_s.iter().map(|time_s| motion.sample(*time_s));
    (times_s.clone(), states.collect())
}

fn file((times_s, states): (Vec<f64>, Vec<JointState>), known: Known) -> MotionFile {
    MotionFile {
        source: MotionSource {
            file: "motion.json".to_owned(),
            sha256: String::new(),
            format: "joint trajectory",
            points: states.len(),
        },
        times_s: Some(times_s),
        states,
        known,
        lines: Vec::new(),
        notes: Vec::new(),
    }
}

fn judged(
    resolved: &ResolvedScenario,
    file: &MotionFile,
    asked: &JudgeOptions,
) -> Result<JudgedRun, JudgeError> {
    judge(
        resolved,
        file,
        asked,
        &options(),
        &AtomicBool::new(false),
        &Silent,
    )
}

fn refused(resolved: &ResolvedScenario, file: &MotionFile) -> String {
    match judged(resolved, file, &JudgeOptions::default()) {
        Err(JudgeError::Refused(finding)) => finding.to_string(),
        other => panic!("{:?}", other.map(|done| done.run.report.verdict)),
    }
}

#[test]
fn a_plan_s_own_motion_has_its_clearances_its_configuration_and_its_verdict() {
    let (resolved, plan) = planned();
    let motion = plan.trajectory.as_ref().unwrap();
    let asked = JudgeOptions {
        beside: true,
        ..JudgeOptions::default()
    };
    let done = judged(
        &resolved,
        &file(points(motion), Known::Accelerations),
        &asked,
    )
    .unwrap();
    let report = &done.run.report;
    assert_ne!(report.verdict, Verdict::Fail, "{:?}", report.criteria);
    let [configuration] = report.goals[0].configurations.as_slice() else {
        panic!("one configuration is judged")
    };
    assert_eq!(configuration.label, plan.configuration.label());
    assert_eq!(configuration.status, Status::Ok);
    let hold = &report.judged.as_ref().unwrap().holds[0];
    assert!(hold.guide_off_m < 1e-9 && hold.angle_off_rad < 1e-9);
    let roll_rad = plan.candidate.as_ref().unwrap().roll_rad;
    assert!((hold.roll_rad - roll_rad).abs() < 1e-9);
    let given = done.run.plans[0].configurations[0]
        .certificate
        .as_ref()
        .unwrap();
    let known = plan.certificate.as_ref().unwrap();
    let mut compared = 0;
    for (class, found) in given.iter() {
        let known = known.get(class).unwrap();
        // Both are least clearances to the width of a certificate; where both are found at the same place, exact.
        let off_m = found.attained.separation.distance_m - known.attained.separation.distance_m;
        assert!(off_m.abs() < 1e-4 + SAME_M, "{class:?} {off_m}");
        assert!(found.width_m() < 1.1e-4, "{class:?} {}", found.width_m());
        compared += usize::from(off_m.abs() < SAME_M);
    }
    assert!(compared > 4, "{compared}");
    // The access zone is there while the guide is held, whoever moves it there.
    assert!(given.get(ClearanceClass::NeedleCorridor).is_some());
    let own = &hold.plans[0];
    assert_eq!(own.label, configuration.label);
    assert!(own.clearances.values().all(|each| each.lost_m().is_none()));
}

/// Two points whose cubic leaves them into the patient and comes back: every point of the file is free.
#[test]
fn what_happens_between_two_points_is_found() {
    const STEP_S: f64 = 0.5;
    let (resolved, plan) = planned();
    let motion = plan.trajectory.as_ref().unwrap();
    let (mut times_s, mut states) = points(motion);
    // While it holds, the shoulder dips and rises again.
    let held = motion.end();
    let begin_s = times_s[times_s.len() - 1];
    let dip = |speed: f64| JointState {
        velocity: Joints::new(0.0, speed, 0.0, 0.0, 0.0, 0.0),
        ..JointState::at_rest(held)
    };
    let model = ClearanceModel::new(&resolved.cell);
    let clearance_m = |q: &Joints| {
        let minima = model.minimum_per_class(q);
        let patient = [
            ClearanceClass::ToolPhantom,
            ClearanceClass::GuideStandoff,
            ClearanceClass::RobotPhantom,
        ];
        let all = patient.map(|class| minima.get(class).unwrap().separation.distance_m);
        all.into_iter().fold(f64::INFINITY, f64::min)
    };
    // The cubic with speeds +v and -v at both ends is `v u (1 - u) h` away: written down here by itself.
    let deepest_m = |speed: f64| {
        let all = (0..=4000).map(|k| {
            let u = f64::from(k) / 4000.0;
            let off = speed * u * (1.0 - u) * STEP_S;
            clearance_m(&(held + Joints::new(0.0, off, 0.0, 0.0, 0.0, 0.0)))
        });
        all.fold(f64::INFINITY, f64::min)
    };
    // Into the patient by a tenth of a millimetre or so, in the direction that leads there.
    let inwards = if deepest_m(0.02) < deepest_m(-0.02) {
        1.0
    } else {
        -1.0
    };
    let (mut free, mut hits) = (0.0, 1.0);
    for _ in 0..30 {
        let speed = 0.5 * (free + hits);
        if deepest_m(inwards * speed) < -3e-4 {
            hits = speed;
        } else {
            free = speed;
        }
    }
    let speed = inwards * hits;
    times_s.extend([begin_s + 0.3, begin_s + 0.3 + STEP_S, begin_s + 1.5]);
    states.extend([dip(speed), dip(-speed), JointState::at_rest(held)]);
    assert!(
        states
            .iter()
            .all(|state| clearance_m(&state.position) > 0.0)
    );
    let done = judged(
        &resolved,
        &file((times_s, states), Known::Velocities),
        &JudgeOptions::default(),
    );
    let report = done.unwrap().run.report;
    assert_eq!(report.verdict, Verdict::Fail);
    let configuration = &report.goals[0].configurations[0];
    let rule = &configuration.rejections[0];
    assert_eq!(rule.rule, "collision", "{rule:?}");
    let sampled_m = deepest_m(speed);
    assert!(
        rule.value <= sampled_m && sampled_m - rule.value < 1.1e-4,
        "{} {sampled_m}",
        rule.value
    );
}

#[test]
fn what_follows_the_hold_is_judged_too() {
    let (resolved, plan) = planned();
    let back = plan.retreat.clone().unwrap();
    let whole = plan.trajectory.clone().unwrap().followed_by(back);
    let file = file(points(&whole), Known::Accelerations);
    let done = judged(&resolved, &file, &JudgeOptions::default()).unwrap();
    let report = &done.run.report;
    let judged = report.judged.as_ref().unwrap();
    assert_eq!(judged.holds.len(), 1);
    assert!((judged.duration_s - whole.duration_s()).abs() < 1e-9);
    assert!(judged.holds[0].afterwards_m.contains_key("robot_phantom"));
    let after = report
        .criteria
        .iter()
        .filter(|each| each.detail.starts_with("after the hold"));
    assert!(after.clone().count() > 2 && after.clone().all(|each| each.pass));
}

#[test]
fn motions_that_begin_or_end_elsewhere_or_jump_are_refused_with_where() {
    let (resolved, plan) = planned();
    let motion = plan.trajectory.as_ref().unwrap();
    let (times_s, states) = points(motion);
    let from = |first: usize, last: usize| {
        let part = (times_s[first..last].to_vec(), states[first..last].to_vec());
        file(part, Known::Accelerations)
    };
    let whole = states.len();
    assert!(refused(&resolved, &from(60, whole)).contains("from the scenario's start posture"));
    let moved = JudgeOptions {
        any_start: true,
        ..JudgeOptions::default()
    };
    assert!(judged(&resolved, &from(60, whole), &moved).is_ok());
    let short = refused(&resolved, &from(0, 150));
    assert!(
        short.contains("stands at no goal: nearest to `pose`"),
        "{short}"
    );
    let named = JudgeOptions {
        goal: Some("pose".to_owned()),
        ..JudgeOptions::default()
    };
    let done = judged(&resolved, &from(0, 150), &named).unwrap();
    let hold = &done.run.report.judged.as_ref().unwrap().holds[0];
    assert!(hold.is_added && hold.guide_off_m > 0.02);
    // Judged all the same, and not passed.
    assert_eq!(done.run.report.verdict, Verdict::Fail);
    let off = done.run.report.criteria.iter();
    let off = off.clone().find(|each| each.criterion == "guide_position");
    assert!(off.is_some_and(|each| !each.pass && each.value > Some(20.0)));
    let mut jumps = from(0, whole);
    jumps.states[70].position[3] += 0.5;
    let jump = refused(&resolved, &jumps);
    assert!(
        jump.contains("point 71: wrist_1_joint jumps by 0.50"),
        "{jump}"
    );
}
