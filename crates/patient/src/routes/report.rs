//! What was found, as a document.

use nalgebra::UnitVector3;
use needlebench_kinematics::ik::Configuration;
use needlebench_numerics::pareto::pareto_front;
use needlebench_routing::{
    Anatomy, Nearest, Obstacle, Ray, Risk, RouteRule, RouteRules, Searched, bent_reason,
};
use serde::Serialize;

use super::joint::{Asked, AxisError, ROLLS, Served};
use super::{RouteTask, WithRobot};
use crate::proposal::Refused;

/// The routes to a target. Lengths in m, angles in rad unless a name says otherwise, places in frame `phantom`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RoutePlan {
    /// Of this document.
    pub schema_version: u32,
    /// Name of the goal.
    pub goal: String,
    /// Lesion that is aimed at.
    pub lesion: Option<String>,
    /// The target.
    pub target_in_phantom_m: [f64; 3],
    /// Origin of frame `phantom` in the scan's frame `ct`, whose axes are the same; none without a scan.
    pub phantom_origin_in_ct_m: Option<[f64; 3]>,
    /// What distances are of: `voxels` of the scan, or `solids` of the phantom.
    pub anatomy: &'static str,
    /// Distances that every route keeps before the robot's own error is added.
    pub margins: Vec<BaseMargin>,
    /// Constant part of margins that include an error, m.
    pub margin_constant_m: f64,
    /// Standard deviations in them.
    pub sigmas: f64,
    /// Directions that were evaluated.
    pub tried: usize,
    /// Of these, free before the robot was asked.
    pub free: usize,
    /// Why the others are not, in the order in which rules are asked.
    pub refused: Vec<RuleCount>,
    /// Directions about the needle that each configuration was tried at.
    pub rolls: u32,
    /// Why no robot was asked; none if one was.
    pub robot_not_asked: Option<String>,
    /// Position of the robot's base, world; none if it was not asked.
    pub base_position_m: Option<[f64; 3]>,
    /// Required number of feasible configurations.
    pub wanted: usize,
    /// Why configurations do not work on all these routes, the most frequent reason first.
    pub robot_refused: Vec<Refused>,
    /// Routes of which each stands for those around it, the best first.
    pub routes: Vec<RouteAnswer>,
    /// The best route in which as many configurations are feasible as required; without a robot the first.
    pub chosen: Option<ChosenRoute>,
    /// What nothing beats in risk, clearance, expected error and room at once: number of a route and a configuration.
    pub pareto: Vec<(usize, &'static str)>,
    /// The best path that only the bent needle breaks a rule on; none if there is none, or no needle is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bent: Option<BentRefusal>,
    /// The best path if it is infeasible for the robot.
    pub why_not: Option<WhyNot>,
    /// Every direction that was evaluated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub map: Option<MapColumns>,
}

/// A path that is admissible for the straight needle, and not for the one that tissue bends.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BentRefusal {
    /// Azimuth and elevation from the target, deg.
    pub direction_deg: [f64; 2],
    /// How it compares: [`Risk::odds_ratio`].
    pub odds_ratio: f64,
    /// What the bent needle comes too close to, for people.
    pub reason: String,
}

/// A margin without the robot's own error.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BaseMargin {
    /// From what.
    pub obstacle: &'static str,
    /// The least distance, m.
    pub margin_m: f64,
    /// Whether the patient has any such structure labelled. One that is not labelled has no distance.
    pub known: bool,
}

/// How many directions a rule refuses.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RuleCount {
    /// The rule.
    pub rule: &'static str,
    /// For people.
    pub in_words: &'static str,
    /// How many.
    pub count: usize,
}

/// A needle path and the configurations feasible for it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RouteAnswer {
    /// Lines for the goal in a scenario.
    pub toml: String,
    /// Azimuth and elevation from the target, deg: `entry_direction_deg`.
    pub direction_deg: [f64; 2],
    /// Where the needle enters.
    pub entry_in_phantom_m: [f64; 3],
    /// From the skin to the target.
    pub depth_m: f64,
    /// Angle between needle and the skin's normal.
    pub angle_to_skin_normal_rad: f64,
    /// What the needle keeps from bone, vessels and organs.
    pub margins: Vec<MarginReport>,
    /// The same of the median needle as tissue bends it, with the same margins; none where no needle is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bend: Option<BendAnswer>,
    /// How often it enters a lung.
    pub pleural_crossings: u32,
    /// How much of it is in a lung.
    pub depth_in_lung_m: f64,
    /// Fissures that it crosses.
    pub fissures_crossed: Vec<String>,
    /// Bullae that it crosses.
    pub bullae_crossed: Vec<String>,
    /// How it compares, term by term.
    pub risk: Risk,
    /// Why the guide cannot be there at all.
    pub blocked: Option<String>,
    /// Feasible configurations, the margins included, with the error of each.
    pub working: usize,
    /// Of these the one with the best posture, by `planning.roll_aim`: motions and what else `run` ranks by are not
    /// planned for all routes.
    pub best: Option<&'static str>,
    /// All eight, if the robot was asked.
    pub configurations: Vec<ConfigurationAnswer>,
}

/// A distance from an obstacle, and the required one.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MarginReport {
    /// Bone, vessel or organ.
    pub obstacle: &'static str,
    /// What of it is nearest; none if nothing is within 20 mm.
    pub part: Option<String>,
    /// Lower bound of the distance of the needle's surface, from the skin to as far as the needle is thrown; none if
    /// there is nothing.
    pub distance_m: Option<f64>,
    /// The required distance without the robot's own error.
    pub margin_m: f64,
}

/// A needle as tissue bends it on a route.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BendAnswer {
    /// How far the tip is off the axis, m.
    pub tip_m: f64,
    /// Unit vector towards which it bends, frame `phantom`; none where that is not known, and distances are the least
    /// of twelve directions.
    pub towards_in_phantom: Option<[f64; 3]>,
    /// What the bent needle keeps from bone, vessels and organs.
    pub margins: Vec<MarginReport>,
}

/// One configuration on a route.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ConfigurationAnswer {
    /// Its label.
    pub label: &'static str,
    /// It is feasible and satisfies the margins including its own error.
    pub works: bool,
    /// The first rule or criterion that it violates.
    pub reason: Option<String>,
    /// Direction about the needle.
    pub roll_rad: Option<f64>,
    /// The posture.
    pub joints_rad: Option<[f64; 6]>,
    /// Least clearance of arm and tool from what stands around.
    pub clearance_m: Option<f64>,
    /// What is left of the margins with this configuration's error; none if it is not known or nothing is near.
    pub spare_m: Option<f64>,
    /// Share of the hemisphere of 0.35 m about the entry that arm and tool do not occupy.
    pub free_fraction: Option<f64>,
    /// Expected error.
    pub error: Option<AxisError>,
}

/// The route to take.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChosenRoute {
    /// Its number in `routes`.
    pub route: usize,
    /// The configuration that `run` recommends; none if no robot was asked, or it recommends none. Until motions were
    /// planned, the best by its posture.
    pub configuration: Option<&'static str>,
    /// Why, in the words of `run`; none until motions were planned.
    pub because: Option<String>,
}

impl ChosenRoute {
    /// No configuration is recommended, and why.
    pub fn leave_open(&mut self, why: String) {
        self.configuration = None;
        self.because = Some(why);
    }
}

/// A safer path that is infeasible for the robot.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WhyNot {
    /// Its number in `routes`.
    pub route: usize,
    /// By how much its odds are less than those of the chosen route: their ratio; none if there is no chosen one.
    pub odds_to_chosen: Option<f64>,
    /// Why configurations do not work, the most frequent reason first.
    pub reasons: Vec<Refused>,
    /// Changes that free it, the smallest of each kind; none if they were not looked for.
    pub freeing: Option<Freeing>,
}

/// What was tried to free a route, and what did.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Freeing {
    /// What was tried, for people.
    pub tried: String,
    /// The smallest change of each kind that makes as many configurations feasible as required; of equals the one with
    /// more feasible ones.
    pub freed: Vec<Freed>,
}

/// A change that makes a path feasible. Only postures are evaluated, without RMS errors.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Freed {
    /// `base`, `table` or `tool`.
    pub kind: &'static str,
    /// Lines for the scenario.
    pub toml: String,
    /// By how much it is moved, m; none for a tool.
    pub moved_m: Option<[f64; 3]>,
    /// Configurations that then work.
    pub working: usize,
}

/// All directions that were evaluated, column by column.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MapColumns {
    /// Rules by number.
    pub rules: Vec<&'static str>,
    /// Azimuth from the target, deg.
    pub azimuth_deg: Vec<f64>,
    /// Elevation, deg.
    pub elevation_deg: Vec<f64>,
    /// From the target to the skin; none where there is none that is known.
    pub depth_m: Vec<Option<f64>>,
    /// Number of the rule that refuses it; none if it is free.
    pub rule: Vec<Option<usize>>,
    /// What the rule found: m, rad or a count.
    pub value: Vec<Option<f64>>,
    /// What it may be.
    pub limit: Vec<Option<f64>>,
    /// Odds ratio of what is free.
    pub odds_ratio: Vec<Option<f64>>,
}

fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

/// To a millionth: what no scan and no arm is known to.
fn short(value: f64) -> f64 {
    (value * 1e6).round() / 1e6 + 0.0
}

impl MapColumns {
    /// Without a needle that bends there is no rule about it.
    pub(super) fn of(searched: &Searched, bends: bool) -> Self {
        let all = &searched.candidates;
        let angle = |index: usize| {
            let directions = all.iter();
            directions
                .map(|each| direction_deg(&each.outwards)[index])
                .collect()
        };
        let refusal = |value: &dyn Fn(&needlebench_routing::Refusal) -> f64| {
            let refusals = all.iter().map(|each| each.outcome.as_ref().err());
            refusals
                .map(|refusal| refusal.map(value).and_then(finite).map(short))
                .collect()
        };
        let rules = RouteRule::ALL.into_iter();
        let rules: Vec<RouteRule> = rules
            .filter(|each| bends || *each != RouteRule::Bent)
            .collect();
        let rule = |rule: RouteRule| rules.iter().position(|each| *each == rule);
        Self {
            rules: rules.iter().map(|each| each.name()).collect(),
            azimuth_deg: angle(0),
            elevation_deg: angle(1),
            depth_m: all.iter().map(|each| each.depth_m.map(short)).collect(),
            rule: all
                .iter()
                .map(|each| rule(each.outcome.as_ref().err()?.rule))
                .collect(),
            value: refusal(&|refusal| refusal.value),
            limit: refusal(&|refusal| refusal.limit),
            odds_ratio: all
                .iter()
                .map(|each| Some(short(each.outcome.as_ref().ok()?.risk.odds_ratio)))
                .collect(),
        }
    }
}

/// The document of what was found; `asked` in the order of preference.
pub(super) fn plan(
    task: &RouteTask<'_>,
    anatomy: &dyn Anatomy,
    rules: &RouteRules,
    searched: &Searched,
    asked: &[Asked],
) -> RoutePlan {
    let wanted = task.wanted();
    let with_robot = task.robot == WithRobot::Yes;
    let serves = |each: &Asked| !with_robot || each.working() >= wanted;
    let chosen = asked.iter().position(serves);
    let why_not = asked.first().filter(|first| with_robot && !serves(first));
    let odds = |index: usize| asked[index].rounded.route.risk.odds_ratio;
    let placed = task
        .resolved
        .cell
        .robot
        .world_from_base_link
        .translation
        .vector;
    RoutePlan {
        schema_version: 1,
        goal: task.section.name.clone(),
        lesion: task.section.lesion.clone(),
        target_in_phantom_m: anatomy.target().coords.into(),
        phantom_origin_in_ct_m: None,
        anatomy: anatomy.kind(),
        margins: Obstacle::ALL
            .into_iter()
            .map(|obstacle| BaseMargin {
                obstacle: obstacle.name(),
                margin_m: rules.margins_m[obstacle as usize],
                known: anatomy.knows(obstacle),
            })
            .collect(),
        margin_constant_m: rules.constant_m,
        sigmas: rules.sigmas,
        tried: searched.candidates.len(),
        free: searched.free().len(),
        refused: searched
            .refused()
            .into_iter()
            .map(|(rule, count)| RuleCount {
                rule: rule.name(),
                in_words: rule.in_words(),
                count,
            })
            .collect(),
        rolls: ROLLS,
        robot_not_asked: match &task.robot {
            WithRobot::Yes => None,
            WithRobot::No(why) => Some(why.clone()),
        },
        base_position_m: with_robot.then(|| placed.into()),
        wanted,
        robot_refused: reasons(asked),
        pareto: unbeaten(asked),
        chosen: chosen.map(|route| ChosenRoute {
            route,
            configuration: asked[route].best().map(|best| best.configuration.label()),
            because: None,
        }),
        why_not: why_not.map(|first| WhyNot {
            route: 0,
            odds_to_chosen: chosen.map(|chosen| odds(0) / odds(chosen)),
            reasons: reasons(std::slice::from_ref(first)),
            freeing: None,
        }),
        routes: asked
            .iter()
            .map(|each| answer(anatomy, rules, each))
            .collect(),
        bent: best_bent(anatomy, rules, searched),
        map: Some(MapColumns::of(searched, rules.needle.is_some())),
    }
}

/// The best path that only the bent needle is refused on.
fn best_bent(
    anatomy: &dyn Anatomy,
    rules: &RouteRules,
    searched: &Searched,
) -> Option<BentRefusal> {
    let refused = searched.candidates.iter();
    let refused = refused.filter_map(|candidate| candidate.straight.as_deref());
    let best = refused.min_by(|a, b| a.better_first(b))?;
    Some(BentRefusal {
        direction_deg: direction_deg(&best.outwards),
        odds_ratio: best.risk.odds_ratio,
        reason: bent_reason(anatomy, rules, best)?,
    })
}

/// Azimuth and elevation as they are written, deg.
fn direction_deg(outwards: &UnitVector3<f64>) -> [f64; 2] {
    needlebench_routing::angles_rad(outwards)
        .map(|angle| (angle.to_degrees() * 100.0).round() / 100.0 + 0.0)
}

/// Why configurations do not work, the most frequent reason first.
fn reasons(asked: &[Asked]) -> Vec<Refused> {
    let all = asked.iter().flat_map(|each| {
        let blocked = each.blocked.iter().map(String::as_str);
        let broken = each.configurations.iter();
        blocked.chain(broken.filter_map(|served| served.reason.as_deref()))
    });
    crate::proposal::counted(all)
}

fn unbeaten(asked: &[Asked]) -> Vec<(usize, &'static str)> {
    let mut pairs: Vec<(usize, &'static str)> = Vec::new();
    let mut aims: Vec<[f64; 4]> = Vec::new();
    for (route, each) in asked.iter().enumerate() {
        for served in each.configurations.iter().filter(|served| served.works()) {
            let error = served.error.map_or(0.0, |error| error.target_lateral_rms_m);
            pairs.push((route, served.configuration.label()));
            aims.push([
                each.rounded.route.risk.log_odds,
                -served.clearance_m.unwrap_or(f64::INFINITY),
                error,
                -served.room.unwrap_or(0.0),
            ]);
        }
    }
    let dominates = |a: &[f64; 4], b: &[f64; 4]| {
        let mut pairs = a.iter().zip(b);
        pairs.clone().all(|(a, b)| a <= b) && pairs.any(|(a, b)| a < b)
    };
    pareto_front(&aims, dominates)
        .into_iter()
        .map(|index| pairs[index])
        .collect()
}

fn answer(anatomy: &dyn Anatomy, rules: &RouteRules, asked: &Asked) -> RouteAnswer {
    let route = &asked.rounded.route;
    let direction_deg = asked.rounded.direction_deg;
    let ray = Ray {
        target: anatomy.target(),
        outwards: route.outwards,
    };
    let entry = ray.at(route.depth_m);
    let margin =
        |obstacle: Obstacle, nearest: Option<Nearest>, distances_m: &[f64; 3]| MarginReport {
            obstacle: obstacle.name(),
            part: nearest.map(|nearest| nearest.name),
            distance_m: finite(distances_m[obstacle as usize]),
            margin_m: rules.margins_m[obstacle as usize],
        };
    let margins = Obstacle::ALL.into_iter().map(|obstacle| {
        let span = [-rules.throw_m, route.depth_m];
        let nearest = anatomy.nearest(&ray, span, obstacle);
        margin(obstacle, nearest, &route.distances_m)
    });
    let needle = rules.needle.as_ref();
    let to_any_side = || needle?.bend(anatomy, &ray, route.depth_m, rules.throw_m);
    let bend = route.bend.clone().or_else(to_any_side);
    let bend = bend.as_ref().map(|bend| BendAnswer {
        tip_m: bend.tip_m,
        towards_in_phantom: bend.towards.map(Into::into),
        margins: Obstacle::ALL
            .map(|each| margin(each, bend.nearest(anatomy, &ray, each), &bend.distances_m))
            .into(),
    });
    let [azimuth, elevation] = direction_deg;
    let mm = entry.coords * 1e3;
    RouteAnswer {
        toml: format!(
            "entry_direction_deg = [{azimuth}, {elevation}] # enters at [{:.1}, {:.1}, {:.1}] mm, {:.0} mm deep",
            mm.x,
            mm.y,
            mm.z,
            route.depth_m * 1e3
        ),
        direction_deg,
        entry_in_phantom_m: entry.coords.into(),
        depth_m: route.depth_m,
        angle_to_skin_normal_rad: route.skin_angle_rad,
        margins: margins.collect(),
        bend,
        pleural_crossings: route.lungs.entries,
        depth_in_lung_m: route.lungs.within_m,
        fissures_crossed: route.lungs.fissures.clone(),
        bullae_crossed: route.lungs.bullae.clone(),
        risk: route.risk.clone(),
        blocked: asked.blocked.clone(),
        working: asked.working(),
        best: asked.best().map(|best| best.configuration.label()),
        configurations: asked.configurations.iter().map(configuration).collect(),
    }
}

fn configuration(served: &Served) -> ConfigurationAnswer {
    ConfigurationAnswer {
        label: Configuration::label(served.configuration),
        works: served.works(),
        reason: served.reason.clone(),
        roll_rad: served.candidate.as_ref().map(|each| each.roll_rad),
        joints_rad: served.candidate.as_ref().map(|each| each.joints.into()),
        clearance_m: served.clearance_m,
        spare_m: served.spare_m.and_then(|_| finite(served.least_spare_m())),
        free_fraction: served.room,
        error: served.error,
    }
}
