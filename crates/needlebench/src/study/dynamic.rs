//! A case with its motion in the engines.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use needlebench_cell::ResolvedScenario;
use needlebench_cell::scenario::EngineName;
use needlebench_clearance::ClearanceModel;
use needlebench_engine::{
    ClosedLoop, EngineError, Hooks, Motion, MujocoFleet, RapierPlant, Recording, Servo, simulate,
    simulate_fleet,
};
use needlebench_evaluation::adjudication::judge_differences;
use needlebench_evaluation::report::{CriterionResult, Status};
use needlebench_evaluation::{ClearanceSeries, judge, recorded_clearance};
use needlebench_kinematics::trajectory::JointTrajectory;
use needlebench_planning::GoalPlan;
use needlebench_study::{Outcome, Row};

use crate::events::{self, EventRun, EventSimulation};
use crate::pipeline::{EngineRun, FLEET_ARMS, jobs};
use crate::plants::{Harness, mujoco_settings, rapier_settings};
use crate::reality::servo;
use crate::trial::Trial;

use super::engines::EngineSet;
use super::planned::{Stage, eight};
use super::rows::{broken_rule, row, set_measured};

/// Nobody interrupts a case: a study ends between two of them.
static NEVER: AtomicBool = AtomicBool::new(false);

/// The rows of a case, and where its time went.
#[derive(Debug, Clone, PartialEq)]
pub struct DynamicCase {
    /// The rows.
    pub rows: [Row; 8],
    /// Wall-clock times.
    pub cost: CaseCost,
}

/// Wall-clock times of a dynamic case.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct CaseCost {
    /// Candidates and motions of all configurations.
    pub planning: Duration,
    /// rapier: building its plant, motions under the servo, clearances along them.
    pub rapier: Duration,
    /// The same in MuJoCo.
    pub mujoco: Duration,
    /// Everything else: the models of the cell before, needles, criteria and rows after.
    pub other: Duration,
}

impl CaseCost {
    /// All together.
    pub fn total(&self) -> Duration {
        self.planning + self.rapier + self.mujoco + self.other
    }
}

/// The rows of a case by the motions in the engines: what [`run_scenario`](crate::run_scenario) would
/// report of the same scenario, number for number.
///
/// A configuration whose motion an engine cannot carry out has [`Outcome::Failed`] with the detail
/// `engine_failure rapier`, and no measured numbers.
///
/// # Errors
/// If the scenario has not exactly one goal or cannot be planned at all; if the MuJoCo process cannot
/// be started, or fails twice in this case.
pub fn dynamic_rows(
    resolved: &ResolvedScenario,
    engines: &[EngineName],
    set: &mut EngineSet,
) -> Result<[Row; 8], String> {
    Ok(dynamic_case(resolved, engines, set)?.rows)
}

/// [`dynamic_rows`] with the times that the parts took.
///
/// # Errors
/// As [`dynamic_rows`].
pub fn dynamic_case(
    resolved: &ResolvedScenario,
    engines: &[EngineName],
    set: &mut EngineSet,
) -> Result<DynamicCase, String> {
    let started = Instant::now();
    let mut cost = CaseCost::default();
    let model = ClearanceModel::new(&resolved.cell);
    let stage = Stage::new(resolved, &model)?;
    let plan = timed(&mut cost.planning, || stage.plan());
    let mut case = Case::new(&stage, plan);
    if engines.contains(&EngineName::Rapier) {
        timed(&mut cost.rapier, || case.run_rapier());
    }
    if engines.contains(&EngineName::Mujoco) {
        timed(&mut cost.mujoco, || case.run_mujoco(set))?;
    }
    let rows = case.rows();
    cost.other = started.elapsed().saturating_sub(cost.total());
    Ok(DynamicCase { rows, cost })
}

fn timed<T>(total: &mut Duration, work: impl FnOnce() -> T) -> T {
    let started = Instant::now();
    let result = work();
    *total += started.elapsed();
    result
}

/// One case under way.
struct Case<'a> {
    stage: &'a Stage<'a>,
    plans: [GoalPlan; 1],
    servo: Servo,
    /// Configurations that are simulated.
    jobs: Vec<usize>,
    /// Those of them whose servo is stable: the engines are asked about no others.
    stable: Vec<usize>,
    /// By configuration.
    runs: Vec<Vec<EngineRun>>,
    /// By configuration: the first engine that failed it.
    failed: Vec<Option<EngineName>>,
    events: Vec<EventRun>,
    engines: usize,
}

impl<'a> Case<'a> {
    fn new(stage: &'a Stage<'a>, plan: GoalPlan) -> Self {
        let plans = [plan];
        let count = plans[0].configurations.len();
        let mut case = Self {
            jobs: jobs(stage.resolved, &plans)
                .into_iter()
                .map(|job| job.configuration)
                .collect(),
            stable: Vec::new(),
            events: events::stage(stage.resolved, &stage.reality, &plans, 1),
            plans,
            servo: servo(stage.resolved),
            stage,
            runs: vec![Vec::new(); count],
            failed: vec![None; count],
            engines: 0,
        };
        let reality = &stage.reality;
        let dynamics = reality.cell().dynamics();
        let is_stable = |&job: &usize| {
            let mass = dynamics.mass_matrix(&case.trajectory(job).end());
            let (servo, actuation) = (&case.servo, reality.actuation());
            ClosedLoop::instability(&mass, servo, actuation, case.timestep_s()).is_none()
        };
        case.stable = case.jobs.iter().copied().filter(is_stable).collect();
        case
    }

    fn trajectory(&self, configuration: usize) -> &JointTrajectory {
        let plan = &self.plans[0].configurations[configuration];
        plan.trajectory.as_ref().expect("jobs have one")
    }

    fn timestep_s(&self) -> f64 {
        self.stage.resolved.scenario.engines.timestep_ms * 1e-3
    }

    fn motion(&self, configuration: usize) -> Motion<'_> {
        Motion {
            servo: &self.servo,
            actuation: self.stage.reality.actuation(),
            trajectory: self.trajectory(configuration),
        }
    }

    fn run_rapier(&mut self) {
        let cell = self.stage.reality.cell();
        let settings = rapier_settings(&self.stage.resolved.scenario.engines);
        let mut done = Vec::new();
        if let Ok(mut plant) = RapierPlant::new(cell, self.timestep_s(), &settings) {
            for &job in &self.stable {
                let Motion {
                    servo,
                    actuation,
                    trajectory,
                } = self.motion(job);
                let hooks = Hooks::default();
                if let Ok(recording) = simulate(&mut plant, servo, actuation, trajectory, hooks) {
                    done.push((job, recording));
                }
            }
        }
        self.keep(EngineName::Rapier, done);
        self.run_events(EngineName::Rapier, None);
    }

    fn run_mujoco(&mut self, set: &mut EngineSet) -> Result<(), String> {
        let resolved = self.stage.resolved;
        let mut again = false;
        loop {
            let harness = set.mujoco(resolved)?;
            let done = self.in_fleet(harness);
            let failure = harness_failure(harness);
            let Some(failure) = failure else {
                self.keep(EngineName::Mujoco, done);
                self.run_events(EngineName::Mujoco, Some(harness));
                let Some(failure) = harness_failure(harness) else {
                    return Ok(());
                };
                set.discard();
                return Err(failure);
            };
            set.discard();
            if again {
                return Err(failure);
            }
            again = true;
        }
    }

    /// The motions in MuJoCo that came to their end, as many at a time as a fleet has arms.
    fn in_fleet(&self, harness: &Harness) -> Vec<(usize, Recording)> {
        let Ok(process) = harness else {
            return Vec::new();
        };
        let mut process = process.lock().expect("one thread uses it");
        let stable = &self.stable;
        let motions: Vec<Motion<'_>> = stable.iter().map(|&job| self.motion(job)).collect();
        if motions.is_empty() || process.clear().is_err() {
            return Vec::new();
        }
        let cell = self.stage.reality.cell();
        let settings = mujoco_settings(&self.stage.resolved.scenario.engines);
        let arms = motions.len().min(FLEET_ARMS);
        let mut done = Vec::new();
        let fleet = MujocoFleet::new(&mut process, cell, self.timestep_s(), &settings, arms);
        if let Ok(mut fleet) = fleet {
            let ended = |index: usize, result: Result<Recording, EngineError>| {
                if let Ok(recording) = result {
                    done.push((stable[index], recording));
                }
            };
            // If the process fails, the caller sees it and takes another.
            let _ = simulate_fleet(&mut fleet, &motions, None, ended);
        }
        done
    }

    /// Takes the recordings of an engine; a job without one is a failure of the engine.
    fn keep(&mut self, engine: EngineName, done: Vec<(usize, Recording)>) {
        self.engines += 1;
        for job in &self.jobs {
            if done.iter().all(|(other, _)| other != job) {
                self.failed[*job].get_or_insert(engine);
            }
        }
        for (job, recording) in done {
            let run = self.measured(engine, job, recording);
            self.runs[job].push(run);
        }
    }

    /// A recording with its least clearances.
    fn measured(&self, engine: EngineName, job: usize, recording: Recording) -> EngineRun {
        let stage = self.stage;
        let (cell, model) = (stage.reality.cell(), stage.reality.model());
        let trajectory = self.trajectory(job);
        let scenario = &stage.resolved.scenario;
        let mut clearance = ClearanceSeries {
            minima: recorded_clearance(
                cell,
                model,
                trajectory,
                &recording,
                scenario.recording.period_ms * 1e-3,
                scenario.planning.certificate_tolerance_mm * 1e-3,
            ),
            time_s: Vec::new(),
            distance_m: BTreeMap::new(),
        };
        stage.reality.allow_for_breath(&mut clearance);
        EngineRun {
            engine,
            recording,
            clearance,
        }
    }

    /// Contacts, stops and ways back that the scenario asks for.
    fn run_events(&mut self, engine: EngineName, harness: Option<&Harness>) {
        let mut events = std::mem::take(&mut self.events);
        let simulation = EventSimulation {
            resolved: self.stage.resolved,
            reality: &self.stage.reality,
            plans: &self.plans,
            harness,
            cancel: &NEVER,
        };
        for run in &mut events {
            let (done, failure) = simulation.run(engine, std::slice::from_ref(run));
            run.engines
                .extend(done.into_iter().map(|done| (engine, done)));
            if failure.is_some() {
                self.failed[run.configuration].get_or_insert(engine);
            }
        }
        self.events = events;
    }

    fn rows(mut self) -> [Row; 8] {
        // What one engine measured where another failed is no result of the configuration.
        for (runs, failed) in self.runs.iter_mut().zip(&self.failed) {
            if failed.is_some() {
                runs.clear();
            }
        }
        let Stage {
            resolved,
            planner,
            reality,
            ..
        } = self.stage;
        let envelope = &resolved.scenario.engines.envelope;
        let trials: Vec<Trial> = self
            .runs
            .iter()
            .map(|runs| Trial {
                referee: None,
                adjudication: match runs.as_slice() {
                    [a, b] => {
                        let pair = [&a.recording, &b.recording];
                        let (cell, goal) = (reality.cell(), reality.goal(0));
                        Some(judge_differences(cell, goal, envelope, pair))
                    }
                    _ => None,
                },
            })
            .collect();
        let [plan] = &self.plans;
        let report = self.stage.report(plan, &self.runs, &trials, &self.events);
        let mut reports = [report];
        let criteria = &resolved.scenario.criteria;
        let (_, checked) = judge(&mut reports, &resolved.goals, criteria, self.engines == 2);
        let rows = plan
            .configurations
            .iter()
            .zip(&reports[0].configurations)
            .zip(&self.failed);
        eight(rows.map(|((plan, report), failed)| {
            let mut row = row(planner, plan, report);
            set_measured(&mut row, report);
            (row.outcome, row.detail) = match (broken_rule(plan), failed, report.status) {
                (Some(rule), _, _) => (Outcome::Rejected, rule),
                (None, Some(engine), _) => (
                    Outcome::Failed,
                    format!("engine_failure {}", engine.name()).into(),
                ),
                (None, None, Status::Ok) => (Outcome::Ok, "".into()),
                (None, None, _) => (Outcome::Failed, missed(&checked, report.label)),
            };
            row
        }))
    }
}

/// The first criterion that a configuration misses.
fn missed(checked: &[CriterionResult], label: &str) -> Cow<'static, str> {
    checked
        .iter()
        .find(|result| {
            !result.pass && result.label.as_deref() == Some(label) && result.criterion != "expected"
        })
        .map_or("no_engine".into(), |result| result.criterion.clone().into())
}

/// Why the process serves nobody any more.
fn harness_failure(harness: &Harness) -> Option<String> {
    match harness {
        Ok(process) => process
            .lock()
            .expect("one thread uses it")
            .failure()
            .map(ToString::to_string),
        Err(message) => Some(message.clone()),
    }
}
