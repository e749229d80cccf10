//! The arm in rapier, as a reduced-coordinate multibody.

mod engine;
mod hooks;
mod world;

use needlebench_cell::Cell;
use needlebench_kinematics::{JOINT_COUNT, Joints, Pose};
use rapier3d_f64::geometry::ContactPair;
use serde::{Deserialize, Serialize};

use crate::convert::UNITS_PER_M;
use crate::plant::checked_timestep_s;
use crate::{Contact, EngineError, EngineIdentity, Plant, PlantState};
pub(crate) use engine::Rapier;
use world::{Blueprint, World};

/// Version of the `rapier3d-f64` crate that is linked; compared with `Cargo.lock` by a test.
const RAPIER_VERSION: &str = "0.36.1";

/// Settings of rapier's solver, beside the step length.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RapierSettings {
    /// Natural frequency of a contact as a spring, Hz; higher is stiffer.
    ///
    /// The default of 700 Hz is as stiff as the default contact of MuJoCo: there it is
    /// `sqrt(k d / (1 - d)) / (2 pi)`.
    pub contact_natural_frequency_hz: f64,
    /// Damping ratio of a contact as a spring.
    pub contact_damping_ratio: f64,
    /// Coulomb friction between any two solids; 0 by default, see
    /// [`MujocoSettings::friction`](crate::MujocoSettings::friction).
    pub friction: f64,
    /// Gap at which rapier starts to track a contact point, m; such a point can bear a force that
    /// stops the bodies just before they touch.
    pub prediction_distance_m: f64,
    /// Gauss-Seidel sweeps over the contacts per step.
    pub contact_sweeps: usize,
}

impl Default for RapierSettings {
    fn default() -> Self {
        Self {
            contact_natural_frequency_hz: 700.0,
            contact_damping_ratio: 1.0,
            friction: 0.0,
            prediction_distance_m: 1e-4,
            contact_sweeps: 10,
        }
    }
}

impl RapierSettings {
    fn check(&self) -> Result<(), EngineError> {
        let positive = [
            (
                "contact_natural_frequency_hz",
                self.contact_natural_frequency_hz,
            ),
            ("contact_damping_ratio", self.contact_damping_ratio),
            ("prediction_distance_m", self.prediction_distance_m),
            ("contact_sweeps", self.contact_sweeps as f64),
        ];
        for (key, value) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return Err(EngineError::BadSetting {
                    key,
                    value,
                    expected: "positive",
                });
            }
        }
        if !(self.friction >= 0.0 && self.friction.is_finite()) {
            return Err(EngineError::BadSetting {
                key: "friction",
                value: self.friction,
                expected: "finite and not negative",
            });
        }
        Ok(())
    }
}

/// The arm in rapier.
///
/// The joints are the unactuated joints of a multibody; torques act on the bodies. Damping and
/// joint friction are zero (rapier's default would damp every joint with 0.1 N m s/rad) and a step
/// is one substep, because rapier would freeze the torques across several.
pub struct RapierPlant {
    blueprint: Blueprint,
    settings: RapierSettings,
    timestep_s: f64,
    world: World,
}

impl RapierPlant {
    /// Builds the cell's arm and everything that it may touch.
    pub fn new(
        cell: &Cell,
        timestep_s: f64,
        settings: &RapierSettings,
    ) -> Result<Self, EngineError> {
        settings.check()?;
        let timestep_s = checked_timestep_s(timestep_s)?;
        let blueprint = Blueprint::new(cell, timestep_s, settings)?;
        let world = World::new(&blueprint, &Joints::zeros());
        Ok(Self {
            blueprint,
            settings: *settings,
            timestep_s,
            world,
        })
    }

    /// Joint-space mass matrix at the present posture with armature, kg m^2, as rapier solves it.
    pub fn mass_matrix(&mut self) -> nalgebra::Matrix6<f64> {
        self.world.mass_matrix()
    }

    /// Advances by one step under joint torques, N m, without looking at what came of it: the bare
    /// engine, which the run loop is measured against.
    pub fn advance(&mut self, torque_nm: &Joints) -> Result<(), EngineError> {
        self.world.step(torque_nm);
        if self.world.has_non_finite_bodies() {
            let reason = "a body's pose or velocity is no longer finite".to_owned();
            return Err(EngineError::Unstable {
                engine: "rapier",
                reason,
            });
        }
        Ok(())
    }

    fn observe(&self) -> PlantState {
        let (position, velocity) = self.world.joint_state();
        let wrist_3 = self.world.link_pose(JOINT_COUNT - 1);
        PlantState {
            position,
            velocity,
            world_from_flange: wrist_3 * self.blueprint.chain.wrist_3_from_flange,
            contact: self.contact(),
        }
    }

    fn contact(&self) -> Contact {
        let mut contact = Contact::default();
        let mut impulse = 0.0;
        let mut strongest = (-1.0, 0.0);
        for pair in self.world.contact_pairs() {
            for manifold in pair.manifolds() {
                let solved = &manifold.data.solver_contacts;
                for (k, point) in manifold.points.iter().enumerate() {
                    // The impulse of a point that was not solved is a leftover of earlier steps.
                    let is_solved = solved.iter().any(|one| one.contact_indices() == [k as u64]);
                    let point_impulse = if is_solved { point.data.impulse } else { 0.0 };
                    let depth_m = -point.dist / UNITS_PER_M;
                    if depth_m <= 0.0 && point_impulse <= 0.0 {
                        continue;
                    }
                    contact.count += 1;
                    impulse += point_impulse;
                    contact.deepest_penetration_m = contact.deepest_penetration_m.max(depth_m);
                    if (point_impulse, depth_m) > strongest {
                        strongest = (point_impulse, depth_m);
                        contact.pair = Some(self.body_pair(pair));
                    }
                }
            }
        }
        contact.normal_force_n = impulse / UNITS_PER_M / self.timestep_s;
        contact
    }

    fn body_pair(&self, pair: &ContactPair) -> (u32, u32) {
        let a = self.world.body_index(pair.collider1);
        let b = self.world.body_index(pair.collider2);
        (a.min(b), a.max(b))
    }
}

impl Plant for RapierPlant {
    fn identity(&self) -> EngineIdentity {
        let RapierSettings {
            contact_natural_frequency_hz,
            contact_damping_ratio,
            friction,
            prediction_distance_m,
            contact_sweeps,
        } = self.settings;
        let setting = |key: &str, value: String| (key.to_owned(), value);
        EngineIdentity {
            name: "rapier",
            version: RAPIER_VERSION.into(),
            settings: vec![
                setting("timestep_s", self.timestep_s.to_string()),
                setting("substeps", "1".into()),
                setting(
                    "contact_natural_frequency_hz",
                    contact_natural_frequency_hz.to_string(),
                ),
                setting("contact_damping_ratio", contact_damping_ratio.to_string()),
                setting("friction", friction.to_string()),
                setting("prediction_distance_m", prediction_distance_m.to_string()),
                setting("contact_sweeps", contact_sweeps.to_string()),
            ],
        }
    }

    fn reset(&mut self, position: &Joints) -> Result<PlantState, EngineError> {
        // A new world: no warm start, no broad-phase history, nothing that could differ.
        self.world = World::new(&self.blueprint, position);
        Ok(self.observe())
    }

    fn step(&mut self, torque_nm: &Joints) -> Result<PlantState, EngineError> {
        self.advance(torque_nm)?;
        Ok(self.observe())
    }

    fn timestep_s(&self) -> f64 {
        self.timestep_s
    }

    fn link_poses(&mut self) -> Result<[Pose; JOINT_COUNT], EngineError> {
        Ok(std::array::from_fn(|i| self.world.link_pose(i)))
    }
}
