//! A case with its motion, without engines.

use std::borrow::Cow;

use needlebench_clearance::ClearanceModel;
use needlebench_evaluation::check_configuration;
use needlebench_evaluation::report::{ConfigurationReport, GoalReport};
use needlebench_evaluation::room::RoomModel;
use needlebench_planning::GoalPlan;
use needlebench_scenario::ResolvedScenario;
use needlebench_scenario::scenario::CriteriaSection;
use needlebench_scenario::study::StudyMode;
use needlebench_study::Outcome;

use crate::adjudication::Adjudicated;
use crate::assemble::{Context, goal_report};
use crate::budgets::total_budgets;
use crate::events::EventRun;
use crate::probability::probabilities;
use crate::setup::Setup;
use crate::simulate::EngineRun;

use super::failure::CaseFailure;
use super::likely::Likely;
use super::rows::{CaseRow, broken_rule};

/// Prepares a case of a scenario with one goal.
pub(super) fn case_setup<'a>(
    resolved: &'a ResolvedScenario,
    model: &'a ClearanceModel,
) -> Result<Setup<'a>, CaseFailure> {
    if resolved.goals.len() != 1 || resolved.iso9283.is_some() || resolved.excitation.is_some() {
        return Err(CaseFailure::Goals {
            file: resolved.source.file.clone(),
            goals: resolved.goals.len(),
        });
    }
    Ok(Setup::new(resolved, model)?)
}

/// The report of the only goal, without what only pages and pictures show.
pub(super) fn case_report(
    setup: &Setup<'_>,
    plan: &GoalPlan,
    runs: &[Vec<EngineRun>],
    adjudicated: &[Adjudicated],
    events: &[EventRun],
    engines: &[&'static str],
    likely: Likely,
) -> GoalReport {
    let criteria = &setup.resolved.scenario.criteria;
    let room_counts = criteria.min_free_fraction.is_some()
        || criteria.min_sight_fraction.is_some()
        || criteria.min_hand_cone_deg.is_some();
    let plans = std::slice::from_ref(plan);
    // A criterion of what is simulated.
    let has_engines = !engines.is_empty();
    let needs_probabilities =
        likely != Likely::AsJudged || has_engines && criteria.has_probability();
    let likely = needs_probabilities.then(|| probabilities(setup, plans, 1, false));
    let context = Context {
        setup,
        budgets: &total_budgets(setup, plans, has_engines),
        probabilities: likely.as_ref(),
        room: room_counts.then(|| RoomModel::new(setup.resolved)),
        events,
        engines,
    };
    goal_report(&context, 0, plan, runs, adjudicated)
}

/// The rows of a case by its planned motions: clearances are the least along the motion, of the
/// final posture where there is none, and the tip is predicted from static equilibrium.
///
/// Of the scenario's criteria those are checked that a motion decides: the predicted needle, the error
/// budget, the free space, and clearances by their certified bounds.
///
/// # Errors
/// If the scenario has not exactly one goal, or cannot be planned at all.
pub fn planned_rows(resolved: &ResolvedScenario) -> Result<[CaseRow; 8], CaseFailure> {
    planned_case(resolved, Likely::AsJudged)
}

/// [`planned_rows`] with probabilities.
///
/// # Errors
/// As [`planned_rows`].
pub fn planned_case(
    resolved: &ResolvedScenario,
    likely: Likely,
) -> Result<[CaseRow; 8], CaseFailure> {
    let model = ClearanceModel::new(&resolved.cell);
    let setup = case_setup(resolved, &model)?;
    let plan = setup.planner.plan(&resolved.goals[0]);
    let none: Vec<Vec<EngineRun>> = plan.configurations.iter().map(|_| Vec::new()).collect();
    let adjudicated = vec![Adjudicated::default(); none.len()];
    let report = case_report(&setup, &plan, &none, &adjudicated, &[], &[], likely);
    let goal = &resolved.goals[0].name;
    let criteria = &resolved.scenario.criteria;
    let rows = plan.configurations.iter().zip(report.configurations);
    Ok(eight(rows.map(|(plan, measured)| {
        let (outcome, detail) = match broken_rule(&plan.rejections) {
            Some(rule) => (Outcome::Rejected, rule),
            None => match missed(goal, criteria, &measured) {
                Some((outcome, criterion)) => (outcome, criterion),
                None => (Outcome::Ok, "".into()),
            },
        };
        CaseRow {
            outcome,
            detail,
            mode: StudyMode::Planned,
            measured,
            margin_m: None,
        }
    })))
}

/// The first criterion, in the order of a run's, that the motion is known to fail, or else that could
/// not be evaluated.
fn missed(
    goal: &str,
    criteria: &CriteriaSection,
    report: &ConfigurationReport,
) -> Option<(Outcome, Cow<'static, str>)> {
    let judged = check_configuration(goal, report, criteria, StudyMode::Planned, &[]);
    let missed = judged.results.into_iter().find(|result| !result.pass);
    let unjudged = judged.not_judged.into_iter().next();
    let missed = missed.map(|result| (Outcome::Failed, result.criterion.into()));
    missed.or(unjudged.map(|each| (Outcome::NotJudged, each.detail().into())))
}

/// One row of each configuration.
pub(super) fn eight(rows: impl Iterator<Item = CaseRow>) -> [CaseRow; 8] {
    let rows: Vec<CaseRow> = rows.collect();
    rows.try_into().expect("a goal has eight configurations")
}
