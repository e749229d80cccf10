//! How far the engines may differ before a scenario counts that as a failure.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Finding;
use crate::scenario::Scenario;
use crate::toml_text::TomlText;

/// Largest differences between the engines; judged for every configuration that both simulated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct EnvelopeSection {
    /// Distance of the needle's tips at any time before the first contact, um. The default is the
    /// figure that both engines keep on the shipped scenarios at 1 ms; it grows with step and
    /// acceleration.
    pub peak_tip_um: f64,
    /// Distance of the needle's tips at the end of a motion that ends without contact, nm.
    pub settled_tip_nm: f64,
    /// Difference of a joint's torque at any time before the first contact, N m. Assumed: a
    /// thousandth of the limit of a UR3's wrist.
    pub joint_torque_nm: f64,
    /// Distance of the needle's tips at the end of a motion that ends in contact, um.
    pub contact_tip_um: f64,
    /// Difference of the normal forces at the end of a motion that ends in contact, as a fraction
    /// of the larger.
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

/// Limits below what rounding leaves, or so wide that they judge nothing.
pub(crate) fn check_envelope(toml: &TomlText<'_>, scenario: &Scenario) -> Vec<Finding> {
    let envelope = &scenario.engines.envelope;
    [
        ("peak_tip_um", envelope.peak_tip_um, 1e-6, 1e5, "um"),
        ("settled_tip_nm", envelope.settled_tip_nm, 1e-4, 1e8, "nm"),
        (
            "joint_torque_nm",
            envelope.joint_torque_nm,
            1e-9,
            1e3,
            "N m",
        ),
        ("contact_tip_um", envelope.contact_tip_um, 1e-6, 1e5, "um"),
        (
            "contact_force_relative",
            envelope.contact_force_relative,
            1e-9,
            1.0,
            "",
        ),
    ]
    .into_iter()
    .filter(|(_, value, least, most, _)| !(*least..=*most).contains(value))
    .map(|(key, value, least, most, unit)| {
        let key = format!("engines.envelope.{key}");
        let (written, hint) = if unit.is_empty() {
            (
                value.to_string(),
                "it is a fraction: 0.01 is one percent".to_owned(),
            )
        } else {
            (
                format!("{value} {unit}"),
                format!("the value is in {unit}; to judge nothing, take the upper end"),
            )
        };
        toml.finding(
            &key,
            format!("`{key}` is {written}, outside {least} to {most}"),
        )
        .hint(hint)
    })
    .collect()
}
