//! The needle guide: `[tool]`.

use std::collections::BTreeMap;

use needlebench_robot::StatedShape;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

use super::models::reference_schema;

/// Outer diameters of needles by gauge, mm: the nominal sizes of the needle gauge chart.
pub(crate) const NEEDLE_OUTER_DIAMETER_MM: [(u32, f64); 11] = [
    (14, 2.108),
    (15, 1.829),
    (16, 1.651),
    (17, 1.473),
    (18, 1.270),
    (19, 1.067),
    (20, 0.9081),
    (21, 0.8192),
    (22, 0.7176),
    (23, 0.6414),
    (25, 0.5144),
];

/// The tool that is defined by parameters.
pub(crate) const PARAMETRIC_TOOL: &str = "parametric";

/// The needle guide.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ToolSection {
    /// `offset`, `perpendicular`, `inline`, `parametric`, or the path of a URDF relative to this file.
    #[schemars(schema_with = "tools")]
    pub urdf: String,
    /// Rotation of the tool about the flange axis, deg. The flange's four screws allow multiples of 90.
    #[schemars(range(min = -360.0, max = 360.0))]
    pub mount_rotation_deg: f64,
    /// Distance of the guide tube's centre from the flange along its axis, mm; tool `parametric` only. Default: 55, as
    /// of `offset`.
    #[schemars(range(min = 20.0, max = 250.0))]
    pub guide_ahead_mm: Option<f64>,
    /// Distance of the guide tube's centre from the flange axis, mm, positive away from the arm's connector; tool
    /// `parametric` only. Default: 70, as of `offset`.
    #[schemars(range(min = -200.0, max = 200.0))]
    pub guide_beside_mm: Option<f64>,
    /// Angle of the needle direction from the flange axis, deg: 0 along it, 90 perpendicular to it and away from the
    /// arm's connector; tool `parametric` only. Default: 0.
    #[schemars(range(min = -120.0, max = 120.0))]
    pub guide_tilt_deg: Option<f64>,
    /// Bore diameter of the guide, mm. Default: the tool's.
    #[schemars(range(min = 0.2, max = 10.0))]
    pub bore_mm: Option<f64>,
    /// Needle gauge, 14 to 25. Default: the tool's.
    #[schemars(schema_with = "gauges")]
    pub needle_gauge: Option<u32>,
    /// Needle length from hub to tip, mm. Default: the tool's.
    #[schemars(range(min = 20.0, max = 500.0))]
    pub needle_length_mm: Option<f64>,
    /// Radius of the access zone behind the guide for needle and hand, mm. Assumed: half of a hand holding the hub.
    #[schemars(range(min = 0.5, max = 200.0))]
    pub corridor_radius_mm: f64,
    /// Length of the access zone behind the guide's inlet, mm. Default: the needle length.
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub corridor_length_mm: Option<f64>,
    /// Half-angle of the hand cone from the guide's inlet to the end of the access zone, of which it is part, deg. 0
    /// omits the cone. Assumed.
    #[schemars(range(min = 0.0, max = 80.0))]
    pub hand_cone_half_angle_deg: f64,
    /// Links of the tool's URDF that need no collision shape, each as `NAME = "none"`. Every report lists them.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub shape: BTreeMap<String, StatedShape>,
}

impl Default for ToolSection {
    fn default() -> Self {
        Self {
            urdf: "offset".to_owned(),
            mount_rotation_deg: 0.0,
            guide_ahead_mm: None,
            guide_beside_mm: None,
            guide_tilt_deg: None,
            bore_mm: None,
            needle_gauge: None,
            needle_length_mm: None,
            corridor_radius_mm: 25.0,
            corridor_length_mm: None,
            hand_cone_half_angle_deg: 12.0,
            shape: BTreeMap::new(),
        }
    }
}

fn tools(_: &mut SchemaGenerator) -> Schema {
    reference_schema("needle_guide", "urdf", &[PARAMETRIC_TOOL])
}

fn gauges(_: &mut SchemaGenerator) -> Schema {
    let gauges = NEEDLE_OUTER_DIAMETER_MM.map(|(gauge, _)| gauge);
    let (least, most) = (gauges[0], gauges[gauges.len() - 1]);
    json_schema!({ "type": "integer", "minimum": least, "maximum": most, "enum": gauges })
}
