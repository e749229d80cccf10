//! Two results side by side.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;
use serde_json::Value;

use crate::metric::{MetricKey, resolve};
pub use crate::provenance::ProvenanceDifference;
use crate::provenance::provenance_differences;
use crate::report::{SCHEMA_VERSION, Verdict};
use crate::stored::StoredReport;
use crate::threshold::{EVERY, Subject, Threshold};

/// What to compare and what to allow.
#[derive(Debug, Clone, Default)]
pub struct CompareOptions {
    /// Goals that have another name in the second result.
    pub renamed_goals: Vec<(String, String)>,
    /// Losses that are allowed.
    pub thresholds: Vec<Threshold>,
    /// A configuration that is no longer feasible does not fail the comparison.
    pub allow_status_change: bool,
    /// A goal, a configuration or a metric that only the first has does not fail the comparison.
    pub allow_lost: bool,
}

/// Two results side by side.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// Version of the keys.
    pub schema_version: u32,
    /// `pass` where nothing was lost beyond what is allowed; `incomplete` where nothing is known to be
    /// lost, but one of the two is not complete.
    pub verdict: Verdict,
    /// Whether the verdict is `pass`.
    pub pass: bool,
    /// What was lost, if anything.
    pub failures: Vec<ComparisonFailure>,
    /// Which of the two is not complete, and why.
    pub incomplete: Vec<String>,
    /// The first result.
    pub a: Side,
    /// The second result.
    pub b: Side,
    /// What else differs between the two: versions, inputs, settings.
    pub provenance_differences: Vec<ProvenanceDifference>,
    /// Where something is compared by another name than it was asked for or written by.
    pub notes: Vec<String>,
    /// Goals of either.
    pub goals: Vec<GoalComparison>,
}

/// One of the two results.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Side {
    /// Where it comes from.
    pub source: String,
    /// Name of its scenario.
    pub scenario: Option<String>,
    /// `pass`, `fail` or `incomplete`.
    pub verdict: Option<String>,
    /// Version of needlebench.
    pub version: Option<String>,
    /// Git revision of the program.
    pub git_revision: Option<String>,
    /// SHA-256 of all sources that its results depend on.
    pub source_sha256: Option<String>,
}

/// What a failed comparison lost.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct ComparisonFailure {
    /// Goal, by its name in the first result that has it.
    pub goal: Option<String>,
    /// Configuration.
    pub label: Option<String>,
    /// Key of the metric; none where a status changed.
    pub metric: Option<String>,
    /// In words.
    pub detail: String,
}

/// One goal of either result.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GoalComparison {
    /// Name in the first result; none if it has no such goal.
    pub a: Option<String>,
    /// Name in the second.
    pub b: Option<String>,
    /// What the first recommends.
    pub recommended_a: Option<String>,
    /// What the second recommends.
    pub recommended_b: Option<String>,
    /// Configurations of either.
    pub configurations: Vec<ConfigurationComparison>,
}

impl GoalComparison {
    /// Its name, in the first result that has it.
    pub fn name(&self) -> &str {
        let name = self.a.as_deref().or(self.b.as_deref());
        name.unwrap_or_default()
    }
}

/// Better, worse or the same.
///
/// A metric without a direction, such as a joint's position, is neither better nor worse.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Change {
    /// The second is better.
    Better,
    /// The second is worse.
    Worse,
    /// Another value of what has no direction.
    Changed,
    /// No difference beyond the resolution.
    Same,
    /// Only the first has it.
    Lost,
    /// Only the second has it.
    New,
}

/// One configuration of a goal.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ConfigurationComparison {
    /// Its label.
    pub label: String,
    /// Status in the first result; none if it is not there.
    pub status_a: Option<String>,
    /// Status in the second.
    pub status_b: Option<String>,
    /// Why it was rejected in the first, if so.
    pub rejection_a: Option<String>,
    /// Why it was rejected in the second, if so.
    pub rejection_b: Option<String>,
    /// Change of the status.
    pub status: Change,
    /// Metrics that either measured.
    pub metrics: Vec<MetricComparison>,
}

impl ConfigurationComparison {
    /// The metrics that say most: of each family the last that is in both, and all that are in one.
    pub fn telling_metrics(&self) -> impl Iterator<Item = &MetricComparison> {
        let is_in_both = |found: &MetricComparison| found.a.is_some() && found.b.is_some();
        let family = |found: &MetricComparison| found.key.metric().family;
        self.metrics
            .iter()
            .enumerate()
            .filter_map(move |(at, found)| {
                let mut later = self.metrics[at + 1..].iter();
                let outdone = later.any(|other| {
                    family(other) == family(found) && is_in_both(other) && !other.key.is_of_engine()
                });
                (!outdone || found.key.is_of_engine() || !is_in_both(found)).then_some(found)
            })
    }

    /// Whether it was not rejected in either.
    pub fn works_in_either(&self) -> bool {
        [&self.status_a, &self.status_b]
            .into_iter()
            .flatten()
            .any(|status| status != "rejected")
    }
}

/// One metric of a configuration.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MetricComparison {
    /// Its key.
    pub metric: String,
    /// The metric itself.
    #[serde(skip)]
    pub key: MetricKey,
    /// Unit of the values.
    pub unit: &'static str,
    /// First value; none if it was not measured.
    pub a: Option<f64>,
    /// Second value.
    pub b: Option<f64>,
    /// Second minus first.
    pub change: Option<f64>,
    /// Change over the magnitude of the first value; none where that is 0.
    pub relative: Option<f64>,
    /// Differences up to this are none.
    pub resolution: f64,
    /// Which way it went.
    pub outcome: Change,
}

/// Why two results cannot be compared.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CompareError {
    /// A goal that is said to be renamed is not there.
    #[error("{report} has no goal `{goal}`; it has {known}")]
    UnknownGoal {
        /// The report.
        report: String,
        /// The goal.
        goal: String,
        /// Goals that it has.
        known: String,
    },
    /// A goal is renamed twice.
    #[error("goal `{goal}` is renamed twice")]
    RenamedTwice {
        /// The goal.
        goal: String,
    },
    /// Not one goal is in both.
    #[error("the reports have no goal in common: {a} and {b}")]
    NothingInCommon {
        /// Goals of the first.
        a: String,
        /// Goals of the second.
        b: String,
    },
}

/// Compares two results, goal by goal and configuration by configuration.
///
/// Lost is what a metric got worse by. The comparison fails where a loss is more than a threshold allows for a
/// configuration that worked and is not rejected now, where a metric with a threshold is no longer measured or never
/// was; unless that is allowed where a configuration that worked does not; and, unless that is allowed, where a goal, a
/// configuration, or a metric of one feasible in both is missing in the second.
///
/// # Errors
/// If the goals cannot be matched.
pub fn compare(
    a: &StoredReport,
    b: &StoredReport,
    options: &CompareOptions,
) -> Result<Comparison, CompareError> {
    let matched = matched_goals(a, b, &options.renamed_goals)?;
    let engines = engines(&matched);
    let engines: Vec<&str> = engines.iter().map(String::as_str).collect();
    let keys: Vec<MetricKey> = MetricKey::all(&engines).collect();
    let goals: Vec<GoalComparison> = matched
        .into_iter()
        .map(|(in_a, in_b)| compare_goal(in_a, in_b, &keys))
        .collect();
    let mut failures = Vec::new();
    if !options.allow_status_change {
        failures.extend(status_failures(&goals, b));
    }
    if !options.allow_lost {
        failures.extend(lost(&goals));
    }
    let incomplete: Vec<String> = [a, b]
        .into_iter()
        .filter_map(StoredReport::incomplete)
        .collect();
    let mut notes = Vec::new();
    let mut metrics = goals
        .iter()
        .flat_map(|goal| &goal.configurations)
        .flat_map(|each| &each.metrics);
    if !metrics.any(|found| found.a.is_some() && found.b.is_some()) {
        notes.push("no metric is in both: only outcomes are compared".to_owned());
    }
    for threshold in &options.thresholds {
        let found = threshold_failures(&goals, threshold);
        failures.extend(found.failures);
        notes.extend(found.note);
    }
    let verdict = Verdict::of(!failures.is_empty(), !incomplete.is_empty());
    Ok(Comparison {
        schema_version: SCHEMA_VERSION,
        verdict,
        pass: verdict == Verdict::Pass,
        failures,
        incomplete,
        a: side(a),
        b: side(b),
        provenance_differences: provenance_differences(a, b),
        notes,
        goals,
    })
}

/// Engines that measured anything.
fn engines(goals: &[MatchedGoals<'_>]) -> BTreeSet<String> {
    let goals = goals.iter().flat_map(|(a, b)| [*a, *b]).flatten();
    goals
        .filter_map(|(_, goal)| goal.get("configurations")?.as_array())
        .flatten()
        .filter_map(|configuration| configuration.get("engines")?.as_object())
        .flat_map(|engines| engines.keys().cloned())
        .collect()
}

fn side(report: &StoredReport) -> Side {
    let text = |pointer: &str| report.text(pointer).map(str::to_owned);
    Side {
        source: report.source().to_owned(),
        scenario: text("/scenario/name"),
        verdict: text("/verdict"),
        version: text("/provenance/version"),
        git_revision: text("/provenance/git_revision"),
        source_sha256: text("/provenance/source_sha256"),
    }
}

type NamedGoal<'a> = (&'a str, &'a Value);
/// A goal of the first result, of the second, or the same goal of both.
type MatchedGoals<'a> = (Option<NamedGoal<'a>>, Option<NamedGoal<'a>>);

/// Goals of the first result with their partners, then those that only the second has.
fn matched_goals<'a>(
    a: &'a StoredReport,
    b: &'a StoredReport,
    renamed: &[(String, String)],
) -> Result<Vec<MatchedGoals<'a>>, CompareError> {
    let names = |report: &StoredReport| {
        let names: Vec<&str> = report.goals().map(|(name, _)| name).collect();
        names.join(", ")
    };
    let has = |report: &StoredReport, goal: &str| report.goals().any(|(name, _)| name == goal);
    for (index, (from, to)) in renamed.iter().enumerate() {
        for (report, goal) in [(a, from), (b, to)] {
            if !has(report, goal) {
                return Err(CompareError::UnknownGoal {
                    report: report.source().to_owned(),
                    goal: goal.clone(),
                    known: names(report),
                });
            }
        }
        let earlier = &renamed[..index];
        if earlier.iter().any(|(a, b)| a == from || b == to) {
            return Err(CompareError::RenamedTwice { goal: from.clone() });
        }
    }
    let taken = |name: &str| renamed.iter().any(|(_, to)| to == name);
    let are_partners = |in_a: &str, in_b: &str| match renamed.iter().find(|(from, _)| from == in_a)
    {
        Some((_, to)) => to == in_b,
        None => !taken(in_b) && in_a == in_b,
    };
    let mut matched: Vec<MatchedGoals<'_>> = a
        .goals()
        .map(|goal| {
            let partner = b.goals().find(|(name, _)| are_partners(goal.0, name));
            (Some(goal), partner)
        })
        .collect();
    let left = b.goals().filter(|(name, _)| {
        !matched
            .iter()
            .any(|(_, found)| found.is_some_and(|(known, _)| known == *name))
    });
    let left: Vec<_> = left.map(|goal| (None, Some(goal))).collect();
    matched.extend(left);
    if !matched.iter().any(|(a, b)| a.is_some() && b.is_some()) {
        return Err(CompareError::NothingInCommon {
            a: names(a),
            b: names(b),
        });
    }
    Ok(matched)
}

fn compare_goal(
    a: Option<NamedGoal<'_>>,
    b: Option<NamedGoal<'_>>,
    keys: &[MetricKey],
) -> GoalComparison {
    let recommended = |goal: Option<NamedGoal<'_>>| {
        let label = goal?.1.pointer("/recommended/label")?.as_str()?;
        Some(label.to_owned())
    };
    let configurations = |goal: Option<NamedGoal<'_>>| -> Vec<Value> {
        let list = goal.and_then(|(_, goal)| goal.get("configurations")?.as_array());
        list.cloned().unwrap_or_default()
    };
    let (of_a, of_b) = (configurations(a), configurations(b));
    let label = |each: &Value| text(each, "/label").map(str::to_owned);
    let mut pairs: Vec<(Option<&Value>, Option<&Value>)> = of_a
        .iter()
        .map(|each| {
            let same = of_b.iter().find(|other| label(other) == label(each));
            (Some(each), same)
        })
        .collect();
    let only_b = of_b
        .iter()
        .filter(|each| !of_a.iter().any(|other| label(other) == label(each)));
    pairs.extend(only_b.map(|each| (None, Some(each))));
    GoalComparison {
        a: a.map(|(name, _)| name.to_owned()),
        b: b.map(|(name, _)| name.to_owned()),
        recommended_a: recommended(a),
        recommended_b: recommended(b),
        configurations: pairs
            .into_iter()
            .map(|(a, b)| compare_configuration(a, b, keys))
            .collect(),
    }
}

/// How good a status is; what this version does not know is no better than rejected.
fn standing(status: &str) -> u8 {
    match status {
        "ok" => 2,
        "failed" => 1,
        _ => 0,
    }
}

fn text<'a>(value: &'a Value, pointer: &str) -> Option<&'a str> {
    value.pointer(pointer)?.as_str()
}

fn compare_configuration(
    a: Option<&Value>,
    b: Option<&Value>,
    keys: &[MetricKey],
) -> ConfigurationComparison {
    let status = |each: Option<&Value>| text(each?, "/status").map(str::to_owned);
    let rejection = |each: Option<&Value>| {
        let rule = text(each?, "/rejections/0/rule")?;
        let detail = text(each?, "/rejections/0/detail").unwrap_or_default();
        let text = format!("{rule}: {detail}");
        Some(text.trim_end_matches(": ").to_owned())
    };
    let (status_a, status_b) = (status(a), status(b));
    let change = match (&status_a, &status_b) {
        (Some(a), Some(b)) => match standing(b).cmp(&standing(a)) {
            Ordering::Less => Change::Worse,
            Ordering::Equal => Change::Same,
            Ordering::Greater => Change::Better,
        },
        (Some(_), None) => Change::Lost,
        _ => Change::New,
    };
    let label = a.or(b).and_then(|each| text(each, "/label"));
    let measured = |each: Option<&Value>| each.map(StoredReport::measured).unwrap_or_default();
    let (in_a, in_b) = (measured(a), measured(b));
    ConfigurationComparison {
        label: label.unwrap_or_default().to_owned(),
        rejection_a: rejection(a),
        rejection_b: rejection(b),
        status_a,
        status_b,
        status: change,
        metrics: keys
            .iter()
            .filter_map(|key| {
                let read = |from: &BTreeMap<String, f64>| from.get(&*key.key()).copied();
                compare_metric(key, read(&in_a), read(&in_b))
            })
            .collect(),
    }
}

fn compare_metric(key: &MetricKey, a: Option<f64>, b: Option<f64>) -> Option<MetricComparison> {
    let metric = key.metric();
    let outcome = match (a, b) {
        (None, None) => return None,
        (Some(_), None) => Change::Lost,
        (None, Some(_)) => Change::New,
        (Some(a), Some(b)) => match metric.compare(a, b) {
            Ordering::Less if metric.better.is_none() => Change::Changed,
            Ordering::Less => Change::Worse,
            Ordering::Equal => Change::Same,
            Ordering::Greater => Change::Better,
        },
    };
    let change = a.zip(b).map(|(a, b)| b - a);
    Some(MetricComparison {
        metric: key.key().into_owned(),
        key: key.clone(),
        unit: metric.quantity.unit(),
        a,
        b,
        change,
        relative: change
            .zip(a)
            .filter(|(_, a)| *a != 0.0)
            .map(|(change, a)| change / a.abs()),
        resolution: metric.resolution,
        outcome,
    })
}

/// Configurations that do worse.
fn status_failures(goals: &[GoalComparison], b: &StoredReport) -> Vec<ComparisonFailure> {
    let mut failures = Vec::new();
    for goal in goals {
        for each in goal
            .configurations
            .iter()
            .filter(|each| each.status == Change::Worse)
        {
            let before = each.status_a.as_deref().unwrap_or("missing");
            let now = each.status_b.as_deref().unwrap_or("missing");
            let missed = || {
                let missed = missed(b, goal.b.as_deref()?, &each.label);
                (!missed.is_empty()).then(|| format!("failed: {}", missed.join(", ")))
            };
            let why = each.rejection_b.clone().or_else(missed);
            let why = why.map_or(String::new(), |why| format!(" ({why})"));
            failures.push(ComparisonFailure {
                goal: Some(goal.name().to_owned()),
                label: Some(each.label.clone()),
                metric: None,
                detail: format!("was {before}, now {now}{why}"),
            });
        }
    }
    failures
}

/// Criteria that a configuration of a report fails.
fn missed<'a>(report: &'a StoredReport, goal: &str, label: &str) -> Vec<&'a str> {
    let criteria = report.value("/criteria").and_then(Value::as_array);
    let of_it = criteria.into_iter().flatten().filter(|each| {
        text(each, "/goal") == Some(goal)
            && text(each, "/label") == Some(label)
            && each.get("pass") == Some(&Value::Bool(false))
    });
    let mut names: Vec<&str> = of_it.filter_map(|each| text(each, "/criterion")).collect();
    // One of each engine.
    names.dedup();
    names
}

/// Metrics that a failure names; the rest are counted.
const MOST_NAMED: usize = 6;

/// Goals, configurations, and metrics of configurations feasible in both, that the second does not have.
fn lost(goals: &[GoalComparison]) -> Vec<ComparisonFailure> {
    let mut failures = Vec::new();
    for goal in goals {
        let mut fail = |label: Option<&str>, metric: Option<&str>, detail: String| {
            failures.push(ComparisonFailure {
                goal: Some(goal.name().to_owned()),
                label: label.map(str::to_owned),
                metric: metric.map(str::to_owned),
                detail,
            });
        };
        if goal.b.is_none() {
            fail(
                None,
                None,
                "the goal is missing in the second result".to_owned(),
            );
            continue;
        }
        for each in &goal.configurations {
            let label = Some(each.label.as_str());
            if each.status == Change::Lost {
                let before = each.status_a.as_deref().unwrap_or("missing");
                fail(label, None, format!("was {before}, now missing"));
                continue;
            }
            // What is rejected is measured as far as it came, which is no loss of its own.
            let works =
                |status: &Option<String>| status.as_deref().is_some_and(|it| standing(it) > 0);
            if !works(&each.status_a) || !works(&each.status_b) {
                continue;
            }
            let is_lost = |found: &&MetricComparison| found.outcome == Change::Lost;
            let keys: Vec<&str> = each
                .metrics
                .iter()
                .filter(is_lost)
                .map(|found| &*found.metric)
                .collect();
            if keys.is_empty() {
                continue;
            }
            let named = keys[..keys.len().min(MOST_NAMED)].join(", ");
            let more = match keys.len().saturating_sub(MOST_NAMED) {
                0 => String::new(),
                more => format!(" and {more} more"),
            };
            let only = (keys.len() == 1).then(|| keys[0]);
            fail(label, only, format!("no longer measured: {named}{more}"));
        }
    }
    failures
}

/// What a threshold found.
struct Held {
    failures: Vec<ComparisonFailure>,
    note: Option<String>,
}

fn threshold_failures(goals: &[GoalComparison], threshold: &Threshold) -> Held {
    let Subject::Metric(wanted, _) = &threshold.subject else {
        unreachable!("runs have no rates");
    };
    let compared: Vec<(&GoalComparison, &ConfigurationComparison)> = goals
        .iter()
        .filter(|goal| goal.a.is_some() && goal.b.is_some())
        .flat_map(|goal| goal.configurations.iter().map(move |each| (goal, each)))
        .filter(|(_, each)| {
            let status = |status: &Option<String>| status.as_deref().map_or(0, standing);
            status(&each.status_a) == 2 && status(&each.status_b) > 0
        })
        .filter(|(_, each)| {
            let of = threshold.of.as_deref().unwrap_or(EVERY);
            of == EVERY || of == each.label
        })
        .collect();
    let has = |key: &str, value: fn(&MetricComparison) -> Option<f64>| {
        let mut all = compared.iter().flat_map(|(_, each)| &each.metrics);
        all.any(|found| found.metric == key && value(found).is_some())
    };
    let resolved = resolve(
        wanted,
        |key| has(key, |found| found.a),
        |key| has(key, |found| found.b),
    );
    let (key, metric, words) = (
        resolved.key.key(),
        resolved.key.metric(),
        resolved.key.words(),
    );
    let mut failures = Vec::new();
    let mut measured = false;
    for (goal, each) in &compared {
        let found = each.metrics.iter().find(|found| found.metric == key);
        let Some((first, second)) = found.and_then(|found| Some((found.a?, found.b))) else {
            continue;
        };
        measured = true;
        let text = |value: f64| metric.quantity.text(value);
        let detail = match second {
            None => format!("{words}: was {}, no longer measured", text(first)),
            Some(second) => {
                let loss = -metric.gain(first, second);
                if !threshold.limit.is_exceeded_by(loss, first) {
                    continue;
                }
                format!(
                    "{words}: {} to {}, worse by {}, threshold {}",
                    text(first),
                    text(second),
                    threshold.loss_text(loss, first),
                    threshold.text
                )
            }
        };
        failures.push(ComparisonFailure {
            goal: Some(goal.name().to_owned()),
            label: Some(each.label.clone()),
            metric: Some(key.clone().into_owned()),
            detail,
        });
    }
    if !measured {
        // A threshold that nothing is compared with would always pass.
        failures.push(ComparisonFailure {
            goal: None,
            label: None,
            metric: Some(key.into_owned()),
            detail: format!(
                "{words}: not measured in the first result for any configuration feasible in both, \
                 so its threshold checks nothing"
            ),
        });
    }
    Held {
        failures,
        note: resolved
            .note
            .map(|note| format!("threshold {}: {note}", threshold.key)),
    }
}
