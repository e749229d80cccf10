//! How far a stop at any moment of a motion goes.

use needlebench_cell::Cell;
use needlebench_engine::Brakes;
use needlebench_kinematics::trajectory::{JointTrajectory, Phase};
use needlebench_kinematics::{Dynamics, Joints};
use needlebench_scenario::Goal;
use serde::Serialize;

use crate::needle::tip_of;

/// Time between two triggers that are looked at, s.
const SPACING_S: f64 = 0.04;

/// Step of the braked arm, s.
const STEP_S: f64 = 1e-3;

/// Longest stop that is followed, s.
const LONGEST_S: f64 = 2.0;

/// Speed below which the arm stands, rad/s.
const STANDING_RAD_S: f64 = 1e-3;

/// Worst stop of a motion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Default)]
pub struct StopEnvelope {
    /// Moment of the trigger from which the tip goes farthest, s.
    pub worst_at_s: f64,
    /// That distance, m.
    pub worst_tip_distance_m: f64,
    /// Largest distance of the flange, from any moment, m.
    pub worst_flange_distance_m: f64,
    /// Longest stopping time, from any moment, s.
    pub worst_stopping_time_s: f64,
    /// Largest way of each joint, from any moment, rad.
    pub worst_joint_travel_rad: [f64; 6],
    /// Moments that were looked at.
    pub triggers: usize,
}

/// Follows stops from moments every 40 ms of the way in, without an engine.
///
/// Category 0: our own rigid-body dynamics under the brakes, in steps of 1 ms. Categories 1 and 2: the
/// planned path itself, slowed down within `deceleration_s`.
pub fn stopping_envelope(
    cell: &Cell,
    goal: &Goal,
    trajectory: &JointTrajectory,
    brakes: Option<&Brakes>,
    deceleration_s: f64,
) -> StopEnvelope {
    let dynamics = cell.dynamics();
    let end_s = arrival_s(trajectory);
    let mut envelope = StopEnvelope::default();
    let mut at_s = 0.0;
    while at_s < end_s {
        let start = trajectory.sample(at_s);
        let (stopped, time_s) = match brakes {
            Some(brakes) => braked(&dynamics, brakes, &start.position, &start.velocity),
            None => (
                trajectory.stopped(at_s, deceleration_s).end(),
                deceleration_s,
            ),
        };
        let [first, last] = [start.position, stopped].map(|q| cell.robot.world_from_flange(&q));
        let tip_m = (tip_of(cell, goal, &last) - tip_of(cell, goal, &first)).norm();
        let flange_m = (last.translation.vector - first.translation.vector).norm();
        if tip_m > envelope.worst_tip_distance_m {
            envelope.worst_tip_distance_m = tip_m;
            envelope.worst_at_s = at_s;
        }
        envelope.worst_flange_distance_m = envelope.worst_flange_distance_m.max(flange_m);
        envelope.worst_stopping_time_s = envelope.worst_stopping_time_s.max(time_s);
        let travel = (stopped - start.position).abs();
        for (worst, here) in envelope.worst_joint_travel_rad.iter_mut().zip(&travel) {
            *worst = worst.max(*here);
        }
        envelope.triggers += 1;
        at_s += SPACING_S;
    }
    envelope
}

/// When the guide is in its place, s.
pub(crate) fn arrival_s(trajectory: &JointTrajectory) -> f64 {
    trajectory
        .phases()
        .iter()
        .filter(|(phase, _, _)| *phase != Phase::Hold)
        .map(|(_, _, end_s)| *end_s)
        .fold(0.0, f64::max)
}

/// Where the arm stands under its brakes, and how long it takes.
fn braked(dynamics: &Dynamics, brakes: &Brakes, q: &Joints, v: &Joints) -> (Joints, f64) {
    let (mut q, mut v, mut time_s) = (*q, *v, 0.0);
    while v.amax() > STANDING_RAD_S && time_s < LONGEST_S {
        let torque = brakes.torque(dynamics, &q, &v, STEP_S);
        let bias = dynamics.inverse_dynamics(&q, &v, &Joints::zeros());
        let Some(inverse) = dynamics.mass_matrix(&q).try_inverse() else {
            break;
        };
        v += inverse * (torque - bias) * STEP_S;
        q += v * STEP_S;
        time_s += STEP_S;
    }
    (q, time_s)
}
