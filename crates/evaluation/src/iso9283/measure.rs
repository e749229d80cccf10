//! From a recorded cycle to attained poses and arrivals.

use nalgebra::{Point3, UnitQuaternion, Vector3};
use needlebench_cell::Cell;
use needlebench_engine::{PlantState, Recording};
use needlebench_iso9283::{Arrival, Attained, mean_vector};
use needlebench_kinematics::{Pose, rotation_vector};
use needlebench_scenario::iso9283::{Iso9283Protocol, Stop};
use serde::Serialize;

use crate::motion::ContactMeasurement;

/// What one recorded cycle says.
#[derive(Debug, Clone, PartialEq)]
pub struct CycleMeasurement {
    /// Attained pose of every stop, by a perfect tracker.
    pub attained: Vec<Attained>,
    /// How the measured point came there.
    pub arrivals: Vec<Arrival>,
}

/// Measures a recorded cycle as a tracker would: at each stop the mean over the measuring window
/// before the robot leaves.
///
/// `cycle` counts from 1; `start_s` is when the cycle began in the whole test.
pub fn measure_cycle(
    cell: &Cell,
    protocol: &Iso9283Protocol,
    recording: &Recording,
    stops: &[Stop],
    cycle: u32,
    start_s: f64,
) -> CycleMeasurement {
    let base_from_world = cell.robot.world_from_base().inverse();
    let point =
        |state: &PlantState| base_from_world * state.world_from_flange * protocol.flange_from_point;
    let (mut attained, mut arrivals) = (Vec::new(), Vec::new());
    for stop in stops {
        let of = window(recording, stop.departure_s, stop.end_s);
        let last_s = recording.time_s[of.end - 1];
        let measured = window(recording, last_s - protocol.measuring_s, last_s);
        let poses: Vec<Pose> = recording.state[measured].iter().map(point).collect();
        let mean = mean_pose(&poses);
        let position_m = Point3::from(mean.translation.vector);
        let pose = u32::try_from(stop.pose + 1).expect("there are five poses");
        attained.push(Attained {
            pose,
            cycle,
            axis: stop.axis,
            time_s: Some(start_s + last_s - 0.5 * protocol.measuring_s),
            position_m,
            orientation: Some(mean.rotation),
        });
        arrivals.push(Arrival {
            pose,
            cycle,
            time_s: recording.time_s[of.clone()]
                .iter()
                .map(|time_s| time_s - stop.arrival_s)
                .collect(),
            distance_m: recording.state[of]
                .iter()
                .map(|state| (point(state).translation.vector - position_m.coords).norm())
                .collect(),
        });
    }
    CycleMeasurement { attained, arrivals }
}

/// Indices of the states from one time to another, both included; at least one state.
fn window(recording: &Recording, from_s: f64, to_s: f64) -> std::ops::Range<usize> {
    // The end of a stop need not be a whole number of steps.
    let slack_s = 1e-6 * recording.timestep_s;
    let times = &recording.time_s;
    let end = times
        .partition_point(|time_s| *time_s <= to_s + slack_s)
        .max(1);
    let start = times.partition_point(|time_s| *time_s < from_s - slack_s);
    start.min(end - 1)..end
}

/// Mean of poses that are near to one another; of equal ones exactly that one.
fn mean_pose(poses: &[Pose]) -> Pose {
    let positions: Vec<Vector3<f64>> = poses.iter().map(|pose| pose.translation.vector).collect();
    let first = poses[0].rotation;
    let turns: Vec<Vector3<f64>> = poses
        .iter()
        .map(|pose| {
            if pose.rotation == first {
                Vector3::zeros()
            } else {
                rotation_vector(&(pose.rotation * first.inverse()))
            }
        })
        .collect();
    let turn = mean_vector(&turns);
    let rotation = if turn == Vector3::zeros() {
        first
    } else {
        UnitQuaternion::from_scaled_axis(turn) * first
    };
    Pose::from_parts(mean_vector(&positions).into(), rotation)
}

/// Effort and contact over all recorded cycles.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Effort {
    /// Largest torque over its joint's limit.
    pub peak_torque_ratio: f64,
    /// Largest joint speed over its joint's limit.
    pub peak_speed_ratio: f64,
    /// Steps in which a torque was cut at its limit.
    pub saturated_steps: usize,
    /// Contact.
    pub contact: ContactMeasurement,
}

impl Effort {
    /// Takes a recording into account.
    pub fn add(&mut self, cell: &Cell, recording: &Recording) {
        let limits = &cell.robot.limits;
        let (efforts, speeds) = (limits.efforts_nm(), limits.velocities_rad_s());
        for torque in &recording.drive_nm {
            let ratio = torque.abs().component_div(&efforts).max();
            self.peak_torque_ratio = self.peak_torque_ratio.max(ratio);
        }
        self.saturated_steps += recording.saturated_steps;
        for (state, &time_s) in recording.state.iter().zip(&recording.time_s) {
            let ratio = state.velocity.abs().component_div(&speeds).max();
            self.peak_speed_ratio = self.peak_speed_ratio.max(ratio);
            let (found, contact) = (&state.contact, &mut self.contact);
            if found.count == 0 {
                continue;
            }
            if !contact.occurred {
                contact.occurred = true;
                contact.first_time_s = Some(time_s);
                contact.first_pair = found
                    .pair
                    .map(|(a, b)| [a, b].map(|index| cell.bodies[index as usize].name.clone()));
            }
            contact.peak_force_n = contact.peak_force_n.max(found.normal_force_n);
            contact.impulse_ns += found.normal_force_n * recording.timestep_s;
            contact.deepest_penetration_m = contact
                .deepest_penetration_m
                .max(found.deepest_penetration_m);
        }
    }
}
