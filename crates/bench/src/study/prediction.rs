//! Where the needle comes to rest in a posture, without any engine.

use needlebench_engine::Servo;
use needlebench_evaluation::probability::ProbabilityReport;
use needlebench_evaluation::{NeedleMeasurement, measure_guide};
use needlebench_kinematics::Dynamics;
use needlebench_kinematics::trajectory::JointTrajectory;
use needlebench_planning::{Candidate, Planner};
use needlebench_scenario::imperfections::Imperfections;
use needlebench_scenario::{PlacedPhantom, ResolvedScenario};
use needlebench_uncertainty::budget::{BudgetCase, ErrorBudget, analytic_total};
use needlebench_uncertainty::{Truth, servo_of, settle_after};

use super::likely::Likely;
use crate::budgets::analytic_budget;
use crate::probability::GoalProbabilities;
use crate::real_cell::drawn_truth;

/// What is known of the needle in one posture.
pub(super) struct Predicted {
    /// One arm and one patient; none where a drive is too weak or nothing tells how joints came to
    /// rest.
    pub needle: Option<NeedleMeasurement>,
    /// Over all arms and patients, where a criterion requires it.
    pub budget: Option<ErrorBudget>,
    /// Over the same, where it is asked for; with what went wrong.
    pub probability: Option<Result<ProbabilityReport, String>>,
}

/// Predicts the needle in the postures of one layout.
pub(super) struct Prediction<'a> {
    resolved: &'a ResolvedScenario,
    servo: Servo,
    real: Option<Real>,
    /// Basis of the error budget, where a criterion requires one.
    expected: Option<&'a Imperfections>,
    /// Probabilities with their basis, where they are asked for.
    likely: Option<(GoalProbabilities<'a>, &'a Imperfections)>,
}

struct Real {
    truth: Truth,
    dynamics: Dynamics,
    /// Where the phantom really is.
    phantom: Option<PlacedPhantom>,
}

impl<'a> Prediction<'a> {
    /// Samples the layout's imperfections, if it has any; the RMS tip error is computed if it is requested here or
    /// required by a criterion.
    ///
    /// # Errors
    /// The key at fault.
    pub fn new(
        resolved: &'a ResolvedScenario,
        expects_tip: bool,
        likely: Likely,
    ) -> Result<Self, &'static str> {
        let real = drawn_truth(resolved)
            .map(|truth| {
                let truth = truth.map_err(|_| "imperfections.registration.markers_mm")?;
                Ok::<_, &'static str>(Real {
                    dynamics: truth.dynamics(&resolved.cell),
                    phantom: resolved.phantom.as_ref().map(|each| truth.phantom(each)),
                    truth,
                })
            })
            .transpose()?;
        let criteria = &resolved.scenario.criteria;
        let asked = expects_tip
            || criteria.max_tip_rms_mm.is_some()
            || criteria.max_tip_lateral_rms_mm.is_some();
        let all = resolved.expected.as_ref().map(|each| &each.imperfections);
        let expected = all.filter(|_| asked);
        let likely = likely.extent().zip(all).map(|(extent, imperfections)| {
            let goal = &resolved.goals[0];
            (
                GoalProbabilities::new(resolved, goal, extent),
                imperfections,
            )
        });
        Ok(Self {
            resolved,
            servo: servo_of(resolved),
            real,
            expected,
            likely,
        })
    }

    pub fn resolved(&self) -> &'a ResolvedScenario {
        self.resolved
    }

    /// Of a posture; how likely its needle meets what only where that is wanted.
    pub fn of(
        &self,
        planner: &Planner<'_>,
        candidate: &Candidate,
        wants_probability: bool,
    ) -> Predicted {
        let goal = &self.resolved.goals[0];
        // How the joints came to rest matters for friction alone.
        let drawn = self.real.as_ref().map(|real| &real.truth.actuation);
        let sticks = drawn.is_some_and(|drives| drives.friction.is_some())
            || self.expected.is_some_and(|each| each.friction.is_some())
            || self
                .likely
                .as_ref()
                .is_some_and(|(_, each)| each.friction.is_some());
        let motion = if sticks {
            planner.approach(goal, candidate)
        } else {
            Some(JointTrajectory::starting_at(candidate.joints))
        };
        let needle = if let Some(real) = &self.real {
            motion.as_ref().and_then(|motion| self.needle(real, motion))
        } else {
            let exit = self.resolved.cell.world_from_guide_exit(&candidate.joints);
            Some(measure_guide(self.resolved.phantom.as_ref(), goal, &exit))
        };
        Predicted {
            needle,
            budget: motion.as_ref().and_then(|motion| self.budget(motion)),
            probability: motion
                .filter(|_| wants_probability)
                .and_then(|motion| self.probability(&motion)),
        }
    }

    fn needle(&self, real: &Real, motion: &JointTrajectory) -> Option<NeedleMeasurement> {
        let goal = &self.resolved.goals[0];
        let settled = settle_after(&self.servo, &real.dynamics, &real.truth, motion).ok()?;
        let exit = real
            .truth
            .world_from_guide_exit(&self.resolved.cell, &settled.position);
        let goal = real.truth.goal(goal);
        Some(measure_guide(real.phantom.as_ref(), &goal, &exit))
    }

    fn probability(&self, motion: &JointTrajectory) -> Option<Result<ProbabilityReport, String>> {
        let (likely, imperfections) = self.likely.as_ref()?;
        let goal = &self.resolved.goals[0];
        let case = BudgetCase::of(self.resolved, goal, &self.servo, imperfections, motion);
        likely.of(&case)
    }

    fn budget(&self, motion: &JointTrajectory) -> Option<ErrorBudget> {
        let goal = &self.resolved.goals[0];
        let case = BudgetCase::of(self.resolved, goal, &self.servo, self.expected?, motion);
        analytic_total(&case).ok().map(analytic_budget)
    }
}
