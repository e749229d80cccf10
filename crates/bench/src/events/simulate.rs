//! Events in an engine.

use needlebench_engine::{
    Braking, Engine, EngineError, EnginePool, Hooks, Motion, MotionJob, MotionSettings, Recording,
    run_motions,
};
use needlebench_evaluation::report::EngineFailure;
use needlebench_parallel::Control;
use needlebench_planning::GoalPlan;

use super::{EngineEvents, EventRun, section};
use crate::plan::Job;
use crate::setup::Setup;

/// What one engine made of the events.
pub(crate) struct SimulatedEvents {
    /// By configuration, as they were staged; none where a motion could not be made.
    pub by_run: Vec<Option<EngineEvents>>,
    /// How the engine failed, if it did and was not interrupted: by the first motion that is missing.
    pub failure: Option<EngineFailure>,
    /// What ended the engine itself, or the run.
    pub error: Option<EngineError>,
}

/// One motion of an event.
#[derive(Clone, Copy)]
enum Part {
    /// The contact of this index.
    Press(usize),
    Stop,
    Retract,
}

/// Simulates everything that is staged in one engine, which has made the planned motions before.
pub(crate) fn simulate(
    setup: &Setup<'_>,
    plans: &[GoalPlan],
    staged: &[EventRun],
    pool: &EnginePool,
    engine: &'static dyn Engine,
    restart: bool,
    control: &Control<'_>,
) -> SimulatedEvents {
    if pool.could_not_start(engine) {
        // The planned motions have failed for the same reason, which is reported.
        return SimulatedEvents {
            by_run: staged.iter().map(|_| None).collect(),
            failure: None,
            error: None,
        };
    }
    let dynamics = setup.real.cell().dynamics();
    let mut parts: Vec<(usize, Part)> = Vec::new();
    let mut jobs: Vec<MotionJob<'_>> = Vec::new();
    for (at, run) in staged.iter().enumerate() {
        for (index, press) in run.press.iter().enumerate() {
            let Ok(press) = press else { continue };
            parts.push((at, Part::Press(index)));
            jobs.push(MotionJob {
                cell: &press.cell,
                friction: section(setup.resolved).press[index].friction,
                motion: setup.motion(&press.trajectory),
            });
        }
        if let Some(stop) = &run.stop {
            let braking = stop.brakes.map(|(from_s, brakes)| Braking {
                from_s,
                brakes,
                dynamics: &dynamics,
            });
            parts.push((at, Part::Stop));
            jobs.push(MotionJob {
                motion: Motion {
                    braking,
                    ..setup.motion(&stop.trajectory)
                },
                ..setup.job(&stop.trajectory)
            });
        }
        let retreat = run.job().plan(plans).retreat.as_ref();
        if let Some(retreat) = retreat.filter(|_| section(setup.resolved).retreat) {
            parts.push((at, Part::Retract));
            jobs.push(setup.job(retreat));
        }
    }
    let hooks = Hooks {
        cancel: Some(control.cancel),
        progress: None,
    };
    let settings = MotionSettings {
        restart,
        ..setup.motion_settings()
    };
    let mut ends: Vec<Option<Result<Recording, EngineError>>> = jobs.iter().map(|_| None).collect();
    let done = run_motions(
        pool,
        engine,
        &jobs,
        settings,
        hooks,
        &mut |index, result| {
            ends[index] = Some(result);
        },
    );
    let mut by_run: Vec<Option<EngineEvents>> = staged
        .iter()
        .map(|run| {
            Some(EngineEvents {
                press: run.press.iter().map(|_| None).collect(),
                ..EngineEvents::default()
            })
        })
        .collect();
    let mut first: Option<(usize, Option<EngineError>)> = None;
    for ((at, part), end) in parts.into_iter().zip(ends) {
        match (end, &mut by_run[at]) {
            (Some(Ok(recording)), Some(events)) => match part {
                Part::Press(index) => events.press[index] = Some(recording),
                Part::Stop => events.stop = Some(recording),
                Part::Retract => events.retract = Some(recording),
            },
            (Some(Ok(_)), None) => {}
            (missing, events) => {
                *events = None;
                first.get_or_insert((at, missing.and_then(Result::err)));
            }
        }
    }
    let error_of = |own: Option<EngineError>| match &done.error {
        Some(EngineError::Cancelled) => None,
        Some(error) => Some(error.to_string()),
        None => own.map(|error| error.to_string()),
    };
    let failure = first.and_then(|(at, own)| {
        let during = staged[at].job().in_words(setup, plans);
        Some(EngineFailure {
            engine: engine.name().to_owned(),
            during: Some(format!("events of {during}")),
            message: error_of(own)?,
        })
    });
    SimulatedEvents {
        by_run,
        failure,
        error: done.error,
    }
}

impl EventRun {
    fn job(&self) -> Job {
        Job {
            goal: self.goal,
            configuration: self.configuration,
        }
    }
}
