//! What people in the room call things: the page's dictionary.

use needlebench_cell::ResolvedScenario;
use needlebench_evaluation::metric::metrics;
use serde_json::{Map, Value, json};

/// Classes of clearance, rules and criteria, besides those that are metrics.
const NAMES: [(&str, &str); 31] = [
    ("robot_phantom", "arm to patient"),
    ("tool_phantom", "tool to patient"),
    ("guide_standoff", "guide to skin"),
    ("robot_table", "arm to table"),
    ("robot_gantry", "arm to gantry"),
    ("robot_mount", "arm to its mount"),
    ("robot_obstacle", "arm to obstacles"),
    ("robot_person", "arm to people"),
    ("self", "arm to itself"),
    ("needle_corridor", "space behind the guide"),
    ("needle_route", "needle's way in"),
    ("unreachable", "out of reach"),
    ("merged", "same as another configuration"),
    ("nearest_only", "only nearly reached"),
    ("joint_limit", "joint limit"),
    ("singular", "singular posture"),
    ("too_close", "too close"),
    ("no_motion", "no motion found"),
    ("expected", "outcome as expected"),
    ("allow_contact", "no contact"),
    ("min_working_configurations", "configurations that work"),
    (
        "engines.envelope.peak_tip_um",
        "engines' tips apart on the way",
    ),
    (
        "engines.envelope.settled_tip_nm",
        "engines' tips apart at rest",
    ),
    (
        "engines.envelope.joint_torque_nm",
        "engines' joint torques apart",
    ),
    (
        "events.max_retraction_deviation_mm",
        "way back: guide off the needle's axis",
    ),
    ("events.stop.max_tip_distance_mm", "stop: way of the tip"),
    ("events.stop.max_stopping_time_s", "stop: time to a stand"),
    ("max_force_difference", "engines' forces apart"),
    ("max_balance_difference", "force off the balance of torques"),
    ("max_tip_difference_mm", "engines' tips apart"),
    ("max_recovery_s", "time to recover"),
];

/// Words for the names that the documents of pages use.
pub(super) fn words(resolved: &ResolvedScenario) -> Value {
    let criteria = metrics().filter_map(|metric| Some((metric.criterion?.key, metric.words)));
    // Of several ways to know one thing the last one is the plain one.
    let mut words: Map<String, Value> = criteria
        .chain(NAMES)
        .map(|(name, words)| (name.to_owned(), json!(words)))
        .collect();
    let parts = resolved.words().into_iter();
    words.extend(parts.map(|(name, words)| (name, json!(words))));
    Value::Object(words)
}
