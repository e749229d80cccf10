//! `arm.toml`: what is known of an arm besides its URDF, each value with its source.

use std::sync::LazyLock;

use needlebench_kinematics::{JOINT_LABELS, UrGeometry, UrModel};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

use crate::printable::commented;
use crate::schema::FileSchema;

/// What is known of an arm. Only the name, the URDF and the lengths are needed; what else is left out
/// is not known, and is never taken from another arm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ArmData {
    /// The maker's name, such as `UR3e`.
    pub name: String,
    /// The URDF, relative to this file; `builtin:ur3e/ur3e.urdf` for a shipped one.
    pub urdf: String,
    /// Nominal lengths, by which a URDF from elsewhere is recognised.
    pub geometry: GeometryData,
    /// Where the masses and moments of inertia in the URDF are from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inertia: Option<Traced>,
    /// Where the limits in the URDF are from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limits: Option<LimitsData>,
    /// What the URDF's collision shapes enclose; without it they are not compared with meshes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub enclosure: Option<Traced>,
    /// Rated load.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub payload: Option<PayloadData>,
    /// Reach by the data sheet.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reach: Option<ReachData>,
    /// Typical speed of the tool by the data sheet.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tool_speed: Option<ToolSpeedData>,
    /// Repeatability by the data sheet.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub repeatability: Option<RepeatabilityData>,
    /// Gains of the joint servo.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub servo: Option<ServoData>,
    /// Rotor inertia.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotors: Option<RotorData>,
    /// Torque constants of the motors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motors: Option<MotorData>,
    /// The controller.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub control: Option<ControlData>,
    /// What the maker's controller takes gravity for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gravity: Option<GravityData>,
    /// Elasticity of the gears.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gears: Option<GearData>,
    /// Friction of the joints.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction: Option<FrictionData>,
    /// Brakes of the joints, by published stops of category 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub brakes: Option<BrakesData>,
    /// Where the arm stands and starts, unless a scenario says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cell: Option<CellData>,
    /// The test cube of ISO 9283, unless a scenario says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub iso9283: Option<CubeData>,
    /// Factory calibrations of real arms.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub population: Option<PopulationData>,
    /// The factory calibration of this very arm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<OwnCalibration>,
    /// Why a table is left out, by its name.
    #[serde(default, skip_serializing_if = "Lacks::is_empty")]
    pub lacks: Lacks,
}

/// Tables that are left out, and why.
pub type Lacks = std::collections::BTreeMap<String, String>;

/// Names of the tables that may be left out.
pub(super) const TABLES: [&str; 19] = [
    "inertia",
    "limits",
    "enclosure",
    "payload",
    "reach",
    "tool_speed",
    "repeatability",
    "servo",
    "rotors",
    "motors",
    "control",
    "gravity",
    "gears",
    "friction",
    "brakes",
    "cell",
    "iso9283",
    "population",
    "calibration",
];

impl ArmData {
    /// Sources that begin with `assumed`, by their keys.
    pub fn assumed(&self) -> std::collections::BTreeMap<String, String> {
        fn collect(
            at: &str,
            value: &serde_json::Value,
            found: &mut std::collections::BTreeMap<String, String>,
        ) {
            match value {
                serde_json::Value::Object(entries) => {
                    for (key, inner) in entries {
                        let path = if at.is_empty() {
                            key.clone()
                        } else {
                            format!("{at}.{key}")
                        };
                        match inner.as_str() {
                            Some(text)
                                if key.ends_with("source") && text.starts_with("assumed") =>
                            {
                                found.insert(path, text.to_owned());
                            }
                            _ => collect(&path, inner, found),
                        }
                    }
                }
                serde_json::Value::Array(items) => {
                    for (index, inner) in items.iter().enumerate() {
                        collect(&format!("{at}[{index}]"), inner, found);
                    }
                }
                _ => {}
            }
        }
        let mut found = std::collections::BTreeMap::new();
        let value = serde_json::to_value(self).expect("data of arms have string keys");
        collect("", &value, &mut found);
        found
    }
}

/// Where numbers that stand in the URDF are from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Traced {
    /// A citation, or `assumed: ` and why.
    pub source: String,
}

/// Lengths of the standard DH chain.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GeometryData {
    /// Height of the shoulder, m.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub d1_m: f64,
    /// Upper arm, m; negative.
    #[schemars(range(min = -2.0, max = 0.0))]
    pub a2_m: f64,
    /// Forearm, m; negative.
    #[schemars(range(min = -2.0, max = 0.0))]
    pub a3_m: f64,
    /// Offset of wrist 1, m.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub d4_m: f64,
    /// From wrist 1 to wrist 2, m.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub d5_m: f64,
    /// From wrist 2 to the flange, m.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub d6_m: f64,
    /// A citation, or `assumed: ` and why.
    pub source: String,
}

impl GeometryData {
    /// The lengths.
    pub fn lengths(&self) -> UrGeometry {
        UrGeometry {
            d1: self.d1_m,
            a2: self.a2_m,
            a3: self.a3_m,
            d4: self.d4_m,
            d5: self.d5_m,
            d6: self.d6_m,
        }
    }
}

/// Where the limits of the joints are from; the numbers stand in the URDF.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LimitsData {
    /// Source of the ranges.
    pub position_source: String,
    /// Source of the speeds.
    pub velocity_source: String,
    /// Source of the torques.
    pub effort_source: String,
}

/// Rated load.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PayloadData {
    /// Rated load at the flange, kg.
    #[schemars(range(min = 0.1, max = 100.0))]
    pub kg: f64,
    /// A citation, or `assumed: ` and why.
    pub source: String,
}

/// Reach.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ReachData {
    /// Reach, mm.
    #[schemars(range(min = 100.0, max = 5000.0))]
    pub mm: f64,
    /// A citation, or `assumed: ` and why.
    pub source: String,
}

/// Speed of the tool.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ToolSpeedData {
    /// Typical speed of the tool, mm/s.
    #[schemars(range(min = 1.0, max = 20_000.0))]
    pub mm_s: f64,
    /// A citation, or `assumed: ` and why.
    pub source: String,
}

/// Repeatability.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RepeatabilityData {
    /// Pose repeatability, mm.
    #[schemars(range(min = 1e-3, max = 10.0))]
    pub mm: f64,
    /// A citation, or `assumed: ` and why.
    pub source: String,
}

/// Gains of the joint servo.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ServoData {
    /// Position gain per joint, N m/rad.
    #[schemars(inner(range(min = 0.0, max = 1e6)))]
    pub stiffness_nm_rad: [f64; 6],
    /// Velocity gain per joint, N m s/rad.
    #[schemars(inner(range(min = 0.0, max = 1e5)))]
    pub damping_nms_rad: [f64; 6],
    /// A citation, or `assumed: ` and why.
    pub source: String,
}

/// Rotor inertia.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RotorData {
    /// Rotor inertia per joint, seen at the joint, kg m^2.
    #[schemars(inner(range(min = 0.0, max = 10.0)))]
    pub inertia_kgm2: [f64; 6],
    /// A citation, or `assumed: ` and why.
    pub source: String,
}

/// The factory calibration of one arm: the data are of this one then, and not of its type.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OwnCalibration {
    /// What ROS's `ur_calibration` writes, relative to this file. Used unless the scenario or the command
    /// line gives another.
    pub file: String,
    /// A citation, or `assumed: ` and why.
    pub source: String,
}

/// Torque constants of the motors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MotorData {
    /// Torque at the joint per ampere that the controller shows, per joint, N m/A.
    #[schemars(inner(range(min = 0.1, max = 1000.0)))]
    pub torque_constant_nm_a: [f64; 6],
    /// A citation, or `assumed: ` and why.
    pub source: String,
}

/// The controller.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ControlData {
    /// Time between two set-points, ms.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub period_ms: f64,
    /// A citation, or `assumed: ` and why.
    pub source: String,
}

/// What the maker's controller takes gravity for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GravityData {
    /// Acceleration of gravity in the controller's feed-forward, m/s^2.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub believed_m_s2: f64,
    /// A citation, or `assumed: ` and why.
    pub source: String,
}

/// Elasticity of the gears.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GearData {
    /// Torsional stiffness per joint, N m/rad; of a strain-wave gear the first of its three, `K1`.
    #[schemars(inner(range(min = 100.0, max = 1e9)))]
    pub stiffness_nm_rad: [f64; 6],
    /// How a strain-wave gear stiffens under torque; of one stiffness if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stiffening: Option<Stiffening>,
    /// A citation, or `assumed: ` and why.
    pub source: String,
}

/// How strain-wave gears stiffen: their second and third stiffness, and the torques where these begin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Stiffening {
    /// Torque per joint up to which the first stiffness holds, `T1`, N m.
    #[schemars(inner(range(min = 0.0, max = 1e4)))]
    pub first_corner_nm: [f64; 6],
    /// Stiffness from there on, `K2`, N m/rad.
    #[schemars(inner(range(min = 100.0, max = 1e9)))]
    pub second_nm_rad: [f64; 6],
    /// Torque up to which it holds, `T2`, N m.
    #[schemars(inner(range(min = 0.0, max = 1e4)))]
    pub second_corner_nm: [f64; 6],
    /// Stiffness beyond, `K3`, N m/rad.
    #[schemars(inner(range(min = 100.0, max = 1e9)))]
    pub third_nm_rad: [f64; 6],
}

/// Friction of the joints, by the LuGre model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FrictionData {
    /// Sliding friction per joint, N m.
    #[schemars(inner(range(min = 0.0, max = 50.0)))]
    pub coulomb_nm: [f64; 6],
    /// Break-away torque per joint, N m.
    #[schemars(inner(range(min = 0.0, max = 60.0)))]
    pub stiction_nm: [f64; 6],
    /// Speed at which the break-away torque has fallen off to 1/e, deg/s.
    #[schemars(inner(range(min = 0.01, max = 100.0)))]
    pub stribeck_deg_s: [f64; 6],
    /// Viscous friction per joint, N m s/rad.
    #[schemars(inner(range(min = 0.0, max = 100.0)))]
    pub viscous_nms_rad: [f64; 6],
    /// Stiffness of the contact before it slips per joint, N m/rad.
    #[schemars(inner(range(min = 100.0, max = 1e7)))]
    pub bristle_stiffness_nm_rad: [f64; 6],
    /// Damping of the contact before it slips per joint, N m s/rad.
    #[schemars(inner(range(min = 0.0, max = 1e4)))]
    pub bristle_damping_nms_rad: [f64; 6],
    /// A citation, or `assumed: ` and why.
    pub source: String,
}

/// Brakes of the joints, by stops of category 0 at full extension.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BrakesData {
    /// Speed of the joint from which the published stops are, deg/s.
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub speed_deg_s: f64,
    /// Load at the flange in the published stops, kg.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub load_kg: f64,
    /// Source of the figures of the joints that have no source of their own.
    pub source: String,
    /// Each joint once.
    pub stops: Vec<StopData>,
    /// A brake that stands.
    pub standing: StandingData,
}

/// A joint's published stop of category 0, or the joint whose brake it has.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StopData {
    /// The joint: `shoulder_pan`, `shoulder_lift`, `elbow`, `wrist_1`, `wrist_2` or `wrist_3`.
    #[schemars(schema_with = "joints")]
    pub joint: String,
    /// Angle travelled, rad.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1e-4, max = 20.0))]
    pub distance_rad: Option<f64>,
    /// Time taken, s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1e-4, max = 20.0))]
    pub time_s: Option<f64>,
    /// Instead of both: the joint whose brake it has, by the ratio of their torque limits.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(schema_with = "joints")]
    pub like: Option<String>,
    /// A citation, or `assumed: ` and why; needed with `like`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
}

/// A brake that stands.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StandingData {
    /// Torque of a brake that stands over that of one that slips.
    #[schemars(range(min = 1.0, max = 10.0))]
    pub ratio: f64,
    /// A citation, or `assumed: ` and why.
    pub source: String,
}

/// Where the arm stands and starts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CellData {
    /// Position of `base_link` in the world, mm.
    #[schemars(inner(range(min = -5000.0, max = 5000.0)))]
    pub base_position_mm: [f64; 3],
    /// Roll, pitch and yaw of `base_link` in the world, deg.
    #[schemars(inner(range(min = -720.0, max = 720.0)))]
    pub base_rpy_deg: [f64; 3],
    /// Start posture, shoulder pan to wrist 3, deg.
    #[schemars(inner(range(min = -720.0, max = 720.0)))]
    pub start_joints_deg: [f64; 6],
    /// Where it stands at the right of a patient on a table: from mid-chest towards the head, from the table's
    /// edge outwards, and over the table's upper face, mm.
    #[serde(default)]
    #[schemars(inner(range(min = -3000.0, max = 3000.0)))]
    pub beside_patient_mm: Option<[f64; 3]>,
    /// A citation, or `assumed: ` and why.
    pub source: String,
}

/// The test cube of ISO 9283.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CubeData {
    /// Middle of the cube in the controller's `base` frame, mm.
    #[schemars(inner(range(min = -5000.0, max = 5000.0)))]
    pub cube_centre_mm: [f64; 3],
    /// Edge of the cube, mm.
    #[schemars(range(min = 10.0, max = 2000.0))]
    pub cube_edge_mm: f64,
    /// A citation, or `assumed: ` and why.
    pub source: String,
}

/// Factory calibrations of real arms: how far one leaves the works from its nominal lengths.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PopulationData {
    /// How the arms were chosen, and why those of another type stand in.
    pub source: String,
    /// The arms.
    pub calibrations: Vec<CalibrationData>,
}

/// One real arm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CalibrationData {
    /// What ROS's `ur_calibration` wrote, relative to this file; `builtin:ur3/calibrations/ur3-1.yaml` for
    /// a shipped one.
    pub file: String,
    /// Type of the arm, such as `UR3e`, if it is not this one. It counts by its deviations from that
    /// type's nominal joint origins.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(schema_with = "models")]
    pub of: Option<String>,
    /// Who published it.
    pub source: String,
}

impl ArmData {
    /// The text of an `arm.toml` with these data, under some lines of comment.
    ///
    /// # Panics
    /// Never: whatever an `arm.toml` holds can be written.
    pub fn to_toml(&self, comment: &str) -> String {
        let text = toml::to_string(self).expect("tables of numbers and texts can be written");
        format!("{}\n{text}", commented(comment))
    }
}

fn joints(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "string", "enum": JOINT_LABELS })
}

fn models(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "string", "enum": UrModel::ALL.map(UrModel::name) })
}

/// What an `arm.toml` may hold.
pub(super) static ARM_DATA: LazyLock<FileSchema> = LazyLock::new(FileSchema::of::<ArmData>);

/// The JSON schema (draft-07) of `arm.toml`, for editors.
pub fn arm_schema() -> serde_json::Value {
    ARM_DATA.published()
}
