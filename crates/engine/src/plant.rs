//! What the run loop knows of a physics engine.

use needlebench_kinematics::trajectory::JointTrajectory;
use needlebench_kinematics::{JOINT_COUNT, Joints, Pose};

use crate::{EngineError, EngineIdentity, PlantState};

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

    /// Places the arm at rest where a motion begins that it is about to be driven along.
    ///
    /// What simulates an arm knows of the motion by its torques alone, and needs its start. What
    /// stands in for one, such as a replay or a robot's own controller, may take all of it.
    fn begin(&mut self, motion: &JointTrajectory) -> Result<PlantState, EngineError> {
        self.reset(&motion.sample(0.0).position)
    }

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
