//! Numbers of cases to inspect: each can be rerun alone.

use needlebench_kinematics::ik::Configuration;
use serde::{Deserialize, Serialize};

use super::layout::{CONFIGURATIONS, Layout, has_numbers};
use super::spread::BEST;
use crate::column::indices;
use crate::{CaseResult, MetricColumn};

/// Cases that each list has at most.
pub const MOST_CASES: usize = 5;

/// Cases that show failures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    /// First cases with an invalid layout.
    pub invalid: Vec<u64>,
    /// First cases in which fewer than 1, 2, ... 8 configurations are ok.
    pub fewer_than: Vec<Vec<u64>>,
    /// Of each configuration, and of the best.
    pub configurations: Vec<ConfigurationEvidence>,
}

/// Cases that show failures of a configuration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ConfigurationEvidence {
    /// Label of the configuration, or [`BEST`].
    pub of: String,
    /// First valid cases in which it is not ok.
    pub not_ok: Vec<u64>,
    /// The worst cases by metric.
    pub worst: Vec<WorstCases>,
}

/// Worst cases by a metric.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WorstCases {
    /// Name of the metric's column, with the unit.
    pub metric: String,
    /// The worst first; equal ones in the order of their numbers.
    pub cases: Vec<CaseValue>,
}

/// A case and a value.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CaseValue {
    /// Number of the case.
    pub case: u64,
    /// The value.
    pub value: f64,
}

/// The largest of a stream, with the cases they are of.
#[derive(Debug, Clone, Default)]
pub(crate) struct Largest(Vec<CaseValue>);

impl Largest {
    pub(crate) fn push(&mut self, case: u64, value: f64) {
        if self.0.len() == MOST_CASES && self.0[MOST_CASES - 1].value >= value {
            return;
        }
        let at = self.0.partition_point(|known| known.value >= value);
        self.0.insert(at, CaseValue { case, value });
        self.0.truncate(MOST_CASES);
    }

    /// With the values as they were before they were turned round.
    pub(crate) fn finish(&self, sign: f64) -> Vec<CaseValue> {
        let turned = |each: &CaseValue| CaseValue {
            case: each.case,
            value: sign * each.value,
        };
        self.0.iter().map(turned).collect()
    }
}

/// Adds a case to the first ones.
pub(crate) fn push_first(cases: &mut Vec<u64>, case: u64) {
    if cases.len() < MOST_CASES {
        cases.push(case);
    }
}

/// Collects the evidence.
#[derive(Debug)]
pub(crate) struct Collector<'a> {
    columns: &'a [MetricColumn],
    /// Indices of the columns whose worst cases are kept.
    kept: Vec<usize>,
    invalid: Vec<u64>,
    fewer_than: [Vec<u64>; CONFIGURATIONS],
    not_ok: [Vec<u64>; CONFIGURATIONS + 1],
    /// Of each configuration and the best, one for each of the kept columns.
    worst: [Vec<Largest>; CONFIGURATIONS + 1],
}

/// -1 where less is worse.
fn sign(column: &MetricColumn) -> f64 {
    if column.more_is_better == Some(true) {
        -1.0
    } else {
        1.0
    }
}

impl<'a> Collector<'a> {
    pub(crate) fn new(columns: &'a [MetricColumn]) -> Self {
        let kept = indices(columns, |column| column.by_case);
        Self {
            columns,
            invalid: Vec::new(),
            fewer_than: Default::default(),
            not_ok: Default::default(),
            worst: std::array::from_fn(|_| vec![Largest::default(); kept.len()]),
            kept,
        }
    }

    pub(crate) fn push(&mut self, result: &CaseResult, layout: Option<&Layout>) {
        let case = result.case;
        let Some(layout) = layout else {
            push_first(&mut self.invalid, case);
            return;
        };
        for (index, cases) in self.fewer_than.iter_mut().enumerate() {
            if layout.working() <= index {
                push_first(cases, case);
            }
        }
        if layout.best.is_none() {
            push_first(&mut self.not_ok[CONFIGURATIONS], case);
        }
        for (index, row) in result.rows.iter().enumerate() {
            if !layout.works(index) {
                push_first(&mut self.not_ok[index], case);
            }
            if !has_numbers(row) {
                continue;
            }
            for (at, &column) in self.kept.iter().enumerate() {
                let Some(value) = row.get(column) else {
                    continue;
                };
                let value = sign(&self.columns[column]) * f64::from(value);
                self.worst[index][at].push(case, value);
                if layout.best == Some(index) {
                    self.worst[CONFIGURATIONS][at].push(case, value);
                }
            }
        }
    }

    pub(crate) fn finish(self) -> Evidence {
        let labels = Configuration::ALL.iter().map(|each| each.label());
        let all = labels.chain([BEST]).zip(self.not_ok).zip(&self.worst);
        let columns: Vec<&MetricColumn> = self
            .kept
            .iter()
            .map(|&index| &self.columns[index])
            .collect();
        Evidence {
            invalid: self.invalid,
            fewer_than: self.fewer_than.to_vec(),
            configurations: all
                .map(|((label, not_ok), worst)| ConfigurationEvidence {
                    of: label.to_owned(),
                    not_ok,
                    worst: columns
                        .iter()
                        .zip(worst)
                        .map(|(column, largest)| WorstCases {
                            metric: column.name.clone(),
                            cases: largest.finish(sign(column)),
                        })
                        .filter(|each| !each.cases.is_empty())
                        .collect(),
                })
                .collect(),
        }
    }
}
