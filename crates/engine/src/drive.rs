//! One motion of one arm: what torque the plant gets next, and what it did.

use needlebench_kinematics::trajectory::JointTrajectory;
use needlebench_kinematics::{Dynamics, JOINT_COUNT, JOINT_LABELS, Joints};

use crate::actuation::Drives;
use crate::{
    ActuatedTorque, Actuation, Brakes, Cost, EngineError, EngineIdentity, PlantState, Recording,
    Reference, Servo,
};

/// Speed that no arm reaches, rad/s: 16 times the fastest joint of a UR3.
const ABSURD_SPEED_RAD_S: f64 = 100.0;

/// Position that no joint reaches, rad: 16 turns.
const ABSURD_POSITION_RAD: f64 = 100.0;

/// A trajectory whose end lies this fraction of a step behind a step's end needs no further step.
const STEP_SLACK: f64 = 1e-6;

/// What one arm is to do.
#[derive(Debug, Clone, Copy)]
pub struct Motion<'a> {
    /// The servo.
    pub servo: &'a Servo,
    /// The drives.
    pub actuation: &'a Actuation,
    /// What the servo follows.
    pub trajectory: &'a JointTrajectory,
    /// From when on the arm is braked instead, if ever.
    pub braking: Option<Braking<'a>>,
    /// What is recorded.
    pub keep: Keep<'a>,
}

/// Which states of a motion its recording has.
#[derive(Debug, Clone, Copy, Default)]
pub enum Keep<'a> {
    /// Every one.
    #[default]
    Steps,
    /// The one nearest to each of these times (s), which increase; each state once. What lies between
    /// needs no memory.
    Near(&'a [f64]),
}

/// From a moment on the drives are off and the brakes act.
#[derive(Debug, Clone, Copy)]
pub struct Braking<'a> {
    /// The moment, s.
    pub from_s: f64,
    /// The brakes.
    pub brakes: Brakes,
    /// The arm that they brake: the plant's own.
    pub dynamics: &'a Dynamics,
}

/// A motion under way.
///
/// Plants are stepped by the caller, so that several of them can go in turn:
///
/// ```text
/// drive.record(plant.begin(motion.trajectory))
/// while let Some(torque) = drive.torque(reference)? { drive.record(plant.step(&torque)?)? }
/// drive.finish(reference)
/// ```
#[derive(Debug)]
pub(crate) struct Drive<'a> {
    drives: Drives<'a>,
    /// Steps that there are; without an end if none.
    steps: Option<usize>,
    braking: Option<Braking<'a>>,
    keep: Keep<'a>,
    /// State after the last step.
    now: Option<PlantState>,
    /// Steps that were made.
    step: usize,
    /// Times that states were kept for.
    kept_times: usize,
    /// Whether the state after the last step was kept.
    is_kept: bool,
    recording: Recording,
}

impl<'a> Drive<'a> {
    /// Prepares a motion from its start to its end on a plant with steps of `timestep_s` whose
    /// velocities are `velocity_age_s` old (see [`Plant::velocity_age_s`](crate::Plant)).
    ///
    /// The servo is sampled once per step and its torque held over it. The last state is the first
    /// one at or after the trajectory's end.
    ///
    /// # Errors
    /// [`EngineError::BadSetting`] for gains, limits and imperfections out of range.
    pub(crate) fn new(
        motion: &Motion<'a>,
        engine: EngineIdentity,
        timestep_s: f64,
        velocity_age_s: f64,
    ) -> Result<Self, EngineError> {
        let steps = step_count(motion.trajectory.duration_s(), timestep_s);
        let kept = match motion.keep {
            Keep::Steps => steps,
            Keep::Near(times_s) => times_s.len(),
        };
        let parts = (motion.servo, motion.actuation, motion.keep);
        let mut drive = Self::unbounded(parts, engine, timestep_s, velocity_age_s)?;
        drive.steps = Some(steps);
        drive.braking = motion.braking;
        let recording = &mut drive.recording;
        recording.time_s.reserve_exact(kept + 1);
        recording.state.reserve_exact(kept + 1);
        recording.reference.reserve_exact(kept + 1);
        recording.torque_nm.reserve_exact(kept);
        recording.drive_nm.reserve_exact(kept);
        Ok(drive)
    }

    /// The same without an end.
    ///
    /// # Errors
    /// As [`Drive::new`].
    pub(crate) fn unbounded(
        (servo, actuation, keep): (&'a Servo, &'a Actuation, Keep<'a>),
        engine: EngineIdentity,
        timestep_s: f64,
        velocity_age_s: f64,
    ) -> Result<Self, EngineError> {
        servo.check()?;
        actuation.check()?;
        Ok(Self {
            drives: Drives::new(servo, actuation, timestep_s, velocity_age_s),
            steps: None,
            braking: None,
            keep,
            now: None,
            step: 0,
            kept_times: 0,
            is_kept: false,
            recording: Recording {
                engine,
                timestep_s,
                velocity_age_s,
                time_s: Vec::new(),
                state: Vec::new(),
                reference: Vec::new(),
                torque_nm: Vec::new(),
                drive_nm: Vec::new(),
                saturated_steps: 0,
                saturation: Default::default(),
                cost: Cost::default(),
            },
        })
    }

    /// Torque of the next step, N m; none after the last one.
    ///
    /// # Errors
    /// [`EngineError::Diverged`] if it is not a number.
    ///
    /// # Panics
    /// If no state was recorded yet.
    pub(crate) fn torque(
        &mut self,
        followed: &dyn Reference,
    ) -> Result<Option<Joints>, EngineError> {
        if self.steps.is_some_and(|steps| self.step >= steps) {
            return Ok(None);
        }
        let state = self.now.expect("recorded after reset");
        let time_s = self.step as f64 * self.recording.timestep_s;
        let planned = followed.sample(time_s);
        if self.is_kept {
            self.recording.reference.push(planned);
        }
        let braking = self
            .braking
            .filter(|braking| time_s >= braking.from_s - STEP_SLACK * self.recording.timestep_s);
        let torque = if let Some(Braking {
            brakes, dynamics, ..
        }) = braking
        {
            let h = self.recording.timestep_s;
            let torque_nm = brakes.torque(dynamics, &state.position, &state.velocity, h);
            ActuatedTorque {
                link_nm: torque_nm,
                drive_nm: Joints::zeros(),
                saturated: [false; JOINT_COUNT],
            }
        } else {
            self.drives
                .torque(followed, time_s, &planned, &state.position, &state.velocity)
        };
        check_torque(self.recording.engine.name, time_s, &torque.drive_nm)?;
        self.recording.saturated_steps += usize::from(torque.saturated.contains(&true));
        for (joint, cut) in self.recording.saturation.iter_mut().zip(torque.saturated) {
            if cut {
                joint.steps += 1;
                joint.first_time_s.get_or_insert(time_s);
            }
        }
        if self.is_kept {
            self.recording.torque_nm.push(torque.link_nm);
            self.recording.drive_nm.push(torque.drive_nm);
        }
        self.step += 1;
        Ok(Some(torque.link_nm))
    }

    /// Keeps the state after the reset or after a step.
    ///
    /// # Errors
    /// [`EngineError::Diverged`] if it left every sensible range; it is kept all the same.
    pub(crate) fn record(&mut self, state: PlantState) -> Result<(), EngineError> {
        let time_s = self.step as f64 * self.recording.timestep_s;
        self.now = Some(state);
        self.is_kept = self.is_wanted(time_s);
        let recording = &mut self.recording;
        if self.is_kept {
            recording.time_s.push(time_s);
            recording.state.push(state);
        }
        check_state(recording.engine.name, time_s, &state)
    }

    /// Whether the state at a time is to be kept.
    fn is_wanted(&mut self, time_s: f64) -> bool {
        let Keep::Near(times_s) = self.keep else {
            return true;
        };
        let until_s = time_s + 0.5 * self.recording.timestep_s;
        let passed = times_s[self.kept_times..]
            .iter()
            .take_while(|wanted_s| **wanted_s < until_s);
        let passed = passed.count();
        self.kept_times += passed;
        passed > 0
    }

    /// The recording; its cost is the caller's to fill in.
    pub(crate) fn finish(mut self, followed: &dyn Reference) -> Recording {
        self.add_reference(followed);
        self.recording
    }

    /// The reference of a state from which no step began.
    fn add_reference(&mut self, followed: &dyn Reference) {
        let recording = &mut self.recording;
        if recording.reference.len() < recording.state.len() {
            let time_s = self.step as f64 * recording.timestep_s;
            recording.reference.push(followed.sample(time_s));
        }
    }

    /// The error with what was recorded until it came: [`EngineError::Stopped`]. Errors that are
    /// not the motion's own stay as they are.
    pub(crate) fn stopped_by(
        mut self,
        followed: &dyn Reference,
        error: EngineError,
    ) -> EngineError {
        if !matches!(
            error,
            EngineError::Diverged { .. } | EngineError::Unstable { .. }
        ) {
            return error;
        }
        self.add_reference(followed);
        let mut recording = self.recording;
        let sensible = |state: &PlantState| check_state("", 0.0, state).is_ok();
        let count = recording.state.iter().take_while(|s| sensible(s)).count();
        recording.time_s.truncate(count);
        recording.state.truncate(count);
        recording.reference.truncate(count);
        recording.torque_nm.truncate(count.saturating_sub(1));
        recording.drive_nm.truncate(count.saturating_sub(1));
        EngineError::Stopped {
            error: Box::new(error),
            recording: Box::new(recording),
        }
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

fn check_torque(engine: &'static str, time_s: f64, torque_nm: &Joints) -> Result<(), EngineError> {
    check(engine, time_s, "torque", torque_nm, f64::MAX)
}

fn check_state(engine: &'static str, time_s: f64, state: &PlantState) -> Result<(), EngineError> {
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
    engine: &'static str,
    time_s: f64,
    quantity: &'static str,
    values: &Joints,
    limit: f64,
) -> Result<(), EngineError> {
    for (&value, joint) in values.iter().zip(JOINT_LABELS) {
        if value.abs() > limit || value.is_nan() {
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
