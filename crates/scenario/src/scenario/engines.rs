//! The physics engines: `[engines]`.

use needlebench_cell::{EngineSettings, MujocoSettings, RapierSettings, STANDARD_GRAVITY_M_S2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::envelope::EnvelopeSection;
use crate::engine_name::EngineName;

/// The physics engines.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct EnginesSection {
    /// Engines to run if the command line names none. Default: all default engines.
    pub run: Option<Vec<EngineName>>,
    /// Time step, ms.
    #[schemars(range(min = 0.01, max = 5.0))]
    pub timestep_ms: f64,
    /// Gravity of the world, m/s^2: of the engines, the reference integrator, statics and gear deflection. On Earth it
    /// is 9.76 to 9.84.
    #[schemars(range(min = 0.0, max = 20.0), extend("x-hint" = "it is the magnitude, in m/s^2: 9.80665"))]
    pub gravity_m_s2: f64,
    /// Time without an answer after which the MuJoCo process is stopped, s.
    #[schemars(range(min = 0.1, max = 3600.0))]
    pub harness_timeout_s: f64,
    /// Coulomb friction coefficient between all solids, in both engines. With friction a pressed guide creeps in MuJoCo
    /// and settled tips differ by up to 0.5 mm, so the default is none.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub friction: f64,
    /// Settings of rapier only.
    pub rapier: RapierSection,
    /// Settings of MuJoCo only.
    pub mujoco: MujocoSection,
    /// Tolerance: maximum differences between the engines.
    pub envelope: EnvelopeSection,
}

/// Settings of rapier only.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RapierSection {
    /// Natural frequency of the contact spring, Hz. Higher is stiffer.
    #[schemars(range(min = 1.0, max = 1e6))]
    pub contact_natural_frequency_hz: f64,
    /// Damping ratio of the contact spring.
    #[schemars(range(min = 1e-3, max = 1e3))]
    pub contact_damping_ratio: f64,
    /// Gauss-Seidel iterations over the contacts per step.
    #[schemars(range(min = 1, max = 1000))]
    pub contact_sweeps: u32,
}

impl Default for RapierSection {
    fn default() -> Self {
        Self {
            contact_natural_frequency_hz: 1e4,
            contact_damping_ratio: 1.0,
            contact_sweeps: 10,
        }
    }
}

/// Settings of MuJoCo only.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MujocoSection {
    /// Stiffness of the contacts' reference acceleration, 1/s^2 (first number of `solref`).
    #[schemars(range(min = 1.0, max = 1e9))]
    pub contact_stiffness_per_s2: f64,
    /// Damping of the contacts' reference acceleration, 1/s (second number of `solref`).
    #[schemars(range(min = 0.1, max = 1e6))]
    pub contact_damping_per_s: f64,
    /// Contact impedance at every depth, between 0 and 1 (`solimp`).
    #[schemars(range(min = 0.01, max = 0.9999))]
    pub contact_impedance: f64,
}

impl Default for MujocoSection {
    fn default() -> Self {
        Self {
            contact_stiffness_per_s2: 1e6,
            contact_damping_per_s: 1e3,
            contact_impedance: 0.95,
        }
    }
}

impl EnginesSection {
    /// As engines take them.
    pub fn settings(&self) -> EngineSettings {
        let Self { rapier, mujoco, .. } = self;
        EngineSettings {
            timestep_s: self.timestep_ms * 1e-3,
            harness_timeout_s: self.harness_timeout_s,
            friction: self.friction,
            rapier: RapierSettings {
                contact_natural_frequency_hz: rapier.contact_natural_frequency_hz,
                contact_damping_ratio: rapier.contact_damping_ratio,
                contact_sweeps: rapier.contact_sweeps,
            },
            mujoco: MujocoSettings {
                contact_stiffness_per_s2: mujoco.contact_stiffness_per_s2,
                contact_damping_per_s: mujoco.contact_damping_per_s,
                contact_impedance: mujoco.contact_impedance,
            },
        }
    }
}

impl Default for EnginesSection {
    fn default() -> Self {
        Self {
            run: None,
            timestep_ms: 1.0,
            gravity_m_s2: STANDARD_GRAVITY_M_S2,
            harness_timeout_s: 30.0,
            friction: 0.0,
            rapier: RapierSection::default(),
            mujoco: MujocoSection::default(),
            envelope: EnvelopeSection::default(),
        }
    }
}
