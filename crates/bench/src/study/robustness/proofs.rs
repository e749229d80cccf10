//! Whether a posture is feasible in a layout whose phantom is moved, without the layout's clearances.
//!
//! What a static case looks at is decided thus: joint limits, singularities and the needle's errors are
//! computed, clearances are proven by bounds of travel or by the pairs alone that these leave open
//! ([`KnownGaps`]), and the needle path, which a goal in the phantom takes along, is that of the layout it
//! comes from. Where a clearance is at its limit up to rounding nothing is decided.

use needlebench_cell::{BodyKind, ClearanceClass};
use needlebench_clearance::{ClearanceModel, KnownGaps};
use needlebench_evaluation::report::ConfigurationReport;
use needlebench_evaluation::{first_missed_by_posture, measure_guide};
use needlebench_kinematics::ik::Configuration;
use needlebench_kinematics::{Joints, Pose};
use needlebench_planning::{Planner, judge_route_beside, needle_route};
use needlebench_scenario::{MovedPhantom, ResolvedScenario};

/// Rounding of a distance that is computed at another place of the phantom, m: 2e-7 at most, see
/// [`needlebench_geometry`].
const ROUNDING_M: f64 = 1e-6;

pub(super) struct Proofs<'a> {
    resolved: &'a ResolvedScenario,
    planner: Planner<'a>,
    configuration: Configuration,
    gaps: KnownGaps<'a>,
    phantom_from_world: Pose,
    /// What is evaluated of a posture besides its clearances.
    judged: ConfigurationReport,
    route: Route,
    /// A criterion is on errors of real arms and patients.
    asks_for_budget: bool,
}

/// Whether the needle path has its required margins.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Route {
    /// In every layout alike; none where it is at a limit up to rounding.
    GoesWithPhantom(Option<bool>),
    /// The goal stays where the phantom is moved.
    Stays,
}

impl<'a> Proofs<'a> {
    /// For the moves of the phantom of a layout; none with `[imperfections]`, whose needle is not the nominal
    /// arm's. `model` is of the layout's cell.
    pub fn of(
        resolved: &'a ResolvedScenario,
        model: &'a ClearanceModel,
        configuration: Configuration,
    ) -> Option<Self> {
        let criteria = &resolved.scenario.criteria;
        let (placed, [goal]) = (resolved.phantom.as_ref()?, &resolved.goals[..]) else {
            return None;
        };
        // Behind the cuts of a scan distances prove nothing.
        if resolved.imperfections.is_some() || !resolved.cell.behind_cuts.is_empty() {
            return None;
        }
        let planner = Planner::new(resolved, model).ok()?;
        let limit_m = |class: ClearanceClass| match class {
            ClearanceClass::NeedleRoute => f64::NEG_INFINITY,
            _ => planner.limits().get(class).judged_m,
        };
        // Rules and criteria about clearances are all kept by what keeps these limits.
        let mut at_limits = ConfigurationReport::new(configuration.label());
        for class in ClearanceClass::ALL {
            let least_m = limit_m(class);
            let known = &mut at_limits.posture_clearance_m;
            known.extend((least_m > f64::NEG_INFINITY).then_some((class.name(), least_m)));
        }
        if first_missed_by_posture(&at_limits, criteria).is_some() {
            return None;
        }
        let bodies = &resolved.cell.bodies;
        let gaps = KnownGaps::new(model, limit_m, |body| {
            bodies[body].kind == BodyKind::Phantom
        });
        let here = MovedPhantom {
            phantom: placed.clone(),
            goal: goal.clone(),
            is_moved_as_one: true,
        };
        let goes_along = resolved.scenario.goals[0].flange_pose.is_none();
        Some(Self {
            gaps,
            phantom_from_world: placed.world_from_phantom.inverse(),
            judged: ConfigurationReport::new(configuration.label()),
            route: if goes_along {
                let surplus_m = route_surplus_m(resolved, &here);
                Route::GoesWithPhantom((surplus_m.abs() > ROUNDING_M).then_some(surplus_m > 0.0))
            } else {
                Route::Stays
            },
            asks_for_budget: criteria.max_tip_rms_mm.is_some()
                || criteria.max_tip_lateral_rms_mm.is_some(),
            planner,
            resolved,
            configuration,
        })
    }

    /// Whether the configuration is feasible at a roll: whether its row in a study would be ok.
    pub fn works_at(&mut self, moved: &MovedPhantom, roll_rad: f64) -> Option<bool> {
        let route = match self.route {
            Route::GoesWithPhantom(kept) => kept?,
            Route::Stays => route_surplus_m(self.resolved, moved) >= 0.0,
        };
        let goal = &moved.goal;
        let reached = self.planner.reached(goal, self.configuration, roll_rad);
        let Some(q) = reached.filter(|_| route) else {
            return Some(false);
        };
        let exit = self.resolved.cell.world_from_guide_exit(&q);
        self.judged.predicted = Some(measure_guide(None, goal, &exit));
        if first_missed_by_posture(&self.judged, &self.resolved.scenario.criteria).is_some() {
            return Some(false);
        }
        let keeps = self.keeps_clear(moved, &q)?;
        // What is left is for the row to say.
        (!keeps || !self.asks_for_budget).then_some(keeps)
    }

    /// Whether a posture keeps all clearances that rules and criteria want.
    pub fn keeps_clear(&mut self, moved: &MovedPhantom, q: &Joints) -> Option<bool> {
        let by = moved.phantom.world_from_phantom * self.phantom_from_world;
        self.gaps.keeps(q, &by)
    }
}

/// Clearance of the needle path in excess of the required one, m; infinite without obstacles.
fn route_surplus_m(resolved: &ResolvedScenario, moved: &MovedPhantom) -> f64 {
    let MovedPhantom { phantom, goal, .. } = moved;
    let judged = judge_route_beside(resolved, phantom, goal);
    let by_rule_m = judged.map(|judged| judged.distance_m - judged.margin_m);
    let criteria = &resolved.scenario.criteria.min_clearance_mm;
    let least_mm = criteria.least_mm(ClearanceClass::NeedleRoute);
    let by_criterion_m = least_mm.and_then(|least_mm| {
        let nearest = needle_route(resolved, phantom, goal)?;
        Some(nearest.separation.distance_m - least_mm * 1e-3)
    });
    let surpluses_m = [by_rule_m, by_criterion_m].into_iter().flatten();
    surpluses_m.fold(f64::INFINITY, f64::min)
}
