//! What a simulation leaves behind.

use std::time::Duration;

use needlebench_kinematics::trajectory::JointState;
use needlebench_kinematics::{JOINT_COUNT, Joints};

use crate::{EngineIdentity, PlantState};

/// Motion of one plant under one servo.
///
/// All vectors but the torques have one entry more than there were steps; entry 0 is the state
/// after the reset. Where not all states were kept ([`Keep::Near`](crate::Keep)), entries are those that
/// were, and the last one may lack its torque. Everything but `cost` is the same, bit for bit, whenever it is computed.
#[derive(Debug, Clone)]
pub struct Recording {
    /// The engine.
    pub engine: EngineIdentity,
    /// Length of a step, s.
    pub timestep_s: f64,
    /// How long before the time of a state its velocity was, s; see
    /// [`Plant::velocity_age_s`](crate::Plant::velocity_age_s).
    pub velocity_age_s: f64,
    /// Time of each state, s.
    pub time_s: Vec<f64>,
    /// Observed states.
    pub state: Vec<PlantState>,
    /// The trajectory at the same times, as planned.
    pub reference: Vec<JointState>,
    /// Torque that acted on the links over each step, N m; entry `k` between states `k` and
    /// `k + 1`.
    pub torque_nm: Vec<Joints>,
    /// Torque of the motors over each step, N m: the same where joints have no friction.
    pub drive_nm: Vec<Joints>,
    /// Steps in which the effort limit cut the torque of at least one joint.
    pub saturated_steps: usize,
    /// The same for each joint.
    pub saturation: [Saturation; JOINT_COUNT],
    /// What it cost; differs from run to run.
    pub cost: Cost,
}

/// How often the effort limit cut a joint's torque.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Saturation {
    /// Number of steps.
    pub steps: usize,
    /// Start of the first of them, s.
    pub first_time_s: Option<f64>,
}

/// Cost of a simulation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Cost {
    /// Wall-clock time of the whole run, reset and servo included.
    pub wall: Duration,
}

impl Recording {
    /// Number of steps.
    pub fn steps(&self) -> usize {
        self.torque_nm.len()
    }
}
