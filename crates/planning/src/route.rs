//! What the planned needle passes on its way from the skin to its end.

use std::cell::OnceCell;
use std::collections::BTreeMap;

use nalgebra::Point3;
use needlebench_cell::{Cell, ClearanceClass, Rule, part_in_words};
use needlebench_clearance::ROUNDING_M;
use needlebench_geometry::Separation;
use needlebench_phantom::{RouteObstacle, Tissue};
use needlebench_scenario::scenario::NeedleRouteSection;
use needlebench_scenario::{Goal, PlacedPhantom, ResolvedScenario};

use crate::Rejection;

/// What a planned needle comes near to.
#[derive(Debug, Clone, PartialEq)]
pub struct RouteClearance<'a> {
    /// The part.
    pub part: &'a RouteObstacle,
    /// Signed distance with the needle as A, world.
    pub separation: Separation,
    /// Whether it is what the needle comes nearest to as tissue bends it, and not on its straight way.
    pub is_bent: bool,
}

/// What the planned needle comes nearest to of bones, vessels and organs, from the skin to where it ends, straight or as
/// tissue bends it; `None` without a phantom that has any.
///
/// The organ that contains the target is left out, and the bone whose lesion is aimed at: the needle has to
/// enter them.
pub fn needle_route<'a>(
    resolved: &ResolvedScenario,
    placed: &'a PlacedPhantom,
    goal: &Goal,
) -> Option<RouteClearance<'a>> {
    let passage = Passage::new(resolved, placed, goal);
    passage.nearest(|part| part.tissue != Tissue::Fissure)
}

/// Names of the fissures of the lungs that the planned needle touches or crosses, in the order of the
/// phantom's parts: an air leak is likelier then.
pub fn crossed_fissures(resolved: &ResolvedScenario, goal: &Goal) -> Vec<String> {
    let Some(placed) = &resolved.phantom else {
        return Vec::new();
    };
    let parts = &placed.phantom.route_obstacles().parts;
    let fissures = parts.iter().filter(|part| part.tissue == Tissue::Fissure);
    let passage = Passage::new(resolved, placed, goal);
    let is_crossed = |fissure: &&RouteObstacle| {
        passage
            .nearest(|part| part == *fissure)
            .is_some_and(|nearest| nearest.separation.distance_m - ROUNDING_M <= 0.0)
    };
    fissures
        .filter(is_crossed)
        .map(|fissure| fissure.name.clone())
        .collect()
}

/// The lines of a goal's needle beside what it is to keep away from.
struct Passage<'p, 'g> {
    placed: &'p PlacedPhantom,
    /// Radius of the needle, m.
    radius_m: f64,
    /// From the skin to where it ends; none without a patient.
    straight: Option<[Point3<f64>; 2]>,
    /// As tissue bends the median needle: empty where it does not, or where it is not known to which side.
    bent: Vec<Point3<f64>>,
    entered: Entered<'p, 'g>,
}

impl<'p, 'g> Passage<'p, 'g> {
    fn new(resolved: &ResolvedScenario, placed: &'p PlacedPhantom, goal: &'g Goal) -> Self {
        let expected = resolved.expected.as_ref();
        let needle = expected.and_then(|expected| expected.imperfections.tissue());
        Self {
            placed,
            radius_m: needle_radius_m(&resolved.cell),
            straight: goal.entry_m.map(|entry| [entry, needle_end(goal)]),
            bent: needle
                .and_then(|needle| goal.median_line(needle))
                .unwrap_or_default(),
            entered: Entered::new(placed, goal),
        }
    }

    fn nearest(&self, wanted: impl Fn(&RouteObstacle) -> bool) -> Option<RouteClearance<'p>> {
        let Self {
            placed, radius_m, ..
        } = *self;
        let along = |points: &[Point3<f64>], is_bent| {
            nearest_along(radius_m, placed, points, &self.entered, &wanted)
                .map(|found| RouteClearance { is_bent, ..found })
        };
        let straight = along(self.straight.as_ref()?, false);
        let both = [straight, along(&self.bent, true)].into_iter().flatten();
        both.reduce(nearer)
    }
}

fn needle_radius_m(cell: &Cell) -> f64 {
    0.5 * cell.tool.needle.outer_diameter_m
}

/// The same of a needle through points, world.
fn nearest_along<'a>(
    radius_m: f64,
    placed: &'a PlacedPhantom,
    points: &[Point3<f64>],
    entered: &Entered<'_, '_>,
    wanted: impl Fn(&RouteObstacle) -> bool,
) -> Option<RouteClearance<'a>> {
    let obstacles = placed.phantom.route_obstacles();
    let counts = |index: usize| {
        let part = &obstacles.parts[index];
        wanted(part) && !entered.is(part)
    };
    let nearest = points.windows(2).filter_map(|ends| {
        let (index, separation) = obstacles.solids.nearest_to_segment(
            &ends[0],
            &ends[1],
            radius_m,
            &placed.world_from_phantom,
            counts,
        )?;
        Some(RouteClearance {
            part: &obstacles.parts[index],
            separation,
            is_bent: false,
        })
    });
    nearest.reduce(nearer)
}

/// The first of two, unless the second is nearer.
fn nearer<'a>(a: RouteClearance<'a>, b: RouteClearance<'a>) -> RouteClearance<'a> {
    if b.separation.distance_m < a.separation.distance_m {
        b
    } else {
        a
    }
}

/// What of bone, vessels and organs a bent needle of a goal comes nearest to, apart from what it has to enter: through
/// points from the skin to its tip, world.
pub fn bent_route<'a>(
    cell: &Cell,
    placed: &'a PlacedPhantom,
    goal: &Goal,
    points: &[Point3<f64>],
) -> Option<RouteClearance<'a>> {
    let entered = Entered::new(placed, goal);
    nearest_along(needle_radius_m(cell), placed, points, &entered, |part| {
        part.tissue != Tissue::Fissure
    })
}

/// A structure that the needle of a goal keeps away from.
#[derive(Debug, Clone, PartialEq)]
pub struct NeedleStructure<'a> {
    /// Its name.
    pub name: &'a str,
    /// Bone, vessel or organ.
    pub tissue: Tissue,
    /// Its parts, by their numbers among the phantom's route obstacles.
    pub parts: Vec<usize>,
}

/// Structures that the needle of a goal keeps away from, in the order of the phantom's parts.
pub fn needle_structures<'a>(
    section: &NeedleRouteSection,
    placed: &'a PlacedPhantom,
    goal: &Goal,
) -> Vec<NeedleStructure<'a>> {
    let entered = Entered::new(placed, goal);
    let mut structures: Vec<NeedleStructure<'_>> = Vec::new();
    let mut numbers = BTreeMap::new();
    let parts = placed.phantom.route_obstacles().parts.iter().enumerate();
    let kept = parts.filter(|(_, part)| {
        margin_m(section, part.tissue).is_some() && !is_off(section, part) && !entered.is(part)
    });
    for (index, part) in kept {
        let key = (organ_of(part), part.tissue);
        let number = *numbers.entry(key).or_insert_with(|| {
            structures.push(NeedleStructure {
                name: key.0,
                tissue: key.1,
                parts: Vec::new(),
            });
            structures.len() - 1
        });
        structures[number].parts.push(index);
    }
    structures
}

/// Structures that the needle must enter: the organ of the target, and what holds the lesion that it is aimed at, such
/// as a rib.
struct Entered<'p, 'g> {
    placed: &'p PlacedPhantom,
    goal: &'g Goal,
    /// Found when something is asked for the first time: hundreds of parts may hold the target.
    organs: OnceCell<Vec<String>>,
}

impl<'p, 'g> Entered<'p, 'g> {
    fn new(placed: &'p PlacedPhantom, goal: &'g Goal) -> Self {
        Self {
            placed,
            goal,
            organs: OnceCell::new(),
        }
    }

    fn is(&self, part: &RouteObstacle) -> bool {
        let organs = self.organs.get_or_init(|| self.find());
        organs.iter().any(|organ| organ == organ_of(part))
    }

    fn find(&self) -> Vec<String> {
        let Self { placed, goal, .. } = *self;
        let mut entered: Vec<String> = goal.target_organ.iter().cloned().collect();
        if goal.lesion.is_some() {
            let target = placed.world_from_phantom.inverse() * goal.target_m;
            entered.extend(placed.phantom.bones_at(&target).map(str::to_owned));
        }
        entered
    }
}

/// The organ that a part belongs to; itself, if to none.
fn organ_of(part: &RouteObstacle) -> &str {
    part.organ.as_deref().unwrap_or(&part.name)
}

/// Where the needle's tip ends, or the target where that is deeper.
fn needle_end(goal: &Goal) -> Point3<f64> {
    let exit = Point3::from(goal.world_from_guide_exit.translation.vector);
    let tip = exit + goal.axis.into_inner() * goal.insertion_length_m;
    let deeper = (tip - goal.target_m).dot(&goal.axis) > 0.0;
    if deeper { tip } else { goal.aimed_m() }
}

/// Whether the scenario keeps the needle away from a part.
fn is_off(section: &NeedleRouteSection, part: &RouteObstacle) -> bool {
    section.off.iter().any(|name| part.is_called(name))
}

/// Least distance of the needle from a tissue, m; none for what it may pass through.
fn margin_m(section: &NeedleRouteSection, tissue: Tissue) -> Option<f64> {
    let margin_mm = match tissue {
        Tissue::Bone => section.bone_mm,
        Tissue::Vessel => section.vessel_mm,
        Tissue::Organ => section.organ_mm,
        Tissue::Skin
        | Tissue::Fissure
        | Tissue::Lesion
        | Tissue::Marker
        | Tissue::Beside
        | Tissue::Assumed => return None,
    };
    Some(margin_mm * 1e-3)
}

/// What a planned needle keeps away from least, by its margin.
#[derive(Debug, Clone, PartialEq)]
pub struct RouteJudgement<'a> {
    /// What it is, and how far.
    pub nearest: RouteClearance<'a>,
    /// The distance less what rounding may add to it, m.
    pub distance_m: f64,
    /// The required distance, m.
    pub margin_m: f64,
}

impl RouteJudgement<'_> {
    /// The margin is kept.
    pub fn is_kept(&self) -> bool {
        self.distance_m >= self.margin_m
    }
}

/// The margin that the planned needle of a goal keeps least, or misses most; `None` where there is nothing
/// to keep away from, or it is switched off.
pub fn judge_route<'a>(resolved: &'a ResolvedScenario, goal: &Goal) -> Option<RouteJudgement<'a>> {
    judge_route_beside(resolved, resolved.phantom.as_ref()?, goal)
}

/// [`judge_route`] with the phantom at another place.
pub fn judge_route_beside<'a>(
    resolved: &ResolvedScenario,
    placed: &'a PlacedPhantom,
    goal: &Goal,
) -> Option<RouteJudgement<'a>> {
    judged_tissues(resolved, placed, goal).min_by(|a, b| {
        let surplus = |each: &RouteJudgement<'_>| each.distance_m - each.margin_m;
        surplus(a).total_cmp(&surplus(b))
    })
}

/// How the planned needle of a goal keeps each margin, straight and as tissue bends it: bone, vessel and organ, as far as
/// there are any that it has to keep away from.
pub fn judged_tissues<'a>(
    resolved: &ResolvedScenario,
    placed: &'a PlacedPhantom,
    goal: &Goal,
) -> impl Iterator<Item = RouteJudgement<'a>> {
    judged(resolved, Passage::new(resolved, placed, goal))
}

/// [`judged_tissues`] of the straight needle alone.
pub fn judged_straight<'a>(
    resolved: &ResolvedScenario,
    placed: &'a PlacedPhantom,
    goal: &Goal,
) -> impl Iterator<Item = RouteJudgement<'a>> {
    let passage = Passage {
        bent: Vec::new(),
        ..Passage::new(resolved, placed, goal)
    };
    judged(resolved, passage)
}

fn judged<'a>(
    resolved: &ResolvedScenario,
    passage: Passage<'a, '_>,
) -> impl Iterator<Item = RouteJudgement<'a>> {
    let section = &resolved.scenario.planning.needle_route;
    let tissues = [Tissue::Bone, Tissue::Vessel, Tissue::Organ].into_iter();
    tissues.filter_map(move |tissue| {
        let margin_m = margin_m(section, tissue)?;
        let wanted = |part: &RouteObstacle| part.tissue == tissue && !is_off(section, part);
        let nearest = passage.nearest(wanted)?;
        Some(RouteJudgement {
            distance_m: nearest.separation.distance_m - ROUNDING_M,
            nearest,
            margin_m,
        })
    })
}

/// Why a goal is rejected for all configurations; `None` if the needle path satisfies its margins.
pub fn route_rejection(resolved: &ResolvedScenario, goal: &Goal) -> Option<Rejection> {
    let judged = judge_route(resolved, goal).filter(|judged| !judged.is_kept())?;
    let RouteObstacle { name, tissue, .. } = judged.nearest.part;
    let name = part_in_words(name);
    let does = if judged.distance_m < 0.0 {
        "passes through"
    } else {
        "is too close to"
    };
    let bent = if judged.nearest.is_bent {
        ", bent by tissue,"
    } else {
        ""
    };
    Some(Rejection {
        rule: Rule::NeedleRoute,
        value: judged.distance_m,
        limit: judged.margin_m,
        unit: "m",
        detail: format!("the planned needle{bent} {does} {name} ({tissue})"),
        class: Some(ClearanceClass::NeedleRoute),
    })
}
