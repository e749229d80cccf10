//! Table, gantry and mount of a scenario.

use crate::fixtures::FixtureError;
use needlebench_input::{Finding, TomlText};

/// What is wrong with a fixture, at the key of its section.
pub(super) fn fixture_finding(toml: &TomlText<'_>, section: &str, error: &FixtureError) -> Finding {
    let key = match error.key() {
        Some(name) => format!("{section}.{name}"),
        None => section.to_owned(),
    };
    toml.finding(&key, error.to_string()).hint(error.hint())
}
