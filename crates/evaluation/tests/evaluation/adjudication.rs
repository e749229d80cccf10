//! Who is right and why, on recordings that were made up to differ in one known way.

use std::path::Path;

use needlebench_engine::{Contact, Cost, EngineIdentity, PlantState, Recording};
use needlebench_evaluation::adjudication::{
    Adjudication, Cause, Evidence, JudgedQuantity, PairConvergence, adjudicate, judge_differences,
    sentence,
};
use needlebench_evaluation::referee::{
    DOCUMENTED_ORDER, HeldTorques, RefereeComparison, RefereeReport, StepDifference, TipDifference,
    TipPath, steps_before_contact, tip_difference,
};
use needlebench_kinematics::Joints;
use needlebench_kinematics::trajectory::JointState;
use needlebench_scenario::envelope::EnvelopeSection;
use needlebench_scenario::{Overrides, ResolvedScenario, load_scenario};

const TIMESTEP_S: f64 = 1e-3;
const STEPS: u32 = 1000;
const LIMIT_NM: f64 = 12.0;

fn table3() -> ResolvedScenario {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/table3.toml");
    load_scenario(&path, &Overrides::default()).unwrap()
}

/// An arm that stands still but for `error(time)` at wrist 3, with `torque(time)` at all joints and
/// a contact of `force(time)`.
fn recording(
    resolved: &ResolvedScenario,
    name: &'static str,
    error_rad: impl Fn(f64) -> f64,
    torque_nm: impl Fn(f64) -> f64,
    force_n: impl Fn(f64) -> f64,
) -> Recording {
    let times: Vec<f64> = (0..=STEPS).map(|k| f64::from(k) * TIMESTEP_S).collect();
    let state = |time_s: f64| {
        let mut position = resolved.start;
        position[5] += error_rad(time_s);
        let force = force_n(time_s);
        PlantState {
            position,
            velocity: Joints::zeros(),
            world_from_flange: resolved.cell.robot.world_from_flange(&position),
            contact: Contact {
                count: u32::from(force > 0.0),
                deepest_penetration_m: 1e-6 * force,
                normal_force_n: force,
                pair: None,
            },
        }
    };
    Recording {
        engine: EngineIdentity {
            name,
            version: "1".into(),
            settings: Vec::new(),
        },
        timestep_s: TIMESTEP_S,
        velocity_age_s: 0.5 * TIMESTEP_S,
        state: times.iter().map(|time_s| state(*time_s)).collect(),
        reference: vec![JointState::at_rest(resolved.start); times.len()],
        torque_nm: times[1..]
            .iter()
            .map(|time_s| Joints::repeat(torque_nm(time_s - TIMESTEP_S)))
            .collect(),
        time_s: times,
        drive_nm: Vec::new(),
        saturated_steps: 0,
        saturation: Default::default(),
        cost: Cost::default(),
    }
}

fn still(resolved: &ResolvedScenario) -> Recording {
    recording(resolved, "rapier", |_| 0.0, |_| 6.0, |_| 0.0)
}

fn steps(peaks_m: [f64; 2]) -> Vec<StepDifference> {
    peaks_m
        .into_iter()
        .zip([1e-3, 5e-4])
        .map(|(peak_tip_m, timestep_s)| StepDifference {
            timestep_s,
            peak_tip_m,
        })
        .collect()
}

/// Distances from the referee under held torques. In closed loop the engines are as far from it as each other.
fn referee(rapier_m: f64, mujoco_m: f64) -> RefereeReport {
    let comparison = |peak_tip_m| RefereeComparison {
        until_s: 1.0,
        closed_loop: TipDifference::default(),
        held_torques: Some(HeldTorques {
            peak_tip_m,
            ..HeldTorques::default()
        }),
        convergence: Vec::new(),
        order: None,
        documented_order: DOCUMENTED_ORDER,
    };
    RefereeReport {
        engines: [
            ("rapier".to_owned(), comparison(rapier_m)),
            ("mujoco".to_owned(), comparison(mujoco_m)),
        ]
        .into(),
    }
}

fn judged(
    resolved: &ResolvedScenario,
    other: &Recording,
    convergence: &[StepDifference],
) -> Adjudication {
    let referee = referee(1e-6, 3e-6);
    let convergence = [PairConvergence {
        engines: ["rapier", "mujoco"],
        steps: convergence.to_vec(),
    }];
    adjudicate(
        &resolved.cell,
        &resolved.goals[0],
        &EnvelopeSection::default(),
        &Joints::repeat(LIMIT_NM),
        &[&still(resolved), other],
        Evidence {
            referee: Some(&referee),
            convergence: &convergence,
        },
    )
    .expect("there are two")
}

fn quantity<'a>(found: &'a Adjudication, key: &str) -> &'a JudgedQuantity {
    let key = format!("engines.envelope.{key}");
    let mut all = found.quantities.iter();
    all.find(|each| each.quantity == key).unwrap()
}

/// A bump that is over before the end.
fn bump(time_s: f64) -> f64 {
    if (0.3..0.5).contains(&time_s) {
        1e-3
    } else {
        0.0
    }
}

#[test]
fn equal_motions_are_inside_every_envelope() {
    let resolved = table3();
    let same = recording(&resolved, "mujoco", |_| 0.0, |_| 6.0, |_| 0.0);
    let found = judge_differences(
        &resolved.cell,
        &resolved.goals[0],
        &EnvelopeSection::default(),
        &[&still(&resolved), &same],
    )
    .unwrap();
    assert_eq!(found.quantities.len(), 3);
    assert!(!found.has_breach() && !found.needs_referee());
    assert!(found.quantities.iter().all(|each| each.value == 0.0));
    assert_eq!(found, judged(&resolved, &same, &[]));
}

#[test]
fn difference_that_shrinks_with_the_step_is_the_steps() {
    let resolved = table3();
    let other = recording(&resolved, "mujoco", bump, |_| 6.0, |_| 0.0);
    let found = judged(&resolved, &other, &steps([2e-6, 1e-6]));
    let peak = quantity(&found, "peak_tip_um");
    assert!(!peak.pass && quantity(&found, "settled_tip_nm").pass && found.needs_referee());
    let ruling = peak.ruling.as_ref().unwrap();
    assert!((ruling.first_time_s - 0.3).abs() < 1e-9);
    assert_eq!(ruling.nearer.as_deref(), Some("rapier"));
    assert_eq!(ruling.cause, Cause::StepTooLong);
    let words = sentence(peak).unwrap();
    assert!(
        words.contains("2.000 um at step 1.000 ms") && words.contains("order 1.00"),
        "{words}"
    );
}

#[test]
fn difference_that_stays_at_smaller_steps_is_the_models() {
    let resolved = table3();
    let other = recording(&resolved, "mujoco", bump, |_| 6.0, |_| 0.0);
    for convergence in [steps([2e-6, 2e-6]), Vec::new()] {
        let found = judged(&resolved, &other, &convergence);
        let ruling = quantity(&found, "peak_tip_um").ruling.as_ref().unwrap();
        assert_eq!(ruling.cause, Cause::ModelsDiffer);
    }
}

#[test]
fn torque_at_its_limit_goes_before_the_step() {
    let resolved = table3();
    let torque = |at_s: f64| move |time_s: f64| if time_s >= at_s { LIMIT_NM } else { 6.0 };
    let cause = |at_s: f64| {
        let other = recording(&resolved, "mujoco", bump, torque(at_s), |_| 0.0);
        let found = judged(&resolved, &other, &steps([2e-6, 1e-6]));
        quantity(&found, "peak_tip_um")
            .ruling
            .as_ref()
            .unwrap()
            .cause
    };
    assert_eq!(cause(0.2), Cause::Saturation);
    // What saturates later has not caused it.
    assert_eq!(cause(0.6), Cause::StepTooLong);
}

#[test]
fn torque_difference_names_its_joint() {
    let resolved = table3();
    let mut other = recording(&resolved, "mujoco", |_| 0.0, |_| 6.0, |_| 0.0);
    other.torque_nm[400][2] += 0.5;
    let found = judged(&resolved, &other, &steps([2e-6, 2e-6]));
    let torque = quantity(&found, "joint_torque_nm");
    assert_eq!(torque.joint, Some("elbow"));
    assert!((torque.value - 0.5).abs() < 1e-12 && (torque.time_s - 0.4).abs() < 1e-9);
}

#[test]
fn contact_is_judged_at_the_end_and_by_its_onset_and_depth() {
    let resolved = table3();
    let touching =
        |from_s: f64, force: f64| move |time_s: f64| if time_s >= from_s { force } else { 0.0 };
    let one = recording(&resolved, "rapier", |_| 0.0, |_| 6.0, touching(0.5, 100.0));
    let cause = |from_s: f64| {
        let other = recording(
            &resolved,
            "mujoco",
            |_| 0.0,
            |_| 6.0,
            touching(from_s, 90.0),
        );
        let found = adjudicate(
            &resolved.cell,
            &resolved.goals[0],
            &EnvelopeSection::default(),
            &Joints::repeat(LIMIT_NM),
            &[&one, &other],
            Evidence::default(),
        )
        .unwrap();
        assert!(found.has_breach() && !found.needs_referee());
        assert!(quantity(&found, "contact_tip_um").pass);
        let force = quantity(&found, "contact_force_relative");
        assert!((force.value - 0.1).abs() < 1e-12);
        let ruling = force.ruling.as_ref().unwrap();
        assert_eq!(ruling.nearer, None);
        ruling.cause
    };
    assert_eq!(cause(0.5), Cause::ContactSoftness);
    assert_eq!(cause(0.6), Cause::ContactOnset);
    // Beyond the end: the other engine never touches, and the forces are not comparable.
    assert_eq!(steps_before_contact(&one), 499);
}

#[test]
fn tips_are_compared_as_far_as_both_go() {
    let resolved = table3();
    let other = recording(&resolved, "mujoco", bump, |_| 6.0, |_| 0.0);
    let still = still(&resolved);
    let (cell, goal) = (&resolved.cell, &resolved.goals[0]);
    let [still, moved] = [&still, &other].map(|each| TipPath::of(cell, goal, each));
    let steps = still.steps_before_contact;
    assert_eq!(steps + 1, other.state.len());
    let whole = tip_difference(&still, &moved, steps);
    assert_eq!(whole.settled_tip_m, Some(0.0));
    assert!((whole.peak_time_s - 0.3).abs() < 1e-9 && whole.peak_tip_m > 1e-5);
    let part = tip_difference(&still, &moved, 199);
    assert_eq!((part.peak_tip_m, part.settled_tip_m), (0.0, None));
    let early = TipPath::of_states(cell, goal, TIMESTEP_S, &other.state[..200]);
    assert_eq!(tip_difference(&still, &early, steps), part);
}

#[test]
fn of_three_engines_the_pair_that_differs_most_is_judged() {
    let resolved = table3();
    let small = |time_s: f64| 0.01 * bump(time_s);
    let first = still(&resolved);
    let second = recording(&resolved, "mujoco", small, |_| 6.0, |_| 0.0);
    let third = recording(&resolved, "third", bump, |_| 6.5, |_| 0.0);
    let (cell, goal) = (&resolved.cell, &resolved.goals[0]);
    let envelope = EnvelopeSection::default();
    let judge = |runs: &[&Recording]| judge_differences(cell, goal, &envelope, runs);
    assert_eq!(judge(&[&first]), None);
    let found = judge(&[&first, &second, &third]).unwrap();
    let peak = quantity(&found, "peak_tip_um");
    assert_eq!(peak.engines, Some(["rapier", "third"]));
    // It is what the two differ by alone, where nobody need be told which they are.
    let alone = judge(&[&first, &third]).unwrap();
    let of_pair = quantity(&alone, "peak_tip_um");
    assert_eq!((of_pair.value, of_pair.engines), (peak.value, None));
    // The order of convergence is looked up for that pair, and the judge is asked about no other engine.
    let convergence = |engines, peaks_m| PairConvergence {
        engines,
        steps: steps(peaks_m),
    };
    let convergence = [
        convergence(["rapier", "mujoco"], [2e-6, 2e-6]),
        convergence(["rapier", "third"], [2e-6, 1e-6]),
    ];
    let mut referee = referee(2e-6, 1e-6);
    let mut of_third = referee.engines["rapier"].clone();
    of_third.held_torques.as_mut().unwrap().peak_tip_m = 5e-6;
    referee.engines.insert("third".to_owned(), of_third);
    let evidence = Evidence {
        referee: Some(&referee),
        convergence: &convergence,
    };
    let limits = Joints::repeat(LIMIT_NM);
    let runs = [&first, &second, &third];
    let ruled = adjudicate(cell, goal, &envelope, &limits, &runs, evidence).unwrap();
    let peak = quantity(&ruled, "peak_tip_um");
    let ruling = peak.ruling.as_ref().unwrap();
    assert_eq!(ruling.cause, Cause::StepTooLong);
    assert_eq!(ruling.nearer.as_deref(), Some("rapier"));
    let words = sentence(peak).unwrap();
    assert!(words.starts_with("rapier and third differ"), "{words}");
}
