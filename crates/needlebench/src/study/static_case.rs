//! Static cases: the final postures of a layout, without motions and without engines.

use std::sync::Arc;

use needlebench_cell::phantom::Phantom;
use needlebench_cell::{ClearanceClass, Finding, ResolvedScenario};
use needlebench_clearance::{ClassMinima, ClearanceModel};
use needlebench_evaluation::{RouteObstacles, clearance_limits};
use needlebench_kinematics::Joints;
use needlebench_kinematics::ik::Configuration;
use needlebench_planning::{Candidate, Member, Planner, Rejection, Rule};
use needlebench_study::{Metric, Outcome, Row};

use super::prediction::{Predicted, Prediction};
use super::rows::{set_needle, set_posture};

/// Millimetres in a metre.
const MM: f64 = 1e3;

/// Layouts of which the prepared geometry is kept: of phantoms of some sizes, of some tools.
const KEPT: usize = 8;

/// Evaluates static cases one after the other; what layouts have in common is prepared once.
///
/// What it answers depends on the layout alone, not on what was evaluated before. Memory is bounded.
///
/// # What a row holds
///
/// For a fixed roll the posture is the one of the inverse kinematics, for a free one that which a plan
/// tries first ([`Planner::postures`]). Clearances, margins and rules are those of the nominal arm in
/// that posture, as in `needlebench atlas`; joint positions lie in (-180, 180] deg. A configuration
/// that breaks no rule is then judged by those of the scenario's criteria that a posture decides.
///
/// With `[imperfections]` the needle is where one draw of them, made from the scenario's seed as in a
/// run, settles by the balance of torques. Friction needs to know how the joints came to rest: it is
/// that of the straight approach along the needle alone, after which nothing remembers the motion
/// before; where there is no such line there is no prediction.
#[derive(Debug, Default)]
pub struct StaticWorker {
    /// The one used last is the last.
    models: Vec<ClearanceModel>,
    routes: Vec<(Arc<Phantom>, RouteObstacles)>,
}

/// The eight rows of one layout; `resolved` has one goal, or its first one counts.
///
/// See [`StaticWorker`], which is faster for many.
pub fn static_rows(resolved: &ResolvedScenario) -> [Row; 8] {
    StaticWorker::default().rows(resolved)
}

/// Rows of a layout that cannot exist; the key at fault is the detail.
pub fn invalid_rows(findings: &[Finding]) -> [Row; 8] {
    let key = findings.iter().find_map(|finding| finding.key.clone());
    all_rows(
        Outcome::Invalid,
        &key.unwrap_or_else(|| "scenario".to_owned()),
    )
}

fn all_rows(outcome: Outcome, detail: &str) -> [Row; 8] {
    rows_of(|index| Row::new(index, outcome, detail.to_owned()))
}

fn rows_of(mut row: impl FnMut(u8) -> Row) -> [Row; 8] {
    let mut index = 0;
    [(); 8].map(|()| {
        let row = row(index);
        index += 1;
        row
    })
}

impl StaticWorker {
    /// The eight rows of one layout; `resolved` has one goal, or its first one counts.
    pub fn rows(&mut self, resolved: &ResolvedScenario) -> [Row; 8] {
        self.evaluate(resolved, |planner, prediction, route_m| {
            let mut members = planner.postures(&resolved.goals[0]).into_iter();
            rows_of(|index| {
                let member = members.next().expect("there are eight");
                row(planner, prediction, index, &member, route_m)
            })
        })
        .unwrap_or_else(|key| all_rows(Outcome::Invalid, key))
    }

    /// One of [`StaticWorker::rows`].
    pub fn row(&mut self, resolved: &ResolvedScenario, configuration: Configuration) -> Row {
        let index = index_of(configuration);
        self.evaluate(resolved, |planner, prediction, route_m| {
            let member = planner.posture(&resolved.goals[0], configuration);
            row(planner, prediction, index, &member, route_m)
        })
        .unwrap_or_else(|key| Row::new(index, Outcome::Invalid, key))
    }

    /// The first rule or criterion about clearances that a posture breaks in a layout.
    pub(super) fn clearance_broken(
        &mut self,
        resolved: &ResolvedScenario,
        q: &Joints,
    ) -> Option<&'static str> {
        let broken = self.evaluate(resolved, |planner, _, _| {
            let (clearance, rejections) = planner.clearance_rules(q);
            let rule = rejections.first().map(rule_detail);
            rule.or_else(|| missed_clearance(resolved, &clearance, None))
        });
        broken.unwrap_or_else(Some)
    }

    /// Does something with a layout that is ready for it; the key at fault where it cannot be.
    fn evaluate<T>(
        &mut self,
        resolved: &ResolvedScenario,
        mut with: impl FnMut(&Planner<'_>, &Prediction<'_>, Option<f64>) -> T,
    ) -> Result<T, &'static str> {
        if resolved.goals.is_empty() {
            return Err("goals");
        }
        let route_m = self.route_m(resolved);
        let prediction = Prediction::new(resolved)?;
        let model = self.model(resolved);
        let planner = Planner::new(resolved, model).map_err(|_| "robot.urdf")?;
        Ok(with(&planner, &prediction, route_m))
    }

    /// The layout's clearances, prepared from the kept ones.
    fn model(&mut self, resolved: &ResolvedScenario) -> &ClearanceModel {
        let cell = &resolved.cell;
        let nearest = (0..self.models.len()).max_by_key(|&index| {
            // The later of equals.
            (self.models[index].bodies_in_common(cell), index)
        });
        let model = match nearest {
            Some(index) => {
                let known = &self.models[index];
                let model = known.for_cell(cell);
                // One of each kind is kept: those with the same shapes replace each other.
                if known.has_shapes_of(cell) || self.models.len() == KEPT {
                    let oldest = if known.has_shapes_of(cell) { index } else { 0 };
                    self.models.remove(oldest);
                }
                model
            }
            None => ClearanceModel::new(cell),
        };
        self.models.push(model);
        &self.models[self.models.len() - 1]
    }

    /// Clearance of the planned needle on its way, m; none without a phantom.
    fn route_m(&mut self, resolved: &ResolvedScenario) -> Option<f64> {
        let placed = resolved.phantom.as_ref()?;
        let phantom = &placed.phantom;
        let known = |(each, _): &(Arc<Phantom>, RouteObstacles)| Arc::ptr_eq(each, phantom);
        let index = self.routes.iter().position(known).unwrap_or_else(|| {
            if self.routes.len() == KEPT {
                self.routes.remove(0);
            }
            let obstacles = RouteObstacles::new(phantom);
            self.routes.push((Arc::clone(phantom), obstacles));
            self.routes.len() - 1
        });
        let obstacles = &self.routes[index].1;
        let (_, separation) = obstacles.nearest(&resolved.cell, placed, &resolved.goals[0])?;
        Some(separation.distance_m)
    }
}

fn row(
    planner: &Planner<'_>,
    prediction: &Prediction<'_>,
    index: u8,
    member: &Member,
    route_m: Option<f64>,
) -> Row {
    let resolved = prediction.resolved();
    let rejection = member.rejections.first();
    let mut row = match rejection {
        Some(rejection) => Row::new(index, Outcome::Rejected, rule_detail(rejection)),
        None => Row::new(index, Outcome::Ok, ""),
    };
    row.set(Metric::Roll, member.roll_rad.to_degrees());
    row.set(Metric::Surplus, member.surplus * MM);
    if let Some(route_m) = route_m {
        row.set(Metric::NeedleRoute, route_m * MM);
    }
    let Some(candidate) = &member.candidate else {
        return row;
    };
    set_posture(&mut row, candidate);
    set_clearances(&mut row, candidate);
    let goal = &resolved.goals[0];
    // The same number in m/rad and in mm/mrad.
    row.set(
        Metric::TipSensitivity,
        planner.tip_sensitivity(goal, candidate),
    );
    let predicted = prediction.of(planner, candidate);
    if let Some(needle) = &predicted.needle {
        set_needle(&mut row, needle);
    }
    if let Some(moments) = &predicted.spread {
        row.set(Metric::TipRms, moments.rms_m * MM);
    }
    if rejection.is_none()
        && let Some(missed) = missed_criterion(resolved, candidate, route_m, &predicted)
    {
        row.outcome = Outcome::Failed;
        row.detail = missed.into();
    }
    row
}

/// The least clearance of each class, and of all surroundings.
fn set_clearances(row: &mut Row, candidate: &Candidate) {
    let mut least_m = f64::INFINITY;
    for pair in candidate.clearance.iter() {
        let distance_m = pair.separation.distance_m;
        let (metric, counts) = match pair.class {
            ClearanceClass::RobotPhantom => (Metric::RobotPhantom, true),
            ClearanceClass::RobotTable => (Metric::RobotTable, true),
            ClearanceClass::RobotGantry => (Metric::RobotGantry, true),
            ClearanceClass::RobotMount => (Metric::RobotMount, true),
            ClearanceClass::ToolPhantom => (Metric::ToolPhantom, true),
            ClearanceClass::SelfCollision => (Metric::SelfClearance, false),
            ClearanceClass::GuideStandoff => (Metric::GuideStandoff, false),
            ClearanceClass::NeedleCorridor => (Metric::NeedleCorridor, false),
            ClearanceClass::NeedleRoute => (Metric::NeedleRoute, false),
        };
        row.set(metric, distance_m * MM);
        if counts {
            least_m = least_m.min(distance_m);
        }
    }
    row.set(Metric::Clearance, least_m * MM);
}

/// The rule, and for collisions the class of the pair.
fn rule_detail(rejection: &Rejection) -> &'static str {
    match (rejection.rule, rejection.class) {
        (Rule::Collision, Some(class)) => match class {
            ClearanceClass::RobotPhantom => "collision robot_phantom",
            ClearanceClass::RobotTable => "collision robot_table",
            ClearanceClass::RobotGantry => "collision robot_gantry",
            ClearanceClass::RobotMount => "collision robot_mount",
            ClearanceClass::SelfCollision => "collision self",
            ClearanceClass::ToolPhantom => "collision tool_phantom",
            ClearanceClass::GuideStandoff => "collision guide_standoff",
            ClearanceClass::NeedleCorridor => "collision needle_corridor",
            ClearanceClass::NeedleRoute => "collision needle_route",
        },
        (rule, _) => rule.name(),
    }
}

/// The first criterion, in the order of a run's, that the posture is known to miss.
fn missed_criterion(
    resolved: &ResolvedScenario,
    candidate: &Candidate,
    route_m: Option<f64>,
    predicted: &Predicted,
) -> Option<&'static str> {
    let criteria = &resolved.scenario.criteria;
    let needle = predicted.needle.as_ref();
    let spread = predicted.spread.as_ref();
    let at_most = [
        (
            "max_tip_position_error_mm",
            criteria.max_tip_position_error_mm.map(|mm| mm / MM),
            needle.map(|each| each.tip_position_error_m),
        ),
        (
            "max_needle_angle_error_deg",
            criteria.max_needle_angle_error_deg.map(f64::to_radians),
            needle.map(|each| each.needle_angle_error_rad),
        ),
        (
            "max_guide_position_error_mm",
            criteria.max_guide_position_error_mm.map(|mm| mm / MM),
            needle.map(|each| each.guide_position_error_m),
        ),
        (
            "max_tip_rms_mm",
            criteria.max_tip_rms_mm.map(|mm| mm / MM),
            spread.map(|each| each.rms_m),
        ),
        (
            "max_tip_lateral_rms_mm",
            criteria.max_tip_lateral_rms_mm.map(|mm| mm / MM),
            spread.map(|each| each.lateral_rms_m),
        ),
    ];
    let is_above = |limit: Option<f64>, value: Option<f64>| {
        limit.zip(value).is_some_and(|(limit, value)| value > limit)
    };
    let missed = at_most
        .into_iter()
        .find(|(_, limit, value)| is_above(*limit, *value));
    if let Some((name, ..)) = missed {
        return Some(name);
    }
    missed_clearance(resolved, &candidate.clearance, route_m)
}

/// The first class whose clearance is less than a criterion wants.
fn missed_clearance(
    resolved: &ResolvedScenario,
    clearance: &ClassMinima,
    route_m: Option<f64>,
) -> Option<&'static str> {
    let limits = clearance_limits(&resolved.scenario.criteria.min_clearance_mm);
    let missed = limits.into_iter().find(|(class, _, limit_mm)| {
        let found_m = if *class == ClearanceClass::NeedleRoute.name() {
            route_m
        } else {
            let mut measured = clearance.iter();
            let pair = measured.find(|pair| pair.class.name() == *class);
            pair.map(|pair| pair.separation.distance_m)
        };
        found_m
            .zip(limit_mm.map(|mm| mm / MM))
            .is_some_and(|(found_m, limit_m)| found_m < limit_m)
    });
    missed.map(|(_, key, _)| key)
}

#[expect(clippy::cast_possible_truncation, reason = "below 8")]
fn index_of(configuration: Configuration) -> u8 {
    configuration.index() as u8
}
