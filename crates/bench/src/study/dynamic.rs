//! A case with its motion in the engines.

use std::borrow::Cow;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use needlebench_clearance::ClearanceModel;
use needlebench_engine::{Engine, EngineError, EnginePool, engine_names};
use needlebench_evaluation::judge;
use needlebench_evaluation::report::{Judged, Status};
use needlebench_parallel::{Control, Silent};
use needlebench_scenario::ResolvedScenario;
use needlebench_scenario::study::StudyMode;
use needlebench_study::Outcome;

use crate::adjudication::Adjudicated;
use crate::events::{self, EventRun};
use crate::plan::{Planned, plan_goals};
use crate::setup::Setup;
use crate::simulate::{Detail, EngineRun, Simulation};

use super::failure::CaseFailure;
use super::likely::Likely;
use super::planned::{case_report, case_setup, eight};
use super::rows::{CaseRow, broken_rule};

/// Prefix of the detail of a configuration whose motion an engine could not execute; the engine follows.
pub const ENGINE_FAILURE: &str = "engine_failure";

/// Nobody interrupts a case: a study ends between two of them.
static NEVER: AtomicBool = AtomicBool::new(false);

/// The rows of a case, and where its time went.
#[derive(Debug, Clone, PartialEq)]
pub struct DynamicCase {
    /// The rows.
    pub rows: [CaseRow; 8],
    /// Wall-clock times.
    pub cost: CaseCost,
}

/// Wall-clock times of a dynamic case.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct CaseCost {
    /// Candidates and motions of all configurations.
    pub planning: Duration,
    /// By engine: building its arms, motions under the servo, clearances along them.
    pub engines: Vec<(&'static str, Duration)>,
    /// Everything else: the models of the cell before, needles, criteria and rows after.
    pub other: Duration,
}

impl CaseCost {
    /// All together.
    pub fn total(&self) -> Duration {
        let engines: Duration = self.engines.iter().map(|(_, time)| *time).sum();
        self.planning + engines + self.other
    }

    /// Time of one engine.
    pub fn of(&self, engine: &str) -> Duration {
        let own = self.engines.iter().filter(|(name, _)| *name == engine);
        own.map(|(_, time)| *time).sum()
    }
}

/// The rows of a case by the motions in the engines: what [`run_scenario`](crate::run_scenario) would
/// report of the same scenario, number for number.
///
/// A configuration whose motion an engine cannot execute is [`Outcome::NotJudged`] with the detail
/// `engine_failure rapier`, and no measured numbers.
///
/// # Errors
/// If the scenario has not exactly one goal or cannot be planned at all; if an engine cannot be
/// started, or its process fails twice in this case.
pub fn dynamic_rows(
    resolved: &ResolvedScenario,
    engines: &[&'static dyn Engine],
    pool: &EnginePool,
) -> Result<[CaseRow; 8], CaseFailure> {
    Ok(dynamic_case(resolved, engines, pool, Likely::AsJudged)?.rows)
}

/// [`dynamic_rows`] with probabilities, and the times that the parts took.
///
/// # Errors
/// As [`dynamic_rows`].
pub fn dynamic_case(
    resolved: &ResolvedScenario,
    engines: &[&'static dyn Engine],
    pool: &EnginePool,
    likely: Likely,
) -> Result<DynamicCase, CaseFailure> {
    let started = Instant::now();
    let mut cost = CaseCost::default();
    let model = ClearanceModel::new(&resolved.cell);
    let setup = case_setup(resolved, &model)?;
    let control = Control {
        threads: 1,
        cancel: &NEVER,
        progress: &Silent,
    };
    let planning = Instant::now();
    let planned = plan_goals(&setup, &control);
    cost.planning = planning.elapsed();
    let mut case = Case::new(&setup, &planned);
    for &engine in engines {
        let begun = Instant::now();
        if let Err(error) = case.run_in(engine, pool, &control) {
            // The next case may find it well again.
            pool.discard(engine);
            return Err(error.into());
        }
        cost.engines.push((engine.name(), begun.elapsed()));
    }
    let rows = case.rows(&engine_names(engines), likely);
    cost.other = started.elapsed().saturating_sub(cost.total());
    Ok(DynamicCase { rows, cost })
}

/// One case under way.
struct Case<'a> {
    setup: &'a Setup<'a>,
    planned: &'a Planned,
    /// By configuration.
    runs: Vec<Vec<EngineRun>>,
    /// By configuration: the first engine that failed it.
    failed: Vec<Option<&'static str>>,
    events: Vec<EventRun>,
}

impl<'a> Case<'a> {
    fn new(setup: &'a Setup<'a>, planned: &'a Planned) -> Self {
        let count = planned.goals[0].configurations.len();
        Self {
            setup,
            planned,
            runs: vec![Vec::new(); count],
            failed: vec![None; count],
            events: events::stage(setup, planned, 1),
        }
    }

    /// Planned motions and events in one engine.
    ///
    /// # Errors
    /// What ended the engine itself.
    fn run_in(
        &mut self,
        engine: &'static dyn Engine,
        pool: &EnginePool,
        control: &Control<'_>,
    ) -> Result<(), EngineError> {
        let simulation = Simulation {
            setup: self.setup,
            plans: &self.planned.goals,
            jobs: &self.planned.simulated,
            detail: Detail::Least,
            restart: true,
        };
        let made = simulation.run_in(pool, engine, control);
        if let Some(error) = made.error {
            return Err(error);
        }
        for motion in &made.failed {
            self.failed[motion.job.configuration].get_or_insert(engine.name());
        }
        for (job, run) in made.runs {
            self.runs[job.configuration].push(run);
        }
        let done = events::simulate(
            self.setup,
            &self.planned.goals,
            &self.events,
            pool,
            engine,
            true,
            control,
        );
        if let Some(error) = done.error {
            return Err(error);
        }
        for (run, events) in self.events.iter_mut().zip(done.by_run) {
            match events {
                Some(events) => run.engines.push((engine.name(), events)),
                None => {
                    self.failed[run.configuration].get_or_insert(engine.name());
                }
            }
        }
        Ok(())
    }

    fn rows(mut self, engines: &[&'static str], likely: Likely) -> [CaseRow; 8] {
        // What one engine measured where another failed is no result of the configuration.
        for (runs, failed) in self.runs.iter_mut().zip(&self.failed) {
            if failed.is_some() {
                runs.clear();
            }
        }
        let (setup, plan) = (self.setup, &self.planned.goals[0]);
        let judged = |runs: &Vec<EngineRun>| Adjudicated::without_referee(setup, 0, runs);
        let adjudicated: Vec<Adjudicated> = self.runs.iter().map(judged).collect();
        let (runs, events) = (&self.runs, &self.events);
        let report = case_report(setup, plan, runs, &adjudicated, events, engines, likely);
        let mut reports = [report];
        let resolved = setup.resolved;
        let criteria = &resolved.scenario.criteria;
        let (_, judged) = judge(&mut reports, &resolved.goals, criteria, engines);
        let [report] = reports;
        let rows = plan
            .configurations
            .iter()
            .zip(report.configurations)
            .zip(&self.failed);
        eight(rows.map(|((plan, measured), failed)| {
            let (outcome, detail) = match (broken_rule(&plan.rejections), failed, measured.status) {
                (Some(rule), _, _) => (Outcome::Rejected, rule),
                (None, Some(engine), _) => (
                    Outcome::NotJudged,
                    format!("{ENGINE_FAILURE} {engine}").into(),
                ),
                (None, None, Status::Ok) if measured.not_judged == 0 => (Outcome::Ok, "".into()),
                (None, None, _) => missed(&judged, measured.label),
            };
            CaseRow {
                outcome,
                detail,
                mode: StudyMode::Dynamic,
                measured,
                margin_m: None,
            }
        }))
    }
}

/// The first criterion that a configuration fails, or else that could not be evaluated.
fn missed(judged: &Judged, label: &str) -> (Outcome, Cow<'static, str>) {
    let counts = |of: &Option<String>, criterion: &str| {
        of.as_deref() == Some(label) && criterion != "expected"
    };
    let missed = judged
        .results
        .iter()
        .filter(|each| !each.pass && counts(&each.label, &each.criterion))
        .map(|each| (Outcome::Failed, each.criterion.clone()));
    let unjudged = judged
        .not_judged
        .iter()
        .filter(|each| counts(&each.label, &each.criterion))
        .map(|each| (Outcome::NotJudged, each.detail()));
    missed.chain(unjudged).next().map_or(
        (Outcome::NotJudged, "no_engine".into()),
        |(outcome, detail)| (outcome, detail.into()),
    )
}
