//! The first stage: plans of all goals, and which motions are worth a simulation.

use needlebench_parallel::in_parallel;
use needlebench_planning::{ConfigurationPlan, GoalPlan, Rule};

use crate::control::Control;
use crate::setup::Setup;

/// One motion to simulate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Job {
    /// Index of the goal.
    pub goal: usize,
    /// Index of the configuration.
    pub configuration: usize,
}

impl Job {
    /// Its plan.
    pub fn plan(self, plans: &[GoalPlan]) -> &ConfigurationPlan {
        &plans[self.goal].configurations[self.configuration]
    }

    /// Goal and configuration, for people.
    pub fn in_words(self, setup: &Setup<'_>, plans: &[GoalPlan]) -> String {
        let goal = &setup.resolved.goals[self.goal].name;
        format!("{goal} {}", self.plan(plans).configuration)
    }
}

/// Plans of all goals.
pub(crate) fn plan_goals(setup: &Setup<'_>, control: &Control<'_>) -> Vec<GoalPlan> {
    let goals = &setup.resolved.goals;
    control.progress.message("planning");
    control.progress.expect(goals.len() as u64);
    in_parallel(control.threads, goals, |goal| {
        let plan = setup.planner.plan(goal);
        control.progress.step();
        plan
    })
}

/// Configurations that are simulated: those that work, and on request those that only collide.
pub(crate) fn jobs(setup: &Setup<'_>, plans: &[GoalPlan]) -> Vec<Job> {
    let everything = setup.resolved.scenario.planning.simulate_rejected;
    let worth = |plan: &ConfigurationPlan| {
        plan.trajectory.is_some()
            && (plan.rejections.is_empty()
                || everything
                    && plan.rejections.iter().all(|rejection| {
                        matches!(
                            rejection.rule,
                            Rule::NeedleRoute
                                | Rule::Collision
                                | Rule::TooClose
                                | Rule::NeedleCorridor
                                | Rule::NoMotion
                        )
                    }))
    };
    all(plans).filter(|job| worth(job.plan(plans))).collect()
}

/// Configurations that work.
pub(crate) fn working(plans: &[GoalPlan]) -> Vec<Job> {
    let works = |plan: &ConfigurationPlan| plan.rejections.is_empty() && plan.trajectory.is_some();
    all(plans).filter(|job| works(job.plan(plans))).collect()
}

fn all(plans: &[GoalPlan]) -> impl Iterator<Item = Job> {
    plans.iter().enumerate().flat_map(|(goal, plan)| {
        (0..plan.configurations.len()).map(move |configuration| Job {
            goal,
            configuration,
        })
    })
}
