//! Needle paths, planned with the robot: which entries reach a target without harm, which of them are feasible for the
//! arm, in which configuration, with what margin and expected error, and what room is left.
//!
//! # How they are found
//!
//! 1. Thousands of directions are evaluated by the rules and risks of [`needlebench_routing`], without the robot.
//! 2. Of those that are free, the best ones at least 2 deg apart, at most 200, are moved to the best place near by and
//!    asked for: each of the eight configurations at 12 rolls, by the code of `check`; what works has the expected
//!    error of its own arm, registration and patient, and has to keep the margins with it.
//! 3. The choice is the best of the paths with as many feasible configurations as the scenario requires. The odds
//!    ratios are not known to a tenth: paths whose odds differ by less are equal, and are ordered by what is left of
//!    their margins. Beside it stands what nothing beats in risk, clearance, expected error and room at once.
//! 4. Configurations on the chosen route are ranked by a run of it (`needlebench_bench::rank_route`).
//! 5. If a safer route fails by the robot alone, the smallest change that would free it is looked for.

mod freeing;
mod joint;
mod report;

use std::sync::Arc;

use needlebench_input::Finding;
use needlebench_parallel::{Control, in_parallel};
use needlebench_phantom::Phantom;
use needlebench_routing::{
    Anatomy, Route, RouteNeedle, RouteRules, Searched, SolidAnatomy, VoxelAnatomy, VoxelOptions,
    angles_rad, apart, judge, outwards, refined, search,
};
use needlebench_scenario::scenario::{GoalSection, RouteSection};
use needlebench_scenario::{GoalPlacer, ResolvedScenario};
use needlebench_volume::{BesideKind, VolumeError};

use crate::ct::BuiltFolder;
use crate::proposal::SuggestError;
use joint::{Asked, Served, ask, best_asked};

pub use freeing::free;
pub use joint::AxisError;
pub use report::{
    BendAnswer, BentRefusal, ChosenRoute, ConfigurationAnswer, Freed, Freeing, MapColumns,
    MarginReport, RouteAnswer, RoutePlan, RuleCount, WhyNot,
};

/// Directions that are evaluated in voxels.
pub const VOXEL_DIRECTIONS: usize = 20_000;
/// Directions that are evaluated among solids, whose distances are exact and take longer.
pub const SOLID_DIRECTIONS: usize = 4_000;
/// Least angle between directions that the robot is checked for, rad: 2 deg.
const APART_RAD: f64 = 2.0 * std::f64::consts::PI / 180.0;
/// Most directions that the robot is checked for.
const MOST_ASKED: usize = 200;
/// Smallest step of a direction that is moved to the best place near by, rad.
const REFINED_RAD: f64 = 0.002;
/// Logarithms of odds that differ by less are equal: a tenth, since no ratio is known better.
pub const SAME_ODDS: f64 = 0.1;
/// Steps that directions are rounded to, deg: what is written is what was evaluated.
const ROUNDED: f64 = 100.0;

/// Whether and why a robot is asked.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum WithRobot {
    /// The robot of the scenario.
    Yes,
    /// No robot can be asked: why.
    No(String),
}

/// Why there are no voxels to plan in.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum VoxelsError {
    /// The scan has no such place, or it was interrupted.
    #[error(transparent)]
    Scan(#[from] VolumeError),
    /// The goal has no target.
    #[error("{0}")]
    Target(Finding),
}

impl From<Finding> for VoxelsError {
    fn from(finding: Finding) -> Self {
        Self::Target(finding)
    }
}

/// What is to be planned.
#[derive(Debug)]
pub struct RouteTask<'a> {
    /// The cell, with any goals.
    pub resolved: &'a ResolvedScenario,
    /// The goal's target, guide and approach; an entry that it has does not count.
    pub section: &'a GoalSection,
    /// Rules and risks.
    pub rules: &'a RouteSection,
    /// Whether the robot is asked.
    pub robot: WithRobot,
    /// Directions to judge.
    pub directions: usize,
}

impl RouteTask<'_> {
    /// The rules in SI; without the needle's bend where its bevel is to face what is not there, see [`free_routes`].
    pub fn route_rules(&self) -> RouteRules {
        let rules = RouteRules::new(
            self.rules,
            &self.resolved.scenario.planning.needle_route,
            &self.resolved.cell.tool,
            self.section.standoff_mm * 1e-3,
            // A robot whose error nobody tells has the usual one.
            self.robot == WithRobot::Yes && self.resolved.expected.is_some(),
        );
        RouteRules {
            needle: self.needle().ok().flatten(),
            ..rules
        }
    }

    /// The needle, if tissue bends it.
    fn needle(&self) -> Result<Option<RouteNeedle>, Finding> {
        let expected = self.resolved.expected.as_ref();
        let Some(needle) = expected.and_then(|expected| expected.imperfections.tissue()) else {
            return Ok(None);
        };
        let facing = GoalPlacer::new(self.resolved).bevel()?;
        Ok(facing.map(|facing| RouteNeedle {
            needle: needle.clone(),
            facing,
            standoff_m: self.section.standoff_mm * 1e-3,
            insertion_length_m: self.section.insertion_length_mm.map(|mm| mm * 1e-3),
        }))
    }

    /// Required number of feasible configurations.
    fn wanted(&self) -> usize {
        let criteria = &self.resolved.scenario.criteria;
        (criteria.min_working_configurations as usize).max(1)
    }

    /// The goal with the entry in a direction from its target, deg.
    fn section_at(&self, direction_deg: [f64; 2]) -> GoalSection {
        GoalSection {
            entry_mm: None,
            entry_direction_deg: Some(direction_deg),
            route: None,
            expected: std::collections::BTreeMap::new(),
            ..self.section.clone()
        }
    }

    /// The voxels of a scan about the target; Hounsfield units, in the order of the labels, tell fat from other soft
    /// tissue on the way of a needle that bends.
    ///
    /// # Errors
    /// If the target is none, or is not in the scan's body; interrupted.
    pub fn voxels(
        &self,
        built: &BuiltFolder,
        hu: Option<&[i16]>,
        control: &Control<'_>,
    ) -> Result<VoxelAnatomy, VoxelsError> {
        let target = GoalPlacer::new(self.resolved).target(self.section)?;
        let rules = self.route_rules();
        let placed = self.resolved.phantom.as_ref();
        let scenario = &self.resolved.scenario;
        // What the scenario does not have is not there: a couch that the patient does not lie on.
        let parts = scenario.phantom.iter().flat_map(|phantom| &phantom.parts);
        let parts: Vec<&str> = parts.map(|part| part.name.as_str()).collect();
        let beside = BesideKind::ALL.iter().map(|kind| kind.name());
        let missing = beside.filter(|name| !parts.contains(name));
        let mut off = scenario.planning.needle_route.off.clone();
        off.extend(missing.map(str::to_owned));
        let options = VoxelOptions {
            patient: placed.map(|placed| &placed.phantom),
            lesions: &built.lesions(),
            off: &off,
            needle_m: rules.longest_m,
            markers: &built.markers(),
            outside_m: rules.outside_m,
            lung_vessel_m: self.rules.lung_vessel_mm * 1e-3,
            below_rib_m: self.rules.below_rib_mm * 1e-3,
            beside_sternum_m: self.rules.beside_sternum_mm * 1e-3,
            hu: hu.filter(|_| rules.needle.is_some()),
            threads: control.threads,
            cancel: control.cancel,
        };
        Ok(VoxelAnatomy::new(
            built.labels(),
            built.origin_in_ct_m(),
            target,
            &options,
        )?)
    }

    /// The patient.
    ///
    /// # Errors
    /// A scenario without one.
    pub fn phantom(&self) -> Result<&Arc<Phantom>, SuggestError> {
        let placed = self.resolved.phantom.as_ref();
        let placed =
            placed.ok_or_else(|| SuggestError::refused("no patient", "add a [phantom] section"))?;
        Ok(&placed.phantom)
    }

    /// The phantom's solids about the target.
    ///
    /// # Errors
    /// If there is no patient or the target is none.
    pub fn solids(&self) -> Result<SolidAnatomy<'_>, SuggestError> {
        let target = GoalPlacer::new(self.resolved).target(self.section)?;
        Ok(SolidAnatomy::new(
            self.phantom()?,
            target,
            self.section.lesion.is_some(),
            &self.resolved.scenario.planning.needle_route,
        ))
    }
}

/// A route with its direction as it is written.
#[derive(Debug, Clone, PartialEq)]
struct Rounded {
    direction_deg: [f64; 2],
    route: Route,
}

/// The selected path, and the configurations feasible for it.
#[derive(Debug, Clone, PartialEq)]
pub struct ServedRoute {
    /// Azimuth and elevation from the target, deg: `entry_direction_deg`.
    pub direction_deg: [f64; 2],
    /// From the skin to the target, m.
    pub depth_m: f64,
    /// How it compares: [`needlebench_routing::Risk::odds_ratio`].
    pub odds_ratio: f64,
    /// Feasible configurations, the margins included, with the error of each.
    pub working: usize,
    /// The one to choose among them.
    pub best: &'static str,
}

impl ServedRoute {
    fn of(asked: &Asked) -> Option<Self> {
        let best: &Served = asked.best()?;
        Some(Self {
            direction_deg: asked.rounded.direction_deg,
            depth_m: asked.rounded.route.depth_m,
            odds_ratio: asked.rounded.route.risk.odds_ratio,
            working: asked.working(),
            best: best.configuration.label(),
        })
    }
}

/// Directions as the patient alone judges them, and those of the free ones that stand for the rest.
#[derive(Debug, Clone, PartialEq)]
pub struct FreeRoutes {
    rules: RouteRules,
    searched: Searched,
    standing: Vec<Rounded>,
}

/// Plans the routes to a target. The same for any number of threads.
///
/// # Errors
/// If there is no patient, the target is none, the robot is none that can be asked, or it was interrupted.
pub fn plan_routes(
    task: &RouteTask<'_>,
    anatomy: &dyn Anatomy,
    control: &Control<'_>,
) -> Result<RoutePlan, SuggestError> {
    let free = free_routes(task, anatomy, control)?;
    match task.robot {
        WithRobot::Yes => free.plan_with_robot(task, anatomy, control),
        WithRobot::No(_) => Ok(free.plan(task, anatomy)),
    }
}

/// The first stage of [`plan_routes`].
///
/// # Errors
/// If the bevel is to face a structure that the patient does not have, or it was interrupted.
pub fn free_routes(
    task: &RouteTask<'_>,
    anatomy: &dyn Anatomy,
    control: &Control<'_>,
) -> Result<FreeRoutes, SuggestError> {
    task.needle()?;
    let rules = task.route_rules();
    control.progress.message("routes");
    let stop = || control.is_cancelled();
    let searched = search(anatomy, &rules, task.directions, control.threads, &stop);
    if control.is_cancelled() {
        return Err(SuggestError::Interrupted);
    }
    let standing = candidates(anatomy, &rules, &searched, task.directions, control.threads);
    Ok(FreeRoutes {
        rules,
        searched,
        standing,
    })
}

impl FreeRoutes {
    /// The plan from the patient alone: the robot was not checked, or not yet.
    pub fn plan(&self, task: &RouteTask<'_>, anatomy: &dyn Anatomy) -> RoutePlan {
        let standing = self.standing.iter().cloned();
        let unasked = standing.map(Asked::without_robot).collect();
        let mut plan = self.ordered(task, anatomy, unasked);
        if plan.robot_not_asked.is_none() {
            plan.robot_not_asked = Some("not checked yet".to_owned());
            plan.why_not = None;
        }
        plan
    }

    /// The plan with the task's robot.
    ///
    /// # Errors
    /// If the robot is none that can be asked, or it was interrupted.
    pub fn plan_with_robot(
        &self,
        task: &RouteTask<'_>,
        anatomy: &dyn Anatomy,
        control: &Control<'_>,
    ) -> Result<RoutePlan, SuggestError> {
        let asked = ask(task, &self.rules, &self.standing, control)?;
        Ok(self.ordered(task, anatomy, asked))
    }

    /// The route that [`FreeRoutes::plan_with_robot`] chooses, without asking for others than could be it: what a robot
    /// leaves to spare is no more than the needle has, so that the search ends where no route to come has as much.
    ///
    /// # Errors
    /// If the robot is none that can be asked, or it was interrupted.
    pub fn best_served(
        &self,
        task: &RouteTask<'_>,
        control: &Control<'_>,
    ) -> Result<Option<ServedRoute>, SuggestError> {
        let least = least_log_odds(self.standing.iter());
        let spare_m = |each: &Rounded| each.route.spare_m;
        let mut standing = self.standing.clone();
        standing
            .sort_by(|a, b| better_first(least, (&a.route, spare_m(a)), (&b.route, spare_m(b))));
        let better_first = |a: (&Route, f64), b: (&Route, f64)| better_first(least, a, b);
        let best = best_asked(task, &self.rules, &standing, control, better_first)?;
        Ok(best.as_ref().and_then(ServedRoute::of))
    }

    /// Why [`FreeRoutes::best_served`] has none for a task.
    pub fn why_none(&self, task: &RouteTask<'_>) -> String {
        let goal = &task.section.name;
        if self.searched.free().is_empty() {
            let refused = self.searched.refused();
            let most = refused.iter().max_by_key(|(_, count)| *count);
            format!(
                "goal `{goal}` has no needle path: none of {} directions is admissible; most \
                 frequent reason: {}",
                self.searched.candidates.len(),
                most.map_or("", |(rule, _)| rule.in_words())
            )
        } else {
            format!(
                "goal `{goal}` has no needle path feasible for the robot: none of {} \
                 representative paths in {} of 8 configurations",
                self.standing.len(),
                task.wanted()
            )
        }
    }

    fn ordered(&self, task: &RouteTask<'_>, anatomy: &dyn Anatomy, asked: Vec<Asked>) -> RoutePlan {
        report::plan(task, anatomy, &self.rules, &self.searched, &ordered(asked))
    }
}

/// Directions that stand for those around them, each at the best place near by.
fn candidates(
    anatomy: &dyn Anatomy,
    rules: &RouteRules,
    searched: &Searched,
    directions: usize,
    threads: usize,
) -> Vec<Rounded> {
    let mut free = searched.free();
    let least = free.first().map_or(0.0, |route| route.risk.log_odds);
    // Odds that cannot be told apart are no reason to give up what there is to spare.
    let better = |a: &Route, b: &Route| better_first(least, (a, a.spare_m), (b, b.spare_m));
    free.sort_by(|a, b| better(a, b));
    let picked = apart(&free, |route| route.outwards, APART_RAD, MOST_ASKED);
    // Half of the distance between directions of an even grid.
    let step_rad = 0.5 * (4.0 * std::f64::consts::PI / directions.max(1) as f64).sqrt();
    let each = in_parallel(threads, &picked, |&index| {
        let best = refined(anatomy, rules, free[index], [step_rad, REFINED_RAD], better);
        rounded(anatomy, rules, &best).or_else(|| rounded(anatomy, rules, free[index]))
    });
    let mut found: Vec<Rounded> = each.into_iter().flatten().collect();
    found.sort_by(|a, b| better(&a.route, &b.route));
    // Several may have come to the same place.
    let kept = apart(&found, |each| each.route.outwards, APART_RAD, MOST_ASKED);
    kept.into_iter().map(|index| found[index].clone()).collect()
}

/// The route in the direction as it is written, if that is free too.
fn rounded(anatomy: &dyn Anatomy, rules: &RouteRules, route: &Route) -> Option<Rounded> {
    let direction_deg = angles_rad(&route.outwards)
        .map(|angle| (angle.to_degrees() * ROUNDED).round() / ROUNDED + 0.0);
    let direction = outwards(direction_deg.map(f64::to_radians));
    let route = judge(anatomy, rules, &direction).outcome.ok()?;
    Some(Rounded {
        direction_deg,
        route,
    })
}

/// Of two routes with what each has to spare the better one first: by odds in distinguishable steps, then by margin.
fn better_first(
    least_log_odds: f64,
    (a, a_spare_m): (&Route, f64),
    (b, b_spare_m): (&Route, f64),
) -> std::cmp::Ordering {
    let step = |route: &Route| ((route.risk.log_odds - least_log_odds) / SAME_ODDS + 1e-9).floor();
    let by_odds = step(a).total_cmp(&step(b));
    by_odds
        .then(b_spare_m.total_cmp(&a_spare_m))
        .then(a.risk.log_odds.total_cmp(&b.risk.log_odds))
}

fn least_log_odds<'a>(routes: impl Iterator<Item = &'a Rounded>) -> f64 {
    routes
        .map(|each| each.route.risk.log_odds)
        .fold(f64::INFINITY, f64::min)
}

fn ordered(mut asked: Vec<Asked>) -> Vec<Asked> {
    let least = least_log_odds(asked.iter().map(|each| &each.rounded));
    asked.sort_by(|a, b| {
        better_first(
            least,
            (&a.rounded.route, a.spare_m()),
            (&b.rounded.route, b.spare_m()),
        )
    });
    asked
}
