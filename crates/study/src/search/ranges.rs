//! Control factors with ranges: screening, evolution strategies, and a race of the best.

use super::finite::{Round, race};
use super::log::{Decision, Purpose};
use super::pool::{Found, Pool};
use super::{Choices, CmaEs, FINALISTS, Judge, SearchError, SearchPlan};
use needlebench_numerics::random::SplitMix64;
use needlebench_numerics::sobol::SobolDimension;

/// Most combinations of finite control factors that have an evolution strategy each.
const MOST_COMBINATIONS: usize = 16;
/// Points of the first look, of all combinations together, and of each at least.
const SCREENED: usize = 32;
const LEAST_SCREENED: usize = 8;
/// First deviation of the strategies, in units of the box.
const SIGMA: f64 = 0.2;
/// A strategy whose deviation is below this has arrived.
const ARRIVED: f64 = 0.004;
/// The next one begins farther than this from all that have begun or arrived.
const ELSEWHERE: f64 = 0.2;
/// Candidates nearer to each other are one in the race.
const DISTINCT: f64 = 0.02;
/// Generations of each strategy that a budget must allow.
const LEAST_GENERATIONS: u64 = 4;

/// One combination of the finite control factors.
struct Island {
    combination: usize,
    /// Points of the first look, the best first.
    starts: Vec<Vec<f64>>,
    taken: Vec<Vec<f64>>,
    strategy: CmaEs,
    has_arrived: bool,
    points: Vec<(usize, Vec<f64>)>,
}

/// Circumstances of screening, of evolution, and of the last round.
fn circumstances(samples: u64) -> [u64; 3] {
    let evolution = (samples / 4)
        .next_power_of_two()
        .clamp(16, samples.max(16))
        .min(samples);
    [(evolution / 2).max(8).min(samples), evolution, samples]
}

pub(super) fn check<S>(plan: &SearchPlan, choices: &Choices) -> Result<(), SearchError<S>> {
    let dimensions = choices.dimensions();
    let combinations = choices.combinations().unwrap_or(usize::MAX);
    if combinations > MOST_COMBINATIONS {
        return Err(SearchError::Combinations {
            combinations,
            most: MOST_COMBINATIONS,
        });
    }
    let needed = least(combinations, dimensions, plan.samples, plan.fresh);
    if plan.budget < needed {
        return Err(SearchError::Budget {
            budget: plan.budget,
            least: needed,
            what: format!(
                "{combinations} combinations of finite control factors with {dimensions} ranges"
            ),
        });
    }
    Ok(())
}

/// The least that a search of ranges needs.
fn least(combinations: usize, dimensions: usize, samples: u64, fresh: u64) -> u64 {
    let [screening, evolution, last] = circumstances(samples);
    let islands = combinations as u64;
    let points = screened(combinations) as u64 * islands;
    let population = CmaEs::new(&vec![0.5; dimensions], SIGMA, 0).population() as u64;
    points * screening
        + LEAST_GENERATIONS * islands * population * evolution
        + islands * evolution
        + FINALISTS as u64 * (last - evolution)
        + fresh
}

fn screened(combinations: usize) -> usize {
    (SCREENED / combinations).max(LEAST_SCREENED)
}

/// A point of the unit cube that is the same for all combinations.
pub(super) fn spread_point(dimensions: usize, index: u32, seed: u64) -> Vec<f64> {
    (0..dimensions)
        .map(|k| {
            let mixed = seed ^ (k as u64 + 1).wrapping_mul(0xa076_1d64_78bd_642f);
            SobolDimension::new(k, SplitMix64::new(mixed).next_u64()).coordinate(index)
        })
        .collect()
}

pub(super) fn search<J: Judge>(
    pool: &mut Pool<'_, J>,
    choices: &Choices,
) -> Result<Found, SearchError<J::Stop>> {
    let plan = pool.plan;
    check(plan, choices)?;
    let combinations = choices.combinations().unwrap_or(usize::MAX);
    let [screening, evolution, last] = circumstances(plan.samples);
    let mut islands = Vec::new();
    for combination in 0..combinations {
        islands.push(first_look(pool, choices, combination, screening)?);
    }
    // What the means, the race and the fresh circumstances need stays.
    let reserved =
        islands.len() as u64 * evolution + FINALISTS as u64 * (last - evolution) + plan.fresh;
    let total = plan.budget - reserved - pool.charged();
    let begun = pool.charged();
    // Half of the combinations go at the end of each phase.
    let phases = u64::from(islands.len().next_power_of_two().trailing_zeros()) + 1;
    let mut all = Vec::new();
    for phase in 1..=phases {
        let until = begun + total / phases * phase;
        evolve(pool, choices, &mut islands, evolution, until)?;
        islands = halved(pool, islands, evolution, phase == phases, &mut all);
    }
    for island in &mut islands {
        let mean = island.strategy.mean().to_vec();
        let id = pool.add(choices.candidate(island.combination, &mean));
        pool.evaluate(&[id], evolution, Purpose::Evolution)?;
        island.points.push((id, mean));
    }
    all.extend(islands);
    let finalists = distinct(pool, &all, evolution);
    let rounds = [(2 * evolution).min(last), last].map(|circumstances| Round {
        circumstances,
        keep: FINALISTS,
    });
    let rounds = if rounds[0] == rounds[1] {
        &rounds[1..]
    } else {
        &rounds[..]
    };
    race(pool, finalists, rounds)
}

fn first_look<J: Judge>(
    pool: &mut Pool<'_, J>,
    choices: &Choices,
    combination: usize,
    circumstances: u64,
) -> Result<Island, SearchError<J::Stop>> {
    let dimensions = choices.dimensions();
    let combinations = choices.combinations().unwrap_or(1);
    let count = u32::try_from(screened(combinations)).expect("few");
    let mut points: Vec<(usize, Vec<f64>)> = (0..count)
        .map(|index| {
            let point = spread_point(dimensions, index, pool.plan.seed);
            (pool.add(choices.candidate(combination, &point)), point)
        })
        .collect();
    let ids: Vec<usize> = points.iter().map(|(id, _)| *id).collect();
    // All of them, not only the best: they are also where strategies begin anew.
    pool.evaluate(&ids, circumstances, Purpose::Screening)?;
    let ranked = pool.ranked(&ids, circumstances);
    points.sort_by_key(|(id, _)| ranked.iter().position(|ranked| ranked == id));
    let starts: Vec<Vec<f64>> = points.into_iter().map(|(_, point)| point).collect();
    let strategy = CmaEs::new(&starts[0], SIGMA, seed(pool.plan.seed, combination, 0));
    Ok(Island {
        combination,
        taken: vec![starts[0].clone()],
        starts,
        strategy,
        has_arrived: false,
        points: Vec::new(),
    })
}

fn seed(seed: u64, combination: usize, start: usize) -> u64 {
    let place = ((combination as u64) << 32) | (start as u64 + 1);
    SplitMix64::new(seed ^ place.wrapping_mul(0xe703_7ed1_a0b4_28db)).next_u64()
}

/// Generations in turn, as far as cases go.
fn evolve<J: Judge>(
    pool: &mut Pool<'_, J>,
    choices: &Choices,
    islands: &mut [Island],
    circumstances: u64,
    until: u64,
) -> Result<(), SearchError<J::Stop>> {
    loop {
        let mut any = false;
        for island in &mut *islands {
            let cost = island.strategy.population() as u64 * circumstances;
            if island.has_arrived || pool.charged() + cost > until {
                continue;
            }
            any = true;
            step(pool, choices, island, circumstances)?;
        }
        if !any {
            return Ok(());
        }
    }
}

fn step<J: Judge>(
    pool: &mut Pool<'_, J>,
    choices: &Choices,
    island: &mut Island,
    circumstances: u64,
) -> Result<(), SearchError<J::Stop>> {
    let points: Vec<(usize, Vec<f64>)> = island
        .strategy
        .ask()
        .into_iter()
        .map(|point| {
            (
                pool.add(choices.candidate(island.combination, &point)),
                point,
            )
        })
        .collect();
    let mut ids: Vec<usize> = points.iter().map(|(id, _)| *id).collect();
    ids.sort_unstable();
    ids.dedup();
    let parents = island.strategy.parents();
    let best = pool.best(
        &ids,
        circumstances,
        parents.min(ids.len()),
        Purpose::Evolution,
    )?;
    // Points that are one candidate, after rounding, stand together.
    let place = |id: usize| best.ranked.iter().position(|&ranked| ranked == id);
    let mut better: Vec<(usize, &Vec<f64>)> = points
        .iter()
        .filter_map(|(id, point)| Some((place(*id)?, point)))
        .collect();
    better.sort_by_key(|(place, _)| *place);
    let mut better: Vec<Vec<f64>> = better.into_iter().map(|(_, point)| point.clone()).collect();
    // Fewer than the parents only if all of a small generation rounds to few candidates.
    while better.len() < parents {
        better.push(better[better.len() - 1].clone());
    }
    island.strategy.tell(&better);
    let judged = points.into_iter().filter(|(id, _)| place(*id).is_some());
    island.points.extend(judged);
    pool.decide(Decision {
        after: 0,
        purpose: Purpose::Evolution,
        circumstances,
        kept: best.ranked[..parents.min(best.ranked.len())].to_vec(),
        told_apart: Vec::new(),
        dropped: Vec::new(),
        ruled_out: best.ruled_out,
    });
    if island.strategy.spread() < ARRIVED {
        island.taken.push(island.strategy.mean().to_vec());
        let next = island.starts.iter().find(|start| {
            let mut taken = island.taken.iter();
            taken.all(|taken| distance(start, taken) > ELSEWHERE)
        });
        match next.cloned() {
            Some(start) => {
                let number = island.taken.len();
                let seed = seed(pool.plan.seed, island.combination, number);
                island.strategy = CmaEs::new(&start, SIGMA, seed);
                island.taken.push(start);
            }
            None => island.has_arrived = true,
        }
    }
    Ok(())
}

/// Largest difference of coordinates.
fn distance(a: &[f64], b: &[f64]) -> f64 {
    let pairs = a.iter().zip(b);
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// The better half of the combinations; those that go keep their points for the race.
fn halved<J: Judge>(
    pool: &mut Pool<'_, J>,
    islands: Vec<Island>,
    circumstances: u64,
    is_last: bool,
    gone: &mut Vec<Island>,
) -> Vec<Island> {
    if is_last || islands.len() == 1 {
        return islands;
    }
    let ids: Vec<usize> = islands
        .iter()
        .flat_map(|island| island.points.iter().map(|(id, _)| *id))
        .collect();
    let ranked = pool.ranked(&ids, circumstances);
    let mut placed: Vec<(usize, Island)> = islands
        .into_iter()
        .map(|island| {
            let own = |id: &usize| island.points.iter().any(|(own, _)| own == id);
            let best = ranked.iter().position(own).unwrap_or(usize::MAX);
            (best, island)
        })
        .collect();
    placed.sort_by_key(|(best, island)| (*best, island.combination));
    let keep = placed.len().div_ceil(2);
    let dropped: Vec<Island> = placed
        .split_off(keep)
        .into_iter()
        .map(|each| each.1)
        .collect();
    gone.extend(dropped);
    placed.into_iter().map(|(_, island)| island).collect()
}

/// The best candidates that are not next to each other.
fn distinct<J: Judge>(pool: &Pool<'_, J>, islands: &[Island], circumstances: u64) -> Vec<usize> {
    let points: Vec<(usize, usize, &[f64])> = islands
        .iter()
        .flat_map(|island| {
            let points = island.points.iter();
            points.map(|(id, point)| (*id, island.combination, point.as_slice()))
        })
        .collect();
    let mut ids: Vec<usize> = points.iter().map(|(id, ..)| *id).collect();
    ids.sort_unstable();
    ids.dedup();
    let mut chosen: Vec<(usize, usize, &[f64])> = Vec::new();
    for id in pool.ranked(&ids, circumstances) {
        let point = points.iter().find(|(own, ..)| *own == id).expect("a point");
        let is_new = chosen.iter().all(|(_, combination, other)| {
            *combination != point.1 || distance(other, point.2) > DISTINCT
        });
        if is_new {
            chosen.push(*point);
        }
        if chosen.len() == FINALISTS {
            break;
        }
    }
    chosen.into_iter().map(|(id, ..)| id).collect()
}
