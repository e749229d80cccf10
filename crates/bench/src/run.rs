//! The whole pipeline of one scenario: plan, simulate, stage events, adjudicate, budget, assemble.
//!
//! Each stage is a module that takes what the stages before it made; see [`run`].

use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use needlebench_cell::ClearanceClass;
use needlebench_clearance::ClearanceModel;
use needlebench_engine::{Engine, EngineIdentity, EnginePool, engine_names};
use needlebench_evaluation::report::{
    EngineFailure, GoalReport, NotJudged, Report, Status, Verdict,
};
use needlebench_evaluation::trace::trace;
use needlebench_evaluation::{
    comparing_engines, criteria_with_limits, excitation as excited, iso9283 as protocol,
};
use needlebench_parallel::{Control, Progress, Silent, in_parallel};
use needlebench_planning::GoalPlan;
use needlebench_scenario::ResolvedScenario;
use needlebench_scenario::study::StudyMode;

use crate::adjudication::Adjudicator;
use crate::assemble::{Results, assemble};
use crate::budgets::budgets;
use crate::events::{self, EventRun};
use crate::excitation;
use crate::iso9283;
use crate::plan::{Job, Planned, plan_goals};
use crate::probability::probabilities;
use crate::rtde::RtdeSource;
use crate::runnable::Runnable;
use crate::scenario_run::{RealArm, RunError, RunOptions, ScenarioRun, StoppedRun};
use crate::setup::Setup;
use crate::simulate::{Detail, EngineRun, SimulatedMotions, Simulation};

/// Plans, simulates, measures and judges one scenario.
///
/// # Errors
/// [`RunError`]. A failing engine is no error: the report says so and keeps what the others measured.
pub fn run(
    runnable: &Runnable,
    options: &RunOptions,
    cancel: &AtomicBool,
    progress: &dyn Progress,
) -> Result<ScenarioRun, RunError> {
    let engines = options.chosen_engines(runnable.scenario())?;
    let name = &*runnable.scenario().scenario.name;
    let _stage = tracing::info_span!("run", scenario = name).entered();
    tracing::info!(engines = ?engine_names(&engines), threads = options.jobs, "begins");
    let control = Control {
        threads: options.jobs,
        cancel,
        progress,
    };
    let mut finished = if let Some(plan) = runnable.excitation() {
        excitation::run(runnable.scenario(), plan, &engines, &control)?
    } else if let Some(plan) = runnable.protocol() {
        iso9283::run(runnable.scenario(), plan, &engines, &control)?
    } else {
        run_goals(runnable.scenario(), options, &engines, &control, plan_goals)?
    };
    judge_rest(&mut finished.report, runnable.scenario(), options, &engines);
    Ok(finished)
}

/// Evaluates what no configuration decides by itself, and what requirements come to.
pub(crate) fn judge_rest(
    report: &mut Report,
    resolved: &ResolvedScenario,
    options: &RunOptions,
    engines: &[&'static dyn Engine],
) {
    judge_alone(report, resolved, options, engines);
    judge_unseen(report, resolved);
    judge_absent(report, resolved, engines);
    trace(report, &resolved.scenario.requirements);
}

/// Beginning of the note on criteria that the choice of engines leaves out.
pub const LEFT_OUT: &str = "not evaluated, as the command selects";

/// What engines differ by takes two of them. Where one ran alone, the criteria on it are not evaluated; where it was
/// the command that left the other one out, a note says which those are.
fn judge_alone(
    report: &mut Report,
    resolved: &ResolvedScenario,
    options: &RunOptions,
    engines: &[&'static dyn Engine],
) {
    let keys = comparing_engines(&resolved.scenario.criteria);
    let [only] = engines else { return };
    if keys.is_empty() {
        return;
    }
    let of_scenario = RunOptions {
        engines: None,
        ..options.clone()
    };
    let own = of_scenario.chosen_engines(resolved);
    if own.is_ok_and(|own| own.len() > 1) {
        let note = format!("{LEFT_OUT} {} alone: {}", only.name(), keys.join(", "));
        report.notes.push(note);
        return;
    }
    let reason = format!(
        "requires two engines; the scenario runs {} alone",
        only.name()
    );
    leave_open(report, &keys, &reason);
}

/// The clearance of a part without a shape is unknown: no class that it belongs to is evaluated.
fn judge_unseen(report: &mut Report, resolved: &ResolvedScenario) {
    for (class, parts) in &resolved.cell.unseen {
        let key = format!("min_clearance_mm.{}", class.name());
        let reason = format!("no collision shape known for {}", parts.join(", "));
        // What the other parts miss is missed.
        report
            .criteria
            .retain(|result| result.criterion != key || !result.pass);
        leave_open(report, &[&key], &reason);
    }
}

/// A required criterion for which the scenario has no value, such as the clearance of a gantry that is not in the
/// room, is not evaluated.
fn judge_absent(report: &mut Report, resolved: &ResolvedScenario, engines: &[&'static dyn Engine]) {
    let moved = |goal: &GoalReport| {
        let mut all = goal.configurations.iter();
        all.any(|each| each.status != Status::Rejected)
    };
    if !report.goals.iter().any(moved) {
        return;
    }
    let criteria = &resolved.scenario.criteria;
    let compared = comparing_engines(criteria);
    for key in criteria_with_limits(criteria, StudyMode::Dynamic) {
        let is_known = report.criteria.iter().any(|each| each.criterion == key)
            || report.not_judged.iter().any(|each| each.criterion == key);
        let said = engines.len() == 1 && compared.contains(&key);
        if !is_known && !said {
            let class = key
                .strip_prefix("min_clearance_mm.")
                .and_then(ClearanceClass::named);
            let pairs = &resolved.cell.pairs;
            let absent = class.filter(|class| {
                *class != ClearanceClass::NeedleRoute
                    && pairs.iter().all(|pair| pair.class != *class)
            });
            let reason = match absent.and_then(|class| class.name().strip_prefix("robot_")) {
                Some(body) => format!("no {body} in the room"),
                None => "no value available".to_owned(),
            };
            leave_open(report, &[key], &reason);
        }
    }
}

/// Criteria of all that moved are not evaluated.
pub(crate) fn leave_open(report: &mut Report, keys: &[&str], reason: &str) {
    let mut subjects: Vec<(String, Option<String>)> = Vec::new();
    if report.iso9283.is_some() {
        subjects.push((protocol::SUBJECT.to_owned(), None));
    } else if report.excitation.is_some() {
        subjects.push((excited::SUBJECT.to_owned(), None));
    }
    for goal in &report.goals {
        for configuration in &goal.configurations {
            if configuration.status != Status::Rejected {
                subjects.push((goal.name.clone(), Some(configuration.label.to_owned())));
            }
        }
    }
    let all = subjects.into_iter().flat_map(|(goal, label)| {
        let keys = keys.iter();
        keys.map(move |key| (goal.clone(), label.clone(), (*key).to_owned()))
    });
    not_judged(report, all.collect(), reason);
}

/// Criteria that are not evaluated, each with the goal and the configuration that it is of.
fn not_judged(report: &mut Report, all: Vec<(String, Option<String>, String)>, reason: &str) {
    for (goal, label, criterion) in all {
        let of_goal = report.goals.iter_mut().filter(|each| each.name == goal);
        let mut configurations = of_goal.flat_map(|each| &mut each.configurations);
        if let Some(found) = configurations.find(|each| label.as_deref() == Some(each.label)) {
            found.not_judged += 1;
        }
        report.not_judged.push(NotJudged {
            goal,
            label,
            engine: None,
            criterion,
            reason: reason.to_owned(),
            requirement: None,
        });
    }
    report.verdict = Verdict::of(
        report.verdict == Verdict::Fail,
        !report.not_judged.is_empty(),
    );
}

/// Runs a scenario without progress and without a way to interrupt it.
///
/// # Errors
/// As [`run`].
pub fn run_scenario(
    resolved: &ResolvedScenario,
    options: &RunOptions,
) -> Result<ScenarioRun, RunError> {
    let runnable = Runnable::new(resolved.clone());
    run(&runnable, options, &AtomicBool::new(false), &Silent)
}

/// Simulates, measures and judges the plans that `plan` makes of the goals.
pub(crate) fn run_goals(
    resolved: &ResolvedScenario,
    options: &RunOptions,
    engines: &[&'static dyn Engine],
    control: &Control<'_>,
    plan: impl FnOnce(&Setup<'_>, &Control<'_>) -> Planned,
) -> Result<ScenarioRun, RunError> {
    let mut timings = Timings::start();
    let model = ClearanceModel::new(&resolved.cell);
    let setup = Setup::new(resolved, &model)?;
    let pool = EnginePool::new(engines);
    let planned = plan_while_engines_start(&setup, &pool, engines, control, plan);
    timings.lap("planning_s");
    let plans = &planned.goals;
    tell_plans(resolved, plans);

    tracing::info!(
        motions = planned.simulated.len(),
        "simulates in each engine"
    );
    let simulation = Simulation {
        setup: &setup,
        plans,
        jobs: &planned.simulated,
        detail: Detail::Series,
        restart: false,
    };
    control.progress.message("simulating");
    control
        .progress
        .expect((planned.simulated.len() * engines.len()) as u64);
    let simulated = in_parallel(control.threads, engines, |engine| {
        simulation.run_in(&pool, *engine, control)
    });
    timings.lap("simulation_s");
    tracing::info!("simulated");
    for made in &simulated {
        timings.of_engine(made);
    }

    let (events, event_failures) = run_events(&setup, &planned, &pool, engines, control);
    let failures = simulated
        .iter()
        .filter_map(|made| made.failure(&simulation));
    let failures: Vec<EngineFailure> = failures.chain(event_failures).collect();
    let mut identities: Vec<EngineIdentity> = Vec::new();
    identities.extend(simulated.iter().filter_map(|made| made.identity.clone()));
    let (runs, stopped) = by_configuration(plans, simulated);

    let refereed = Instant::now();
    let adjudicator = Adjudicator {
        setup: &setup,
        plans,
        runs: &runs,
        engines,
        pool: &pool,
        always: options.referee,
    };
    let adjudications = adjudicator.judge_all(control);
    if adjudications.identity.is_some() {
        timings.set("referee_s", refereed.elapsed().as_secs_f64());
    }
    identities.extend(adjudications.identity);

    tracing::info!(
        events = events.len(),
        failures = failures.len(),
        "events staged"
    );
    let budgets = budgets(&setup, plans, control.threads);
    tracing::info!("error budgets computed");
    let probabilities = probabilities(&setup, plans, control.threads, true);
    tracing::info!("probabilities estimated");
    let interrupted = control.is_cancelled();
    let results = Results {
        plans,
        runs: &runs,
        events: &events,
        budgets: &budgets,
        probabilities: &probabilities,
        adjudicated: &adjudications.by_goal,
        engines: &engine_names(engines),
        failures,
        identities,
        timings: timings.all,
    };
    let mut report = assemble(&setup, results);
    report.notes.extend(adjudications.notes);
    if interrupted {
        report
            .notes
            .push("run interrupted: motions not simulated by then are missing".to_owned());
    }
    let real_arm = RealArm::of(setup.real.cell());
    Ok(ScenarioRun {
        report,
        plans: planned.goals,
        runs,
        events,
        stopped,
        iso9283: None,
        excitation: None,
        rtde: Some(RtdeSource::of(&setup)),
        interrupted,
        real_arm,
    })
}

/// What was decided of each configuration.
fn tell_plans(resolved: &ResolvedScenario, plans: &[GoalPlan]) {
    for (goal, plan) in resolved.goals.iter().zip(plans) {
        let _stage = tracing::info_span!("plan", goal = %goal.name).entered();
        for each in &plan.configurations {
            match each.rejections.first() {
                None => tracing::info!(configuration = %each.configuration, "feasible"),
                Some(first) => tracing::info!(
                    configuration = %each.configuration,
                    rule = first.rule.name(),
                    value = first.value,
                    limit = first.limit,
                    unit = first.unit,
                    detail = first.detail,
                    "infeasible"
                ),
            }
        }
    }
}

/// Plans all goals; what engines need is started meanwhile.
fn plan_while_engines_start(
    setup: &Setup<'_>,
    pool: &EnginePool,
    engines: &[&'static dyn Engine],
    control: &Control<'_>,
    plan: impl FnOnce(&Setup<'_>, &Control<'_>) -> Planned,
) -> Planned {
    let settings = &setup.resolved.scenario.engines.settings();
    std::thread::scope(|scope| {
        for engine in engines {
            scope.spawn(move || {
                let mut tell = |text: &str| control.progress.notice(text);
                // Whoever asks the engine for something is told why it could not start.
                let _ = pool.start(*engine, settings, &mut tell);
            });
        }
        plan(setup, control)
    })
}

/// Stages the events of all feasible configurations, and simulates them in all engines.
fn run_events(
    setup: &Setup<'_>,
    planned: &Planned,
    pool: &EnginePool,
    engines: &[&'static dyn Engine],
    control: &Control<'_>,
) -> (Vec<EventRun>, Vec<EngineFailure>) {
    let mut staged = events::stage(setup, planned, control.threads);
    let done = in_parallel(control.threads, engines, |engine| {
        events::simulate(
            setup,
            &planned.goals,
            &staged,
            pool,
            *engine,
            false,
            control,
        )
    });
    let mut failures = Vec::new();
    for (engine, done) in engines.iter().zip(done) {
        failures.extend(done.failure);
        for (run, events) in staged.iter_mut().zip(done.by_run) {
            run.engines
                .extend(events.map(|events| (engine.name(), events)));
        }
    }
    (staged, failures)
}

/// Recordings by goal and configuration, and those that broke off.
fn by_configuration(
    plans: &[GoalPlan],
    simulated: Vec<SimulatedMotions>,
) -> (Vec<Vec<Vec<EngineRun>>>, Vec<StoppedRun>) {
    let empty = |plan: &GoalPlan| plan.configurations.iter().map(|_| Vec::new()).collect();
    let mut runs: Vec<Vec<Vec<EngineRun>>> = plans.iter().map(empty).collect();
    let mut stopped = Vec::new();
    for made in simulated {
        for (job, run) in made.runs {
            runs[job.goal][job.configuration].push(run);
        }
        for failed in made.failed {
            let Job {
                goal,
                configuration,
            } = failed.job;
            stopped.extend(failed.run.map(|run| StoppedRun {
                goal,
                configuration,
                run,
            }));
        }
    }
    (runs, stopped)
}

/// Wall-clock times for the report, s.
struct Timings {
    lap: Instant,
    all: BTreeMap<String, f64>,
}

impl Timings {
    fn start() -> Self {
        Self {
            lap: Instant::now(),
            all: BTreeMap::new(),
        }
    }

    fn set(&mut self, key: &str, value: f64) {
        self.all.insert(key.to_owned(), value);
    }

    /// Time since the last lap.
    fn lap(&mut self, key: &str) {
        self.set(key, self.lap.elapsed().as_secs_f64());
        self.lap = Instant::now();
    }

    fn of_engine(&mut self, made: &SimulatedMotions) {
        let name = made.engine.name();
        self.set(&format!("{name}_s"), made.wall.as_secs_f64());
        if let Some(factor) = made.real_time_factor() {
            self.set(&format!("{name}_real_time_factor"), factor);
        }
    }
}
