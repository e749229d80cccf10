//! Why nothing could be proposed, and what was rejected on the way.

use std::collections::BTreeMap;

use needlebench_cell::reason_in_words;
use needlebench_input::Finding;
use needlebench_scenario::NoEntry;
use serde::Serialize;

use crate::stop::Stop;

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

impl From<SuggestError> for NoEntry {
    fn from(error: SuggestError) -> Self {
        let message = error.to_string();
        let hint = match error {
            SuggestError::Interrupted => String::new(),
            SuggestError::Refused { hint, .. } => hint,
        };
        Self {
            message,
            hint,
            nothing_serves: false,
        }
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

    /// Something about the scenario, with how to mend it.
    pub fn refused(message: impl Into<String>, hint: impl Into<String>) -> Self {
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
pub fn counted<'a>(rules: impl Iterator<Item = &'a str>) -> Vec<Refused> {
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
