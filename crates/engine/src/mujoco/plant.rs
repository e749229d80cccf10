//! The arm in MuJoCo.

use std::collections::BTreeMap;

use needlebench_cell::Cell;
use needlebench_kinematics::{JOINT_COUNT, Joints, Pose};
use serde::{Deserialize, Serialize};

use super::mjcf::{FLANGE_SITE, geoms_of, joint_name, link_name, mjcf};
use super::{HarnessError, HarnessProcess, HarnessState, InverseDynamics, PlantHandle};
use crate::plant::checked_timestep_s;
use crate::{Contact, EngineError, EngineIdentity, Plant, PlantState};

/// How MuJoCo advances velocities.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MujocoIntegrator {
    /// Semi-implicit Euler with explicit Coriolis forces; what MuJoCo does by default.
    Euler,
    /// Semi-implicit Euler with the velocity derivative of the Coriolis forces in the mass matrix,
    /// as rapier's multibodies have it too: the engines' tips then differ by 0.09 um on a motion
    /// of 2 s at 1 ms steps, against 1.2 um with [`Self::Euler`].
    #[default]
    Implicit,
}

impl MujocoIntegrator {
    /// MJCF's name.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Euler => "Euler",
            Self::Implicit => "implicit",
        }
    }
}

/// Settings of MuJoCo's solver, beside the step length.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MujocoSettings {
    /// Integrator.
    pub integrator: MujocoIntegrator,
    /// Stiffness of a contact's reference acceleration, 1/s^2 (first, negated number of `solref`),
    /// at most `1/h^2` for a step `h`: beyond that a contact overshoots within one step.
    pub contact_stiffness_per_s2: f64,
    /// Damping of a contact's reference acceleration, 1/s (second, negated number of `solref`), at
    /// most `1/h`: that much stops the bodies within one step, twice as much throws them back.
    pub contact_damping_per_s: f64,
    /// Impedance of contacts at every depth, in (0, 1) (`solimp`).
    ///
    /// A contact under the force `F` settles at the depth `F / m * (1 - d) / (d k)`, with the
    /// effective mass `m`, the impedance `d` and the stiffness `k`.
    pub contact_impedance: f64,
    /// Coulomb friction between any two solids.
    ///
    /// 0 by default: MuJoCo's friction is soft and creeps, so that a tip that is pressed against a
    /// wall settles 0.01 to 0.5 mm apart in the two engines with friction, and 1 um without.
    pub friction: f64,
}

impl Default for MujocoSettings {
    fn default() -> Self {
        Self {
            integrator: MujocoIntegrator::default(),
            contact_stiffness_per_s2: 1e6,
            contact_damping_per_s: 1e3,
            contact_impedance: 0.95,
            friction: 0.0,
        }
    }
}

impl MujocoSettings {
    /// Stiffness (1/s^2) and damping (1/s) that a step of this length allows.
    pub(super) fn contact_spring(&self, timestep_s: f64) -> (f64, f64) {
        let rate_per_s = timestep_s.recip();
        (
            self.contact_stiffness_per_s2.min(rate_per_s.powi(2)),
            self.contact_damping_per_s.min(rate_per_s),
        )
    }

    fn check(&self) -> Result<(), EngineError> {
        let bad = |key, value, expected| {
            Err(EngineError::BadSetting {
                key,
                value,
                expected,
            })
        };
        for (key, value) in [
            ("contact_stiffness_per_s2", self.contact_stiffness_per_s2),
            ("contact_damping_per_s", self.contact_damping_per_s),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return bad(key, value, "positive");
            }
        }
        if !(self.contact_impedance > 0.0 && self.contact_impedance < 1.0) {
            return bad(
                "contact_impedance",
                self.contact_impedance,
                "between 0 and 1",
            );
        }
        if !(self.friction >= 0.0 && self.friction.is_finite()) {
            return bad("friction", self.friction, "finite and not negative");
        }
        Ok(())
    }
}

/// The arm in MuJoCo, stepped in lock-step by a harness process.
pub struct MujocoPlant<'h> {
    harness: &'h mut HarnessProcess,
    handle: PlantHandle,
    settings: MujocoSettings,
    timestep_s: f64,
    /// Index into `Cell::bodies` of each geom.
    body_of_geom: Vec<u32>,
    /// Index among MuJoCo's bodies of each moving link.
    link_bodies: [usize; JOINT_COUNT],
    position: Joints,
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
        settings.check()?;
        let timestep_s = checked_timestep_s(timestep_s)?;
        let model = mjcf(cell, timestep_s, settings)?;
        let handle = harness.load(&model, FLANGE_SITE)?;
        let joints = (0..JOINT_COUNT).map(joint_name);
        if !joints.eq(handle.joint_names.iter().cloned()) {
            return Err(EngineError::ModelMismatch { missing: "joints" });
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
            .ok_or(EngineError::ModelMismatch { missing: "geoms" })?;
        let mut link_bodies = [0; JOINT_COUNT];
        for (i, index) in link_bodies.iter_mut().enumerate() {
            *index = handle
                .body_names
                .iter()
                .position(|name| *name == link_name(i))
                .ok_or(EngineError::ModelMismatch { missing: "links" })?;
        }
        Ok(Self {
            harness,
            handle,
            settings: *settings,
            timestep_s,
            body_of_geom,
            link_bodies,
            position: Joints::zeros(),
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
        let dynamics =
            self.harness
                .inverse(&self.handle, q.as_slice(), qd.as_slice(), qdd.as_slice())?;
        Ok(dynamics)
    }

    fn observed(&mut self, state: &HarnessState) -> Result<PlantState, EngineError> {
        let contact = state.contact;
        let pair = match contact.strongest_pair {
            None => None,
            Some([a, b]) => {
                let body = |geom: u32| {
                    self.body_of_geom
                        .get(geom as usize)
                        .copied()
                        .ok_or(EngineError::ModelMismatch { missing: "geoms" })
                };
                let (a, b) = (body(a)?, body(b)?);
                Some((a.min(b), a.max(b)))
            }
        };
        // The handle's counts were held against the six joints.
        self.position = Joints::from_column_slice(&state.qpos);
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

impl Plant for MujocoPlant<'_> {
    fn identity(&self) -> EngineIdentity {
        let MujocoSettings {
            integrator,
            contact_impedance,
            friction,
            ..
        } = self.settings;
        let (stiffness_per_s2, damping_per_s) = self.settings.contact_spring(self.timestep_s);
        let versions = self.harness.versions();
        let setting = |key: &str, value: String| (key.to_owned(), value);
        EngineIdentity {
            name: "mujoco".into(),
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

    fn reset(&mut self, position: &Joints) -> Result<PlantState, EngineError> {
        let state = self
            .harness
            .reset(&self.handle, position.as_slice(), &[0.0; JOINT_COUNT])?;
        let mut state = self.observed(&state)?;
        // MuJoCo solves the forces of the posture at once; no step has borne them yet.
        state.contact.normal_force_n = 0.0;
        Ok(state)
    }

    fn step(&mut self, torque_nm: &Joints) -> Result<PlantState, EngineError> {
        let stepped = self.harness.step(&self.handle, torque_nm.as_slice());
        let state = stepped.map_err(|error| match error {
            // The harness is well and serves the next reset.
            HarnessError::Engine { message, .. } => EngineError::Unstable {
                engine: "mujoco",
                reason: message,
            },
            other => EngineError::Harness(other),
        })?;
        self.observed(&state)
    }

    fn timestep_s(&self) -> f64 {
        self.timestep_s
    }

    fn link_poses(&mut self) -> Result<[Pose; JOINT_COUNT], EngineError> {
        let still = Joints::zeros();
        let position = self.position;
        let dynamics = self.inverse_dynamics(&position, &still, &still)?;
        Ok(self.link_bodies.map(|body| dynamics.world_from_body[body]))
    }
}
