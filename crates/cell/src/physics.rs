//! How engines simulate a cell.

/// Standard gravity, m/s^2 (3rd General Conference on Weights and Measures, 1901).
pub const STANDARD_GRAVITY_M_S2: f64 = 9.80665;

/// Settings that engines share, and those of each.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EngineSettings {
    /// Time step, s.
    pub timestep_s: f64,
    /// Time without an answer after which a process is given up, s.
    pub harness_timeout_s: f64,
    /// Coulomb friction between any two solids.
    pub friction: f64,
    /// Of rapier alone.
    pub rapier: RapierSettings,
    /// Of MuJoCo alone.
    pub mujoco: MujocoSettings,
}

/// Contacts of rapier.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RapierSettings {
    /// Natural frequency of a contact as a spring, Hz.
    pub contact_natural_frequency_hz: f64,
    /// Damping ratio of a contact as a spring.
    pub contact_damping_ratio: f64,
    /// Gauss-Seidel sweeps over the contacts per step.
    pub contact_sweeps: u32,
}

/// Contacts of MuJoCo.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MujocoSettings {
    /// Stiffness of a contact's reference acceleration, 1/s^2 (first number of `solref`).
    pub contact_stiffness_per_s2: f64,
    /// Damping of a contact's reference acceleration, 1/s (second number of `solref`).
    pub contact_damping_per_s: f64,
    /// Impedance of contacts at every depth, between 0 and 1 (`solimp`).
    pub contact_impedance: f64,
}
