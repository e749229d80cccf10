//! The log of a search, and its answer.

use serde::{Deserialize, Serialize};

use super::Stream;
use super::objective::{Estimate, Objective};

/// The purpose of a generation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Purpose {
    /// Screening of points spread over ranges.
    Screening,
    /// Points of an evolution strategy.
    Evolution,
    /// A round of halving.
    Halving,
    /// The last candidates, with all circumstances.
    Final,
    /// The winner, on held-out circumstances.
    Fresh,
}

/// A candidate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CandidateLog {
    /// Its number.
    pub id: usize,
    /// Its values of the control factors, by name.
    pub choice: Vec<(String, serde_json::Value)>,
    /// Number of common circumstances that it was evaluated under.
    pub cases: u64,
    /// Its estimates under those, of the first objective and the second; intervals do not account for the selection.
    pub figures: Vec<Estimate>,
    /// Its success rate.
    pub rate: Estimate,
}

/// A candidate in a generation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CandidateStanding {
    /// Its number.
    pub id: usize,
    /// Its estimates by all circumstances up to those of the generation; none where invalid layouts decide them.
    pub figures: Vec<Option<f64>>,
}

/// A generation with its candidates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GenerationLog {
    /// Its number.
    pub generation: u32,
    /// Its purpose.
    pub purpose: Purpose,
    /// Which circumstances.
    pub stream: Stream,
    /// The first circumstance, and the one after the last.
    pub circumstances: [u64; 2],
    /// Number of cases.
    pub cases: u64,
    /// Its candidates.
    pub candidates: Vec<CandidateStanding>,
}

/// A decision between generations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Decision {
    /// Number of generations before it.
    pub after: u32,
    /// Its purpose.
    pub purpose: Purpose,
    /// Number of circumstances that it is based on.
    pub circumstances: u64,
    /// Candidates that stay, the best first.
    pub kept: Vec<usize>,
    /// Candidates significantly worse than the best.
    pub told_apart: Vec<usize>,
    /// Candidates eliminated by order alone: they may be equivalent.
    pub dropped: Vec<usize>,
    /// Candidates eliminated by reachability alone, whose clearances were not computed.
    pub ruled_out: Vec<usize>,
}

/// A candidate that is Pareto-optimal, or may be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrontMember {
    /// Its number.
    pub id: usize,
    /// Whether it is Pareto-optimal by its estimates.
    pub by_estimate: bool,
    /// Whether it is significantly so: each other one is significantly worse in an objective. Family-wise error rate
    /// 5 % over all pairs and both objectives.
    pub is_certain: bool,
    /// Estimates on held-out circumstances; none of candidates that were not re-evaluated.
    pub fresh: Option<Vec<Estimate>>,
}

/// The answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// Number of the best candidate; of a front the one that is best in the first objective.
    pub winner: usize,
    /// Its estimates with confidence intervals, from the held-out circumstances alone.
    pub figures: Vec<Estimate>,
    /// Its success rate, on the same.
    pub rate: Estimate,
    /// Its estimates on the circumstances that it was selected by, optimistically biased.
    pub selected_by: Vec<Estimate>,
    /// Finalists not significantly different from it, the best first, with the winner among them; empty with two
    /// objectives, which have a front.
    pub equals: Vec<usize>,
    /// Candidates eliminated earlier that were not significantly different from the best of their round.
    pub undecided: Vec<usize>,
    /// The front of two objectives.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub front: Vec<FrontMember>,
}

impl Answer {
    /// Whether there is a recommendation: the best candidate is feasible in some held-out layout.
    pub fn is_recommended(&self) -> bool {
        self.rate.value.is_some_and(|rate| rate > 0.0)
    }
}

/// All of a search.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SearchLog {
    /// What candidates are compared by.
    pub objectives: Vec<Objective>,
    /// Circumstances of the last candidates.
    pub samples: u64,
    /// Held-out circumstances that the winner is evaluated on.
    pub fresh: u64,
    /// Most cases.
    pub budget: u64,
    /// Cases that were computed.
    pub cases: u64,
    /// Cases that were not computed, because reachability alone eliminated their candidates. They count against the
    /// budget.
    pub cases_spared: u64,
    /// Candidates eliminated by reachability alone and not evaluated later.
    pub ruled_out: usize,
    /// The candidates.
    pub candidates: Vec<CandidateLog>,
    /// The generations.
    pub generations: Vec<GenerationLog>,
    /// Decisions between them.
    pub decisions: Vec<Decision>,
    /// The answer; none before the end.
    pub answer: Option<Answer>,
}
