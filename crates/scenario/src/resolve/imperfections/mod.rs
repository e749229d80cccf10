//! Imperfections in SI units, with what they name read.

mod absorbed;
mod arms;
mod breathing;
mod localised;
mod needle;

use nalgebra::Vector3;
use needlebench_kinematics::Joints;

pub use absorbed::AbsorbedSag;
pub use arms::{ArmPopulation, OriginDeviations};
pub(crate) use arms::{RealArms, resolve_calibration};
pub use breathing::Breathing;
pub(crate) use breathing::RecordedBreath;
pub use localised::{Localisation, Markers, TargetLocalisation};
pub use needle::{
    Aim, Bends, Cantilever, Carried, NeedleBending, NeedleDraw, NeedlePath, TissueError,
    TissueNeedle, Turn, bend_at_m, bends_along_m,
};
pub use needlebench_cell::GearTwist;

pub use super::arm_values::JointFriction;
use super::arm_values::{joint_friction, set_point_period_ms};
use crate::scenario::ImperfectionsSection;
pub use crate::scenario::{ArmClass, BreathState, CalibrationBlock};
use needle::needle_bending;
use needlebench_cell::Tool;
use needlebench_input::{Finding, ModelSource, TomlText};
use needlebench_robot::LoadedRobot;
use std::path::Path;
use std::sync::Arc;

/// The imperfections in SI units, with what they name resolved.
#[derive(Debug, Clone, PartialEq)]
pub struct Imperfections {
    /// Samples of the error budget in a run.
    pub budget_samples: usize,
    /// Distribution of the real arm's joint origins.
    pub calibration: Option<ArmPopulation>,
    /// Encoders.
    pub encoder: Option<EncoderSpread>,
    /// Twist of the gears.
    pub elasticity: Option<Elasticity>,
    /// Error of the believed tool.
    pub payload: Option<PayloadSpread>,
    /// Friction as modelled in the controller.
    pub friction: Option<JointFriction>,
    /// Highest torques of the drives, N m.
    pub drive_limit_nm: Option<Joints>,
    /// Set-points: period, delay and torque delay, s.
    pub control: Option<[f64; 3]>,
    /// Diametral clearance of the needle in its guide, m.
    pub guide_clearance_m: Option<f64>,
    /// Place of the robot's base.
    pub hand_eye: Option<HandEye>,
    /// Markers, and how well they are localised.
    pub registration: Option<Markers>,
    /// Motion of the markers.
    pub skin_markers: Option<SkinMarkers>,
    /// How well the target is localised in the image.
    pub imaging: Option<TargetLocalisation>,
    /// Bending of the needle.
    pub needle: Option<NeedleBending>,
    /// Motion of skin and target along the insertion.
    pub indentation: Option<Indentation>,
    /// Breathing.
    pub breathing: Option<Breathing>,
    /// Files that were read.
    pub sources: Vec<ModelSource>,
}

impl Imperfections {
    /// The needle, if it bends in tissue.
    pub fn tissue(&self) -> Option<&TissueNeedle> {
        match &self.needle {
            Some(NeedleBending::Tissue(needle)) => Some(needle),
            _ => None,
        }
    }

    /// A needle in tissue bends as it would in air instead.
    pub(crate) fn bend_in_air(&mut self) {
        if let Some(NeedleBending::Tissue(needle)) = &self.needle {
            self.needle = Some(NeedleBending::Cantilever(needle.in_air()));
        }
    }

    /// Nothing imperfect.
    pub(crate) fn none() -> Self {
        Self {
            budget_samples: 0,
            calibration: None,
            encoder: None,
            elasticity: None,
            payload: None,
            friction: None,
            drive_limit_nm: None,
            control: None,
            guide_clearance_m: None,
            hand_eye: None,
            registration: None,
            skin_markers: None,
            imaging: None,
            needle: None,
            indentation: None,
            breathing: None,
            sources: Vec::new(),
        }
    }
}

/// Elasticity of the gears.
#[derive(Debug, Clone, PartialEq)]
pub struct Elasticity {
    /// How they twist.
    pub gears: GearTwist,
    /// Relative standard deviation of each joint's compliance.
    pub spread: f64,
    /// What a calibration that was measured on the sagging arm took for geometry; none if there was no such
    /// calibration.
    pub absorbed: Option<Arc<AbsorbedSag>>,
}

/// Error of the robot's base.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HandEye {
    /// Standard deviation along each axis, m.
    pub translation_m: f64,
    /// Standard deviation about each axis, rad, about the phantom's origin.
    pub rotation_rad: f64,
}

/// Markers that move with the skin.
#[derive(Debug, Clone, PartialEq)]
pub struct SkinMarkers {
    /// The markers, and how they are localised: the fit weighs them by that alone.
    pub markers: Markers,
    /// Standard deviation of each along each axis, m.
    pub shift_m: f64,
    /// Their common motion.
    pub breathing: Breathing,
}

/// Motion of skin and target along the insertion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Indentation {
    /// Mean, of skin and target, m.
    pub mean_m: [f64; 2],
    /// Standard deviation, of skin and target, m.
    pub spread_m: [f64; 2],
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

/// Samples of the Monte Carlo in a run unless the scenario says.
const DEFAULT_BUDGET_SAMPLES: u32 = 2000;

/// What the sections of a scenario leave to its robot and its tool.
pub(crate) struct Given<'a> {
    pub toml: &'a TomlText<'a>,
    /// Key of the needle's block.
    pub needle_place: &'a str,
    /// Folder that files are relative to.
    pub base: &'a Path,
    pub robot: &'a LoadedRobot,
    pub tool: &'a Tool,
    pub timestep_ms: f64,
    /// Real arms of the calibration block.
    pub arms: Option<&'a RealArms>,
    /// Recordings of the breathing block.
    pub recorded: Option<&'a RecordedBreath>,
}

/// Resolves the section.
pub(crate) fn resolve_imperfections(
    given: &Given<'_>,
    section: &ImperfectionsSection,
    elasticity: Option<Elasticity>,
    notes: &mut Vec<String>,
) -> Result<Imperfections, Finding> {
    let Given {
        toml,
        needle_place,
        base,
        robot,
        tool,
        timestep_ms,
        arms,
        recorded,
    } = *given;
    let bore_clearance_m = tool.bore_m - tool.needle.outer_diameter_m;
    let joints = Joints::from_column_slice;
    let breathing = section.breathing.as_ref();
    let breathing = breathing.map(|block| Breathing::new(toml, block, recorded, notes));
    let registration = section.registration.as_ref().map(Markers::new);
    let skin_markers = section.skin_markers.as_ref().zip(registration.as_ref());
    let skin_markers = skin_markers
        .zip(breathing)
        .map(|((block, markers), breathing)| SkinMarkers {
            markers: markers.clone(),
            shift_m: block.shift_mm * 1e-3,
            breathing: breathing.of_markers(block.phase_spread),
        });
    let guide_clearance_m = section.guide.as_ref().map(|block| {
        block
            .diametral_clearance_mm
            .map_or(bore_clearance_m, |mm| mm * 1e-3)
    });
    let mut sources = arms.map(|arms| arms.sources.clone()).unwrap_or_default();
    sources.extend(
        recorded
            .iter()
            .flat_map(|recorded| recorded.sources.iter().cloned()),
    );
    let needle = section.needle.as_ref().map(|block| {
        let play_m = 0.5 * guide_clearance_m.unwrap_or(0.0);
        needle_bending(toml, needle_place, block, tool, play_m, base, &mut sources)
    });
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
        elasticity,
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
        guide_clearance_m,
        hand_eye: section.hand_eye.as_ref().map(|block| HandEye {
            translation_m: block.translation_mm * 1e-3,
            rotation_rad: block.rotation_deg.to_radians(),
        }),
        registration,
        skin_markers,
        imaging: section.imaging.as_ref().map(TargetLocalisation::new),
        needle: needle.transpose()?,
        indentation: section.indentation.as_ref().map(|block| Indentation {
            mean_m: [block.skin_mm, block.target_mm].map(|mm| mm * 1e-3),
            spread_m: [block.skin_spread_mm, block.target_spread_mm].map(|mm| mm * 1e-3),
        }),
        breathing,
        sources,
    })
}
