//! Motions to the goals of a scenario, whether they collide or not.

use std::path::Path;

use nalgebra::UnitVector3;
use needlebench_kinematics::ik::Kinematics;
use needlebench_kinematics::trajectory::{JointPath, JointTrajectory, Phase};
use needlebench_scenario::{Overrides, ResolvedScenario, Roll, load_scenario};

/// A shipped scenario.
pub fn shipped(name: &str) -> ResolvedScenario {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
    load_scenario(&path.join(name), &Overrides::default()).expect("a shipped scenario is sound")
}

/// For every goal, configuration and direction about the needle: from the start posture straight
/// to the pre-entry posture, along the needle, and a rest there.
pub fn motions(resolved: &ResolvedScenario, rolls_rad: &[f64]) -> Vec<JointTrajectory> {
    let cell = &resolved.cell;
    let kinematics = Kinematics::new(cell.robot.chain)
        .expect("the shipped robot is a UR arm")
        .within(cell.robot.limits);
    let mut motions = Vec::new();
    for goal in &resolved.goals {
        let fixed = match goal.roll {
            Roll::Fixed(roll_rad) => vec![roll_rad],
            Roll::Free => rolls_rad.to_vec(),
        };
        for roll_rad in fixed {
            let pose = cell.robot.world_from_base_link.inverse()
                * goal.world_from_guide_exit_at(roll_rad)
                * cell.tool.flange_from_guide_exit.inverse();
            let axis = cell.robot.world_from_base_link.rotation.inverse() * goal.axis.into_inner();
            for solution in kinematics.solve(&pose, Some(&resolved.start)).solutions {
                let line = JointPath::line_ending_at(
                    &cell.robot.chain,
                    &solution.joints,
                    &UnitVector3::new_normalize(axis),
                    goal.approach_m,
                );
                let Ok(line) = line else { continue };
                motions.push(
                    JointTrajectory::starting_at(resolved.start)
                        .then_straight_to(Phase::Transfer, line.start(), &resolved.motion)
                        .then_along(Phase::Approach, line, &resolved.motion)
                        .then_hold(Phase::Hold, 0.5),
                );
            }
        }
    }
    motions
}
