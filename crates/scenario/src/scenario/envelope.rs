//! Maximum differences between the engines: `[engines.envelope]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Tolerance: maximum differences between the engines, evaluated for every configuration that both simulated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct EnvelopeSection {
    /// Maximum difference of the tip position before the first contact, um. Default: what both engines achieve on the
    /// shipped scenarios at 1 ms; it grows with time step and acceleration.
    #[schemars(range(min = 1e-6, max = 1e5), extend("x-hint" = "the value is in um; the upper end of the range accepts any difference"))]
    pub peak_tip_um: f64,
    /// Maximum difference of the tip position at the end of a motion without contact, nm.
    #[schemars(range(min = 1e-4, max = 1e8), extend("x-unit" = "nm"), extend("x-hint" = "the value is in nm; the upper end of the range accepts any difference"))]
    pub settled_tip_nm: f64,
    /// Maximum difference of a joint torque before the first contact, N m. Assumed: 1/1000 of the limit of a UR3's
    /// wrist.
    #[schemars(range(min = 1e-9, max = 1e3), extend("x-hint" = "the value is in N m; the upper end of the range accepts any difference"))]
    pub joint_torque_nm: f64,
    /// Maximum difference of the tip position at the end of a motion in contact, um.
    #[schemars(range(min = 1e-6, max = 1e5), extend("x-hint" = "the value is in um; the upper end of the range accepts any difference"))]
    pub contact_tip_um: f64,
    /// Maximum difference of the normal forces at the end of a motion in contact, as a fraction of the larger.
    #[schemars(range(min = 1e-9, max = 1.0), extend("x-hint" = "it is a fraction: 0.01 is one percent"))]
    pub contact_force_relative: f64,
}

impl Default for EnvelopeSection {
    fn default() -> Self {
        Self {
            peak_tip_um: 1.0,
            settled_tip_nm: 1.0,
            joint_torque_nm: 0.012,
            contact_tip_um: 20.0,
            contact_force_relative: 0.01,
        }
    }
}
