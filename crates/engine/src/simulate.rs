//! The run loop: one servo, one trajectory, any plant.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use needlebench_kinematics::trajectory::{JointState, JointTrajectory};
use needlebench_kinematics::{JOINT_LABELS, Joints};

use crate::{Cost, EngineError, Plant, PlantState, Recording, Servo};

/// Speed that no arm reaches, rad/s: 16 times the fastest joint of a UR3.
const ABSURD_SPEED_RAD_S: f64 = 100.0;

/// Position that no joint reaches, rad: 16 turns.
const ABSURD_POSITION_RAD: f64 = 100.0;

/// A trajectory whose end lies this fraction of a step behind a step's end needs no further step.
const STEP_SLACK: f64 = 1e-6;

/// How the caller takes part in a run.
#[derive(Default)]
pub struct Hooks<'a> {
    /// Read before every step; once it is set the run ends with [`EngineError::Cancelled`].
    pub cancel: Option<&'a AtomicBool>,
    /// Called after every step with the simulated time, s.
    pub progress: Option<&'a mut dyn FnMut(f64)>,
}

/// Runs `trajectory` from its start to its end on `plant`.
///
/// The servo is sampled once per step and its torque held over it. The last state is the first one
/// at or after the trajectory's end.
pub fn simulate(
    plant: &mut dyn Plant,
    servo: &Servo,
    trajectory: &JointTrajectory,
    mut hooks: Hooks<'_>,
) -> Result<Recording, EngineError> {
    servo.check()?;
    let started = Instant::now();
    let timestep_s = plant.timestep_s();
    let velocity_age_s = plant.velocity_age_s();
    let engine = plant.identity();
    let steps = step_count(trajectory.duration_s(), timestep_s);

    let start = trajectory.sample(0.0);
    let mut state = plant.reset(&start.position)?;
    let mut recording = Recording {
        engine,
        timestep_s,
        time_s: Vec::with_capacity(steps + 1),
        state: Vec::with_capacity(steps + 1),
        reference: Vec::with_capacity(steps + 1),
        torque_nm: Vec::with_capacity(steps),
        saturated_steps: 0,
        cost: Cost::default(),
    };
    recording.time_s.push(0.0);
    recording.state.push(state);
    recording.reference.push(start);
    for k in 0..steps {
        if hooks
            .cancel
            .is_some_and(|cancel| cancel.load(Ordering::Relaxed))
        {
            return Err(EngineError::Cancelled);
        }
        let time_s = k as f64 * timestep_s;
        let output = servo.torque(
            &servo_reference(trajectory, time_s, velocity_age_s),
            &state.position,
            &state.velocity,
        );
        let next_s = (k + 1) as f64 * timestep_s;
        check_torque(&recording.engine.name, time_s, &output.torque_nm)?;
        state = plant.step(&output.torque_nm)?;
        check_state(&recording.engine.name, next_s, &state)?;
        recording.saturated_steps += usize::from(output.saturated);
        recording.torque_nm.push(output.torque_nm);
        recording.time_s.push(next_s);
        recording.state.push(state);
        recording.reference.push(trajectory.sample(next_s));
        if let Some(progress) = hooks.progress.as_mut() {
            progress(next_s);
        }
    }
    recording.cost.wall = started.elapsed();
    Ok(recording)
}

/// Reference for the torque of the step that starts at `time_s`.
///
/// Semi-implicit Euler is leapfrog in disguise: with the acceleration of the step's start, the
/// positions follow the trajectory to second order, while the velocities belong half a step
/// earlier. Taking the velocity there removes a bias of `kd * h / 2 * qdd`, which is 0.3 N m at
/// 10 rad/s^2 and 1 ms.
fn servo_reference(trajectory: &JointTrajectory, time_s: f64, velocity_age_s: f64) -> JointState {
    JointState {
        velocity: trajectory
            .sample((time_s - velocity_age_s).max(0.0))
            .velocity,
        ..trajectory.sample(time_s)
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "durations are not negative and far below 2^52 steps"
)]
fn step_count(duration_s: f64, timestep_s: f64) -> usize {
    (duration_s / timestep_s - STEP_SLACK).ceil().max(0.0) as usize
}

fn check_torque(engine: &str, time_s: f64, torque_nm: &Joints) -> Result<(), EngineError> {
    check(engine, time_s, "torque", torque_nm, f64::MAX)
}

fn check_state(engine: &str, time_s: f64, state: &PlantState) -> Result<(), EngineError> {
    check(
        engine,
        time_s,
        "position",
        &state.position,
        ABSURD_POSITION_RAD,
    )?;
    check(
        engine,
        time_s,
        "velocity",
        &state.velocity,
        ABSURD_SPEED_RAD_S,
    )
}

fn check(
    engine: &str,
    time_s: f64,
    quantity: &'static str,
    values: &Joints,
    limit: f64,
) -> Result<(), EngineError> {
    for (&value, joint) in values.iter().zip(JOINT_LABELS) {
        if value.abs() > limit || value.is_nan() {
            let engine = engine.to_owned();
            return Err(EngineError::Diverged {
                engine,
                time_s,
                joint,
                quantity,
                value,
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_cover_the_trajectory_and_no_more() {
        assert_eq!(step_count(0.0, 1e-3), 0);
        assert_eq!(step_count(2.0, 1e-3), 2000);
        assert_eq!(step_count(0.3, 0.1), 3);
        assert_eq!(step_count(2.0004, 1e-3), 2001);
    }
}
