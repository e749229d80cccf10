//! How likely a configuration's needle comes too close to structures, and its tip is in the lesion.

use std::cell::OnceCell;
use std::iter;

use nalgebra::{Matrix3, Point3, Rotation3, Vector3};
use needlebench_evaluation::probability::{
    ASSUMED_LARGER, EventProbability, LargerProbability, LesionProbability, ProbabilityReport,
    StructureProbability,
};
use needlebench_geometry::PreparedSolids;
use needlebench_kinematics::Pose;
use needlebench_phantom::{Lesion, Phantom, Tissue};
use needlebench_planning::{GoalPlan, NeedleStructure, needle_structures};
use needlebench_probability::{
    Anatomy, Body, Bound, BoundKind, Case, Draws, Estimate, Event, HalfPlane, LEAST_PRINTED,
    Larger, Law, Needle, Origin, Structure, Told, at_most, bound_label, estimate, estimate_label,
};
use needlebench_scenario::imperfections::Imperfections;
use needlebench_scenario::{Goal, PlacedPhantom, ResolvedScenario};
use needlebench_uncertainty::Source;
use needlebench_uncertainty::budget::{BudgetCase, path_law};

use crate::budgets::{measured_and_assumed, of_each};
use crate::setup::Setup;

/// How close is too close, m (assumed).
const MARGIN_M: f64 = 1e-3;

/// The tip is to come so near to its point, m.
const POINT_M: f64 = 2e-3;

/// What is farther beside the planned needle than the first, or before its entry and behind its tip than the second, by a full
/// breath more, counts together, m.
const BESIDE_M: f64 = 12e-3;
const BEHIND_M: f64 = 30e-3;

/// Farther off its goal an arm holds its needle too far from what was looked at beside it, m.
const HELD_M: f64 = 5e-3;

/// Standard deviations of boundaries that they are taken to be nearer by: none is by more (6e-16).
const FAR: f64 = 8.0;

/// Most draws of an estimate.
const DRAWS: u64 = 100_000;

/// Draws of the lesion alone: of many configurations that are compared.
const LESION_DRAWS: u64 = 10_000;

/// Triangles of surfaces are cut until no edge is longer, m.
const EDGE_M: f64 = 5e-3;

/// Solids are taken for triangles that are farther inside by no more, m.
const CHORD_M: f64 = 1e-4;

/// Standard deviation of where a bone's boundary is seen in slices of 1 mm and of 5 mm, m: of ribs, measured on synthetic
/// scans of the shipped chests; in between and beyond along the line through both.
const BONE_SD_M: [f64; 2] = [0.21e-3, 0.68e-3];
const SLICES_M: [f64; 2] = [1e-3, 5e-3];

/// Probabilities by goal and configuration, for every configuration with a motion in a patient, and what went wrong where there
/// are none.
pub(crate) type Probabilities = Vec<Vec<Option<Result<ProbabilityReport, String>>>>;

/// Of all configurations that have a motion; with larger assumed errors besides, if asked.
pub(crate) fn probabilities(
    setup: &Setup<'_>,
    plans: &[GoalPlan],
    threads: usize,
    with_larger: bool,
) -> Probabilities {
    let resolved = setup.resolved;
    let goals = resolved.goals.iter();
    let goals: Vec<Option<Surroundings<'_>>> = goals
        .map(|goal| Surroundings::new(resolved, goal, Extent::All))
        .collect();
    let draws = Extent::All.draws(resolved);
    let found = of_each(setup, plans, threads, |goal, case| {
        Some(goals[goal].as_ref()?.of(case, &draws, with_larger))
    });
    let flat = |each: Vec<Option<Option<_>>>| each.into_iter().map(Option::flatten).collect();
    found.into_iter().map(flat).collect()
}

/// What probabilities are told of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Extent {
    /// Lesion and structures, as of a run.
    All,
    /// The lesion, by few draws; no structure is looked at.
    Lesion,
}

impl Extent {
    /// The draws of a scenario's needles.
    fn draws(self, resolved: &ResolvedScenario) -> Draws {
        Draws {
            seed: resolved.scenario.seed,
            most: match self {
                Self::All => DRAWS,
                Self::Lesion => LESION_DRAWS,
            },
            threads: 1,
            moves: false,
        }
    }
}

/// Probabilities of several configurations of one goal: what is about the needle is prepared once, at the first of them.
pub(crate) struct GoalProbabilities<'a> {
    resolved: &'a ResolvedScenario,
    goal: &'a Goal,
    extent: Extent,
    around: OnceCell<Option<Surroundings<'a>>>,
}

impl<'a> GoalProbabilities<'a> {
    pub fn new(resolved: &'a ResolvedScenario, goal: &'a Goal, extent: Extent) -> Self {
        Self {
            resolved,
            goal,
            extent,
            around: OnceCell::new(),
        }
    }

    /// Of a configuration; none without a patient.
    ///
    /// # Errors
    /// A sentence.
    pub fn of(&self, case: &BudgetCase<'_>) -> Option<Result<ProbabilityReport, String>> {
        let prepare = || Surroundings::new(self.resolved, self.goal, self.extent);
        let around = self.around.get_or_init(prepare).as_ref()?;
        Some(around.of(case, &self.extent.draws(self.resolved), false))
    }
}

/// The lesion that a goal's target is in.
pub(crate) fn lesion_at<'a>(placed: &'a PlacedPhantom, goal: &Goal) -> Option<&'a Lesion> {
    let place = placed.world_from_phantom.inverse() * goal.target_m;
    let mut lesions = placed.phantom.lesions.iter();
    lesions.find(|lesion| match &goal.lesion {
        Some(name) => lesion.name == *name,
        None => (place - lesion.center_m).norm() < 0.5 * lesion.diameter_m,
    })
}

/// What is about a goal's needle: the same for all configurations.
struct Surroundings<'a> {
    extent: Extent,
    /// Structures that are near, with their distances from the planned needle's surface, m.
    near: Vec<(NeedleStructure<'a>, f64)>,
    /// How many others there are.
    others: usize,
    /// Those that are near, all others together as far as they move with the chest wall and with the lung, the target, and the
    /// lesion.
    structures: Vec<Structure>,
    around: Around<'a>,
    needle: Needle,
    lesion: Option<(String, f64)>,
}

/// Structures in the frame of the needle.
struct Around<'a> {
    solids: &'a PreparedSolids,
    phantom_from_needle: Pose,
    places: Vec<Place>,
}

enum Place {
    /// Parts of the phantom.
    Parts(Vec<usize>),
    /// Outside of a cylinder.
    Outside(Cylinder),
    /// Within a radius of a point, m.
    Ball(Point3<f64>, f64),
}

/// What is near a planned needle: a cylinder about its axis.
#[derive(Clone, Copy)]
struct Cylinder {
    radius_m: f64,
    /// Where it begins and ends along the needle, from the entry, m.
    ends_m: [f64; 2],
}

impl Cylinder {
    /// Of a body that a full breath moves so far, m.
    fn new(needle: &Needle, breath_m: f64) -> Self {
        let behind_m = BEHIND_M + breath_m;
        Self {
            radius_m: BESIDE_M + breath_m + needle.radius_m,
            ends_m: [-behind_m, needle.depth_m + behind_m],
        }
    }

    /// How far a point is from what is outside, m: negative outside, and no farther than it says.
    fn depth_m(&self, point: &Point3<f64>) -> f64 {
        let [from_m, to_m] = self.ends_m;
        let beside_m = self.radius_m - point.coords.yz().norm();
        beside_m.min(point.x - from_m).min(to_m - point.x)
    }

    /// Smaller by a distance, m.
    fn within(self, by_m: f64) -> Self {
        let [from_m, to_m] = self.ends_m;
        Self {
            radius_m: self.radius_m - by_m,
            ends_m: [from_m + by_m, to_m - by_m],
        }
    }
}

impl Anatomy for Around<'_> {
    fn distance_m(&self, structure: usize, point_m: &Point3<f64>) -> f64 {
        match &self.places[structure] {
            Place::Parts(parts) => {
                let point = self.phantom_from_needle * point_m;
                self.solids.distance_to_point_m(parts, &point)
            }
            Place::Outside(cylinder) => cylinder.depth_m(point_m),
            Place::Ball(middle, radius_m) => (point_m - middle).norm() - radius_m,
        }
    }
}

/// Pose of the needle's frame in the world: x along the guide's axis from the planned entry point, y and z along x and y of the
/// guide's exit at roll 0.
fn world_from_needle(goal: &Goal, entry: &Point3<f64>) -> Pose {
    let axes = goal.world_from_guide_exit.rotation.to_rotation_matrix();
    let [x, y, z] = [0, 1, 2].map(|column| axes.matrix().column(column).into_owned());
    let turned = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[z, x, y]));
    Pose::from_parts(entry.coords.into(), turned.into())
}

impl<'a> Surroundings<'a> {
    /// None for a goal without a patient.
    fn new(resolved: &'a ResolvedScenario, goal: &'a Goal, extent: Extent) -> Option<Self> {
        let placed = resolved.phantom.as_ref()?;
        let phantom = &placed.phantom;
        let solids = &phantom.route_obstacles().solids;
        let entry = goal.entry_m?;
        let section = &resolved.scenario.planning.needle_route;
        let imperfections = &resolved.expected.as_ref()?.imperfections;
        let seen = Boundaries::of(imperfections);
        let breath_m = imperfections.breathing.map_or([0.0; 2], |breathing| {
            [breathing.skin_m, breathing.target_m].map(|moved_m| moved_m.norm())
        });
        let world_from_needle = world_from_needle(goal, &entry);
        let phantom_from_needle = placed.world_from_phantom.inverse() * world_from_needle;
        let needle_from_world = world_from_needle.inverse();
        let needle = Needle {
            depth_m: goal.insertion_length_m - goal.standoff_m.unwrap_or(0.0),
            throw_m: 0.0,
            radius_m: 0.5 * resolved.cell.tool.needle.outer_diameter_m,
        };
        let cylinders = breath_m.map(|moved_m| Cylinder::new(&needle, moved_m));
        let farthest_m = BEHIND_M + breath_m[0].max(breath_m[1]);
        let tip = entry + goal.axis.into_inner() * needle.depth_m;
        let distance_m = |obstacle: &NeedleStructure<'_>| {
            let wanted = |index: usize| obstacle.parts.contains(&index);
            let place = &placed.world_from_phantom;
            solids
                .nearest_to_segment(&entry, &tip, needle.radius_m, place, wanted)
                .map_or(f64::INFINITY, |(_, to)| to.distance_m)
        };
        let obstacles = needle_structures(section, placed, goal).into_iter();
        let all: Vec<(NeedleStructure<'_>, f64)> = obstacles
            .map(|each| {
                let distance_m = distance_m(&each);
                (each, distance_m)
            })
            .collect();
        let mut structures = Vec::new();
        let mut places = Vec::new();
        let mut add = |name: &str, body, boundary_sd_m, covers, place| {
            structures.push(Structure {
                name: name.to_owned(),
                body,
                boundary_sd_m,
                covers,
            });
            places.push(place);
        };
        let needle_from_phantom = phantom_from_needle.inverse();
        let mut near = Vec::new();
        let mut others = 0;
        for (obstacle, distance_m) in all {
            if extent == Extent::Lesion || distance_m >= farthest_m {
                others += 1;
                continue;
            }
            let parts = &phantom.route_obstacles().parts;
            let names = obstacle.parts.iter().map(|part| &parts[*part].name);
            let surfaces: Vec<Vec<Point3<f64>>> =
                names.map(|name| corners_of(phantom, name)).collect();
            let body = body_of(obstacle.tissue, &surfaces, phantom);
            let cylinder = &cylinders[of_body(body)];
            let mut corners = Vec::new();
            for triangle in surfaces.iter().flat_map(|each| each.chunks_exact(3)) {
                let triangle = [0, 1, 2].map(|corner| needle_from_phantom * triangle[corner]);
                add_near(triangle, cylinder, &mut corners);
            }
            if corners.is_empty() && distance_m > 0.0 {
                others += 1;
                continue;
            }
            let covers = HalfPlane::covers(&corners, 3, CHORD_M);
            let sd_m = seen.of_m(obstacle.tissue);
            let place = Place::Parts(obstacle.parts.clone());
            add(obstacle.name, body, sd_m, covers, place);
            near.push((obstacle, distance_m));
        }
        for body in [Body::Wall, Body::Lung] {
            let shift_m = FAR * seen.soft_m.max(seen.bone_m);
            let place = Place::Outside(cylinders[of_body(body)].within(shift_m));
            add("others", body, 0.0, Vec::new(), place);
        }
        let target = Place::Ball(needle_from_world * goal.target_m, POINT_M);
        add("target", Body::Lung, 0.0, Vec::new(), target);
        let lesion = lesion_at(placed, goal).map(|lesion| {
            let middle = needle_from_world * (placed.world_from_phantom * lesion.center_m);
            let place = Place::Ball(middle, 0.5 * lesion.diameter_m);
            add(&lesion.name, Body::Lung, seen.soft_m, Vec::new(), place);
            (lesion.name.clone(), lesion.diameter_m)
        });
        Some(Self {
            extent,
            near,
            others,
            structures,
            around: Around {
                solids,
                phantom_from_needle,
                places,
            },
            needle,
            lesion,
        })
    }

    /// The structures with boundaries that are seen less well, as none of them is measured.
    fn boundaries_larger(&self) -> Vec<Structure> {
        let structures = self.structures.iter().cloned();
        structures
            .map(|structure| Structure {
                boundary_sd_m: structure.boundary_sd_m * ASSUMED_LARGER,
                ..structure
            })
            .collect()
    }

    /// Probabilities of a configuration's needle; with larger assumed errors besides, if asked.
    ///
    /// # Errors
    /// A sentence.
    fn of(
        &self,
        case: &BudgetCase<'_>,
        draws: &Draws,
        with_larger: bool,
    ) -> Result<ProbabilityReport, String> {
        let off_m = case.held_off_m.map(|off_m| off_m.norm());
        if let Some(off_m) = off_m.into_iter().find(|off_m| *off_m > HELD_M) {
            return Err(format!(
                "the needle is held {:.1} mm off the goal's: only up to {:.0} mm the structures beside it are known",
                off_m * 1e3,
                HELD_M * 1e3
            ));
        }
        let law = path_law(case).map_err(|error| error.to_string())?;
        let about = Case::new(&law, self.needle, &self.structures, &self.around)
            .map_err(|error| error.to_string())?;
        let count = self.near.len();
        let closer = |structure: usize| Event::Closer {
            structure,
            margin_m: MARGIN_M,
        };
        let bound = |structure: usize| -> Result<Bound, String> {
            let found = at_most(&about, &closer(structure)).map_err(|error| error.to_string())?;
            found.ok_or_else(|| "no bound".to_owned())
        };
        let beyond = [bound(count)?.probability, bound(count + 1)?.probability];
        let mut bounds = Vec::new();
        for structure in 0..count {
            let Bound { probability, kind } = bound(structure)?;
            // Planes hold what is near of it; what is not is beyond.
            let more = match kind {
                BoundKind::HalfPlanes => beyond[of_body(self.structures[structure].body)],
                BoundKind::Stations | BoundKind::Sum => 0.0,
            };
            bounds.push((probability + more).min(1.0));
        }
        bounds.extend(beyond);
        let (told, left): (Vec<usize>, Vec<usize>) =
            (0..count).partition(|index| bounds[*index] >= LEAST_PRINTED);
        let mut events: Vec<Event> = told.iter().copied().map(closer).collect();
        events.push(Event::Any {
            structures: told.clone(),
            margin_m: MARGIN_M,
        });
        let inside = |structure: usize| Event::TipInside { structure };
        events.push(inside(count + 2));
        events.extend(self.lesion.iter().map(|_| inside(count + 3)));
        let found = estimate(&about, &events, draws).map_err(|error| error.to_string())?;
        let larger = if with_larger {
            let law = assumed_larger(&law, case.imperfections)?;
            let seen = self.boundaries_larger();
            let under = about
                .under(&law, &seen)
                .map_err(|error| error.to_string())?;
            estimate(&under, &events, draws).map_err(|error| error.to_string())?
        } else {
            Vec::new()
        };
        let larger = larger.into_iter().map(Some).chain(iter::repeat(None));
        let found: Vec<(Estimate, Option<Estimate>)> = found.into_iter().zip(larger).collect();
        let (of_structures, others) = found.split_at(told.len());
        let [any, within_2_mm, in_lesion @ ..] = others else {
            return Err("estimates are missing".to_owned());
        };
        let report = |estimates: &(Estimate, Option<Estimate>), at_most: Option<f64>| {
            event_report(estimates, at_most, &law)
        };
        let mut structures: Vec<StructureProbability> = Vec::new();
        for (index, estimate) in told.iter().copied().zip(of_structures) {
            let (obstacle, distance_m) = &self.near[index];
            let seen = &self.structures[index];
            structures.push(StructureProbability {
                structure: obstacle.name.to_owned(),
                tissue: obstacle.tissue.to_string(),
                distance_m: *distance_m,
                boundary_sd_m: seen.boundary_sd_m,
                moves_with: match seen.body {
                    Body::Wall => "wall",
                    Body::Lung => "lung",
                },
                event: report(estimate, Some(bounds[index])),
            });
        }
        // Of those that no draw hits, the one with the largest bound first.
        let key = |each: &StructureProbability| {
            let event = &each.event;
            let bound = event.at_most.unwrap_or(1.0);
            (event.probability.unwrap_or(0.0), bound)
        };
        structures.sort_by(|a, b| {
            let [(a, a_bound), (b, b_bound)] = [key(a), key(b)];
            b.total_cmp(&a).then(b_bound.total_cmp(&a_bound))
        });
        let sum = |some: &[usize]| -> f64 {
            let sum: f64 = some.iter().map(|index| bounds[*index]).sum();
            sum.min(1.0)
        };
        let lesion = self.lesion.as_ref().zip(in_lesion.first());
        let lesion = lesion.map(|((name, diameter_m), estimate)| LesionProbability {
            lesion: name.clone(),
            diameter_m: *diameter_m,
            boundary_sd_m: self.structures[count + 3].boundary_sd_m,
            event: report(estimate, None),
        });
        Ok(ProbabilityReport {
            in_lesion: lesion,
            within_2_mm: report(within_2_mm, None),
            any: (!told.is_empty()).then(|| report(any, Some(sum(&told)))),
            structures,
            margin_m: MARGIN_M,
            others: self.others + left.len(),
            others_at_most: match self.extent {
                Extent::All => sum(&[left, vec![count, count + 1]].concat()),
                // Nothing is known of what was not looked at.
                Extent::Lesion => 1.0,
            },
            assumed: assumed(case.imperfections),
        })
    }
}

/// Of an estimate, and of that with the assumed deviations larger.
fn event_report(
    (estimate, larger): &(Estimate, Option<Estimate>),
    at_most: Option<f64>,
    law: &Law,
) -> EventProbability {
    let is_drawn = |estimate: &&Estimate| estimate.told != Told::AtPlan;
    let mostly = estimate.influences.first().map(|first| match first.origin {
        Origin::Part(index) => law.parts()[index].name.clone(),
        Origin::Level => "level of the held breath".to_owned(),
        Origin::Drift => "drift of the held breath".to_owned(),
        Origin::FailedHolds => "failed holds".to_owned(),
        Origin::Boundary => "boundary in the image".to_owned(),
    });
    EventProbability {
        probability: match estimate.told {
            Told::AtPlan => None,
            _ => estimate.probability,
        },
        interval_95: [estimate.interval.low, estimate.interval.high],
        at_most,
        of_1000: estimate_label(estimate),
        at_most_of_1000: at_most.map(bound_label),
        assumed_larger: larger
            .as_ref()
            .filter(is_drawn)
            .map(|larger| LargerProbability {
                probability: larger.probability,
                interval_95: [larger.interval.low, larger.interval.high],
                of_1000: estimate_label(larger),
            }),
        mostly,
        draws: estimate.draws,
    }
}

/// Standard deviations of where boundaries are seen, m; 0 where no image is imperfect.
struct Boundaries {
    bone_m: f64,
    soft_m: f64,
}

impl Boundaries {
    fn of(imperfections: &Imperfections) -> Self {
        let Some(voxel_m) = imperfections.imaging.map(|seen| seen.voxel_m) else {
            return Self {
                bone_m: 0.0,
                soft_m: 0.0,
            };
        };
        let slope = (BONE_SD_M[1] - BONE_SD_M[0]) / (SLICES_M[1] - SLICES_M[0]);
        let bone_m = BONE_SD_M[0] + slope * (voxel_m.z - SLICES_M[0]);
        // Half a voxel (assumed), one of the same volume.
        let half_m = 0.5 * libm::cbrt(voxel_m.product());
        Self {
            bone_m: bone_m.max(0.0),
            soft_m: half_m,
        }
    }

    fn of_m(&self, tissue: Tissue) -> f64 {
        if tissue == Tissue::Bone {
            self.bone_m
        } else {
            self.soft_m
        }
    }
}

/// The surface of a part, phantom frame: corners of its triangles in turn.
fn corners_of(phantom: &Phantom, name: &str) -> Vec<Point3<f64>> {
    let parts = phantom.parts.iter().filter(|part| part.name == name);
    let corners = parts.flat_map(|part| {
        let place = part.solid.parent_from_shape;
        let surface = part.solid.shape.surface(CHORD_M);
        let triangles = surface.triangles.into_iter().flatten();
        let vertices_m = surface.vertices_m;
        triangles
            .map(|vertex| place * vertices_m[vertex as usize])
            .collect::<Vec<_>>()
    });
    corners.collect()
}

/// Where a body is among those of a scenario's breath.
fn of_body(body: Body) -> usize {
    match body {
        Body::Wall => 0,
        Body::Lung => 1,
    }
}

/// Adds the corners of those pieces of a triangle, needle frame, that may reach into a cylinder: of no edge longer than
/// [`EDGE_M`].
fn add_near(triangle: [Point3<f64>; 3], cylinder: &Cylinder, corners: &mut Vec<Point3<f64>>) {
    let [a, b, c] = triangle;
    let middle = Point3::from((a.coords + b.coords + c.coords) / 3.0);
    let reach_m = triangle
        .iter()
        .map(|corner| (corner - middle).norm())
        .fold(0.0, f64::max);
    if cylinder.depth_m(&middle) < -(reach_m + CHORD_M) {
        return;
    }
    let turned = [[a, b, c], [b, c, a], [c, a, b]];
    let length_m = |[from, to, _]: &[Point3<f64>; 3]| (to - from).norm();
    let [first, second, third] = &turned;
    let longest = [second, third].into_iter().fold(first, |longest, each| {
        if length_m(each) > length_m(longest) {
            each
        } else {
            longest
        }
    });
    if length_m(longest) <= EDGE_M {
        corners.extend(triangle);
        return;
    }
    let [from, to, opposite] = *longest;
    let between = nalgebra::center(&from, &to);
    add_near([from, between, opposite], cylinder, corners);
    add_near([between, to, opposite], cylinder, corners);
}

/// Bones and what is in no organ move with the chest wall; organs, and vessels most of whose parts are in one, as the target
/// does (assumed).
fn body_of(tissue: Tissue, parts: &[Vec<Point3<f64>>], phantom: &Phantom) -> Body {
    let is_inner = match tissue {
        Tissue::Bone => false,
        Tissue::Organ => true,
        _ => {
            let obstacles = phantom.route_obstacles();
            let is_in_organ = |corners: &&Vec<Point3<f64>>| {
                let sum = corners
                    .iter()
                    .fold(Vector3::zeros(), |sum, corner| sum + corner.coords);
                let middle = Point3::from(sum / corners.len().max(1) as f64);
                let mut parts = obstacles.parts.iter().enumerate();
                parts.any(|(index, part)| {
                    part.tissue == Tissue::Organ && obstacles.solids.contains(index, &middle)
                })
            };
            2 * parts.iter().filter(is_in_organ).count() > parts.len()
        }
    };
    if is_inner { Body::Lung } else { Body::Wall }
}

/// The law with the deviations of what was not measured larger.
fn assumed_larger(law: &Law, imperfections: &Imperfections) -> Result<Law, String> {
    let (_, assumed) = measured_and_assumed(imperfections);
    let is_assumed = |source: Source| assumed.contains(&source);
    let larger = Larger {
        factor: ASSUMED_LARGER,
        part: &|name| assumed.iter().any(|source| source.name() == name),
        bend: is_assumed(Source::Needle),
        breath: is_assumed(Source::Breathing),
    };
    law.with(&larger).map_err(|error| error.to_string())
}

/// What of the model was not measured.
fn assumed(imperfections: &Imperfections) -> Vec<String> {
    let (measured, assumed) = measured_and_assumed(imperfections);
    if measured.is_empty() {
        return vec!["all sources".to_owned()];
    }
    let names = assumed.iter().map(|source| source.name());
    let names = names.chain(["boundaries in the image"]);
    names.map(str::to_owned).collect()
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use needlebench_clearance::ClearanceModel;
    use needlebench_kinematics::trajectory::JointTrajectory;
    use needlebench_numerics::random::SplitMix64;
    use needlebench_planning::Planner;
    use needlebench_scenario::{Overrides, load_scenario};
    use needlebench_uncertainty::{Layout, Truth, servo_of, settle_after};

    use super::*;

    const DRAWS: usize = 20_000;

    fn resolved(imperfections: &str) -> ResolvedScenario {
        let scenarios = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
        let text = fs::read_to_string(scenarios.join("table3.toml")).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("scenario.toml");
        let text = text.replace("max_tip_rms_mm = 2.7", "");
        fs::write(&file, format!("{text}\n[imperfections]\n{imperfections}")).unwrap();
        load_scenario(&file, &Overrides::default()).unwrap()
    }

    /// Shares of arms and patients, settled and measured as in a run, whose straight needle comes closer to a structure, and
    /// whose tip comes within 2 mm of the target.
    fn shares(
        resolved: &ResolvedScenario,
        trajectory: &JointTrajectory,
        structure: &str,
    ) -> [f64; 2] {
        let imperfections = resolved.imperfections.as_ref().unwrap();
        let (cell, goal) = (&resolved.cell, &resolved.goals[0]);
        let placed = resolved.phantom.as_ref().unwrap();
        let place = &placed.world_from_phantom;
        let servo = servo_of(resolved);
        let entry = goal.entry_m.unwrap();
        let planned = [entry, goal.target_m];
        let depths_m = [goal.standoff_m.unwrap(), goal.insertion_length_m];
        let layout = Layout::new(imperfections);
        let obstacles = placed.phantom.route_obstacles();
        let radius_m = 0.5 * cell.tool.needle.outer_diameter_m;
        let mut hits = [0.0; 2];
        for row in &layout.hypercube(DRAWS, &mut SplitMix64::new(5)) {
            let truth = Truth::new(cell, Some(place), imperfections, &layout, row, 0).unwrap();
            let settled = settle_after(&servo, &truth.dynamics(cell), &truth, trajectory).unwrap();
            let needle = truth.needle_points(cell, &settled.position, depths_m);
            let wanted = truth.wanted(goal, &planned);
            // Where it is in the phantom as that was planned.
            let [from, to] = [0, 1].map(|at| planned[at] + (needle[at] - wanted[at]));
            let of = |index: usize| obstacles.parts[index].organ.as_deref() == Some(structure);
            let nearest = obstacles
                .solids
                .nearest_to_segment(&from, &to, radius_m, place, of);
            hits[0] += f64::from(u8::from(nearest.unwrap().1.distance_m < MARGIN_M));
            hits[1] += f64::from(u8::from((to - goal.target_m).norm() < POINT_M));
        }
        hits.map(|count| count / DRAWS as f64)
    }

    /// Needles without breath, image and tissue: their place in the phantom is where arm and registration have it.
    #[test]
    fn counts_are_those_of_arms_and_patients_that_are_settled_and_measured() {
        let resolved = resolved(
            "[imperfections.calibration]\n[imperfections.elasticity]\n[imperfections.hand_eye]\n\
             translation_mm = 2.5\n[imperfections.guide]\n",
        );
        let model = ClearanceModel::new(&resolved.cell);
        let planner = Planner::new(&resolved, &model).unwrap();
        let plan = planner.plan(&resolved.goals[0]);
        let motion = plan
            .configurations
            .iter()
            .find_map(|each| each.trajectory.as_ref());
        let motion = motion.unwrap();
        let servo = servo_of(&resolved);
        let imperfections = &resolved.expected.as_ref().unwrap().imperfections;
        let case = BudgetCase::of(&resolved, &resolved.goals[0], &servo, imperfections, motion);
        let draws = Draws {
            seed: 3,
            most: DRAWS as u64,
            threads: 1,
            moves: false,
        };
        let around = Surroundings::new(&resolved, &resolved.goals[0], Extent::All).unwrap();
        let found = around.of(&case, &draws, true).unwrap();
        let first = &found.structures[0];
        let [close, within] = shares(&resolved, motion, &first.structure);
        for (name, event, share) in [
            (first.structure.as_str(), &first.event, close),
            ("within 2 mm", &found.within_2_mm, within),
        ] {
            let [low, high] = event.interval_95;
            let sd = (share * (1.0 - share) / DRAWS as f64).sqrt();
            // Of first order, and play is normal: 5 %.
            let slack = 3.0 * sd + 0.05 * share;
            assert!(share > 0.01, "{name}: {share}");
            assert!(
                (low - slack..high + slack).contains(&share),
                "{name}: {share} in {event:?}"
            );
            assert!(
                event.at_most.is_none_or(|at_most| at_most > share - slack),
                "{event:?}"
            );
        }
    }

    /// What is dropped of a triangle is outside of the cylinder.
    #[test]
    fn near_pieces_of_triangles_hold_all_that_is_near() {
        let cylinder = Cylinder {
            radius_m: 0.015,
            ends_m: [-0.03, 0.11],
        };
        let mut random = SplitMix64::new(9);
        let mut place = |size_m: f64| {
            let [x, y, z] = [0, 1, 2].map(|_| random.uniform(-size_m, size_m));
            Point3::new(x, y, z)
        };
        let mut near = 0;
        for _ in 0..200 {
            let triangle = [place(0.1), place(0.1), place(0.1)];
            let mut corners = Vec::new();
            add_near(triangle, &cylinder, &mut corners);
            for _ in 0..50 {
                let shares = place(1.0).coords.map(f64::abs);
                let shares = shares / shares.sum();
                let [a, b, c] = triangle.map(|corner| corner.coords);
                let point = Point3::from(a * shares.x + b * shares.y + c * shares.z);
                if cylinder.depth_m(&point) < 0.0 {
                    continue;
                }
                near += 1;
                let area = |a: &Point3<f64>, b: &Point3<f64>, c: &Point3<f64>| {
                    (b - a).cross(&(c - a)).norm()
                };
                let holds = |piece: &[Point3<f64>]| {
                    let [a, b, c] = [&piece[0], &piece[1], &piece[2]];
                    let parts = area(a, b, &point) + area(b, c, &point) + area(c, a, &point);
                    parts < area(a, b, c) * (1.0 + 1e-9) + 1e-15
                };
                assert!(corners.chunks_exact(3).any(holds), "{point}");
            }
        }
        assert!(near > 100, "{near}");
    }
}
