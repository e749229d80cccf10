//! Two studies side by side.
//!
//! Studies of the same design are compared case by case; others by their rates and quantiles. What is
//! compared is read from the tables alone, in a few passes and without keeping cases.

mod metric;
mod paired;
#[cfg(test)]
mod tests;

use needlebench_kinematics::ik::Configuration;
use serde::Serialize;

pub use metric::{EVERY, STUDY_RATES, StudyLimit, StudyRate, StudySubject, StudyThreshold};
pub use paired::{ConfigurationTransition, Paired, PairedDifference, Transition};

use crate::statistics::{BEST, Interval, Rate, Summary, SummaryOptions, summarise};
use crate::{MetricColumn, Results, ResultsError};
use metric::{Compared, INVALID_LAYOUTS, SUCCESS_RATE, WORKING_LAYOUTS, bad_tail};

/// Version of the keys of a [`StudyComparison`].
pub const COMPARISON_VERSION: u32 = 1;

/// Two studies side by side.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StudyComparison {
    /// Version of the keys.
    pub schema_version: u32,
    /// Whether there is no regression beyond the thresholds.
    pub pass: bool,
    /// The regressions.
    pub failures: Vec<StudyFailure>,
    /// The first study.
    pub a: StudySide,
    /// The second study.
    pub b: StudySide,
    /// Where something is compared by another name than it was asked for or written by.
    pub notes: Vec<String>,
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

/// A regression.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct StudyFailure {
    /// Key of the metric, or name of the rate.
    pub metric: String,
    /// Configuration, or `best`; none of layouts.
    pub of: Option<String>,
    /// Threshold that was exceeded; none of a significant regression without one.
    pub threshold: Option<String>,
    /// In words.
    pub detail: String,
    /// Cases that show it, to be rerun in the second study.
    pub cases: Vec<u64>,
}

/// A rate or quantile in both studies.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Change {
    /// Key of the metric, or name of the rate.
    pub metric: String,
    /// The same in words.
    pub words: String,
    /// Share of the quantile; none of a rate.
    pub quantile: Option<f64>,
    /// Configuration, or `best`; none of layouts.
    pub of: Option<String>,
    /// Unit of the values; `1` of a rate.
    pub unit: String,
    /// In the first study; none where it has none.
    pub a: Option<f64>,
    /// Its 95 % interval.
    pub a_interval: Option<Interval>,
    /// In the second study.
    pub b: Option<f64>,
    /// Its 95 % interval.
    pub b_interval: Option<Interval>,
    /// Second minus first.
    pub change: Option<f64>,
    /// By how much the second is worse; negative where it is better.
    pub loss: Option<f64>,
    /// Whether the difference is significant: by the paired test of rates of the same cases, else where
    /// the intervals do not overlap.
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
    pub unit: String,
    /// Whether the regression is within the threshold.
    pub pass: bool,
    /// In words.
    pub detail: String,
}

/// Thresholds and options of a comparison.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct StudyCompareOptions {
    /// Thresholds.
    pub thresholds: Vec<StudyThreshold>,
    /// A significantly lower rate does not fail the comparison unless a threshold does.
    pub allow_status_change: bool,
    /// Cases and metrics that only the first has do not fail the comparison.
    pub allow_lost: bool,
    /// What there is to say of the names of metrics.
    pub notes: Vec<String>,
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

/// Two studies, read and summed up.
pub struct StudyPair<'a> {
    studies: [ComparedStudy<'a>; 2],
    summaries: [Summary; 2],
    /// Case by case, or why not.
    paired: Result<Paired, String>,
}

impl<'a> StudyPair<'a> {
    /// Reads both, with quantiles at such shares beside those that are always given.
    ///
    /// # Errors
    /// If a table cannot be read.
    pub fn read(
        a: ComparedStudy<'a>,
        b: ComparedStudy<'a>,
        quantiles: &[f64],
    ) -> Result<Self, ResultsError> {
        let options = SummaryOptions {
            factors: false,
            more_quantiles: quantiles.to_vec(),
            ..SummaryOptions::default()
        };
        Ok(Self {
            summaries: [
                summarise(a.results, &options)?,
                summarise(b.results, &options)?,
            ],
            paired: paired::paired(a.results, b.results)?,
            studies: [a, b],
        })
    }

    /// Whether each of the two has any value of a metric, by its key.
    pub fn have(&self, key: &str) -> [bool; 2] {
        self.summaries.each_ref().map(|summary| {
            let mut columns = summary.metrics.iter();
            columns.any(|column| {
                let mut spreads = summary.spreads.iter();
                column.key == key && spreads.any(|spread| spread.metric == column.name)
            })
        })
    }

    /// Compares the two.
    ///
    /// The comparison fails where a regression exceeds a threshold, and, unless that is allowed, where
    /// the share of feasible layouts or the success rate of a configuration is significantly lower and
    /// has no threshold; and, unless that is allowed, where the second has fewer cases or no values of
    /// a metric that the first has.
    pub fn compare(self, options: &StudyCompareOptions) -> StudyComparison {
        let [a, b] = self.studies;
        let [summary_a, summary_b] = &self.summaries;
        let (paired, unpaired_because) = match self.paired {
            Ok(paired) => (Some(paired), None),
            Err(reason) => (None, Some(reason)),
        };
        let both = Both {
            a: summary_a,
            b: summary_b,
            paired: paired.as_ref(),
        };
        let (thresholds, mut failures) = held(&both, options);
        let changes = both.changes();
        if !options.allow_status_change {
            failures.extend(lost_rates(&both, options, &changes));
        }
        if !options.allow_lost {
            failures.extend(lost(summary_a, summary_b));
        }
        StudyComparison {
            schema_version: COMPARISON_VERSION,
            pass: failures.is_empty(),
            failures,
            a: side(a, summary_a),
            b: side(b, summary_b),
            notes: options.notes.clone(),
            unpaired_because,
            changes,
            thresholds,
            paired,
        }
    }
}

/// The thresholds with their values, and those that were exceeded.
fn held(
    both: &Both<'_>,
    options: &StudyCompareOptions,
) -> (Vec<ThresholdResult>, Vec<StudyFailure>) {
    let mut failures = Vec::new();
    let mut thresholds = Vec::new();
    for threshold in &options.thresholds {
        let compared = both.compared(&threshold.subject);
        for of in subjects(both, compared, threshold) {
            let change = both.change(compared, of.as_deref());
            let result = judged(threshold, &change);
            if !result.pass {
                failures.push(StudyFailure {
                    metric: change.metric,
                    of: of.clone(),
                    threshold: Some(threshold.key.clone()),
                    detail: result.detail.clone(),
                    cases: both.cases(compared, of.as_deref()),
                });
            }
            thresholds.push(result);
        }
    }
    (thresholds, failures)
}

/// Cases and metrics that the second study does not have.
fn lost(a: &Summary, b: &Summary) -> Vec<StudyFailure> {
    let failure = |metric: &str, detail: String| StudyFailure {
        metric: metric.to_owned(),
        of: None,
        threshold: None,
        detail,
        cases: Vec::new(),
    };
    let mut failures = Vec::new();
    let (before, now) = (a.overall.cases, b.overall.cases);
    if now < before {
        let detail = format!("{} of {before} cases are missing in study B", before - now);
        failures.push(failure("cases", detail));
    }
    let has_values = |summary: &Summary, key: &str| {
        let mut columns = summary.metrics.iter();
        columns.any(|column| {
            let mut spreads = summary.spreads.iter();
            column.key == key && spreads.any(|spread| spread.metric == column.name)
        })
    };
    for column in &a.metrics {
        if has_values(a, &column.key) && !has_values(b, &column.key) {
            let detail = format!("{}: study B has no values", column.words);
            failures.push(failure(&column.key, detail));
        }
    }
    failures
}

/// Significantly lower rates that have no threshold.
fn lost_rates(
    both: &Both<'_>,
    options: &StudyCompareOptions,
    changes: &[Change],
) -> Vec<StudyFailure> {
    let mut failures = Vec::new();
    for change in changes {
        let mut counting = [WORKING_LAYOUTS, SUCCESS_RATE].into_iter();
        let Some(rate) = counting.find(|rate| rate.name == change.metric) else {
            continue;
        };
        let has_threshold = options.thresholds.iter().any(|each| {
            let of = each.of.as_deref();
            each.subject == StudySubject::Rate(rate)
                && (of == Some(EVERY) || of == change.of.as_deref())
        });
        let worse = change.loss.is_some_and(|loss| loss > 0.0) && change.beyond_chance;
        if worse && !has_threshold {
            failures.push(StudyFailure {
                metric: change.metric.clone(),
                of: change.of.clone(),
                threshold: None,
                detail: format!("{}, statistically significant", in_words(change)),
                cases: both.cases(Compared::Rate(rate), change.of.as_deref()),
            });
        }
    }
    failures
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
fn subjects(
    both: &Both<'_>,
    compared: Compared<'_>,
    threshold: &StudyThreshold,
) -> Vec<Option<String>> {
    if threshold.of.as_deref() != Some(EVERY) {
        return vec![threshold.of.clone()];
    }
    let found: Vec<Option<String>> = labels()
        .filter(|label| {
            let change = both.change(compared, Some(label));
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
        (Some(loss), Some(first)) => !threshold.limit.is_exceeded_by(loss, first),
        _ => false,
    };
    ThresholdResult {
        threshold: threshold.key.clone(),
        limit: threshold.text.clone(),
        of: change.of.clone(),
        loss: change.loss,
        unit: change.unit.clone(),
        pass,
        detail: match (change.a, change.b) {
            (Some(_), Some(_)) if pass => in_words(change),
            (Some(first), Some(_)) => {
                let loss =
                    threshold.loss_text(change.loss.unwrap_or_default(), first, &change.unit);
                format!("{}{loss}, limit {}", in_words(change), threshold.text)
            }
            (None, None) => format!("{}: neither study has values", what(change)),
            (None, Some(_)) => format!("{}: study A has no values", what(change)),
            (Some(_), None) => format!("{}: study B has no values", what(change)),
        },
    }
}

/// `P5 clearance of the best configuration`.
pub fn what(change: &Change) -> String {
    let quantile = change
        .quantile
        .map_or(String::new(), |p| format!("P{} ", short(100.0 * p)));
    let of = match change.of.as_deref() {
        None => String::new(),
        Some(BEST) => " of the best configuration".to_owned(),
        Some(of) => format!(" of {of}"),
    };
    format!("{quantile}{}{of}", change.words)
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
        value.map_or("none".to_owned(), |value| value_text(value, &change.unit))
    };
    let loss = change.loss.unwrap_or_default();
    let way = if loss > 0.0 { "worse" } else { "better" };
    let by = if loss == 0.0 {
        "unchanged".to_owned()
    } else {
        let size = match change.unit.as_str() {
            "1" => format!("{:.2} percentage points", 100.0 * loss.abs()),
            unit => value_text(loss.abs(), unit),
        };
        format!("{size} {way}")
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

impl<'a> Both<'a> {
    /// Columns that either study sums up, those of the first before those that only the second has.
    fn columns(&self) -> Vec<&'a MetricColumn> {
        let first = &self.a.metrics;
        let more = self.b.metrics.iter();
        let more = more.filter(|column| first.iter().all(|known| known.key != column.key));
        first.iter().chain(more).collect()
    }

    fn compared<'b>(&self, subject: &'b StudySubject) -> Compared<'b>
    where
        'a: 'b,
    {
        match subject {
            StudySubject::Rate(rate) => Compared::Rate(*rate),
            StudySubject::Metric(key, quantile) => {
                let mut columns = self.columns().into_iter();
                match columns.find(|column| column.key == *key) {
                    Some(column) => Compared::Quantile(column, *quantile),
                    None => Compared::Unknown(key, *quantile),
                }
            }
        }
    }

    fn transition(&self, compared: Compared<'_>, of: Option<&str>) -> Option<&Transition> {
        let paired = self.paired?;
        let Compared::Rate(rate) = compared else {
            return None;
        };
        if rate == WORKING_LAYOUTS {
            return Some(&paired.working);
        }
        let mut all = paired.configurations.iter();
        let found = all.find(|each| rate == SUCCESS_RATE && Some(each.label.as_str()) == of);
        found.map(|each| &each.success)
    }

    /// Cases that show a regression.
    fn cases(&self, compared: Compared<'_>, of: Option<&str>) -> Vec<u64> {
        if let Some(transition) = self.transition(compared, of) {
            return transition.lost_cases.clone();
        }
        let name = match compared {
            Compared::Rate(rate) if rate == INVALID_LAYOUTS => {
                return self.b.evidence.invalid.clone();
            }
            Compared::Rate(_) => None,
            Compared::Quantile(column, _) => Some(column.name.as_str()),
            Compared::Unknown(..) => return Vec::new(),
        };
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

    fn change(&self, compared: Compared<'_>, of: Option<&str>) -> Change {
        let (a, a_interval) = value(self.a, compared, of);
        let (b, b_interval) = value(self.b, compared, of);
        let apart = a_interval
            .zip(b_interval)
            .is_some_and(|(a, b): (Interval, Interval)| !a.overlaps(b));
        Change {
            metric: compared.name().to_owned(),
            words: compared.words().to_owned(),
            quantile: compared.quantile(),
            of: of.map(str::to_owned),
            unit: compared.unit().to_owned(),
            a,
            a_interval,
            b,
            b_interval,
            change: a.zip(b).map(|(a, b)| b - a),
            loss: a.zip(b).map(|(a, b)| compared.loss(a, b)),
            beyond_chance: self
                .transition(compared, of)
                .map_or(apart, |found| found.worse || found.better),
        }
    }

    /// Rates, then the bad tail's quantile and the median of each metric, of the best configuration and
    /// of each.
    fn changes(&self) -> Vec<Change> {
        let mut changes = Vec::new();
        for rate in STUDY_RATES {
            let compared = Compared::Rate(rate);
            if rate.of_configurations {
                changes.extend(labels().map(|label| self.change(compared, Some(label))));
            } else {
                changes.push(self.change(compared, None));
            }
        }
        for column in self.columns() {
            for of in [BEST].into_iter().chain(labels()) {
                for p in [bad_tail(column), 0.5] {
                    changes.push(self.change(Compared::Quantile(column, p), Some(of)));
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
    compared: Compared<'_>,
    of: Option<&str>,
) -> (Option<f64>, Option<Interval>) {
    let overall = &summary.overall;
    let of_rate = |rate: &Rate| (rate.rate, rate.interval);
    match compared {
        Compared::Unknown(..) => (None, None),
        Compared::Rate(rate) if rate == INVALID_LAYOUTS => {
            let points = overall.cases as f64 / summary.repeats as f64;
            of_rate(&Rate::new(overall.invalid, overall.cases, points))
        }
        Compared::Rate(rate) if rate == WORKING_LAYOUTS => of_rate(&overall.at_least[0]),
        Compared::Rate(_) => {
            let mut all = overall.configurations.iter();
            all.find(|each| Some(each.label.as_str()) == of)
                .map_or((None, None), |each| of_rate(&each.success))
        }
        Compared::Quantile(column, p) => {
            // The same key in another unit would be another number.
            let mut columns = summary.metrics.iter();
            let own = columns.find(|own| own.key == column.key && own.unit == column.unit);
            own.and_then(|own| summary.spread(of.unwrap_or(BEST), &own.name))
                .and_then(|spread| spread.quantile(p))
                .map_or((None, None), |found| (Some(found.value), found.interval))
        }
    }
}
