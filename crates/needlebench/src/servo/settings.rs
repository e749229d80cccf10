//! Gains, limits and default speeds, each with where it comes from.

use needlebench_cell::ResolvedScenario;
use needlebench_cell::scenario::{ControllerSection, MotionSection};
use needlebench_engine::Servo;
use serde::Serialize;

/// One line of the servo's data sheet.
#[derive(Debug, Serialize)]
pub(crate) struct Setting {
    pub name: &'static str,
    pub unit: &'static str,
    /// Per joint, or one value for all.
    pub values: Vec<f64>,
    /// Where it comes from; begins with `assumed` where nobody published it.
    pub source: String,
}

/// Everything that the servo is set to.
pub(crate) fn settings(resolved: &ResolvedScenario, servo: &Servo) -> Vec<Setting> {
    let scenario = &resolved.scenario;
    let usual = ControllerSection::default();
    let gains = |is_default: bool| {
        if is_default {
            "assumed: UR publishes no gains; shoulder at 6 Hz, damped at 0.6".to_owned()
        } else {
            format!("{}: controller", resolved.source.file)
        }
    };
    let robot = &resolved.cell.robot;
    // The shipped model's numbers are traced in its README; of others only the file is known.
    let model = |quantity: &str, origin: &str| {
        if robot.name == "ur3" {
            format!("{} ({origin})", robot.source.file)
        } else {
            format!("{}: {quantity}", robot.source.file)
        }
    };
    let motion = &scenario.motion;
    let usual_motion = MotionSection::default();
    let chosen = |is_default: bool, origin: &str| {
        if is_default {
            origin.to_owned()
        } else {
            format!("{}: motion", resolved.source.file)
        }
    };
    let controller = &scenario.controller;
    let degrees = |value: f64| vec![value.to_radians()];
    let per_joint = |name, unit, values: Vec<f64>, source| Setting {
        name,
        unit,
        values,
        source,
    };
    vec![
        per_joint(
            "position gain kp",
            "N m/rad",
            servo.gains.kp_nm_per_rad.to_vec(),
            gains(controller.stiffness_nm_rad == usual.stiffness_nm_rad),
        ),
        per_joint(
            "velocity gain kd",
            "N m s/rad",
            servo.gains.kd_nms_per_rad.to_vec(),
            gains(controller.damping_nms_rad == usual.damping_nms_rad),
        ),
        per_joint(
            "rotor inertia at the joint",
            "kg m^2",
            servo.dynamics.armature_kgm2.iter().copied().collect(),
            if controller.armature_kgm2 == usual.armature_kgm2 {
                "assumed: UR publishes none".to_owned()
            } else {
                format!("{}: controller", resolved.source.file)
            },
        ),
        per_joint(
            "torque limit",
            "N m",
            servo.effort_limit_nm.iter().copied().collect(),
            model("effort limits", "UR, article `Max. joint torques`, 2020"),
        ),
        per_joint(
            "speed limit",
            "rad/s",
            robot.limits.velocities_rad_s().iter().copied().collect(),
            model(
                "velocity limits",
                "UR3 user manual, CB3, technical specifications",
            ),
        ),
        per_joint(
            "default joint speed",
            "rad/s",
            degrees(motion.joint_velocity_deg_s),
            chosen(
                motion.joint_velocity_deg_s == usual_motion.joint_velocity_deg_s,
                "URScript manual, movej: v = 1.05 rad/s",
            ),
        ),
        per_joint(
            "default joint acceleration",
            "rad/s^2",
            degrees(motion.joint_acceleration_deg_s2),
            chosen(
                motion.joint_acceleration_deg_s2 == usual_motion.joint_acceleration_deg_s2,
                "URScript manual, movej: a = 1.4 rad/s^2",
            ),
        ),
        per_joint(
            "default joint jerk",
            "rad/s^3",
            degrees(motion.joint_jerk_deg_s3),
            chosen(
                motion.joint_jerk_deg_s3 == usual_motion.joint_jerk_deg_s3,
                "assumed: full acceleration after 0.14 s",
            ),
        ),
        per_joint(
            "speed along the needle",
            "m/s",
            vec![motion.line_velocity_mm_s * 1e-3],
            chosen(
                motion.line_velocity_mm_s == usual_motion.line_velocity_mm_s,
                "assumed: slow beside a patient (URScript movel: 0.25 m/s)",
            ),
        ),
    ]
}
