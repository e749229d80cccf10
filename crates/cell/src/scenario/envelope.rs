//! How far the engines may differ before a scenario counts that as a failure: `[engines.envelope]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Largest differences between the engines; judged for every configuration that both simulated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct EnvelopeSection {
    /// Distance of the needle's tips at any time before the first contact, um. The default is the
    /// figure that both engines keep on the shipped scenarios at 1 ms; it grows with step and
    /// acceleration.
    #[schemars(range(min = 1e-6, max = 1e5), extend("x-hint" = "the value is in um; to judge nothing, take the upper end"))]
    pub peak_tip_um: f64,
    /// Distance of the needle's tips at the end of a motion that ends without contact, nm.
    #[schemars(range(min = 1e-4, max = 1e8), extend("x-unit" = "nm"), extend("x-hint" = "the value is in nm; to judge nothing, take the upper end"))]
    pub settled_tip_nm: f64,
    /// Difference of a joint's torque at any time before the first contact, N m. Assumed: a
    /// thousandth of the limit of a UR3's wrist.
    #[schemars(range(min = 1e-9, max = 1e3), extend("x-hint" = "the value is in N m; to judge nothing, take the upper end"))]
    pub joint_torque_nm: f64,
    /// Distance of the needle's tips at the end of a motion that ends in contact, um.
    #[schemars(range(min = 1e-6, max = 1e5), extend("x-hint" = "the value is in um; to judge nothing, take the upper end"))]
    pub contact_tip_um: f64,
    /// Difference of the normal forces at the end of a motion that ends in contact, as a fraction
    /// of the larger.
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
