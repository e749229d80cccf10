//! Where an arm stands and starts: the scenario's, else the arm's, else a general assumption.

use needlebench_kinematics::{Joints, Pose};
use needlebench_robot::LoadedRobot;

use super::pose_of;
use crate::scenario::Scenario;

/// Where the arm stands and starts.
pub(crate) struct Layout {
    pub world_from_base_link: Pose,
    pub start: Joints,
}

impl Layout {
    /// The scenario's, else the arm's, else one that any arm can have, which is noted.
    pub(crate) fn of(scenario: &Scenario, robot: &LoadedRobot, notes: &mut Vec<String>) -> Self {
        /// A column of a table's height, mm.
        const PLACE_MM: [f64; 3] = [0.0, 0.0, 800.0];
        /// Folded over the base, deg.
        const POSTURE_DEG: [f64; 6] = [0.0, -90.0, -60.0, -90.0, 90.0, 0.0];
        let section = &scenario.robot;
        let known = robot
            .description
            .arm
            .as_ref()
            .and_then(|used| used.arm.data.cell.as_ref());
        let mut assumed = Vec::new();
        let place_mm = section
            .base_position_mm
            .or(known.map(|cell| cell.base_position_mm))
            .unwrap_or_else(|| {
                assumed.push(format!("base at {PLACE_MM:?} mm"));
                PLACE_MM
            });
        let rpy_deg = section
            .base_rpy_deg
            .or(known.map(|cell| cell.base_rpy_deg))
            .unwrap_or_default();
        let start_deg = scenario
            .start
            .joints_deg
            .or(known.map(|cell| cell.start_joints_deg))
            .unwrap_or_else(|| {
                assumed.push(format!("start posture {POSTURE_DEG:?} deg"));
                POSTURE_DEG
            });
        if !assumed.is_empty() {
            notes.push(format!(
                "assumed for {}, since neither the scenario nor the arm data give it: {}",
                robot.description.arm_name,
                assumed.join(", ")
            ));
        }
        Self {
            world_from_base_link: pose_of(place_mm, rpy_deg),
            start: Joints::from_column_slice(&start_deg.map(f64::to_radians)),
        }
    }
}
