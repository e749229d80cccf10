//! The retreat along the needle.

use nalgebra::Vector3;
use needlebench_cell::Cell;
use needlebench_clearance::ClearanceModel;
use needlebench_engine::Recording;
use needlebench_kinematics::trajectory::{JointTrajectory, Phase};
use needlebench_scenario::Goal;
use serde::Serialize;

use crate::clearance::{certify_recording, measure_clearance};
use crate::contact::ContactEpisode;
use crate::needle::tip_of;
use crate::report::ClearanceReport;

/// The retreat in one engine.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RetractionEngineReport {
    /// Length of the needle that lies in the patient at the start, m: from entry point to target.
    pub inserted_length_m: f64,
    /// Length of the linear retreat, m.
    pub straight_length_m: f64,
    /// Whether the straight way is as long as the inserted length. Where it is not, the needle has to
    /// be drawn by hand before the arm turns off.
    pub needle_clears: bool,
    /// Largest distance of the guide's exit from the needle's axis while the needle is in and the way
    /// is straight, m: as much the guide bends a needle at the skin.
    pub largest_lateral_deviation_m: f64,
    /// Largest angle between guide and axis in that time, rad.
    pub largest_angle_rad: f64,
    /// Largest distance of the tip of a needle that is fixed in the guide from the axis, m.
    pub largest_tip_deviation_m: f64,
    /// When the largest lateral deviation was, s.
    pub at_s: f64,
    /// Time of the whole way, s.
    pub duration_s: f64,
    /// Contacts on the way.
    pub contacts: Vec<ContactEpisode>,
    /// Least clearances on the way, with their certified bounds.
    pub clearance: ClearanceReport,
}

/// Measures a retreat.
pub fn measure_retraction(
    cell: &Cell,
    model: &ClearanceModel,
    goal: &Goal,
    trajectory: &JointTrajectory,
    recording: &Recording,
    (period_s, tolerance_m, settling_band_m): (f64, f64, f64),
) -> RetractionEngineReport {
    let axis = goal.axis.into_inner();
    let inserted_length_m = goal.entry_m.map_or(goal.insertion_length_m, |entry| {
        (goal.target_m - entry).norm()
    });
    let exit_of =
        |k: usize| recording.state[k].world_from_flange * cell.tool.flange_from_guide_exit;
    let first = exit_of(0).translation.vector;
    let off_axis = |point: &Vector3<f64>| {
        let from_target = point - goal.aimed_m().coords;
        (from_target - axis * axis.dot(&from_target)).norm()
    };
    let (mut lateral_m, mut angle_rad, mut tip_m, mut at_s) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0);
    let mut straight_length_m = 0.0_f64;
    for (k, &time_s) in recording.time_s.iter().enumerate() {
        if trajectory.phase_at(time_s) != Phase::Retract {
            continue;
        }
        let exit = exit_of(k);
        let back_m = -axis.dot(&(exit.translation.vector - first));
        straight_length_m = straight_length_m.max(back_m);
        if back_m > inserted_length_m {
            continue;
        }
        let here_m = off_axis(&exit.translation.vector);
        if here_m > lateral_m {
            (lateral_m, at_s) = (here_m, time_s);
        }
        let along = exit.rotation * Vector3::z();
        angle_rad = angle_rad.max(libm::atan2(along.cross(&axis).norm(), along.dot(&axis)));
        let tip = tip_of(cell, goal, &recording.state[k].world_from_flange);
        tip_m = tip_m.max(off_axis(&tip.coords));
    }
    let mut series = measure_clearance(cell, model, trajectory, recording, period_s);
    certify_recording(&mut series, cell, model, trajectory, recording, tolerance_m);
    let mut contacts = crate::contact::episodes(cell, goal, trajectory, recording, settling_band_m);
    crate::contact::add_approach_speeds(&mut contacts, cell, model, recording);
    RetractionEngineReport {
        inserted_length_m,
        straight_length_m,
        // The servo is this near to its reference.
        needle_clears: straight_length_m + 1e-5 >= inserted_length_m,
        largest_lateral_deviation_m: lateral_m,
        largest_angle_rad: angle_rad,
        largest_tip_deviation_m: tip_m,
        at_s,
        duration_s: trajectory.duration_s(),
        contacts,
        clearance: ClearanceReport::of(&series.minima),
    }
}
