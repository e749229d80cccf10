//! The whole way of one scenario: plan, simulate, measure, judge.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use needlebench_cell::ResolvedScenario;
use needlebench_cell::scenario::EngineName;
use needlebench_clearance::ClearanceModel;
use needlebench_engine::mujoco::{HarnessProcess, ensure};
use needlebench_engine::{
    Actuation, EngineError, EngineIdentity, Hooks, MujocoPlant, MujocoSettings, Plant, RapierPlant,
    RapierSettings, Recording, Servo, ServoGains, simulate,
};
use needlebench_evaluation::report::{EngineFailure, Report};
use needlebench_evaluation::{ClearanceSeries, certify_recording, measure_clearance};
use needlebench_kinematics::NotUrGeometry;
use needlebench_planning::{ConfigurationPlan, GoalPlan, Planner, Rule};

use crate::assemble::assemble;
use crate::events::{self, EventRun, EventSimulation};
use crate::progress::Progress;

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

/// How to run a scenario.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunOptions {
    /// Engines; the scenario's own choice if `None`.
    pub engines: Option<EngineChoice>,
    /// Threads; more than there are engines and goals is no use.
    pub jobs: usize,
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
    /// It was interrupted; what was finished until then is here.
    pub interrupted: bool,
}

/// One motion to simulate.
#[derive(Debug, Clone, Copy)]
struct Job {
    goal: usize,
    configuration: usize,
}

/// Plans, simulates, measures and judges one scenario.
///
/// # Errors
/// [`NotUrGeometry`] if the robot is not a UR arm. A failing engine is no error: the report says
/// so and keeps what the other one measured.
pub(crate) fn run(
    resolved: &ResolvedScenario,
    options: &RunOptions,
    cancel: &AtomicBool,
    progress: &Progress,
) -> Result<ScenarioRun, NotUrGeometry> {
    let started = Instant::now();
    let mut timings = BTreeMap::new();
    let engines = match options.engines {
        None => {
            let mut engines = resolved.scenario.engines.run.clone();
            engines.sort_unstable();
            engines.dedup();
            engines
        }
        Some(EngineChoice::Rapier) => vec![EngineName::Rapier],
        Some(EngineChoice::Mujoco) => vec![EngineName::Mujoco],
        Some(EngineChoice::Both) => vec![EngineName::Rapier, EngineName::Mujoco],
    };
    let model = ClearanceModel::new(&resolved.cell);
    let planner = Planner::new(resolved, &model)?;

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
        model: &model,
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

    let mut events = events::stage(resolved, &model, &plans, options.jobs);
    let event_simulation = EventSimulation {
        resolved,
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
    for outcome in &mut outcomes {
        timings.insert(
            format!("{}_s", outcome.engine.name()),
            outcome.wall.as_secs_f64(),
        );
        for (job, run) in outcome.runs.drain(..) {
            runs[job.goal][job.configuration].push(run);
        }
    }
    let failures = outcomes
        .iter_mut()
        .filter_map(|outcome| outcome.failure.take())
        .chain(event_failures)
        .collect();
    let identities = outcomes
        .iter_mut()
        .filter_map(|outcome| outcome.identity.take())
        .collect();
    let interrupted = cancel.load(Ordering::Relaxed);
    let mut report = assemble(
        resolved, &planner, &model, &plans, &runs, &events, &engines, failures, identities, timings,
    );
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
        interrupted,
    })
}

/// Runs a scenario without progress and without a way to interrupt it.
///
/// # Errors
/// As the program's `run`.
pub fn run_scenario(
    resolved: &ResolvedScenario,
    options: &RunOptions,
) -> Result<ScenarioRun, NotUrGeometry> {
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
fn jobs(resolved: &ResolvedScenario, plans: &[GoalPlan]) -> Vec<Job> {
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

pub(crate) type Harness = Result<Mutex<HarnessProcess>, String>;

fn start_harness(resolved: &ResolvedScenario, progress: &Progress) -> Harness {
    let timeout = Duration::from_secs_f64(resolved.scenario.engines.harness_timeout_s);
    let environment =
        ensure(&mut |text| progress.message(text)).map_err(|error| error.to_string())?;
    HarnessProcess::start(&environment, timeout)
        .map(Mutex::new)
        .map_err(|error| error.to_string())
}

struct Simulation<'a> {
    resolved: &'a ResolvedScenario,
    plans: &'a [GoalPlan],
    model: &'a ClearanceModel,
    jobs: &'a [Job],
    cancel: &'a AtomicBool,
    progress: &'a Progress,
}

struct EngineOutcome {
    engine: EngineName,
    identity: Option<EngineIdentity>,
    runs: Vec<(Job, EngineRun)>,
    failure: Option<EngineFailure>,
    wall: Duration,
}

impl Simulation<'_> {
    fn run(&self, engine: EngineName, harness: Option<&Harness>) -> EngineOutcome {
        let started = Instant::now();
        let mut outcome = EngineOutcome {
            engine,
            identity: None,
            runs: Vec::new(),
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
        let cell = &self.resolved.cell;
        let engines = &self.resolved.scenario.engines;
        let timestep_s = engines.timestep_ms * 1e-3;
        let start = |error: EngineError| (None, error.to_string());
        let mut process;
        let mut plant: Box<dyn Plant> = match engine {
            EngineName::Rapier => {
                let settings = rapier_settings(engines);
                Box::new(RapierPlant::new(cell, timestep_s, &settings).map_err(start)?)
            }
            EngineName::Mujoco => {
                let harness = harness.expect("a MuJoCo run has a harness or its error");
                process = match harness {
                    Ok(process) => process.lock().expect("one thread uses it"),
                    Err(message) => return Err((None, message.clone())),
                };
                let settings = mujoco_settings(engines);
                Box::new(
                    MujocoPlant::new(&mut process, cell, timestep_s, &settings).map_err(start)?,
                )
            }
        };
        outcome.identity = Some(plant.identity());
        let servo = servo(self.resolved);
        let actuation = Actuation::default();
        for &job in self.jobs {
            let goal = &self.resolved.goals[job.goal];
            let plan = &self.plans[job.goal].configurations[job.configuration];
            let trajectory = plan.trajectory.as_ref().expect("jobs have trajectories");
            let hooks = Hooks {
                cancel: Some(self.cancel),
                progress: None,
            };
            let recording = match simulate(plant.as_mut(), &servo, &actuation, trajectory, hooks) {
                Ok(recording) => recording,
                Err(EngineError::Cancelled) => return Ok(()),
                Err(error) => {
                    let during = format!("{} {}", goal.name, plan.configuration);
                    return Err((Some(during), error.to_string()));
                }
            };
            let period_s = self.resolved.scenario.recording.period_ms * 1e-3;
            let mut clearance =
                measure_clearance(cell, self.model, trajectory, &recording, period_s);
            let tolerance_m = self.resolved.scenario.planning.certificate_tolerance_mm * 1e-3;
            certify_recording(
                &mut clearance,
                cell,
                self.model,
                trajectory,
                &recording,
                tolerance_m,
            );
            outcome.runs.push((
                job,
                EngineRun {
                    engine,
                    recording,
                    clearance,
                },
            ));
            self.progress.step();
        }
        Ok(())
    }
}

pub(crate) fn rapier_settings(
    engines: &needlebench_cell::scenario::EnginesSection,
) -> RapierSettings {
    RapierSettings {
        contact_natural_frequency_hz: engines.rapier.contact_natural_frequency_hz,
        contact_damping_ratio: engines.rapier.contact_damping_ratio,
        contact_sweeps: engines.rapier.contact_sweeps as usize,
        friction: engines.friction,
        ..RapierSettings::default()
    }
}

pub(crate) fn mujoco_settings(
    engines: &needlebench_cell::scenario::EnginesSection,
) -> MujocoSettings {
    MujocoSettings {
        contact_stiffness_per_s2: engines.mujoco.contact_stiffness_per_s2,
        contact_damping_per_s: engines.mujoco.contact_damping_per_s,
        contact_impedance: engines.mujoco.contact_impedance,
        friction: engines.friction,
        ..MujocoSettings::default()
    }
}

pub(crate) fn servo(resolved: &ResolvedScenario) -> Servo {
    let controller = &resolved.scenario.controller;
    Servo {
        dynamics: resolved.cell.dynamics(),
        gains: ServoGains {
            kp_nm_per_rad: controller.stiffness_nm_rad,
            kd_nms_per_rad: controller.damping_nms_rad,
        },
        effort_limit_nm: resolved.cell.robot.limits.efforts_nm(),
    }
}
