//! A prescribed contact.

use std::collections::BTreeMap;

use needlebench_clearance::ClearanceModel;
use needlebench_engine::Recording;
use needlebench_kinematics::trajectory::JointTrajectory;
use needlebench_scenario::Goal;
use serde::Serialize;

use crate::contact::{
    ContactEpisode, ForceBalance, add_approach_speeds, episodes, force_balance, settled_index,
};
use crate::engine_pairs::largest_over_pairs;
use crate::needle::tip_of;

/// Time before the settled force in which its ripple is taken, s.
const RIPPLE_S: f64 = 0.05;

/// What the forces of a staged contact mean, in the words of reports.
pub const RIGID_FORCE_MEANS: &str = "servo stiffness times depth, on a rigid surface; not the force on a patient, whose tissue \
     yields";

/// A prescribed contact, in all engines.
///
/// The phantom is rigid and so are table and gantry. What an arm that is commanded a depth into them presses with is
/// the stiffness of its servo times that depth: a check of engines and torques, and no force on a patient.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PressReport {
    /// Class of the contact.
    pub class: &'static str,
    /// The two solids that were to touch; empty where it could not be staged.
    pub solids: Vec<String>,
    /// How far the planned posture lies in the obstacle, m.
    pub depth_m: f64,
    /// How far the obstacle was moved after planning, in the world, m.
    pub displacement_m: Option<[f64; 3]>,
    /// Coulomb friction.
    pub friction: f64,
    /// What all forces here mean: [`RIGID_FORCE_MEANS`].
    pub force_means: &'static str,
    /// Why it could not be staged, if it could not.
    pub not_staged: Option<String>,
    /// What the engines measured.
    pub engines: BTreeMap<String, PressEngineReport>,
    /// Difference of the settled forces as a share of the larger, the largest over all pairs of
    /// engines; none unless all settled.
    pub force_difference: Option<f64>,
    /// Distance of the engines' tips when settled, likewise, m.
    pub tip_difference_settled_m: Option<f64>,
    /// Largest distance of the engines' tips, likewise, m.
    pub tip_difference_peak_m: Option<f64>,
}

/// A contact in one engine.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PressEngineReport {
    /// All contacts of the motion; a guide that bounces has several.
    pub episodes: Vec<ContactEpisode>,
    /// Settled sum of normal forces, N: the servo's stiffness times a depth, against a rigid surface; none
    /// without contact while the reference stood.
    pub settled_force_n: Option<f64>,
    /// The same from the joints' torques.
    pub balance: Option<ForceBalance>,
    /// Difference of the two as a share of the latter.
    pub balance_difference: Option<f64>,
    /// Distance of the tip from its reference when settled, m: what the servo yields.
    pub settled_tip_offset_m: Option<f64>,
    /// Range of that force in the 50 ms before, N: a contact that chatters has not settled.
    pub force_ripple_n: Option<f64>,
    /// Time from the end of the last contact until the tip follows its reference again, s.
    pub recovery_s: Option<f64>,
    /// Steps in which a torque was cut at its limit.
    pub saturated_steps: usize,
}

/// Measures a contact. `cell` and `model` are those with the obstacle moved, `bodies` those that were
/// to touch.
#[expect(clippy::too_many_arguments, reason = "a plan and its recording")]
pub fn measure_press(
    cell: &needlebench_cell::Cell,
    model: &ClearanceModel,
    bodies: [usize; 2],
    goal: &Goal,
    trajectory: &JointTrajectory,
    recording: &Recording,
    friction: f64,
    settling_band_m: f64,
) -> PressEngineReport {
    let mut episodes = episodes(cell, goal, trajectory, recording, settling_band_m);
    add_approach_speeds(&mut episodes, cell, model, recording);
    let settled = settled_contact(recording);
    let state = settled.map(|k| &recording.state[k]);
    let balance = settled.filter(|k| *k > 0).and_then(|k| {
        let torque = &recording.torque_nm[k - 1];
        let q = &recording.state[k].position;
        force_balance(cell, model, bodies, q, torque, friction)
    });
    let settled_force_n = state.map(|state| state.contact.normal_force_n);
    PressEngineReport {
        settled_force_n,
        balance,
        balance_difference: settled_force_n.zip(balance).map(|(force_n, balance)| {
            (force_n - balance.normal_force_n).abs() / balance.normal_force_n.abs()
        }),
        settled_tip_offset_m: settled.map(|k| {
            let reference = cell
                .robot
                .world_from_flange(&recording.reference[k].position);
            let tip = tip_of(cell, goal, &recording.state[k].world_from_flange);
            (tip - tip_of(cell, goal, &reference)).norm()
        }),
        force_ripple_n: settled.map(|k| {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "small, positive"
            )]
            let window = (RIPPLE_S / recording.timestep_s).round() as usize;
            let forces = recording.state[k.saturating_sub(window)..=k]
                .iter()
                .map(|state| state.contact.normal_force_n);
            let (least, most) = forces.fold((f64::INFINITY, 0.0_f64), |(least, most), force| {
                (least.min(force), most.max(force))
            });
            most - least
        }),
        recovery_s: episodes.last().and_then(|each| each.tip_recovery_s),
        episodes,
        saturated_steps: recording.saturated_steps,
    }
}

/// Last state in contact at which the reference has stood for long enough.
fn settled_contact(recording: &Recording) -> Option<usize> {
    // While it stands in the obstacle, not at the rest after the way back.
    let last = recording
        .state
        .iter()
        .rposition(|state| state.contact.count > 0)?;
    settled_index(recording, 0, last + 1).filter(|k| recording.state[*k].contact.count > 0)
}

/// Adds how the engines differ: the largest over all pairs of them.
pub fn press_difference(
    report: &mut PressReport,
    cell: &needlebench_cell::Cell,
    goal: &Goal,
    recordings: &[&Recording],
) {
    let tips_m = |a: &Recording, b: &Recording, k: usize| {
        let [a, b] = [a, b].map(|each| tip_of(cell, goal, &each.state[k].world_from_flange));
        (a - b).norm()
    };
    let settled = |a: &Recording, b: &Recording| settled_contact(a).zip(settled_contact(b));
    report.tip_difference_peak_m = largest_over_pairs(recordings, |a, b| {
        let steps = a.state.len().min(b.state.len());
        (0..steps).map(|k| tips_m(a, b, k)).reduce(f64::max)
    });
    report.tip_difference_settled_m = largest_over_pairs(recordings, |a, b| {
        settled(a, b).map(|(ka, kb)| tips_m(a, b, ka.min(kb)))
    });
    report.force_difference = largest_over_pairs(recordings, |a, b| {
        let (ka, kb) = settled(a, b)?;
        let forces = [&a.state[ka], &b.state[kb]].map(|state| state.contact.normal_force_n);
        let larger = forces[0].max(forces[1]);
        (larger > 0.0).then(|| (forces[0] - forces[1]).abs() / larger)
    });
}
