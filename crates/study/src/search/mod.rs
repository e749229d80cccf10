//! The best choice looked for instead of listed.
//!
//! A *candidate* is a value of each factor with `role = "choice"`; a *circumstance* is a sampled point of all
//! other factors, goals included, the same one for all candidates (common random points), so that what a
//! hard layout does to all of them drops out of their differences. What a case is worth is asked of a [`Judge`], generation by generation;
//! this module knows neither robots nor files, and what it asks depends on the seed and the answers alone.
//!
//! - Finite choices: successive halving (Karnin, Koren and Somekh, ICML 2013), with twice the circumstances in
//!   each round; whoever can be told from the best is dropped at once, and the last round says who cannot.
//! - Choices with ranges: a first look at points spread over them, then [`CmaEs`] from the best of those, on its own
//!   for each combination of the finite ones, of which the worse half is dropped as the budget goes; the best distinct candidates are raced as finite ones are.
//! - Two objectives: finite choices, or points spread over ranges, halved by layers of the Pareto front.
//!
//! The winner is judged again on circumstances that nothing was compared by: of many candidates the one that looks best
//! looks better than it is. Those are independent points, and intervals are of them alone.

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

/// Most candidates of the last round, unless more were asked for.
const FINALISTS: usize = 8;

/// Chance that the best is told from the winner, over all rounds.
const ALPHA: f64 = 0.05;

/// Circumstances of the first round of halving, at least.
const FEWEST: u64 = 8;

/// What is looked for, and at what cost.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchPlan {
    /// What candidates are compared by.
    pub objective: Objective,
    /// Another objective, of which the front is wanted.
    pub second: Option<Objective>,
    /// Circumstances of the last round.
    pub samples: u64,
    /// Circumstances that the winner is judged on.
    pub fresh: u64,
    /// Most cases.
    pub budget: u64,
    /// Seed of the draws of the search itself.
    pub seed: u64,
}

impl SearchPlan {
    /// Whether the budget is large enough for such choices.
    ///
    /// # Errors
    /// [`SearchError::Budget`] with the least that is, or too many combinations.
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
    /// Those that nothing was compared by.
    Fresh,
}

/// Cases that are wanted: each of some candidates under each of some circumstances.
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

/// What cases are worth. By candidate, then circumstance; it may depend on nothing else.
pub trait Judge {
    /// Why it does not go on.
    type Stop;

    /// Which cases no configuration comes to the needle in, which is cheap to find: the most that their margin
    /// can be, mm; nothing works in them. None of all others.
    ///
    /// # Errors
    /// Why it does not go on.
    fn out_of_reach(
        &mut self,
        generation: &Generation,
    ) -> Result<Vec<Vec<Option<f64>>>, Self::Stop>;

    /// What the cases are worth.
    ///
    /// # Errors
    /// Why it does not go on.
    fn judge(&mut self, generation: &Generation) -> Result<Vec<Vec<CaseWorth>>, Self::Stop>;

    /// What a candidate is, by the names of its factors.
    fn describe(&self, candidate: &[crate::FactorValue]) -> Vec<(String, serde_json::Value)>;

    /// Called after each generation.
    ///
    /// # Errors
    /// Why it does not go on.
    fn note(&mut self, _log: &SearchLog) -> Result<(), Self::Stop> {
        Ok(())
    }
}

/// Why there is no answer.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SearchError<S> {
    /// Too few cases for any.
    #[error("a budget of {budget} cases is too small: {least} are the least for {what}")]
    Budget {
        /// What was given.
        budget: u64,
        /// What is needed.
        least: u64,
        /// For what.
        what: String,
    },
    /// Too many combinations of finite choices beside ranges.
    #[error(
        "{combinations} combinations of finite choices beside ranges; at most {most} are looked at"
    )]
    Combinations {
        /// How many.
        combinations: usize,
        /// How many may be.
        most: usize,
    },
    /// The judge does not go on.
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
