//! How a plant followed its trajectory.

use nalgebra::Point3;
use needlebench_cell::Cell;
use needlebench_engine::Recording;
use needlebench_kinematics::trajectory::{JointTrajectory, Phase};
use needlebench_kinematics::{JOINT_LABELS, Joints};
use needlebench_scenario::Goal;
use serde::Serialize;

use crate::contact::{ContactEpisode, episodes};
use crate::engine_pairs::pairs;
use crate::needle::tip_of;

/// Contact of arm or tool during a motion.
#[derive(Debug, Clone, PartialEq, Serialize, Default)]
pub struct ContactMeasurement {
    /// Whether anything touched.
    pub occurred: bool,
    /// Time of the first touch, s.
    pub first_time_s: Option<f64>,
    /// Phase of the first touch.
    pub first_phase: Option<&'static str>,
    /// Bodies that touched first.
    pub first_pair: Option<[String; 2]>,
    /// Largest sum of normal forces against rigid surfaces, N.
    pub peak_force_n: f64,
    /// Integral of the sum of normal forces, N s.
    pub impulse_ns: f64,
    /// Deepest penetration, m.
    pub deepest_penetration_m: f64,
    /// The contacts one by one.
    pub episodes: Vec<ContactEpisode>,
}

/// Time and effort of one simulated motion.
#[derive(Debug, Clone, PartialEq, Serialize, Default)]
pub struct MotionMeasurement {
    /// Time from the end of the planned motion until the needle's tip stays within the band about
    /// its commanded place, s; none if it never does. For an imperfect arm, which never comes to
    /// its commanded place, the band is about where it ends.
    pub settling_time_s: Option<f64>,
    /// Half-width of that band, m.
    pub settling_band_m: f64,
    /// Largest distance of the needle's tip from its reference at the same time, m.
    pub peak_tracking_error_m: f64,
    /// Largest torque over its joint's limit.
    pub peak_torque_ratio: f64,
    /// Largest joint speed over its joint's limit.
    pub peak_speed_ratio: f64,
    /// Steps in which a torque was cut at its limit.
    pub saturated_steps: usize,
    /// Joints whose torque was cut at its limit.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub saturated_joints: Vec<SaturatedJoint>,
    /// Largest torque in the last step minus the torque that gravity asks for there, N m.
    pub holding_torque_error_nm: f64,
    /// Contact.
    pub contact: ContactMeasurement,
}

/// A joint whose torque saturated.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SaturatedJoint {
    /// Label of the joint.
    pub joint: &'static str,
    /// Steps in which its torque was cut.
    pub steps: usize,
    /// The same as a share of all steps.
    pub share: f64,
    /// When that happened first, s.
    pub first_time_s: Option<f64>,
}

fn saturated_joints(recording: &Recording) -> Vec<SaturatedJoint> {
    JOINT_LABELS
        .into_iter()
        .zip(&recording.saturation)
        .filter(|(_, saturation)| saturation.steps > 0)
        .map(|(joint, saturation)| SaturatedJoint {
            joint,
            steps: saturation.steps,
            share: saturation.steps as f64 / recording.steps().max(1) as f64,
            first_time_s: saturation.first_time_s,
        })
        .collect()
}

/// Difference of engines that followed the same trajectory: the largest over all pairs of them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Default)]
pub struct EngineDifference {
    /// Largest distance of two tips at the same time, m.
    pub peak_tip_m: f64,
    /// Largest distance of two tips at the end, m.
    pub settled_tip_m: f64,
    /// Engines with that peak; left out where there are but two.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub peak_engines: Option<[&'static str; 2]>,
    /// Engines that settled that far apart; left out where there are but two.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub settled_engines: Option<[&'static str; 2]>,
}

impl EngineDifference {
    /// The largest over pairs of engines, each with its peak and settled distance, m; none without any
    /// pair.
    pub fn largest(pairs: impl IntoIterator<Item = ([&'static str; 2], [f64; 2])>) -> Option<Self> {
        let mut pairs = pairs.into_iter();
        let (engines, [peak_tip_m, settled_tip_m]) = pairs.next()?;
        let mut found = Self {
            peak_tip_m,
            settled_tip_m,
            ..Self::default()
        };
        let (mut peak, mut settled, mut count) = (engines, engines, 1);
        for (engines, [peak_tip_m, settled_tip_m]) in pairs {
            count += 1;
            if peak_tip_m > found.peak_tip_m {
                (found.peak_tip_m, peak) = (peak_tip_m, engines);
            }
            if settled_tip_m > found.settled_tip_m {
                (found.settled_tip_m, settled) = (settled_tip_m, engines);
            }
        }
        if count > 1 {
            (found.peak_engines, found.settled_engines) = (Some(peak), Some(settled));
        }
        Some(found)
    }
}

/// Measures a recording. `rests_at_m` is where the needle's tip is to settle, world; its commanded
/// place if none.
pub fn measure_motion(
    cell: &Cell,
    goal: &Goal,
    trajectory: &JointTrajectory,
    recording: &Recording,
    settling_band_m: f64,
    rests_at_m: Option<Point3<f64>>,
) -> MotionMeasurement {
    let reference_tip = |q: &Joints| tip_of(cell, goal, &cell.robot.world_from_flange(q));
    let rests_at_m = rests_at_m.unwrap_or_else(|| reference_tip(&trajectory.end()));
    let motion_end_s = trajectory
        .phases()
        .iter()
        .filter(|(phase, _, _)| *phase != Phase::Hold)
        .map(|(_, _, end_s)| *end_s)
        .fold(0.0, f64::max);
    let mut peak_tracking_error_m: f64 = 0.0;
    let mut last_outside_s = None;
    let mut peak_speed_ratio: f64 = 0.0;
    let mut contact = ContactMeasurement::default();
    let velocity_limit = cell.robot.limits.velocities_rad_s();
    // While the arm holds its place the reference stays.
    let mut last_reference: Option<(Joints, Point3<f64>)> = None;
    for ((state, reference), &time_s) in recording
        .state
        .iter()
        .zip(&recording.reference)
        .zip(&recording.time_s)
    {
        let tip = tip_of(cell, goal, &state.world_from_flange);
        let planned_tip = match last_reference {
            Some((known, planned_tip)) if known == reference.position => planned_tip,
            _ => reference_tip(&reference.position),
        };
        last_reference = Some((reference.position, planned_tip));
        peak_tracking_error_m = peak_tracking_error_m.max((tip - planned_tip).norm());
        if (tip - rests_at_m).norm() > settling_band_m {
            last_outside_s = Some(time_s);
        }
        peak_speed_ratio =
            peak_speed_ratio.max(state.velocity.abs().component_div(&velocity_limit).max());
        if state.contact.count > 0 {
            if !contact.occurred {
                contact.occurred = true;
                contact.first_time_s = Some(time_s);
                contact.first_phase = Some(trajectory.phase_at(time_s).name());
                contact.first_pair = state
                    .contact
                    .pair
                    .map(|(a, b)| [a, b].map(|index| cell.bodies[index as usize].name.clone()));
            }
            contact.peak_force_n = contact.peak_force_n.max(state.contact.normal_force_n);
            contact.impulse_ns += state.contact.normal_force_n * recording.timestep_s;
            contact.deepest_penetration_m = contact
                .deepest_penetration_m
                .max(state.contact.deepest_penetration_m);
        }
    }
    contact.episodes = episodes(cell, goal, trajectory, recording, settling_band_m);
    let effort_limit = cell.robot.limits.efforts_nm();
    let peak_torque_ratio = recording
        .drive_nm
        .iter()
        .map(|torque| torque.abs().component_div(&effort_limit).max())
        .fold(0.0, f64::max);
    let end_s = recording.time_s.last().copied().unwrap_or(0.0);
    let settling_time_s = match last_outside_s {
        None => Some(0.0),
        Some(outside_s) if outside_s >= end_s => None,
        Some(outside_s) => Some((outside_s + recording.timestep_s - motion_end_s).max(0.0)),
    };
    let holding_torque_error_nm = recording
        .torque_nm
        .last()
        .zip(recording.state.last())
        .map_or(0.0, |(torque, state)| {
            (torque - cell.dynamics().gravity_torque(&state.position)).amax()
        });
    MotionMeasurement {
        settling_time_s,
        settling_band_m,
        peak_tracking_error_m,
        peak_torque_ratio,
        peak_speed_ratio,
        saturated_steps: recording.saturated_steps,
        saturated_joints: saturated_joints(recording),
        holding_torque_error_nm,
        contact,
    }
}

/// Compares the tips of recordings of one trajectory, step by step; none unless there are two.
pub fn engine_difference(
    cell: &Cell,
    goal: &Goal,
    recordings: &[&Recording],
) -> Option<EngineDifference> {
    EngineDifference::largest(pairs(recordings).map(|[a, b]| {
        let distances = a.state.iter().zip(&b.state).map(|(a, b)| {
            let tips = [a, b].map(|state| tip_of(cell, goal, &state.world_from_flange));
            (tips[0] - tips[1]).norm()
        });
        let (mut peak_tip_m, mut settled_tip_m): (f64, f64) = (0.0, 0.0);
        for distance_m in distances {
            peak_tip_m = peak_tip_m.max(distance_m);
            settled_tip_m = distance_m;
        }
        ([a.engine.name, b.engine.name], [peak_tip_m, settled_tip_m])
    }))
}
