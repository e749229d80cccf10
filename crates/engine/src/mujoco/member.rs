//! What single plants and those of a fleet have in common.

use std::collections::BTreeMap;

use needlebench_cell::Cell;
use needlebench_kinematics::{JOINT_COUNT, JOINT_NAMES, Joints, LINK_NAMES};

use super::mjcf::{FLANGE_SITE, geoms_of, mjcf};
use super::process::GroupStep;
use super::{HarnessProcess, HarnessState, HarnessVersions, MujocoSettings, PlantHandle};
use crate::broad_phase::BroadPhase;
use crate::plant::checked_timestep_s;
use crate::{Contact, EngineError, EngineIdentity, PlantState};

/// A compiled model of a cell.
pub(super) struct Model {
    settings: MujocoSettings,
    pub timestep_s: f64,
    /// Index into `Cell::bodies` of each geom.
    body_of_geom: Vec<u32>,
    /// Index among MuJoCo's bodies of each moving link.
    pub link_bodies: [usize; JOINT_COUNT],
}

/// A running state of the model.
pub(super) struct Member {
    pub handle: PlantHandle,
    pub position: Joints,
    broad_phase: BroadPhase,
    /// Something may touch in the next step.
    look: bool,
}

impl Model {
    /// Compiles the cell's arm and everything that it may touch.
    pub(super) fn load(
        harness: &mut HarnessProcess,
        cell: &Cell,
        timestep_s: f64,
        settings: &MujocoSettings,
    ) -> Result<(Self, Member), EngineError> {
        settings.check()?;
        let timestep_s = checked_timestep_s(timestep_s)?;
        let text = mjcf(cell, timestep_s, settings)?;
        let handle = harness.load(&text, FLANGE_SITE)?;
        if handle.joint_names != JOINT_NAMES {
            return Err(mismatch("joints"));
        }
        let mut bodies = BTreeMap::new();
        for (body, each) in cell.bodies.iter().enumerate() {
            for solid in 0..each.solids.len() {
                let names = geoms_of(cell, body, solid)?.into_iter();
                bodies.extend(names.map(|(name, _)| (name, body)));
            }
        }
        let body_of_geom = handle
            .geom_names
            .iter()
            .map(|name| bodies.get(name).and_then(|&body| u32::try_from(body).ok()))
            .collect::<Option<Vec<u32>>>()
            .ok_or_else(|| mismatch("geoms"))?;
        let mut link_bodies = [0; JOINT_COUNT];
        for (i, index) in link_bodies.iter_mut().enumerate() {
            *index = handle
                .body_names
                .iter()
                .position(|name| *name == LINK_NAMES[i])
                .ok_or_else(|| mismatch("links"))?;
        }
        let model = Self {
            settings: *settings,
            timestep_s,
            body_of_geom,
            link_bodies,
        };
        let member = Member {
            handle,
            position: Joints::zeros(),
            broad_phase: BroadPhase::new(cell)?,
            look: true,
        };
        Ok((model, member))
    }

    pub(super) fn identity(&self, versions: &HarnessVersions) -> EngineIdentity {
        let MujocoSettings {
            integrator,
            contact_impedance,
            friction,
            ..
        } = self.settings;
        let (stiffness_per_s2, damping_per_s) = self.settings.contact_spring(self.timestep_s);
        let setting = |key: &str, value: String| (key.to_owned(), value);
        EngineIdentity {
            name: "mujoco",
            version: versions.mujoco.clone(),
            settings: vec![
                setting("timestep_s", self.timestep_s.to_string()),
                setting("integrator", integrator.name().to_owned()),
                setting("contact_stiffness_per_s2", stiffness_per_s2.to_string()),
                setting("contact_damping_per_s", damping_per_s.to_string()),
                setting("contact_impedance", contact_impedance.to_string()),
                setting("friction", friction.to_string()),
                setting("numpy", versions.numpy.clone()),
                setting("python", versions.python.clone()),
            ],
        }
    }

    fn body(&self, geom: u32) -> Result<u32, EngineError> {
        let body = self.body_of_geom.get(geom as usize).copied();
        body.ok_or_else(|| mismatch("geoms"))
    }
}

impl Member {
    /// A further state of the same model.
    pub(super) fn copy(&self, harness: &mut HarnessProcess) -> Result<Self, EngineError> {
        Ok(Self {
            handle: harness.copy(&self.handle)?,
            broad_phase: self.broad_phase.clone(),
            ..*self
        })
    }

    /// Places the arm at rest.
    pub(super) fn reset(
        &mut self,
        harness: &mut HarnessProcess,
        model: &Model,
        position: &Joints,
    ) -> Result<PlantState, EngineError> {
        self.broad_phase.reset(position);
        let state = harness.reset(&self.handle, position.as_slice(), &[0.0; JOINT_COUNT])?;
        let mut state = self.observed(model, &state)?;
        // MuJoCo solves the forces of the posture at once; no step has borne them yet.
        state.contact.normal_force_n = 0.0;
        Ok(state)
    }

    /// What the harness is to be asked for a step.
    pub(super) fn step<'a>(&'a self, torque_nm: &'a Joints) -> GroupStep<'a> {
        GroupStep {
            plant: &self.handle,
            look: self.look,
            tau: torque_nm.as_slice(),
        }
    }

    /// Reads what the harness says of the plant.
    pub(super) fn observed(
        &mut self,
        model: &Model,
        state: &HarnessState,
    ) -> Result<PlantState, EngineError> {
        let contact = state.contact;
        let pair = match contact.strongest_pair {
            None => None,
            Some([a, b]) => {
                let (a, b) = (model.body(a)?, model.body(b)?);
                Some((a.min(b), a.max(b)))
            }
        };
        // The handle's counts were held against the six joints.
        self.position = Joints::from_column_slice(&state.qpos);
        self.look = self.broad_phase.move_to(&self.position);
        Ok(PlantState {
            position: self.position,
            velocity: Joints::from_column_slice(&state.qvel),
            world_from_flange: state.world_from_site(),
            contact: Contact {
                count: contact.count,
                deepest_penetration_m: contact.deepest_penetration_m,
                normal_force_n: contact.normal_force_n,
                pair,
            },
        })
    }
}

/// The harness has another model than the one it was given.
fn mismatch(missing: &str) -> EngineError {
    EngineError::Refused {
        reason: format!("the MuJoCo harness reports other {missing} than its model has"),
    }
}

/// The error of a plant that MuJoCo gave up; a reset mends it.
pub(super) fn unstable(reason: String) -> EngineError {
    EngineError::Unstable {
        engine: "mujoco",
        reason,
    }
}
