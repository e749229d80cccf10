//! Goals that no posture comes to, without a look at clearances.

use std::f64::consts::TAU;

use needlebench_kinematics::Pose;
use needlebench_kinematics::ik::{Kinematics, Rows};
use needlebench_scenario::{Goal, ResolvedScenario, Roll};

/// Pose of the flange in `base_link` that brings the guide to a goal.
pub(crate) fn base_link_from_flange(
    resolved: &ResolvedScenario,
    goal: &Goal,
    roll_rad: f64,
) -> Pose {
    let cell = &resolved.cell;
    cell.robot.world_from_base_link.inverse()
        * goal.world_from_guide_exit_at(roll_rad)
        * cell.tool.flange_from_guide_exit.inverse()
}

/// Rolls that are looked at: all round where it is free, else the one.
pub(crate) fn rolls(goal: &Goal, count: u32) -> Vec<f64> {
    match goal.roll {
        Roll::Fixed(roll_rad) => vec![roll_rad],
        Roll::Free => (0..count)
            .map(|k| TAU * f64::from(k) / f64::from(count))
            .collect(),
    }
}

/// Of a goal that no configuration reaches at any roll that [`Planner::postures`](crate::Planner::postures) looks at:
/// how far the one falls short that comes nearest, m, negative, which is the largest constraint margin of those
/// postures unless the needle path is refused too. None where any reaches it at any of them.
///
/// `kinematics` is of the scenario's chain, within its limits. Closed-form inverse kinematics of all rolls at once: a microsecond or
/// so, where a posture with its clearances takes a thousand times as long.
pub fn out_of_reach_m(
    resolved: &ResolvedScenario,
    goal: &Goal,
    kinematics: &Kinematics,
) -> Option<f64> {
    let poses: Vec<Pose> = rolls(goal, resolved.scenario.planning.roll_samples)
        .into_iter()
        .map(|roll_rad| base_link_from_flange(resolved, goal, roll_rad))
        .collect();
    let mut rows = vec![Rows::new(); poses.len()];
    kinematics.rows_batch(&poses, Some(&resolved.start), &mut rows);
    if rows.iter().any(|rows| rows.count() > 0) {
        return None;
    }
    // What plans ask decides, and says how far: a pose at the edge may have a posture all the same.
    let mut nearest_m = f64::INFINITY;
    for pose in &poses {
        let found = kinematics.branches(pose, Some(&resolved.start));
        if !found.solutions.is_empty() {
            return None;
        }
        let missing = found.unreachable.iter();
        nearest_m = missing
            .map(|(_, reason)| reason.missing_m())
            .fold(nearest_m, f64::min);
    }
    Some(-nearest_m.max(f64::MIN_POSITIVE))
}
