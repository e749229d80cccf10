//! Rules that reject configurations: one line of [`RULES`] each.

/// What a configuration is rejected by, in the order in which rules are applied.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Rule {
    /// The planned needle is too close to bone, vessel or organ, in every configuration.
    NeedleRoute,
    /// No joint positions bring the guide there in this configuration.
    Unreachable,
    /// At this pose the configuration is the same posture as another one.
    Merged,
    /// Only a nearest posture exists, not an exact one.
    NearestOnly,
    /// A joint would leave its range.
    JointLimit,
    /// The final posture is too close to a singularity.
    Singular,
    /// Bodies touch: the distance between them is below zero.
    Collision,
    /// Bodies do not touch, but their clearance is below the floor of their class, or not certified to be above it.
    TooClose,
    /// The access zone behind the guide, which needle and hand require, is blocked.
    NeedleCorridor,
    /// The linear approach along the needle to the final pose is infeasible.
    Approach,
    /// The posture is free and so is the approach, but no motion from the start was found.
    NoMotion,
}

/// What stands in files and what people read, in the order of [`Rule`].
const RULES: [(Rule, &str, &str); 11] = [
    (Rule::NeedleRoute, "needle_route", "needle path blocked"),
    (Rule::Unreachable, "unreachable", "out of reach"),
    (Rule::Merged, "merged", "coincident solution"),
    (Rule::NearestOnly, "nearest_only", "no exact solution"),
    (Rule::JointLimit, "joint_limit", "joint limit"),
    (Rule::Singular, "singular", "singular"),
    (Rule::Collision, "collision", "collision"),
    (Rule::TooClose, "too_close", "too close"),
    (
        Rule::NeedleCorridor,
        "needle_corridor",
        "access zone blocked",
    ),
    (Rule::Approach, "approach", "no linear approach"),
    (Rule::NoMotion, "no_motion", "no motion"),
];

impl Rule {
    /// All of them, in the order of [`Rule::NAMES`].
    pub fn all() -> impl Iterator<Item = Self> {
        RULES.iter().map(|(rule, ..)| *rule)
    }

    /// Names in reports and in `expected` of scenario files.
    pub const NAMES: [&str; RULES.len()] = {
        let mut names = [""; RULES.len()];
        let mut index = 0;
        while index < RULES.len() {
            names[index] = RULES[index].1;
            index += 1;
        }
        names
    };

    /// The rule of a name.
    pub fn named(name: &str) -> Option<Self> {
        Self::all().find(|rule| rule.name() == name)
    }

    /// Name in reports and in `expected` of scenario files.
    pub fn name(self) -> &'static str {
        RULES[self as usize].1
    }

    /// The reason for rejection, in words.
    pub fn in_words(self) -> &'static str {
        RULES[self as usize].2
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_rule_is_at_its_place_and_has_words() {
        for (index, rule) in Rule::all().enumerate() {
            assert_eq!(rule as usize, index, "{}", rule.name());
            assert_eq!(Rule::named(rule.name()), Some(rule));
            assert!(!rule.in_words().contains('_'), "{}", rule.name());
        }
    }
}
