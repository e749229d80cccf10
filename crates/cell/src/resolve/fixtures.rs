//! Table, gantry and mount of a scenario.

use crate::Finding;
use crate::fixtures::FixtureError;
use crate::toml_text::TomlText;

/// What is wrong with a fixture, at the key of its section.
pub(super) fn fixture_finding(toml: &TomlText<'_>, section: &str, error: &FixtureError) -> Finding {
    let Some(name) = error.key() else {
        return toml
            .finding(section, error.to_string())
            .hint("see `base_position_mm` and `base_rpy_deg` under [robot]");
    };
    toml.finding(&format!("{section}.{name}"), error.to_string())
        .hint(if name.ends_with("_mm") {
            "lengths are in millimetres"
        } else {
            "angles are in degrees"
        })
}
