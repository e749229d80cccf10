//! The servo as its manufacturer would describe it: settings with their sources, the closed loop at a posture, and its
//! responses to steps and sines in the engines beside those of the linear loop.

pub mod experiment;
pub mod linear;
pub mod settings;

use nalgebra::ComplexField as _;
use needlebench_engine::{EngineError, Plant, Servo};
use needlebench_kinematics::{JOINT_LABELS, Joints};
use serde::Serialize;

use experiment::{Bench, JointResponse};
use linear::{JointLoop, Linear, Margins};
use settings::Setting;

/// The servo and what was measured of it.
#[derive(Debug, Serialize)]
pub struct ServoReport {
    /// Version of this layout.
    pub schema_version: u32,
    /// Name of the scenario.
    pub scenario: String,
    /// Where the posture comes from.
    pub posture: String,
    /// Joint positions of the posture.
    pub posture_rad: [f64; 6],
    /// Time step of servo and engines.
    pub timestep_s: f64,
    /// Settings with their sources.
    pub settings: Vec<Setting>,
    /// Margins of gains and time step.
    pub margins: Margins,
    /// One entry per joint.
    pub joints: Vec<JointReport>,
}

/// One joint.
#[derive(Debug, Serialize)]
pub struct JointReport {
    /// Name of the joint.
    pub joint: &'static str,
    /// Torque limit.
    pub limit_nm: f64,
    /// The linear closed loop.
    pub closed_loop: JointLoop,
    /// What the engines did.
    pub responses: Vec<JointResponse>,
    /// Index of the joint.
    #[serde(skip)]
    pub index: usize,
    /// The linear closed loop's course after a step of 1.
    #[serde(skip)]
    pub linear_step: Vec<f64>,
    /// Frequency (Hz), gain and phase (rad) of the linear closed loop, for a curve.
    #[serde(skip)]
    pub linear_curve: Vec<[f64; 3]>,
}

/// Points of the curve of the linear closed loop.
const CURVE_POINTS: u32 = 160;

/// The joints without what engines show of them.
pub fn joints(
    linear: &Linear,
    servo: &Servo,
    wanted: &[usize],
    timestep_s: f64,
) -> Vec<JointReport> {
    wanted
        .iter()
        .map(|&index| JointReport {
            joint: JOINT_LABELS[index],
            limit_nm: servo.effort_limit_nm[index],
            closed_loop: linear.joint(index),
            responses: Vec::new(),
            index,
            linear_step: linear.step_response(index, experiment::steps_shown(timestep_s)),
            linear_curve: (0..=CURVE_POINTS)
                .map(|k| libm::pow(10_f64, 2.0 * f64::from(k) / f64::from(CURVE_POINTS)))
                .filter(|hz| *hz < 0.5 / timestep_s)
                .map(|hz| {
                    let response = linear.response(index, hz);
                    [hz, response.modulus(), response.argument()]
                })
                .collect(),
        })
        .collect()
}

/// Puts all joints of a report through the experiments in one engine.
pub fn measure(
    report: &mut ServoReport,
    plant: &mut dyn Plant,
    servo: &Servo,
    linear: &Linear,
    posture: &Joints,
) -> Result<(), EngineError> {
    let mut bench = Bench {
        plant,
        servo,
        linear,
        posture: *posture,
        held_nm: servo.dynamics.gravity_torque(posture),
    };
    for joint in &mut report.joints {
        joint.responses.push(bench.joint(joint.index)?);
    }
    Ok(())
}
