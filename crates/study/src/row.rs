//! One row: one configuration in one case.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

/// The outcome of a configuration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[repr(u8)]
pub enum Outcome {
    /// Feasible, meets all criteria.
    Ok = 0,
    /// Not rejected, but fails a criterion, which [`Row::detail`] names.
    Failed = 1,
    /// A rule rejects it, which [`Row::detail`] names.
    Rejected = 2,
    /// The layout is invalid; [`Row::detail`] is the invalid key.
    Invalid = 3,
    /// Not rejected and fails no criterion that could be evaluated, but one could not be, or an engine could not
    /// execute its motion; [`Row::detail`] names which.
    NotJudged = 4,
}

impl Outcome {
    /// All of them, each at the index that it is cast to.
    pub const ALL: [Self; 5] = [
        Self::Ok,
        Self::Failed,
        Self::Rejected,
        Self::Invalid,
        Self::NotJudged,
    ];

    /// Name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Failed => "failed",
            Self::Rejected => "rejected",
            Self::Invalid => "invalid",
            Self::NotJudged => "not_judged",
        }
    }
}

/// One configuration in one case.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Index of the configuration, 0 to 7, in the order of
    /// [`Configuration::ALL`](needlebench_kinematics::ik::Configuration::ALL).
    pub configuration: u8,
    /// What became of it.
    pub outcome: Outcome,
    /// The rule or criterion that it fails, as `collision robot_phantom` or `max_tip_position_error_mm`; the key at
    /// fault of an invalid layout; what could not be evaluated, as `engine_failure rapier`; empty if it is ok.
    pub detail: Cow<'static, str>,
    /// Values of the study's columns; NaN where a row has none, and none beyond the last.
    pub values: Vec<f32>,
}

impl Row {
    /// A row without numbers.
    pub fn new(configuration: u8, outcome: Outcome, detail: impl Into<Cow<'static, str>>) -> Self {
        Self {
            configuration,
            outcome,
            detail: detail.into(),
            values: Vec::new(),
        }
    }

    /// Value of a column, by its index, if there is one.
    pub fn get(&self, column: usize) -> Option<f32> {
        let value = self.values.get(column).copied();
        value.filter(|value| !value.is_nan())
    }

    /// Sets the values of all columns. Infinities have no place in a table: they become none.
    #[must_use]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a column has 24 bits of mantissa"
    )]
    pub fn with_values(mut self, values: impl Iterator<Item = Option<f64>>) -> Self {
        let of_column = |value: Option<f64>| {
            let value = value.filter(|value| value.is_finite());
            value.map_or(f32::NAN, |value| value as f32)
        };
        self.values = values.map(of_column).collect();
        self
    }
}

/// All rows of a case, in the order of the configurations: always eight.
#[derive(Debug, Clone, PartialEq)]
pub struct CaseResult {
    /// Number of the case.
    pub case: u64,
    /// One row per configuration.
    pub rows: [Row; 8],
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outcomes_stand_where_they_are_looked_up() {
        for (index, outcome) in Outcome::ALL.into_iter().enumerate() {
            assert_eq!(outcome as usize, index);
        }
    }
}
