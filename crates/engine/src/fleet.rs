//! Arms that are stepped together.

use std::ops::DerefMut;

use needlebench_kinematics::Joints;
use needlebench_kinematics::trajectory::JointTrajectory;

use crate::{EngineError, EngineIdentity, Plant, PlantState};

/// Arms of one cell in one engine, each with a state of its own; see [`Plant`].
pub trait Fleet {
    /// Name, version and settings, the same for all arms.
    fn identity(&self) -> EngineIdentity;

    /// Number of arms: at least one.
    fn arms(&self) -> usize;

    /// Length of a step, s.
    fn timestep_s(&self) -> f64;

    /// As [`Plant::velocity_age_s`].
    fn velocity_age_s(&self) -> f64 {
        0.5 * self.timestep_s()
    }

    /// Places one arm where a motion begins, as [`Plant::begin`] does.
    ///
    /// # Errors
    /// What the engine says; if [`EngineError::is_fatal`], no arm can go on.
    fn begin(&mut self, arm: usize, motion: &JointTrajectory) -> Result<PlantState, EngineError>;

    /// Advances some of the arms by one step under constant joint torques, N m; states are in the
    /// order of `torques_nm`.
    ///
    /// An arm that became unstable has an error in place of its state until it begins anew; the
    /// others are not concerned.
    ///
    /// # Errors
    /// What ends all of them.
    fn step(
        &mut self,
        torques_nm: &[(usize, Joints)],
    ) -> Result<Vec<Result<PlantState, EngineError>>, EngineError>;
}

/// A fleet of one arm: a plant, by a reference or a box.
pub(crate) struct Lone<P>(pub P);

impl<'p, P: DerefMut<Target = dyn Plant + 'p>> Fleet for Lone<P> {
    fn identity(&self) -> EngineIdentity {
        self.0.identity()
    }

    fn arms(&self) -> usize {
        1
    }

    fn timestep_s(&self) -> f64 {
        self.0.timestep_s()
    }

    fn velocity_age_s(&self) -> f64 {
        self.0.velocity_age_s()
    }

    fn begin(&mut self, _arm: usize, motion: &JointTrajectory) -> Result<PlantState, EngineError> {
        self.0.begin(motion)
    }

    fn step(
        &mut self,
        torques_nm: &[(usize, Joints)],
    ) -> Result<Vec<Result<PlantState, EngineError>>, EngineError> {
        torques_nm
            .iter()
            .map(|(_, torque_nm)| match self.0.step(torque_nm) {
                Err(error) if error.is_fatal() => Err(error),
                state => Ok(state),
            })
            .collect()
    }
}
