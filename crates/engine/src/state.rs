//! What is seen of an arm in an engine.

use needlebench_kinematics::{Joints, Pose};
use serde::Serialize;

/// Name, version and settings of an engine, for the provenance of a result.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct EngineIdentity {
    /// `rapier`, `mujoco`, `referee` and so on.
    pub name: &'static str,
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
