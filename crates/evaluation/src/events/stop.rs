//! A stop in one engine.

use needlebench_cell::Cell;
use needlebench_clearance::ClearanceModel;
use needlebench_engine::Recording;
use needlebench_kinematics::trajectory::JointTrajectory;
use needlebench_scenario::Goal;
use serde::Serialize;

use crate::clearance::{certify_recording, measure_clearance};
use crate::contact::ContactEpisode;
use crate::needle::tip_of;
use crate::report::ClearanceReport;

/// Speed below which a joint stands, rad/s: half a millimetre a second at the end of the arm.
const STANDING_RAD_S: f64 = 1e-3;

/// A stop in one engine.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StopEngineReport {
    /// Time from the trigger until all joints stand for good, s; none if they do not.
    pub stopping_time_s: Option<f64>,
    /// Way of each joint from the trigger to its stand, rad.
    pub joint_travel_rad: [f64; 6],
    /// Distance of the needle's tip from where it was at the trigger, in the end, m.
    pub tip_distance_m: f64,
    /// The same of the flange.
    pub flange_distance_m: f64,
    /// Largest distance of the flange from the planned path, m: categories 1 and 2 keep to it.
    pub off_path_m: f64,
    /// Contacts from the trigger on.
    pub contacts: Vec<ContactEpisode>,
    /// Least clearances from the trigger on, with their certified bounds.
    pub clearance: ClearanceReport,
}

/// Measures a stop that was triggered at `at_s`; `planned` is the motion without it.
pub fn measure_stop(
    cell: &Cell,
    model: &ClearanceModel,
    goal: &Goal,
    (planned, trajectory): (&JointTrajectory, &JointTrajectory),
    recording: &Recording,
    at_s: f64,
    (period_s, tolerance_m, settling_band_m): (f64, f64, f64),
) -> StopEngineReport {
    let trigger = recording
        .time_s
        .partition_point(|time_s| *time_s < at_s - 0.5 * recording.timestep_s)
        .min(recording.state.len() - 1);
    let after = since(recording, trigger);
    let (first, last) = (&after.state[0], &after.state[after.state.len() - 1]);
    let moving = after
        .state
        .iter()
        .rposition(|state| state.velocity.amax() >= STANDING_RAD_S);
    let stopping_time_s = match moving {
        None => Some(0.0),
        Some(k) if k + 1 == after.state.len() => None,
        Some(k) => Some((k + 1) as f64 * recording.timestep_s),
    };
    let tip = |flange| tip_of(cell, goal, flange);
    let mut series = measure_clearance(cell, model, trajectory, &after, period_s);
    certify_recording(&mut series, cell, model, trajectory, &after, tolerance_m);
    let mut contacts = crate::contact::episodes(cell, goal, trajectory, &after, settling_band_m);
    crate::contact::add_approach_speeds(&mut contacts, cell, model, &after);
    StopEngineReport {
        stopping_time_s,
        joint_travel_rad: (last.position - first.position).abs().into(),
        tip_distance_m: (tip(&last.world_from_flange) - tip(&first.world_from_flange)).norm(),
        flange_distance_m: (last.world_from_flange.translation.vector
            - first.world_from_flange.translation.vector)
            .norm(),
        off_path_m: off_path_m(cell, planned, &after, at_s),
        contacts,
        clearance: ClearanceReport::of(&series.minima),
    }
}

/// Largest distance of the recorded flange from the planned path after `at_s`, by samples of it.
fn off_path_m(cell: &Cell, planned: &JointTrajectory, after: &Recording, at_s: f64) -> f64 {
    /// Samples of the path: every 2 ms, a millimetre of the fastest motion.
    const SPACING_S: f64 = 2e-3;
    /// Every so many states.
    const STRIDE: usize = 20;
    let span_s = after.time_s[after.time_s.len() - 1] - after.time_s[0];
    let count = (span_s / SPACING_S).ceil();
    let place = |time_s: f64| {
        let q = planned.sample(time_s).position;
        cell.robot.world_from_flange(&q).translation.vector
    };
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "small, positive"
    )]
    let path: Vec<_> = (0..=count as u32)
        .map(|k| place(at_s + f64::from(k) * SPACING_S))
        .collect();
    after
        .state
        .iter()
        .step_by(STRIDE)
        .chain(after.state.last())
        .map(|state| {
            let here = state.world_from_flange.translation.vector;
            path.windows(2)
                .map(|ends| {
                    let way = ends[1] - ends[0];
                    let length = way.norm_squared();
                    let share = if length > 0.0 {
                        ((here - ends[0]).dot(&way) / length).clamp(0.0, 1.0)
                    } else {
                        0.0
                    };
                    (here - ends[0] - way * share).norm()
                })
                .fold(f64::INFINITY, f64::min)
        })
        .filter(|distance| distance.is_finite())
        .fold(0.0, f64::max)
}

/// A recording from one of its states on.
fn since(recording: &Recording, from: usize) -> Recording {
    Recording {
        engine: recording.engine.clone(),
        timestep_s: recording.timestep_s,
        velocity_age_s: recording.velocity_age_s,
        time_s: recording.time_s[from..].to_vec(),
        state: recording.state[from..].to_vec(),
        reference: recording.reference[from..].to_vec(),
        torque_nm: recording.torque_nm[from..].to_vec(),
        drive_nm: recording.drive_nm[from..].to_vec(),
        saturated_steps: 0,
        saturation: Default::default(),
        cost: recording.cost,
    }
}
