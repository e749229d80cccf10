//! The physics engines: `[engines]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::envelope::EnvelopeSection;
use crate::engine_name::EngineName;

/// Standard gravity, m/s^2 (3rd General Conference on Weights and Measures, 1901).
pub const STANDARD_GRAVITY_M_S2: f64 = 9.80665;

/// The physics engines.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct EnginesSection {
    /// Engines to run when the command line does not say; those that run by default if left out.
    pub run: Option<Vec<EngineName>>,
    /// Time step, ms.
    #[schemars(range(min = 0.01, max = 5.0))]
    pub timestep_ms: f64,
    /// Acceleration of gravity in the world, m/s^2: what engines, referee, statics and sagging gears have.
    /// Standard gravity if left out. On Earth it is 9.76 to 9.84.
    #[schemars(range(min = 0.0, max = 20.0), extend("x-hint" = "it is the magnitude, in m/s^2: 9.80665"))]
    pub gravity_m_s2: f64,
    /// Time without an answer after which the MuJoCo process is given up, s.
    #[schemars(range(min = 0.1, max = 3600.0))]
    pub harness_timeout_s: f64,
    /// Coulomb friction between any two solids, in both engines. With friction a pressed guide
    /// creeps in MuJoCo and settled tips differ by up to 0.5 mm, so the default is none.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub friction: f64,
    /// Settings of rapier alone.
    pub rapier: RapierSection,
    /// Settings of MuJoCo alone.
    pub mujoco: MujocoSection,
    /// How far the engines may differ.
    pub envelope: EnvelopeSection,
}

/// Settings of rapier alone.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RapierSection {
    /// Natural frequency of a contact as a spring, Hz; higher is stiffer.
    #[schemars(range(min = 1.0, max = 1e6))]
    pub contact_natural_frequency_hz: f64,
    /// Damping ratio of a contact as a spring.
    #[schemars(range(min = 1e-3, max = 1e3))]
    pub contact_damping_ratio: f64,
    /// Gauss-Seidel sweeps over the contacts per step.
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

/// Settings of MuJoCo alone.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MujocoSection {
    /// Stiffness of a contact's reference acceleration, 1/s^2 (first number of `solref`).
    #[schemars(range(min = 1.0, max = 1e9))]
    pub contact_stiffness_per_s2: f64,
    /// Damping of a contact's reference acceleration, 1/s (second number of `solref`).
    #[schemars(range(min = 0.1, max = 1e6))]
    pub contact_damping_per_s: f64,
    /// Impedance of contacts at every depth, between 0 and 1 (`solimp`).
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
