//! The people in the room: the paper's Figure 6 in numbers.
//!
//! For each configuration in its final posture: which part of the space about the entry point arm
//! and tool leave free, what of the entry point and of the needle people see past them, how wide a
//! cone behind the guide is free for the hand, and where the elbow is.

mod grid;
mod hand_cone;
mod obstacles;
mod sector;
mod sight;

use std::collections::BTreeMap;
use std::sync::OnceLock;

use nalgebra::{Point3, Vector3};
use needlebench_cell::BodyKind;
use needlebench_geometry::{PreparedShape, Shape, separation};
use needlebench_kinematics::{Joints, Pose};
use needlebench_scenario::people::{ElbowPreference, Handedness, PatientSides, Person, Side};
use needlebench_scenario::{Goal, ResolvedScenario};
use serde::Serialize;

pub use grid::VoxelGrid;
pub(crate) use hand_cone::CONE_START_M;
pub use hand_cone::{CONE_TOLERANCE_RAD, HandCone, hand_cone};
pub use obstacles::{Obstacles, PlacedObstacles, SightLines};
pub use sector::Sector;
pub use sight::{ENTRY_DISC_HEIGHT_M, OpenLines, Sight, SightTargets, sight_segments};

/// Radius of the hemisphere about the entry point in which free space is measured, m: as far as a forearm with a hand
/// reaches.
pub const SECTOR_RADIUS_M: f64 = 0.35;
/// Points nearer to arm or tool than this are not free, m: half of a hand's breadth.
pub(crate) const FREE_MARGIN_M: f64 = 0.05;
/// Edge of the cubes by which free space is counted, m.
pub const VOXEL_M: f64 = 0.02;

/// What one configuration leaves to the people in the room, in its final posture.
#[derive(Debug, Clone, PartialEq, Serialize, Default)]
pub struct RoomReport {
    /// Share of the hemisphere of 0.35 m on the outer side of the skin at the entry point that is farther than 0.05 m
    /// from arm and tool; what phantom, table, gantry, mount and obstacles fill does not count. By cubes of 20 mm.
    pub free_fraction: f64,
    /// The same by region, which share out the hemisphere: `above` and the patient's level sides. Empty without a
    /// patient.
    pub regions: BTreeMap<&'static str, f64>,
    /// Sight of each person in each stature.
    pub sight: Vec<SightReport>,
    /// Mean of `sight` over the people on the preferred side, over all if there are none.
    pub sight_fraction: f64,
    /// Half-angle of the largest cone behind the guide, about the needle, that is free of arm, tool and surroundings; a
    /// certified lower bound, at most a right angle.
    pub hand_cone_half_angle_rad: f64,
    /// How much larger the true angle may be, at most: proven by a point inside a solid.
    pub hand_cone_accuracy_rad: f64,
    /// Length of the cone from the guide's entry.
    pub hand_cone_length_m: f64,
    /// The solid that blocks a larger cone.
    pub hand_cone_blocker: Option<String>,
    /// Whether the elbow is above the line from shoulder to wrist in the plane of upper arm and forearm,
    /// in the world: of the two ways to bend the elbow for one place of the wrist exactly one is up.
    pub elbow_up: bool,
    /// Height of the elbow's axis over the entry point.
    pub elbow_over_entry_m: f64,
    /// Height over the entry point of the arm's lowest point over the patient, the tool left out;
    /// none without a patient or where no link is over it.
    pub lowest_over_patient_m: Option<f64>,
    /// Free share of the region on the side that the scenario prefers.
    pub preferred_side_free_fraction: Option<f64>,
    /// Whether the elbow is where the scenario prefers it.
    pub elbow_as_preferred: Option<bool>,
}

/// What one person of one stature sees.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SightReport {
    /// Who.
    pub person: String,
    /// The same in words: who, where and of which stature.
    pub person_in_words: String,
    /// Stature.
    pub stature_m: f64,
    /// Side of the patient.
    pub side: Option<Side>,
    /// Middle of where the eyes may be, in the world.
    pub eyes_m: [f64; 3],
    /// Mean of the two below.
    pub fraction: f64,
    /// What arm and tool leave of the lines to the skin within 30 mm of the entry point that phantom,
    /// table, gantry, mount and obstacles leave free: 1 if the robot takes nothing. 0 where nothing can be seen
    /// without the robot either.
    pub entry_fraction: f64,
    /// The same of the lines to the needle between guide and hub.
    pub needle_fraction: f64,
    /// Share of all lines that are free without the robot: what the patient's own body and the table
    /// leave.
    pub without_robot_fraction: f64,
    /// Half-width of the 95 % interval of `fraction`, estimated from eight shifted series of lines.
    pub accuracy: f64,
    /// The solid of the robot that is in the way of most of the lines.
    pub blocker: Option<String>,
    /// Free share of the half of the sector on the side of the person's better hand.
    pub hand_side_free_fraction: Option<f64>,
}

/// Room measurements of one scenario, prepared once.
#[derive(Debug)]
pub struct RoomModel<'a> {
    resolved: &'a ResolvedScenario,
    obstacles: Obstacles<'a>,
    sides: Option<PatientSides>,
    /// Of each goal, made on first use.
    sectors: Vec<OnceLock<Sector>>,
    /// Of each goal by person and stature, for the needle where the goal has it; made on first use.
    open_lines: Vec<OnceLock<Vec<OpenLines>>>,
    /// Points all over the arm: body and place in it, m.
    surface: Vec<(usize, Vec<Point3<f64>>)>,
}

/// Needles that lie nearer to each other are the same for lines of sight, m: rounding of inverse kinematics.
const SAME_PLACE_M: f64 = 1e-8;
/// Distance of two points of the arm's surface that are asked whether they are over the patient, m.
const SURFACE_SPACING_M: f64 = 0.01;
/// Fineness of curved surfaces, m.
const CHORD_ERROR_M: f64 = 1e-3;

impl<'a> RoomModel<'a> {
    /// Prepares the obstacles.
    pub fn new(resolved: &'a ResolvedScenario) -> Self {
        let cell = &resolved.cell;
        let obstacles = Obstacles::new(cell);
        let sides = resolved
            .phantom
            .as_ref()
            .and_then(|placed| PatientSides::new(&placed.world_from_phantom.rotation));
        let moving = cell
            .bodies
            .iter()
            .enumerate()
            .filter(|(_, body)| body.kind == BodyKind::Link);
        let surface = moving
            .map(|(index, body)| {
                let points = body.solids.iter().flat_map(|solid| {
                    let mesh = solid.shape.surface(CHORD_ERROR_M);
                    edge_points(&mesh, &solid.parent_from_shape)
                });
                (index, points.collect())
            })
            .collect();
        Self {
            resolved,
            obstacles,
            sides,
            sectors: resolved.goals.iter().map(|_| OnceLock::new()).collect(),
            open_lines: resolved.goals.iter().map(|_| OnceLock::new()).collect(),
            surface,
        }
    }

    /// The hemisphere about the entry point of a goal.
    pub fn sector(&self, goal: usize) -> &Sector {
        self.sectors[goal].get_or_init(|| {
            let placed = &self.resolved.goals[goal];
            Sector::new(
                entry_of(placed),
                skin_normal(self.resolved, placed),
                SECTOR_RADIUS_M,
                VOXEL_M,
                &self.obstacles.surroundings(),
                self.sides.as_ref(),
            )
        })
    }

    /// The solids of the cell.
    pub fn obstacles(&self) -> &Obstacles<'a> {
        &self.obstacles
    }

    /// By voxel of the goal's sector: whether it counts, and arm or tool are nearer than the margin.
    pub fn taken(&self, goal: usize, q: &Joints) -> Vec<bool> {
        let sector = self.sector(goal);
        let near = sector.taken_by(&self.obstacles.robot(q), FREE_MARGIN_M);
        let near = near.iter().zip(&sector.inside);
        near.map(|(near, counts)| *near && *counts).collect()
    }

    /// Entry of the guide as the arm holds it; z points along the insertion.
    pub fn guide_entry(&self, q: &Joints) -> Pose {
        let cell = &self.resolved.cell;
        cell.robot.world_from_flange(q) * cell.tool.flange_from_guide_entry
    }

    /// What people look at.
    pub fn targets(&self, goal: usize, q: &Joints) -> SightTargets {
        self.targets_behind(goal, &self.guide_entry(q))
    }

    /// The same with the guide where the goal has it.
    fn goal_targets(&self, goal: usize) -> SightTargets {
        let exit = self.resolved.goals[goal].world_from_guide_exit;
        let length_m = self.resolved.cell.tool.guide_length_m();
        let entry = exit * Pose::translation(0.0, 0.0, -length_m);
        self.targets_behind(goal, &entry)
    }

    fn targets_behind(&self, goal: usize, entry: &Pose) -> SightTargets {
        let sector = self.sector(goal);
        let tool = &self.resolved.cell.tool;
        let standoff_m = self.resolved.goals[goal].standoff_m.unwrap_or(0.0);
        // With the tip on the skin; a needle too short for that ends at the guide.
        let hub_m = (tool.needle.length_m - tool.guide_length_m() - standoff_m).max(CONE_START_M);
        SightTargets {
            entry_m: sector.center_m,
            outwards: sector.outwards,
            needle_m: [CONE_START_M, hub_m]
                .map(|behind_m| entry * Point3::new(0.0, 0.0, -behind_m)),
        }
    }

    /// What the surroundings leave of the sight of each person in each stature.
    fn lines_of_people(&self, goal: usize, targets: &SightTargets) -> Vec<OpenLines> {
        let surroundings = self.obstacles.surroundings();
        let mut lines = Vec::new();
        for person in &self.resolved.people.by_goal[goal] {
            lines.extend(person.statures_m.iter().map(|&stature_m| {
                let eyes_m = person.eyes_m(stature_m);
                OpenLines::new(&surroundings, &eyes_m, person.head_movement_m, targets)
            }));
        }
        lines
    }

    /// Length of the hand cone, m: that of the access zone.
    pub(crate) fn hand_reach_m(&self) -> f64 {
        self.resolved
            .scenario
            .tool
            .corridor_length_mm
            .map_or(self.resolved.cell.tool.needle.length_m, |mm| mm * 1e-3)
    }

    /// Measures a posture for a goal, given by its index.
    pub fn measure(&self, goal: usize, q: &Joints) -> RoomReport {
        let sector = self.sector(goal);
        let taken = self.taken(goal, q);
        let regions = sector.free_by_region(&taken);
        let all = self.obstacles.all(q);
        let targets = self.targets(goal, q);
        let people = &self.resolved.people;
        let robot = self.obstacles.robot(q);
        // Every configuration holds the needle in the same place, up to rounding.
        let nominal = self.goal_targets(goal);
        let own;
        let lines = if nominal.is_within(&targets, SAME_PLACE_M) {
            self.open_lines[goal].get_or_init(|| self.lines_of_people(goal, &nominal))
        } else {
            own = self.lines_of_people(goal, &targets);
            &own
        };
        let mut lines = lines.iter();
        let mut sight = Vec::new();
        for person in &people.by_goal[goal] {
            let hand_side = sector.free_towards(&taken, &hand_side(person, &sector.center_m));
            for &stature_m in &person.statures_m {
                let lines = lines.next().expect("there are lines of each stature");
                let seen = lines.past(&robot);
                let eyes_m = person.eyes_m(stature_m);
                sight.push(SightReport {
                    person: person.name.clone(),
                    person_in_words: person.in_words(stature_m),
                    stature_m,
                    side: person.side,
                    eyes_m: eyes_m.coords.into(),
                    fraction: 0.5 * (seen.entry_fraction + seen.needle_fraction),
                    entry_fraction: seen.entry_fraction,
                    needle_fraction: seen.needle_fraction,
                    without_robot_fraction: seen.without_robot_fraction,
                    accuracy: seen.accuracy,
                    blocker: seen.blocker,
                    hand_side_free_fraction: hand_side,
                });
            }
        }
        let entry = self.guide_entry(q);
        let reach_m = self.hand_reach_m();
        let behind = -(entry.rotation * Vector3::z());
        let cone = hand_cone(&all, &entry.translation.vector.into(), &behind, reach_m);
        let links = self.resolved.cell.robot.world_from_links(q);
        let elbow_axis = self.resolved.cell.robot.chain.joints[2].axis;
        let elbow_up = elbow_is_up(&links, &(links[2].rotation * elbow_axis.into_inner()));
        RoomReport {
            free_fraction: sector.free_fraction(&taken),
            sight_fraction: mean_sight(&sight, people.prefer_side),
            hand_cone_half_angle_rad: cone.half_angle_rad,
            hand_cone_accuracy_rad: cone.accuracy_rad,
            hand_cone_length_m: reach_m,
            hand_cone_blocker: cone.blocker,
            elbow_up,
            elbow_over_entry_m: links[2].translation.vector.z - sector.center_m.z,
            lowest_over_patient_m: self.lowest_over_patient_m(goal, q),
            preferred_side_free_fraction: people
                .prefer_side
                .and_then(|side| regions.get(side.name()).copied()),
            elbow_as_preferred: people
                .prefer_elbow
                .map(|wanted| elbow_up == (wanted == ElbowPreference::Up)),
            regions,
            sight,
        }
    }

    /// See [`RoomReport::lowest_over_patient_m`].
    fn lowest_over_patient_m(&self, goal: usize, q: &Joints) -> Option<f64> {
        let placed = self.resolved.phantom.as_ref()?;
        let sides = self.sides.as_ref()?;
        let axes = [
            sides.direction(Side::Head)?,
            Vector3::z().cross(&sides.direction(Side::Head)?),
        ];
        let skin = placed.phantom.skin();
        let pose = placed.world_from_phantom * skin.parent_from_shape;
        let mut ranges = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        for vertex in skin.shape.surface(CHORD_ERROR_M).vertices_m {
            let vertex = pose * vertex;
            for (range, axis) in ranges.iter_mut().zip(&axes) {
                let along = vertex.coords.dot(axis);
                *range = [range[0].min(along), range[1].max(along)];
            }
        }
        let bodies = self.resolved.cell.world_from_bodies(q);
        let lowest =
            self.surface
                .iter()
                .flat_map(|(body, points)| points.iter().map(|point| bodies[*body] * point))
                .filter(|point| {
                    ranges.iter().zip(&axes).all(|(range, axis)| {
                        (range[0]..=range[1]).contains(&point.coords.dot(axis))
                    })
                })
                .map(|point| point.z)
                .reduce(f64::min)?;
        Some(lowest - entry_of(&self.resolved.goals[goal]).z)
    }
}

/// The entry point, or the guide's exit without a phantom.
fn entry_of(goal: &Goal) -> Point3<f64> {
    goal.entry_m
        .unwrap_or_else(|| goal.world_from_guide_exit.translation.vector.into())
}

/// Outer normal of the skin at the entry point; against the needle without a phantom.
fn skin_normal(resolved: &ResolvedScenario, goal: &Goal) -> Vector3<f64> {
    /// Distance from the skin at which its nearest point is asked for: the normal is that of a
    /// point within this distance of the entry, and well above the distances' error.
    const STEP_M: f64 = 1e-3;
    let against = -goal.axis.into_inner();
    let (Some(entry), Some(placed)) = (goal.entry_m, &resolved.phantom) else {
        return against;
    };
    let skin = placed.phantom.skin();
    let probe = entry + against * STEP_M;
    let found = separation(
        &PreparedShape::new(&Shape::Sphere { radius_m: 0.0 }),
        &Pose::translation(probe.x, probe.y, probe.z),
        &PreparedShape::new(&skin.shape),
        &(placed.world_from_phantom * skin.parent_from_shape),
    );
    if found.distance_m > 0.0 {
        -found.normal.into_inner()
    } else {
        against
    }
}

/// Level direction to the side of a person's better hand, who looks at the entry point.
fn hand_side(person: &Person, entry: &Point3<f64>) -> Vector3<f64> {
    let ahead = entry - person.position_m;
    let to_the_right = Vector3::new(ahead.y, -ahead.x, 0.0);
    match person.handedness {
        Handedness::Right => to_the_right,
        Handedness::Left => -to_the_right,
    }
}

fn mean_sight(sight: &[SightReport], prefer_side: Option<Side>) -> f64 {
    let preferred: Vec<f64> = sight
        .iter()
        .filter(|each| prefer_side.is_some() && each.side == prefer_side)
        .map(|each| each.fraction)
        .collect();
    let counted = if preferred.is_empty() {
        sight.iter().map(|each| each.fraction).collect()
    } else {
        preferred
    };
    counted.iter().sum::<f64>() / counted.len() as f64
}

/// Whether the elbow's axis is above the line from the shoulder's to the wrist's, all seen along the
/// elbow's axis.
///
/// The wrist's frame lies beside the plane in which upper arm and forearm turn, by 0.1 m in a UR3: without
/// that, the line of a folded arm would run across the plane, and both ways to bend the elbow would be
/// below it. Where the line is vertical neither way is higher: the one that bends about the elbow's axis
/// forwards is called up.
fn elbow_is_up(links: &[Pose; 6], elbow_axis: &Vector3<f64>) -> bool {
    /// Heights nearer than this are even, m: rounding of a pose.
    const EVEN_M: f64 = 1e-9;
    let in_plane = |vector: Vector3<f64>| vector - elbow_axis * vector.dot(elbow_axis);
    let [shoulder, elbow, wrist] = [1, 2, 3].map(|link: usize| links[link].translation.vector);
    let (upper, line) = (in_plane(elbow - shoulder), in_plane(wrist - shoulder));
    let along = upper.dot(&line) / line.norm_squared().max(f64::MIN_POSITIVE);
    let over_m = (upper - line * along).z;
    if over_m.abs() <= EVEN_M {
        return elbow_axis.dot(&line.cross(&upper)) > 0.0;
    }
    over_m > 0.0
}

/// Points on all edges of a surface, no farther apart than [`SURFACE_SPACING_M`].
fn edge_points(
    mesh: &needlebench_geometry::TriangleMesh,
    body_from_shape: &Pose,
) -> Vec<Point3<f64>> {
    let mut points = Vec::new();
    for triangle in &mesh.triangles {
        for edge in 0..3 {
            let (a, b) = (triangle[edge], triangle[(edge + 1) % 3]);
            // Every edge has two triangles: one of them is enough.
            if a > b {
                continue;
            }
            let [a, b] = [a, b].map(|i| body_from_shape * mesh.vertices_m[i as usize]);
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a few dozen"
            )]
            let steps = ((b - a).norm() / SURFACE_SPACING_M).ceil().max(1.0) as u32;
            points.extend((0..=steps).map(|k| a + (b - a) * (f64::from(k) / f64::from(steps))));
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use needlebench_scenario::{Overrides, load_scenario};

    use super::*;

    /// The other way to bend the elbow for the same place of the wrist is the mirror image about the line
    /// from shoulder to wrist; the one with the higher elbow is up, and no other.
    #[test]
    fn of_two_ways_to_bend_the_elbow_the_higher_one_is_up() {
        /// Heights that are nearer say nothing, m.
        const EVEN_M: f64 = 1e-6;
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/table3.toml");
        let robot = load_scenario(&path, &Overrides::default())
            .unwrap()
            .cell
            .robot;
        let axis = robot.chain.joints[2].axis.into_inner();
        let up = |q: &Joints| {
            let links = robot.world_from_links(q);
            elbow_is_up(&links, &(links[2].rotation * axis))
        };
        let at = |q: &Joints, link: usize| robot.world_from_links(q)[link].translation.vector;
        // In the plane, from the origins of the chain: upper arm along -x by a2, forearm by a3.
        let lengths = [2, 3].map(|joint: usize| {
            let origin = robot.chain.joints[joint]
                .parent_from_joint
                .translation
                .vector;
            origin.xy().norm()
        });
        let mut state = 3_u64;
        let mut angle = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            ((state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5) * std::f64::consts::TAU
        };
        let (mut folded, mut compared) = (0, 0);
        for _ in 0..2000 {
            let (lift, elbow) = (angle(), angle());
            // Angle of the wrist's direction from the upper arm's, by the law of cosines.
            let (far, across) = (
                lengths[0] + lengths[1] * libm::cos(elbow),
                lengths[1] * libm::sin(elbow),
            );
            let towards = lift + libm::atan2(across, far);
            let one = Joints::new(0.4, lift, elbow, 0.2, 0.3, 0.1);
            let other = Joints::new(0.4, 2.0 * towards - lift, -elbow, 0.2, 0.3, 0.1);
            let apart_m = (at(&one, 3) - at(&other, 3)).norm();
            assert!(apart_m < 1e-12, "the wrist moves by {apart_m}");
            let higher_m = at(&one, 2).z - at(&other, 2).z;
            if higher_m.abs() < EVEN_M {
                continue;
            }
            compared += 1;
            folded += usize::from(libm::cos(elbow) < -0.9);
            assert_eq!(
                [up(&one), up(&other)],
                [higher_m > 0.0, higher_m < 0.0],
                "{lift} {elbow}"
            );
        }
        assert!(compared > 1900 && folded > 200, "{compared} {folded}");
    }
}
