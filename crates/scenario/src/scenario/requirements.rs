//! Criteria of scenarios that `[requirements]` may name.

use std::sync::LazyLock;

use schemars::{Schema, SchemaGenerator};

use super::{CriteriaSection, EnvelopeSection, Iso9283Criteria, ReplaySection};
use crate::requirements::{keys, schema};

/// Evaluated for a configuration and its goal without a limit in `[criteria]`.
const OF_GOALS: [&str; 2] = ["expected", "needle_route"];

/// Limits of `[events]`; those of a press are of any press.
const OF_EVENTS: [&str; 7] = [
    "events.max_retraction_deviation_mm",
    "events.press.max_balance_difference",
    "events.press.max_force_difference",
    "events.press.max_recovery_s",
    "events.press.max_tip_difference_mm",
    "events.stop.max_stopping_time_s",
    "events.stop.max_tip_distance_mm",
];

/// Criteria of scenarios, including those of ISO 9283, of replays and of the tolerance between the engines.
static OF_SCENARIOS: LazyLock<Vec<String>> = LazyLock::new(|| {
    let mut all = keys(&CriteriaSection::default(), "");
    // How a criterion is measured, and no criterion itself.
    all.retain(|key| key != "settling_band_mm");
    all.extend(keys(&Iso9283Criteria::default(), ""));
    all.extend(keys(&ReplaySection::default(), ""));
    all.extend(keys(&EnvelopeSection::default(), "engines.envelope."));
    all.extend(OF_GOALS.iter().chain(&OF_EVENTS).map(ToString::to_string));
    all.sort();
    all
});

pub(super) fn scenario_requirements(_: &mut SchemaGenerator) -> Schema {
    schema(&OF_SCENARIOS)
}
