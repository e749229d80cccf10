//! Proposals for a scenario: where a needle may enter for a target, and where the robot may stand for its goals.
//!
//! Both are found on a stated grid, evaluated by the code that `check` and static cases of studies have, and ranked by
//! stated terms: nothing here has rules of its own about routes or clearances. Only postures are evaluated, unless
//! motions are requested.

mod entries;
mod grid;
mod places;

use std::collections::BTreeMap;

use needlebench_cell::reason_in_words;
use needlebench_input::Finding;
use serde::Serialize;

use crate::Stop;

pub use entries::{
    ENTRY_TERMS, Entry, EntryRule, EntrySample, EntrySearch, EntryTerm, TissueMargin, plan_entry,
    suggest_entries,
};
pub use places::{
    Place, PlaceGoal, PlaceSample, PlaceSearch, at_place, plan_place, suggest_places,
};

/// Why nothing could be proposed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SuggestError {
    /// The user stopped it.
    #[error("interrupted")]
    Interrupted,
    /// Something about the scenario, and how to mend it.
    #[error("{message}")]
    Refused {
        /// What is wrong.
        message: String,
        /// How to mend it.
        hint: String,
    },
}

impl From<Finding> for SuggestError {
    fn from(finding: Finding) -> Self {
        Self::refused(finding.message, finding.hint.unwrap_or_default())
    }
}

impl SuggestError {
    /// With the scenario that it is in.
    pub fn in_file(self, file: &str) -> Stop {
        match self {
            Self::Interrupted => Stop::Interrupted,
            Self::Refused { message, hint } => Finding::new(file, message).hint(hint).into(),
        }
    }

    pub(crate) fn refused(message: impl Into<String>, hint: impl Into<String>) -> Self {
        Self::Refused {
            message: message.into(),
            hint: hint.into(),
        }
    }
}

/// How many of the tried ones a rule rejected.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Refused {
    /// The rule.
    pub rule: String,
    /// How many it rejected.
    pub count: usize,
}

impl Refused {
    /// The rule in words, behind its goal where it has one.
    pub fn in_words(&self) -> String {
        match self.rule.split_once(": ") {
            Some((goal, rule)) => format!("{goal}: {}", reason_in_words(rule)),
            None => reason_in_words(&self.rule),
        }
    }
}

/// Counts of rules, the most frequent first.
pub(crate) fn counted<'a>(rules: impl Iterator<Item = &'a str>) -> Vec<Refused> {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for rule in rules {
        *counts.entry(rule).or_default() += 1;
    }
    let mut counts: Vec<Refused> = counts
        .into_iter()
        .map(|(rule, count)| Refused {
            rule: rule.to_owned(),
            count,
        })
        .collect();
    // The sort is stable: equals stay in the order of their names.
    counts.sort_by_key(|refused| std::cmp::Reverse(refused.count));
    counts
}
