//! The scenario file: a plain struct with a default and a description for every key.
//!
//! Lengths are in mm and angles in degrees here and only here; keys say their unit.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::envelope::EnvelopeSection;
pub use crate::events::{EventsSection, PressClass, PressSection, StopSection};
use crate::fixtures::{GantryParameters, MountParameters, TableParameters};
pub use crate::imperfections::ImperfectionsSection;
pub use crate::iso9283::Iso9283Section;
pub use crate::people::{PeopleSection, PersonSection};
use crate::ranking::RankingSection;
use crate::robot::MissingInertia;
use crate::user_parts::PartSection;

/// One scenario: a cell, goals, and what is asked of every configuration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Name in reports and of the results folder: letters, digits, `-` and `_`.
    pub name: String,
    /// What the scenario is for, in a sentence or two.
    #[serde(default)]
    pub description: String,
    /// Seed of everything random: searches for motions, and draws of imperfections.
    #[serde(default)]
    pub seed: u64,
    /// The arm and where it stands.
    #[serde(default)]
    pub robot: RobotSection,
    /// Column under the robot; none if left out.
    #[serde(default)]
    pub mount: Option<MountParameters>,
    /// The needle guide.
    #[serde(default)]
    pub tool: ToolSection,
    /// The chest phantom; none if left out.
    #[serde(default)]
    pub phantom: Option<PhantomSection>,
    /// CT table; none if left out.
    #[serde(default)]
    pub table: Option<TableParameters>,
    /// CT gantry; none if left out.
    #[serde(default)]
    pub gantry: Option<GantryParameters>,
    /// Where needles are to go. Needed unless there is an `[iso9283]`.
    #[serde(default)]
    pub goals: Vec<GoalSection>,
    /// The test of the robot by ISO 9283, instead of goals.
    #[serde(default)]
    pub iso9283: Option<Iso9283Section>,
    /// Where every motion starts.
    #[serde(default)]
    pub start: StartSection,
    /// Speed limits of the motion.
    #[serde(default)]
    pub motion: MotionSection,
    /// What makes a configuration unfit before anything is simulated.
    #[serde(default)]
    pub planning: PlanningSection,
    /// The joint servo.
    #[serde(default)]
    pub controller: ControllerSection,
    /// The physics engines.
    #[serde(default)]
    pub engines: EnginesSection,
    /// What every working configuration has to reach.
    #[serde(default)]
    pub criteria: CriteriaSection,
    /// How the configurations that work are ranked.
    #[serde(default)]
    pub ranking: RankingSection,
    /// What is written of each simulated motion.
    #[serde(default)]
    pub recording: RecordingSection,
    /// The people in the room, and what they prefer.
    #[serde(default)]
    pub people: PeopleSection,
    /// How the real arm and the real phantom differ from what the controller believes; not at all
    /// if left out.
    #[serde(default)]
    pub imperfections: Option<ImperfectionsSection>,
    /// Contacts, stops and the way back, simulated besides the planned motion; none if left out.
    #[serde(default)]
    pub events: Option<EventsSection>,
}

/// The arm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RobotSection {
    /// `ur3`, or the path of a URDF relative to this file.
    pub urdf: String,
    /// Position of `base_link` in the world (z up, floor at 0), mm.
    pub base_position_mm: [f64; 3],
    /// Roll, pitch and yaw of `base_link` in the world, deg.
    pub base_rpy_deg: [f64; 3],
    /// What to do when a moving link has no mass: `error` or `nominal-ur3`.
    pub missing_inertia: MissingInertia,
    /// Factory calibration of the arm, as ROS's `ur_calibration` writes it: path relative to this
    /// file. Its joint origins replace the URDF's. The nominal arm if left out; a robot or a
    /// calibration of the command line replaces it.
    pub calibration: Option<String>,
}

impl Default for RobotSection {
    fn default() -> Self {
        Self {
            urdf: "ur3".to_owned(),
            base_position_mm: [0.0, 0.0, 800.0],
            base_rpy_deg: [0.0; 3],
            missing_inertia: MissingInertia::default(),
            calibration: None,
        }
    }
}

/// The needle guide.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ToolSection {
    /// `offset`, `perpendicular`, `inline`, or the path of a URDF relative to this file.
    pub urdf: String,
    /// Angle about the flange axis at which the tool is bolted on, deg. The flange's four screws
    /// allow multiples of 90.
    pub mount_rotation_deg: f64,
    /// Diameter of the bore, mm; the tool's own if left out.
    pub bore_mm: Option<f64>,
    /// Gauge of the needle, 14 to 25; the tool's own if left out.
    pub needle_gauge: Option<u32>,
    /// Length of the needle from hub to tip, mm; the tool's own if left out.
    pub needle_length_mm: Option<f64>,
    /// Radius of the volume behind the guide that needle and hand need, mm. Default assumed: half of a
    /// hand that holds the hub.
    pub corridor_radius_mm: f64,
    /// Length of that volume behind the guide's entry, mm; the needle's length if left out.
    pub corridor_length_mm: Option<f64>,
    /// Half-angle of the cone that the hand needs on its way to the hub, deg, from the guide's entry
    /// to the end of that volume; it counts as part of it. 0 leaves the cone out. Default assumed.
    pub hand_cone_half_angle_deg: f64,
}

impl Default for ToolSection {
    fn default() -> Self {
        Self {
            urdf: "offset".to_owned(),
            mount_rotation_deg: 0.0,
            bore_mm: None,
            needle_gauge: None,
            needle_length_mm: None,
            corridor_radius_mm: 25.0,
            corridor_length_mm: None,
            hand_cone_half_angle_deg: 12.0,
        }
    }
}

/// How the phantom lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Posture {
    /// On the back.
    Supine,
    /// On the belly.
    Prone,
    /// On the left side.
    LeftLateral,
    /// On the right side.
    RightLateral,
}

/// The phantom and where it lies.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PhantomSection {
    /// `male-p5`, `male-p50`, `male-p95`, `female-p5`, `female-p50`, `female-p95`, the path of a
    /// parameter file relative to this file, or `none` for a phantom of `parts` alone.
    pub model: String,
    /// Breadth of the chest, mm; the model's own if left out.
    pub breadth_mm: Option<f64>,
    /// Depth of the chest, mm; the model's own if left out.
    pub depth_mm: Option<f64>,
    /// Length of the phantom, mm; the model's own if left out.
    pub length_mm: Option<f64>,
    /// How it lies.
    pub posture: Posture,
    /// Direction from feet to head in the world's horizontal plane: 0 is world x, 90 world y, deg.
    pub head_yaw_deg: f64,
    /// Turn about the long axis away from the posture, deg.
    pub body_roll_deg: f64,
    /// Position of the phantom's origin (mid-chest) in the world, mm. With `rest_on_table` the
    /// third number is the height of a cushion over the table.
    pub position_mm: [f64; 3],
    /// Lays the lowest point of the skin on the table.
    pub rest_on_table: bool,
    /// Parts from STL files, besides the model's or in their place.
    pub parts: Vec<PartSection>,
}

impl Default for PhantomSection {
    fn default() -> Self {
        Self {
            model: "male-p50".to_owned(),
            breadth_mm: None,
            depth_mm: None,
            length_mm: None,
            posture: Posture::Supine,
            head_yaw_deg: 0.0,
            body_roll_deg: 0.0,
            position_mm: [0.0; 3],
            rest_on_table: true,
            parts: Vec::new(),
        }
    }
}

/// A pose of the flange as the UR controller shows it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FlangePose {
    /// Position in the controller's `base` frame, mm.
    pub position_mm: [f64; 3],
    /// Rotation vector in the `base` frame, rad.
    pub rotation_vector_rad: [f64; 3],
}

/// One needle: from entry and target, or from a flange pose.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GoalSection {
    /// Name in reports: letters, digits, `-` and `_`.
    pub name: String,
    /// Entry point on the skin, phantom frame (left, posterior, superior), mm. A point within
    /// 5 mm of the skin is moved onto it along the needle.
    #[serde(default)]
    pub entry_mm: Option<[f64; 3]>,
    /// Where the needle enters, as seen from the target, instead of `entry_mm`: azimuth and elevation
    /// in the phantom frame, deg. Azimuth 0 is towards the front of the body, 90 towards the patient's
    /// left, -90 towards the right; elevation 90 is towards the head. The entry is where the line from
    /// the target in that direction leaves the skin, so one goal suits phantoms of all sizes.
    #[serde(default)]
    pub entry_direction_deg: Option<[f64; 2]>,
    /// Target point, phantom frame, mm.
    #[serde(default)]
    pub target_mm: Option<[f64; 3]>,
    /// Name of a lesion of the phantom whose centre is the target, instead of `target_mm`.
    #[serde(default)]
    pub lesion: Option<String>,
    /// Added to `target_mm` or to the lesion's centre, phantom frame (left, posterior, superior), mm.
    #[serde(default)]
    pub target_offset_mm: Option<[f64; 3]>,
    /// Pose of the flange, instead of entry and target. The needle then follows the guide.
    #[serde(default)]
    pub flange_pose: Option<FlangePose>,
    /// From the guide's exit to the needle's tip, mm. Left out: the distance from the guide's
    /// exit to the target. Needed with `flange_pose`.
    #[serde(default)]
    pub insertion_length_mm: Option<f64>,
    /// Gap between the guide's exit and the entry point, mm. Not used with `flange_pose`.
    #[serde(default = "default_standoff_mm")]
    pub standoff_mm: f64,
    /// How far behind its final place the guide starts to move straight along the needle, mm.
    #[serde(default = "default_approach_mm")]
    pub approach_mm: f64,
    /// Angle of the guide about the needle, deg: 0 turns the guide's x axis as near to the
    /// patient's head as it gets. Left out: free, and chosen for each configuration.
    #[serde(default)]
    pub roll_deg: Option<f64>,
    /// Outcome that is expected of a configuration: `ok`, `failed`, or the rule that rejects it.
    /// The key `every` stands for all that are not named.
    #[serde(default)]
    pub expected: BTreeMap<String, String>,
}

impl GoalSection {
    /// The key that decides the entry.
    pub(crate) fn entry_key(&self) -> &'static str {
        if self.entry_direction_deg.is_some() {
            "entry_direction_deg"
        } else {
            "entry_mm"
        }
    }

    /// The key that decides the target.
    pub(crate) fn target_key(&self) -> &'static str {
        match (&self.target_offset_mm, &self.lesion) {
            (Some(_), _) => "target_offset_mm",
            (None, Some(_)) => "lesion",
            (None, None) => "target_mm",
        }
    }
}

fn default_standoff_mm() -> f64 {
    10.0
}
fn default_approach_mm() -> f64 {
    60.0
}

/// Where every motion starts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StartSection {
    /// Joint positions, shoulder pan to wrist 3, deg.
    pub joints_deg: [f64; 6],
}

impl Default for StartSection {
    fn default() -> Self {
        Self {
            joints_deg: [0.0, -90.0, -60.0, -90.0, 90.0, 0.0],
        }
    }
}

/// Speed limits of the motion; the URDF's joint speed limits hold besides.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MotionSection {
    /// Joint speed, deg/s. Default: URScript `movej`'s 1.05 rad/s.
    pub joint_velocity_deg_s: f64,
    /// Joint acceleration, deg/s^2. Default: URScript `movej`'s 1.4 rad/s^2.
    pub joint_acceleration_deg_s2: f64,
    /// Joint jerk, deg/s^3. Default assumed: full acceleration after 0.14 s.
    pub joint_jerk_deg_s3: f64,
    /// Speed of the guide along the needle axis, mm/s. Default assumed: slow beside a patient.
    pub line_velocity_mm_s: f64,
    /// Acceleration of the guide along the needle axis, mm/s^2.
    pub line_acceleration_mm_s2: f64,
    /// Jerk of the guide along the needle axis, mm/s^3.
    pub line_jerk_mm_s3: f64,
    /// Time that the arm holds its final place, s.
    pub hold_s: f64,
}

impl Default for MotionSection {
    fn default() -> Self {
        Self {
            joint_velocity_deg_s: 60.0,
            joint_acceleration_deg_s2: 80.0,
            joint_jerk_deg_s3: 570.0,
            line_velocity_mm_s: 50.0,
            line_acceleration_mm_s2: 200.0,
            line_jerk_mm_s3: 1000.0,
            hold_s: 1.0,
        }
    }
}

/// What the guide's angle about the needle is chosen for, where it is free.
#[derive(
    Debug,
    Clone,
    Copy,
    Default,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Hash,
    Serialize,
    Deserialize,
    JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum RollAim {
    /// Clearance of the final posture: a soft least over all classes, `-s ln sum exp(-d / s)` with
    /// `s` = 20 mm, so that a class that no roll changes does not decide.
    Clearance,
    /// Margin to the joint limits.
    JointMargin,
    /// Distance from singularities: the least of `|sin q5|`, `|sin q3|` and the distance from the
    /// shoulder's singularity over 100 mm.
    Singularity,
    /// Least motion of the needle's tip under errors of the joints.
    TipAccuracy,
    /// The weighted mean of the `[ranking]` utilities of all these: what configurations are ranked by,
    /// as far as the final posture decides it. The default.
    #[default]
    Balanced,
}

impl RollAim {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::Clearance,
        Self::JointMargin,
        Self::Singularity,
        Self::TipAccuracy,
        Self::Balanced,
    ];

    /// Name in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Clearance => "clearance",
            Self::JointMargin => "joint_margin",
            Self::Singularity => "singularity",
            Self::TipAccuracy => "tip_accuracy",
            Self::Balanced => "balanced",
        }
    }
}

/// What makes a configuration unfit before anything is simulated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PlanningSection {
    /// Clearance of arm and tool from their surroundings below which a posture or motion is
    /// rejected, mm.
    pub min_clearance_mm: f64,
    /// Clearance of arm and tool from themselves below which a posture or motion is rejected, mm.
    /// Forearm and wrist 2 are about 10 mm apart in most postures.
    pub min_self_clearance_mm: f64,
    /// `|sin q5|` and `|sin q3|` below which the final posture is rejected as singular.
    pub min_singularity_sine: f64,
    /// Distance of wrist 2 from the cylinder about the shoulder axis below which the final posture
    /// is rejected as singular, mm: `sqrt(rho^2 - d4^2)`.
    pub min_shoulder_distance_mm: f64,
    /// Rejects a final posture in which something stands in the volume behind the guide that
    /// needle and hand need.
    pub require_needle_corridor: bool,
    /// Simulates configurations too that are rejected for collisions or a blocked corridor, to
    /// see what would happen. They stay rejected.
    pub simulate_rejected: bool,
    /// Directions about the needle that are tried where roll is free; between them the edges of the
    /// ranges that work and the best roll are searched for.
    pub roll_samples: u32,
    /// What the direction about the needle is chosen for.
    pub roll_aim: RollAim,
    /// Largest step of any point of the arm between two collision checks of a motion, mm.
    pub sample_spacing_mm: f64,
    /// Postures that the search for a motion may look at per configuration, where the straight joint
    /// motion is blocked; 0 for straight motions only. A count, not a time: results are the same on
    /// every machine. A posture takes about 10 us.
    pub motion_checks: u32,
    /// Distance between the least clearance found along a motion and its proven lower bound that
    /// is aimed at, mm.
    pub certificate_tolerance_mm: f64,
}

impl Default for PlanningSection {
    fn default() -> Self {
        Self {
            min_clearance_mm: 0.0,
            min_self_clearance_mm: 0.0,
            min_singularity_sine: 0.01,
            min_shoulder_distance_mm: 5.0,
            require_needle_corridor: true,
            simulate_rejected: false,
            roll_samples: 36,
            roll_aim: RollAim::default(),
            sample_spacing_mm: 5.0,
            motion_checks: 60_000,
            certificate_tolerance_mm: 0.1,
        }
    }
}

/// The joint servo, the same for every engine.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ControllerSection {
    /// Position gain per joint, N m/rad.
    pub stiffness_nm_rad: [f64; 6],
    /// Velocity gain per joint, N m s/rad.
    pub damping_nms_rad: [f64; 6],
    /// Reflected rotor inertia per joint, kg m^2. Assumed: UR publishes none.
    pub armature_kgm2: [f64; 6],
}

impl Default for ControllerSection {
    fn default() -> Self {
        Self {
            stiffness_nm_rad: [2000.0; 6],
            damping_nms_rad: [60.0; 6],
            armature_kgm2: [0.1; 6],
        }
    }
}

/// The physics engines.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct EnginesSection {
    /// Engines to run when the command line does not say: `rapier`, `mujoco`.
    pub run: Vec<EngineName>,
    /// Time step, ms.
    pub timestep_ms: f64,
    /// Time without an answer after which the MuJoCo process is given up, s.
    pub harness_timeout_s: f64,
    /// Coulomb friction between any two solids, in both engines. With friction a pressed guide
    /// creeps in MuJoCo and settled tips differ by up to 0.5 mm, so the default is none.
    pub friction: f64,
    /// Settings of rapier alone.
    pub rapier: RapierSection,
    /// Settings of MuJoCo alone.
    pub mujoco: MujocoSection,
    /// How far the engines may differ.
    pub envelope: EnvelopeSection,
}

/// Settings of rapier alone.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RapierSection {
    /// Natural frequency of a contact as a spring, Hz; higher is stiffer.
    pub contact_natural_frequency_hz: f64,
    /// Damping ratio of a contact as a spring.
    pub contact_damping_ratio: f64,
    /// Gauss-Seidel sweeps over the contacts per step.
    pub contact_sweeps: u32,
}

impl Default for RapierSection {
    fn default() -> Self {
        Self {
            contact_natural_frequency_hz: 1e4,
            contact_damping_ratio: 1.0,
            contact_sweeps: 10,
        }
    }
}

/// Settings of MuJoCo alone.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MujocoSection {
    /// Stiffness of a contact's reference acceleration, 1/s^2 (first number of `solref`).
    pub contact_stiffness_per_s2: f64,
    /// Damping of a contact's reference acceleration, 1/s (second number of `solref`).
    pub contact_damping_per_s: f64,
    /// Impedance of contacts at every depth, between 0 and 1 (`solimp`).
    pub contact_impedance: f64,
}

impl Default for MujocoSection {
    fn default() -> Self {
        Self {
            contact_stiffness_per_s2: 1e6,
            contact_damping_per_s: 1e3,
            contact_impedance: 0.95,
        }
    }
}

/// An engine.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum EngineName {
    /// rapier, in process.
    Rapier,
    /// MuJoCo, in a Python process.
    Mujoco,
}

impl EngineName {
    /// Name in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rapier => "rapier",
            Self::Mujoco => "mujoco",
        }
    }
}

impl Default for EnginesSection {
    fn default() -> Self {
        Self {
            run: vec![EngineName::Rapier, EngineName::Mujoco],
            timestep_ms: 1.0,
            harness_timeout_s: 30.0,
            friction: 0.0,
            rapier: RapierSection::default(),
            mujoco: MujocoSection::default(),
            envelope: EnvelopeSection::default(),
        }
    }
}

/// Least clearances, mm; a class that is left out is not judged.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ClearanceCriteria {
    /// Arm against the skin.
    pub robot_phantom: Option<f64>,
    /// Arm and tool against the table.
    pub robot_table: Option<f64>,
    /// Arm and tool against the gantry.
    pub robot_gantry: Option<f64>,
    /// Arm and tool against the mount.
    pub robot_mount: Option<f64>,
    /// Arm and tool against themselves.
    #[serde(rename = "self")]
    pub self_collision: Option<f64>,
    /// Tool, without its guide tube, against the skin.
    pub tool_phantom: Option<f64>,
    /// Guide tube against the skin.
    pub guide_standoff: Option<f64>,
    /// Volume behind the guide against everything else.
    pub needle_corridor: Option<f64>,
    /// Planned needle against bone, vessel and organ.
    pub needle_route: Option<f64>,
}

/// What every working configuration has to reach, in each engine.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CriteriaSection {
    /// Largest settled distance of the needle tip from the target, mm.
    pub max_tip_position_error_mm: Option<f64>,
    /// Largest root mean square distance of the needle's tip from the target over all arms and
    /// patients of `[imperfections]`, mm.
    pub max_tip_rms_mm: Option<f64>,
    /// The same across the needle, mm.
    pub max_tip_lateral_rms_mm: Option<f64>,
    /// Largest settled angle between planned and actual needle, deg.
    pub max_needle_angle_error_deg: Option<f64>,
    /// Largest settled distance of the guide's exit from its planned place, mm.
    pub max_guide_position_error_mm: Option<f64>,
    /// Largest time from the end of the motion until the tip stays within its band, s.
    pub max_settling_time_s: Option<f64>,
    /// Largest share of a joint's torque limit that is used.
    pub max_peak_torque_ratio: Option<f64>,
    /// Largest difference of the engines' tips while moving, mm.
    pub max_engine_difference_peak_mm: Option<f64>,
    /// Largest difference of the engines' tips when settled, mm.
    pub max_engine_difference_settled_mm: Option<f64>,
    /// Whether arm or tool may touch anything.
    pub allow_contact: bool,
    /// Least clearances over the recorded motion, mm.
    pub min_clearance_mm: ClearanceCriteria,
    /// Configurations that have to work for each goal.
    pub min_working_configurations: u32,
    /// Half-width of the tip's settling band, mm.
    pub settling_band_mm: f64,
    /// Least share of the room about the entry point that is free of arm and tool, 0 to 1.
    pub min_free_fraction: Option<f64>,
    /// Least share of unobstructed lines of sight, 0 to 1.
    pub min_sight_fraction: Option<f64>,
    /// Least half-angle of the free cone behind the guide, deg.
    pub min_hand_cone_deg: Option<f64>,
}

impl Default for CriteriaSection {
    fn default() -> Self {
        Self {
            max_tip_position_error_mm: Some(0.1),
            max_tip_rms_mm: None,
            max_tip_lateral_rms_mm: None,
            max_needle_angle_error_deg: Some(0.05),
            max_guide_position_error_mm: None,
            max_settling_time_s: None,
            max_peak_torque_ratio: Some(1.0),
            max_engine_difference_peak_mm: None,
            max_engine_difference_settled_mm: None,
            allow_contact: false,
            min_clearance_mm: ClearanceCriteria::default(),
            min_working_configurations: 1,
            settling_band_mm: 0.01,
            min_free_fraction: None,
            min_sight_fraction: None,
            min_hand_cone_deg: None,
        }
    }
}

/// What is written of each simulated motion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RecordingSection {
    /// Time between two rows of a recording, and between two clearance checks, ms.
    pub period_ms: f64,
    /// Write a picture of each configuration.
    pub pictures: bool,
}

impl Default for RecordingSection {
    fn default() -> Self {
        Self {
            period_ms: 10.0,
            pictures: true,
        }
    }
}

/// The JSON schema (draft-07) of scenario files, for editors.
pub fn scenario_schema() -> serde_json::Value {
    schemars::generate::SchemaSettings::draft07()
        .into_generator()
        .into_root_schema_for::<Scenario>()
        .to_value()
}
