//! What is known of an excitation run before it is made.

use needlebench_evaluation::certified_clearance;
use needlebench_evaluation::excitation::MotionReport;
use needlebench_evaluation::report::ClearanceReport;
use needlebench_kinematics::JOINT_LABELS;
use needlebench_planning::excitation::{
    CalibrationInformation, ExcitationPlan, FoundRun, IDENTIFIED_SHARE, Identification, NOISE,
};
use needlebench_scenario::ResolvedScenario;
use serde::Serialize;

use crate::excitation::motions;

/// A planned run: its clearances, and what its log will tell.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PlanReport {
    /// Version of the keys.
    pub schema_version: u32,
    /// Name of the run's scenario.
    pub scenario: String,
    /// The arm.
    pub arm: String,
    /// Seed of the search.
    pub seed: u64,
    /// Postures at which the arm stands, the start's among them where a way leads over it.
    pub postures: usize,
    /// How often a way leads over the start posture.
    pub over_start: usize,
    /// Free postures that were chosen from, of how many that were drawn.
    pub candidates: [usize; 2],
    /// Payloads besides the tool, kg: the run is made once with each.
    pub payloads_kg: Vec<f64>,
    /// Mass of the tool, kg.
    pub tool_kg: f64,
    /// Duration with one payload, s.
    pub duration_s: f64,
    /// Required clearance from everything else, m.
    pub clearance_limit_m: f64,
    /// Required self-clearance, m.
    pub self_clearance_limit_m: f64,
    /// Certified clearances of all motions together.
    pub planned: ClearanceReport,
    /// Motion by motion.
    pub motions: Vec<MotionReport>,
    /// What the run's log tells.
    pub tells: Telling,
    /// What the log of as many random free postures without sweeps tells: medians of nine such runs.
    pub random: Telling,
    /// The noise that both are for.
    pub noise: NoiseReport,
    /// Files that were written.
    pub files: Vec<String>,
}

/// What a log tells: standard deviations. None where a value is not determined, or nothing is known of the motors.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Telling {
    /// Ratio of the largest to the least singular value of a calibration's 30 unknowns; none where not all of them
    /// are determined.
    pub calibration_condition: Option<f64>,
    /// Error of the calibrated arm's flange at other postures, root mean square and largest, m.
    pub flange_rms_m: f64,
    /// The largest of it, m.
    pub flange_worst_m: f64,
    /// Mass at the flange, kg.
    pub payload_kg: Option<f64>,
    /// Its centre, m.
    pub payload_centre_m: Option<f64>,
    /// By joint.
    pub joints: Vec<JointTelling>,
}

/// What a log tells of a joint: standard deviations.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JointTelling {
    /// The joint.
    pub joint: &'static str,
    /// Rotor inertia, kg m^2.
    pub rotor_kgm2: Option<f64>,
    /// Torque constant, as a share of it.
    pub torque_constant_share: Option<f64>,
    /// Whether the torque constant is determined to a tenth.
    pub torque_constant_identified: Option<bool>,
    /// Sliding friction, N m.
    pub coulomb_nm: Option<f64>,
    /// Viscous friction, N m s/rad.
    pub viscous_nms_rad: Option<f64>,
    /// Least and largest torque while the joint stands, over all payloads, N m.
    pub standing_nm: [f64; 2],
}

/// The noise that is assumed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NoiseReport {
    /// Flange about the best calibration, per axis, m.
    pub position_m: f64,
    /// Its orientation, rad.
    pub rotation_rad: f64,
    /// The controller's torque about the model, N m.
    pub moment_nm: f64,
    /// Currents about their law, A.
    pub current_a: f64,
    /// Time after which an error is another one, s.
    pub independent_s: f64,
    /// Deviation of each origin before anything is measured, m.
    pub origin_m: f64,
    /// The same of its orientation, rad.
    pub origin_rad: f64,
}

impl Telling {
    fn of((calibration, found): &(CalibrationInformation, Identification)) -> Self {
        let finite = |value: f64| value.is_finite().then_some(value);
        Self {
            calibration_condition: calibration.condition,
            flange_rms_m: calibration.flange_rms_m,
            flange_worst_m: calibration.flange_worst_m,
            payload_kg: finite(found.payload.mass_kg),
            payload_centre_m: finite(found.payload.centre_m),
            joints: found
                .joints
                .iter()
                .zip(JOINT_LABELS)
                .map(|(each, joint)| JointTelling {
                    joint,
                    rotor_kgm2: finite(each.rotor_kgm2),
                    torque_constant_share: each.torque_constant_share.and_then(finite),
                    torque_constant_identified: each
                        .torque_constant_share
                        .map(|share| share <= IDENTIFIED_SHARE),
                    coulomb_nm: each.coulomb_nm.and_then(finite),
                    viscous_nms_rad: each.viscous_nms_rad.and_then(finite),
                    standing_nm: each.gravity_nm,
                })
                .collect(),
        }
    }
}

impl PlanReport {
    /// Of a run that was found and planned; `resolved` is its scenario.
    pub fn of(
        resolved: &ResolvedScenario,
        plan: &ExcitationPlan,
        found: &FoundRun,
        seed: u64,
    ) -> Self {
        let protocol = &found.protocol;
        Self {
            schema_version: 1,
            scenario: resolved.scenario.name.clone(),
            arm: resolved.robot_description.arm_name.clone(),
            seed,
            postures: protocol.postures.len(),
            over_start: found.detours,
            candidates: [found.candidates, found.drawn as usize],
            payloads_kg: protocol
                .loads
                .iter()
                .map(|load| load.body.mass_kg)
                .collect(),
            tool_kg: resolved.cell.tool.body.mass_kg,
            duration_s: plan.trajectory.duration_s(),
            clearance_limit_m: protocol.clearance_m,
            self_clearance_limit_m: protocol.self_clearance_m,
            planned: ClearanceReport::of(&certified_clearance(&resolved.cell, &plan.certificate)),
            motions: motions(resolved, plan),
            tells: Telling::of(&found.tells),
            random: Telling::of(&found.random),
            noise: NoiseReport {
                position_m: NOISE.position_m,
                rotation_rad: NOISE.rotation_rad,
                moment_nm: NOISE.moment_nm,
                current_a: NOISE.current_a,
                independent_s: NOISE.independent_s,
                origin_m: NOISE.origin_m,
                origin_rad: NOISE.origin_rad,
            },
            files: Vec::new(),
        }
    }
}
