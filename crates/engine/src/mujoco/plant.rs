//! The arm in MuJoCo.

use needlebench_cell::Cell;
use needlebench_kinematics::{JOINT_COUNT, Joints, Pose};

use super::member::{Member, Model, unstable};
use super::{HarnessError, HarnessProcess, InverseDynamics, MujocoSettings, Replay};
use crate::{EngineError, EngineIdentity, Plant, PlantState};

/// The arm in MuJoCo, stepped in lock-step by a harness process.
pub struct MujocoPlant<'h> {
    harness: &'h mut HarnessProcess,
    model: Model,
    member: Member,
}

impl<'h> MujocoPlant<'h> {
    /// Compiles the cell's arm and everything that it may touch in the harness.
    ///
    /// The harness keeps the model for as long as it runs; use one plant for many resets.
    pub fn new(
        harness: &'h mut HarnessProcess,
        cell: &Cell,
        timestep_s: f64,
        settings: &MujocoSettings,
    ) -> Result<Self, EngineError> {
        let (model, member) = Model::load(harness, cell, timestep_s, settings)?;
        Ok(Self {
            harness,
            model,
            member,
        })
    }

    /// MuJoCo's rigid-body dynamics at any state, for validation; the running state stays.
    ///
    /// `q` in rad, `qd` in rad/s, `qdd` in rad/s^2.
    pub fn inverse_dynamics(
        &mut self,
        q: &Joints,
        qd: &Joints,
        qdd: &Joints,
    ) -> Result<InverseDynamics, EngineError> {
        let handle = &self.member.handle;
        let dynamics = self
            .harness
            .inverse(handle, q.as_slice(), qd.as_slice(), qdd.as_slice())?;
        Ok(dynamics)
    }

    /// Runs MuJoCo alone under the torques (N m) of one step after the other, from rest at
    /// `position`, in a loop inside the harness: what lock-step is measured against.
    ///
    /// With `look` false MuJoCo does not look for contacts.
    pub fn replay(
        &mut self,
        position: &Joints,
        look: bool,
        torque_nm: &[Joints],
    ) -> Result<Replay, EngineError> {
        self.reset(position)?;
        let rows: Vec<f64> = torque_nm.iter().flatten().copied().collect();
        Ok(self.harness.replay(&self.member.handle, look, &rows)?)
    }
}

impl Plant for MujocoPlant<'_> {
    fn identity(&self) -> EngineIdentity {
        self.model.identity(self.harness.versions())
    }

    fn reset(&mut self, position: &Joints) -> Result<PlantState, EngineError> {
        self.member.reset(self.harness, &self.model, position)
    }

    fn step(&mut self, torque_nm: &Joints) -> Result<PlantState, EngineError> {
        let step = self.member.step(torque_nm);
        let stepped = self.harness.step_looking(step.plant, step.look, step.tau);
        let state = stepped.map_err(|error| match error {
            // The harness is well and serves the next reset.
            HarnessError::Engine { message, .. } => unstable(message),
            other => other.into(),
        })?;
        self.member.observed(&self.model, &state)
    }

    fn timestep_s(&self) -> f64 {
        self.model.timestep_s
    }

    fn link_poses(&mut self) -> Result<[Pose; JOINT_COUNT], EngineError> {
        let still = Joints::zeros();
        let position = self.member.position;
        let dynamics = self.inverse_dynamics(&position, &still, &still)?;
        Ok(self
            .model
            .link_bodies
            .map(|body| dynamics.world_from_body[body]))
    }
}
