//! What the run loop knows of a physics engine.

use needlebench_kinematics::{JOINT_COUNT, Joints, Pose};
use serde::Serialize;

use crate::EngineError;

/// Name, version and settings of an engine, for the provenance of a result.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct EngineIdentity {
    /// `rapier`, `mujoco` or `referee`.
    pub name: String,
    /// Version of the engine.
    pub version: String,
    /// Everything that was set, in a fixed order.
    pub settings: Vec<(String, String)>,
}

/// Contacts between the physical pairs of a cell, as the engine's own solver saw them.
///
/// Both engines find contacts at the start of a step and solve forces over it, so in the state
/// after a step the depth belongs to the step's start and the force to the whole step.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Contact {
    /// Contact points that penetrate or bear a force.
    pub count: u32,
    /// Deepest penetration, m; 0 without contact.
    pub deepest_penetration_m: f64,
    /// Sum of the normal forces of all contact points, N.
    pub normal_force_n: f64,
    /// Bodies of the contact point with the largest normal force (of the deepest, if none bears
    /// any), as indices into `Cell::bodies`, the smaller first.
    pub pair: Option<(u32, u32)>,
}

/// Observed state of a plant, read from the engine's own data, never from our kinematics.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlantState {
    /// Joint positions, rad.
    pub position: Joints,
    /// Joint velocities, rad/s.
    ///
    /// A semi-implicit Euler step moves the positions with the velocity that it has just computed.
    /// To second order in the time step, that velocity is the one half a step earlier.
    pub velocity: Joints,
    /// Pose of the flange in the world, from the engine's last body.
    pub world_from_flange: Pose,
    /// Contacts of the last step; of the posture itself, without forces, after a reset.
    pub contact: Contact,
}

/// The arm in a physics engine: it has a state and advances one step under joint torques.
///
/// Joint limits are not constraints of the plants: a planned motion stays inside them, and a limit
/// that an engine enforces in its own way would hide the motion that left them.
pub trait Plant {
    /// Name, version and settings.
    fn identity(&self) -> EngineIdentity;

    /// Places the arm at rest at `position` and forgets everything before.
    ///
    /// Two runs from the same reset under the same torques are equal bit for bit.
    fn reset(&mut self, position: &Joints) -> Result<PlantState, EngineError>;

    /// Advances by one step under constant joint torques, N m.
    fn step(&mut self, torque_nm: &Joints) -> Result<PlantState, EngineError>;

    /// Length of a step, s.
    fn timestep_s(&self) -> f64;

    /// How long before the time of a state its velocity was, s: half a step in the engines.
    fn velocity_age_s(&self) -> f64 {
        0.5 * self.timestep_s()
    }

    /// World poses of the six moving links' frames, from the engine's bodies.
    fn link_poses(&mut self) -> Result<[Pose; JOINT_COUNT], EngineError>;
}

/// Checks a step length, s.
pub(crate) fn checked_timestep_s(timestep_s: f64) -> Result<f64, EngineError> {
    if timestep_s.is_finite() && timestep_s > 0.0 {
        Ok(timestep_s)
    } else {
        Err(EngineError::BadTimestep { timestep_s })
    }
}
