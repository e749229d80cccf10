//! Ranking of the configurations of a goal, with every term of it.
//!
//! The score of a configuration is the weighted mean of its utilities,
//! `sum_k w_k u_k / sum_k w_k`, over the metrics that were measured for *every* configuration that
//! works: a metric that one of them lacks would compare different sums. Before utilities are taken,
//! values that are tied (see [`levels`]) are replaced by the best of them, so that neither score
//! nor order depends on noise, and a configuration never scores above one that beats it in the
//! same metrics.

use needlebench_cell::ranking::{Aim, RankingSection};
use serde::Serialize;

use crate::metric::{Better, ConfigurationFacts, METRICS, Metric};
use crate::pareto::{dominates, levels, pareto_set};
use crate::reason::reason;
use crate::report::{ConfigurationReport, GoalReport, Recommendation, Status};

/// Score of a configuration that works.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RankingReport {
    /// 1 is the first choice.
    pub rank: usize,
    /// Sum of the contributions: 0 to 1.
    pub score: f64,
    /// What makes it up.
    pub terms: Vec<Term>,
}

/// One metric's share in a score.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Term {
    /// Name of the metric.
    pub metric: &'static str,
    /// Value of the configuration.
    pub value: f64,
    /// Best value that is tied with it.
    pub counted_as: f64,
    /// Unit of both.
    pub unit: &'static str,
    /// Utility of `counted_as`, 0 to 1.
    pub utility: f64,
    /// Weight of the metric.
    pub weight: f64,
    /// Weight over the sum of weights, times utility.
    pub contribution: f64,
}

/// A configuration that is at least as good in every metric of the Pareto set and better in some.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Dominance {
    /// Its label; of several the one with the best score.
    pub label: String,
    /// Metrics in which it is better, beyond their resolution.
    pub better_in: Vec<&'static str>,
}

/// How the configurations of a goal compare.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GoalRanking {
    /// Configurations that work, first choice first.
    pub order: Vec<String>,
    /// Those that no other one beats, in the order of the report.
    pub pareto_set: Vec<String>,
    /// The metrics and how each counts.
    pub metrics: Vec<RankedMetric>,
    /// Second choice.
    pub runner_up: Option<String>,
    /// Smallest change of one weight that makes another configuration the first choice; none if no
    /// single weight can.
    pub smallest_weight_change: Option<WeightChange>,
}

/// How a metric counts.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RankedMetric {
    /// Its name.
    pub name: &'static str,
    /// Unit of resolution and anchors.
    pub unit: &'static str,
    /// `more` or `less`.
    pub better: &'static str,
    /// Differences up to this are none.
    pub resolution: f64,
    /// Weight.
    pub weight: f64,
    /// Value of utility 0.
    pub worst: f64,
    /// Value of utility 0.5.
    pub half: f64,
    /// Value of utility 1: what is better still counts no more.
    pub best: f64,
    /// Whether it decides on the Pareto set.
    pub in_pareto_set: bool,
    /// Configurations that work and for which it was not measured: then it counts for none.
    pub not_measured_for: Vec<String>,
}

/// A change of one weight that changes the first choice.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WeightChange {
    /// The metric.
    pub metric: &'static str,
    /// Its weight.
    pub weight: f64,
    /// Weight at which the two are even.
    pub even_at: f64,
    /// The first choice beyond that.
    pub then_first: String,
}

/// A metric that counts, with the values of all configurations that work.
struct Column {
    metric: &'static Metric,
    aim: Aim,
    /// As measured.
    values: Vec<f64>,
    /// Best of the tied ones.
    counted_as: Vec<f64>,
    levels: Vec<usize>,
}

/// Marks the Pareto set of a goal, ranks its configurations and recommends the first.
///
/// Takes the statuses as they are: only what is `ok` is compared.
pub fn rank_goal(goal: &mut GoalReport, ranking: &RankingSection) {
    for each in &mut goal.configurations {
        each.pareto = false;
        each.dominated_by = None;
        each.ranking = None;
    }
    let working: Vec<usize> = (0..goal.configurations.len())
        .filter(|&index| goal.configurations[index].status == Status::Ok)
        .collect();
    let label = |at: usize| goal.configurations[working[at]].label;
    let (metrics, columns) = columns(&goal.configurations, &working, ranking);

    let candidates: Vec<Vec<usize>> = (0..working.len())
        .map(|at| {
            let decide = columns.iter().filter(|each| each.metric.in_pareto_set);
            decide.map(|column| column.levels[at]).collect()
        })
        .collect();
    let members = pareto_set(&candidates);
    let scored = scores(&columns, working.len());
    let mut order: Vec<usize> = (0..working.len()).collect();
    if let Some(scored) = &scored {
        // Stable: even scores stay in the order of the report.
        order.sort_by(|&a, &b| scored[b].score.total_cmp(&scored[a].score));
    }

    let dominance: Vec<Option<Dominance>> = (0..working.len())
        .map(|at| {
            let mut better = order
                .iter()
                .filter(|&&other| members[other] && dominates(&candidates[other], &candidates[at]));
            better.next().map(|&other| Dominance {
                label: label(other).to_owned(),
                better_in: columns
                    .iter()
                    .filter(|column| column.metric.in_pareto_set)
                    .filter(|column| column.levels[other] < column.levels[at])
                    .map(|column| column.metric.name)
                    .collect(),
            })
        })
        .collect();
    let change =
        smallest_weight_change(&columns, &order).map(|(column, even_at, other)| WeightChange {
            metric: columns[column].metric.name,
            weight: columns[column].aim.weight,
            even_at,
            then_first: label(other).to_owned(),
        });
    let summary = GoalRanking {
        order: order.iter().map(|&at| label(at).to_owned()).collect(),
        pareto_set: (0..working.len())
            .filter(|&at| members[at])
            .map(|at| label(at).to_owned())
            .collect(),
        metrics,
        runner_up: order.get(1).map(|&at| label(at).to_owned()),
        smallest_weight_change: change,
    };

    for (at, (index, dominance)) in working.iter().zip(dominance).enumerate() {
        let configuration = &mut goal.configurations[*index];
        configuration.pareto = members[at];
        configuration.dominated_by = dominance;
        configuration.ranking = scored.as_ref().map(|scored| {
            let rank = order.iter().position(|&other| other == at);
            RankingReport {
                rank: 1 + rank.expect("the order holds all that work"),
                ..scored[at].clone()
            }
        });
    }
    goal.recommended = order.first().map(|&first| {
        let at = |position: usize| order.get(position).map(|&at| working[at]);
        Recommendation {
            label: goal.configurations[working[first]].label.to_owned(),
            reason: reason(
                &goal.configurations[working[first]],
                at(1).map(|index| &goal.configurations[index]),
                &summary,
            ),
        }
    });
    goal.ranking = Some(summary);
}

/// The metrics that can be ranked by, and the columns of those that every configuration has.
fn columns(
    configurations: &[ConfigurationReport],
    working: &[usize],
    ranking: &RankingSection,
) -> (Vec<RankedMetric>, Vec<Column>) {
    let json: Vec<serde_json::Value> = working
        .iter()
        .map(|&index| ConfigurationFacts::json(&configurations[index]))
        .collect();
    let aims = ranking.aims();
    let mut described = Vec::new();
    let mut columns = Vec::new();
    for metric in METRICS {
        let Some((key, scale)) = metric.ranking_key else {
            continue;
        };
        let aim = aims.iter().find(|(name, _)| *name == key);
        let aim = aim.expect("every metric's key exists").1.scaled(scale);
        let measured: Vec<Option<f64>> = json
            .iter()
            .map(|each| metric.read(ConfigurationFacts::new(each)))
            .collect();
        let missing = measured.iter().zip(working).filter(|(v, _)| v.is_none());
        described.push(RankedMetric {
            name: metric.name,
            unit: metric.quantity.unit(),
            better: match metric.better {
                Better::More => "more",
                Better::Less => "less",
            },
            resolution: metric.resolution,
            weight: aim.weight,
            worst: aim.worst,
            half: aim.half,
            best: aim.best,
            in_pareto_set: metric.in_pareto_set,
            not_measured_for: missing
                .map(|(_, &index)| configurations[index].label.to_owned())
                .collect(),
        });
        if let Some(values) = measured.into_iter().collect::<Option<Vec<f64>>>() {
            columns.push(column(metric, aim, values));
        }
    }
    (described, columns)
}

fn column(metric: &'static Metric, aim: Aim, values: Vec<f64>) -> Column {
    let more = metric.better == Better::More;
    // What is better than the best anchor counts no more, here as in the utility.
    let enough: Vec<f64> = values
        .iter()
        .map(|&value| {
            if more {
                value.min(aim.best)
            } else {
                value.max(aim.best)
            }
        })
        .collect();
    let levels = levels(&enough, metric.resolution, more);
    let best_of = |level: usize| {
        let tied = enough.iter().zip(&levels).filter(|(_, of)| **of == level);
        let pick = if more { f64::max } else { f64::min };
        tied.map(|(value, _)| *value).reduce(pick)
    };
    let counted_as = levels
        .iter()
        .map(|&level| best_of(level).expect("a level has its value"))
        .collect();
    Column {
        metric,
        aim,
        values,
        counted_as,
        levels,
    }
}

impl Column {
    fn utility(&self, at: usize) -> f64 {
        self.aim.utility(self.counted_as[at])
    }
}

/// Scores in the order of the columns' values; none if nothing that has a weight was measured.
fn scores(columns: &[Column], count: usize) -> Option<Vec<RankingReport>> {
    let total: f64 = columns.iter().map(|column| column.aim.weight).sum();
    if total <= 0.0 {
        return None;
    }
    let report = |at: usize| {
        let terms: Vec<Term> = columns
            .iter()
            .map(|column| Term {
                metric: column.metric.name,
                value: column.values[at],
                counted_as: column.counted_as[at],
                unit: column.metric.quantity.unit(),
                utility: column.utility(at),
                weight: column.aim.weight,
                contribution: column.aim.weight / total * column.utility(at),
            })
            .collect();
        RankingReport {
            rank: 0, // known when all are scored
            score: terms.iter().map(|term| term.contribution).sum(),
            terms,
        }
    };
    Some((0..count).map(report).collect())
}

/// Weights this much smaller than they were are 0.
const ROUNDING: f64 = 1e-9;

/// The change of one weight, smallest in size, at which the first of the order is no longer ahead:
/// its column, the new weight, and the configuration that is then even.
///
/// With `d_k` the lead of the first over another in utility of metric `k`, their scores are even
/// when `sum_k w_k d_k = 0`. That is linear in each weight, so every crossing is found.
fn smallest_weight_change(columns: &[Column], order: &[usize]) -> Option<(usize, f64, usize)> {
    let (&first, others) = order.split_first()?;
    let mut smallest: Option<(f64, usize, f64, usize)> = None;
    for &other in others {
        let leads: Vec<f64> = columns
            .iter()
            .map(|column| column.utility(first) - column.utility(other))
            .collect();
        let ahead: f64 = columns
            .iter()
            .zip(&leads)
            .map(|(c, d)| c.aim.weight * d)
            .sum();
        for (index, lead) in leads.iter().enumerate().filter(|(_, lead)| **lead != 0.0) {
            let weight = columns[index].aim.weight;
            let change = -ahead.max(0.0) / lead;
            // Even at weight 0 means ahead at every weight: below 0 worse would count as better.
            let possible = change >= 0.0 || weight + change > ROUNDING * weight;
            let smaller = smallest.is_none_or(|(known, ..)| change.abs() < known);
            if possible && smaller {
                smallest = Some((change.abs(), index, weight + change, other));
            }
        }
    }
    smallest.map(|(_, index, even_at, other)| (index, even_at, other))
}
