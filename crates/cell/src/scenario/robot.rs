//! The arm: `[robot]`.

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Serialize};

use super::models::names_or_path;
use crate::arm::Arm;
use crate::robot::MissingInertia;

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
}

fn arms(_: &mut SchemaGenerator) -> Schema {
    names_or_path(&Arm::shipped_names().collect::<Vec<_>>())
}
