//! Rules that reject configurations: one entry of [`RULES`] each.

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

/// How the value of a rejection, and its limit, are said.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Amount {
    /// Not at all: there is no number.
    None,
    /// By how much the pose is missed; there is no limit.
    Missed,
    /// A value and the limit that it exceeds or does not reach.
    Limited,
    /// A length of which a certain one is required.
    Required,
    /// A signed distance: below zero a penetration, above it a clearance that is too small.
    Distance,
}

/// One rule: its names, and everything about it that somebody else needs to know.
struct Entry {
    rule: Rule,
    /// What stands in files.
    name: &'static str,
    /// What people read.
    words: &'static str,
    amount: Amount,
    /// What may make the configuration feasible if no roll does; none where nothing short of another needle would.
    remedy: Option<&'static str>,
    /// Whether the rule is one of a class of pairs, which tables name with it.
    of_class: bool,
    /// Whether the motion is still one that a robot could make, which `simulate_rejected` asks for.
    can_be_simulated: bool,
}

const ANOTHER_BASE: Option<&str> = Some("another base placement");
const ANOTHER_LIMIT: Option<&str> = Some("another base placement, tool or limit");

/// Of a rule that leaves a posture which somebody could move to.
const PHYSICAL: Entry = Entry {
    rule: Rule::Collision,
    name: "",
    words: "",
    amount: Amount::Distance,
    remedy: ANOTHER_LIMIT,
    of_class: true,
    can_be_simulated: true,
};

/// Of a rule that the joints violate.
const OF_JOINTS: Entry = Entry {
    amount: Amount::Limited,
    remedy: ANOTHER_BASE,
    of_class: false,
    can_be_simulated: false,
    ..PHYSICAL
};

/// In the order of [`Rule`].
const RULES: [Entry; 11] = [
    Entry {
        rule: Rule::NeedleRoute,
        name: "needle_route",
        words: "needle path blocked",
        remedy: None,
        of_class: false,
        ..PHYSICAL
    },
    Entry {
        rule: Rule::Unreachable,
        name: "unreachable",
        words: "out of reach",
        amount: Amount::Missed,
        ..OF_JOINTS
    },
    Entry {
        rule: Rule::Merged,
        name: "merged",
        words: "coincident solution",
        amount: Amount::None,
        remedy: None,
        ..OF_JOINTS
    },
    Entry {
        rule: Rule::NearestOnly,
        name: "nearest_only",
        words: "no exact solution",
        remedy: None,
        ..OF_JOINTS
    },
    Entry {
        rule: Rule::JointLimit,
        name: "joint_limit",
        words: "joint limit",
        ..OF_JOINTS
    },
    Entry {
        rule: Rule::Singular,
        name: "singular",
        words: "singular",
        ..OF_JOINTS
    },
    Entry {
        rule: Rule::Collision,
        name: "collision",
        words: "collision",
        ..PHYSICAL
    },
    Entry {
        rule: Rule::TooClose,
        name: "too_close",
        words: "too close",
        ..PHYSICAL
    },
    Entry {
        rule: Rule::NeedleCorridor,
        name: "needle_corridor",
        words: "access zone blocked",
        remedy: Some("another base placement or tool"),
        of_class: false,
        ..PHYSICAL
    },
    Entry {
        rule: Rule::Approach,
        name: "approach",
        words: "no linear approach",
        amount: Amount::Required,
        ..OF_JOINTS
    },
    Entry {
        rule: Rule::NoMotion,
        name: "no_motion",
        words: "no motion",
        remedy: None,
        ..PHYSICAL
    },
];

impl Rule {
    /// All of them, in the order of [`Rule::NAMES`].
    pub fn all() -> impl Iterator<Item = Self> {
        RULES.iter().map(|entry| entry.rule)
    }

    /// Names in reports and in `expected` of scenario files.
    pub const NAMES: [&str; RULES.len()] = {
        let mut names = [""; RULES.len()];
        let mut index = 0;
        while index < RULES.len() {
            names[index] = RULES[index].name;
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
        self.entry().name
    }

    /// The reason for rejection, in words.
    pub fn in_words(self) -> &'static str {
        self.entry().words
    }

    /// How value and limit of a rejection are said.
    pub fn amount(self) -> Amount {
        self.entry().amount
    }

    /// What may make a configuration feasible that no roll does: a noun phrase, as in "try another base placement".
    pub fn remedy(self) -> Option<&'static str> {
        self.entry().remedy
    }

    /// Whether a rejection is one of a class of pairs, which tables name with the rule.
    pub fn is_of_a_class(self) -> bool {
        self.entry().of_class
    }

    /// Whether the motion can be simulated all the same, where `simulate_rejected` asks for it.
    pub fn can_be_simulated(self) -> bool {
        self.entry().can_be_simulated
    }

    fn entry(self) -> &'static Entry {
        &RULES[self as usize]
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
