//! Gains and rotor inertia: the scenario's, else the arm's, else a general rule's.

use std::f64::consts::TAU;

use nalgebra::Vector3;
use needlebench_cell::{Robot, Tool};
use needlebench_kinematics::{Dynamics, JOINT_COUNT, Joints};
use needlebench_robot::LoadedRobot;
use serde::Serialize;

use crate::scenario::{ControllerSection, Scenario};

/// Frequency at which the rule lets the stretched-out arm swing about its heaviest joint, Hz.
const NATURAL_FREQUENCY_HZ: f64 = 6.0;

/// Damping ratio of that motion.
const DAMPING_RATIO: f64 = 0.6;

/// Velocity gain over rotor inertia, 1/s: explicit steps of 1 ms stay stable up to three times as much.
const DAMPING_PER_INERTIA_PER_S: f64 = 600.0;

/// What the joint servo is set to, and where each comes from.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ServoSettings {
    /// Position gain per joint, N m/rad.
    pub stiffness_nm_rad: [f64; JOINT_COUNT],
    /// Velocity gain per joint, N m s/rad.
    pub damping_nms_rad: [f64; JOINT_COUNT],
    /// Reflected rotor inertia per joint, kg m^2.
    pub armature_kgm2: [f64; JOINT_COUNT],
    /// Source of the position gains.
    pub stiffness_source: String,
    /// Source of the velocity gains.
    pub damping_source: String,
    /// Source of the rotor inertia.
    pub armature_source: String,
}

/// The servo of a scenario in `file`; a note on assumed values.
pub(crate) fn servo_settings(
    file: &str,
    section: &ControllerSection,
    robot: &LoadedRobot,
    tool: &Tool,
    notes: &mut Vec<String>,
) -> ServoSettings {
    let data = robot.description.arm.as_ref().map(|used| &used.arm.data);
    let servo = data.and_then(|data| data.servo.as_ref());
    let rotors = data.and_then(|data| data.rotors.as_ref());
    let general = General::of(robot, tool);
    let mut ruled = Vec::new();
    let mut pick = |given: Option<[f64; JOINT_COUNT]>,
                    arm: Option<([f64; JOINT_COUNT], &String)>,
                    rule: f64,
                    (name, unit): (&str, &str)| match (given, arm) {
        (Some(given), _) => (given, format!("{file}: controller")),
        (None, Some((values, source))) => (values, source.clone()),
        (None, None) => {
            ruled.push(format!("{name} {rule:.3} {unit}"));
            ([rule; JOINT_COUNT], RULE.to_owned())
        }
    };
    let (stiffness_nm_rad, stiffness_source) = pick(
        section.stiffness_nm_rad,
        servo.map(|servo| (servo.stiffness_nm_rad, &servo.source)),
        general.stiffness_nm_rad,
        ("position gain", "N m/rad"),
    );
    let (damping_nms_rad, damping_source) = pick(
        section.damping_nms_rad,
        servo.map(|servo| (servo.damping_nms_rad, &servo.source)),
        general.damping_nms_rad,
        ("velocity gain", "N m s/rad"),
    );
    let (armature_kgm2, armature_source) = pick(
        section.armature_kgm2,
        rotors.map(|rotors| (rotors.inertia_kgm2, &rotors.source)),
        general.armature_kgm2,
        ("rotor inertia", "kg m^2"),
    );
    if !ruled.is_empty() {
        notes.push(format!(
            "the servo of {} is assumed, since there are no data: {} for every joint ({RULE})",
            robot.description.arm_name,
            ruled.join(", ")
        ));
    }
    ServoSettings {
        stiffness_nm_rad,
        damping_nms_rad,
        armature_kgm2,
        stiffness_source,
        damping_source,
        armature_source,
    }
}

/// A note of what an arm's data assume of its drives, where a scenario leaves that to the arm; by the first
/// clause of the reason that they give.
pub(crate) fn note_assumed_drives(
    scenario: &Scenario,
    robot: &LoadedRobot,
    has_friction: bool,
    notes: &mut Vec<String>,
) {
    let Some(used) = &robot.description.arm else {
        return;
    };
    let data = &used.arm.data;
    let rotors = data.rotors.as_ref().map(|rotors| &rotors.source);
    let rotors = rotors.filter(|_| scenario.controller.armature_kgm2.is_none());
    let block = scenario.imperfections.as_ref();
    let block = block.and_then(|block| block.friction.as_ref());
    let is_given =
        block.is_some_and(|block| block.coulomb_nm.is_some() && block.viscous_nms_rad.is_some());
    let friction = data.friction.as_ref().map(|friction| &friction.source);
    let friction = friction.filter(|_| has_friction && !is_given);
    let reason = |source: &String| {
        let reason = source.strip_prefix("assumed:")?;
        Some(reason.split(';').next()?.trim().to_owned())
    };
    let assumed = match (rotors.and_then(reason), friction.and_then(reason)) {
        (Some(rotors), Some(friction)) if rotors == friction => {
            format!("rotor inertia and friction ({rotors})")
        }
        (Some(rotors), Some(friction)) => {
            format!("rotor inertia ({rotors}), friction ({friction})")
        }
        (Some(rotors), None) => format!("rotor inertia ({rotors})"),
        (None, Some(friction)) => format!("friction ({friction})"),
        (None, None) => return,
    };
    notes.push(format!("assumed for the {}: {assumed}", data.name));
}

/// The rule in words.
const RULE: &str = "assumed: natural frequency 6 Hz and damping ratio 0.6 of the stretched-out arm, rotor \
                    inertia sufficient for steps of 1 ms";

/// What the rule gives for every joint of an arm.
#[derive(Debug, Clone, Copy)]
struct General {
    stiffness_nm_rad: f64,
    damping_nms_rad: f64,
    armature_kgm2: f64,
}

impl General {
    fn of(robot: &Robot, tool: &Tool) -> Self {
        let mut bodies = robot.bodies;
        let last = JOINT_COUNT - 1;
        let tool = tool.body.transformed(&robot.chain.wrist_3_from_flange);
        bodies[last] = bodies[last].combined_with(&tool);
        let dynamics = Dynamics {
            chain: robot.chain,
            bodies,
            armature_kgm2: Joints::zeros(),
            gravity_m_s2: Vector3::zeros(),
        };
        let of_links_kgm2 = dynamics.mass_matrix(&Joints::zeros()).diagonal().max();
        let frequency_rad_s = TAU * NATURAL_FREQUENCY_HZ;
        // The rotor swings too: its inertia is this share of the whole.
        let of_rotor = 2.0 * DAMPING_RATIO * frequency_rad_s / DAMPING_PER_INERTIA_PER_S;
        let inertia_kgm2 = of_links_kgm2 / (1.0 - of_rotor);
        Self {
            stiffness_nm_rad: inertia_kgm2 * frequency_rad_s.powi(2),
            damping_nms_rad: 2.0 * DAMPING_RATIO * frequency_rad_s * inertia_kgm2,
            armature_kgm2: of_rotor * inertia_kgm2,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Overrides, load_scenario};

    /// The rule for arms of which nothing is known swings the same shoulder as the UR3's own gains do, at the
    /// same frequency with the same damping: but without the rated load, and with a light rotor.
    #[test]
    fn the_general_rule_swings_a_ur3_as_its_own_gains_do() {
        /// The UR3's gains are rounded to two digits.
        const DIGITS: f64 = 0.025;
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("s.toml");
        let scenario = "name = \"s\"\n[robot]\nbase_rpy_deg = [0, 0, 180]\n[[goals]]\nname = \"g\"\n\
                        insertion_length_mm = 100\n[goals.flange_pose]\n\
                        position_mm = [194.2, -359.3, 170.1]\nrotation_vector_rad = [-0.8567, 2.7197, -1.1407]\n";
        std::fs::write(&file, scenario).unwrap();
        let resolved = load_scenario(&file, &Overrides::default()).unwrap();
        let rule = General::of(&resolved.cell.robot, &resolved.cell.tool);
        let servo = &resolved.servo;
        // Of the rule: links and tool, 0.85 kg m^2, and its rotor.
        let swung_kgm2 = rule.stiffness_nm_rad / (TAU * NATURAL_FREQUENCY_HZ).powi(2);
        assert!((0.8..1.0).contains(&swung_kgm2), "{swung_kgm2}");
        // A lighter arm needs less of both gains, by the same factor.
        let factors = [
            servo.stiffness_nm_rad[1] / rule.stiffness_nm_rad,
            servo.damping_nms_rad[1] / rule.damping_nms_rad,
        ];
        assert!(
            (factors[0] / factors[1] - 1.0).abs() < DIGITS,
            "{factors:?}"
        );
        // Wrists: velocity gain by rotor inertia is that of the rule.
        for wrist in 3..JOINT_COUNT {
            let per_rotor_per_s = servo.damping_nms_rad[wrist] / servo.armature_kgm2[wrist];
            let ratio = per_rotor_per_s / (rule.damping_nms_rad / rule.armature_kgm2);
            assert!((ratio - 1.0).abs() < DIGITS, "{ratio}");
        }
    }
}
