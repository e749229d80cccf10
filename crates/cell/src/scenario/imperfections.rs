//! How the real arm and the real phantom differ from what the controller believes.
//!
//! Each effect is a block of its own under `[imperfections]`, off unless it is there. A block says
//! what is *known* of the effect (which every arm has) and what is *uncertain* (one draw per arm or
//! per patient). A run uses one draw, made from the scenario's seed; the error budget uses the
//! distribution.

mod measured;

use needlebench_kinematics::JOINT_COUNT;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Serialize};

use super::models::names_or_path;
use crate::Finding;
use crate::arm::Arm;
use crate::toml_text::TomlText;

pub use measured::CovarianceMm2;
pub(crate) use measured::covariance_m2;

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
    /// Place of the robot's base in terms of the CT or tracker that sees the markers.
    pub hand_eye: Option<HandEyeBlock>,
    /// Registration of the phantom by markers.
    pub registration: Option<RegistrationBlock>,
    /// Motion of the markers with the skin that they stick to.
    pub skin_markers: Option<SkinMarkersBlock>,
    /// Localisation of the target in the image.
    pub imaging: Option<ImagingBlock>,
    /// Bending of the needle in tissue.
    pub needle: Option<NeedleBlock>,
    /// Tissue that gives way under needle, hand and guide.
    pub indentation: Option<IndentationBlock>,
    /// Breathing of the phantom.
    pub breathing: Option<BreathingBlock>,
}

/// What the controller knows of its arm's joint origins.
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
pub enum ArmClass {
    /// It knows the maker's calibration of this arm, measured without a tool: what it does not know is what
    /// that calibration leaves, and what moves with the load. The default.
    #[default]
    FactoryCalibrated,
    /// Inverse kinematics are computed elsewhere, with nominal lengths: the arm is off by all that its
    /// calibration would say.
    NominalKinematics,
    /// The calibration that the scenario has, measured in place and with the tool on: what it does not know
    /// is what that leaves.
    CalibratedHere,
}

impl ArmClass {
    /// Name in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::FactoryCalibrated => "factory_calibrated",
            Self::NominalKinematics => "nominal_kinematics",
            Self::CalibratedHere => "calibrated_here",
        }
    }
}

/// Whether the patient's breath is held while the needle goes in.
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
pub enum BreathState {
    /// Held near the end of expiration, but for the holds that fail.
    #[default]
    Hold,
    /// The needle goes in at any phase.
    Free,
}

/// Of which arm and patient the expected tip error is, where there are no `[imperfections]`: those of all
/// default blocks.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ExpectedSection {
    /// What the controller knows of its arm; `calibrated_here` if the scenario has a calibration, else
    /// `factory_calibrated`.
    pub arm: Option<ArmClass>,
    /// Whether the breath is held.
    pub breath: BreathState,
    /// Markers with their measured covariances, instead of the assumed ones. They hold the robot's own error in
    /// touching them: there is no hand-eye calibration beside them.
    pub registration: Option<RegistrationBlock>,
    /// The target's measured covariance, instead of the assumed one.
    pub imaging: Option<ImagingBlock>,
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
    /// What the controller knows of them; `nominal_kinematics` if `arm` names one arm, else
    /// `factory_calibrated`.
    pub class: Option<ArmClass>,
    /// Share of the population's deviations, about none, that a calibration leaves: of
    /// `factory_calibrated` and `calibrated_here`. Assumed: a fifth, which is 0.3 mm at a tip 200 mm in front
    /// of the flange; UR publishes no figure.
    #[schemars(range(min = 0.0, max = 1.0), extend("x-hint" = "it is a share: 20 % are 0.2"))]
    pub residual: f64,
    /// The calibration was measured on an arm that sags under its own weight, and has taken for geometry
    /// what sag looks like it: that part is not counted again with `elasticity`.
    pub measured_under_gravity: bool,
}

/// Value of `arm` for the distribution of all arms in the data.
pub(crate) const POPULATION: &str = "population";

impl CalibrationBlock {
    /// What the controller knows of its arm.
    pub(crate) fn class(&self) -> ArmClass {
        self.class.unwrap_or(if self.arm == POPULATION {
            ArmClass::FactoryCalibrated
        } else {
            ArmClass::NominalKinematics
        })
    }
}

impl Default for CalibrationBlock {
    fn default() -> Self {
        Self {
            arm: POPULATION.to_owned(),
            scale: 1.0,
            class: None,
            residual: 0.2,
            measured_under_gravity: true,
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
    /// Torsional stiffness of each joint at every torque, N m/rad; if left out the arm's own, which grows
    /// with the torque where its data say so.
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
///
/// How well the markers are localised is assumed, the same for all (`localisation_error_mm`), or was measured, for
/// each of them (`covariance_mm2`). The controller then weighs each marker by the inverse of its covariance.
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
    /// Measured covariance of each of `markers_mm`, in their order, `[xx, yy, zz, xy, xz, yz]` in the phantom
    /// frame, mm^2, instead of `localisation_error_mm`: of its place in the scan, plus that of its place as the
    /// robot has it (by drawing, or touched with the tip).
    #[schemars(length(min = 3), inner(inner(range(min = -10000.0, max = 10000.0))))]
    pub covariance_mm2: Option<Vec<CovarianceMm2>>,
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
            covariance_mm2: None,
        }
    }
}

/// Place of the robot's base in terms of the CT or tracker that sees the markers: the hand-eye calibration.
///
/// The error is a rotation about the phantom's origin (mid-chest, where such a calibration is made to be
/// good) and a translation, independent and equal along all axes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct HandEyeBlock {
    /// Standard deviation of the place along each axis, mm. Assumed: a tracker with 0.25 mm rms at a
    /// marker, seen in a dozen places, and the arm's own errors while it is seen.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub translation_mm: f64,
    /// Standard deviation of the rotation about each axis, deg. Assumed.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub rotation_deg: f64,
}

impl Default for HandEyeBlock {
    fn default() -> Self {
        Self {
            translation_mm: 0.3,
            rotation_deg: 0.05,
        }
    }
}

/// Markers that move with the skin they stick to, between the image and the moment they are seen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SkinMarkersBlock {
    /// Standard deviation of each marker's motion along each axis, mm, independent of the others: skin
    /// that shifts on what lies under it. Assumed.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub shift_mm: f64,
    /// All markers rise together with the `skin_mm` of `[imperfections.breathing]`, at a phase of their
    /// own: standard deviation of that phase about the end of expiration. Assumed: as well met as the
    /// needle's.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub phase_spread: f64,
}

impl Default for SkinMarkersBlock {
    fn default() -> Self {
        Self {
            shift_mm: 0.5,
            phase_spread: 0.08,
        }
    }
}

/// Where the target is seen in the image.
///
/// Each axis of the target is uniform within half a voxel, and off by what the reader's choice of its
/// centre is off: assumed. Or how well its centre is known was measured (`covariance_mm2`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ImagingBlock {
    /// Size of a voxel along the phantom's axes (left, posterior, superior), mm; the last is the slice's
    /// thickness. Assumed: a chest CT for an intervention.
    #[schemars(inner(range(min = 0.01, max = 20.0)))]
    pub voxel_mm: [f64; 3],
    /// Standard deviation of the chosen centre of the target along each axis, mm. Assumed.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub reader_mm: f64,
    /// Measured covariance of the target's centre, `[xx, yy, zz, xy, xz, yz]` in the phantom frame, mm^2,
    /// instead of `voxel_mm` and `reader_mm`.
    #[schemars(inner(range(min = -10000.0, max = 10000.0)))]
    pub covariance_mm2: Option<CovarianceMm2>,
}

impl Default for ImagingBlock {
    fn default() -> Self {
        Self {
            voxel_mm: [0.7, 0.7, 2.0],
            reader_mm: 0.3,
            covariance_mm2: None,
        }
    }
}

/// Bending of the needle: a force across its tip, from the bevel, on a beam that the guide holds.
///
/// An Euler-Bernoulli cantilever from the guide's exit to the tip, `delta = F L^3 / (3 E I)`, the model of a
/// concentrated force at the bevel that mechanics of needle steering begin with (Misra et al., Int. J.
/// Robotics Research 29(13), 2010), without the tissue that supports the shaft: an upper estimate for the
/// force. The bevel points anywhere.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct NeedleBlock {
    /// Root mean square of the force across the tip, N. Assumed: 1 mm at the end of an 18 G needle with
    /// its stylet, 90 mm from the guide. Radiologists report at most 5.3 mm of unwanted bending, on average
    /// (de Jong et al., Medical Devices 11, 2018, 259-265).
    #[schemars(range(min = 0.0, max = 10.0))]
    pub side_force_n: f64,
    /// Young's modulus of the needle, GPa: stainless steel.
    #[schemars(range(min = 1.0, max = 500.0))]
    pub young_gpa: f64,
    /// Diameter of the needle's bore, mm; 0 with its stylet in, as it goes in.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub bore_mm: f64,
}

impl Default for NeedleBlock {
    fn default() -> Self {
        Self {
            side_force_n: 0.1,
            young_gpa: 200.0,
            bore_mm: 0.0,
        }
    }
}

/// Tissue that gives way along the needle, under needle, hand and guide.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct IndentationBlock {
    /// Mean motion of the skin along the insertion, mm. Assumed.
    #[schemars(range(min = 0.0, max = 30.0))]
    pub skin_mm: f64,
    /// Standard deviation of it, mm. Assumed.
    #[schemars(range(min = 0.0, max = 30.0))]
    pub skin_spread_mm: f64,
    /// Mean motion of the target, mm. Assumed: a fraction of the skin's.
    #[schemars(range(min = 0.0, max = 30.0))]
    pub target_mm: f64,
    /// Standard deviation of it, mm. Assumed.
    #[schemars(range(min = 0.0, max = 30.0))]
    pub target_spread_mm: f64,
}

impl Default for IndentationBlock {
    fn default() -> Self {
        Self {
            skin_mm: 2.0,
            skin_spread_mm: 1.0,
            target_mm: 0.5,
            target_spread_mm: 0.5,
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
    /// Share of holds that fail: the needle then goes in at any phase. Assumed.
    #[schemars(range(min = 0.0, max = 1.0), extend("x-hint" = "it is a share: 5 % are 0.05"))]
    pub hold_failure: f64,
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
            hold_failure: 0.05,
            free: false,
        }
    }
}

fn arms(_: &mut SchemaGenerator) -> Schema {
    let shipped = Arm::shipped_calibrations().into_iter();
    let names = shipped.map(|(name, _)| name);
    let names = names.chain([POPULATION.to_owned()]);
    names_or_path(&names.collect::<Vec<_>>())
}

impl ImperfectionsSection {
    /// Every block with its defaults, of an arm of which the controller knows this, and of a patient who
    /// breathes like that.
    pub fn of_class(class: ArmClass, breath: BreathState) -> Self {
        Self {
            budget_samples: None,
            calibration: Some(CalibrationBlock {
                class: Some(class),
                ..CalibrationBlock::default()
            }),
            encoder: Some(EncoderBlock::default()),
            elasticity: Some(ElasticityBlock::default()),
            payload: Some(PayloadBlock::default()),
            friction: Some(FrictionBlock::default()),
            torque_limits: None,
            control: None,
            guide: Some(GuideBlock::default()),
            hand_eye: Some(HandEyeBlock::default()),
            registration: Some(RegistrationBlock::default()),
            skin_markers: Some(SkinMarkersBlock::default()),
            imaging: Some(ImagingBlock::default()),
            needle: Some(NeedleBlock::default()),
            indentation: Some(IndentationBlock::default()),
            breathing: Some(BreathingBlock {
                free: breath == BreathState::Free,
                ..BreathingBlock::default()
            }),
        }
    }
}

/// What is measured, of the expected tip error.
pub(super) fn check_expected(toml: &TomlText<'_>, scenario: &super::Scenario) -> Vec<Finding> {
    let section = &scenario.expected;
    let mut findings = Vec::new();
    if let Some(block) = &section.registration {
        findings.extend(measured::check_markers(
            toml,
            "expected.registration",
            block,
        ));
    }
    if let Some(block) = &section.imaging {
        findings.extend(measured::check_target(toml, "expected.imaging", block));
    }
    let measured = [
        ("registration", section.registration.is_some()),
        ("imaging", section.imaging.is_some()),
    ];
    for (block, _) in measured.into_iter().filter(|(_, given)| *given) {
        if scenario.imperfections.is_some() {
            let key = format!("expected.{block}");
            let finding = toml.finding(&key, format!("`{block}` contradicts [imperfections]"));
            findings.push(finding.hint(format!(
                "the expected tip error is of the [imperfections]: write it as [imperfections.{block}]"
            )));
        }
    }
    findings
}

/// Blocks that contradict themselves.
pub(super) fn check(toml: &TomlText<'_>, section: &ImperfectionsSection) -> Vec<Finding> {
    let mut findings = Vec::new();
    if section.skin_markers.is_some() {
        for (other, given) in [
            ("registration", section.registration.is_some()),
            ("breathing", section.breathing.is_some()),
        ] {
            if !given {
                let key = "imperfections.skin_markers";
                let lack = format!("markers that move need `[imperfections.{other}]` beside them");
                findings.push(toml.finding(key, lack).hint(
                    "the markers' places stand under `registration`, the skin's motion under `breathing`",
                ));
            }
        }
    }
    if let Some(block) = &section.calibration
        && block.class() != ArmClass::NominalKinematics
        && block.arm != POPULATION
    {
        let (arm, class) = (&block.arm, block.class().name());
        findings.push(
            toml.finding(
                "imperfections.calibration.arm",
                format!("`{arm}` is one real arm, of which a {class} controller knows the origins"),
            )
            .hint("`class = \"nominal_kinematics\"` for a controller that knows nominal lengths alone"),
        );
    }
    if let Some(block) = &section.registration {
        let key = "imperfections.registration.markers_mm";
        if is_on_a_line(&block.markers_mm) {
            findings.push(
                toml.finding(key, "the markers lie on one line")
                    .hint("the phantom could turn about it: move one of them away"),
            );
        }
        findings.extend(measured::check_markers(
            toml,
            "imperfections.registration",
            block,
        ));
    }
    if let Some(block) = &section.imaging {
        findings.extend(measured::check_target(toml, "imperfections.imaging", block));
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
