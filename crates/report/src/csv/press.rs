//! The recording of a prescribed contact.

use std::fmt::Write;

use needlebench_engine::Recording;
use needlebench_kinematics::JOINT_LABELS;
use needlebench_planning::PressPlan;
use needlebench_scenario::Goal;

/// Signed distance of the bodies that are to touch, m.
pub(crate) fn clearance_m(press: &PressPlan, recording: &Recording, index: usize) -> Option<f64> {
    let minima = press
        .model
        .minimum_per_class(&recording.state[index].position);
    minima
        .get(press.class)
        .map(|found| found.separation.distance_m)
}

/// Steps between two rows of a contact's recording and two points of its chart.
pub(crate) const STRIDE: usize = 5;

/// One row every fifth step: time, phase, contact, clearance of what is to touch, joints and torques.
///
/// Clearance is our own, of the recorded posture; force and depth are the engine's.
pub(crate) fn press_csv(goal: &Goal, press: &PressPlan, recording: &Recording) -> String {
    let mut out = String::from("time_s,phase,rigid_contact_force_n,penetration_m,clearance_m");
    out.push_str(",tip_x_m,tip_y_m,tip_z_m");
    for quantity in ["position_rad", "torque_nm"] {
        for joint in JOINT_LABELS {
            // Writing to a String cannot fail.
            let _ = write!(out, ",{joint}_{quantity}");
        }
    }
    out.push('\n');
    for index in (0..recording.state.len()).step_by(STRIDE) {
        let (state, time_s) = (&recording.state[index], recording.time_s[index]);
        let contact = &state.contact;
        let _ = write!(
            out,
            "{time_s:.6},{},{:.6},{:.9},{:.9}",
            press.trajectory.phase_at(time_s).name(),
            contact.normal_force_n,
            contact.deepest_penetration_m,
            clearance_m(press, recording, index).unwrap_or(f64::NAN)
        );
        let exit = state.world_from_flange * press.cell.tool.flange_from_guide_exit;
        let tip = exit * nalgebra::Point3::new(0.0, 0.0, goal.insertion_length_m);
        let torque = recording.torque_nm.get(index.saturating_sub(1));
        for value in tip.iter().chain(state.position.iter()) {
            let _ = write!(out, ",{value:.12}");
        }
        for joint in 0..JOINT_LABELS.len() {
            let _ = write!(out, ",{:.9}", torque.map_or(0.0, |torque| torque[joint]));
        }
        out.push('\n');
    }
    out
}
