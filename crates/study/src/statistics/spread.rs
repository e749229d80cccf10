//! Quantiles, means and deviations of metrics.

use std::rc::Rc;

use needlebench_kinematics::ik::Configuration;
use serde::{Deserialize, Serialize};

use super::interval::Interval;
use super::layout::{CONFIGURATIONS, Layout, has_numbers};
use super::moments::Moments;
use super::selection::Quantiles;
use crate::column::indices;
use crate::{CaseResult, MetricColumn};

/// Name of the best configuration of each layout: ok, with the largest clearance of those that are.
pub const BEST: &str = "best";

/// Shares of which the quantiles are given, from the least to the largest value.
pub const PROBABILITIES: [f64; 9] = [0.0, 0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99, 1.0];

/// How a metric is spread over layouts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// Label of the configuration, or [`BEST`].
    pub of: String,
    /// Name of the metric's column, with the unit.
    pub metric: String,
    /// Values: rows of valid layouts that are ok or failed and have the metric; of [`BEST`] the
    /// layouts in which any configuration is ok.
    pub count: u64,
    /// Mean.
    pub mean: f64,
    /// Standard deviation, with `n - 1`; none of a single value.
    pub standard_deviation: Option<f64>,
    /// Quantiles at [`PROBABILITIES`].
    pub quantiles: Vec<QuantileValue>,
}

/// One quantile.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct QuantileValue {
    /// Its share, 0 to 1.
    pub p: f64,
    /// The quantile.
    pub value: f64,
    /// Its interval by order statistics; none of the least and the largest value, and of a sample
    /// that is too small for one.
    pub interval: Option<Interval>,
    /// Says so where the sample is too small for the interval.
    pub remark: Option<String>,
}

impl Spread {
    /// The quantile of a share, if it is one of those given.
    pub fn quantile(&self, p: f64) -> Option<&QuantileValue> {
        self.quantiles.iter().find(|each| (each.p - p).abs() < 1e-9)
    }
}

/// All metrics of all configurations, and of the best.
pub(crate) struct Spreads {
    probabilities: Rc<[f64]>,
    /// Indices of the columns that are summed up.
    columns: Vec<usize>,
    /// Of each configuration and the best, one for each of those columns.
    streams: Vec<(Moments, Quantiles)>,
}

impl Spreads {
    pub(crate) fn new(
        probabilities: Rc<[f64]>,
        repeats: u64,
        tail: f64,
        columns: &[MetricColumn],
    ) -> Self {
        let columns = indices(columns, |column| column.spread);
        let stream = (
            Moments::default(),
            Quantiles::with_tail(Rc::clone(&probabilities), repeats, tail),
        );
        Self {
            probabilities,
            streams: vec![stream; (CONFIGURATIONS + 1) * columns.len()],
            columns,
        }
    }

    pub(crate) fn push(&mut self, result: &CaseResult, layout: &Layout, pass: usize) {
        let width = self.columns.len();
        for (index, row) in result.rows.iter().enumerate() {
            if !has_numbers(row) {
                continue;
            }
            for (column, &index_in_row) in self.columns.iter().enumerate() {
                let Some(value) = row.get(index_in_row) else {
                    continue;
                };
                let mut push = |at: usize| {
                    let (moments, quantiles) = &mut self.streams[at * width + column];
                    if pass == 0 {
                        moments.push(f64::from(value));
                    }
                    quantiles.push(value);
                };
                push(index);
                if layout.best == Some(index) {
                    push(CONFIGURATIONS);
                }
            }
        }
    }

    pub(crate) fn next_pass(&mut self) {
        for (_, quantiles) in &mut self.streams {
            quantiles.next_pass();
        }
    }

    /// Those that have any value, configuration by configuration, the best last.
    pub(crate) fn finish(&self, columns: &[MetricColumn]) -> Vec<Spread> {
        let labels = Configuration::ALL.iter().map(|each| each.label());
        let mut found = Vec::new();
        for (at, label) in labels.chain([BEST]).enumerate() {
            for (column, &index_in_row) in self.columns.iter().enumerate() {
                let (moments, quantiles) = &self.streams[at * self.columns.len() + column];
                let Some(mean) = moments.mean() else {
                    continue;
                };
                let values = self.probabilities.iter().filter_map(|&p| {
                    let interval = quantiles.interval(p);
                    let inner = p > 0.0 && p < 1.0;
                    Some(QuantileValue {
                        p,
                        value: quantiles.value(p)?,
                        interval,
                        remark: (inner && interval.is_none())
                            .then(|| "sample too small for an interval".to_owned()),
                    })
                });
                found.push(Spread {
                    of: label.to_owned(),
                    metric: columns[index_in_row].name.clone(),
                    count: moments.count(),
                    mean,
                    standard_deviation: moments.standard_deviation(),
                    quantiles: values.collect(),
                });
            }
        }
        found
    }
}
