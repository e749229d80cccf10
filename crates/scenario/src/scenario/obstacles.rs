//! Further obstacles in the room: `[[obstacles]]`.

use needlebench_cell::{BodyKind, ClearanceClass};
use needlebench_input::schema::{LONGEST_NAME, NAME};
use needlebench_input::{Finding, TomlText};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::LengthUnit;

/// Clearance class of an obstacle, by its name in `[criteria.min_clearance_mm]` and in reports.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ObstacleClass {
    /// Its own class: equipment that belongs to no other fixture.
    #[default]
    RobotObstacle,
    /// The table's: an arm board, a side rail, a cushion.
    RobotTable,
    /// The gantry's: a monitor or a laser on the housing.
    RobotGantry,
    /// The mount's: feet, braces and cables.
    RobotMount,
}

impl ObstacleClass {
    /// The class of clearance.
    pub fn class(self) -> ClearanceClass {
        match self {
            Self::RobotObstacle => ClearanceClass::RobotObstacle,
            Self::RobotTable => ClearanceClass::RobotTable,
            Self::RobotGantry => ClearanceClass::RobotGantry,
            Self::RobotMount => ClearanceClass::RobotMount,
        }
    }

    /// The kind of body whose pairs are of this class.
    pub(crate) fn kind(self) -> BodyKind {
        match self {
            Self::RobotObstacle => BodyKind::Obstacle,
            Self::RobotTable => BodyKind::Table,
            Self::RobotGantry => BodyKind::Gantry,
            Self::RobotMount => BodyKind::Mount,
        }
    }
}

/// Parent frame of an obstacle: its position and rotation are in that frame, and it moves with it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AttachedTo {
    /// The room: the world's frame, z up, the floor at 0.
    #[default]
    World,
    /// The table: x along it, y across, z up; origin at the centre of its upper face.
    Table,
    /// The gantry: x along the bore, y across, z up at zero tilt; origin at the isocentre.
    Gantry,
    /// The robot base: the frame of ROS's `base_link`, z out of the foot; hanging and tilted with it.
    RobotBase,
}

impl AttachedTo {
    /// Its key in a scenario.
    pub(crate) fn key(self) -> &'static str {
        match self {
            Self::World => "world",
            Self::Table => "table",
            Self::Gantry => "gantry",
            Self::RobotBase => "robot_base",
        }
    }
}

/// One rigid obstacle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObstacleSection {
    /// Name in reports: letters, digits, `-` and `_`; unique among all bodies.
    #[schemars(regex(pattern = NAME), length(max = LONGEST_NAME))]
    pub name: String,
    /// Clearance class of the obstacle, with the criterion of that name.
    #[serde(default)]
    pub class: ObstacleClass,
    /// Parent frame, in which `position_mm` and `rpy_deg` are given.
    #[serde(default)]
    pub attached_to: AttachedTo,
    /// Origin of the shape in the frame of `attached_to`, mm: the centre of a box, cylinder, capsule or sphere, or the
    /// origin of a mesh file.
    #[schemars(inner(range(min = -20_000.0, max = 20_000.0)))]
    pub position_mm: [f64; 3],
    /// Roll, pitch and yaw of the shape in the frame of `attached_to`, deg.
    #[serde(default)]
    #[schemars(inner(range(min = -720.0, max = 720.0)))]
    pub rpy_deg: [f64; 3],
    /// Shape: one of `box`, `cylinder`, `capsule`, `sphere`, `convex` and `mesh`.
    pub shape: ObstacleShape,
    /// Whether the obstacle is present; `false` removes it, so that a study can vary it.
    #[serde(default = "yes")]
    pub present: bool,
}

fn yes() -> bool {
    true
}

/// A shape: exactly one of these keys.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ObstacleShape {
    /// A box aligned with the axes.
    #[serde(rename = "box")]
    pub cuboid: Option<BoxShape>,
    /// A cylinder about z.
    pub cylinder: Option<RoundShape>,
    /// A cylinder about z with a hemisphere at each end.
    pub capsule: Option<RoundShape>,
    /// A sphere.
    pub sphere: Option<SphereShape>,
    /// The convex hull of a mesh file's vertices.
    pub convex: Option<FileShape>,
    /// The solid enclosed by a mesh file's surface, which must be closed and need not be convex. Engines collide with
    /// convex pieces that cover it.
    pub mesh: Option<FileShape>,
}

/// A box.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BoxShape {
    /// Edges along x, y and z, mm.
    #[schemars(inner(range(min = 0.1, max = 20_000.0)))]
    pub size_mm: [f64; 3],
}

/// A cylinder or a capsule.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RoundShape {
    /// Radius, mm.
    #[schemars(range(min = 0.1, max = 5000.0))]
    pub radius_mm: f64,
    /// Length along z, mm; of a capsule the cylindrical part, so that the capsule is 2 `radius_mm` longer.
    #[schemars(range(min = 0.1, max = 20_000.0))]
    pub length_mm: f64,
}

/// A sphere.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SphereShape {
    /// Radius, mm.
    #[schemars(range(min = 0.1, max = 5000.0))]
    pub radius_mm: f64,
}

/// A shape from a mesh file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
// As the released schema has it.
#[schemars(rename = "StlShape")]
pub struct FileShape {
    /// STL, OBJ or COLLADA (`.dae`) file, relative to this file: triangles counter-clockwise seen from outside.
    pub file: String,
    /// Unit of the file's coordinates: `mm`, `cm`, `m` or `in`. Default mm, for an object larger than 100 mm; COLLADA
    /// files state their own unit.
    #[serde(default)]
    pub unit: LengthUnit,
    /// Reverses the orientation of an inside-out surface.
    #[serde(default)]
    pub flip: bool,
}

impl ObstacleShape {
    /// The keys that are given.
    fn given(&self) -> Vec<&'static str> {
        [
            ("box", self.cuboid.is_some()),
            ("cylinder", self.cylinder.is_some()),
            ("capsule", self.capsule.is_some()),
            ("sphere", self.sphere.is_some()),
            ("convex", self.convex.is_some()),
            ("mesh", self.mesh.is_some()),
        ]
        .into_iter()
        .filter_map(|(key, is_given)| is_given.then_some(key))
        .collect()
    }
}

/// Checks for obstacles with no or several shapes, and for duplicate names.
pub(super) fn check(toml: &TomlText<'_>, sections: &[ObstacleSection]) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (index, section) in sections.iter().enumerate() {
        let given = section.shape.given();
        if given.len() != 1 {
            let message = if given.is_empty() {
                format!("obstacle `{}` has no shape", section.name)
            } else {
                let given = given.join(" and ");
                format!(
                    "obstacle `{}` has the shapes {given}; one is allowed",
                    section.name
                )
            };
            findings.push(
                toml.finding(&format!("obstacles[{index}].shape"), message)
                    .hint("one of box, cylinder, capsule, sphere, convex and mesh; split a composite body into several obstacles"),
            );
        }
        if sections[..index]
            .iter()
            .any(|other| other.name == section.name)
        {
            findings.push(
                toml.finding(
                    &format!("obstacles[{index}].name"),
                    format!("two obstacles are named `{}`", section.name),
                )
                .hint("names identify bodies in reports"),
            );
        }
    }
    findings
}
