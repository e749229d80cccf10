//! What a study measures: the columns of its table, given by the worker that computes its rows.

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
    /// Its role in the statistics; of several columns that a row has the last counts.
    pub measure: Option<Measure>,
    /// Key of the study's criteria that is on it.
    pub criterion: Option<String>,
}

/// Beginning of the keys of the needle's distance from bone, vessels and organs, the same for all configurations.
const ROUTE_KEY: &str = "needle_route";

/// The roles of columns.
#[derive(Debug, Clone)]
pub(crate) struct Measures {
    clearance: Vec<usize>,
    tip_error: Vec<usize>,
    /// Columns of the needle path's clearance, and the required value.
    route: Option<(Vec<usize>, f64)>,
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
            route: None,
        }
    }

    /// With the required clearance of the needle path from bone, vessels and organs, mm.
    pub(crate) fn with_route(mut self, columns: &[MetricColumn], least_mm: Option<f64>) -> Self {
        let found = indices(columns, |column| column.key.starts_with(ROUTE_KEY));
        self.route = least_mm.map(|least_mm| (found, least_mm));
        self
    }

    /// Whether the needle path of a layout has the required clearance; none where it is not required or not known.
    pub(crate) fn keeps_away(&self, rows: &[Row]) -> Option<bool> {
        let (columns, least_mm) = self.route.as_ref()?;
        let mut known = rows
            .iter()
            .flat_map(|row| columns.iter().filter_map(|&column| row.get(column)));
        Some(f64::from(known.next()?) >= *least_mm)
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
