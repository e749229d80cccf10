//! Optimisation of a study's control factors.
//!
//! A *candidate* is a value of each control factor (`role = "control"`); a *circumstance* is a sampled point of the
//! noise factors, goals included, the same one for all candidates (common random points), so that the common effect
//! of a difficult layout cancels in their differences. A [`Judge`] evaluates the cases, generation by generation; this
//! module knows neither robots nor files, and its requests depend on the seed and the answers alone.
//!
//! - Finite control factors: successive halving (Karnin, Koren and Somekh, ICML 2013), with twice the circumstances in
//!   each round; candidates significantly worse than the best are eliminated at once, and the last round gives the tied
//!   ones.
//! - Control factors with ranges: screening of points spread over them, then [`CmaEs`] from the best of those, separate
//!   for each combination of the finite ones, the worse half of which is dropped as the budget is used; the best
//!   distinct candidates are raced as finite ones are.
//! - Two objectives: finite control factors, or points spread over ranges, halved by layers of the Pareto front.
//!
//! The winner is evaluated again on held-out circumstances, because the best of many candidates is optimistically
//! biased. These are independent points, and confidence intervals are from them alone.

mod choices;
mod cma;
mod finite;
mod log;
mod objective;
mod pareto;
mod pool;
mod race;
mod ranges;
mod space;
#[cfg(test)]
mod tests;

pub use choices::{Candidate, ChoiceAxis, Choices};
pub use cma::CmaEs;
pub use log::{
    Answer, CandidateLog, CandidateStanding, Decision, FrontMember, GenerationLog, Purpose,
    SearchLog,
};
pub use objective::{CaseWorth, Ends, Estimate, Objective};
pub use space::{GenerationDesign, SearchSpace, SpaceError};

use pool::Pool;

/// Most candidates of the last round, unless more were requested.
const FINALISTS: usize = 8;

/// Probability that the best differs significantly from the winner, over all rounds.
const ALPHA: f64 = 0.05;

/// Fewest circumstances of the first round of halving.
const FEWEST: u64 = 8;

/// Objective and cost of a search.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchPlan {
    /// What candidates are compared by.
    pub objective: Objective,
    /// A second objective, for a Pareto front.
    pub second: Option<Objective>,
    /// Circumstances of the last round.
    pub samples: u64,
    /// Held-out circumstances that the winner is evaluated on.
    pub fresh: u64,
    /// Most cases.
    pub budget: u64,
    /// Seed of the search's own random numbers.
    pub seed: u64,
}

impl SearchPlan {
    /// Whether the budget is large enough for such control factors.
    ///
    /// # Errors
    /// [`SearchError::Budget`] with the least sufficient budget, or too many combinations.
    pub fn check<S>(&self, choices: &Choices) -> Result<(), SearchError<S>> {
        if self.second.is_some() {
            pareto::check(self, choices)
        } else if choices.dimensions() > 0 {
            ranges::check(self, choices)
        } else {
            finite::check(self, choices)
        }
    }
}

/// Which circumstances.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stream {
    /// Those that candidates are compared by.
    Common,
    /// Held-out ones.
    Fresh,
}

/// Requested cases: each of some candidates under each of some circumstances.
#[derive(Debug, Clone, PartialEq)]
pub struct Generation {
    /// Its number, from 0.
    pub number: u32,
    /// What for.
    pub purpose: Purpose,
    /// Which circumstances.
    pub stream: Stream,
    /// Number of the first circumstance.
    pub first: u64,
    /// How many of them.
    pub count: u64,
    /// Numbers of the candidates in the log.
    pub ids: Vec<usize>,
    /// The candidates.
    pub candidates: Vec<Candidate>,
}

impl Generation {
    /// Number of its cases.
    pub fn cases(&self) -> u64 {
        self.count * self.candidates.len() as u64
    }
}

/// Evaluates cases, by candidate, then circumstance; the outcome may depend on nothing else.
pub trait Judge {
    /// Why the search stops.
    type Stop;

    /// Cases that are out of reach of every configuration, which is cheap to find: an upper bound of their margin, mm;
    /// they are infeasible. None for all others.
    ///
    /// # Errors
    /// Why the search stops.
    fn out_of_reach(
        &mut self,
        generation: &Generation,
    ) -> Result<Vec<Vec<Option<f64>>>, Self::Stop>;

    /// The outcomes of the cases.
    ///
    /// # Errors
    /// Why the search stops.
    fn judge(&mut self, generation: &Generation) -> Result<Vec<Vec<CaseWorth>>, Self::Stop>;

    /// What a candidate is, by the names of its factors.
    fn describe(&self, candidate: &[crate::FactorValue]) -> Vec<(String, serde_json::Value)>;

    /// Called after each generation.
    ///
    /// # Errors
    /// Why the search stops.
    fn note(&mut self, _log: &SearchLog) -> Result<(), Self::Stop> {
        Ok(())
    }
}

/// Why there is no answer.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SearchError<S> {
    /// The budget is too small.
    #[error("a budget of {budget} cases is too small: {what} require at least {least}")]
    Budget {
        /// The given budget.
        budget: u64,
        /// The required budget.
        least: u64,
        /// What requires it.
        what: String,
    },
    /// Too many combinations of finite control factors with ranges.
    #[error(
        "{combinations} combinations of finite control factors with ranges; the limit is {most}"
    )]
    Combinations {
        /// How many.
        combinations: usize,
        /// The limit.
        most: usize,
    },
    /// The evaluator stopped.
    #[error("stopped")]
    Stopped(S),
}

/// Looks for the best candidate; the log has the answer.
///
/// # Errors
/// [`SearchError`].
pub fn search<J: Judge>(
    plan: &SearchPlan,
    choices: &Choices,
    judge: &mut J,
) -> Result<SearchLog, SearchError<J::Stop>> {
    let mut pool = Pool::new(plan, judge);
    let has_ranges = choices.dimensions() > 0;
    if plan.second.is_some() {
        pareto::search(&mut pool, choices)?;
    } else {
        let found = if has_ranges {
            ranges::search(&mut pool, choices)?
        } else {
            finite::search(&mut pool, choices)?
        };
        pool.judge_anew(&found.ranked[..1])?;
        pool.answer(found);
    }
    pool.finish()
}
