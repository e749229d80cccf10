//! How the real arm and the real phantom differ from what the controller believes.
//!
//! Each effect is a block of its own under `[imperfections]`, off unless it is there. A block says
//! what is *known* of the effect (which every arm has) and what is *uncertain* (one draw per arm or
//! per patient). A run uses one draw, made from the scenario's seed; the error budget uses the
//! distribution.

use nalgebra::{Point3, Vector3};
use needlebench_kinematics::{JOINT_COUNT, Joints};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::parts::Library;
use crate::toml_text::TomlText;
use crate::{Finding, ModelSource};

mod arms;
mod checks;

pub use arms::ArmPopulation;
pub(crate) use arms::resolve_calibration;
pub(crate) use checks::check_imperfections;

/// How the real arm and phantom differ from the nominal ones.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ImperfectionsSection {
    /// Samples of the error budget's Monte Carlo in a `run`; 0 for the analytic budget alone.
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
    /// `population`: an arm drawn from the normal distribution with mean and covariance of nine
    /// real arms' factory calibrations; or one of them by name (`ur3-1` to `ur3-4`, `ur3e-1` to
    /// `ur3e-5`), of which the deviations from its nominal model are taken; or the path of such a
    /// file relative to this one.
    pub arm: String,
    /// Factor on the deviations.
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
    pub resolution_deg: [f64; 6],
    /// Standard deviation of one reading, deg, independent from step to step. Assumed.
    pub noise_deg: [f64; 6],
    /// Standard deviation of the zero of each joint, deg. Assumed: none, since a factory calibration
    /// contains it.
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
    /// Torsional stiffness of each joint, N m/rad. Assumed: the first stiffness that a maker of
    /// strain-wave gears gives for sizes 17, 14 and 11, whose repeated peak torques (54, 28, 11
    /// N m) are a UR3's joint torques.
    pub stiffness_nm_rad: [f64; 6],
    /// Relative standard deviation of each joint's compliance. Assumed.
    pub spread: f64,
}

impl Default for ElasticityBlock {
    fn default() -> Self {
        Self {
            stiffness_nm_rad: [10_000.0, 10_000.0, 4700.0, 2700.0, 2700.0, 2700.0],
            spread: 0.2,
        }
    }
}

/// Error of the controller's belief about the tool: true minus believed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PayloadBlock {
    /// Mean error of the mass, kg.
    pub mass_error_kg: f64,
    /// Standard deviation of the mass, kg. Assumed: a kitchen scale and some cable.
    pub mass_spread_kg: f64,
    /// Mean error of the centre of mass in the flange frame, mm.
    pub com_error_mm: [f64; 3],
    /// Standard deviation of the centre of mass on each axis, mm. Assumed.
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
    /// Sliding friction per joint, N m. Assumed: 6 % of the joint's torque limit.
    pub coulomb_nm: [f64; 6],
    /// Break-away torque per joint, N m. Assumed: a fifth more.
    pub stiction_nm: [f64; 6],
    /// Speed at which the break-away torque has fallen off to 1/e, deg/s. Assumed.
    pub stribeck_deg_s: [f64; 6],
    /// Viscous friction per joint, N m s/rad. Assumed.
    pub viscous_nms_rad: [f64; 6],
    /// Stiffness of the contact before it slips per joint, N m/rad. Assumed.
    pub bristle_stiffness_nm_rad: [f64; 6],
    /// Damping of the contact before it slips per joint, N m s/rad. Assumed.
    pub bristle_damping_nms_rad: [f64; 6],
    /// Share of the believed friction that the controller compensates while a joint moves, 0 to 1.
    /// Assumed.
    pub compensation: f64,
    /// Relative standard deviation of each joint's friction about the believed one. Assumed.
    pub spread: f64,
}

impl Default for FrictionBlock {
    fn default() -> Self {
        Self {
            coulomb_nm: [3.4, 3.4, 1.7, 0.7, 0.7, 0.7],
            stiction_nm: [4.1, 4.1, 2.0, 0.85, 0.85, 0.85],
            stribeck_deg_s: [1.0; JOINT_COUNT],
            viscous_nms_rad: [5.0, 5.0, 3.0, 1.0, 1.0, 1.0],
            bristle_stiffness_nm_rad: [40_000.0, 40_000.0, 30_000.0, 20_000.0, 20_000.0, 20_000.0],
            bristle_damping_nms_rad: [40.0, 40.0, 30.0, 20.0, 20.0, 20.0],
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
    pub drive_nm: [f64; 6],
}

/// Rate and age of the set-points, and delay of the servo.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ControlBlock {
    /// Time between two set-points, ms. Default: 125 Hz, the rate of a CB3 controller's real-time
    /// interface (UR, RTDE guide). The servo joins them by straight lines in joint space.
    pub period_ms: f64,
    /// Age of a set-point when it arrives, ms. Assumed.
    pub delay_ms: f64,
    /// Delay from measurement to torque, ms. Assumed: none beyond the servo's own step.
    pub torque_delay_ms: f64,
}

impl Default for ControlBlock {
    fn default() -> Self {
        Self {
            period_ms: 8.0,
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
    pub diametral_clearance_mm: Option<f64>,
}

/// Registration of the phantom by markers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RegistrationBlock {
    /// Markers in the phantom frame (left, posterior, superior), mm. Default: six about the front
    /// of the chest.
    pub markers_mm: Vec<[f64; 3]>,
    /// Root mean square distance between a marker's place and where it is seen (fiducial
    /// localisation error), mm. Assumed: a third of a CT voxel and as much again of a tracker.
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
    pub skin_mm: [f64; 3],
    /// Motion of the target from expiration to inspiration, phantom frame, mm. Assumed: a lesion in
    /// the lower lung, quiet breathing.
    pub target_mm: [f64; 3],
    /// Time of one breath, s.
    pub period_s: f64,
    /// Mean phase at which the needle goes in; 0 is the end of expiration.
    pub phase: f64,
    /// Standard deviation of that phase: how well it is met. `free = true` leaves it uniform.
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

/// The imperfections in SI units, with what they name resolved.
#[derive(Debug, Clone, PartialEq)]
pub struct Imperfections {
    /// Samples of the error budget in a run.
    pub budget_samples: usize,
    /// Distribution of the real arm's joint origins.
    pub calibration: Option<ArmPopulation>,
    /// Encoders.
    pub encoder: Option<EncoderSpread>,
    /// Compliance of the gears, rad/(N m), and its relative standard deviation.
    pub elasticity: Option<(Joints, f64)>,
    /// Error of the believed tool.
    pub payload: Option<PayloadSpread>,
    /// Friction as the controller believes it.
    pub friction: Option<FrictionBlock>,
    /// Highest torques of the drives, N m.
    pub drive_limit_nm: Option<Joints>,
    /// Set-points: period, delay and torque delay, s.
    pub control: Option<[f64; 3]>,
    /// Diametral clearance of the needle in its guide, m.
    pub guide_clearance_m: Option<f64>,
    /// Markers in the phantom frame and root mean square localisation error, m.
    pub registration: Option<(Vec<Point3<f64>>, f64)>,
    /// Breathing.
    pub breathing: Option<Breathing>,
    /// Files that were read.
    pub sources: Vec<ModelSource>,
}

/// Encoders, rad.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EncoderSpread {
    /// Angle between two readings.
    pub resolution_rad: Joints,
    /// Standard deviation of one reading.
    pub noise_rad: Joints,
    /// Standard deviation of the zero.
    pub zero_spread_rad: Joints,
}

/// Error of the believed tool: true minus believed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PayloadSpread {
    /// Mean error of the mass, kg.
    pub mass_error_kg: f64,
    /// Standard deviation of the mass, kg.
    pub mass_spread_kg: f64,
    /// Mean error of the centre of mass, flange frame, m.
    pub com_error_m: Vector3<f64>,
    /// Standard deviation of the centre of mass on each axis, m.
    pub com_spread_m: f64,
}

/// Breathing: displacement `amplitude * sin^4(pi phase)`, phantom frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Breathing {
    /// Motion of the skin from expiration to inspiration, m.
    pub skin_m: Vector3<f64>,
    /// Motion of the target, m.
    pub target_m: Vector3<f64>,
    /// Time of one breath, s.
    pub period_s: f64,
    /// Mean phase of the insertion.
    pub phase: f64,
    /// Standard deviation of the phase; none if it is uniform.
    pub phase_spread: Option<f64>,
}

/// Samples of the Monte Carlo in a run unless the scenario says.
const DEFAULT_BUDGET_SAMPLES: u32 = 2000;

/// Resolves the section; `bore_clearance_m` is the tool's bore minus its needle.
pub(crate) fn resolve_imperfections(
    toml: &TomlText<'_>,
    section: &ImperfectionsSection,
    folder: &std::path::Path,
    library: &Library,
    bore_clearance_m: f64,
) -> Result<Imperfections, Finding> {
    let joints = Joints::from_column_slice;
    let mut sources = Vec::new();
    let calibration = section
        .calibration
        .as_ref()
        .map(|block| library.arms(toml, block, folder))
        .transpose()?
        .map(|arms| {
            sources.extend(arms.1.iter().cloned());
            arms.0.clone()
        });
    Ok(Imperfections {
        budget_samples: section.budget_samples.unwrap_or(DEFAULT_BUDGET_SAMPLES) as usize,
        calibration,
        encoder: section.encoder.as_ref().map(|block| EncoderSpread {
            resolution_rad: joints(&block.resolution_deg.map(f64::to_radians)),
            noise_rad: joints(&block.noise_deg.map(f64::to_radians)),
            zero_spread_rad: joints(&block.zero_spread_deg.map(f64::to_radians)),
        }),
        elasticity: section.elasticity.as_ref().map(|block| {
            (
                joints(&block.stiffness_nm_rad.map(f64::recip)),
                block.spread,
            )
        }),
        payload: section.payload.as_ref().map(|block| PayloadSpread {
            mass_error_kg: block.mass_error_kg,
            mass_spread_kg: block.mass_spread_kg,
            com_error_m: Vector3::from(block.com_error_mm) * 1e-3,
            com_spread_m: block.com_spread_mm * 1e-3,
        }),
        friction: section.friction.clone(),
        drive_limit_nm: section
            .torque_limits
            .as_ref()
            .map(|block| joints(&block.drive_nm)),
        control: section.control.as_ref().map(|block| {
            [block.period_ms, block.delay_ms, block.torque_delay_ms].map(|ms| ms * 1e-3)
        }),
        guide_clearance_m: section.guide.as_ref().map(|block| {
            block
                .diametral_clearance_mm
                .map_or(bore_clearance_m, |mm| mm * 1e-3)
        }),
        registration: section.registration.as_ref().map(|block| {
            let markers = block.markers_mm.iter();
            let markers = markers.map(|mm| Point3::from(Vector3::from(*mm) * 1e-3));
            (markers.collect(), block.localisation_error_mm * 1e-3)
        }),
        breathing: section.breathing.as_ref().map(|block| Breathing {
            skin_m: Vector3::from(block.skin_mm) * 1e-3,
            target_m: Vector3::from(block.target_mm) * 1e-3,
            period_s: block.period_s,
            phase: block.phase,
            phase_spread: (!block.free).then_some(block.phase_spread),
        }),
        sources,
    })
}
