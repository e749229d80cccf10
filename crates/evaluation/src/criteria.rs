//! Criteria of a scenario on the values of a configuration.

use needlebench_cell::Limit;
use needlebench_cell::scenario::CriteriaSection;
use needlebench_cell::study::StudyMode;

use crate::adjudication::sentence;
use crate::metric::{Better, Criterion, Metric, Missing, Source, metrics};
use crate::report::{ConfigurationReport, CriterionResult, EngineReport};

/// A criterion on a value.
struct Checked<'a> {
    metric: &'static Metric,
    criterion: &'static Criterion,
    engine: Option<(&'a str, &'a EngineReport)>,
    value: Option<f64>,
    limit: Limit,
}

impl Checked<'_> {
    fn is_met(&self) -> bool {
        self.limit.is_met_by(self.value)
    }
}

/// The criteria that there are in such cases, as far as the scenario has a limit.
fn limits(
    criteria: &CriteriaSection,
    mode: StudyMode,
) -> impl Iterator<Item = (&'static Metric, &'static Criterion, Limit)> {
    metrics().filter_map(move |metric| {
        let criterion = metric.criterion.as_ref()?;
        if !criterion.modes.contains(&mode) {
            return None;
        }
        let limit = Limit {
            value: (criterion.limit)(criteria)?,
            at_least: metric.better == Some(Better::More),
        };
        Some((metric, criterion, limit))
    })
}

/// The criteria on what each engine measured, engine by engine.
fn of_engines<'a>(
    configuration: &'a ConfigurationReport,
    criteria: &'a CriteriaSection,
    mode: StudyMode,
) -> impl Iterator<Item = Checked<'a>> {
    configuration
        .engines
        .iter()
        .flat_map(move |(name, report)| {
            limits(criteria, mode).filter_map(move |(metric, criterion, limit)| {
                let Source::Engines(read) = metric.source else {
                    return None;
                };
                Some(Checked {
                    metric,
                    criterion,
                    engine: Some((name.as_str(), report)),
                    value: read(report),
                    limit,
                })
            })
        })
}

/// The criteria on a configuration as a whole; each by the last of its metrics that was measured.
fn of_configuration<'a>(
    configuration: &'a ConfigurationReport,
    criteria: &'a CriteriaSection,
    mode: StudyMode,
) -> impl Iterator<Item = Checked<'a>> {
    let mut all = limits(criteria, mode)
        .filter(|(metric, ..)| matches!(metric.source, Source::Configuration(_)))
        .map(|(metric, criterion, limit)| Checked {
            metric,
            criterion,
            engine: None,
            value: metric.read(configuration),
            limit,
        })
        .peekable();
    std::iter::from_fn(move || {
        let mut chosen = all.next()?;
        while let Some(next) = all.next_if(|next| next.criterion.key == chosen.criterion.key) {
            if next.value.is_some() {
                chosen = next;
            }
        }
        Some(chosen)
    })
    .filter(|checked| checked.value.is_some() || checked.criterion.missing != Missing::Skips)
}

/// Checks a configuration that works against all criteria; a run's are those of a dynamic case.
///
/// Values of the engines are checked for each engine that ran, clearances over all of them and by
/// their proven lower bounds. What engines differ by is checked where `compared` says that all of them
/// ran.
pub fn check_configuration(
    goal: &str,
    configuration: &ConfigurationReport,
    criteria: &CriteriaSection,
    mode: StudyMode,
    compared: bool,
) -> Vec<CriterionResult> {
    let result = |checked: Checked<'_>| CriterionResult {
        goal: goal.to_owned(),
        label: Some(configuration.label.to_owned()),
        engine: checked.engine.map(|(name, _)| name.to_owned()),
        criterion: checked.criterion.key.to_owned(),
        value: checked.value,
        limit: Some(checked.limit.value),
        unit: checked.metric.quantity.unit(),
        pass: checked.is_met(),
        detail: (checked.criterion.detail)(
            configuration,
            checked.engine.map(|(_, report)| report),
            criteria,
        ),
    };
    let of_engines = of_engines(configuration, criteria, mode).map(result);
    let mut results: Vec<CriterionResult> = of_engines.collect();
    let (of_both, others): (Vec<_>, Vec<_>) = of_configuration(configuration, criteria, mode)
        .partition(|checked| checked.criterion.missing == Missing::FailsIfCompared);
    if compared {
        results.extend(of_both.into_iter().map(result));
        results.extend(within_envelope(goal, configuration));
    }
    results.extend(others.into_iter().map(result));
    if let Some(events) = &configuration.events {
        results.extend(events.checks.iter().cloned());
    }
    results
}

/// The envelope that the scenario sets for the engines' difference.
fn within_envelope<'a>(
    goal: &'a str,
    configuration: &'a ConfigurationReport,
) -> impl Iterator<Item = CriterionResult> + 'a {
    let adjudication = configuration.adjudication.iter();
    let judged = adjudication.flat_map(|each| &each.quantities);
    judged.map(move |judged| {
        let limit = Limit {
            value: judged.limit,
            at_least: false,
        };
        CriterionResult {
            goal: goal.to_owned(),
            label: Some(configuration.label.to_owned()),
            engine: None,
            criterion: judged.quantity.to_owned(),
            value: Some(judged.value),
            limit: Some(judged.limit),
            unit: judged.unit,
            pass: limit.is_met_by(Some(judged.value)),
            detail: sentence(judged).unwrap_or_default(),
        }
    })
}

/// Key of the first criterion, in the order of [`check_configuration`], that a static case's posture is
/// known to miss: what was not measured says nothing.
pub fn first_missed_by_posture(
    posture: &ConfigurationReport,
    criteria: &CriteriaSection,
) -> Option<&'static str> {
    let mut all = of_configuration(posture, criteria, StudyMode::Static);
    let missed = all.find(|checked| checked.value.is_some() && !checked.is_met());
    missed.map(|checked| checked.criterion.key)
}
