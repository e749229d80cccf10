//! The second stage: planned motions in an engine, with the clearances along them.

use std::time::{Duration, Instant};

use needlebench_engine::{
    Engine, EngineError, EngineIdentity, EnginePool, Hooks, MotionJob, MotionSettings, Recording,
    run_motions,
};
use needlebench_evaluation::report::EngineFailure;
use needlebench_evaluation::{ClearanceSeries, measure_clearance, recorded_clearance};
use needlebench_kinematics::trajectory::JointTrajectory;
use needlebench_parallel::Control;
use needlebench_planning::GoalPlan;

use crate::plan::Job;
use crate::setup::Setup;

/// Recording of one engine with the clearances along it.
#[derive(Debug, Clone)]
pub struct EngineRun {
    /// Name of the engine.
    pub engine: &'static str,
    /// What the plant did.
    pub recording: Recording,
    /// Clearance over time.
    pub clearance: ClearanceSeries,
}

/// What is measured along a motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Detail {
    /// Clearances over time, for curves and tables.
    Series,
    /// The least clearances alone.
    Least,
}

/// Motions that are simulated.
pub(crate) struct Simulation<'a> {
    pub setup: &'a Setup<'a>,
    pub plans: &'a [GoalPlan],
    pub jobs: &'a [Job],
    pub detail: Detail,
    /// An engine whose process dies is started once again.
    pub restart: bool,
}

/// What one engine made of them.
pub(crate) struct SimulatedMotions {
    pub engine: &'static dyn Engine,
    pub identity: Option<EngineIdentity>,
    /// Motions that came to their end, in the order of the jobs.
    pub runs: Vec<(Job, EngineRun)>,
    /// Motions that the engine could not make, in the order of the jobs.
    pub failed: Vec<FailedMotion>,
    /// What ended the engine itself, or the run.
    pub error: Option<EngineError>,
    pub wall: Duration,
}

/// A motion that an engine could not make.
pub(crate) struct FailedMotion {
    pub job: Job,
    pub error: EngineError,
    /// What there is of it.
    pub run: Option<EngineRun>,
}

impl Simulation<'_> {
    /// Makes all motions in one engine.
    pub(crate) fn run_in(
        &self,
        pool: &EnginePool,
        engine: &'static dyn Engine,
        control: &Control<'_>,
    ) -> SimulatedMotions {
        let started = Instant::now();
        let motions: Vec<MotionJob<'_>> = self
            .jobs
            .iter()
            .map(|job| self.setup.job(self.trajectory(*job)))
            .collect();
        let settings = MotionSettings {
            restart: self.restart,
            ..self.setup.motion_settings()
        };
        let hooks = Hooks {
            cancel: Some(control.cancel),
            progress: None,
        };
        let (mut runs, mut failed) = (Vec::new(), Vec::new());
        let mut ended = |index: usize, result: Result<Recording, EngineError>| {
            let job = self.jobs[index];
            match result {
                Ok(recording) => runs.push((job, self.measured(engine, job, recording))),
                Err(EngineError::Stopped { error, recording }) => failed.push(FailedMotion {
                    job,
                    error: *error,
                    run: (recording.state.len() > 1)
                        .then(|| self.unfinished(engine, job, *recording)),
                }),
                Err(error) => failed.push(FailedMotion {
                    job,
                    error,
                    run: None,
                }),
            }
            control.progress.step();
        };
        let done = run_motions(pool, engine, &motions, settings, hooks, &mut ended);
        runs.sort_by_key(|(job, _)| *job);
        failed.sort_by_key(|each| each.job);
        SimulatedMotions {
            engine,
            identity: done.identity,
            runs,
            failed,
            error: done.error,
            wall: started.elapsed(),
        }
    }

    fn trajectory(&self, job: Job) -> &JointTrajectory {
        let trajectory = job.plan(self.plans).trajectory.as_ref();
        trajectory.expect("jobs have trajectories")
    }

    fn period_s(&self) -> f64 {
        self.setup.resolved.scenario.recording.period_ms * 1e-3
    }

    /// A recording that broke off, with the clearances along it, sampled.
    fn unfinished(&self, engine: &dyn Engine, job: Job, recording: Recording) -> EngineRun {
        let (cell, model) = (self.setup.real.cell(), self.setup.real.model());
        let trajectory = self.trajectory(job);
        let clearance = measure_clearance(cell, model, trajectory, &recording, self.period_s());
        EngineRun {
            engine: engine.name(),
            recording,
            clearance,
        }
    }

    /// A recording with the clearances along it.
    fn measured(&self, engine: &dyn Engine, job: Job, recording: Recording) -> EngineRun {
        let (cell, model) = (self.setup.real.cell(), self.setup.real.model());
        let (trajectory, period_s) = (self.trajectory(job), self.period_s());
        let mut clearance = match self.detail {
            Detail::Series => measure_clearance(cell, model, trajectory, &recording, period_s),
            Detail::Least => ClearanceSeries::default(),
        };
        let planning = &self.setup.resolved.scenario.planning;
        let tolerance_m = planning.certificate_tolerance_mm * 1e-3;
        // One search for the least, whoever needs the series besides.
        clearance.minima =
            recorded_clearance(cell, model, trajectory, &recording, period_s, tolerance_m);
        self.setup.real.allow_for_breath(&mut clearance);
        EngineRun {
            engine: engine.name(),
            recording,
            clearance,
        }
    }
}

impl SimulatedMotions {
    /// Simulated time over the wall-clock time of all motions of an engine, with everything that
    /// belongs to them: building the plants, control, recording and the certified clearance.
    pub(crate) fn real_time_factor(&self) -> Option<f64> {
        let durations_s = self
            .runs
            .iter()
            .filter_map(|(_, run)| run.recording.time_s.last());
        let simulated_s: f64 = durations_s.sum();
        let wall_s = self.wall.as_secs_f64();
        (simulated_s > 0.0 && wall_s > 0.0).then(|| simulated_s / wall_s)
    }

    /// How the engine failed, if it did and was not interrupted: by the first motion that is missing.
    pub fn failure(&self, simulation: &Simulation<'_>) -> Option<EngineFailure> {
        let first = self.failed.first();
        let (job, error) = match &self.error {
            Some(EngineError::Cancelled) => return None,
            Some(error) => {
                let is_missing = |job: &&Job| self.runs.iter().all(|(done, _)| done != *job);
                let missing = simulation.jobs.iter().find(is_missing).copied();
                // Without an arm no motion was under way.
                (missing.filter(|_| self.identity.is_some()), error)
            }
            None => {
                let FailedMotion { job, error, .. } = first?;
                let made = !matches!(error, EngineError::NotMade { .. });
                (Some(*job).filter(|_| made), error)
            }
        };
        Some(EngineFailure {
            engine: self.engine.name().to_owned(),
            during: job.map(|job| job.in_words(simulation.setup, simulation.plans)),
            message: error.to_string(),
        })
    }
}
