//! The first stage: plans of all goals, and which motions are worth a simulation.

use needlebench_parallel::{Control, in_parallel};
use needlebench_planning::{ConfigurationPlan, GoalPlan};

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

/// Plans of all goals, and what is done with them.
#[derive(Debug)]
pub(crate) struct Planned {
    /// By goal.
    pub goals: Vec<GoalPlan>,
    /// Motions that are simulated: the feasible ones, and on request those that are rejected for collisions only.
    pub simulated: Vec<Job>,
    /// Those that no rule rejects.
    pub feasible: Vec<Job>,
}

/// Plans all goals.
pub(crate) fn plan_goals(setup: &Setup<'_>, control: &Control<'_>) -> Planned {
    let goals = &setup.resolved.goals;
    control.progress.message("planning");
    control.progress.expect(goals.len() as u64);
    let goals = in_parallel(control.threads, goals, |goal| {
        let plan = setup.planner.plan(goal);
        control.progress.step();
        plan
    });
    Planned::of(setup, goals)
}

impl Planned {
    /// Plans, from wherever they are, with what is done with them.
    pub(crate) fn of(setup: &Setup<'_>, goals: Vec<GoalPlan>) -> Self {
        Self {
            simulated: simulated(setup, &goals),
            feasible: feasible(&goals),
            goals,
        }
    }
}

fn simulated(setup: &Setup<'_>, plans: &[GoalPlan]) -> Vec<Job> {
    let everything = setup.resolved.scenario.planning.simulate_rejected;
    let worth = |plan: &ConfigurationPlan| {
        plan.trajectory.is_some()
            && (plan.rejections.is_empty()
                || everything
                    && plan
                        .rejections
                        .iter()
                        .all(|rejection| rejection.rule.can_be_simulated()))
    };
    all(plans).filter(|job| worth(job.plan(plans))).collect()
}

fn feasible(plans: &[GoalPlan]) -> Vec<Job> {
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
