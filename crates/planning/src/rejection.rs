//! Why a configuration cannot work.

use needlebench_cell::ClearanceClass;

/// Rules, in the order in which they are applied.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Rule {
    /// The planned needle comes too near to bone, vessel or organ: no configuration changes that.
    NeedleRoute,
    /// No joint positions bring the guide there in this configuration.
    Unreachable,
    /// At this pose the configuration is the same posture as another one.
    Merged,
    /// Only a nearest posture exists, not an exact one.
    NearestOnly,
    /// A joint would have to leave its range.
    JointLimit,
    /// The final posture is too near to a singularity.
    Singular,
    /// Bodies touch: the distance between them is below zero.
    Collision,
    /// Bodies do not touch, but come nearer than the floor of their class, or it cannot be proven that they do not.
    TooClose,
    /// The volume behind the guide that needle and hand need is blocked.
    NeedleCorridor,
    /// The guide cannot move straight along the needle to its place.
    Approach,
    /// The posture is free and so is the approach, but no motion from the start was found.
    NoMotion,
}

impl Rule {
    /// Name in reports and in `expected` of scenario files.
    pub fn name(self) -> &'static str {
        match self {
            Self::NeedleRoute => "needle_route",
            Self::Unreachable => "unreachable",
            Self::Merged => "merged",
            Self::NearestOnly => "nearest_only",
            Self::JointLimit => "joint_limit",
            Self::Singular => "singular",
            Self::Collision => "collision",
            Self::TooClose => "too_close",
            Self::NeedleCorridor => "needle_corridor",
            Self::Approach => "approach",
            Self::NoMotion => "no_motion",
        }
    }
}

/// One rule that a configuration breaks.
#[derive(Debug, Clone, PartialEq)]
pub struct Rejection {
    /// The rule.
    pub rule: Rule,
    /// The value that breaks it, in `unit`.
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

/// Which rule two bodies break whose distance is below their floor, and what they do, in words: `collides with` or
/// `is too close to`.
pub(crate) fn of_distance(distance_m: f64) -> (Rule, &'static str) {
    if distance_m < 0.0 {
        (Rule::Collision, "collides with")
    } else {
        (Rule::TooClose, "is too close to")
    }
}
