//! `arm.toml`: data of an arm besides its URDF, each value with its source.

use std::sync::LazyLock;

use needlebench_kinematics::{JOINT_LABELS, UrGeometry, UrModel};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

use needlebench_input::commented;
use needlebench_input::schema::FileSchema;

/// Data of an arm. Only name, URDF and lengths are required; other tables that are missing are unknown, and never taken
/// from another arm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ArmData {
    /// The manufacturer's name, such as `UR3e`.
    pub name: String,
    /// The URDF, relative to this file; `builtin:ur3e/ur3e.urdf` for a shipped one.
    pub urdf: String,
    /// Nominal lengths, by which a URDF from elsewhere is recognised.
    pub geometry: GeometryData,
    /// Source of the masses and moments of inertia in the URDF.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inertia: Option<Traced>,
    /// Sources of the limits in the URDF.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limits: Option<LimitsData>,
    /// Source of the URDF's collision shapes; without it they are not compared with meshes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub enclosure: Option<Traced>,
    /// Rated load.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub payload: Option<PayloadData>,
    /// Reach from the data sheet.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reach: Option<ReachData>,
    /// Typical tool speed from the data sheet.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tool_speed: Option<ToolSpeedData>,
    /// Repeatability from the data sheet.
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
    /// Gravity in the manufacturer's controller.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gravity: Option<GravityData>,
    /// Elasticity of the gears.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gears: Option<GearData>,
    /// Friction of the joints.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction: Option<FrictionData>,
    /// Joint brakes, from published stops of category 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub brakes: Option<BrakesData>,
    /// Default base placement and start posture.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cell: Option<CellData>,
    /// Default test cube of ISO 9283.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub iso9283: Option<CubeData>,
    /// Factory calibrations of real arms.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub population: Option<PopulationData>,
    /// Factory calibration of this individual arm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<OwnCalibration>,
    /// Reason why a table is missing, by its name.
    #[serde(default, skip_serializing_if = "Lacks::is_empty")]
    pub lacks: Lacks,
}

/// Missing tables, with reasons.
pub type Lacks = std::collections::BTreeMap<String, String>;

/// Names of the optional tables.
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

/// Source of numbers that are in the URDF.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Traced {
    /// A citation, or `assumed: ` and the reason.
    pub source: String,
}

/// Lengths of the standard DH chain.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GeometryData {
    /// Shoulder height, m.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub d1_m: f64,
    /// Upper-arm length, m; negative.
    #[schemars(range(min = -2.0, max = 0.0))]
    pub a2_m: f64,
    /// Forearm length, m; negative.
    #[schemars(range(min = -2.0, max = 0.0))]
    pub a3_m: f64,
    /// Offset of wrist 1, m.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub d4_m: f64,
    /// Distance from wrist 1 to wrist 2, m.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub d5_m: f64,
    /// Distance from wrist 2 to the flange, m.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub d6_m: f64,
    /// A citation, or `assumed: ` and the reason.
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

/// Sources of the joint limits; the numbers are in the URDF.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LimitsData {
    /// Source of the position limits.
    pub position_source: String,
    /// Source of the velocity limits.
    pub velocity_source: String,
    /// Source of the torque limits.
    pub effort_source: String,
}

/// Rated load.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PayloadData {
    /// Rated load at the flange, kg.
    #[schemars(range(min = 0.1, max = 100.0))]
    pub kg: f64,
    /// A citation, or `assumed: ` and the reason.
    pub source: String,
}

/// Reach.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ReachData {
    /// Reach, mm.
    #[schemars(range(min = 100.0, max = 5000.0))]
    pub mm: f64,
    /// A citation, or `assumed: ` and the reason.
    pub source: String,
}

/// Tool speed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ToolSpeedData {
    /// Typical tool speed, mm/s.
    #[schemars(range(min = 1.0, max = 20_000.0))]
    pub mm_s: f64,
    /// A citation, or `assumed: ` and the reason.
    pub source: String,
}

/// Repeatability.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RepeatabilityData {
    /// Pose repeatability, mm.
    #[schemars(range(min = 1e-3, max = 10.0))]
    pub mm: f64,
    /// A citation, or `assumed: ` and the reason.
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
    /// A citation, or `assumed: ` and the reason.
    pub source: String,
}

/// Rotor inertia.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RotorData {
    /// Rotor inertia per joint, reflected to the joint, kg m^2.
    #[schemars(inner(range(min = 0.0, max = 50.0)))]
    pub inertia_kgm2: [f64; 6],
    /// A citation, or `assumed: ` and the reason.
    pub source: String,
}

/// Factory calibration of one arm: the data are then of this arm, not of its type.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OwnCalibration {
    /// File written by ROS's `ur_calibration`, relative to this file. Used unless the scenario or the command line
    /// gives another.
    pub file: String,
    /// A citation, or `assumed: ` and the reason.
    pub source: String,
}

/// Motor torque constants.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MotorData {
    /// Joint torque per ampere of the current that the controller reports, per joint, N m/A.
    #[schemars(inner(range(min = 0.1, max = 1000.0)))]
    pub torque_constant_nm_a: [f64; 6],
    /// A citation, or `assumed: ` and the reason.
    pub source: String,
}

/// The controller.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ControlData {
    /// Set-point period, ms.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub period_ms: f64,
    /// A citation, or `assumed: ` and the reason.
    pub source: String,
}

/// Gravity in the manufacturer's controller.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GravityData {
    /// Gravity in the controller's feed-forward, m/s^2.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub believed_m_s2: f64,
    /// A citation, or `assumed: ` and the reason.
    pub source: String,
}

/// Elasticity of the gears.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GearData {
    /// Torsional stiffness per joint, N m/rad; of a strain-wave gear the first of its three, `K1`.
    #[schemars(inner(range(min = 100.0, max = 1e9)))]
    pub stiffness_nm_rad: [f64; 6],
    /// Stiffening of a strain-wave gear under torque. Default: constant stiffness.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stiffening: Option<Stiffening>,
    /// A citation, or `assumed: ` and the reason.
    pub source: String,
}

/// Stiffening of strain-wave gears: second and third stiffness, and the torques at which they begin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Stiffening {
    /// Torque per joint up to which the first stiffness applies, `T1`, N m.
    #[schemars(inner(range(min = 0.0, max = 1e4)))]
    pub first_corner_nm: [f64; 6],
    /// Stiffness above `T1`, `K2`, N m/rad.
    #[schemars(inner(range(min = 100.0, max = 1e9)))]
    pub second_nm_rad: [f64; 6],
    /// Torque up to which the second stiffness applies, `T2`, N m.
    #[schemars(inner(range(min = 0.0, max = 1e4)))]
    pub second_corner_nm: [f64; 6],
    /// Stiffness above `T2`, `K3`, N m/rad.
    #[schemars(inner(range(min = 100.0, max = 1e9)))]
    pub third_nm_rad: [f64; 6],
}

/// Joint friction (LuGre model).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FrictionData {
    /// Coulomb friction per joint, N m.
    #[schemars(inner(range(min = 0.0, max = 50.0)))]
    pub coulomb_nm: [f64; 6],
    /// Break-away torque (stiction) per joint, N m.
    #[schemars(inner(range(min = 0.0, max = 60.0)))]
    pub stiction_nm: [f64; 6],
    /// Stribeck velocity per joint, at which the excess of the break-away torque has decayed to 1/e, deg/s.
    #[schemars(inner(range(min = 0.01, max = 100.0)))]
    pub stribeck_deg_s: [f64; 6],
    /// Viscous friction per joint, N m s/rad.
    #[schemars(inner(range(min = 0.0, max = 100.0)))]
    pub viscous_nms_rad: [f64; 6],
    /// Bristle stiffness per joint before sliding, N m/rad.
    #[schemars(inner(range(min = 100.0, max = 1e7)))]
    pub bristle_stiffness_nm_rad: [f64; 6],
    /// Bristle damping per joint before sliding, N m s/rad.
    #[schemars(inner(range(min = 0.0, max = 1e4)))]
    pub bristle_damping_nms_rad: [f64; 6],
    /// A citation, or `assumed: ` and the reason.
    pub source: String,
}

/// Joint brakes, from stops of category 0 at full extension.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BrakesData {
    /// Initial joint speed of the published stops, deg/s.
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub speed_deg_s: f64,
    /// Load at the flange in the published stops, kg.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub load_kg: f64,
    /// Source for all joints without a source of their own.
    pub source: String,
    /// One entry per joint.
    pub stops: Vec<StopData>,
    /// Static brake torque.
    pub standing: StandingData,
}

/// Published stop of category 0 of a joint, or the joint whose brake it shares.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StopData {
    /// The joint: `shoulder_pan`, `shoulder_lift`, `elbow`, `wrist_1`, `wrist_2` or `wrist_3`.
    #[schemars(schema_with = "joints")]
    pub joint: String,
    /// Stopping distance, rad.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1e-4, max = 20.0))]
    pub distance_rad: Option<f64>,
    /// Stopping time, s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1e-4, max = 20.0))]
    pub time_s: Option<f64>,
    /// Instead of both: the joint whose brake is used, scaled by the ratio of their torque limits.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(schema_with = "joints")]
    pub like: Option<String>,
    /// A citation, or `assumed: ` and the reason; required with `like`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
}

/// Static brake torque.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StandingData {
    /// Ratio of static to sliding brake torque.
    #[schemars(range(min = 1.0, max = 10.0))]
    pub ratio: f64,
    /// A citation, or `assumed: ` and the reason.
    pub source: String,
}

/// Default base placement and start posture.
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
    /// Base placement on the right of a patient on a table, mm: from mid-chest towards the head, from the table's edge
    /// outwards, and above the table's upper face.
    #[serde(default)]
    #[schemars(inner(range(min = -3000.0, max = 3000.0)))]
    pub beside_patient_mm: Option<[f64; 3]>,
    /// A citation, or `assumed: ` and the reason.
    pub source: String,
}

/// The test cube of ISO 9283.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CubeData {
    /// Centre of the cube in the controller's `base` frame, mm.
    #[schemars(inner(range(min = -5000.0, max = 5000.0)))]
    pub cube_centre_mm: [f64; 3],
    /// Edge of the cube, mm.
    #[schemars(range(min = 10.0, max = 2000.0))]
    pub cube_edge_mm: f64,
    /// A citation, or `assumed: ` and the reason.
    pub source: String,
}

/// Factory calibrations of real arms.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PopulationData {
    /// Selection of the arms, and the reason for including those of another type.
    pub source: String,
    /// The arms.
    pub calibrations: Vec<CalibrationData>,
}

/// One real arm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CalibrationData {
    /// File written by ROS's `ur_calibration`, relative to this file; `builtin:ur3/calibrations/ur3-1.yaml` for a
    /// shipped one.
    pub file: String,
    /// Type of the arm, such as `UR3e`, if it differs from this one. It is used as deviations from that type's nominal
    /// joint origins.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(schema_with = "models")]
    pub of: Option<String>,
    /// Publisher of the calibration.
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
