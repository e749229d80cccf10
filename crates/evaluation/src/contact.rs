//! Contacts, one by one.

use nalgebra::Vector3;
use needlebench_cell::{Cell, Frame};
use needlebench_clearance::ClearanceModel;
use needlebench_engine::Recording;
use needlebench_kinematics::Joints;
use needlebench_kinematics::trajectory::JointTrajectory;
use needlebench_scenario::Goal;
use serde::Serialize;

use crate::needle::tip_of;

/// Contacts that are apart by less than this are one, s.
const EPISODE_GAP_S: f64 = 0.01;

/// A reference that has stood for this long gives settled values, s: servo and contact die out with
/// 30 ms.
const SETTLED_AFTER_S: f64 = 0.15;

/// One contact, from the first touch until the bodies are apart.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ContactEpisode {
    /// First touch, s.
    pub start_s: f64,
    /// First moment apart again, s; none if they touch to the end.
    pub end_s: Option<f64>,
    /// Phase of the first touch.
    pub phase: &'static str,
    /// Bodies that bear most of the force at the first touch.
    pub pair: Option<[String; 2]>,
    /// Speed at which they came together, m/s: of the nearest points, along the normal, in the state
    /// before the touch. None where the motion starts in contact.
    pub approach_speed_m_s: Option<f64>,
    /// Largest sum of normal forces against a rigid surface, N.
    pub peak_force_n: f64,
    /// Sum of normal forces when the reference has stood long enough, N: the servo's stiffness times the depth that
    /// it is commanded into a rigid surface, and no force on a patient; none if it never stands.
    pub settled_force_n: Option<f64>,
    /// Integral of the sum of normal forces, N s.
    pub impulse_ns: f64,
    /// Deepest penetration, m.
    pub deepest_penetration_m: f64,
    /// Penetration at the same time as the settled force, m.
    pub settled_penetration_m: Option<f64>,
    /// Time from when the reference leaves its stand until the bodies are apart, s.
    pub release_s: Option<f64>,
    /// Largest distance of the needle's tip from its reference afterwards, m.
    pub tip_peak_after_m: Option<f64>,
    /// Time from the end until the tip stays within the settling band about its reference, s; none
    /// if it does not before the recording or the time to the next contact ends.
    pub tip_recovery_s: Option<f64>,
}

/// All contacts of a recording in order of time, without speeds of approach.
pub(crate) fn episodes(
    cell: &Cell,
    goal: &Goal,
    trajectory: &JointTrajectory,
    recording: &Recording,
    settling_band_m: f64,
) -> Vec<ContactEpisode> {
    let spans = spans(recording);
    spans
        .iter()
        .enumerate()
        .map(|(k, &(from, to))| {
            let until = spans
                .get(k + 1)
                .map_or(recording.state.len(), |next| next.0);
            let mut episode = of_span(cell, trajectory, recording, from, to);
            let ends = to < recording.state.len();
            if ends {
                let distance_m = |k: usize| {
                    let reference = cell
                        .robot
                        .world_from_flange(&recording.reference[k].position);
                    let state = &recording.state[k].world_from_flange;
                    (tip_of(cell, goal, state) - tip_of(cell, goal, &reference)).norm()
                };
                let after: Vec<f64> = (to..until).map(distance_m).collect();
                episode.tip_peak_after_m = after.iter().copied().reduce(f64::max);
                let last_outside = after.iter().rposition(|each| *each > settling_band_m);
                episode.tip_recovery_s = match last_outside {
                    None => Some(0.0),
                    Some(last) if last + 1 == after.len() => None,
                    Some(last) => Some((last + 1) as f64 * recording.timestep_s),
                };
            }
            episode
        })
        .collect()
}

/// First index in contact and first index apart, per contact.
fn spans(recording: &Recording) -> Vec<(usize, usize)> {
    let mut spans: Vec<(usize, usize)> = Vec::new();
    for (k, state) in recording.state.iter().enumerate() {
        if state.contact.count == 0 {
            continue;
        }
        match spans.last_mut() {
            Some((_, end)) if ((k - *end) as f64) * recording.timestep_s < EPISODE_GAP_S => {
                *end = k + 1;
            }
            _ => spans.push((k, k + 1)),
        }
    }
    spans
}

fn of_span(
    cell: &Cell,
    trajectory: &JointTrajectory,
    recording: &Recording,
    from: usize,
    to: usize,
) -> ContactEpisode {
    let contacts = || recording.state[from..to].iter().map(|state| state.contact);
    let time_s = recording.time_s[from];
    let settled = settled_index(recording, from, to);
    let apart_s = recording.time_s.get(to).copied();
    let leaves = settled.map(|k| recording.time_s[k]);
    ContactEpisode {
        start_s: time_s,
        end_s: apart_s,
        phase: trajectory.phase_at(time_s).name(),
        pair: recording.state[from]
            .contact
            .pair
            .map(|(a, b)| [a, b].map(|index| cell.bodies[index as usize].name.clone())),
        approach_speed_m_s: None,
        peak_force_n: contacts()
            .map(|each| each.normal_force_n)
            .fold(0.0, f64::max),
        settled_force_n: settled.map(|k| recording.state[k].contact.normal_force_n),
        impulse_ns: contacts().map(|each| each.normal_force_n).sum::<f64>() * recording.timestep_s,
        deepest_penetration_m: contacts()
            .map(|each| each.deepest_penetration_m)
            .fold(0.0, f64::max),
        settled_penetration_m: settled.map(|k| recording.state[k].contact.deepest_penetration_m),
        release_s: leaves.zip(apart_s).map(|(leaves, apart)| apart - leaves),
        tip_peak_after_m: None,
        tip_recovery_s: None,
    }
}

/// The last state of a contact at which the reference has stood for long enough.
pub(crate) fn settled_index(recording: &Recording, from: usize, to: usize) -> Option<usize> {
    let stands = |k: usize| recording.reference[k].velocity == Joints::zeros();
    let mut stood = 0_usize;
    let mut settled = None;
    for k in from..to {
        stood = if stands(k) { stood + 1 } else { 0 };
        if stood as f64 * recording.timestep_s >= SETTLED_AFTER_S {
            settled = Some(k);
        }
    }
    settled
}

/// Adds the speeds at which bodies came together.
///
/// `model` is that of `cell`, the one that was simulated.
pub fn add_approach_speeds(
    episodes: &mut [ContactEpisode],
    cell: &Cell,
    model: &ClearanceModel,
    recording: &Recording,
) {
    for episode in episodes {
        let touched = recording
            .time_s
            .partition_point(|time_s| *time_s < episode.start_s);
        let Some((before, (a, b))) = touched
            .checked_sub(1)
            .map(|k| &recording.state[k])
            .zip(recording.state[touched].contact.pair)
        else {
            continue;
        };
        let (a, b) = (a as usize, b as usize);
        let pairs = model.all_pairs(&before.position);
        let Some(nearest) = pairs.iter().find(|each| {
            let pair = cell.pairs[each.pair];
            [(a, b), (b, a)].contains(&(pair.a, pair.b))
        }) else {
            continue;
        };
        let pair = cell.pairs[nearest.pair];
        let (gap, normal) = (&nearest.separation, nearest.separation.normal.into_inner());
        let speed = |body: usize, point: &nalgebra::Point3<f64>| match cell.bodies[body].frame {
            Frame::World => 0.0,
            Frame::Link(link) => {
                response(cell, &before.position, link, &point.coords, &normal).dot(&before.velocity)
            }
        };
        episode.approach_speed_m_s =
            Some(speed(pair.a, &gap.point_on_a) - speed(pair.b, &gap.point_on_b));
    }
}

/// [`needlebench_kinematics::Chain::point_response`] with point and direction in the world.
fn response(
    cell: &Cell,
    q: &Joints,
    link: usize,
    point_m: &Vector3<f64>,
    direction: &Vector3<f64>,
) -> Joints {
    let to_base = cell.robot.world_from_base_link.inverse();
    let point = to_base * nalgebra::Point3::from(*point_m);
    cell.robot
        .chain
        .point_response(q, link, &point.coords, &(to_base.rotation * direction))
}

/// Force that balances the joints' torques, from the recorded posture and torque alone.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ForceBalance {
    /// Force that presses the bodies together, N.
    pub normal_force_n: f64,
    /// Force across it, N; 0 where there is no friction.
    pub tangential_force_n: f64,
    /// Share of the torques that no force at the point explains: more than a point touches, or the
    /// arm does not rest.
    pub unexplained: f64,
}

/// The force at the nearest points of two bodies that explains what the joints' torques hold besides
/// gravity: `J_p^T f = g(q) - tau`.
///
/// The engine's own contacts play no part in it: point and normal are those of our own clearances, the
/// dynamics is our own. Without friction the force is along the normal, one number from up to six
/// equations; with it three numbers. None for two bodies that are no pair, and where no joint can
/// answer the force.
pub(crate) fn force_balance(
    cell: &Cell,
    model: &ClearanceModel,
    bodies: [usize; 2],
    position: &Joints,
    torque_nm: &Joints,
    friction: f64,
) -> Option<ForceBalance> {
    let nearest = model.all_pairs(position).into_iter().find(|each| {
        let pair = cell.pairs[each.pair];
        [pair.a, pair.b] == bodies
    })?;
    let Frame::Link(link) = cell.bodies[bodies[0]].frame else {
        return None;
    };
    let point = nearest.separation.point_on_a.coords;
    let normal = nearest.separation.normal.into_inner();
    let held = cell.dynamics().gravity_torque(position) - torque_nm;
    // On the arm, which the obstacle pushes back.
    let along = -response(cell, position, link, &point, &normal);
    if along.norm_squared() <= 0.0 {
        return None;
    }
    if friction <= 0.0 {
        let force_n = held.dot(&along) / along.norm_squared();
        return Some(ForceBalance {
            normal_force_n: force_n,
            tangential_force_n: 0.0,
            unexplained: (held - along * force_n).norm() / held.norm(),
        });
    }
    let (across, aside) = {
        let helper = if normal.x.abs() < 0.5 {
            Vector3::x()
        } else {
            Vector3::y()
        };
        let across = normal.cross(&helper).normalize();
        (across, normal.cross(&across))
    };
    let columns = nalgebra::Matrix6x3::from_columns(&[
        along,
        response(cell, position, link, &point, &across),
        response(cell, position, link, &point, &aside),
    ]);
    let force = (columns.transpose() * columns).try_inverse()? * columns.transpose() * held;
    Some(ForceBalance {
        normal_force_n: force.x,
        tangential_force_n: libm::hypot(force.y, force.z),
        unexplained: (held - columns * force).norm() / held.norm(),
    })
}
