//! Many motions in an engine: the one driver of all that is simulated.

use needlebench_cell::{Cell, EngineSettings};

use crate::simulate::{Hooks, simulate_fleet};
use crate::{
    ArmSpec, ClosedLoop, Engine, EngineError, EngineIdentity, EnginePool, EngineSession, Motion,
    Recording, UnstableServo,
};

/// One motion, and whose it is.
#[derive(Debug, Clone, Copy)]
pub struct MotionJob<'a> {
    /// The arm, and all that it may touch. Motions of one cell (the same, not an equal one) share
    /// arms.
    pub cell: &'a Cell,
    /// Coulomb friction between any two solids; the settings' if none.
    pub friction: Option<f64>,
    /// What the arm is to do.
    pub motion: Motion<'a>,
}

/// What all motions of a call have in common.
#[derive(Debug, Clone, Copy)]
pub struct MotionSettings {
    /// The scenario's settings of the engines.
    pub engines: EngineSettings,
    /// Length of a step, s.
    pub timestep_s: f64,
    /// An engine whose process dies is started once again, and makes the motions that are missing.
    pub restart: bool,
}

impl MotionSettings {
    /// As a scenario has them.
    pub fn new(engines: &EngineSettings) -> Self {
        Self {
            engines: *engines,
            timestep_s: engines.timestep_s,
            restart: false,
        }
    }
}

/// What came of the motions together; of each by itself the callback was told.
#[derive(Debug, Clone, Default)]
pub struct MotionsDone {
    /// Name, version and settings of the engine: of the first arms that it made, if it made any.
    pub identity: Option<EngineIdentity>,
    /// What ended the engine itself, or [`EngineError::Cancelled`]: the callback was not told of all
    /// motions.
    pub error: Option<EngineError>,
}

/// Makes motions in an engine, several at a time where it can.
///
/// `finished` is called with the index of each job that ends, in the order in which they end. A
/// recording does not depend on the other motions, bit for bit. Where there is none, the error is
/// [`EngineError::UnstableServo`] for a loop that cannot hold the arm, which is found before anything
/// moves; [`EngineError::NotMade`] for a cell that the engine refuses;
/// [`EngineError::Stopped`] with what was recorded until then for a motion that broke off.
pub fn run_motions(
    pool: &EnginePool,
    engine: &dyn Engine,
    jobs: &[MotionJob<'_>],
    settings: MotionSettings,
    mut hooks: Hooks<'_>,
    finished: &mut dyn FnMut(usize, Result<Recording, EngineError>),
) -> MotionsDone {
    let mut waiting = Vec::new();
    for (index, job) in jobs.iter().enumerate() {
        match instability(job, settings.timestep_s) {
            None => waiting.push(index),
            Some(why) => finished(index, Err(EngineError::UnstableServo(why))),
        }
    }
    let mut done = MotionsDone::default();
    let mut restarts = usize::from(settings.restart);
    let mut simulated_s = 0.0;
    while !waiting.is_empty() {
        let ended = pool.lend(engine, &settings.engines, |session| {
            let groups = groups(jobs, &waiting);
            let mut ended = |index: usize, result: Result<Recording, EngineError>| {
                waiting.retain(|other| *other != index);
                finished(index, result);
            };
            groups.iter().try_for_each(|group| {
                let before_s = simulated_s;
                let mut progress = |time_s: f64| {
                    simulated_s = before_s + time_s;
                    if let Some(progress) = hooks.progress.as_mut() {
                        progress(simulated_s);
                    }
                };
                let hooks = Hooks {
                    cancel: hooks.cancel,
                    progress: Some(&mut progress),
                };
                let made = &mut done.identity;
                drive_group(session, engine, group, settings, made, hooks, &mut ended)
            })
        });
        match ended {
            Ok(()) => break,
            Err(error) if error.is_fatal() && restarts > 0 => {
                restarts -= 1;
                pool.discard(engine);
            }
            Err(error) => {
                done.error = Some(error);
                break;
            }
        }
    }
    done
}

/// Why a servo cannot hold the arm where the motion ends, if it cannot.
fn instability(job: &MotionJob<'_>, timestep_s: f64) -> Option<UnstableServo> {
    let Motion {
        servo,
        actuation,
        trajectory,
        ..
    } = job.motion;
    let mass = job.cell.dynamics().mass_matrix(&trajectory.end());
    ClosedLoop::instability(&mass, servo, actuation, timestep_s)
}

/// Jobs that can share arms, with their indices.
struct Group<'a> {
    cell: &'a Cell,
    friction: Option<f64>,
    indices: Vec<usize>,
    motions: Vec<Motion<'a>>,
}

fn groups<'a>(jobs: &[MotionJob<'a>], indices: &[usize]) -> Vec<Group<'a>> {
    let mut groups: Vec<Group<'a>> = Vec::new();
    for &index in indices {
        let job = &jobs[index];
        let known = groups
            .iter_mut()
            .find(|group| std::ptr::eq(group.cell, job.cell) && group.friction == job.friction);
        if let Some(group) = known {
            group.indices.push(index);
            group.motions.push(job.motion);
        } else {
            groups.push(Group {
                cell: job.cell,
                friction: job.friction,
                indices: vec![index],
                motions: vec![job.motion],
            });
        }
    }
    groups
}

/// Makes the motions of arms of one kind.
///
/// # Errors
/// What ends the engine, and [`EngineError::Cancelled`].
fn drive_group(
    session: &mut dyn EngineSession,
    engine: &dyn Engine,
    group: &Group<'_>,
    settings: MotionSettings,
    identity: &mut Option<EngineIdentity>,
    mut hooks: Hooks<'_>,
    ended: &mut dyn FnMut(usize, Result<Recording, EngineError>),
) -> Result<(), EngineError> {
    let arm = ArmSpec {
        cell: group.cell,
        settings: &settings.engines,
        friction: group.friction.unwrap_or(settings.engines.friction),
        timestep_s: settings.timestep_s,
    };
    let count = group.motions.len().min(engine.motions_at_a_time());
    match session.make_fleet(&arm, count) {
        Ok(mut fleet) => {
            identity.get_or_insert_with(|| fleet.identity());
            simulate_fleet(
                fleet.as_mut(),
                &group.motions,
                &mut hooks,
                &mut |at, result| {
                    ended(group.indices[at], result);
                },
            )
        }
        Err(error) if error.is_fatal() => Err(error),
        Err(error) => {
            for &index in &group.indices {
                let error = Box::new(error.clone());
                ended(index, Err(EngineError::NotMade { error }));
            }
            Ok(())
        }
    }
}
