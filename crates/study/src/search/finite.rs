//! Finite control factors: halving, and racing.

use super::log::{Decision, Purpose};
use super::pool::{Found, Pool};
use super::{ALPHA, Choices, FEWEST, FINALISTS, Judge, SearchError, SearchPlan};

/// Most candidates that are listed.
const MOST_CANDIDATES: usize = 100_000;

/// So many candidates are evaluated under so many circumstances.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Round {
    pub circumstances: u64,
    /// How many stay.
    pub keep: usize,
}

impl Round {
    /// The last one has all circumstances.
    pub fn purpose(self, plan: &SearchPlan) -> Purpose {
        if self.circumstances == plan.samples {
            Purpose::Final
        } else {
            Purpose::Halving
        }
    }
}

/// Rounds of halving from so many circumstances on, and their cases at most.
pub(super) fn rounds(
    candidates: usize,
    first: u64,
    samples: u64,
    finalists: usize,
) -> (Vec<Round>, u64) {
    let (mut alive, mut before, mut now) = (candidates, 0, first.min(samples));
    let (mut rounds, mut cost) = (Vec::new(), 0_u64);
    loop {
        cost = cost.saturating_add((now - before).saturating_mul(alive as u64));
        let keep = if now == samples {
            alive
        } else {
            alive.div_ceil(2).max(finalists.min(alive))
        };
        rounds.push(Round {
            circumstances: now,
            keep,
        });
        if now == samples {
            return (rounds, cost);
        }
        alive = keep;
        before = now;
        now = (2 * now).min(samples);
    }
}

/// The rounds with as many circumstances from the beginning as the budget has room for: powers of two, of
/// which points are even.
pub(super) fn affordable(
    candidates: usize,
    plan: &SearchPlan,
    finalists: usize,
    reserved: u64,
) -> Result<Vec<Round>, u64> {
    let least = rounds(candidates, FEWEST, plan.samples, finalists).1 + reserved;
    let mut first = plan.samples;
    loop {
        let (found, cost) = rounds(candidates, first, plan.samples, finalists);
        if cost.saturating_add(reserved) <= plan.budget {
            return Ok(found);
        }
        if first <= FEWEST {
            return Err(least);
        }
        first = ((first - 1).next_power_of_two() / 2).max(FEWEST);
    }
}

pub(super) fn search<J: Judge>(
    pool: &mut Pool<'_, J>,
    choices: &Choices,
) -> Result<Found, SearchError<J::Stop>> {
    let count = listed(choices)?;
    let rounds = planned_for(pool.plan, count)?;
    let all: Vec<usize> = (0..count)
        .map(|combination| pool.add(choices.candidate(combination, &[])))
        .collect();
    race(pool, all, &rounds)
}

pub(super) fn check<S>(plan: &SearchPlan, choices: &Choices) -> Result<(), SearchError<S>> {
    planned_for(plan, listed(choices)?).map(|_| ())
}

fn planned_for<S>(plan: &SearchPlan, count: usize) -> Result<Vec<Round>, SearchError<S>> {
    planned(
        count,
        plan,
        FINALISTS,
        plan.fresh,
        format!("{count} candidates"),
    )
}

/// [`affordable`] rounds, or an error that the budget is too small.
pub(super) fn planned<S>(
    candidates: usize,
    plan: &SearchPlan,
    finalists: usize,
    reserved: u64,
    what: String,
) -> Result<Vec<Round>, SearchError<S>> {
    affordable(candidates, plan, finalists, reserved).map_err(|least| SearchError::Budget {
        budget: plan.budget,
        least,
        what,
    })
}

/// Number of candidates of finite control factors.
pub(super) fn listed<S>(choices: &Choices) -> Result<usize, SearchError<S>> {
    let combinations = choices.combinations().unwrap_or(usize::MAX);
    if combinations > MOST_CANDIDATES {
        return Err(SearchError::Combinations {
            combinations,
            most: MOST_CANDIDATES,
        });
    }
    Ok(combinations)
}

/// Rounds of halving; candidates significantly worse than the best are eliminated at once.
pub(super) fn race<J: Judge>(
    pool: &mut Pool<'_, J>,
    mut alive: Vec<usize>,
    rounds: &[Round],
) -> Result<Found, SearchError<J::Stop>> {
    // Bonferroni over the looks, which are few.
    let alpha = ALPHA / rounds.len() as f64;
    let mut undecided = Vec::new();
    for round in rounds {
        let purpose = round.purpose(pool.plan);
        let is_last = purpose == Purpose::Final;
        let circumstances = round.circumstances;
        let keep = if is_last { 1 } else { round.keep };
        let best = pool.best(&alive, circumstances, keep, purpose)?;
        let equals = pool.equals(&best.ranked, circumstances, alpha);
        let mut decision = Decision {
            after: 0,
            purpose,
            circumstances,
            kept: Vec::new(),
            told_apart: Vec::new(),
            dropped: Vec::new(),
            ruled_out: best.ruled_out,
        };
        for (place, &id) in best.ranked.iter().enumerate() {
            // Nothing is said of those that were too many to be compared: they are no equals at the end.
            let equal = equals.get(place).copied();
            if equal == Some(false) {
                decision.told_apart.push(id);
            } else if place < round.keep && (equal.is_some() || !is_last) {
                decision.kept.push(id);
            } else {
                decision.dropped.push(id);
            }
        }
        undecided.extend(decision.dropped.iter().copied());
        alive.clone_from(&decision.kept);
        pool.decide(decision);
        if is_last {
            return Ok(Found {
                ranked: best.ranked,
                equals: alive,
                undecided,
            });
        }
    }
    unreachable!("there is a last round")
}

#[cfg(test)]
mod tests {
    use super::super::Objective;
    use super::*;

    fn plan(samples: u64, budget: u64) -> SearchPlan {
        SearchPlan {
            objective: Objective::Rate,
            second: None,
            samples,
            fresh: 0,
            budget,
            seed: 0,
        }
    }

    #[test]
    fn a_third_of_the_grid_is_enough_for_halving() {
        let grid = 105 * 64;
        let rounds = affordable(105, &plan(64, grid / 3), FINALISTS, 0).unwrap();
        let expected = [(8, 53), (16, 27), (32, 14), (64, 14)];
        let expected = expected.map(|(circumstances, keep)| Round {
            circumstances,
            keep,
        });
        assert_eq!(rounds, expected);
    }

    #[test]
    fn a_large_budget_judges_all_with_everything() {
        let rounds = affordable(5, &plan(64, 320), FINALISTS, 0).unwrap();
        assert_eq!(rounds.len(), 1);
        assert_eq!(affordable(5, &plan(64, 319), 4, 0).unwrap().len(), 2);
    }

    #[test]
    fn too_small_a_budget_says_the_least() {
        let least = affordable(105, &plan(64, 100), FINALISTS, 256).unwrap_err();
        assert_eq!(
            affordable(105, &plan(64, least - 1), FINALISTS, 256),
            Err(least)
        );
        assert!(affordable(105, &plan(64, least), FINALISTS, 256).is_ok());
    }
}
