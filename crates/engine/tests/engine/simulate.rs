//! The run loop, on rapier.

use std::sync::atomic::{AtomicBool, Ordering};

use needlebench_engine::{
    Actuation, EngineError, Hooks, Keep, Motion, RapierPlant, RapierSettings, Recording, Servo,
    ServoGains, simulate, simulate_motion,
};
use needlebench_kinematics::Joints;
use needlebench_kinematics::trajectory::{JointTrajectory, MotionLimits, Phase, ProfileLimits};

const TIMESTEP_S: f64 = 1e-3;
const START: Joints = Joints::new(0.2, -1.6, 1.5, -1.2, -1.4, 0.3);

fn trajectory() -> JointTrajectory {
    let limits = MotionLimits {
        velocity: Joints::repeat(1.0),
        acceleration: Joints::repeat(2.0),
        jerk: Joints::repeat(20.0),
        line: ProfileLimits {
            velocity: 0.1,
            acceleration: 0.5,
            jerk: 5.0,
        },
    };
    JointTrajectory::starting_at(START)
        .then_straight_to(Phase::Transfer, START.add_scalar(0.2), &limits)
        .then_hold(Phase::Hold, 0.3)
}

fn servo() -> Servo {
    let cell = crate::common::ur3(Vec::new());
    Servo {
        dynamics: cell.dynamics(),
        gains: ServoGains::default(),
        effort_limit_nm: cell.robot.limits.efforts_nm(),
    }
}

fn run(servo: &Servo, timestep_s: f64, hooks: Hooks<'_>) -> Result<Recording, EngineError> {
    let cell = crate::common::ur3(Vec::new());
    let mut plant = RapierPlant::new(&cell, timestep_s, &RapierSettings::default())?;
    simulate(
        &mut plant,
        servo,
        &Actuation::default(),
        &trajectory(),
        hooks,
    )
}

/// What is kept of a motion is what the whole recording has at those times; nothing else changes.
#[test]
fn states_near_given_times_are_those_of_the_whole_recording() {
    let whole = run(&servo(), TIMESTEP_S, Hooks::default()).unwrap();
    let end_s = whole.time_s[whole.steps()];
    // Off the steps, at them, twice within one, and after the end.
    let times_s = [0.0, 0.010_3, 0.010_4, 0.5, end_s - 0.000_2, end_s + 1.0];
    let cell = crate::common::ur3(Vec::new());
    let mut plant = RapierPlant::new(&cell, TIMESTEP_S, &RapierSettings::default()).unwrap();
    let (servo, trajectory) = (servo(), trajectory());
    let motion = Motion {
        servo: &servo,
        actuation: &Actuation::default(),
        trajectory: &trajectory,
        braking: None,
        keep: Keep::Near(&times_s),
    };
    let kept = simulate_motion(&mut plant, &motion, Hooks::default()).unwrap();
    let wanted = [0, 10, 500, whole.steps()];
    assert_eq!(kept.time_s, wanted.map(|step| whole.time_s[step]));
    assert_eq!(kept.state, wanted.map(|step| whole.state[step]));
    assert_eq!(kept.reference, wanted.map(|step| whole.reference[step]));
    // After the last state there is no torque.
    let torques: Vec<Joints> = wanted[..3]
        .iter()
        .map(|step| whole.torque_nm[*step])
        .collect();
    assert_eq!(kept.torque_nm, torques);
    assert_eq!(kept.saturated_steps, whole.saturated_steps);
}

#[test]
fn recording_covers_the_trajectory() {
    let recording = run(&servo(), TIMESTEP_S, Hooks::default()).unwrap();
    let steps = recording.steps();
    assert_eq!(
        [
            recording.time_s.len(),
            recording.state.len(),
            recording.reference.len()
        ],
        [steps + 1; 3]
    );
    let duration_s = trajectory().duration_s();
    assert!(recording.time_s[steps] >= duration_s - 1e-9);
    assert!(recording.time_s[steps] < duration_s + TIMESTEP_S);
    assert_eq!(recording.state[0].position, START);
    assert_eq!(recording.reference[steps].position, trajectory().end());
}

#[test]
fn two_runs_are_equal_bit_for_bit() {
    let first = run(&servo(), TIMESTEP_S, Hooks::default()).unwrap();
    let second = run(&servo(), TIMESTEP_S, Hooks::default()).unwrap();
    assert_eq!(first.engine, second.engine);
    assert_eq!(first.state, second.state);
    assert_eq!(first.torque_nm, second.torque_nm);
}

#[test]
fn cancelled_run_stops_at_the_next_step() {
    let cancel = AtomicBool::new(false);
    let mut last_s = 0.0;
    let mut progress = |time_s| {
        last_s = time_s;
        cancel.store(time_s > 0.1, Ordering::Relaxed);
    };
    let hooks = Hooks {
        cancel: Some(&cancel),
        progress: Some(&mut progress),
    };
    assert!(matches!(
        run(&servo(), TIMESTEP_S, hooks),
        Err(EngineError::Cancelled)
    ));
    assert!((last_s - 0.101).abs() < 1e-9, "{last_s}");
}

#[test]
fn unstable_gains_are_reported_as_divergence() {
    let mut servo = servo();
    servo.gains.kd_nms_per_rad = [600.0; 6];
    servo.effort_limit_nm = Joints::repeat(f64::INFINITY);
    assert!(servo.stability_ratio(TIMESTEP_S) > 1.0);
    let stopped = run(&servo, TIMESTEP_S, Hooks::default()).unwrap_err();
    let EngineError::Stopped { error, recording } = stopped else {
        panic!("{stopped}");
    };
    assert!(
        matches!(
            *error,
            EngineError::Diverged { .. } | EngineError::Unstable { .. }
        ),
        "{error}"
    );
    // What came before is kept, and nothing that is no number.
    let states = recording.state.len();
    assert!(states > 1, "{states}");
    assert_eq!(recording.torque_nm.len(), states - 1);
    assert!(
        recording
            .state
            .iter()
            .all(|state| state.position.amax() < 100.0)
    );
}

#[test]
fn saturated_steps_are_counted() {
    let mut servo = servo();
    let free = run(&servo, TIMESTEP_S, Hooks::default()).unwrap();
    assert_eq!(free.saturated_steps, 0);
    let peak_nm = free.torque_nm.iter().map(Joints::amax).fold(0.0, f64::max);
    let limit_nm = 0.98 * peak_nm;
    servo.effort_limit_nm = Joints::repeat(limit_nm);
    let limited = run(&servo, TIMESTEP_S, Hooks::default()).unwrap();
    let at_limit = limited
        .torque_nm
        .iter()
        .filter(|torque| torque.amax() >= limit_nm)
        .count();
    assert!(at_limit > 0);
    assert_eq!(limited.saturated_steps, at_limit);
    for (joint, saturation) in limited.saturation.iter().enumerate() {
        let cut = |torque: &Joints| torque[joint].abs() >= limit_nm;
        let of_joint = limited.torque_nm.iter().filter(|torque| cut(torque));
        assert_eq!(saturation.steps, of_joint.count(), "joint {joint}");
        let first = limited.torque_nm.iter().position(cut);
        let first_time_s = first.map(|step| limited.time_s[step]);
        assert_eq!(saturation.first_time_s, first_time_s, "joint {joint}");
    }
}

#[test]
fn bad_numbers_are_refused_before_the_first_step() {
    for timestep_s in [0.0, -1e-3, f64::NAN, f64::INFINITY] {
        let error = run(&servo(), timestep_s, Hooks::default()).unwrap_err();
        assert!(matches!(error, EngineError::BadTimestep { .. }), "{error}");
    }
    let mut negative = servo();
    negative.gains.kp_nm_per_rad[3] = -1.0;
    let mut nan = servo();
    nan.effort_limit_nm[2] = f64::NAN;
    for servo in [negative, nan] {
        let error = run(&servo, TIMESTEP_S, Hooks::default()).unwrap_err();
        assert!(matches!(error, EngineError::BadSetting { .. }), "{error}");
    }
}

#[test]
fn body_without_mass_is_refused() {
    let mut cell = crate::common::ur3(Vec::new());
    cell.robot.bodies[3].mass_kg = 0.0;
    let error = RapierPlant::new(&cell, TIMESTEP_S, &RapierSettings::default())
        .err()
        .unwrap();
    assert!(
        matches!(
            error,
            EngineError::BadBody {
                joint: "wrist_1",
                ..
            }
        ),
        "{error}"
    );
}
