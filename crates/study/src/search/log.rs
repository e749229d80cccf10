//! What a search has done, and its answer.

use serde::{Deserialize, Serialize};

use super::Stream;
use super::objective::{Estimate, Objective};

/// What a generation is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Purpose {
    /// A first look at points spread over ranges.
    Screening,
    /// Points of an evolution strategy.
    Evolution,
    /// A round of halving.
    Halving,
    /// The last candidates, with all circumstances.
    Final,
    /// The winner, on circumstances that nothing was compared by.
    Fresh,
}

/// A candidate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CandidateLog {
    /// Its number.
    pub id: usize,
    /// Its choices, by the names of factors.
    pub choice: Vec<(String, serde_json::Value)>,
    /// Common circumstances that it was judged under.
    pub cases: u64,
    /// Its figures under those, of the first objective and the second; intervals are no better than those of one who
    /// was not selected.
    pub figures: Vec<Estimate>,
    /// The share of its layouts that work.
    pub rate: Estimate,
}

/// A candidate in a generation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CandidateStanding {
    /// Its number.
    pub id: usize,
    /// Its figures by all circumstances up to those of the generation; none of what cannot exist.
    pub figures: Vec<Option<f64>>,
}

/// A generation, and what became of its candidates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GenerationLog {
    /// Its number.
    pub generation: u32,
    /// What for.
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

/// What was decided between generations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Decision {
    /// Number of generations before it.
    pub after: u32,
    /// What for.
    pub purpose: Purpose,
    /// Circumstances that it rests on.
    pub circumstances: u64,
    /// Who stays, the best first.
    pub kept: Vec<usize>,
    /// Who was told from the best.
    pub told_apart: Vec<usize>,
    /// Who was dropped by order alone: they may be as good.
    pub dropped: Vec<usize>,
    /// Who could not be among the kept ones by reach alone, and whose clearances were never asked for.
    pub ruled_out: Vec<usize>,
}

/// A candidate that is on the front, or may be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrontMember {
    /// Its number.
    pub id: usize,
    /// Whether it is on the front by its estimates.
    pub by_estimate: bool,
    /// Whether it is for certain: each other one is worse in an objective for certain. All pairs and both
    /// objectives together are wrong with a chance of at most 5 %.
    pub is_certain: bool,
    /// Figures on fresh circumstances; none of those that were not judged anew.
    pub fresh: Option<Vec<Estimate>>,
}

/// The answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// Number of the best candidate; of a front that which is best in the first objective.
    pub winner: usize,
    /// Its figures on circumstances that nothing was compared by: estimates and intervals of those alone.
    pub figures: Vec<Estimate>,
    /// The share of layouts that work, on the same.
    pub rate: Estimate,
    /// Its figures on those that it was selected by, which look better than they are.
    pub selected_by: Vec<Estimate>,
    /// Who cannot be told from it, of those that have all circumstances, the best first and the winner among them; empty
    /// with two objectives, which have a front.
    pub equals: Vec<usize>,
    /// Who was dropped with fewer circumstances and could not be told from the best of their round.
    pub undecided: Vec<usize>,
    /// The front of two objectives.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub front: Vec<FrontMember>,
}

impl Answer {
    /// Whether there is something to recommend: the best candidate works in some layout that nothing was compared by.
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
    /// Circumstances that the winner is judged on.
    pub fresh: u64,
    /// Most cases.
    pub budget: u64,
    /// Cases that were computed.
    pub cases: u64,
    /// Cases that were not computed, since reach alone had ruled their candidates out: in so many layouts no
    /// configuration comes to the needle. They count against the budget.
    pub cases_spared: u64,
    /// Candidates that reach alone ruled out, and that were not judged later after all.
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
