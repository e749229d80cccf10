//! What a case gives of each configuration, and the rows and columns that are made of it.

use std::borrow::Cow;

use needlebench_cell::study::StudyMode;
use needlebench_evaluation::metric::{self, MetricKey};
use needlebench_evaluation::report::ConfigurationReport;
use needlebench_kinematics::ik::Configuration;
use needlebench_planning::{Rejection, Rule};
use needlebench_study::{Measure, MetricColumn, Outcome, Row};

/// One configuration in one case.
#[derive(Debug, Clone, PartialEq)]
pub struct CaseRow {
    /// What became of it.
    pub outcome: Outcome,
    /// The rule or criterion that it breaks, or the key at fault; empty if it is ok.
    pub detail: Cow<'static, str>,
    /// How it was computed.
    pub mode: StudyMode,
    /// What was measured; of a static case, of its posture.
    pub measured: ConfigurationReport,
}

impl CaseRow {
    /// A configuration of which nothing is known but its outcome.
    pub(super) fn new(
        configuration: Configuration,
        mode: StudyMode,
        outcome: Outcome,
        detail: impl Into<Cow<'static, str>>,
    ) -> Self {
        Self {
            outcome,
            detail: detail.into(),
            mode,
            measured: ConfigurationReport::new(configuration.label()),
        }
    }

    /// Value of a metric in SI units, by its key.
    pub fn get(&self, key: &str) -> Option<f64> {
        let engines: Vec<&str> = self.measured.engines.keys().map(String::as_str).collect();
        let found = MetricKey::named(key, &engines)?;
        found
            .is_measured_in(self.mode)
            .then(|| found.read(&self.measured))
            .flatten()
    }
}

/// The columns of a study.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyColumns(Vec<MetricKey>);

impl StudyColumns {
    /// The columns of a study that computes cases in such modes and engines.
    pub fn new(modes: &[StudyMode], engines: &[&str]) -> Self {
        Self(MetricKey::columns(modes, engines))
    }

    /// Without those that are of true targets alone.
    pub fn without_true_targets(mut self) -> Self {
        self.0.retain(|key| !key.metric().is_of_true_target);
        self
    }

    /// The metrics, in the order of the columns.
    pub fn keys(&self) -> &[MetricKey] {
        &self.0
    }

    /// What the columns are.
    pub fn described(&self) -> Vec<MetricColumn> {
        self.0.iter().map(metric_column).collect()
    }

    /// A configuration of a case as a row.
    pub fn row(&self, index: usize, case: &CaseRow) -> Row {
        let index = u8::try_from(index).expect("there are eight");
        let row = Row::new(index, case.outcome, case.detail.clone());
        row.with_values(self.0.iter().map(|key| {
            let known = key.is_measured_in(case.mode);
            known.then(|| key.read_column(&case.measured)).flatten()
        }))
    }

    /// All configurations of a case as rows.
    pub fn rows(&self, case: &[CaseRow; 8]) -> [Row; 8] {
        std::array::from_fn(|index| self.row(index, &case[index]))
    }
}

/// A metric as a column.
pub fn metric_column(key: &MetricKey) -> MetricColumn {
    let statistics = key.statistics();
    MetricColumn {
        name: key.column(),
        key: key.key().into_owned(),
        words: key.words(),
        description: key.description(),
        unit: key.metric().unit.symbol.to_owned(),
        more_is_better: key.more_is_better(),
        spread: statistics.spread,
        by_case: statistics.by_case,
        measure: statistics.role.map(|role| match role {
            metric::Role::Clearance => Measure::Clearance,
            metric::Role::TipError => Measure::TipError,
        }),
        criterion: statistics.criterion.map(str::to_owned),
    }
}

/// The rule that rejects a configuration: `joint_limit`, `collision robot_phantom`.
pub(super) fn broken_rule(rejections: &[Rejection]) -> Option<Cow<'static, str>> {
    let rejection = rejections.first()?;
    let name = rejection.rule.name();
    Some(match (rejection.rule, rejection.class) {
        (Rule::Collision | Rule::NoMotion, Some(class)) => {
            format!("{name} {}", class.name()).into()
        }
        _ => name.into(),
    })
}
