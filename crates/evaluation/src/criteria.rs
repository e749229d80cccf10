//! Criteria of a scenario on the values of a configuration.

use std::borrow::Cow;

use needlebench_cell::{SCAN_ENDS, UNSEEN_BODY};
use needlebench_input::Limit;
use needlebench_scenario::scenario::CriteriaSection;
use needlebench_scenario::study::StudyMode;

use crate::adjudication::{WITHOUT_CONTACT, sentence};
use crate::metric::{Asked, Better, Criterion, Metric, Missing, Quantity, Source, metrics};
use crate::report::{ConfigurationReport, CriterionResult, EngineReport, Judged, NotJudged};
use crate::verdict::{UNCOMPARED, unmeasured_by};

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

/// Keys of the criteria that have a limit and that cases of a mode are evaluated by.
pub fn criteria_with_limits(criteria: &CriteriaSection, mode: StudyMode) -> Vec<&'static str> {
    let mut keys: Vec<&'static str> = limits(criteria, mode)
        .map(|(_, criterion, _)| criterion.key)
        .collect();
    keys.sort_unstable();
    keys.dedup();
    keys
}

/// Keys of the criteria on what engines differ by that have a limit: they take two engines.
pub fn comparing_engines(criteria: &CriteriaSection) -> Vec<&'static str> {
    limits(criteria, StudyMode::Dynamic)
        .filter(|(_, criterion, _)| criterion.missing == Missing::UnjudgedIfCompared)
        .map(|(_, criterion, _)| criterion.key)
        .collect()
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
                let value = read(report);
                if value.is_none() && criterion.missing == Missing::Skips {
                    return None;
                }
                Some(Checked {
                    metric,
                    criterion,
                    engine: Some((name.as_str(), report)),
                    value,
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

/// Checks a feasible configuration against all criteria; a run's are those of a dynamic case.
///
/// Values of the engines are checked for each of `engines`, those that were to measure it; clearances over all of them
/// and by their certified lower bounds; what engines differ by where there are several of them. What was to be measured
/// and was not is not evaluated.
pub fn check_configuration(
    goal: &str,
    configuration: &ConfigurationReport,
    criteria: &CriteriaSection,
    mode: StudyMode,
    engines: &[&str],
) -> Judged {
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
        requirement: None,
    };
    let missing = |engine: Option<&str>, criterion: &str, reason: String| NotJudged {
        goal: goal.to_owned(),
        label: Some(configuration.label.to_owned()),
        engine: engine.map(str::to_owned),
        criterion: criterion.to_owned(),
        reason,
        requirement: None,
    };
    let mut judged = Judged::default();
    for checked in of_engines(configuration, criteria, mode) {
        let never = checked.criterion.missing == Missing::Never;
        let result = result(checked);
        if never && result.value.is_none() {
            judged.results.push(result);
        } else {
            judged.add(result, || "no value".to_owned());
        }
    }
    let unmeasured = |name: &&&str| !configuration.engines.contains_key(**name);
    let absent: Vec<&str> = engines.iter().filter(unmeasured).copied().collect();
    for name in &absent {
        let of_engine = limits(criteria, mode)
            .filter(|(metric, ..)| matches!(metric.source, Source::Engines(_)))
            .filter(|(metric, criterion, _)| {
                criterion.missing != Missing::Skips || is_known(metric.family, configuration)
            })
            .map(|(_, criterion, _)| criterion.key);
        // Even without a limit on what it measures it was to show that the motion can be made.
        let keys: Vec<&str> = of_engine.collect();
        let keys = if keys.is_empty() {
            vec!["measured"]
        } else {
            keys
        };
        let reason = || unmeasured_by(name);
        let all = keys.iter().map(|key| missing(Some(name), key, reason()));
        judged.not_judged.extend(all);
    }
    let (of_both, others): (Vec<_>, Vec<_>) = of_configuration(configuration, criteria, mode)
        .partition(|checked| checked.criterion.missing == Missing::UnjudgedIfCompared);
    if engines.len() > 1 {
        for checked in of_both {
            judged.add(result(checked), || UNCOMPARED.to_owned());
        }
        if configuration.adjudication.is_none() {
            let all = WITHOUT_CONTACT.map(|key| missing(None, key, UNCOMPARED.to_owned()));
            judged.not_judged.extend(all);
        }
        let of_envelope = within_envelope(goal, configuration);
        judged.results.extend(of_envelope);
    }
    for checked in others {
        let is_probability = checked.metric.asked == Asked::Probabilities;
        judged.add(result(checked), || {
            let budget = configuration.budget_failure.as_ref();
            let budget = budget.map(|failure| format!("no error budget: {failure}"));
            let own = configuration.probability_failure.clone();
            let own = own.filter(|_| is_probability);
            own.or(budget).unwrap_or_else(|| "not measured".to_owned())
        });
    }
    if let Some(probability) = &configuration.probability {
        let decided = criteria_with_limits(criteria, mode);
        let open = probability.undecided(criteria).into_iter();
        for (key, reason) in open.filter(|(key, _)| decided.contains(key)) {
            judged.set_open(missing(None, key, reason));
        }
    }
    if configuration.engines.is_empty() && !absent.is_empty() {
        // What is known of the plan was to be judged by the simulated motion.
        for key in planned_alone(configuration, criteria, mode) {
            judged
                .not_judged
                .push(missing(None, key, "measured by no engine".to_owned()));
        }
    }
    if let Some(events) = &configuration.events {
        judged.extend(events.checks.clone());
    }
    for class in configuration.unknown_clearances() {
        judged.leave_open(&missing(
            None,
            &clearance_key(class),
            UNSEEN_BODY.to_owned(),
        ));
    }
    judged
}

/// Key of the criterion on the clearance of a class.
fn clearance_key(class: &str) -> String {
    format!("min_clearance_mm.{class}")
}

/// Whether a configuration has any of a family's metrics.
fn is_known(family: &str, configuration: &ConfigurationReport) -> bool {
    metrics()
        .filter(|metric| metric.family == family)
        .any(|metric| metric.read(configuration).is_some())
}

/// Keys of criteria that are skipped where nothing is measured, but could be evaluated in another mode: there is
/// something to measure.
fn planned_alone(
    configuration: &ConfigurationReport,
    criteria: &CriteriaSection,
    mode: StudyMode,
) -> Vec<&'static str> {
    let mut keys: Vec<&'static str> = limits(criteria, mode)
        .filter(|(metric, criterion, _)| {
            matches!(metric.source, Source::Configuration(_))
                && criterion.missing == Missing::Skips
                && metric.read(configuration).is_none()
                && is_known(metric.family, configuration)
        })
        .map(|(_, criterion, _)| criterion.key)
        .collect();
    keys.dedup();
    keys
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
            requirement: None,
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

/// The first criterion that a static case's posture misses, or else why one on its clearances is not evaluated, in
/// the words of [`NotJudged::detail`].
pub fn judge_posture(
    posture: &ConfigurationReport,
    criteria: &CriteriaSection,
) -> Option<PostureFault> {
    if let Some(missed) = first_missed_by_posture(posture, criteria) {
        return Some(PostureFault::Missed(missed));
    }
    let unknown = posture.unknown_clearances();
    let first = unknown.first()?;
    Some(PostureFault::NotJudged(format!("{SCAN_ENDS} {first}")))
}

/// What there is against a posture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PostureFault {
    /// It misses this criterion.
    Missed(&'static str),
    /// It misses none that is known, and a clearance is not evaluated for this reason.
    NotJudged(String),
}

impl PostureFault {
    /// The criterion, or the reason.
    pub fn into_detail(self) -> Cow<'static, str> {
        match self {
            Self::Missed(criterion) => criterion.into(),
            Self::NotJudged(reason) => reason.into(),
        }
    }
}

/// What a radian or a plain number counts in metres, where unlike criteria are compared: about the lever of the wrist.
const METRES_PER_UNIT: f64 = 0.1;

/// By how much a static case's posture misses the criterion that it misses most, m, negative; none where it
/// misses none that it is known of. Radians and plain numbers count 100 mm.
pub fn worst_miss_by_posture_m(
    posture: &ConfigurationReport,
    criteria: &CriteriaSection,
) -> Option<f64> {
    of_configuration(posture, criteria, StudyMode::Static)
        .filter(|checked| !checked.is_met())
        .filter_map(|checked| {
            let by = -(checked.value? - checked.limit.value).abs();
            Some(match checked.metric.quantity {
                Quantity::Length => by,
                _ => by * METRES_PER_UNIT,
            })
        })
        .reduce(f64::min)
}
