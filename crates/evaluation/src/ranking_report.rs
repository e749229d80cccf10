//! What a ranking says, as values of the report.

use serde::Serialize;

/// Scores nearer than this are even: far above the rounding of values, and far below what one
/// resolution of any metric changes.
pub const SAME_SCORE: f64 = 1e-9;

/// Score of a feasible configuration.
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
    /// The value, or the best anchor where it is better still.
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

/// A configuration that is worse in no metric of the Pareto set and better in some, each beyond the
/// metric's resolution.
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
    /// Feasible configurations, first choice first.
    pub order: Vec<String>,
    /// Those that no other one beats, in the order of the report.
    pub pareto_set: Vec<String>,
    /// The metrics and how each counts.
    pub metrics: Vec<RankedMetric>,
    /// Configurations whose scores are below the first's by no more than the resolutions of its metrics add up to: what
    /// they lack decides nothing.
    pub not_told_apart: Vec<String>,
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
    /// Feasible configurations for which it was not measured: then it counts for none.
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
