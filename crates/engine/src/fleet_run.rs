//! Many motions on a fleet of arms.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use needlebench_kinematics::Joints;
use needlebench_kinematics::trajectory::JointTrajectory;

use crate::{Actuation, Drive, EngineError, MujocoFleet, Recording, Servo};

/// What one arm is to do.
#[derive(Debug, Clone, Copy)]
pub struct Motion<'a> {
    /// The servo.
    pub servo: &'a Servo,
    /// The drives.
    pub actuation: &'a Actuation,
    /// What the servo follows.
    pub trajectory: &'a JointTrajectory,
}

/// A motion under way.
struct Active<'a> {
    motion: usize,
    arm: usize,
    drive: Drive<'a>,
    wall: Duration,
}

/// Runs all motions on a fleet, as many at a time as it has arms; an arm that is done begins the
/// next motion.
///
/// `finished` is called with the index of each motion that ends, in the order in which they end,
/// and with its recording, which is that of [`simulate`](crate::simulate) on a single plant, bit
/// for bit. A motion whose arm becomes unstable ends with the error; the others go on. The cost of
/// a motion is its share of the messages that it took part in.
///
/// # Errors
/// If the harness fails, and [`EngineError::Cancelled`]; motions that have not ended are lost.
pub fn simulate_fleet(
    fleet: &mut MujocoFleet<'_>,
    motions: &[Motion<'_>],
    cancel: Option<&AtomicBool>,
    mut finished: impl FnMut(usize, Result<Recording, EngineError>),
) -> Result<(), EngineError> {
    let mut waiting = motions.iter().enumerate();
    let mut idle: Vec<usize> = (0..fleet.len()).rev().collect();
    let mut active: Vec<Active<'_>> = Vec::new();
    let mut torques: Vec<(usize, Joints)> = Vec::new();
    loop {
        while !idle.is_empty()
            && let Some((index, motion)) = waiting.next()
        {
            let arm = idle.pop().expect("just looked");
            match begin(fleet, index, arm, motion) {
                Ok(begun) => active.push(begun),
                Err(error @ EngineError::Harness(_)) => return Err(error),
                Err(error) => {
                    finished(index, Err(error));
                    idle.push(arm);
                }
            }
        }
        if cancel.is_some_and(|cancel| cancel.load(Ordering::Relaxed)) {
            return Err(EngineError::Cancelled);
        }
        if active.is_empty() {
            return Ok(());
        }
        let started = Instant::now();
        torques.clear();
        let mut ended: Vec<(usize, Option<EngineError>)> = Vec::new();
        for (place, each) in active.iter_mut().enumerate() {
            match each.drive.torque() {
                Ok(Some(torque_nm)) => torques.push((each.arm, torque_nm)),
                Ok(None) => ended.push((place, None)),
                Err(error) => ended.push((place, Some(error))),
            }
        }
        let any_ended = !ended.is_empty();
        for (place, error) in ended.into_iter().rev() {
            let done = active.remove(place);
            idle.push(done.arm);
            let result = if let Some(error) = error {
                Err(done.drive.stopped_by(error))
            } else {
                let mut recording = done.drive.finish();
                recording.cost.wall = done.wall;
                Ok(recording)
            };
            finished(done.motion, result);
        }
        if any_ended && torques.is_empty() {
            continue;
        }
        let states = fleet.step(&torques)?;
        let mut failed = Vec::new();
        for (place, (each, state)) in active.iter_mut().zip(states).enumerate() {
            if let Err(error) = state.and_then(|state| each.drive.record(state)) {
                failed.push((place, error));
            }
        }
        let share = started.elapsed() / u32::try_from(torques.len()).unwrap_or(u32::MAX);
        for each in &mut active {
            each.wall += share;
        }
        for (place, error) in failed.into_iter().rev() {
            let done = active.remove(place);
            idle.push(done.arm);
            finished(done.motion, Err(done.drive.stopped_by(error)));
        }
    }
}

fn begin<'a>(
    fleet: &mut MujocoFleet<'_>,
    index: usize,
    arm: usize,
    motion: &Motion<'a>,
) -> Result<Active<'a>, EngineError> {
    let started = Instant::now();
    let mut drive = Drive::new(
        motion.servo,
        motion.actuation,
        motion.trajectory,
        fleet.identity(),
        fleet.timestep_s(),
        // As `Plant::velocity_age_s` has it.
        0.5 * fleet.timestep_s(),
    )?;
    drive.record(fleet.reset(arm, &drive.start())?)?;
    Ok(Active {
        motion: index,
        arm,
        drive,
        wall: started.elapsed(),
    })
}
