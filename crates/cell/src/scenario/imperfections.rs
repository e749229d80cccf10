//! How the real arm and the real phantom differ from what the controller believes.
//!
//! Each effect is a block of its own under `[imperfections]`, off unless it is there. A block says
//! what is *known* of the effect (which every arm has) and what is *uncertain* (one draw per arm or
//! per patient). A run uses one draw, made from the scenario's seed; the error budget uses the
//! distribution.

use needlebench_kinematics::JOINT_COUNT;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Serialize};

use super::models::names_or_path;
use crate::Finding;
use crate::arm::Arm;
use crate::toml_text::TomlText;

/// How the real arm and phantom differ from the nominal ones.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ImperfectionsSection {
    /// Samples of the error budget's Monte Carlo in a `run`; 0 for the analytic budget alone.
    #[schemars(range(min = 0, max = 10_000_000))]
    pub budget_samples: Option<u32>,
    /// Joint origins of the real arm, unknown to the controller.
    pub calibration: Option<CalibrationBlock>,
    /// Encoders of the joints.
    pub encoder: Option<EncoderBlock>,
    /// Elasticity of the joints' gears; the arm sags under its weight.
    pub elasticity: Option<ElasticityBlock>,
    /// Mass and centre of mass of the tool, where the controller believes something else.
    pub payload: Option<PayloadBlock>,
    /// Friction of the joints with stiction.
    pub friction: Option<FrictionBlock>,
    /// Torques that the drives can give, where the controller believes in more.
    pub torque_limits: Option<TorqueLimitsBlock>,
    /// Rate and age of the set-points, and delay of the servo.
    pub control: Option<ControlBlock>,
    /// Play of the needle in its guide.
    pub guide: Option<GuideBlock>,
    /// Registration of the phantom by markers.
    pub registration: Option<RegistrationBlock>,
    /// Breathing of the phantom.
    pub breathing: Option<BreathingBlock>,
}

/// Joint origins of the real arm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CalibrationBlock {
    /// `population`: an arm drawn from the normal distribution with mean and covariance of the factory
    /// calibrations in the arm's data; or a real arm of a shipped arm's data by name, such as `ur3-1`,
    /// of which the deviations from its nominal model are taken; or the path of such a file relative
    /// to this one.
    #[schemars(schema_with = "arms")]
    pub arm: String,
    /// Factor on the deviations.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub scale: f64,
}

impl Default for CalibrationBlock {
    fn default() -> Self {
        Self {
            arm: "population".to_owned(),
            scale: 1.0,
        }
    }
}

/// Encoders of the joints.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct EncoderBlock {
    /// Angle between two readings per joint, deg. Assumed: 17 bit, since UR publishes none.
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub resolution_deg: [f64; 6],
    /// Standard deviation of one reading, deg, independent from step to step. Assumed.
    #[schemars(inner(range(min = 0.0, max = 0.1)))]
    pub noise_deg: [f64; 6],
    /// Standard deviation of the zero of each joint, deg. Assumed: none, since a factory calibration
    /// contains it.
    #[schemars(inner(range(min = 0.0, max = 2.0)))]
    pub zero_spread_deg: [f64; 6],
}

impl Default for EncoderBlock {
    fn default() -> Self {
        Self {
            resolution_deg: [360.0 / 131_072.0; JOINT_COUNT],
            noise_deg: [0.0005; JOINT_COUNT],
            zero_spread_deg: [0.0; JOINT_COUNT],
        }
    }
}

/// Elasticity of the gears.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ElasticityBlock {
    /// Torsional stiffness of each joint, N m/rad; the arm's own if left out.
    #[schemars(inner(range(min = 100.0, max = 1e9)))]
    pub stiffness_nm_rad: Option<[f64; 6]>,
    /// Relative standard deviation of each joint's compliance. Assumed.
    #[schemars(range(min = 0.0, max = 0.3), extend("x-hint" = "it is a share: 15 % are 0.15"))]
    pub spread: f64,
}

impl Default for ElasticityBlock {
    fn default() -> Self {
        Self {
            stiffness_nm_rad: None,
            spread: 0.2,
        }
    }
}

/// Error of the controller's belief about the tool: true minus believed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PayloadBlock {
    /// Mean error of the mass, kg.
    #[schemars(range(min = -3.0, max = 3.0))]
    pub mass_error_kg: f64,
    /// Standard deviation of the mass, kg. Assumed: a kitchen scale and some cable.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub mass_spread_kg: f64,
    /// Mean error of the centre of mass in the flange frame, mm.
    #[schemars(inner(range(min = -300.0, max = 300.0)))]
    pub com_error_mm: [f64; 3],
    /// Standard deviation of the centre of mass on each axis, mm. Assumed.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub com_spread_mm: f64,
}

impl Default for PayloadBlock {
    fn default() -> Self {
        Self {
            mass_error_kg: 0.0,
            mass_spread_kg: 0.02,
            com_error_mm: [0.0; 3],
            com_spread_mm: 5.0,
        }
    }
}

/// Friction of the joints, by the LuGre model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FrictionBlock {
    /// Sliding friction per joint, N m; the arm's own if left out, like the next five.
    #[schemars(inner(range(min = 0.0, max = 50.0)))]
    pub coulomb_nm: Option<[f64; 6]>,
    /// Break-away torque per joint, N m.
    #[schemars(inner(range(min = 0.0, max = 60.0)))]
    pub stiction_nm: Option<[f64; 6]>,
    /// Speed at which the break-away torque has fallen off to 1/e, deg/s.
    #[schemars(inner(range(min = 0.01, max = 100.0)))]
    pub stribeck_deg_s: Option<[f64; 6]>,
    /// Viscous friction per joint, N m s/rad.
    #[schemars(inner(range(min = 0.0, max = 100.0)))]
    pub viscous_nms_rad: Option<[f64; 6]>,
    /// Stiffness of the contact before it slips per joint, N m/rad.
    #[schemars(inner(range(min = 100.0, max = 1e7)))]
    pub bristle_stiffness_nm_rad: Option<[f64; 6]>,
    /// Damping of the contact before it slips per joint, N m s/rad.
    #[schemars(inner(range(min = 0.0, max = 1e4)))]
    pub bristle_damping_nms_rad: Option<[f64; 6]>,
    /// Share of the believed friction that the controller compensates while a joint moves, 0 to 1.
    /// Assumed.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub compensation: f64,
    /// Relative standard deviation of each joint's friction about the believed one. Assumed.
    #[schemars(range(min = 0.0, max = 0.3), extend("x-hint" = "it is a share: 15 % are 0.15"))]
    pub spread: f64,
}

impl Default for FrictionBlock {
    fn default() -> Self {
        Self {
            coulomb_nm: None,
            stiction_nm: None,
            stribeck_deg_s: None,
            viscous_nms_rad: None,
            bristle_stiffness_nm_rad: None,
            bristle_damping_nms_rad: None,
            compensation: 0.9,
            spread: 0.15,
        }
    }
}

/// Torques that the drives can give.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TorqueLimitsBlock {
    /// Highest torque of each joint's drive, N m.
    #[schemars(inner(range(min = 0.1, max = 1000.0)))]
    pub drive_nm: [f64; 6],
}

/// Rate and age of the set-points, and delay of the servo.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ControlBlock {
    /// Time between two set-points, ms; that of the arm's controller if left out. The servo joins them
    /// by straight lines in joint space.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub period_ms: Option<f64>,
    /// Age of a set-point when it arrives, ms. Assumed.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub delay_ms: f64,
    /// Delay from measurement to torque, ms. Assumed: none beyond the servo's own step.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub torque_delay_ms: f64,
}

impl Default for ControlBlock {
    fn default() -> Self {
        Self {
            period_ms: None,
            delay_ms: 2.0,
            torque_delay_ms: 0.0,
        }
    }
}

/// Play of the needle in its guide.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GuideBlock {
    /// Bore minus needle, mm; from the tool and its needle if left out. At each end of the guide
    /// the needle's axis lies anywhere in a disc of this diameter, uniformly. Assumed.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub diametral_clearance_mm: Option<f64>,
}

/// Registration of the phantom by markers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RegistrationBlock {
    /// Markers in the phantom frame (left, posterior, superior), mm. Default: six about the front
    /// of the chest.
    #[schemars(length(min = 3), extend("x-hint" = "a rigid registration needs three that are not on one line"), inner(inner(range(min = -2000.0, max = 2000.0))))]
    pub markers_mm: Vec<[f64; 3]>,
    /// Root mean square distance between a marker's place and where it is seen (fiducial
    /// localisation error), mm. Assumed: a third of a CT voxel and as much again of a tracker.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub localisation_error_mm: f64,
}

impl Default for RegistrationBlock {
    fn default() -> Self {
        Self {
            markers_mm: vec![
                [-110.0, -90.0, -90.0],
                [110.0, -90.0, -90.0],
                [-130.0, -70.0, 80.0],
                [130.0, -70.0, 80.0],
                [0.0, -115.0, -120.0],
                [0.0, -110.0, 110.0],
            ],
            localisation_error_mm: 0.5,
        }
    }
}

/// Breathing of the phantom.
///
/// Skin and lesion move by their amplitudes times `sin^4(pi phase)` (Lujan et al., Med. Phys. 26(5),
/// 1999): at rest at phase 0, the end of expiration, where the plan is made, and farthest at 0.5.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct BreathingBlock {
    /// Motion of the skin from expiration to inspiration, phantom frame (left, posterior,
    /// superior), mm. Assumed: quiet breathing.
    #[schemars(inner(range(min = -60.0, max = 60.0)))]
    pub skin_mm: [f64; 3],
    /// Motion of the target from expiration to inspiration, phantom frame, mm. Assumed: a lesion in
    /// the lower lung, quiet breathing.
    #[schemars(inner(range(min = -60.0, max = 60.0)))]
    pub target_mm: [f64; 3],
    /// Time of one breath, s.
    #[schemars(range(min = 0.5, max = 60.0))]
    pub period_s: f64,
    /// Mean phase at which the needle goes in; 0 is the end of expiration.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub phase: f64,
    /// Standard deviation of that phase: how well it is met. `free = true` leaves it uniform.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub phase_spread: f64,
    /// The needle goes in at any phase.
    pub free: bool,
}

impl Default for BreathingBlock {
    fn default() -> Self {
        Self {
            skin_mm: [0.0, -5.0, 0.0],
            target_mm: [0.0, -2.0, -8.0],
            period_s: 4.0,
            phase: 0.0,
            phase_spread: 0.08,
            free: false,
        }
    }
}

fn arms(_: &mut SchemaGenerator) -> Schema {
    let shipped = Arm::shipped_calibrations().into_iter();
    let names = shipped.map(|(name, _)| name);
    let names = names.chain(["population".to_owned()]);
    names_or_path(&names.collect::<Vec<_>>())
}

/// Blocks that contradict themselves.
pub(super) fn check(toml: &TomlText<'_>, section: &ImperfectionsSection) -> Vec<Finding> {
    let mut findings = Vec::new();
    if let Some(block) = &section.registration {
        let key = "imperfections.registration.markers_mm";
        if is_on_a_line(&block.markers_mm) {
            findings.push(
                toml.finding(key, "the markers lie on one line")
                    .hint("the phantom could turn about it: move one of them away"),
            );
        }
    }
    findings
}

/// Sine of the angle between two edges below which markers count as on a line.
const LINE_SINE: f64 = 0.01;

fn is_on_a_line(markers_mm: &[[f64; 3]]) -> bool {
    let points = markers_mm.iter().map(|mm| nalgebra::Vector3::from(*mm));
    let first = nalgebra::Vector3::from(markers_mm[0]);
    let edges: Vec<_> = points.map(|point| point - first).collect();
    let longest = edges
        .iter()
        .max_by(|a, b| a.norm().total_cmp(&b.norm()))
        .copied()
        .unwrap_or_default();
    edges
        .iter()
        .all(|edge| edge.cross(&longest).norm() <= LINE_SINE * longest.norm_squared())
}
