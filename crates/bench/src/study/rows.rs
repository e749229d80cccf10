//! What a case gives of each configuration, and the rows and columns that are made of it.

use std::borrow::Cow;

use needlebench_evaluation::metric::{self, Asked, MetricKey};
use needlebench_evaluation::report::ConfigurationReport;
use needlebench_kinematics::ik::Configuration;
use needlebench_planning::Rejection;
use needlebench_scenario::study::StudyMode;
use needlebench_study::{Measure, MetricColumn, Outcome, Row};

use super::margin::margin_column;

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
    /// The constraint margin of a static case's posture, m.
    pub margin_m: Option<f64>,
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
            margin_m: None,
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

/// The metric of the lesion's probability.
const LESION_PROBABILITY: &str = "lesion_probability";

/// The columns of a study.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyColumns {
    keys: Vec<MetricKey>,
    has_margin: bool,
}

impl StudyColumns {
    /// The columns of a study that computes cases in such modes and engines.
    pub fn new(modes: &[StudyMode], engines: &[&str]) -> Self {
        Self {
            keys: MetricKey::columns(modes, engines),
            has_margin: false,
        }
    }

    /// Without probabilities.
    pub fn without_probabilities(mut self) -> Self {
        self.keys
            .retain(|key| key.metric().asked != Asked::Probabilities);
        self
    }

    /// With no probability but that of the lesion.
    pub fn with_lesion_probability_alone(mut self) -> Self {
        self.keys.retain(|key| {
            key.metric().asked != Asked::Probabilities || key.metric().key == LESION_PROBABILITY
        });
        self
    }

    /// Without those that are of true targets alone.
    pub fn without_true_targets(mut self) -> Self {
        self.keys
            .retain(|key| key.metric().asked != Asked::OfTrueTargets);
        self
    }

    /// With the constraint margin, as the last one.
    pub fn with_margin(mut self) -> Self {
        self.has_margin = true;
        self
    }

    /// The metrics, in the order of the columns; the margin is none.
    pub fn keys(&self) -> &[MetricKey] {
        &self.keys
    }

    /// What the columns are.
    pub fn described(&self) -> Vec<MetricColumn> {
        let margin = self.has_margin.then(margin_column);
        self.keys.iter().map(metric_column).chain(margin).collect()
    }

    /// A configuration of a case as a row.
    pub fn row(&self, index: usize, case: &CaseRow) -> Row {
        let index = u8::try_from(index).expect("there are eight");
        let row = Row::new(index, case.outcome, case.detail.clone());
        let worst = case.measured.at_worst();
        let is_known = |key: &MetricKey, value: f64| {
            let worst = worst.as_ref().map(|worst| key.read_column(worst));
            worst.is_none_or(|worst| worst == Some(value))
        };
        let of_metrics = self.keys.iter().map(|key| {
            let is_measured = key.is_measured_in(case.mode);
            let value = is_measured.then(|| key.read_column(&case.measured))?;
            value.filter(|value| is_known(key, *value))
        });
        let margin = self
            .has_margin
            .then(|| case.margin_m.map(|margin_m| margin_m * 1e3));
        row.with_values(of_metrics.chain(margin))
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

/// The rule that rejects a configuration: `joint_limit`, `collision robot_phantom`, `too_close robot_mount`.
pub(super) fn broken_rule(rejections: &[Rejection]) -> Option<Cow<'static, str>> {
    let rejection = rejections.first()?;
    let name = rejection.rule.name();
    Some(match rejection.class {
        Some(class) if rejection.rule.is_of_a_class() => format!("{name} {}", class.name()).into(),
        _ => name.into(),
    })
}
