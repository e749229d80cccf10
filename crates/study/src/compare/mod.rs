//! Two studies side by side.
//!
//! Studies of the same design are compared case by case; others by their rates and quantiles. What is
//! compared is read from the tables alone, in a few passes and without keeping cases.

mod paired;
#[cfg(test)]
mod tests;
mod threshold;

use needlebench_kinematics::ik::Configuration;
use serde::Serialize;

pub use paired::{ConfigurationTransition, Paired, PairedDifference, Transition};
pub use threshold::{
    EVERY, STUDY_METRICS, StudyLimit, StudyMetric, StudyThreshold, StudyThresholdError,
};

use crate::statistics::{BEST, Interval, Rate, Summary, SummaryOptions, summarise};
use crate::{METRICS, Results, ResultsError};
use threshold::{INVALID_LAYOUTS, SUCCESS_RATE, WORKING_LAYOUTS};

/// Version of the keys of a [`StudyComparison`].
pub const COMPARISON_VERSION: u32 = 1;

/// Two studies side by side.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StudyComparison {
    /// Version of the keys.
    pub schema_version: u32,
    /// Whether nothing was lost beyond what is allowed.
    pub pass: bool,
    /// What was, if anything.
    pub failures: Vec<StudyFailure>,
    /// The first study.
    pub a: StudySide,
    /// The second study.
    pub b: StudySide,
    /// Case by case; none where the two have other cases.
    pub paired: Option<Paired>,
    /// Why they are not compared case by case.
    pub unpaired_because: Option<String>,
    /// Rates and quantiles of both.
    pub changes: Vec<Change>,
    /// The thresholds, each with what it was compared with.
    pub thresholds: Vec<ThresholdResult>,
}

/// One of the two studies.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct StudySide {
    /// Where it comes from.
    pub source: String,
    /// Its name.
    pub name: String,
    /// Hash of everything that decides its results.
    pub study_id: String,
    /// Cases.
    pub cases: u64,
    /// Valid layouts.
    pub layouts: u64,
}

/// What a failed comparison lost.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct StudyFailure {
    /// Name of the metric.
    pub metric: &'static str,
    /// Configuration, or `best`; none of layouts.
    pub of: Option<String>,
    /// Threshold that was exceeded; none where more than chance was lost without one.
    pub threshold: Option<String>,
    /// In words.
    pub detail: String,
    /// Cases that show it, to be rerun in the second study.
    pub cases: Vec<u64>,
}

/// A rate or quantile in both studies.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Change {
    /// Name of the metric.
    pub metric: &'static str,
    /// Share of the quantile; none of a rate.
    pub quantile: Option<f64>,
    /// Configuration, or `best`; none of layouts.
    pub of: Option<String>,
    /// Unit of the values; `1` of a rate.
    pub unit: &'static str,
    /// In the first study; none where it has none.
    pub a: Option<f64>,
    /// Its 95 % interval.
    pub a_interval: Option<Interval>,
    /// In the second study.
    pub b: Option<f64>,
    /// Its 95 % interval.
    pub b_interval: Option<Interval>,
    /// Second less first.
    pub change: Option<f64>,
    /// By how much the second is worse; negative where it is better.
    pub loss: Option<f64>,
    /// Whether the two differ by more than chance: by the paired test of rates of the same cases, else
    /// where the intervals do not overlap.
    pub beyond_chance: bool,
}

/// A threshold and what it was compared with.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ThresholdResult {
    /// Metric, quantile and configuration as they were given.
    pub threshold: String,
    /// The limit as it was given.
    pub limit: String,
    /// Configuration, or `best`; none of layouts.
    pub of: Option<String>,
    /// By how much the second is worse, in the metric's unit; none where there is nothing to compare.
    pub loss: Option<f64>,
    /// Unit of the loss.
    pub unit: &'static str,
    /// Whether the loss is allowed.
    pub pass: bool,
    /// In words.
    pub detail: String,
}

/// What to compare with and what to allow.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct StudyCompareOptions {
    /// Losses that are allowed.
    pub thresholds: Vec<StudyThreshold>,
    /// A rate that fell by more than chance does not fail the comparison unless a threshold says so.
    pub allow_status_change: bool,
}

/// A study to compare.
#[derive(Clone, Copy)]
pub struct ComparedStudy<'a> {
    /// Where it comes from.
    pub source: &'a str,
    /// Its name.
    pub name: &'a str,
    /// Hash of everything that decides its results.
    pub study_id: &'a str,
    /// Its table.
    pub results: &'a (dyn Results + Sync),
}

/// Compares two studies.
///
/// The comparison fails where a loss is more than a threshold allows, and, unless that is allowed,
/// where the share of layouts that work or the success rate of a configuration is less by more than
/// chance and no threshold is on it.
///
/// # Errors
/// If a table cannot be read.
pub fn compare_studies(
    a: ComparedStudy<'_>,
    b: ComparedStudy<'_>,
    options: &StudyCompareOptions,
) -> Result<StudyComparison, ResultsError> {
    let wanted = options.thresholds.iter();
    let summary_options = SummaryOptions {
        factors: false,
        more_quantiles: wanted.filter_map(|each| each.quantile).collect(),
        ..SummaryOptions::default()
    };
    let summary_a = summarise(a.results, &summary_options)?;
    let summary_b = summarise(b.results, &summary_options)?;
    let (paired, unpaired_because) = match paired::paired(a.results, b.results)? {
        Ok(paired) => (Some(paired), None),
        Err(reason) => (None, Some(reason)),
    };
    let both = Both {
        a: &summary_a,
        b: &summary_b,
        paired: paired.as_ref(),
    };
    let mut failures = Vec::new();
    let mut thresholds = Vec::new();
    for threshold in &options.thresholds {
        for of in subjects(&both, threshold) {
            let change = both.change(threshold.metric, threshold.quantile, of.as_deref());
            let result = judged(threshold, &change);
            if !result.pass {
                failures.push(StudyFailure {
                    metric: threshold.metric.name,
                    of: of.clone(),
                    threshold: Some(threshold.key.clone()),
                    detail: result.detail.clone(),
                    cases: both.cases(threshold.metric, of.as_deref()),
                });
            }
            thresholds.push(result);
        }
    }
    let changes = both.changes();
    if !options.allow_status_change {
        for change in &changes {
            let metric = StudyMetric::named(change.metric);
            let has_threshold = options.thresholds.iter().any(|each| {
                let of = each.of.as_deref();
                each.metric.name == change.metric
                    && (of == Some(EVERY) || of == change.of.as_deref())
            });
            let worse = change.loss.is_some_and(|loss| loss > 0.0) && change.beyond_chance;
            let counts =
                change.metric == WORKING_LAYOUTS.name || change.metric == SUCCESS_RATE.name;
            if counts && worse && !has_threshold {
                failures.push(StudyFailure {
                    metric: change.metric,
                    of: change.of.clone(),
                    threshold: None,
                    detail: format!("{}, more than by chance", in_words(change)),
                    cases: metric
                        .map(|metric| both.cases(metric, change.of.as_deref()))
                        .unwrap_or_default(),
                });
            }
        }
    }
    Ok(StudyComparison {
        schema_version: COMPARISON_VERSION,
        pass: failures.is_empty(),
        failures,
        a: side(a, &summary_a),
        b: side(b, &summary_b),
        unpaired_because,
        changes,
        thresholds,
        paired,
    })
}

fn side(study: ComparedStudy<'_>, summary: &Summary) -> StudySide {
    StudySide {
        source: study.source.to_owned(),
        name: study.name.to_owned(),
        study_id: study.study_id.to_owned(),
        cases: summary.overall.cases,
        layouts: summary.overall.layouts,
    }
}

fn labels() -> impl Iterator<Item = &'static str> {
    Configuration::ALL.iter().map(|each| each.label())
}

/// What a threshold is about; of `every` those that the first or the second study has.
fn subjects(both: &Both<'_>, threshold: &StudyThreshold) -> Vec<Option<String>> {
    if threshold.of.as_deref() != Some(EVERY) {
        return vec![threshold.of.clone()];
    }
    let found: Vec<Option<String>> = labels()
        .filter(|label| {
            let change = both.change(threshold.metric, threshold.quantile, Some(label));
            change.a.is_some() || change.b.is_some()
        })
        .map(|label| Some(label.to_owned()))
        .collect();
    if found.is_empty() {
        vec![threshold.of.clone()]
    } else {
        found
    }
}

fn judged(threshold: &StudyThreshold, change: &Change) -> ThresholdResult {
    let pass = match (change.loss, change.a) {
        (Some(loss), Some(first)) => !threshold.is_exceeded_by(loss, first),
        _ => false,
    };
    let allowed = if pass { "" } else { ", more than" };
    ThresholdResult {
        threshold: threshold.key.clone(),
        limit: threshold.text.clone(),
        of: change.of.clone(),
        loss: change.loss,
        unit: change.unit,
        pass,
        detail: match (change.a, change.b) {
            (Some(_), Some(_)) if pass => in_words(change),
            (Some(_), Some(_)) => format!("{}{allowed} {}", in_words(change), threshold.text),
            (None, None) => format!("{}: neither study has values", what(change)),
            (None, Some(_)) => format!("{}: the first study has no values", what(change)),
            (Some(_), None) => format!("{}: the second study has no values", what(change)),
        },
    }
}

/// `5 % quantile of clearance of best`.
pub fn what(change: &Change) -> String {
    let words = StudyMetric::named(change.metric).map_or(change.metric, |metric| metric.words);
    let quantile = change.quantile.map_or(String::new(), |p| {
        format!("{} % quantile of ", short(100.0 * p))
    });
    let of = match change.of.as_deref() {
        None => String::new(),
        Some(BEST) => " of the best configuration".to_owned(),
        Some(of) => format!(" of {of}"),
    };
    format!("{quantile}{words}{of}")
}

fn short(value: f64) -> String {
    let text = format!("{value:.3}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// A value with its unit; shares in per cent.
pub fn value_text(value: f64, unit: &str) -> String {
    match unit {
        "1" => format!("{:.2} %", 100.0 * value),
        unit if value.abs() < 0.1 && value != 0.0 => format!("{value:.2e} {unit}"),
        unit => format!("{value:.2} {unit}"),
    }
}

fn in_words(change: &Change) -> String {
    let text = |value: Option<f64>| {
        value.map_or("none".to_owned(), |value| value_text(value, change.unit))
    };
    let loss = change.loss.unwrap_or_default();
    let way = if loss > 0.0 { "worse" } else { "better" };
    let by = if loss == 0.0 {
        "the same".to_owned()
    } else {
        let points = if change.unit == "1" { "points " } else { "" };
        format!("{} {points}{way}", value_text(loss.abs(), change.unit))
    };
    format!(
        "{}: {} -> {}, {by}",
        what(change),
        text(change.a),
        text(change.b)
    )
}

/// Both summaries, and what came out case by case.
struct Both<'a> {
    a: &'a Summary,
    b: &'a Summary,
    paired: Option<&'a Paired>,
}

impl Both<'_> {
    fn transition(&self, metric: StudyMetric, of: Option<&str>) -> Option<&Transition> {
        let paired = self.paired?;
        if metric == WORKING_LAYOUTS {
            return Some(&paired.working);
        }
        let mut all = paired.configurations.iter();
        let found = all.find(|each| metric == SUCCESS_RATE && Some(each.label.as_str()) == of);
        found.map(|each| &each.success)
    }

    /// Cases that show a loss.
    fn cases(&self, metric: StudyMetric, of: Option<&str>) -> Vec<u64> {
        if let Some(transition) = self.transition(metric, of) {
            return transition.lost_cases.clone();
        }
        if metric == INVALID_LAYOUTS {
            return self.b.evidence.invalid.clone();
        }
        let name = metric.column.map(|column| METRICS[column as usize].name);
        if let Some(paired) = self.paired {
            let mut all = paired.differences.iter();
            let found =
                all.find(|each| Some(each.of.as_str()) == of && Some(&*each.metric) == name);
            if let Some(found) = found {
                return found.losses.iter().map(|each| each.case).collect();
            }
        }
        let mut worst = self.b.evidence.configurations.iter();
        let of_configuration = worst.find(|each| Some(each.of.as_str()) == of);
        match (of_configuration, name) {
            (None, _) => self.b.evidence.fewer_than[0].clone(),
            (Some(found), None) => found.not_ok.clone(),
            (Some(found), Some(name)) => {
                let lists = found.worst.iter().filter(|each| each.metric == name);
                lists
                    .flat_map(|each| each.cases.iter().map(|each| each.case))
                    .collect()
            }
        }
    }

    fn change(&self, metric: StudyMetric, quantile: Option<f64>, of: Option<&str>) -> Change {
        let (a, a_interval) = value(self.a, metric, quantile, of);
        let (b, b_interval) = value(self.b, metric, quantile, of);
        let apart = a_interval
            .zip(b_interval)
            .is_some_and(|(a, b): (Interval, Interval)| !a.overlaps(b));
        Change {
            metric: metric.name,
            quantile,
            of: of.map(str::to_owned),
            unit: metric.unit(),
            a,
            a_interval,
            b,
            b_interval,
            change: a.zip(b).map(|(a, b)| b - a),
            loss: a.zip(b).map(|(a, b)| metric.loss(a, b)),
            beyond_chance: self
                .transition(metric, of)
                .map_or(apart, |found| found.worse || found.better),
        }
    }

    /// Rates, then the bad tail's quantile and the median of each metric, of the best configuration and
    /// of each.
    fn changes(&self) -> Vec<Change> {
        let mut changes = Vec::new();
        for metric in STUDY_METRICS {
            if metric == SUCCESS_RATE {
                changes.extend(labels().map(|label| self.change(metric, None, Some(label))));
            } else if metric.column.is_none() {
                changes.push(self.change(metric, None, None));
            } else {
                for of in [BEST].into_iter().chain(labels()) {
                    for p in [metric.default_quantile(), 0.5] {
                        changes.push(self.change(metric, Some(p), Some(of)));
                    }
                }
            }
        }
        changes.retain(|change| change.a.is_some() || change.b.is_some());
        changes
    }
}

/// A rate or quantile of a study, with its interval.
fn value(
    summary: &Summary,
    metric: StudyMetric,
    quantile: Option<f64>,
    of: Option<&str>,
) -> (Option<f64>, Option<Interval>) {
    let overall = &summary.overall;
    let of_rate = |rate: &Rate| (rate.rate, rate.interval);
    let Some(column) = metric.column else {
        if metric == INVALID_LAYOUTS {
            let repeats = summary.repeats as f64;
            return of_rate(&Rate::new(overall.invalid, overall.cases, repeats));
        }
        if metric == WORKING_LAYOUTS {
            return of_rate(&overall.at_least[0]);
        }
        let mut all = overall.configurations.iter();
        return all
            .find(|each| Some(each.label.as_str()) == of)
            .map_or((None, None), |each| of_rate(&each.success));
    };
    let spread = summary.spread(of.unwrap_or(BEST), METRICS[column as usize].name);
    let p = quantile.unwrap_or(metric.default_quantile());
    spread
        .and_then(|spread| spread.quantile(p))
        .map_or((None, None), |found| (Some(found.value), found.interval))
}
