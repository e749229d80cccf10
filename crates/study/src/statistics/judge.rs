//! Evaluates the criteria of a study.

use needlebench_input::Limit;
use needlebench_kinematics::ik::Configuration;
use needlebench_scenario::study_criteria::{BEST, EVERY, QuantileCriterion, StudyCriteria};
use serde::{Deserialize, Serialize};

use super::interval::{Interval, Rate};
use super::{MOST_CASES, Summary};
use crate::MetricColumn;

/// Verdict of one criterion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CriterionResult {
    /// Key of the criterion.
    pub criterion: String,
    /// The configuration it applies to, or `best`; none where it applies to layouts.
    pub of: Option<String>,
    /// Label of the candidate it is evaluated on, the best one; none without control factors.
    pub choice: Option<String>,
    /// Whether it is met.
    pub pass: bool,
    /// The estimate; none without data.
    pub value: Option<f64>,
    /// Its 95 % confidence interval.
    pub interval: Option<Interval>,
    /// The limit.
    pub limit: f64,
    /// Unit of the three; `1` of a share.
    pub unit: String,
    /// Whether the unfavourable end of the interval was tested instead of the estimate.
    pub confidence: bool,
    /// What was evaluated, in words, with remarks.
    pub detail: String,
    /// Numbers of the worst cases, whatever the verdict.
    pub cases: Vec<u64>,
    /// The requirement it verifies, if the study names one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub requirement: Option<String>,
}

impl CriterionResult {
    /// Whether it was evaluated; if not, it is neither met nor failed.
    pub fn is_judged(&self) -> bool {
        self.value.is_some() && (!self.confidence || self.interval.is_some())
    }

    /// Evaluated and not met.
    pub fn is_missed(&self) -> bool {
        self.is_judged() && !self.pass
    }
}

/// A criterion with its estimate.
struct Judged {
    criterion: &'static str,
    of: Option<String>,
    value: Option<f64>,
    interval: Option<Interval>,
    limit: Limit,
    unit: String,
    what: String,
    cases: Vec<u64>,
}

impl Judged {
    fn verdict(self, confidence: bool) -> CriterionResult {
        let end = |interval: Interval| {
            if self.limit.at_least {
                interval.low
            } else {
                interval.high
            }
        };
        let judged = if confidence {
            self.interval.map(end)
        } else {
            self.value
        };
        let detail = match (self.value, judged) {
            (None, _) => format!("{}: no values", self.what),
            (Some(_), None) => format!("{}: sample too small for a confidence interval", self.what),
            _ => self.what,
        };
        CriterionResult {
            criterion: self.criterion.to_owned(),
            of: self.of,
            choice: None,
            pass: self.limit.is_met_by(judged),
            value: self.value,
            interval: self.interval,
            limit: self.limit.value,
            unit: self.unit,
            confidence,
            detail,
            cases: self.cases,
            requirement: None,
        }
    }
}

/// Evaluates the criteria of a study, with control factors on the best candidate alone. One result per criterion,
/// or per configuration of a criterion on `every`, in the order of the keys.
pub fn judge_study(summary: &Summary, criteria: &StudyCriteria) -> Vec<CriterionResult> {
    let mut judged = Vec::new();
    let k = criteria.working_configurations.unwrap_or(1).clamp(1, 8) as usize;
    let overall = &summary.overall;
    if let Some(limit) = criteria.min_layouts_working {
        let what = match k {
            1 => "layouts with at least one feasible configuration".to_owned(),
            _ => format!("layouts with at least {k} feasible configurations"),
        };
        let cases = summary.evidence.fewer_than[k - 1].clone();
        judged.push(of_rate(
            "min_layouts_working",
            &overall.at_least[k - 1],
            limit,
            what,
            cases,
        ));
    }
    if !criteria.min_success_rate.is_empty() {
        for (index, configuration) in Configuration::ALL.iter().enumerate() {
            let label = configuration.label();
            let rates = &criteria.min_success_rate;
            let Some(limit) = rates.get(label).or_else(|| rates.get(EVERY)) else {
                continue;
            };
            let cases = summary.evidence.configurations[index].not_ok.clone();
            let rate = &overall.configurations[index].success;
            let what = format!("layouts in which {label} is feasible");
            judged.push(Judged {
                of: Some(label.to_owned()),
                ..of_rate("min_success_rate", rate, *limit, what, cases)
            });
        }
    }
    if let Some(limit) = criteria.max_invalid_layouts {
        // Layouts of one sampled point count as one: their correlation is not known.
        let rate = Rate::new(
            overall.invalid,
            overall.cases,
            overall.cases as f64 / summary.repeats as f64,
        );
        let what = "invalid layouts".to_owned();
        judged.push(Judged {
            limit: Limit {
                value: limit,
                at_least: false,
            },
            ..of_rate(
                "max_invalid_layouts",
                &rate,
                limit,
                what,
                summary.evidence.invalid.clone(),
            )
        });
    }
    for criterion in criteria.quantiles() {
        let columns = summary.metrics.iter();
        let mut columns: Vec<&MetricColumn> = columns
            .filter(|column| column.criterion.as_deref() == Some(criterion.key))
            .collect();
        // A study of several kinds of cases has a column of each; those without values are of others.
        let has_values = |column: &&MetricColumn| {
            let mut all = summary.spreads.iter();
            all.any(|spread| spread.metric == column.name)
        };
        if columns.iter().any(has_values) {
            columns.retain(has_values);
        } else {
            columns.truncate(1);
        }
        if columns.is_empty() {
            judged.push(of_quantile(summary, &criterion, None, criterion.of));
        }
        for column in columns {
            judged.extend(of_column(summary, &criterion, column));
        }
    }
    let on = summary.of_choice.as_ref().map(|choice| {
        let held_out = choice.held_out.map_or(String::new(), |share| {
            format!("; split-half validation {:.1} %", 100.0 * share)
        });
        format!(
            "with the best of {} candidates, {}, selected on the same layouts{held_out}",
            choice.of, choice.label
        )
    });
    judged
        .into_iter()
        .map(|mut each| {
            if let Some(why) = &summary.not_ranked {
                // A number over all candidates together has no meaning.
                (each.value, each.interval) = (None, None);
                each.cases = Vec::new();
                each.what = format!("{} with the best candidate; {why}", each.what);
            } else if let Some(on) = &on {
                each.what = format!("{}, {on}", each.what);
            }
            let mut result = each.verdict(criteria.confidence);
            result.choice = summary.of_choice.as_ref().map(|best| best.label.clone());
            result
        })
        .collect()
}

fn of_rate(
    criterion: &'static str,
    rate: &Rate,
    limit: f64,
    what: String,
    cases: Vec<u64>,
) -> Judged {
    Judged {
        criterion,
        of: None,
        value: rate.rate,
        interval: rate.interval,
        limit: Limit {
            value: limit,
            at_least: true,
        },
        unit: "1".to_owned(),
        what: match &rate.remark {
            Some(remark) => format!("{what}; {remark}"),
            None => what,
        },
        cases,
    }
}

/// A criterion on one column: one verdict, or for `every` one for each configuration that has values.
fn of_column(
    summary: &Summary,
    criterion: &QuantileCriterion<'_>,
    column: &MetricColumn,
) -> Vec<Judged> {
    let one = |of: &str| of_quantile(summary, criterion, Some(column), of);
    if criterion.of != EVERY {
        return vec![one(criterion.of)];
    }
    let labels = Configuration::ALL.iter().map(|each| each.label());
    // A configuration that is always rejected has no values to evaluate.
    let seen = labels.filter(|label| summary.spread(label, &column.name).is_some());
    let all: Vec<Judged> = seen.map(one).collect();
    if all.is_empty() {
        vec![one(EVERY)]
    } else {
        all
    }
}

fn of_quantile(
    summary: &Summary,
    criterion: &QuantileCriterion<'_>,
    column: Option<&MetricColumn>,
    of: &str,
) -> Judged {
    let name = column.map_or("", |column| column.name.as_str());
    let spread = summary.spread(of, name);
    let quantile = spread.and_then(|spread| spread.quantile(criterion.quantile));
    let worst = summary.evidence.configurations.iter();
    let cases = worst
        .filter(|each| each.of == of)
        .flat_map(|each| &each.worst)
        .filter(|each| each.metric == name)
        .flat_map(|each| each.cases.iter().map(|each| each.case))
        .take(MOST_CASES);
    let who = if of == BEST {
        "the best configuration"
    } else {
        of
    };
    let count = spread.map_or(0, |spread| spread.count);
    let percent = 100.0 * criterion.quantile;
    Judged {
        criterion: criterion.key,
        of: Some(of.to_owned()),
        value: quantile.map(|quantile| quantile.value),
        interval: quantile.and_then(|quantile| quantile.interval),
        limit: criterion.limit,
        unit: column.map_or_else(|| "mm".to_owned(), |column| column.unit.clone()),
        what: match (column, spread, quantile) {
            (_, Some(_), None) => format!("the summary lacks P{percent}"),
            (None, ..) => format!("P{percent} of {who}: not measured in this study"),
            (Some(column), ..) => {
                format!("P{percent} {} of {who} over {count} layouts", column.words)
            }
        },
        cases: cases.collect(),
    }
}
