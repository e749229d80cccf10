//! From the number of a case to the values of its factors.

use serde::{Deserialize, Serialize};

/// Whether a factor is ours to choose.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Where the robot stands, which tool it has: what a study is to find the best level of.
    Choice,
    /// How the patient lies, what was drawn: what a study is to hold for.
    #[default]
    Circumstance,
}

/// What a case varies.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Factor {
    /// Name of the column: letters, digits and `_`.
    pub name: String,
    /// Unit, from the key (`mm`, `deg`); empty if it has none.
    pub unit: String,
    /// Whether it is ours to choose.
    pub role: Role,
    /// Its values.
    pub kind: FactorKind,
}

/// Values of a factor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FactorKind {
    /// Some.
    Levels(Vec<Level>),
    /// A continuum, with the ends of the middle 99.8 % of its distribution.
    Continuous {
        /// 0.1 % quantile, or the lower end of a bounded range.
        low: f64,
        /// 99.9 % quantile, or the upper end of a bounded range.
        high: f64,
    },
}

/// One of some values.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Level {
    /// In tables.
    pub label: String,
    /// If it is a number.
    pub number: Option<f64>,
}

/// Value of a factor in a case.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FactorValue {
    /// Index of a level.
    Level(usize),
    /// A number of a continuum.
    Number(f64),
}

/// Why there is no design.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum DesignError {
    /// More cases than can be counted.
    #[error("the design has more than 2^53 cases")]
    TooMany,
}

/// All cases of a study. `goal` is always the first factor: the goal's name.
#[derive(Debug, Clone, PartialEq)]
pub struct Design {
    factors: Vec<Factor>,
    cases: u64,
}

impl Design {
    /// The factors, in the order of their columns.
    pub fn factors(&self) -> &[Factor] {
        &self.factors
    }

    /// Number of cases.
    pub fn cases(&self) -> u64 {
        self.cases
    }

    /// Values of all factors in a case, in the order of [`Design::factors`]. Depends on the design
    /// and the number alone.
    ///
    /// # Panics
    /// Beyond [`Design::cases`].
    pub fn values(&self, case: u64) -> Vec<FactorValue> {
        assert!(case < self.cases);
        Vec::new()
    }
}
