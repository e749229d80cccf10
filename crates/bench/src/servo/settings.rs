//! Gains, limits and default speeds, each with where it comes from.

use needlebench_engine::Servo;
use needlebench_robot::Recognition;
use needlebench_scenario::ResolvedScenario;
use needlebench_scenario::scenario::MotionSection;
use serde::Serialize;

/// One line of the servo's data sheet.
#[derive(Debug, Serialize)]
pub struct Setting {
    /// What is set.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Per joint, or one value for all.
    pub values: Vec<f64>,
    /// Where it comes from; begins with `assumed` where it was not published.
    pub source: String,
}

/// Everything that the servo is set to.
pub fn settings(resolved: &ResolvedScenario, servo: &Servo) -> Vec<Setting> {
    let scenario = &resolved.scenario;
    let chosen_servo = &resolved.servo;
    let robot = &resolved.robot_description;
    // The numbers of an arm's own URDF are traced in its data; of others only the file is known.
    let own = robot.arm.as_ref();
    let own = own.filter(|used| used.recognition == Recognition::Own);
    let traced = own.and_then(|used| used.arm.data.limits.as_ref());
    let model = |quantity: &str, source: Option<&String>| match source {
        Some(source) => format!("{} ({source})", robot.source.file),
        None => format!("{}: {quantity}", robot.source.file),
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
            chosen_servo.stiffness_source.clone(),
        ),
        per_joint(
            "velocity gain kd",
            "N m s/rad",
            servo.gains.kd_nms_per_rad.to_vec(),
            chosen_servo.damping_source.clone(),
        ),
        per_joint(
            "rotor inertia at the joint",
            "kg m^2",
            servo.dynamics.armature_kgm2.iter().copied().collect(),
            chosen_servo.armature_source.clone(),
        ),
        per_joint(
            "gravity of the world",
            "m/s^2",
            vec![resolved.gravity.world_m_s2],
            resolved.gravity.world_source.clone(),
        ),
        per_joint(
            "gravity assumed by the controller",
            "m/s^2",
            vec![resolved.gravity.believed_m_s2],
            resolved.gravity.believed_source.clone(),
        ),
        per_joint(
            "torque limit",
            "N m",
            servo.effort_limit_nm.iter().copied().collect(),
            model("effort limits", traced.map(|limits| &limits.effort_source)),
        ),
        per_joint(
            "speed limit",
            "rad/s",
            resolved
                .cell
                .robot
                .limits
                .velocities_rad_s()
                .iter()
                .copied()
                .collect(),
            model(
                "velocity limits",
                traced.map(|limits| &limits.velocity_source),
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
