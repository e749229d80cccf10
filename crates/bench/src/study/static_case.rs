//! Static cases: the final postures of a layout, without motions and without engines.

use std::borrow::Cow;

use needlebench_cell::ClearanceClass;
use needlebench_clearance::ClearanceModel;
use needlebench_evaluation::report::ConfigurationReport;
use needlebench_evaluation::{PostureFault, judge_posture};
use needlebench_input::{Finding, nothing_serves};
use needlebench_kinematics::Joints;
use needlebench_kinematics::ik::{Configuration, Kinematics};
use needlebench_planning::{Member, Planner, needle_route, route_rejection};
use needlebench_scenario::ResolvedScenario;
use needlebench_scenario::study::StudyMode;
use needlebench_study::Outcome;

use super::likely::Likely;
use super::margin::{CountedClasses, margin_m};
use super::prediction::Prediction;
use super::rows::{CaseRow, broken_rule};
use crate::assemble::margins_report;

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
/// that no rule rejects is then evaluated by those of the scenario's criteria that a posture decides.
///
/// With `[imperfections]` the needle is where one draw of them, made from the scenario's seed as in a
/// run, settles in static equilibrium. Friction needs to know how the joints came to rest: it is
/// that of the straight approach along the needle alone, after which nothing remembers the motion
/// before; where there is no such line there is no prediction.
#[derive(Debug, Default)]
pub struct StaticWorker {
    /// The one used last is the last.
    models: Vec<ClearanceModel>,
    /// Of the arm used last.
    kinematics: Option<Kinematics>,
    /// Classes that count in margins.
    counted: CountedClasses,
    /// Whether the RMS tip error is computed without a criterion, too.
    expects_tip: bool,
    /// Probabilities of configurations that no rule rejects.
    likely: Likely,
}

/// The eight rows of one layout; `resolved` has one goal, or its first one counts.
///
/// See [`StaticWorker`], which is faster for many.
pub fn static_rows(resolved: &ResolvedScenario) -> [CaseRow; 8] {
    StaticWorker::default().rows(resolved)
}

/// The detail of a layout in which no entry is feasible for the goal, though all were tried.
pub const NO_ENTRY: &str = "no_entry";

/// Rows of a layout without a scenario. No configuration is feasible where no entry is; otherwise the layout is
/// invalid, and the key at fault is the detail.
pub fn rows_without_scenario(findings: &[Finding], mode: StudyMode) -> [CaseRow; 8] {
    let (outcome, detail) = if nothing_serves(findings) {
        (Outcome::Rejected, NO_ENTRY)
    } else {
        let key = findings.iter().find_map(|finding| finding.key.as_deref());
        (Outcome::Invalid, key.unwrap_or("scenario"))
    };
    rows_alike(mode, outcome, detail)
}

fn rows_alike(mode: StudyMode, outcome: Outcome, detail: &str) -> [CaseRow; 8] {
    Configuration::ALL
        .map(|configuration| CaseRow::new(configuration, mode, outcome, detail.to_owned()))
}

impl StaticWorker {
    /// One whose margins count some classes.
    pub fn counting(counted: CountedClasses) -> Self {
        Self {
            counted,
            ..Self::default()
        }
    }

    /// Computes the RMS tip error without a criterion, too.
    pub fn expecting_tip(self, expects_tip: bool) -> Self {
        Self {
            expects_tip,
            ..self
        }
    }

    /// Estimates probabilities of configurations that no rule rejects.
    pub fn asking(self, likely: Likely) -> Self {
        Self { likely, ..self }
    }

    /// The eight rows of one layout; `resolved` has one goal, or its first one counts.
    pub fn rows(&mut self, resolved: &ResolvedScenario) -> [CaseRow; 8] {
        let counted = self.counted;
        self.evaluate(resolved, |planner, prediction, route_m| {
            let mut members = planner.postures(&resolved.goals[0]).into_iter();
            Configuration::ALL.map(|configuration| {
                let member = members.next().expect("there are eight");
                row(
                    planner,
                    prediction,
                    configuration,
                    &member,
                    route_m,
                    counted,
                )
            })
        })
        .unwrap_or_else(|key| rows_alike(StudyMode::Static, Outcome::Invalid, key))
    }

    /// One of [`StaticWorker::rows`].
    pub fn row(&mut self, resolved: &ResolvedScenario, configuration: Configuration) -> CaseRow {
        self.row_of(resolved, configuration, |planner| {
            planner.posture(&resolved.goals[0], configuration)
        })
    }

    /// One of [`StaticWorker::rows`] if the guide stood at a roll that others than the planner chose.
    pub fn row_at(
        &mut self,
        resolved: &ResolvedScenario,
        configuration: Configuration,
        roll_rad: f64,
    ) -> CaseRow {
        self.row_of(resolved, configuration, |planner| {
            let goal = &resolved.goals[0];
            let member = planner.member_at(goal, configuration, roll_rad);
            member.on_route(route_rejection(resolved, goal).as_ref())
        })
    }

    fn row_of(
        &mut self,
        resolved: &ResolvedScenario,
        configuration: Configuration,
        member: impl Fn(&Planner<'_>) -> Member,
    ) -> CaseRow {
        let counted = self.counted;
        self.evaluate(resolved, |planner, prediction, route_m| {
            let member = member(planner);
            row(
                planner,
                prediction,
                configuration,
                &member,
                route_m,
                counted,
            )
        })
        .unwrap_or_else(|key| CaseRow::new(configuration, StudyMode::Static, Outcome::Invalid, key))
    }

    /// The first rule or criterion about clearances that a posture breaks in a layout; the key at fault of a
    /// layout that cannot be.
    pub(super) fn clearance_broken(
        &mut self,
        resolved: &ResolvedScenario,
        q: &Joints,
    ) -> Result<Option<Cow<'static, str>>, &'static str> {
        self.evaluate(resolved, |planner, _, _| {
            let (clearance, rejections) = planner.clearance_rules(q);
            broken_rule(&rejections).or_else(|| {
                let mut posture = ConfigurationReport::new("");
                posture.set_posture_clearances(&clearance);
                judge_posture(&posture, &resolved.scenario.criteria).map(PostureFault::into_detail)
            })
        })
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
        let route_m = route_m(resolved);
        let prediction = Prediction::new(resolved, self.expects_tip, self.likely)?;
        let known = self.kinematics.take();
        let model = self.model(resolved);
        let planner = match known {
            Some(known) => Planner::like(resolved, model, &known),
            None => Planner::new(resolved, model),
        };
        let planner = planner.map_err(|_| "robot.urdf")?;
        let kinematics = *planner.kinematics();
        let found = with(&planner, &prediction, route_m);
        self.kinematics = Some(kinematics);
        Ok(found)
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
}

/// Clearance of the planned needle on its way, m; none without a phantom.
fn route_m(resolved: &ResolvedScenario) -> Option<f64> {
    let placed = resolved.phantom.as_ref()?;
    let nearest = needle_route(resolved, placed, &resolved.goals[0])?;
    Some(nearest.separation.distance_m)
}

fn row(
    planner: &Planner<'_>,
    prediction: &Prediction<'_>,
    configuration: Configuration,
    member: &Member,
    route_m: Option<f64>,
    counted: CountedClasses,
) -> CaseRow {
    let resolved = prediction.resolved();
    let (outcome, detail) = match broken_rule(&member.rejections) {
        Some(rule) => (Outcome::Rejected, rule),
        None => (Outcome::Ok, "".into()),
    };
    let mut row = CaseRow::new(configuration, StudyMode::Static, outcome, detail);
    let posture = &mut row.measured;
    posture.roll_rad = Some(member.roll_rad);
    posture.surplus_m = Some(member.surplus);
    if let Some(route_m) = route_m {
        let class = ClearanceClass::NeedleRoute.name();
        posture.posture_clearance_m.insert(class, route_m);
    }
    let Some(candidate) = &member.candidate else {
        row.margin_m = Some(margin_m(planner, resolved, member, posture, counted, false));
        return row;
    };
    posture.joints_rad = Some(candidate.joints.into());
    posture.margins = Some(margins_report(&candidate.margins));
    posture.set_posture_clearances(&candidate.clearance);
    let goal = &resolved.goals[0];
    posture.tip_sensitivity_m_per_rad = Some(planner.tip_sensitivity(goal, candidate));
    posture.entry_to_target_m = goal.entry_to_target_m();
    let predicted = prediction.of(planner, candidate, outcome == Outcome::Ok);
    posture.predicted = predicted.needle;
    posture.budget = predicted.budget;
    match predicted.probability {
        Some(Ok(found)) => posture.probability = Some(found),
        Some(Err(error)) => posture.probability_failure = Some(error),
        None => {}
    }
    if outcome == Outcome::Ok
        && let Some(fault) = judge_posture(posture, &resolved.scenario.criteria)
    {
        row.outcome = match fault {
            PostureFault::Missed(_) => Outcome::Failed,
            PostureFault::NotJudged(_) => Outcome::NotJudged,
        };
        row.detail = fault.into_detail();
    }
    let is_ok = row.outcome == Outcome::Ok;
    let margin_m = margin_m(planner, resolved, member, &row.measured, counted, is_ok);
    row.margin_m = Some(margin_m);
    row
}
