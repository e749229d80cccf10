//! The run loop: motions on arms that are stepped together, or on one.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use needlebench_kinematics::Joints;
use needlebench_kinematics::trajectory::JointTrajectory;

use crate::drive::{Drive, Keep, Motion};
use crate::fleet::{Fleet, Lone};
use crate::{Actuation, EngineError, Plant, Recording, Servo};

/// How the caller takes part in a run.
#[derive(Default)]
pub struct Hooks<'a> {
    /// Read before every step; once it is set the run ends with [`EngineError::Cancelled`].
    pub cancel: Option<&'a AtomicBool>,
    /// Called after every step with the time that has been simulated, over all motions, s.
    pub progress: Option<&'a mut dyn FnMut(f64)>,
}

/// Runs `trajectory` from its start to its end on `plant`, through drives as they are.
///
/// # Errors
/// What the plant reports; [`EngineError::Stopped`] if the motion diverged or the engine gave it up.
pub fn simulate(
    plant: &mut dyn Plant,
    servo: &Servo,
    actuation: &Actuation,
    trajectory: &JointTrajectory,
    hooks: Hooks<'_>,
) -> Result<Recording, EngineError> {
    let motion = Motion {
        servo,
        actuation,
        trajectory,
        braking: None,
        keep: Keep::Steps,
    };
    simulate_motion(plant, &motion, hooks)
}

/// Runs one motion on one plant.
///
/// # Errors
/// As [`simulate`].
pub fn simulate_motion(
    plant: &mut dyn Plant,
    motion: &Motion<'_>,
    mut hooks: Hooks<'_>,
) -> Result<Recording, EngineError> {
    let mut ended = None;
    let motions = std::slice::from_ref(motion);
    simulate_fleet(&mut Lone(plant), motions, &mut hooks, &mut |_, result| {
        ended = Some(result);
    })?;
    ended.expect("the only motion has ended")
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
/// and with its recording, which does not depend on the other motions. A motion whose arm becomes
/// unstable ends with [`EngineError::Stopped`]; the others go on. The cost of a motion is its share
/// of the steps that it took part in.
///
/// # Errors
/// What ends the engine, and [`EngineError::Cancelled`]; motions that have not ended are lost.
pub fn simulate_fleet(
    fleet: &mut dyn Fleet,
    motions: &[Motion<'_>],
    hooks: &mut Hooks<'_>,
    finished: &mut dyn FnMut(usize, Result<Recording, EngineError>),
) -> Result<(), EngineError> {
    let mut waiting = motions.iter().enumerate();
    let mut idle: Vec<usize> = (0..fleet.arms()).rev().collect();
    let mut active: Vec<Active<'_>> = Vec::new();
    let mut torques: Vec<(usize, Joints)> = Vec::new();
    let mut steps = 0;
    loop {
        while !idle.is_empty()
            && let Some((index, motion)) = waiting.next()
        {
            let arm = idle.pop().expect("just looked");
            match begin(fleet, index, arm, motion) {
                Ok(begun) => active.push(begun),
                Err(error) if error.is_fatal() => return Err(error),
                Err(error) => {
                    finished(index, Err(error));
                    idle.push(arm);
                }
            }
        }
        let cancel = hooks.cancel;
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
            match each.drive.torque(motions[each.motion].trajectory) {
                Ok(Some(torque_nm)) => torques.push((each.arm, torque_nm)),
                Ok(None) => ended.push((place, None)),
                Err(error) => ended.push((place, Some(error))),
            }
        }
        let any_ended = !ended.is_empty();
        for (place, error) in ended.into_iter().rev() {
            let done = active.remove(place);
            idle.push(done.arm);
            let followed = motions[done.motion].trajectory;
            let result = if let Some(error) = error {
                Err(done.drive.stopped_by(followed, error))
            } else {
                let mut recording = done.drive.finish(followed);
                recording.cost.wall = done.wall;
                Ok(recording)
            };
            finished(done.motion, result);
        }
        if any_ended && torques.is_empty() {
            continue;
        }
        let states = match fleet.step(&torques) {
            Ok(states) => states,
            Err(error) if error.is_fatal() => return Err(error),
            Err(error) => torques.iter().map(|_| Err(error.clone())).collect(),
        };
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
            let followed = motions[done.motion].trajectory;
            finished(done.motion, Err(done.drive.stopped_by(followed, error)));
        }
        steps += torques.len();
        if let Some(progress) = hooks.progress.as_mut() {
            progress(steps as f64 * fleet.timestep_s());
        }
    }
}

fn begin<'a>(
    fleet: &mut dyn Fleet,
    index: usize,
    arm: usize,
    motion: &Motion<'a>,
) -> Result<Active<'a>, EngineError> {
    let started = Instant::now();
    let (identity, timestep_s) = (fleet.identity(), fleet.timestep_s());
    let mut drive = Drive::new(motion, identity, timestep_s, fleet.velocity_age_s())?;
    let begun = fleet.begin(arm, motion.trajectory);
    if let Err(error) = begun.and_then(|state| drive.record(state)) {
        return Err(drive.stopped_by(motion.trajectory, error));
    }
    Ok(Active {
        motion: index,
        arm,
        drive,
        wall: started.elapsed(),
    })
}
