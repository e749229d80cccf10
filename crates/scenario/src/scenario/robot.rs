//! The arm: `[robot]`.

use std::collections::BTreeMap;

use needlebench_robot::{Arm, MissingInertia, StatedShape};
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Serialize};

use super::models::names_or_path;

/// The arm.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RobotSection {
    /// Name of a shipped arm, or the path of a URDF relative to this file. Default: the URDF of `arm`, or `ur3`.
    #[schemars(schema_with = "arms")]
    pub urdf: Option<String>,
    /// Arm whose data are used (brakes, servo, calibration population and more): the name of a shipped one, or the path
    /// of an `arm.toml` or its folder relative to this file. Default: the `arm.toml` beside the URDF, or the shipped
    /// arm with the URDF's lengths.
    pub arm: Option<String>,
    /// Prefix of the robot's link and joint names in the URDF, such as `left_` where a file has two arms; other joints
    /// are then fixed at 0. Default: the common prefix of the joints of the only arm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prefix: Option<String>,
    /// Base placement: position of `base_link` in the world (z up, floor at 0), mm. Default: the arm's.
    #[schemars(inner(range(min = -5000.0, max = 5000.0)))]
    pub base_position_mm: Option<[f64; 3]>,
    /// Base placement: roll, pitch and yaw of `base_link` in the world, deg. Default: the arm's.
    #[schemars(inner(range(min = -720.0, max = 720.0)))]
    pub base_rpy_deg: Option<[f64; 3]>,
    /// Handling of a moving link without mass: `error` to reject the robot; `nominal` to use the masses of the arm
    /// whose data are used; `nominal-ur3` and so on to require that arm.
    pub missing_inertia: MissingInertia,
    /// Factory calibration of the arm, as written by ROS's `ur_calibration`: path relative to this file. Its joint
    /// origins replace the URDF's; a robot or calibration given on the command line takes precedence. Default: the
    /// nominal arm.
    pub calibration: Option<String>,
    /// Collision shapes of links that are not to be completed from the arm's data, by the link's URDF name or its label
    /// (`forearm`): `none` for a link that needs no shape, `given` to use the URDF's shapes as they are. Every report
    /// lists the links without a shape.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub shape: BTreeMap<String, StatedShape>,
}

fn arms(_: &mut SchemaGenerator) -> Schema {
    names_or_path(&Arm::shipped_names().collect::<Vec<_>>())
}
