//! Imperfections in SI units, with what they name read.

mod arms;

use nalgebra::{Point3, Vector3};
use needlebench_kinematics::Joints;

pub use arms::ArmPopulation;
pub(crate) use arms::{RealArms, resolve_calibration};

pub use super::arm_values::JointFriction;
use super::arm_values::{gear_compliance, joint_friction, set_point_period_ms};
use crate::files::ModelSource;
pub use crate::scenario::CalibrationBlock;
use crate::scenario::ImperfectionsSection;
use crate::toml_text::TomlText;
use crate::{Finding, Robot};

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
    pub friction: Option<JointFriction>,
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

/// Resolves the section, with what it leaves to the robot's arm. `arms` are the real arms of its
/// calibration block, and `bore_clearance_m` is the tool's bore minus its needle.
pub(crate) fn resolve_imperfections(
    toml: &TomlText<'_>,
    section: &ImperfectionsSection,
    robot: &Robot,
    arms: Option<&RealArms>,
    bore_clearance_m: f64,
    timestep_ms: f64,
) -> Result<Imperfections, Finding> {
    let joints = Joints::from_column_slice;
    let elasticity = section.elasticity.as_ref();
    let friction = section.friction.as_ref();
    let control = section.control.as_ref();
    Ok(Imperfections {
        budget_samples: section.budget_samples.unwrap_or(DEFAULT_BUDGET_SAMPLES) as usize,
        calibration: arms.map(|arms| arms.population.clone()),
        encoder: section.encoder.as_ref().map(|block| EncoderSpread {
            resolution_rad: joints(&block.resolution_deg.map(f64::to_radians)),
            noise_rad: joints(&block.noise_deg.map(f64::to_radians)),
            zero_spread_rad: joints(&block.zero_spread_deg.map(f64::to_radians)),
        }),
        elasticity: elasticity
            .map(|block| Ok((gear_compliance(toml, block, robot)?, block.spread)))
            .transpose()?,
        payload: section.payload.as_ref().map(|block| PayloadSpread {
            mass_error_kg: block.mass_error_kg,
            mass_spread_kg: block.mass_spread_kg,
            com_error_m: Vector3::from(block.com_error_mm) * 1e-3,
            com_spread_m: block.com_spread_mm * 1e-3,
        }),
        friction: friction
            .map(|block| joint_friction(toml, block, robot))
            .transpose()?,
        drive_limit_nm: section
            .torque_limits
            .as_ref()
            .map(|block| joints(&block.drive_nm)),
        control: control
            .map(|block| {
                let period_ms = set_point_period_ms(toml, block, robot, timestep_ms)?;
                Ok([period_ms, block.delay_ms, block.torque_delay_ms].map(|ms| ms * 1e-3))
            })
            .transpose()?,
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
        sources: arms.map(|arms| arms.sources.clone()).unwrap_or_default(),
    })
}
