//! What is known of a scenario before any motion is planned and any engine runs: which configurations can
//! reach each goal and why not else, what the needle passes, where its target lies, how free the start is.
//!
//! Final postures are those that a plan tries first, under the rules of a plan and the criteria on
//! clearances. Motions and engines can only take configurations away, so a goal for which too few are left
//! here fails in every run.

use needlebench_cell::{Cell, ClearanceClass, Rule, part_in_words, reason_in_words};
use needlebench_clearance::{ClassMinima, ClearanceModel};
use needlebench_evaluation::report::{ConfigurationReport, RejectionReport, RouteReport};
use needlebench_evaluation::{PostureFault, judge_posture, route_is_expected};
use needlebench_input::Finding;
use needlebench_kinematics::NotUrGeometry;
use needlebench_kinematics::ik::Configuration;
use needlebench_planning::{Member, Planner, crossed_fissures};
use needlebench_scenario::{Goal, ResolvedScenario};
use serde::Serialize;

use crate::assemble::{rejection_report, route_report};

/// What all of it rests on, for people.
pub const BASIS: &str = "postures only, motions not planned";

/// What is known of a scenario.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Preview {
    /// [`BASIS`].
    pub basis: &'static str,
    /// The start posture.
    pub start: StartPreview,
    /// Goal by goal.
    pub goals: Vec<GoalPreview>,
}

/// The start posture, which is within the limits of the joints and free.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StartPreview {
    /// Least clearance of arm and tool, m; none if there is nothing to be near to.
    pub least_clearance_m: Option<f64>,
    /// The two solids.
    pub pair: Option<[String; 2]>,
}

/// What is known of a goal.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GoalPreview {
    /// Its name.
    pub name: String,
    /// Configurations whose final posture violates no rule and no criterion on clearances.
    pub working: usize,
    /// All eight.
    pub configurations: Vec<ConfigurationPreview>,
    /// Clearance of the needle from bone, vessels and organs; none where there is nothing to keep away from.
    /// Configurations are looked at as if it did.
    pub needle_route: Option<RouteReport>,
    /// Fissures of the lungs that the needle crosses.
    pub fissures_crossed: Vec<String>,
    /// Where the target lies.
    pub target: TargetPreview,
}

/// One configuration of a goal.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ConfigurationPreview {
    /// Its label.
    pub label: &'static str,
    /// Its final posture violates nothing, and all clearances are evaluated.
    pub works: bool,
    /// Rules that it violates, the first failing one first.
    pub rejections: Vec<RejectionReport>,
    /// The first criterion that it fails, if it violates no rule.
    pub missed: Option<&'static str>,
    /// Why a clearance is not evaluated, if it violates no rule and fails no criterion: `scan_ends robot_phantom`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub not_judged: Option<String>,
    /// The posture that was looked at, if the pose is in reach.
    pub joints_rad: Option<[f64; 6]>,
    /// What arm and tool come nearest to in it; none out of reach, or if there is nothing to be near to.
    pub nearest: Option<NearestPair>,
}

/// Two solids that come nearest to each other.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NearestPair {
    /// Signed distance, m.
    pub distance_m: f64,
    /// Class of the two.
    pub class: ClearanceClass,
    /// The two solids.
    pub pair: [String; 2],
}

impl NearestPair {
    /// Of arm and tool; the access zone is not a body.
    fn of(minima: &ClassMinima, cell: &Cell) -> Option<Self> {
        let bodies = minima
            .iter()
            .filter(|pair| pair.class != ClearanceClass::NeedleCorridor);
        let nearest =
            bodies.min_by(|a, b| a.separation.distance_m.total_cmp(&b.separation.distance_m))?;
        let (a, b) = nearest.solid_names(cell);
        Some(Self {
            distance_m: nearest.separation.distance_m,
            class: nearest.class,
            pair: [a.to_owned(), b.to_owned()],
        })
    }
}

impl ConfigurationPreview {
    /// The first rule or criterion that it violates, or why it is not evaluated; empty if it is feasible.
    pub fn reason(&self) -> &str {
        let rule = self.rejections.first().map(|rejection| rejection.rule);
        let violated = rule.or(self.missed);
        violated.or(self.not_judged.as_deref()).unwrap_or_default()
    }
}

/// The place of a target.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TargetPreview {
    /// The lesion that holds it, if one does.
    pub lesion: Option<String>,
    /// How far outside it is of the lesion that the goal names, m.
    pub beyond_lesion_m: Option<f64>,
    /// The organ that holds it.
    pub organ: Option<String>,
}

impl Preview {
    /// What is known of a scenario, and what of it is wrong.
    ///
    /// # Errors
    /// [`NotUrGeometry`] if the robot is not a UR arm.
    pub fn of(resolved: &ResolvedScenario) -> Result<(Self, Vec<Finding>), NotUrGeometry> {
        let model = ClearanceModel::new(&resolved.cell);
        let planner = Planner::new(resolved, &model)?;
        let mut findings = Vec::new();
        let mut goals = Vec::new();
        for (index, goal) in resolved.goals.iter().enumerate() {
            let preview = goal_preview(&planner, resolved, goal);
            findings.extend(reach_finding(resolved, index, &preview));
            findings.extend(route_finding(resolved, index, &preview));
            goals.push(preview);
        }
        let (minima, _) = planner.clearance_rules(&resolved.start);
        let nearest = NearestPair::of(&minima, &resolved.cell);
        let start = StartPreview {
            least_clearance_m: nearest.as_ref().map(|nearest| nearest.distance_m),
            pair: nearest.map(|nearest| nearest.pair),
        };
        let preview = Self {
            basis: BASIS,
            start,
            goals,
        };
        Ok((preview, findings))
    }
}

/// What is known of a goal in the cell of a scenario.
pub(crate) fn goal_preview(
    planner: &Planner<'_>,
    resolved: &ResolvedScenario,
    goal: &Goal,
) -> GoalPreview {
    preview_of(resolved, goal, planner.postures(goal))
}

/// The same of the best posture of each configuration.
pub(crate) fn preview_of(
    resolved: &ResolvedScenario,
    goal: &Goal,
    members: [Member; 8],
) -> GoalPreview {
    // What a refused route says of all alike is said once.
    let members = members.map(|mut member| {
        member
            .rejections
            .retain(|each| each.rule != Rule::NeedleRoute);
        member
    });
    let configurations: Vec<ConfigurationPreview> = Configuration::ALL
        .into_iter()
        .zip(&members)
        .map(|(configuration, member)| configuration_preview(resolved, configuration, member))
        .collect();
    GoalPreview {
        name: goal.name.clone(),
        working: configurations.iter().filter(|each| each.works).count(),
        configurations,
        needle_route: route_report(resolved, goal),
        fissures_crossed: crossed_fissures(resolved, goal),
        target: target_preview(resolved, goal),
    }
}

fn configuration_preview(
    resolved: &ResolvedScenario,
    configuration: Configuration,
    member: &Member,
) -> ConfigurationPreview {
    let fault = member.candidate.as_ref().and_then(|candidate| {
        let mut posture = ConfigurationReport::new(configuration.label());
        posture.set_posture_clearances(&candidate.clearance);
        judge_posture(&posture, &resolved.scenario.criteria)
    });
    let fault = fault.filter(|_| member.works());
    let works = member.works() && fault.is_none();
    let (missed, not_judged) = match fault {
        Some(PostureFault::Missed(missed)) => (Some(missed), None),
        Some(PostureFault::NotJudged(reason)) => (None, Some(reason)),
        None => (None, None),
    };
    ConfigurationPreview {
        label: configuration.label(),
        works,
        rejections: member.rejections.iter().map(rejection_report).collect(),
        missed,
        not_judged,
        joints_rad: member.candidate.as_ref().map(|each| each.joints.into()),
        nearest: member
            .candidate
            .as_ref()
            .and_then(|each| NearestPair::of(&each.clearance, &resolved.cell)),
    }
}

fn target_preview(resolved: &ResolvedScenario, goal: &Goal) -> TargetPreview {
    let Some(placed) = &resolved.phantom else {
        return TargetPreview {
            lesion: None,
            beyond_lesion_m: None,
            organ: None,
        };
    };
    let target = placed.world_from_phantom.inverse() * goal.target_m;
    let lesions = placed.phantom.lesions.iter().map(|lesion| {
        let beyond_m = (target - lesion.center_m).norm() - 0.5 * lesion.diameter_m;
        (lesion.name.as_str(), beyond_m)
    });
    let holds = lesions.clone().find(|(_, beyond_m)| *beyond_m <= 0.0);
    let aimed_at = lesions
        .filter(|(name, beyond_m)| goal.lesion.as_deref() == Some(name) && *beyond_m > 0.0)
        .map(|(_, beyond_m)| beyond_m)
        .next();
    TargetPreview {
        lesion: holds.map(|(name, _)| name.to_owned()),
        beyond_lesion_m: aimed_at,
        organ: goal.target_organ.clone(),
    }
}

/// The key that places a goal.
fn goal_key(resolved: &ResolvedScenario, index: usize) -> String {
    let section = &resolved.scenario.goals[index];
    let key = if section.flange_pose.is_some() {
        "flange_pose"
    } else if section.entry_direction_deg.is_some() {
        "entry_direction_deg"
    } else {
        "entry_mm"
    };
    format!("goals[{index}].{key}")
}

/// A goal with fewer feasible configurations than the scenario requires.
fn reach_finding(resolved: &ResolvedScenario, index: usize, goal: &GoalPreview) -> Option<Finding> {
    let wanted = resolved.scenario.criteria.min_working_configurations as usize;
    if goal.working >= wanted {
        return None;
    }
    let first = |each: &ConfigurationPreview| each.rejections.first().cloned();
    let missing_m = goal.configurations.iter().map(|each| {
        first(each)
            .filter(|rejection| rejection.rule == Rule::Unreachable.name())
            .map(|rejection| rejection.value)
    });
    let missing_m: Option<Vec<f64>> = missing_m.collect();
    let message = if let Some(missing_m) = missing_m {
        let least_m = missing_m.into_iter().fold(f64::INFINITY, f64::min);
        format!(
            "goal `{}` is out of reach by {:.1} mm or more in every configuration ({BASIS})",
            goal.name,
            least_m * 1e3
        )
    } else {
        let mut reasons: Vec<String> = Vec::new();
        for each in goal.configurations.iter().filter(|each| !each.works) {
            let rule = first(each).map(|rejection| rejection.rule.to_owned());
            let reason = rule.unwrap_or_else(|| each.reason().to_owned());
            let reason = reason_in_words(&reason);
            if !reasons.contains(&reason) {
                reasons.push(reason);
            }
        }
        format!(
            "{} of 8 configurations feasible for goal `{}`, {wanted} required: {} ({BASIS})",
            goal.working,
            goal.name,
            reasons.join(", ")
        )
    };
    Some(
        Finding::new(&resolved.source.file, message)
            .key(goal_key(resolved, index))
            .hint(format!(
                "move the base, the patient or the entry; `needlebench suggest {}` proposes base \
                 placements and entries; `min_working_configurations` under [criteria] sets the \
                 required number",
                resolved.source.file
            )),
    )
}

/// A needle path that violates its margins, unless exactly that is expected.
fn route_finding(resolved: &ResolvedScenario, index: usize, goal: &GoalPreview) -> Option<Finding> {
    let route = goal.needle_route.as_ref()?;
    let wanted_mm = resolved.scenario.criteria.min_clearance_mm.needle_route;
    let limit_m = wanted_mm.map_or(route.margin_m, |mm| route.margin_m.max(mm * 1e-3));
    let is_expected = route_is_expected(&resolved.goals[index]) && !route.kept;
    if route.distance_m >= limit_m || is_expected {
        return None;
    }
    let RouteReport { part, tissue, .. } = route;
    let words = part_in_words(part);
    let bent = if route.is_bent {
        ", bent by tissue"
    } else {
        ""
    };
    let mm = route.distance_m * 1e3;
    let message = if mm < 0.0 {
        format!(
            "needle path of goal `{}`{bent}: {:.1} mm deep in {words} ({tissue}, `{part}`)",
            goal.name, -mm
        )
    } else {
        format!(
            "needle path of goal `{}`{bent}: {mm:.1} mm clearance to {words} ({tissue}, `{part}`), {:.1} \
             mm required",
            goal.name,
            limit_m * 1e3
        )
    };
    Some(
        Finding::new(&resolved.source.file, message)
            .key(goal_key(resolved, index))
            .hint(format!(
                "choose another entry; `needlebench suggest {}` proposes some; `off` under \
                 [planning.needle_route] lists what the needle may pass",
                resolved.source.file
            )),
    )
}
