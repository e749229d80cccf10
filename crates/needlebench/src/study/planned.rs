//! A case with its motion, without engines.

use std::borrow::Cow;

use needlebench_cell::ResolvedScenario;
use needlebench_cell::scenario::CriteriaSection;
use needlebench_clearance::ClearanceModel;
use needlebench_evaluation::report::{ConfigurationReport, GoalReport};
use needlebench_evaluation::room::RoomModel;
use needlebench_evaluation::{NeedleMeasurement, check_configuration};
use needlebench_planning::{ConfigurationPlan, GoalPlan, Planner};
use needlebench_study::{Outcome, Row};

use crate::assemble::{Context, goal_report};
use crate::budgets::analytic_budgets;
use crate::events::EventRun;
use crate::pipeline::EngineRun;
use crate::reality::Reality;
use crate::trial::Trial;

use super::rows::{broken_rule, row, set_needle};

/// What all stages of a case work with.
pub(super) struct Stage<'a> {
    pub resolved: &'a ResolvedScenario,
    pub model: &'a ClearanceModel,
    pub planner: Planner<'a>,
    pub reality: Reality<'a>,
}

impl<'a> Stage<'a> {
    /// Prepares a case of a scenario with one goal.
    pub fn new(resolved: &'a ResolvedScenario, model: &'a ClearanceModel) -> Result<Self, String> {
        if resolved.goals.len() != 1 || resolved.iso9283.is_some() {
            return Err(format!(
                "a case has one goal, `{}` has {}",
                resolved.source.file,
                resolved.goals.len()
            ));
        }
        Ok(Self {
            resolved,
            model,
            planner: Planner::new(resolved, model).map_err(|error| error.to_string())?,
            reality: Reality::new(resolved, model).map_err(|error| error.to_string())?,
        })
    }

    /// The plans of the only goal.
    pub fn plan(&self) -> GoalPlan {
        self.planner.plan(&self.resolved.goals[0])
    }

    /// The report of the only goal, without what only pages and pictures show.
    pub fn report(
        &self,
        plan: &GoalPlan,
        runs: &[Vec<EngineRun>],
        trials: &[Trial],
        events: &[EventRun],
    ) -> GoalReport {
        let criteria = &self.resolved.scenario.criteria;
        let room_counts = criteria.min_free_fraction.is_some()
            || criteria.min_sight_fraction.is_some()
            || criteria.min_hand_cone_deg.is_some();
        let context = Context {
            resolved: self.resolved,
            planner: &self.planner,
            model: self.model,
            reality: &self.reality,
            budgets: &analytic_budgets(self.resolved, std::slice::from_ref(plan)),
            room: room_counts.then(|| RoomModel::new(self.resolved)),
            events,
        };
        goal_report(&context, 0, plan, runs, trials)
    }

    /// Where the needle is predicted to come to rest; where it is commanded to without imperfections.
    fn predicted(
        &self,
        plan: &ConfigurationPlan,
        report: &ConfigurationReport,
    ) -> Option<NeedleMeasurement> {
        if !self.reality.is_imperfect() {
            return report.commanded;
        }
        let trajectory = plan.trajectory.as_ref()?;
        self.reality.predicted_needle(0, trajectory)
    }
}

/// The rows of a case by its planned motions: clearances are the least along the motion, of the
/// final posture where there is none, and the tip is where the balance of torques predicts it.
///
/// Of the scenario's criteria those are checked that a motion decides: the predicted needle, the error
/// budget, the room, and clearances by their proven bounds.
///
/// # Errors
/// If the scenario has not exactly one goal, or cannot be planned at all.
pub fn planned_rows(resolved: &ResolvedScenario) -> Result<[Row; 8], String> {
    let model = ClearanceModel::new(&resolved.cell);
    let stage = Stage::new(resolved, &model)?;
    let plan = stage.plan();
    let none: Vec<Vec<EngineRun>> = plan.configurations.iter().map(|_| Vec::new()).collect();
    let trials = vec![Trial::default(); none.len()];
    let report = stage.report(&plan, &none, &trials, &[]);
    let goal = &resolved.goals[0].name;
    let criteria = &resolved.scenario.criteria;
    let rows = plan.configurations.iter().zip(&report.configurations);
    Ok(eight(rows.map(|(plan, report)| {
        let mut row = row(&stage.planner, plan, report);
        let needle = stage.predicted(plan, report);
        if let Some(needle) = &needle {
            set_needle(&mut row, needle);
        }
        (row.outcome, row.detail) = match broken_rule(plan) {
            Some(rule) => (Outcome::Rejected, rule),
            None => match missed(goal, criteria, report, needle.as_ref()) {
                Some(criterion) => (Outcome::Failed, criterion),
                None => (Outcome::Ok, "".into()),
            },
        };
        row
    })))
}

/// The first criterion, in the order of a run's, that the motion is known to miss.
fn missed(
    goal: &str,
    criteria: &CriteriaSection,
    report: &ConfigurationReport,
    needle: Option<&NeedleMeasurement>,
) -> Option<Cow<'static, str>> {
    const MM: f64 = 1e-3;
    let of_needle = needle.into_iter().flat_map(|needle| {
        [
            (
                "max_tip_position_error_mm",
                criteria.max_tip_position_error_mm.map(|mm| mm * MM),
                needle.tip_position_error_m,
            ),
            (
                "max_needle_angle_error_deg",
                criteria.max_needle_angle_error_deg.map(f64::to_radians),
                needle.needle_angle_error_rad,
            ),
            (
                "max_guide_position_error_mm",
                criteria.max_guide_position_error_mm.map(|mm| mm * MM),
                needle.guide_position_error_m,
            ),
        ]
    });
    of_needle
        .filter(|(_, limit, value)| limit.is_some_and(|limit| *value > limit))
        .map(|(criterion, ..)| criterion.into())
        .chain(
            check_configuration(goal, report, criteria, false)
                .into_iter()
                .filter(|result| !result.pass)
                .map(|result| result.criterion.into()),
        )
        .next()
}

/// One row of each configuration.
pub(super) fn eight(rows: impl Iterator<Item = Row>) -> [Row; 8] {
    let rows: Vec<Row> = rows.collect();
    rows.try_into().expect("a goal has eight configurations")
}
