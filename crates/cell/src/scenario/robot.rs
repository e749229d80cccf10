//! The arm: `[robot]`.

use std::collections::BTreeMap;

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Serialize};

use super::models::names_or_path;
use crate::arm::Arm;
use crate::robot::{MissingInertia, StatedShape};

/// The arm.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RobotSection {
    /// Name of a shipped arm, or the path of a URDF relative to this file. Left out: the URDF of `arm`,
    /// or `ur3`.
    #[schemars(schema_with = "arms")]
    pub urdf: Option<String>,
    /// The arm whose data the robot has (brakes, servo, population of calibrations and more): the name
    /// of a shipped one, or the path of an `arm.toml` or its folder relative to this file. Left out: the
    /// `arm.toml` beside the URDF, or the shipped arm with the URDF's lengths.
    pub arm: Option<String>,
    /// What stands before the names of the robot's links and joints in the URDF, such as `left_` where a file has two
    /// arms. Left out: what the joints of its only arm have in common. With it, joints that are not the arm's stand
    /// still at 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prefix: Option<String>,
    /// Position of `base_link` in the world (z up, floor at 0), mm; the arm's own if left out.
    #[schemars(inner(range(min = -5000.0, max = 5000.0)))]
    pub base_position_mm: Option<[f64; 3]>,
    /// Roll, pitch and yaw of `base_link` in the world, deg; the arm's own if left out.
    #[schemars(inner(range(min = -720.0, max = 720.0)))]
    pub base_rpy_deg: Option<[f64; 3]>,
    /// What to do when a moving link has no mass: `error`; `nominal` for the masses of the arm whose
    /// data the robot has; `nominal-ur3` and so on for those of that arm alone.
    pub missing_inertia: MissingInertia,
    /// Factory calibration of the arm, as ROS's `ur_calibration` writes it: path relative to this
    /// file. Its joint origins replace the URDF's. The nominal arm if left out; a robot or a
    /// calibration of the command line replaces it.
    pub calibration: Option<String>,
    /// Collision shapes of links, by a link's name in the URDF or its label (`forearm`), where they are not to be
    /// completed by what is known of the arm: `none` for one that needs none, `given` for the URDF's as they are.
    /// Every report names those without a shape.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub shape: BTreeMap<String, StatedShape>,
}

fn arms(_: &mut SchemaGenerator) -> Schema {
    names_or_path(&Arm::shipped_names().collect::<Vec<_>>())
}
