//! Ranking of the configurations of a goal, with every term of it.
//!
//! The score of a configuration is the weighted mean of its utilities,
//! `sum_k w_k u_k / sum_k w_k`, over the metrics that were measured for *every* feasible
//! configuration: a metric that one of them lacks would compare different sums. Utilities are those of the
//! values as measured. Scores that differ by no more than [`SAME_SCORE`] are even, and the first in the
//! report's order comes first: noise far below every resolution decides nothing. The Pareto set compares
//! values two by two, each with its resolution ([`crate::pareto`]); a configuration that is beaten there
//! may score above the one that beats it by what differences below the resolutions add up to.

use std::cmp::Ordering;

use needlebench_scenario::ranking::{Aim, RankingSection};

use crate::metric::{Better, Bound, Metric, metrics};
use crate::pareto::{Scale, dominates, pareto_set};
pub use crate::ranking_report::{
    Dominance, GoalRanking, RankedMetric, RankingReport, SAME_SCORE, Term, WeightChange,
};
use crate::reason::{one_sentence, reason};
use crate::report::{ConfigurationReport, GoalReport, Recommendation, Status};

/// A metric that counts, with the values of all feasible configurations.
struct Column {
    metric: &'static Metric,
    aim: Aim,
    scale: Scale,
    /// As measured.
    values: Vec<f64>,
}

/// Marks the Pareto set of a goal, ranks its configurations and recommends the first.
///
/// Takes the statuses as they are: only what is `ok` is compared, and of that only what the unseen body behind the cuts of
/// a scan cannot be nearer to.
pub fn rank_goal(goal: &mut GoalReport, ranking: &RankingSection) {
    for each in &mut goal.configurations {
        each.pareto = false;
        each.dominated_by = None;
        each.ranking = None;
    }
    let working: Vec<usize> = (0..goal.configurations.len())
        .filter(|&index| {
            let each = &goal.configurations[index];
            each.status == Status::Ok && each.unknown_clearances().is_empty()
        })
        .collect();
    let label = |at: usize| goal.configurations[working[at]].label;
    let (metrics, columns) = columns(&goal.configurations, &working, ranking);

    let deciding: Vec<&Column> = columns
        .iter()
        .filter(|each| each.metric.in_pareto_set)
        .collect();
    let scales: Vec<Scale> = deciding.iter().map(|column| column.scale).collect();
    let candidates: Vec<Vec<f64>> = (0..working.len())
        .map(|at| deciding.iter().map(|column| column.values[at]).collect())
        .collect();
    let members = pareto_set(&candidates, &scales);
    let scored = scores(&columns, working.len());
    let order = match &scored {
        Some(scored) => best_first(scored),
        None => (0..working.len()).collect(),
    };

    let dominance: Vec<Option<Dominance>> = (0..working.len())
        .map(|at| {
            let beats = |&&other: &&usize| dominates(&candidates[other], &candidates[at], &scales);
            let beaten = order.iter().filter(|_| !members[at]);
            // A member, if one does.
            let better = beaten.clone().filter(|&&other| members[other]).find(beats);
            better
                .or_else(|| beaten.clone().find(beats))
                .map(|&other| Dominance {
                    label: label(other).to_owned(),
                    better_in: deciding
                        .iter()
                        .filter(|column| column.is_better(other, at))
                        .map(|column| column.metric.key)
                        .collect(),
                })
        })
        .collect();
    let change =
        smallest_weight_change(&columns, &order).map(|(column, even_at, other)| WeightChange {
            metric: columns[column].metric.key,
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
        not_told_apart: match &scored {
            Some(scored) => not_told_apart(&columns, scored, &order)
                .into_iter()
                .map(|at| label(at).to_owned())
                .collect(),
            None => Vec::new(),
        },
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
                rank: 1 + rank.expect("the order holds all feasible ones"),
                ..scored[at].clone()
            }
        });
    }
    goal.recommended = order.first().map(|&first| {
        let at = |position: usize| order.get(position).map(|&at| working[at]);
        let chosen = &goal.configurations[working[first]];
        let next = at(1).map(|index| &goal.configurations[index]);
        let all: Vec<&ConfigurationReport> = working
            .iter()
            .map(|&index| &goal.configurations[index])
            .collect();
        Recommendation {
            label: chosen.label.to_owned(),
            summary: one_sentence(chosen, next, &all, &summary),
            reason: reason(chosen, next, &all, &summary),
        }
    });
    goal.ranking = Some(summary);
}

/// The metrics that can be ranked by, one for each key of the scenario's `[ranking]`, and the columns of
/// those that every configuration has.
///
/// Of several metrics with one key the last counts that any configuration has: the tip error over the arm and patient
/// population where there is a budget, a certified clearance where there is one. Where none has, the proven or the
/// first one is named.
fn columns(
    configurations: &[ConfigurationReport],
    working: &[usize],
    ranking: &RankingSection,
) -> (Vec<RankedMetric>, Vec<Column>) {
    let mut described = Vec::new();
    let mut columns = Vec::new();
    for (key, aim) in ranking.aims() {
        let values = |metric: &Metric| -> Vec<Option<f64>> {
            let working = working.iter();
            working
                .map(|&index| metric.read(&configurations[index]))
                .collect()
        };
        let of_key = || metrics().filter(|metric| metric.ranking_key == Some(key));
        let is_measured = |metric: &&Metric| values(metric).iter().any(Option::is_some);
        let is_proven = |metric: &&Metric| metric.bound == Bound::Certified;
        let found = of_key().rev().find(is_measured);
        let metric = found
            .or_else(|| of_key().find(is_proven))
            .or_else(|| of_key().next())
            .expect("every key has a metric");
        let measured = values(metric);
        let aim = aim.scaled(metric.unit.si);
        let missing = measured.iter().zip(working).filter(|(v, _)| v.is_none());
        described.push(RankedMetric {
            name: metric.key,
            unit: metric.quantity.unit(),
            better: if metric.better == Some(Better::More) {
                "more"
            } else {
                "less"
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
    Column {
        metric,
        aim,
        scale: Scale {
            resolution: metric.resolution,
            more_is_better: metric.better == Some(Better::More),
        },
        values,
    }
}

impl Column {
    fn utility(&self, at: usize) -> f64 {
        self.aim.utility(self.values[at])
    }

    /// What is better than the best anchor counts no more.
    fn counted_as(&self, at: usize) -> f64 {
        let value = self.values[at];
        if self.scale.more_is_better {
            value.min(self.aim.best)
        } else {
            value.max(self.aim.best)
        }
    }

    fn is_better(&self, a: usize, b: usize) -> bool {
        self.scale.compare(self.values[a], self.values[b]) == Ordering::Greater
    }
}

/// Indices by score, best first; of scores that are even with the best that is left, the first in the
/// report's order is next.
fn best_first(scored: &[RankingReport]) -> Vec<usize> {
    let mut left: Vec<usize> = (0..scored.len()).collect();
    let mut order = Vec::with_capacity(left.len());
    while !left.is_empty() {
        let scores = left.iter().map(|&at| scored[at].score);
        let best = scores.fold(f64::NEG_INFINITY, f64::max);
        let next = left
            .iter()
            .position(|&at| scored[at].score >= best - SAME_SCORE);
        order.push(left.remove(next.unwrap_or(0)));
    }
    order
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
                metric: column.metric.key,
                value: column.values[at],
                counted_as: column.counted_as(at),
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

/// Those after the first of the order whose score the resolutions of the first's metrics reach.
///
/// A value that differs by its resolution is the same value, so a score is known to
/// `sum_k w_k max(|u_k(v_k - r_k) - u_k|, |u_k(v_k + r_k) - u_k|) / sum_k w_k` and no better.
fn not_told_apart(columns: &[Column], scored: &[RankingReport], order: &[usize]) -> Vec<usize> {
    let Some((&first, others)) = order.split_first() else {
        return Vec::new();
    };
    let total: f64 = columns.iter().map(|column| column.aim.weight).sum();
    let reach: f64 = columns
        .iter()
        .map(|column| {
            let value = column.values[first];
            let step = column.scale.resolution;
            let moved = |value: f64| (column.aim.utility(value) - column.utility(first)).abs();
            column.aim.weight / total * moved(value - step).max(moved(value + step))
        })
        .sum();
    let is_reached = |at: &usize| scored[first].score - scored[*at].score <= reach;
    others.iter().copied().filter(is_reached).collect()
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
