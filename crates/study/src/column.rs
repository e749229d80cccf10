//! What a study measures: the columns of its table, given by whoever computes its rows.

use serde::{Deserialize, Serialize};

use crate::Row;

/// What the statistics take a column for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// The clearance: of the configurations of a layout that are ok, the one with the most is the best.
    Clearance,
    /// The error of the tip.
    TipError,
}

/// A number that rows have, or have not.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MetricColumn {
    /// Name of the column, with the unit.
    pub name: String,
    /// Name of the metric: the same in two studies is the same.
    pub key: String,
    /// The same in words.
    pub words: String,
    /// What exactly it is, with the unit.
    pub description: String,
    /// Unit; `1` of a plain number.
    pub unit: String,
    /// Whether more is better; none where neither is.
    pub more_is_better: Option<bool>,
    /// Whether quantiles, means and deviations are given, and studies are compared by it.
    pub spread: bool,
    /// Whether the worst cases are named, and studies of the same cases are compared case by case.
    pub by_case: bool,
    /// What it stands for; of several columns that a row has the last counts.
    pub measure: Option<Measure>,
    /// Key of the study's criteria that is on it.
    pub criterion: Option<String>,
}

/// Which columns stand for what.
#[derive(Debug, Clone)]
pub(crate) struct Measures {
    clearance: Vec<usize>,
    tip_error: Vec<usize>,
}

impl Measures {
    pub(crate) fn new(columns: &[MetricColumn]) -> Self {
        let of = |measure| {
            let found = columns.iter().enumerate().rev();
            let found = found.filter(|(_, column)| column.measure == Some(measure));
            found.map(|(index, _)| index).collect()
        };
        Self {
            clearance: of(Measure::Clearance),
            tip_error: of(Measure::TipError),
        }
    }

    pub(crate) fn clearance(&self, row: &Row) -> Option<f32> {
        self.clearance.iter().find_map(|&column| row.get(column))
    }

    pub(crate) fn tip_error(&self, row: &Row) -> Option<f32> {
        self.tip_error.iter().find_map(|&column| row.get(column))
    }
}

/// Indices of the columns that the statistics take up.
pub(crate) fn indices(
    columns: &[MetricColumn],
    is_wanted: impl Fn(&MetricColumn) -> bool,
) -> Vec<usize> {
    let found = columns.iter().enumerate();
    let found = found.filter(|(_, column)| is_wanted(column));
    found.map(|(index, _)| index).collect()
}
