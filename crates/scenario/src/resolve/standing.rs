//! Whether things can stand where a scenario has them: nothing through the floor or through each other,
//! the patient on something, the base within reach of what the arm is there for.
//!
//! What cannot be is refused; what is odd but possible is noted.

mod depths;
mod obstacles;

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Point3, Vector3};
use needlebench_cell::{ClearanceClass, Robot, Tool};
use needlebench_geometry::{PreparedShape, Solid, separation};
use needlebench_input::{Finding, TomlText};
use needlebench_kinematics::{Joints, Pose};
use needlebench_phantom::{Measured, SIZE_PRESETS};

use super::obstacles::PlacedObstacle;
use super::phantom::{Corners, UnplacedPhantom};
use super::{Goal, PlacedPhantom};
use crate::fixtures::{Fixture, FixtureKind};
use crate::scenario::{MountKind, Scenario, TableSection};
use depths::Beside;
pub(super) use depths::{KnownDepths, patient_box};

/// Overlap of rigid things that is rounding of a drawing, m.
pub const RIGID_M: f64 = 1e-3;
/// How far a base's shapes may reach into what it stands on, m: the shipped arms' enclose their foot and
/// reach 7.2 mm below it.
pub const FOOT_M: f64 = 10e-3;
/// Depth to which a patient may lie in a cushion or a table top, m (assumed).
const SOFT_M: f64 = 10e-3;
/// Height of a cushion that is worth a note, and that nobody has, m (assumed).
const CUSHION_M: [f64; 2] = [0.05, 0.3];
/// Higher than any table or bed, m: the range of `table.top_height_mm` ends here.
const HIGHEST_TABLE_M: f64 = 2.0;
/// The key that places the patient.
const PATIENTS_PLACE: &str = "phantom.position_mm";
/// Length of a patient beyond the table that is worth a note, m.
const OVERHANG_M: f64 = 0.05;
/// A goal this many times farther than the arm could ever be long is a slip, and no question of reach.
const TIMES_REACH: f64 = 2.0;

/// The key that places the robot.
pub(super) const BASE_KEY: &str = "robot.base_position_mm";
/// How a scenario without a base placement gets one.
pub(super) const PLACE_HINT: &str = "`needlebench suggest FILE` proposes base placements; one of your own is \
                                     `base_position_mm` and `base_rpy_deg` under [robot]";
const BASE_HINT: &str = "the position is in the world: z up, floor at 0, in millimetres";

/// What stands in a cell.
pub(super) struct Standing<'a> {
    pub toml: &'a TomlText<'a>,
    pub scenario: &'a Scenario,
    pub robot: &'a Robot,
    /// Table, gantry and mount, as far as there are any.
    pub fixtures: &'a [Fixture],
    pub phantom: Option<(&'a PlacedPhantom, &'a UnplacedPhantom)>,
    pub obstacles: &'a [PlacedObstacle],
    /// Solids of the robot's base, in the world.
    pub base: &'a [Solid],
    /// From where the patient lay before; fresh for a cell of which nothing is known.
    pub known: &'a KnownDepths,
}

impl Standing<'_> {
    /// Everything but the goals.
    pub fn check(&self, notes: &mut Vec<String>) -> Result<(), Finding> {
        self.check_table()?;
        self.check_gantry(notes)?;
        self.check_fixtures()?;
        self.check_base(notes)?;
        self.check_phantom(notes)?;
        self.check_bore()?;
        self.check_obstacles(notes)
    }

    /// As [`Standing::check`], for a base placement that nobody gave and that is still to be chosen: what is wrong with it
    /// is noted.
    pub fn check_before_placing(&self, notes: &mut Vec<String>) -> Result<(), Finding> {
        match self.check(notes) {
            Err(finding) if finding.key.as_deref() == Some(BASE_KEY) => {
                notes.push(format!(
                    "assumed, since [robot] gives no base placement: one that cannot be, as {}; {PLACE_HINT}",
                    finding.message
                ));
                self.check_phantom(notes)?;
                self.check_bore()?;
                self.check_obstacles(notes)
            }
            checked => checked,
        }
    }

    /// Where the patient lies alone: what is left of [`Standing::check`] if all else is known to stand.
    pub(crate) fn check_lying(&self, notes: &mut Vec<String>) -> Result<(), Finding> {
        self.check_base_in_patient()?;
        self.check_phantom(notes)?;
        self.check_bore()?;
        self.check_obstacles_in_patient()
    }

    fn fixture(&self, kind: FixtureKind) -> Option<&Fixture> {
        self.fixtures.iter().find(|each| each.kind == kind)
    }

    fn check_table(&self) -> Result<(), Finding> {
        let Some(table) = &self.scenario.table else {
            return Ok(());
        };
        let under_mm = table.thickness_mm - table.top_height_mm;
        if under_mm <= RIGID_M * 1e3 {
            return Ok(());
        }
        let message = format!(
            "the table, {} mm thick, extends {under_mm:.1} mm below the floor: its upper face is at {} mm",
            table.thickness_mm, table.top_height_mm
        );
        let finding = self.toml.finding("table.thickness_mm", message);
        Err(finding.hint("`top_height_mm` is the height of the upper face above the floor"))
    }

    fn check_gantry(&self, notes: &mut Vec<String>) -> Result<(), Finding> {
        let Some(gantry) = &self.scenario.gantry else {
            return Ok(());
        };
        let centre_mm = gantry.isocentre_mm[2];
        let bore_mm = centre_mm - 0.5 * gantry.bore_diameter_mm;
        if bore_mm < -RIGID_M * 1e3 {
            let message = format!(
                "the gantry's bore extends {:.0} mm below the floor: its centre is at {centre_mm} mm",
                -bore_mm
            );
            let finding = self.toml.finding("gantry.isocentre_mm", message);
            return Err(
                finding.hint("the third number is the height above the floor, in millimetres")
            );
        }
        let housing_mm = centre_mm - 0.5 * gantry.outer_height_mm;
        if housing_mm < -RIGID_M * 1e3 {
            notes.push(format!(
                "the gantry's housing extends {:.0} mm below the floor (`gantry.outer_height_mm`)",
                -housing_mm
            ));
        } else if housing_mm > CUSHION_M[1] * 1e3 {
            notes.push(format!(
                "the gantry has no support: its housing ends {housing_mm:.0} mm above the floor"
            ));
        }
        Ok(())
    }

    /// Fixtures through each other.
    fn check_fixtures(&self) -> Result<(), Finding> {
        let table = self.fixture(FixtureKind::Table);
        let gantry = self.fixture(FixtureKind::Gantry);
        let mount = self.fixture(FixtureKind::Mount);
        if let (Some(table), Some(gantry)) = (table, gantry)
            && let Some(found) = deepest(&table.solids, &gantry.solids, RIGID_M)
        {
            return Err(self
                .toml
                .finding(
                    "table.center_mm",
                    format!(
                        "the table overlaps the gantry's housing by {}",
                        found.depth()
                    ),
                )
                .hint(
                    "the table must fit into the bore: compare `top_height_mm`, `width_mm` and \
                     `center_mm` with the gantry's isocentre and bore",
                ));
        }
        let Some(mount) = mount else { return Ok(()) };
        for (name, other) in [("table", table), ("gantry", gantry)] {
            let Some(other) = other else { continue };
            if let Some(found) = deepest(&mount.solids, &other.solids, RIGID_M) {
                return Err(self
                    .toml
                    .finding(
                        "robot.base_position_mm",
                        format!("{} overlaps the {name} by {}", found.a, found.depth()),
                    )
                    .hint(self.way_for_mount(name)));
            }
        }
        Ok(())
    }

    /// What to do about a mount in something.
    fn way_for_mount(&self, name: &str) -> &'static str {
        let kind = self.scenario.mount.as_ref().map(|mount| mount.kind);
        match (kind.unwrap_or_default(), name) {
            (MountKind::Column | MountKind::Wedge, "table") => {
                "the mount is a column from the floor to the robot's base: move the base beside the \
                 table, move the column with `column_offset_mm` under [mount], or omit [mount] for a \
                 robot on the table"
            }
            (MountKind::Column | MountKind::Wedge, _) => {
                "the mount is a column from the floor to the robot's base: move one of them, or the \
                 column with `column_offset_mm` under [mount]"
            }
            (MountKind::TableRail, _) => {
                "the mount is a post beside the table with a horizontal arm below the robot's base: \
                 raise the base, or move it along the table"
            }
            (MountKind::Wall | MountKind::Ceiling, _) => {
                "a wall or a ceiling is a square of `surface_mm` around the robot: move the base, or \
                 reduce the square"
            }
        }
    }

    /// A base in or below something, and one without support.
    fn check_base(&self, notes: &mut Vec<String>) -> Result<(), Finding> {
        let robot = self.robot;
        let base = self.base;
        for (kind, name) in [
            (FixtureKind::Table, "table"),
            (FixtureKind::Gantry, "gantry"),
        ] {
            let Some(fixture) = self.fixture(kind) else {
                continue;
            };
            if let Some(found) = deepest(base, &fixture.solids, FOOT_M) {
                let message = format!("the robot's base overlaps the {name} by {}", found.depth());
                return Err(self.toml.finding(BASE_KEY, message).hint(BASE_HINT));
            }
        }
        self.check_base_in_patient()?;
        let height_m = robot.world_from_base_link.translation.z;
        let obstacles = &self.scenario.obstacles;
        let stands_on_something = self.scenario.mount.is_some()
            // What the user says is the robot's mount.
            || obstacles.iter().any(|each| each.present && each.class.class() == ClearanceClass::RobotMount)
            || height_m <= SOFT_M
            || self.fixtures.iter().any(|fixture| {
                let near = |solid: &Solid| {
                    let reach = solid.bounding_box();
                    let base = base.iter().map(Solid::bounding_box);
                    base.into_iter().any(|each| overlap(&each, &reach, -SOFT_M))
                };
                fixture.solids.iter().any(near)
            });
        if !stands_on_something {
            notes.push(format!(
                "the robot's base is {:.0} mm above the floor without a [mount]: its support is not \
                 checked for collisions",
                height_m * 1e3
            ));
        }
        Ok(())
    }

    /// A lying patient with a chest measured upright.
    fn note_standing_size(&self, placed: &PlacedPhantom, notes: &mut Vec<String>) {
        let (Some(section), Some(size)) = (&self.scenario.phantom, &placed.phantom.parameters)
        else {
            return;
        };
        let is_given = section.breadth_mm.is_some() && section.depth_mm.is_some();
        if size.measured != Some(Measured::Standing) || is_given {
            return;
        }
        let lying = format!("{}-supine", section.model);
        let better = if SIZE_PRESETS.contains(&lying.as_str()) {
            format!(": `{lying}`")
        } else {
            String::new()
        };
        notes.push(format!(
            "the chest of `{}`, {:.0} x {:.0} mm, was measured on people standing; supine it is broader and \
             flatter{better}",
            section.model, size.breadth_mm, size.depth_mm
        ));
    }

    /// A base, or what carries it, in the patient.
    fn check_base_in_patient(&self) -> Result<(), Finding> {
        let mount = self.fixture(FixtureKind::Mount);
        let column = mount.map_or(&[][..], |mount| &mount.solids);
        for (what, beside, solids) in [
            ("the robot's base", Beside::Base, self.base),
            ("the robot's mount", Beside::Mount, column),
        ] {
            if let Some((_, depth_m)) = self.depth_in_patient(beside, solids.iter(), true) {
                let message = format!("{what} overlaps the patient by {:.1} mm", depth_m * 1e3);
                return Err(self.toml.finding(BASE_KEY, message).hint(BASE_HINT));
            }
        }
        Ok(())
    }

    /// A patient in the gantry's housing.
    fn check_bore(&self) -> Result<(), Finding> {
        let Some(gantry) = self.fixture(FixtureKind::Gantry) else {
            return Ok(());
        };
        let solids = gantry.solids.iter();
        let Some((_, depth_m)) = self.depth_in_patient(Beside::Gantry, solids, true) else {
            return Ok(());
        };
        let message = format!(
            "the patient overlaps the gantry's housing by {:.0} mm",
            depth_m * 1e3
        );
        let finding = self.toml.finding(PATIENTS_PLACE, message);
        Err(finding.hint("move the patient into the bore or out of it"))
    }

    /// A patient in, under or far above something, or beyond the table.
    fn check_phantom(&self, notes: &mut Vec<String>) -> Result<(), Finding> {
        let Some((placed, unplaced)) = self.phantom else {
            return Ok(());
        };
        let refuse = |message: String, hint: &str| {
            Err(self.toml.finding(PATIENTS_PLACE, message).hint(hint))
        };
        let height = "the third number is the height above the floor, with `rest_on_table` that of a \
                      cushion on the table, in millimetres";
        // Along and across the table, so that its box is the table; z is the world's.
        let turned = self.scenario.table.as_ref().map(world_from_table);
        let turned = turned.unwrap_or_else(Pose::identity);
        let to_table = turned.inverse() * placed.world_from_phantom;
        let patient = unplaced.extent(&to_table);
        let (low, high) = (patient.0.z, patient.1.z);
        if low < -SOFT_M {
            let message = format!("the patient is {:.0} mm below the floor", -low * 1e3);
            return refuse(message, height);
        }
        let on_nothing = |notes: &mut Vec<String>| {
            if low > HIGHEST_TABLE_M {
                let message = format!(
                    "the patient is {:.0} mm above the floor without support",
                    low * 1e3
                );
                return refuse(message, height);
            }
            if low > SOFT_M {
                notes.push(format!(
                    "the patient is {:.0} mm above the floor without support",
                    low * 1e3
                ));
            }
            Ok(())
        };
        let Some(table) = &self.scenario.table else {
            return on_nothing(notes);
        };
        let half = Vector3::new(0.5 * table.length_mm, 0.5 * table.width_mm, 0.0) * 1e-3;
        let top_m = table.top_height_mm * 1e-3;
        let bottom_m = top_m - table.thickness_mm * 1e-3;
        let slab = (
            Point3::new(-half.x, -half.y, bottom_m),
            Point3::new(half.x, half.y, top_m),
        );
        let over =
            (0..2).all(|axis| patient.0[axis] < slab.1[axis] && patient.1[axis] > slab.0[axis]);
        if !over {
            return on_nothing(notes);
        }
        if high < bottom_m + SOFT_M {
            return refuse(
                format!(
                    "the patient is below the table: {low:.3} to {high:.3} m above the floor, the \
                     table is at {bottom_m:.3} to {top_m:.3} m"
                ),
                "`rest_on_table = true` places the lowest point of the skin on the table",
            );
        }
        if let Some(fixture) = self.fixture(FixtureKind::Table)
            && let Some((_, depth_m)) =
                self.depth_in_patient(Beside::Table, fixture.solids.iter(), true)
        {
            return refuse(
                format!("the patient overlaps the table by {:.0} mm", depth_m * 1e3),
                "`rest_on_table = true` places the lowest point of the skin on the table",
            );
        }
        self.note_standing_size(placed, notes);
        let gap_m = low - top_m;
        if gap_m > CUSHION_M[1] {
            let message = format!(
                "the patient is {:.0} mm above the table without support",
                gap_m * 1e3
            );
            return refuse(message, height);
        }
        if gap_m > CUSHION_M[0] {
            notes.push(format!(
                "the patient is {:.0} mm above the table: a cushion of that height is assumed",
                gap_m * 1e3
            ));
        }
        let beyond_m = (patient.1.x - slab.1.x).max(slab.0.x - patient.0.x);
        if beyond_m > OVERHANG_M {
            notes.push(format!(
                "{:.0} mm of the patient's {:.0} mm along the table extend beyond its end, unsupported",
                beyond_m * 1e3,
                (patient.1.x - patient.0.x) * 1e3
            ));
        }
        Ok(())
    }
}

/// Refuses a base, and fixtures, that are under the floor before anything is built on them.
pub(super) fn check_floor(toml: &TomlText<'_>, robot: &Robot) -> Result<(), Finding> {
    let place = &robot.world_from_base_link;
    let solids = placed(&robot.base.solids, place);
    let of_solids_m = solids.map(|solid| solid.bounding_box().0.z + FOOT_M);
    let low_m = of_solids_m.fold(place.translation.z, f64::min);
    if low_m >= -RIGID_M {
        return Ok(());
    }
    Err(toml
        .finding(
            "robot.base_position_mm",
            format!(
                "the robot's base extends {:.1} mm below the floor",
                -low_m * 1e3
            ),
        )
        .hint("the position is in the world: z up, floor at 0, in millimetres"))
}

/// Refuses a start posture that is under the floor.
pub(super) fn check_start(
    toml: &TomlText<'_>,
    robot: &Robot,
    start: &Joints,
) -> Result<(), Finding> {
    let poses = robot.world_from_links(start);
    let mut lowest: Option<(f64, &str)> = None;
    for (link, pose) in robot.links.iter().zip(&poses) {
        for solid in placed(&link.solids, pose) {
            let low_m = solid.bounding_box().0.z;
            if lowest.is_none_or(|(known_m, _)| low_m < known_m) {
                lowest = Some((low_m, &link.name));
            }
        }
    }
    match lowest {
        Some((low_m, link)) if low_m < -RIGID_M => Err(toml
            .finding(
                "start.joints_deg",
                format!(
                    "in the start posture {link} is {:.0} mm below the floor",
                    -low_m * 1e3
                ),
            )
            .hint("the floor is at z = 0: choose another start posture, or raise the base")),
        _ => Ok(()),
    }
}

/// Refuses goals that are so far from the base that no arm of this kind could have been meant.
pub(super) fn check_distance(
    toml: &TomlText<'_>,
    scenario: &Scenario,
    robot: &Robot,
    tool: &Tool,
    goals: &[Goal],
) -> Result<(), Finding> {
    let chain = &robot.chain;
    let lengths = chain
        .joints
        .iter()
        .map(|joint| joint.parent_from_joint.translation.vector.norm());
    let reach_m = lengths.sum::<f64>()
        + chain.wrist_3_from_flange.translation.vector.norm()
        + tool.flange_from_guide_exit.translation.vector.norm();
    let base = robot.world_from_base_link.translation.vector;
    for (index, goal) in goals.iter().enumerate() {
        let distance_m = (goal.world_from_guide_exit.translation.vector - base).norm();
        if distance_m <= TIMES_REACH * reach_m {
            continue;
        }
        let by_flange = scenario
            .goals
            .get(index)
            .is_some_and(|goal| goal.flange_pose.is_some());
        let key = if by_flange {
            format!("goals[{index}].flange_pose.position_mm")
        } else {
            "robot.base_position_mm".to_owned()
        };
        return Err(toml
            .finding(
                &key,
                format!(
                    "the guide of goal `{}` is {distance_m:.2} m from the robot's base, but arm and tool \
                     reach {reach_m:.2} m",
                    goal.name
                ),
            )
            .hint(if by_flange {
                "the pose is in the controller's base frame, in millimetres"
            } else {
                "compare the positions of robot and patient: both are in the world, in millimetres"
            }));
    }
    Ok(())
}

/// Criteria on bodies that the scenario does not have, which are not evaluated.
pub(super) fn note_idle_criteria(scenario: &Scenario, notes: &mut Vec<String>) {
    for class in ClearanceClass::ALL {
        let is_judged = scenario.criteria.min_clearance_mm.least_mm(class).is_some();
        if let (true, Some((section, false))) = (is_judged, scenario.section_of(class)) {
            notes.push(format!(
                "`criteria.min_clearance_mm.{}` is not evaluated: there is no {section}",
                class.name()
            ));
        }
    }
}

/// People on the same spot.
pub(super) fn note_crowds(people: &super::People, goals: &[Goal], notes: &mut Vec<String>) {
    /// Two bodies of 300 mm depth whose middles are nearer than that stand in each other, m.
    const BODY_M: f64 = 0.3;
    for (goal, persons) in goals.iter().zip(&people.by_goal) {
        for (index, person) in persons.iter().enumerate() {
            for other in &persons[..index] {
                let apart_m = (person.position_m - other.position_m).xy().norm();
                if apart_m < BODY_M {
                    notes.push(format!(
                        "goal `{}`: {} and {} overlap, with their centres {:.0} mm apart",
                        goal.name,
                        other.name,
                        person.name,
                        apart_m * 1e3
                    ));
                }
            }
        }
    }
}

fn placed<'s>(
    solids: &'s [Solid],
    world_from_body: &Pose,
) -> impl Iterator<Item = Solid> + use<'s> {
    let world_from_body = *world_from_body;
    solids.iter().map(move |solid| Solid {
        parent_from_shape: world_from_body * solid.parent_from_shape,
        ..solid.clone()
    })
}

/// Frame in the middle of the table: x along it, z up from the floor.
fn world_from_table(table: &TableSection) -> Pose {
    let yaw_rad = table.yaw_deg.to_radians() % (4.0 * FRAC_PI_2);
    Pose::from_parts(
        Vector3::new(table.center_mm[0] * 1e-3, table.center_mm[1] * 1e-3, 0.0).into(),
        nalgebra::UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw_rad),
    )
}

/// Whether two boxes overlap by more than a depth along every axis: what they hold cannot overlap by
/// more than that otherwise.
fn overlap(a: &Corners, b: &Corners, by_m: f64) -> bool {
    (0..3).all(|axis| a.1[axis].min(b.1[axis]) - a.0[axis].max(b.0[axis]) > by_m)
}

/// Two solids in each other.
struct Overlap<'s> {
    a: &'s str,
    depth_m: f64,
}

impl Overlap<'_> {
    fn depth(&self) -> String {
        format!("{:.1} mm", self.depth_m * 1e3)
    }
}

/// The two solids that are deepest in each other, if that is more than `by_m`.
fn deepest<'s>(a: &'s [Solid], b: &[Solid], by_m: f64) -> Option<Overlap<'s>> {
    let mut found: Option<Overlap<'s>> = None;
    let boxes: Vec<Corners> = b.iter().map(Solid::bounding_box).collect();
    for first in a {
        let of_first = first.bounding_box();
        for (second, of_second) in b.iter().zip(&boxes) {
            if !overlap(&of_first, of_second, by_m) {
                continue;
            }
            let separation = separation(
                &PreparedShape::new(&first.shape),
                &first.parent_from_shape,
                &PreparedShape::new(&second.shape),
                &second.parent_from_shape,
            );
            let depth_m = -separation.distance_m;
            if depth_m > by_m && found.as_ref().is_none_or(|known| depth_m > known.depth_m) {
                found = Some(Overlap {
                    a: &first.name,
                    depth_m,
                });
            }
        }
    }
    found
}
