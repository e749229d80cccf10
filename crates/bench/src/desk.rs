//! A scenario in whose cell goals are tried interactively.
//!
//! What does not depend on the goal is prepared once; everything else is what [`Preview`](crate::Preview) and a run
//! have.

use needlebench_clearance::ClearanceModel;
use needlebench_engine::Servo;
use needlebench_input::Finding;
use needlebench_kinematics::NotUrGeometry;
use needlebench_kinematics::ik::{Configuration, Kinematics};
use needlebench_kinematics::trajectory::JointTrajectory;
use needlebench_parallel::in_parallel;
use needlebench_planning::{ConfigurationPlan, Member, Planner};
use needlebench_scenario::{Expected, Goal, GoalPlacer, ResolvedScenario};
use needlebench_uncertainty::budget::{BudgetCase, Moments, analytic_total};
use needlebench_uncertainty::servo_of;

use crate::preview::{GoalPreview, preview_of};

/// Directions about the needle of a quick answer, as of planned routes.
const QUICK_ROLLS: u32 = 12;

/// A scenario's cell, ready for goals that are not its own.
pub struct Desk {
    resolved: ResolvedScenario,
    model: ClearanceModel,
    kinematics: Kinematics,
    servo: Servo,
}

impl Desk {
    /// Prepares the cell of a scenario; its goals do not count.
    ///
    /// # Errors
    /// [`NotUrGeometry`] if the robot is not a UR arm.
    pub fn new(resolved: ResolvedScenario) -> Result<Self, NotUrGeometry> {
        Ok(Self {
            model: ClearanceModel::new(&resolved.cell),
            kinematics: Kinematics::new(resolved.cell.robot.chain)?,
            servo: servo_of(&resolved),
            resolved,
        })
    }

    /// The scenario.
    pub fn scenario(&self) -> &ResolvedScenario {
        &self.resolved
    }

    /// Places goals in the cell.
    pub fn placer(&self) -> GoalPlacer<'_> {
        GoalPlacer::new(&self.resolved)
    }

    /// Which configurations can reach a goal, by their postures; the same on any number of threads.
    ///
    /// # Errors
    /// [`NotUrGeometry`]: never of a robot that [`Desk::new`] took.
    pub fn preview(&self, goal: &Goal, threads: usize) -> Result<GoalPreview, NotUrGeometry> {
        let planner = self.planner()?;
        let posture = |configuration| planner.posture_off_route(goal, configuration);
        Ok(self.preview_by(goal, threads, posture))
    }

    /// The same of a few directions about the needle, without what would free the others: what works here works, what
    /// does not may at another direction.
    ///
    /// # Errors
    /// As [`Desk::preview`].
    pub fn quick_preview(&self, goal: &Goal, threads: usize) -> Result<GoalPreview, NotUrGeometry> {
        let planner = self.planner()?;
        let rolls = planner.rolls(goal, QUICK_ROLLS);
        let posture = |configuration| planner.best_of_rolls(goal, configuration, &rolls);
        Ok(self.preview_by(goal, threads, posture))
    }

    fn preview_by(
        &self,
        goal: &Goal,
        threads: usize,
        posture: impl Fn(Configuration) -> Member + Sync,
    ) -> GoalPreview {
        let members = in_parallel(threads, &Configuration::ALL, |each| posture(*each));
        let members: [Member; 8] = members.try_into().expect("one of each");
        preview_of(&self.resolved, goal, members)
    }

    /// The whole motion of one configuration, with its certified clearances.
    ///
    /// # Errors
    /// As [`Desk::preview`].
    pub fn plan(
        &self,
        goal: &Goal,
        configuration: Configuration,
    ) -> Result<ConfigurationPlan, NotUrGeometry> {
        Ok(self.planner()?.plan_one(goal, configuration))
    }

    /// Bias and covariance of the needle's error at skin and target, over the arm and patient population of the
    /// scenario's RMS tip error; axes as those of [`Moments`]. None where the arm's data do not suffice.
    pub fn expected_error(
        &self,
        goal: &Goal,
        trajectory: &JointTrajectory,
    ) -> Option<Result<[Moments; 2], Finding>> {
        let Expected { imperfections, .. } = self.resolved.expected.as_ref()?;
        let case = BudgetCase::of(&self.resolved, goal, &self.servo, imperfections, trajectory);
        let file = &self.resolved.source.file;
        Some(analytic_total(&case).map_err(|error| Finding::new(file, error.to_string())))
    }

    fn planner(&self) -> Result<Planner<'_>, NotUrGeometry> {
        Planner::like(&self.resolved, &self.model, &self.kinematics)
    }
}
