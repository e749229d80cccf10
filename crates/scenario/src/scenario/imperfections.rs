//! Deviations of the real arm and patient from the controller's model.
//!
//! Each effect is a block of its own under `[imperfections]`, off unless present. A block states what is *known* of the
//! effect (the same for every arm) and what is *uncertain* (one draw per arm or per patient). A run uses one draw, made
//! from the scenario's seed; the error budget uses the distribution.

mod breathing;
mod measured;
mod needle;

use needlebench_input::{Finding, TomlText};
use needlebench_kinematics::JOINT_COUNT;
use needlebench_robot::Arm;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Serialize};

use super::models::names_or_path;

pub use breathing::BreathingBlock;
pub use measured::CovarianceMm2;
pub(crate) use needle::{BevelFace, IN_EXPECTED, IN_IMPERFECTIONS, SIDE_FORCE_N};
pub use needle::{
    ForcesBlock, MeasuredForce, NeedleBlock, NeedleModel, NeedleTip, StiffnessBlock, TurnAt,
};

pub(crate) use measured::covariance_m2;

/// Deviations of the real arm and patient from the nominal ones.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ImperfectionsSection {
    /// Monte Carlo samples of the error budget in a `run`; 0 for the analytic budget alone.
    #[schemars(range(min = 0, max = 10_000_000))]
    pub budget_samples: Option<u32>,
    /// Deviations of the joint origins, unknown to the controller.
    pub calibration: Option<CalibrationBlock>,
    /// Joint encoders.
    pub encoder: Option<EncoderBlock>,
    /// Joint (gear) elasticity; the arm deflects under its weight.
    pub elasticity: Option<ElasticityBlock>,
    /// Errors of the tool's mass and centre of mass in the controller.
    pub payload: Option<PayloadBlock>,
    /// Joint friction with stiction.
    pub friction: Option<FrictionBlock>,
    /// Torque limits of the drives, below those that the controller assumes.
    pub torque_limits: Option<TorqueLimitsBlock>,
    /// Period and latency of the set-points, and delay of the servo.
    pub control: Option<ControlBlock>,
    /// Play of the needle in its guide.
    pub guide: Option<GuideBlock>,
    /// Hand-eye calibration: pose of the robot base relative to the CT or tracker that localises the markers.
    pub hand_eye: Option<HandEyeBlock>,
    /// Registration of the phantom by markers.
    pub registration: Option<RegistrationBlock>,
    /// Motion of the markers with the skin.
    pub skin_markers: Option<SkinMarkersBlock>,
    /// Localisation of the target in the image.
    pub imaging: Option<ImagingBlock>,
    /// Needle bending in tissue.
    pub needle: Option<NeedleBlock>,
    /// Tissue deformation under needle, hand and guide.
    pub indentation: Option<IndentationBlock>,
    /// Breathing motion of the phantom.
    pub breathing: Option<BreathingBlock>,
}

/// The controller's knowledge of its arm's joint origins.
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
    /// The manufacturer's calibration of this arm, made without a tool, is applied; residual calibration error and
    /// load-dependent deflection remain. The default.
    #[default]
    FactoryCalibrated,
    /// Inverse kinematics are computed outside the controller with nominal lengths; the full calibration deviation is
    /// an error.
    NominalKinematics,
    /// The scenario's calibration, made on site with the tool mounted, is applied; the residual calibration error
    /// and the deflection that a calibration cannot represent remain.
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

/// Whether the patient holds the breath during needle insertion.
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
    /// Breath-hold near the end of expiration, except for the failed holds.
    #[default]
    Hold,
    /// Free breathing: insertion at any phase.
    Free,
}

/// Arm and patient population of the tip error where there are no `[imperfections]`: all blocks except `torque_limits`
/// and `control`, at their defaults.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ExpectedSection {
    /// The controller's knowledge of its arm. Default: `calibrated_here` if the scenario has a calibration, else
    /// `factory_calibrated`.
    pub arm: Option<ArmClass>,
    /// Breath-hold or free breathing: `hold` or `free`.
    pub breath: BreathState,
    /// Markers with measured covariances, instead of the assumed ones. They include the robot's own digitising error,
    /// so there is no hand-eye error in addition.
    pub registration: Option<RegistrationBlock>,
    /// Measured covariance of the target, instead of the assumed one.
    pub imaging: Option<ImagingBlock>,
    /// How the needle bends, instead of the assumed cantilever.
    pub needle: Option<NeedleBlock>,
}

/// Joint origins of the real arm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CalibrationBlock {
    /// `population`: an arm sampled from the normal distribution with mean and covariance of the factory calibrations
    /// in the arm's data. Or one real arm of a shipped arm's data by name, such as `ur3-1`, whose deviations from its
    /// nominal model are used; or the path of such a file relative to this one.
    #[schemars(schema_with = "arms")]
    pub arm: String,
    /// Scale factor of the deviations.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub scale: f64,
    /// The controller's knowledge of the deviations. Default: `nominal_kinematics` if `arm` names one arm, else
    /// `factory_calibrated`.
    pub class: Option<ArmClass>,
    /// Residual of the calibration for `factory_calibrated` and `calibrated_here`, as a share of the population's
    /// deviations, with zero mean. Assumed: a fifth, which is 0.3 mm at a tip 200 mm in front of the flange; UR
    /// publishes no figure.
    #[schemars(range(min = 0.0, max = 1.0), extend("x-hint" = "it is a share: 20 % are 0.2"))]
    pub residual: f64,
    /// Whether the calibration was measured on an arm deflected by its own weight, and so includes the part of the
    /// deflection that looks like geometry. That part is not counted again with `elasticity`.
    pub measured_under_gravity: bool,
}

/// Value of `arm` for the distribution of all arms in the data.
pub(crate) const POPULATION: &str = "population";

impl CalibrationBlock {
    /// The controller's knowledge of its arm.
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

/// Joint encoders.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct EncoderBlock {
    /// Resolution per joint, deg. Assumed: 17 bit, since UR publishes none.
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub resolution_deg: [f64; 6],
    /// Standard deviation of the noise per joint, deg, independent in every step. Assumed.
    #[schemars(inner(range(min = 0.0, max = 0.1)))]
    pub noise_deg: [f64; 6],
    /// Standard deviation of the zero offset per joint, deg. Assumed: none, since a factory calibration includes it.
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

/// Joint (gear) elasticity.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ElasticityBlock {
    /// Torsional stiffness per joint, the same at every torque, N m/rad. Default: the arm's, which increases with
    /// torque where its data say so.
    #[schemars(inner(range(min = 100.0, max = 1e9)))]
    pub stiffness_nm_rad: Option<[f64; 6]>,
    /// Relative standard deviation of the compliance per joint. Assumed.
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

/// Error of the tool's mass properties in the controller: true minus assumed value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PayloadBlock {
    /// Mean error of the mass, kg.
    #[schemars(range(min = -3.0, max = 3.0))]
    pub mass_error_kg: f64,
    /// Standard deviation of the mass, kg. Assumed: kitchen-scale accuracy and some cable.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub mass_spread_kg: f64,
    /// Mean error of the centre of mass in the flange frame, mm.
    #[schemars(inner(range(min = -300.0, max = 300.0)))]
    pub com_error_mm: [f64; 3],
    /// Standard deviation of the centre of mass per axis, mm. Assumed.
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

/// Joint friction (LuGre model).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FrictionBlock {
    /// Coulomb friction per joint, N m. Default of this and the next five: the arm's.
    #[schemars(inner(range(min = 0.0, max = 50.0)))]
    pub coulomb_nm: Option<[f64; 6]>,
    /// Break-away torque (stiction) per joint, N m.
    #[schemars(inner(range(min = 0.0, max = 60.0)))]
    pub stiction_nm: Option<[f64; 6]>,
    /// Stribeck velocity per joint, at which the excess of the break-away torque has decayed to 1/e, deg/s.
    #[schemars(inner(range(min = 0.01, max = 100.0)))]
    pub stribeck_deg_s: Option<[f64; 6]>,
    /// Viscous friction per joint, N m s/rad.
    #[schemars(inner(range(min = 0.0, max = 100.0)))]
    pub viscous_nms_rad: Option<[f64; 6]>,
    /// Bristle stiffness per joint before sliding, N m/rad.
    #[schemars(inner(range(min = 100.0, max = 1e7)))]
    pub bristle_stiffness_nm_rad: Option<[f64; 6]>,
    /// Bristle damping per joint before sliding, N m s/rad.
    #[schemars(inner(range(min = 0.0, max = 1e4)))]
    pub bristle_damping_nms_rad: Option<[f64; 6]>,
    /// Share of the modelled friction that the controller compensates while a joint moves, 0 to 1. Assumed.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub compensation: f64,
    /// Relative standard deviation of the friction per joint about the modelled value. Assumed.
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

/// Torque limits of the drives.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TorqueLimitsBlock {
    /// Maximum drive torque per joint, N m.
    #[schemars(inner(range(min = 0.1, max = 1000.0)))]
    pub drive_nm: [f64; 6],
}

/// Period and latency of the set-points, and delay of the servo.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ControlBlock {
    /// Set-point period, ms; the servo interpolates linearly in joint space. Default: that of the arm's controller.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub period_ms: Option<f64>,
    /// Latency of a set-point, ms. Assumed.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub delay_ms: f64,
    /// Delay from measurement to torque, ms. Assumed: none beyond the servo step.
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
    /// Diametral clearance between bore and needle, mm. Default: from the tool and its needle. Assumed: at each end of
    /// the guide the needle axis is uniformly distributed in a disc of this diameter.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub diametral_clearance_mm: Option<f64>,
}

/// Registration of the phantom by markers.
///
/// The marker localisation error is either assumed, equal for all (`localisation_error_mm`), or measured for each
/// (`covariance_mm2`). With measured covariances the registration weights each marker by the inverse of its covariance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RegistrationBlock {
    /// Marker positions in the phantom frame (left, posterior, superior), mm. Default: six on the anterior chest.
    #[schemars(length(min = 3), extend("x-hint" = "a rigid registration needs three that are not collinear"), inner(inner(range(min = -2000.0, max = 2000.0))))]
    pub markers_mm: Vec<[f64; 3]>,
    /// RMS fiducial localisation error (FLE): distance between true and localised marker position, mm. Assumed: a third
    /// of a CT voxel and the same again of a tracker.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub localisation_error_mm: f64,
    /// Measured covariance of each of `markers_mm`, in their order, `[xx, yy, zz, xy, xz, yz]` in the phantom frame,
    /// mm^2, instead of `localisation_error_mm`. It is the sum for the marker's position in the scan and for its
    /// position known to the robot (from a drawing, or digitised with the tip).
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

/// Hand-eye calibration: pose of the robot base relative to the CT or tracker that localises the markers.
///
/// The error is a rotation about the phantom's origin (mid-chest, for which such a calibration is optimised) and a
/// translation, independent and equal along all axes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct HandEyeBlock {
    /// Standard deviation of the translation per axis, mm. Assumed: a tracker with an RMS error of 0.25 mm per marker
    /// at a dozen positions, and the arm's own errors there.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub translation_mm: f64,
    /// Standard deviation of the rotation per axis, deg. Assumed.
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

/// Motion of the markers with the skin, between the scan and their localisation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SkinMarkersBlock {
    /// Standard deviation of each marker's shift per axis, mm, independent of the others: skin shifting over deeper
    /// tissue. Assumed.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub shift_mm: f64,
    /// Standard deviation of the breathing phase, about the end of expiration, at which the markers are localised. All
    /// markers move together by `skin_mm` of `[imperfections.breathing]`, at a phase independent of the needle's.
    /// Assumed: equal to the needle's.
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

/// Localisation of the target in the image.
///
/// Either assumed: a uniform error within half a voxel per axis, and the reader's error in choosing the centre. Or
/// measured: the covariance of the target's centre (`covariance_mm2`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ImagingBlock {
    /// Voxel size along the phantom's axes (left, posterior, superior), mm; the last is the slice thickness. Assumed: a
    /// chest CT for an intervention.
    #[schemars(inner(range(min = 0.01, max = 20.0)))]
    pub voxel_mm: [f64; 3],
    /// Standard deviation per axis of the target centre chosen by the reader, mm. Assumed.
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

/// Tissue deformation along the needle, under needle, hand and guide.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct IndentationBlock {
    /// Mean displacement of the skin along the insertion direction, mm. Assumed.
    #[schemars(range(min = 0.0, max = 30.0))]
    pub skin_mm: f64,
    /// Standard deviation of the skin displacement, mm. Assumed.
    #[schemars(range(min = 0.0, max = 30.0))]
    pub skin_spread_mm: f64,
    /// Mean displacement of the target, mm. Assumed: a fraction of the skin's.
    #[schemars(range(min = 0.0, max = 30.0))]
    pub target_mm: f64,
    /// Standard deviation of the target displacement, mm. Assumed.
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

fn arms(_: &mut SchemaGenerator) -> Schema {
    let shipped = Arm::shipped_calibrations().into_iter();
    let names = shipped.map(|(name, _)| name);
    let names = names.chain([POPULATION.to_owned()]);
    names_or_path(&names.collect::<Vec<_>>())
}

impl ImperfectionsSection {
    /// Every block with its defaults, for this knowledge of the controller and this breathing.
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

/// Checks what replaces blocks of the imperfections that the RMS tip error is predicted from.
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
    if let Some(block) = &section.needle {
        findings.extend(block.check(toml, IN_EXPECTED));
    }
    let given = [
        ("registration", section.registration.is_some()),
        ("imaging", section.imaging.is_some()),
        ("needle", section.needle.is_some()),
    ];
    for (block, _) in given.into_iter().filter(|(_, given)| *given) {
        if scenario.imperfections.is_some() {
            let key = format!("expected.{block}");
            let finding = toml.finding(&key, format!("`{block}` contradicts [imperfections]"));
            findings.push(finding.hint(format!(
                "the RMS tip error is computed from [imperfections]: write it as [imperfections.{block}]"
            )));
        }
    }
    findings
}

/// Checks for contradicting blocks.
pub(super) fn check(toml: &TomlText<'_>, section: &ImperfectionsSection) -> Vec<Finding> {
    let mut findings = Vec::new();
    if section.skin_markers.is_some() {
        for (other, given) in [
            ("registration", section.registration.is_some()),
            ("breathing", section.breathing.is_some()),
        ] {
            if !given {
                let key = "imperfections.skin_markers";
                let lack = format!("`skin_markers` requires `[imperfections.{other}]`");
                findings.push(toml.finding(key, lack).hint(
                    "`registration` gives the marker positions, `breathing` the motion of the skin",
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
                format!("`{arm}` is one real arm, whose joint origins a {class} controller knows"),
            )
            .hint("`class = \"nominal_kinematics\"` for a controller with nominal lengths only"),
        );
    }
    if let Some(block) = &section.registration {
        let key = "imperfections.registration.markers_mm";
        if is_on_a_line(&block.markers_mm) {
            findings.push(
                toml.finding(key, "the markers are collinear")
                    .hint("the rotation about their line is not determined: move one of them"),
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
    if let Some(block) = &section.needle {
        findings.extend(block.check(toml, IN_IMPERFECTIONS));
    }
    if let Some(block) = &section.breathing {
        findings.extend(block.check(toml));
    }
    findings
}

/// Sine of the angle between two edges below which markers count as collinear.
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
