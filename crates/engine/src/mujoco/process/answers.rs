//! What the harness answers, decoded.

use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, UnitQuaternion, Vector3};
use needlebench_kinematics::Pose;

use super::wire::{Malformed, PROTOCOL_VERSION, Payload};

/// Versions of what runs in the harness process.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct HarnessVersions {
    /// MuJoCo's version.
    pub mujoco: String,
    /// Python's version.
    pub python: String,
    /// numpy's version.
    pub numpy: String,
}

/// A model that the harness has compiled, and the names in it, in MuJoCo's order.
///
/// Unnamed objects have empty names. Body 0 is MuJoCo's `world`.
#[derive(Debug, Clone, PartialEq)]
pub struct PlantHandle {
    pub(super) index: u32,
    /// Length of `qpos`.
    pub qpos_count: usize,
    /// Length of `qvel`, `qacc` and of the torques.
    pub dof_count: usize,
    /// Time step of the model, s.
    pub timestep_s: f64,
    /// Joint names.
    pub joint_names: Vec<String>,
    /// Body names.
    pub body_names: Vec<String>,
    /// Geom names.
    pub geom_names: Vec<String>,
}

/// The contacts that acted during a step; MuJoCo finds them at the state that the step begins with.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ContactSummary {
    /// Number of contact points that touch or bear a force.
    pub count: u32,
    /// Largest penetration, m; zero without contact.
    pub deepest_penetration_m: f64,
    /// Sum of the normal forces of all contact points, N.
    pub normal_force_n: f64,
    /// Geoms of the contact point with the largest normal force, if any bears one.
    pub strongest_pair: Option<[u32; 2]>,
    /// Geoms of the deepest contact point.
    pub deepest_pair: Option<[u32; 2]>,
}

/// State of a plant after a step, all of it read from the engine's own data.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct HarnessState {
    /// Simulated time since the reset, s.
    pub time_s: f64,
    /// Joint positions, rad (m for slides).
    pub qpos: Vec<f64>,
    /// Joint velocities, rad/s (m/s for slides).
    pub qvel: Vec<f64>,
    /// Position of the observed site in world, m; it belongs to `qpos`.
    pub site_position_m: Vector3<f64>,
    /// Rotation of the observed site: its axes in world, as columns.
    pub site_rotation: Matrix3<f64>,
    /// Contacts during the step.
    pub contact: ContactSummary,
}

impl HarnessState {
    /// Pose of the observed site.
    pub fn world_from_site(&self) -> Pose {
        pose(self.site_position_m, self.site_rotation)
    }
}

/// Rigid-body dynamics at one state as MuJoCo computes them, in joint coordinates.
#[derive(Debug, Clone, PartialEq)]
pub struct InverseDynamics {
    /// Torque that causes the acceleration: `mass_matrix * qacc + bias`, N m.
    pub torque_nm: DVector<f64>,
    /// Mass matrix with armature, kg m^2.
    pub mass_matrix: DMatrix<f64>,
    /// Gravity, Coriolis and centrifugal torque, N m.
    pub bias_nm: DVector<f64>,
    /// Gravity torque alone: the bias at zero velocity, N m.
    pub gravity_nm: DVector<f64>,
    /// Pose of every body, in the order of [`PlantHandle::body_names`].
    pub world_from_body: Vec<Pose>,
}

/// Signed distance of two geoms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GeomDistance {
    /// Gap, m; negative when the geoms overlap.
    pub distance_m: f64,
    /// Nearest point of the first geom, in world, m.
    pub point_on_first_m: Vector3<f64>,
    /// Nearest point of the second geom, in world, m.
    pub point_on_second_m: Vector3<f64>,
}

fn pose(position_m: Vector3<f64>, rotation: Matrix3<f64>) -> Pose {
    let rotation = Rotation3::from_matrix_unchecked(rotation);
    Pose::from_parts(
        position_m.into(),
        UnitQuaternion::from_rotation_matrix(&rotation),
    )
}

pub(super) fn versions(mut payload: Payload<'_>) -> Result<HarnessVersions, Malformed> {
    if payload.u32()? != PROTOCOL_VERSION {
        return Err(Malformed);
    }
    let [mujoco, python, numpy] =
        <[String; 3]>::try_from(payload.strings()?).map_err(|_| Malformed)?;
    payload.finish()?;
    Ok(HarnessVersions {
        mujoco,
        python,
        numpy,
    })
}

/// An answer that says no more than that it is done.
pub(super) fn nothing(payload: Payload<'_>) -> Result<(), Malformed> {
    payload.finish()
}

pub(super) fn plant(mut payload: Payload<'_>) -> Result<PlantHandle, Malformed> {
    let index = payload.u32()?;
    let qpos_count = payload.u32()? as usize;
    let dof_count = payload.u32()? as usize;
    let name_counts = [payload.u32()?, payload.u32()?, payload.u32()?];
    let timestep_s = payload.f64()?;
    let names = [payload.strings()?, payload.strings()?, payload.strings()?];
    payload.finish()?;
    let counted = names.each_ref().map(Vec::len);
    if counted != name_counts.map(|count| count as usize) {
        return Err(Malformed);
    }
    let [joint_names, body_names, geom_names] = names;
    Ok(PlantHandle {
        index,
        qpos_count,
        dof_count,
        timestep_s,
        joint_names,
        body_names,
        geom_names,
    })
}

pub(super) fn state(
    mut payload: Payload<'_>,
    plant: &PlantHandle,
) -> Result<HarnessState, Malformed> {
    let mut state = HarnessState::default();
    state_into(&mut payload, plant, &mut state)?;
    payload.finish()?;
    Ok(state)
}

fn state_into(
    payload: &mut Payload<'_>,
    plant: &PlantHandle,
    state: &mut HarnessState,
) -> Result<(), Malformed> {
    if payload.u32()? != plant.index {
        return Err(Malformed);
    }
    state.contact.count = payload.u32()?;
    state.contact.strongest_pair = optional_pair(payload)?;
    state.contact.deepest_pair = optional_pair(payload)?;
    state.time_s = payload.f64()?;
    state.contact.deepest_penetration_m = payload.f64()?;
    state.contact.normal_force_n = payload.f64()?;
    state.site_position_m = payload.vector()?;
    state.site_rotation = payload.rotation()?;
    payload.f64s_into(plant.qpos_count, &mut state.qpos)?;
    payload.f64s_into(plant.dof_count, &mut state.qvel)
}

/// States of several plants; a place in the second list failed for the reason given.
pub(super) fn group_state<'a>(
    mut payload: Payload<'_>,
    plants: impl ExactSizeIterator<Item = &'a PlantHandle>,
    states: &mut Vec<HarnessState>,
) -> Result<Vec<(usize, String)>, Malformed> {
    let count = plants.len();
    if payload.u32()? as usize != count {
        return Err(Malformed);
    }
    let failures = payload.u32()?;
    states.resize_with(count, HarnessState::default);
    for (plant, state) in plants.zip(states) {
        state_into(&mut payload, plant, state)?;
    }
    let mut failed = Vec::new();
    for _ in 0..failures {
        let place = payload.u32()? as usize;
        if place >= count {
            return Err(Malformed);
        }
        failed.push((place, payload.string()?));
    }
    payload.finish()?;
    Ok(failed)
}

pub(super) fn copy(
    mut payload: Payload<'_>,
    original: &PlantHandle,
) -> Result<PlantHandle, Malformed> {
    let index = payload.u32()?;
    payload.finish()?;
    Ok(PlantHandle {
        index,
        ..original.clone()
    })
}

/// How long a replay took in the harness, and where it ended.
#[derive(Debug, Clone, PartialEq)]
pub struct Replay {
    /// Duration of the loop over `mj_step` alone, on the harness's own clock, s.
    pub elapsed_s: f64,
    /// Joint positions at its end, rad (m for slides).
    pub qpos: Vec<f64>,
    /// Joint velocities at its end, rad/s (m/s for slides).
    pub qvel: Vec<f64>,
}

pub(super) fn replay(mut payload: Payload<'_>, plant: &PlantHandle) -> Result<Replay, Malformed> {
    let replay = Replay {
        elapsed_s: payload.f64()?,
        qpos: payload.f64s(plant.qpos_count)?,
        qvel: payload.f64s(plant.dof_count)?,
    };
    payload.finish()?;
    Ok(replay)
}

fn optional_pair(payload: &mut Payload<'_>) -> Result<Option<[u32; 2]>, Malformed> {
    match [payload.optional_index()?, payload.optional_index()?] {
        [Some(first), Some(second)] => Ok(Some([first, second])),
        [None, None] => Ok(None),
        _ => Err(Malformed),
    }
}

pub(super) fn dynamics(
    mut payload: Payload<'_>,
    plant: &PlantHandle,
) -> Result<InverseDynamics, Malformed> {
    let bodies = plant.body_names.len();
    let dofs = plant.dof_count;
    let header = [
        payload.u32()?,
        payload.u32()?,
        payload.u32()?,
        payload.u32()?,
    ];
    if header[0] != plant.index || header[1] as usize != dofs || header[2] as usize != bodies {
        return Err(Malformed);
    }
    let torque_nm = payload.f64s(dofs)?.into();
    let mass_matrix = DMatrix::from_row_slice(dofs, dofs, &payload.f64s(dofs * dofs)?);
    let bias_nm = payload.f64s(dofs)?.into();
    let gravity_nm = payload.f64s(dofs)?.into();
    let mut positions_m = Vec::with_capacity(bodies);
    for _ in 0..bodies {
        positions_m.push(payload.vector()?);
    }
    let mut world_from_body = Vec::with_capacity(bodies);
    for position_m in positions_m {
        world_from_body.push(pose(position_m, payload.rotation()?));
    }
    payload.finish()?;
    Ok(InverseDynamics {
        torque_nm,
        mass_matrix,
        bias_nm,
        gravity_nm,
        world_from_body,
    })
}

pub(super) fn distance(
    mut payload: Payload<'_>,
    cutoff_m: f64,
) -> Result<Option<GeomDistance>, Malformed> {
    let distance_m = payload.f64()?;
    let point_on_first_m = payload.vector()?;
    let point_on_second_m = payload.vector()?;
    payload.finish()?;
    // At and beyond the cutoff MuJoCo returns the cutoff itself, and no points.
    Ok((distance_m < cutoff_m).then_some(GeomDistance {
        distance_m,
        point_on_first_m,
        point_on_second_m,
    }))
}
