//! Recordings as CSV.

use std::fmt::Write;

use needlebench_evaluation::sample_indices;
use needlebench_kinematics::JOINT_LABELS;
use needlebench_kinematics::ik::Configuration;
use needlebench_kinematics::trajectory::JointTrajectory;

use needlebench_bench::EngineRun;

/// Name of the file that a recording is written to: `Right-Down-Fold.rapier.csv`.
pub(crate) fn recording_name(configuration: Configuration, engine: &str) -> String {
    format!("{configuration}.{engine}.csv")
}

/// One row every `period_s`: time, phase, joints, torques, pose of the flange, contact, clearances.
///
/// Units are in the column names; the pose is the engine's own, in the world, quaternion w first.
/// The torque is the one that acted until that moment.
pub(crate) fn recording_csv(
    run: &EngineRun,
    trajectory: &JointTrajectory,
    period_s: f64,
) -> String {
    let recording = &run.recording;
    let mut out = String::from("time_s,phase");
    for quantity in [
        "position_rad",
        "velocity_rad_s",
        "reference_rad",
        "torque_nm",
    ] {
        for joint in JOINT_LABELS {
            // Writing to a String cannot fail.
            let _ = write!(out, ",{joint}_{quantity}");
        }
    }
    out.push_str(",flange_x_m,flange_y_m,flange_z_m,flange_qw,flange_qx,flange_qy,flange_qz");
    out.push_str(",rigid_contact_force_n,penetration_m");
    for class in run.clearance.distance_m.keys() {
        let _ = write!(out, ",{}_m", class.name());
    }
    out.push('\n');
    for (row, index) in sample_indices(recording, period_s).into_iter().enumerate() {
        let state = &recording.state[index];
        let time_s = recording.time_s[index];
        let _ = write!(out, "{time_s:.6},{}", trajectory.phase_at(time_s).name());
        let torque = recording.torque_nm.get(index.saturating_sub(1));
        let reference = &recording.reference[index].position;
        for value in state
            .position
            .iter()
            .chain(state.velocity.iter())
            .chain(reference.iter())
        {
            let _ = write!(out, ",{value:.12}");
        }
        for joint in 0..JOINT_LABELS.len() {
            let _ = write!(out, ",{:.9}", torque.map_or(0.0, |torque| torque[joint]));
        }
        let (position, q) = (
            state.world_from_flange.translation.vector,
            state.world_from_flange.rotation,
        );
        for value in [position.x, position.y, position.z, q.w, q.i, q.j, q.k] {
            let _ = write!(out, ",{value:.12}");
        }
        let contact = &state.contact;
        let _ = write!(
            out,
            ",{:.6},{:.9}",
            contact.normal_force_n, contact.deepest_penetration_m
        );
        for series in run.clearance.distance_m.values() {
            let _ = write!(out, ",{:.9}", series[row]);
        }
        out.push('\n');
    }
    out
}
