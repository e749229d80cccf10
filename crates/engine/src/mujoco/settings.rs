//! Settings of MuJoCo.

use serde::{Deserialize, Serialize};

use crate::EngineError;

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
    /// A contact under the force `F` settles at the depth `F W (1 - d) / k`, with the impedance `d`, the
    /// stiffness `k`, and MuJoCo's estimate `W` of the bodies' inverse inertia there: the mean over three
    /// directions.
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

    pub(super) fn check(&self) -> Result<(), EngineError> {
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
