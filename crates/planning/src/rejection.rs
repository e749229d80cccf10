//! Why a configuration is infeasible.

use needlebench_cell::{ClearanceClass, Rule};

/// One rule that a configuration violates.
#[derive(Debug, Clone, PartialEq)]
pub struct Rejection {
    /// The rule.
    pub rule: Rule,
    /// The value that violates it, in `unit`.
    pub value: f64,
    /// The limit, in `unit`.
    pub limit: f64,
    /// Unit of both: `m`, `rad` or `1`.
    pub unit: &'static str,
    /// Which joint, pair and phase, in words.
    pub detail: String,
    /// Class of the pair, for collisions.
    pub class: Option<ClearanceClass>,
}

/// Which rule two bodies violate whose distance is below their floor, and what they do, in words: `collides with` or
/// `is too close to`.
pub(crate) fn of_distance(distance_m: f64) -> (Rule, &'static str) {
    if distance_m < 0.0 {
        (Rule::Collision, "collides with")
    } else {
        (Rule::TooClose, "is too close to")
    }
}

/// The signed distance of two solids, mm, as a clearance or as a penetration.
pub(crate) fn distance_in_words(a: &str, b: &str, distance_mm: f64) -> String {
    if distance_mm < 0.0 {
        format!("{a} penetrates {b} by {:.1} mm", -distance_mm)
    } else {
        format!("{a} is {distance_mm:.1} mm from {b}")
    }
}
