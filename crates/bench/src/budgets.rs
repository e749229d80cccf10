//! The fifth stage: error budgets.

use needlebench_parallel::in_parallel;
use needlebench_planning::{ConfigurationPlan, GoalPlan};
use needlebench_scenario::Expected;
use needlebench_scenario::imperfections::Imperfections;
use needlebench_uncertainty::Source;
use needlebench_uncertainty::budget::{
    BudgetCase, ErrorBudget, Moments, PointBudget, Samples, SourceBudget, budget, total_budget,
};

use crate::setup::Setup;

/// Error budgets by goal and configuration, for every configuration with a motion; with what went
/// wrong where there is none.
pub(crate) type Budgets = Vec<Vec<Option<Result<ErrorBudget, String>>>>;

/// Error budgets of all configurations that have a motion, over the arm and patient population of the RMS tip error.
///
/// With the scenario's own imperfections each source is also sampled by itself; for a class of arm only all sources
/// together are, for the P95.
pub(crate) fn budgets(setup: &Setup<'_>, plans: &[GoalPlan], threads: usize) -> Budgets {
    let seed = setup.resolved.scenario.seed;
    let expected = setup.resolved.expected.as_ref();
    let is_own = expected.is_some_and(|expected| expected.class.is_none());
    of_each(setup, plans, threads, |_, case| {
        let total = case.imperfections.budget_samples;
        let each_source = if is_own { total } else { 0 };
        budget(case, Samples { total, each_source }, seed).map_err(|error| error.to_string())
    })
}

/// The same of all sources together alone; drawn where engines have run, as a run's are.
pub(crate) fn total_budgets(setup: &Setup<'_>, plans: &[GoalPlan], is_drawn: bool) -> Budgets {
    let seed = setup.resolved.scenario.seed;
    of_each(setup, plans, 1, |_, case| {
        let samples = if is_drawn {
            case.imperfections.budget_samples
        } else {
            0
        };
        total_budget(case, samples, seed).map_err(|error| error.to_string())
    })
}

/// A budget of nothing but the analytic totals at skin and target.
pub(crate) fn analytic_budget(moments: [Moments; 2]) -> ErrorBudget {
    let [at_skin, at_target] = moments.map(|analytic| PointBudget {
        analytic,
        monte_carlo: None,
        radius_95_m: None,
        drawn_radius_95_m: None,
        covariance_difference: None,
        bias_difference_m: None,
    });
    ErrorBudget {
        samples: 0,
        sources: Vec::new(),
        total: SourceBudget {
            source: None,
            basis: None,
            at_skin,
            at_target,
            skin_with_target: None,
        },
        dominant: None,
        before_insertion: None,
        in_tissue: None,
        of_breath: None,
        breathing_freely: None,
    }
}

/// Sources of the error budget that were measured, and those that are assumed.
pub(crate) fn measured_and_assumed(imperfections: &Imperfections) -> (Vec<Source>, Vec<Source>) {
    let all = Source::ALL.into_iter();
    let there = all.filter(|source| source.is_in(imperfections));
    there.partition(|source| source.is_measured_in(imperfections) == Some(true))
}

/// What `of` says of every configuration with a motion, by goal and configuration; nothing without an arm and patient
/// population.
pub(crate) fn of_each<T: Send>(
    setup: &Setup<'_>,
    plans: &[GoalPlan],
    threads: usize,
    of: impl Fn(usize, &BudgetCase<'_>) -> T + Sync,
) -> Vec<Vec<Option<T>>> {
    let resolved = setup.resolved;
    let Some(Expected { imperfections, .. }) = &resolved.expected else {
        return plans
            .iter()
            .map(|plan| plan.configurations.iter().map(|_| None).collect())
            .collect();
    };
    let all: Vec<(usize, &ConfigurationPlan)> = plans
        .iter()
        .enumerate()
        .flat_map(|(goal, plan)| plan.configurations.iter().map(move |each| (goal, each)))
        .collect();
    let mut found = in_parallel(threads, &all, |(index, plan)| {
        let trajectory = plan.trajectory.as_ref()?;
        let goal = &resolved.goals[*index];
        let case = BudgetCase::of(resolved, goal, &setup.servo, imperfections, trajectory);
        // A motion of somebody else may end beside its goal.
        Some(of(*index, &case.as_held()))
    })
    .into_iter();
    plans
        .iter()
        .map(|plan| found.by_ref().take(plan.configurations.len()).collect())
        .collect()
}
