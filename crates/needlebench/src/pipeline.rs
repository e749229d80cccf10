//! The whole way of one scenario: plan, simulate, measure, judge.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use needlebench_cell::scenario::EngineName;
use needlebench_cell::{Cell, ResolvedScenario};
use needlebench_clearance::ClearanceModel;
use needlebench_engine::{
    ClosedLoop, EngineError, EngineIdentity, Hooks, Motion, MujocoFleet, Plant, RapierPlant,
    Recording, simulate, simulate_fleet,
};
use needlebench_evaluation::report::{EngineFailure, Report};
use needlebench_evaluation::{ClearanceSeries, measure_clearance, recorded_clearance};
use needlebench_kinematics::registration::RegistrationError;
use needlebench_kinematics::{Chain, NotUrGeometry, Pose};
use needlebench_planning::{ConfigurationPlan, GoalPlan, Planner, Rule};

use crate::assemble::assemble;
use crate::budgets::budgets;
use crate::events::{self, EventRun, EventSimulation};
use crate::iso9283::{self, ProtocolRun};
use crate::plants::{Harness, mujoco_settings, rapier_settings, start_harness};
use crate::progress::Progress;
use crate::reality::{Reality, servo};

/// Motions that MuJoCo makes at the same time: as many as a goal has configurations.
pub(crate) const FLEET_ARMS: usize = 8;

/// Engines that a run uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum EngineChoice {
    /// rapier only.
    Rapier,
    /// MuJoCo only.
    Mujoco,
    /// Both.
    Both,
}

impl EngineChoice {
    /// The engines of a choice, or else the scenario's own, each once and in order.
    pub(crate) fn engines(choice: Option<Self>, resolved: &ResolvedScenario) -> Vec<EngineName> {
        match choice {
            None => {
                let mut engines = resolved.scenario.engines.run.clone();
                engines.sort_unstable();
                engines.dedup();
                engines
            }
            Some(Self::Rapier) => vec![EngineName::Rapier],
            Some(Self::Mujoco) => vec![EngineName::Mujoco],
            Some(Self::Both) => vec![EngineName::Rapier, EngineName::Mujoco],
        }
    }
}

/// How to run a scenario.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunOptions {
    /// Engines; the scenario's own choice if `None`.
    pub engines: Option<EngineChoice>,
    /// Threads; more than there are engines and goals is no use.
    pub jobs: usize,
    /// Whether to hold every simulated motion against the referee.
    pub referee: bool,
}

/// Recording of one engine with the clearances along it.
#[derive(Debug, Clone)]
pub struct EngineRun {
    /// The engine.
    pub engine: EngineName,
    /// What the plant did.
    pub recording: Recording,
    /// Clearance over time.
    pub clearance: ClearanceSeries,
}

/// A motion that an engine could not carry on, with its recording until then.
#[derive(Debug, Clone)]
pub struct StoppedRun {
    /// Index of the goal.
    pub goal: usize,
    /// Index of the configuration.
    pub configuration: usize,
    /// What there is of it.
    pub run: EngineRun,
}

/// Everything that a run of a scenario leaves.
#[derive(Debug)]
pub struct ScenarioRun {
    /// The report.
    pub report: Report,
    /// Plans, by goal.
    pub plans: Vec<GoalPlan>,
    /// Recordings, by goal, configuration and engine.
    pub runs: Vec<Vec<Vec<EngineRun>>>,
    /// Events of the configurations that work.
    pub(crate) events: Vec<EventRun>,
    /// Motions that an engine could not carry on, until then.
    pub stopped: Vec<StoppedRun>,
    /// What a test by ISO 9283 left besides its report.
    pub iso9283: Option<ProtocolRun>,
    /// It was interrupted; what was finished until then is here.
    pub interrupted: bool,
    /// The arm that was simulated.
    pub(crate) real_arm: RealArm,
}

/// The arm that was simulated: the nominal one, or one draw of the imperfections.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RealArm {
    /// Its place.
    pub world_from_base_link: Pose,
    /// Its links.
    pub chain: Chain,
}

impl RealArm {
    pub fn of(cell: &Cell) -> Self {
        Self {
            world_from_base_link: cell.robot.world_from_base_link,
            chain: cell.robot.chain,
        }
    }
}

/// Why a scenario cannot be run at all.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The robot is not a UR arm.
    #[error(transparent)]
    Robot(#[from] NotUrGeometry),
    /// The markers of `[imperfections.registration]` determine no pose.
    #[error("imperfections.registration.markers_mm: {0}")]
    Registration(#[from] RegistrationError),
}

/// One motion to simulate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Job {
    pub goal: usize,
    pub configuration: usize,
}

/// Plans, simulates, measures and judges one scenario.
///
/// # Errors
/// [`RunError`]. A failing engine is no error: the report says so and keeps what the other one
/// measured.
pub(crate) fn run(
    resolved: &ResolvedScenario,
    options: &RunOptions,
    cancel: &AtomicBool,
    progress: &Progress,
) -> Result<ScenarioRun, RunError> {
    if let Some(protocol) = &resolved.iso9283 {
        return iso9283::run(resolved, protocol, options, cancel, progress);
    }
    let started = Instant::now();
    let mut timings = BTreeMap::new();
    let engines = EngineChoice::engines(options.engines, resolved);
    let model = ClearanceModel::new(&resolved.cell);
    let planner = Planner::new(resolved, &model)?;
    let reality = Reality::new(resolved, &model)?;

    // The MuJoCo process starts while the motions are planned.
    let (plans, harness) = std::thread::scope(|scope| {
        let wanted = engines.contains(&EngineName::Mujoco);
        let harness = wanted.then(|| scope.spawn(|| start_harness(resolved, progress)));
        progress.message("planning");
        progress.expect(resolved.goals.len() as u64);
        let plans = in_parallel(options.jobs, &resolved.goals, |goal| {
            let plan = planner.plan(goal);
            progress.step();
            plan
        });
        (
            plans,
            harness.map(|thread| thread.join().expect("the start-up does not panic")),
        )
    });
    timings.insert("planning_s".to_owned(), started.elapsed().as_secs_f64());

    let jobs = jobs(resolved, &plans);
    progress.message("simulating");
    progress.expect((jobs.len() * engines.len()) as u64);
    let simulation = Simulation {
        resolved,
        plans: &plans,
        reality: &reality,
        jobs: &jobs,
        cancel,
        progress,
    };
    let mut outcomes: Vec<EngineOutcome> = if options.jobs > 1 {
        std::thread::scope(|scope| {
            let threads: Vec<_> = engines
                .iter()
                .map(|engine| {
                    let harness = harness.as_ref().filter(|_| *engine == EngineName::Mujoco);
                    let simulation = &simulation;
                    scope.spawn(move || simulation.run(*engine, harness))
                })
                .collect();
            threads
                .into_iter()
                .map(|thread| thread.join().expect("plants do not panic"))
                .collect()
        })
    } else {
        engines
            .iter()
            .map(|engine| {
                simulation.run(
                    *engine,
                    harness.as_ref().filter(|_| *engine == EngineName::Mujoco),
                )
            })
            .collect()
    };
    timings.insert(
        "simulation_s".to_owned(),
        started.elapsed().as_secs_f64() - timings["planning_s"],
    );

    let mut events = events::stage(resolved, &reality, &plans, options.jobs);
    let event_simulation = EventSimulation {
        resolved,
        reality: &reality,
        plans: &plans,
        harness: harness.as_ref(),
        cancel,
    };
    let event_results = in_parallel(options.jobs.min(2), &engines, |engine| {
        event_simulation.run(*engine, &events)
    });
    let mut event_failures = Vec::new();
    for (engine, (done, failure)) in engines.iter().zip(event_results) {
        event_failures.extend(failure);
        for (run, done) in events.iter_mut().zip(done) {
            run.engines.insert(*engine, done);
        }
    }

    let mut runs: Vec<Vec<Vec<EngineRun>>> = plans
        .iter()
        .map(|plan| plan.configurations.iter().map(|_| Vec::new()).collect())
        .collect();
    let mut stopped = Vec::new();
    for outcome in &mut outcomes {
        let name = outcome.engine.name();
        let wall_s = outcome.wall.as_secs_f64();
        timings.insert(format!("{name}_s"), wall_s);
        if let Some(factor) = outcome.real_time_factor() {
            timings.insert(format!("{name}_real_time_factor"), factor);
        }
        for (job, run) in outcome.runs.drain(..) {
            runs[job.goal][job.configuration].push(run);
        }
        let broken = outcome.stopped.drain(..);
        stopped.extend(broken.map(|(job, run)| StoppedRun {
            goal: job.goal,
            configuration: job.configuration,
            run,
        }));
    }
    let refereed = Instant::now();
    let trials = crate::trial::try_all(
        &crate::trial::Court {
            resolved,
            reality: &reality,
            plans: &plans,
            runs: &runs,
            always: options.referee,
            threads: options.jobs,
            cancel,
            progress,
        },
        harness.as_ref().and_then(|harness| harness.as_ref().ok()),
    );
    if trials.identity.is_some() {
        timings.insert("referee_s".to_owned(), refereed.elapsed().as_secs_f64());
    }
    let failures = outcomes
        .iter_mut()
        .filter_map(|outcome| outcome.failure.take())
        .chain(event_failures)
        .collect();
    let identities = outcomes
        .iter_mut()
        .filter_map(|outcome| outcome.identity.take())
        .chain(trials.identity)
        .collect();
    let budgets = budgets(resolved, &plans, options.jobs);
    let interrupted = cancel.load(Ordering::Relaxed);
    let mut report = assemble(
        resolved,
        &planner,
        &model,
        &reality,
        &plans,
        &runs,
        &events,
        &budgets,
        &trials.by_goal,
        &engines,
        failures,
        identities,
        timings,
    );
    report.notes.extend(trials.notes);
    if interrupted {
        report.notes.push(
            "the run was interrupted: motions that had not been simulated by then are missing"
                .to_owned(),
        );
    }
    Ok(ScenarioRun {
        report,
        plans,
        runs,
        events,
        stopped,
        iso9283: None,
        interrupted,
        real_arm: RealArm::of(reality.cell()),
    })
}

/// Runs a scenario without progress and without a way to interrupt it.
///
/// # Errors
/// As the program's `run`.
pub fn run_scenario(
    resolved: &ResolvedScenario,
    options: &RunOptions,
) -> Result<ScenarioRun, RunError> {
    run(
        resolved,
        options,
        &AtomicBool::new(false),
        &Progress::new(true),
    )
}

/// Applies `f` to all items on up to `threads` threads; results are in the items' order.
pub(crate) fn in_parallel<T: Sync, R: Send>(
    threads: usize,
    items: &[T],
    f: impl Fn(&T) -> R + Sync,
) -> Vec<R> {
    let next = AtomicUsize::new(0);
    let results: Mutex<Vec<(usize, R)>> = Mutex::new(Vec::with_capacity(items.len()));
    std::thread::scope(|scope| {
        for _ in 0..threads.clamp(1, items.len().max(1)) {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some(item) = items.get(index) else { break };
                    let result = f(item);
                    results
                        .lock()
                        .expect("no thread panics")
                        .push((index, result));
                }
            });
        }
    });
    let mut results = results.into_inner().expect("no thread panics");
    results.sort_by_key(|(index, _)| *index);
    results.into_iter().map(|(_, result)| result).collect()
}

/// Configurations that are simulated: those that work, and on request those that only collide.
pub(crate) fn jobs(resolved: &ResolvedScenario, plans: &[GoalPlan]) -> Vec<Job> {
    let everything = resolved.scenario.planning.simulate_rejected;
    let worth = |plan: &ConfigurationPlan| {
        plan.trajectory.is_some()
            && (plan.rejections.is_empty()
                || everything
                    && plan.rejections.iter().all(|rejection| {
                        matches!(
                            rejection.rule,
                            Rule::Collision | Rule::NeedleCorridor | Rule::NoMotion
                        )
                    }))
    };
    plans
        .iter()
        .enumerate()
        .flat_map(|(goal, plan)| {
            plan.configurations
                .iter()
                .enumerate()
                .filter(|(_, plan)| worth(plan))
                .map(move |(configuration, _)| Job {
                    goal,
                    configuration,
                })
        })
        .collect()
}

struct Simulation<'a> {
    resolved: &'a ResolvedScenario,
    plans: &'a [GoalPlan],
    reality: &'a Reality<'a>,
    jobs: &'a [Job],
    cancel: &'a AtomicBool,
    progress: &'a Progress,
}

struct EngineOutcome {
    engine: EngineName,
    identity: Option<EngineIdentity>,
    runs: Vec<(Job, EngineRun)>,
    /// Motions that the engine could not carry on, until then.
    stopped: Vec<(Job, EngineRun)>,
    failure: Option<EngineFailure>,
    wall: Duration,
}

impl EngineOutcome {
    /// Simulated time over the wall-clock time of all motions of an engine, with everything that
    /// belongs to them: building the plants, control, recording and the certified clearance.
    fn real_time_factor(&self) -> Option<f64> {
        let durations_s = self
            .runs
            .iter()
            .filter_map(|(_, run)| run.recording.time_s.last());
        let simulated_s: f64 = durations_s.sum();
        let wall_s = self.wall.as_secs_f64();
        (simulated_s > 0.0 && wall_s > 0.0).then(|| simulated_s / wall_s)
    }
}

impl Simulation<'_> {
    fn run(&self, engine: EngineName, harness: Option<&Harness>) -> EngineOutcome {
        let started = Instant::now();
        let mut outcome = EngineOutcome {
            engine,
            identity: None,
            runs: Vec::new(),
            stopped: Vec::new(),
            failure: None,
            wall: Duration::ZERO,
        };
        if let Err((during, message)) = self.run_jobs(engine, harness, &mut outcome) {
            let engine = engine.name().to_owned();
            outcome.failure = Some(EngineFailure {
                engine,
                during,
                message,
            });
        }
        outcome.wall = started.elapsed();
        outcome
    }

    fn run_jobs(
        &self,
        engine: EngineName,
        harness: Option<&Harness>,
        outcome: &mut EngineOutcome,
    ) -> Result<(), (Option<String>, String)> {
        let cell = self.reality.cell();
        let engines = &self.resolved.scenario.engines;
        let timestep_s = engines.timestep_ms * 1e-3;
        let start = |error: EngineError| (None, error.to_string());
        let servo = servo(self.resolved);
        let actuation = self.reality.actuation();
        for &job in self.jobs {
            let trajectory = self.plan(job).trajectory.as_ref().expect("jobs have one");
            let mass = cell.dynamics().mass_matrix(&trajectory.end());
            if let Some(why) = ClosedLoop::instability(&mass, &servo, actuation, timestep_s) {
                return Err((Some(self.in_words(job)), why.to_string()));
            }
        }
        let motions: Vec<Motion<'_>> = self
            .jobs
            .iter()
            .map(|job| Motion {
                servo: &servo,
                actuation,
                trajectory: self.plan(*job).trajectory.as_ref().expect("jobs have one"),
            })
            .collect();
        // The first motion that failed, in the order of the jobs.
        let mut failure: Option<(usize, EngineError)> = None;
        let mut finished = Vec::new();
        let mut stopped = Vec::new();
        let mut ended = |index: usize, result: Result<Recording, EngineError>| {
            match result {
                Ok(recording) => finished.push((index, self.measured(engine, index, recording))),
                Err(EngineError::Stopped { error, recording }) => {
                    if recording.state.len() > 1 {
                        stopped
                            .push((self.jobs[index], self.unfinished(engine, index, *recording)));
                    }
                    if failure.as_ref().is_none_or(|(first, _)| index < *first) {
                        failure = Some((index, *error));
                    }
                }
                Err(error) if failure.as_ref().is_none_or(|(first, _)| index < *first) => {
                    failure = Some((index, error));
                }
                Err(_) => {}
            }
            self.progress.step();
        };
        let outcome_of_all = match engine {
            EngineName::Rapier => {
                let settings = rapier_settings(engines);
                let mut plant = RapierPlant::new(cell, timestep_s, &settings).map_err(start)?;
                outcome.identity = Some(plant.identity());
                motions.iter().enumerate().try_for_each(|(index, motion)| {
                    let hooks = Hooks {
                        cancel: Some(self.cancel),
                        progress: None,
                    };
                    let Motion {
                        servo,
                        actuation,
                        trajectory,
                    } = motion;
                    match simulate(&mut plant, servo, actuation, trajectory, hooks) {
                        Err(EngineError::Cancelled) => return Err(EngineError::Cancelled),
                        result => ended(index, result),
                    }
                    Ok(())
                })
            }
            EngineName::Mujoco => {
                let harness = harness.expect("a MuJoCo run has a harness or its error");
                let mut process = match harness {
                    Ok(process) => process.lock().expect("one thread uses it"),
                    Err(message) => return Err((None, message.clone())),
                };
                let settings = mujoco_settings(engines);
                let arms = motions.len().min(FLEET_ARMS);
                let mut fleet = MujocoFleet::new(&mut process, cell, timestep_s, &settings, arms)
                    .map_err(start)?;
                outcome.identity = Some(fleet.identity());
                simulate_fleet(&mut fleet, &motions, Some(self.cancel), ended)
            }
        };
        finished.sort_by_key(|(index, _)| *index);
        let runs = finished.into_iter();
        outcome.runs = runs.map(|(index, run)| (self.jobs[index], run)).collect();
        stopped.sort_by_key(|(job, _)| (job.goal, job.configuration));
        outcome.stopped = stopped;
        match outcome_of_all {
            Err(EngineError::Cancelled) => return Ok(()),
            // The process served several motions: the first that is not there stands for all.
            Err(error) => {
                let missing = (0..self.jobs.len())
                    .find(|&index| outcome.runs.iter().all(|(job, _)| *job != self.jobs[index]));
                if let Some(index) = missing {
                    failure = Some((index, error));
                }
            }
            Ok(()) => {}
        }
        failure.map_or(Ok(()), |(index, error)| {
            Err((Some(self.in_words(self.jobs[index])), error.to_string()))
        })
    }

    fn plan(&self, job: Job) -> &ConfigurationPlan {
        &self.plans[job.goal].configurations[job.configuration]
    }

    /// Goal and configuration, for people.
    fn in_words(&self, job: Job) -> String {
        let goal = &self.resolved.goals[job.goal].name;
        format!("{goal} {}", self.plan(job).configuration)
    }

    /// A recording that broke off, with the clearances along it, sampled.
    fn unfinished(&self, engine: EngineName, index: usize, recording: Recording) -> EngineRun {
        let trajectory = self.plan(self.jobs[index]).trajectory.as_ref();
        let clearance = measure_clearance(
            self.reality.cell(),
            self.reality.model(),
            trajectory.expect("jobs have trajectories"),
            &recording,
            self.resolved.scenario.recording.period_ms * 1e-3,
        );
        EngineRun {
            engine,
            recording,
            clearance,
        }
    }

    /// A recording with the clearances along it.
    fn measured(&self, engine: EngineName, index: usize, recording: Recording) -> EngineRun {
        let (cell, model) = (self.reality.cell(), self.reality.model());
        let plan = self.plan(self.jobs[index]);
        let trajectory = plan.trajectory.as_ref().expect("jobs have trajectories");
        let period_s = self.resolved.scenario.recording.period_ms * 1e-3;
        let mut clearance = measure_clearance(cell, model, trajectory, &recording, period_s);
        let tolerance_m = self.resolved.scenario.planning.certificate_tolerance_mm * 1e-3;
        // As in a study: one search for the least, whoever needs the series besides.
        clearance.minima =
            recorded_clearance(cell, model, trajectory, &recording, period_s, tolerance_m);
        self.reality.allow_for_breath(&mut clearance);
        EngineRun {
            engine,
            recording,
            clearance,
        }
    }
}
