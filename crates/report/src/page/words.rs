//! The page's dictionary: words for names.

use needlebench_evaluation::metric::metrics;
use needlebench_scenario::ResolvedScenario;
use serde_json::{Map, Value, json};

use crate::table::class_words::CLASSES;

/// Rules and criteria, besides those that are metrics.
const NAMES: [(&str, &str); 20] = [
    ("unreachable", "out of reach"),
    ("merged", "coincides with another configuration"),
    ("nearest_only", "reached only approximately"),
    ("joint_limit", "joint limit"),
    ("singular", "singular posture"),
    ("too_close", "too close"),
    ("no_motion", "no motion found"),
    ("expected", "outcome as expected"),
    ("allow_contact", "no contact"),
    ("min_working_configurations", "feasible configurations"),
    (
        "engines.envelope.peak_tip_um",
        "tip difference between engines, in motion",
    ),
    (
        "engines.envelope.settled_tip_nm",
        "tip difference between engines, settled",
    ),
    (
        "engines.envelope.joint_torque_nm",
        "joint torque difference between engines",
    ),
    (
        "events.max_retraction_deviation_mm",
        "retreat: lateral guide deviation",
    ),
    ("events.stop.max_tip_distance_mm", "stop: tip travel"),
    ("events.stop.max_stopping_time_s", "stop: stopping time"),
    ("max_force_difference", "force difference between engines"),
    (
        "max_balance_difference",
        "deviation from static equilibrium",
    ),
    ("max_tip_difference_mm", "tip difference between engines"),
    ("max_recovery_s", "recovery time"),
];

/// Words for the names that the documents of pages use.
pub(super) fn words(resolved: &ResolvedScenario) -> Value {
    let criteria = metrics().filter_map(|metric| Some((metric.criterion?.key, metric.words)));
    // Of several ways to know one thing the last one is the plain one.
    let mut words: Map<String, Value> = criteria
        .chain(CLASSES)
        .chain(NAMES)
        .map(|(name, words)| (name.to_owned(), json!(words)))
        .collect();
    let parts = resolved.words().into_iter();
    words.extend(parts.map(|(name, words)| (name, json!(words))));
    Value::Object(words)
}
