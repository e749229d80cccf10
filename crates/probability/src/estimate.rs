//! Estimates from draws, with their intervals.

use crate::case::{Anatomy, Case};
use crate::draw::{Shifts, Streams, path};
use crate::event::{Asked, Event, EventError};
use crate::importance::{Drawn, Proposal, Search};
use crate::influence::{Influence, Origin, Reweighting};
use crate::interval::{
    Difference, Interval, LEAST_PRINTED, SIDES, share_interval, standard_error, weighted_interval,
};

/// Most draws of an estimate.
pub const MOST_DRAWS: u64 = 1_000_000;

/// Draws after which a plain estimate may end.
const BLOCK: u64 = 10_000;

/// Draws after which importance sampling may end, and most of them.
const MOVED_BLOCK: u64 = 2_000;
const MOST_MOVED: u64 = 200_000;

/// A weight that is a larger share of the sum comes from where hardly any draw was moved to.
const LARGEST_WEIGHT: f64 = 0.05;

/// An estimate ends when its interval is within this share of the probability.
const WITHIN: f64 = 0.1;

/// Below this draws are moved to where the event happens.
const RARE: f64 = 1e-3;

/// With a smaller effective sample size moved draws tell nothing.
const LEAST_SIZE: f64 = 200.0;

/// With fewer hits plain draws instead tell no more than an upper end.
const FEWEST_HITS: u64 = 20;

/// Seed and effort of estimates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Draws {
    /// The same seed gives the same arms, patients and needles to every case.
    pub seed: u64,
    /// Most draws: [`MOST_DRAWS`], or fewer for a first look.
    pub most: u64,
    /// Threads that may be used: they change nothing.
    pub threads: usize,
    /// Events below 1e-3 are sampled by their importance; if not, all draws are plain ones.
    pub moves: bool,
}

/// What an estimate says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Told {
    /// A probability with its interval.
    Estimated,
    /// It happened in no draw: below the upper end of the interval, 3.7/n.
    NoHits,
    /// Too few moved draws count, and too few plain ones hit: below the upper end of the interval of these.
    BelowWhatCanBeTold,
    /// The planned path does it already: nothing was drawn.
    AtPlan,
}

/// How an estimate was made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Nothing was drawn.
    Plan,
    /// Draws of the law.
    Plain,
    /// Draws of the law, as no point of failure was found, or too few moved draws counted.
    PlainInstead,
    /// Draws that are moved to so many points.
    Importance {
        /// Points of failure.
        points: usize,
    },
}

/// How likely an event is.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// What it says.
    pub told: Told,
    /// The probability; none without hits, below what can be told, and at plan.
    pub probability: Option<f64>,
    /// Its 95 % interval; from 0 to 1 at plan.
    pub interval: Interval,
    /// Draws.
    pub draws: u64,
    /// Draws in which it happens; of importance sampling, of its moved draws.
    pub hits: u64,
    /// Hits of plain draws; of weighted ones as many as count the same, (sum w)^2 / sum w^2 (Kish 1965).
    pub effective_size: f64,
    /// How it was made.
    pub method: Method,
    /// What it becomes with less variance, the largest change first; empty without a probability.
    pub influences: Vec<Influence>,
}

/// Why there is no estimate.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EstimateError {
    /// An event.
    #[error(transparent)]
    Event(#[from] EventError),
    /// Too few draws.
    #[error("{draws} draws are too few; at least 100")]
    Draws {
        /// As asked for.
        draws: u64,
    },
    /// A distance that is no number.
    #[error("{structure}: a distance near the needle path is not a number")]
    Distance {
        /// Name.
        structure: String,
    },
}

/// How likely events are, in their order.
///
/// What [`crate::at_most`] says enough of need not be asked: structures that no draw comes near take all draws.
///
/// Draws in blocks of 10 000 until the interval is within 10 % of the probability, or all are done; an event below
/// 1e-3 is sampled by its importance, until that or until it is below what is printed as a number. An estimate does not depend on which others are asked for.
///
/// # Errors
/// [`EstimateError`].
pub fn estimate<A: Anatomy>(
    case: &Case<'_, A>,
    events: &[Event],
    draws: &Draws,
) -> Result<Vec<Estimate>, EstimateError> {
    Sampler::new(case, events, draws, true)?.run()
}

/// The same with every distance looked up.
#[cfg(test)]
pub(crate) fn unscreened<A: Anatomy>(
    case: &Case<'_, A>,
    events: &[Event],
    draws: &Draws,
) -> Result<Vec<Estimate>, EstimateError> {
    Sampler::new(case, events, draws, false)?.run()
}

/// An event of one case against an event of another, on the same draws, all of them.
///
/// # Errors
/// [`EstimateError`].
pub fn difference<A: Anatomy, B: Anatomy>(
    first: (&Case<'_, A>, &Event),
    second: (&Case<'_, B>, &Event),
    draws: &Draws,
) -> Result<Difference, EstimateError> {
    let happened = Sampler::new(first.0, std::slice::from_ref(first.1), draws, true)?.outcomes()?;
    let other = Sampler::new(second.0, std::slice::from_ref(second.1), draws, true)?.outcomes()?;
    let both = || happened.iter().zip(&other);
    let count = |wanted: fn(bool, bool) -> bool| {
        let found = both().filter(|(first, second)| wanted(**first, **second));
        found.count() as u64
    };
    Ok(Difference {
        only_first: count(|first, second| first && !second),
        only_second: count(|first, second| !first && second),
        draws: draws.most,
    })
}

/// Sums of one event.
#[derive(Debug, Clone, PartialEq)]
struct Sums {
    draws: u64,
    hits: u64,
    weight: f64,
    square: f64,
    largest: f64,
    /// Weights of what is rare, hits or misses, times the ratio of each origin.
    ratios: Vec<f64>,
}

impl Sums {
    fn new(origins: usize) -> Self {
        Self {
            draws: 0,
            hits: 0,
            weight: 0.0,
            square: 0.0,
            largest: 0.0,
            ratios: vec![0.0; origins],
        }
    }

    fn add(&mut self, other: &Self) {
        self.draws += other.draws;
        self.hits += other.hits;
        self.weight += other.weight;
        self.square += other.square;
        self.largest = self.largest.max(other.largest);
        for (sum, more) in self.ratios.iter_mut().zip(&other.ratios) {
            *sum += more;
        }
    }

    fn share(&self) -> f64 {
        self.weight / self.draws as f64
    }

    fn effective_size(&self) -> f64 {
        if self.square > 0.0 {
            self.weight * self.weight / self.square
        } else {
            0.0
        }
    }

    /// Whether plain draws are enough.
    fn is_enough(&self) -> bool {
        let share = self.hits as f64 / self.draws as f64;
        let about = SIDES * (share * (1.0 - share) / self.draws as f64).sqrt();
        // The exact interval is never narrower.
        self.hits > 0 && about <= WITHIN * share && {
            let interval = share_interval(self.hits, self.draws);
            interval.high - share <= WITHIN * share && share - interval.low <= WITHIN * share
        }
    }

    /// Whether moved draws say anything.
    fn can_tell(&self) -> bool {
        self.effective_size() >= LEAST_SIZE && self.largest <= LARGEST_WEIGHT * self.weight
    }

    /// Whether they are enough: for a number, or to say that it is too small for one.
    fn is_enough_moved(&self) -> bool {
        let error = standard_error(self.weight, self.square, self.draws);
        let is_small =
            || weighted_interval(self.weight, self.square, self.draws).high < LEAST_PRINTED;
        self.can_tell() && (SIDES * error <= WITHIN * self.share() || is_small())
    }
}

/// What a block of draws is asked.
struct Block<'e> {
    first: u64,
    count: u64,
    events: &'e [usize],
    proposal: Option<&'e Proposal>,
}

struct Sampler<'s, 'c, A> {
    case: &'s Case<'c, A>,
    events: &'s [Event],
    draws: Draws,
    is_screened: bool,
    streams: Streams,
    /// Starts of the boundaries' sequences.
    starts: Vec<u64>,
    reweighting: Reweighting,
    origins: Vec<Vec<Origin>>,
}

impl<'s, 'c, A: Anatomy> Sampler<'s, 'c, A> {
    fn new(
        case: &'s Case<'c, A>,
        events: &'s [Event],
        draws: &Draws,
        is_screened: bool,
    ) -> Result<Self, EstimateError> {
        /// Below this an interval says nothing.
        const FEWEST: u64 = 100;
        if draws.most < FEWEST {
            return Err(EstimateError::Draws { draws: draws.most });
        }
        for event in events {
            event.check(case)?;
        }
        let streams = Streams::new(draws.seed);
        let reweighting = Reweighting::new(case.law);
        let has_boundary = |event: &Event| {
            let structure = event.boundary();
            structure.is_some_and(|structure| case.structures[structure].boundary_sd_m > 0.0)
        };
        Ok(Self {
            case,
            events,
            draws: *draws,
            is_screened,
            starts: (0..case.structures.len())
                .map(|each| streams.boundary(each))
                .collect(),
            streams,
            origins: events
                .iter()
                .map(|event| reweighting.origins(has_boundary(event)))
                .collect(),
            reweighting,
        })
    }

    fn run(&self) -> Result<Vec<Estimate>, EstimateError> {
        let mut estimates: Vec<Option<Estimate>> = self
            .events
            .iter()
            .map(|event| self.at_plan(event))
            .collect();
        let open: Vec<usize> = (0..self.events.len())
            .filter(|event| estimates[*event].is_none())
            .collect();
        let mut rare = Vec::new();
        for (event, sums) in self.plain(&open, true)? {
            if self.is_rare(event, &sums) {
                rare.push(event);
            } else {
                estimates[event] = Some(self.estimated(event, &sums, Method::Plain));
            }
        }
        let mut left = Vec::new();
        for event in rare {
            match self.moved(event)? {
                Some((sums, points)) if sums.can_tell() => {
                    let method = Method::Importance { points };
                    estimates[event] = Some(self.estimated(event, &sums, method));
                }
                found => left.push((event, found.is_some())),
            }
        }
        let instead: Vec<usize> = left.iter().map(|(event, _)| *event).collect();
        for ((event, sums), (_, moved)) in self.plain(&instead, false)?.into_iter().zip(left) {
            let mut estimate = self.estimated(event, &sums, Method::PlainInstead);
            if moved && sums.hits < FEWEST_HITS {
                estimate.told = Told::BelowWhatCanBeTold;
                estimate.probability = None;
                estimate.influences.clear();
            }
            estimates[event] = Some(estimate);
        }
        Ok(estimates.into_iter().flatten().collect())
    }

    /// Whether an event that is not wanted is rare, by the first block.
    fn is_rare(&self, event: usize, sums: &Sums) -> bool {
        let is_first = sums.draws == BLOCK.min(self.draws.most);
        let is_few = (sums.hits as f64) < RARE * sums.draws as f64;
        self.draws.moves && is_first && is_few && self.events[event].obstacles().is_some()
    }

    /// Where the planned path does it already.
    fn at_plan(&self, event: &Event) -> Option<Estimate> {
        let (structures, margin_m) = event.obstacles()?;
        let needed_m = self.case.needle.radius_m + margin_m;
        let mut planned = structures
            .iter()
            .map(|each| self.case.clearances[*each].planned_m);
        planned
            .any(|planned_m| planned_m <= needed_m)
            .then(|| Estimate {
                told: Told::AtPlan,
                probability: None,
                interval: Interval {
                    low: 0.0,
                    high: 1.0,
                },
                draws: 0,
                hits: 0,
                effective_size: 0.0,
                method: Method::Plan,
                influences: Vec::new(),
            })
    }

    /// Plain draws until every event has enough; rare ones end with the first block if they are sampled by importance.
    fn plain(&self, events: &[usize], rare_end: bool) -> Result<Vec<(usize, Sums)>, EstimateError> {
        let new = |event: &usize| (*event, Sums::new(self.origins[*event].len()));
        let mut all: Vec<(usize, Sums)> = events.iter().map(new).collect();
        let mut open: Vec<usize> = (0..all.len()).collect();
        let most = self.draws.most;
        let mut blocks = (0..most.div_ceil(BLOCK)).map(|block| {
            let first = block * BLOCK;
            (first, BLOCK.min(most - first))
        });
        while !open.is_empty() {
            // As many at a time as there are threads; those beyond where an event ends do not count for it.
            let wave: Vec<(u64, u64)> = blocks.by_ref().take(self.draws.threads.max(1)).collect();
            if wave.is_empty() {
                break;
            }
            let asked: Vec<usize> = open.iter().map(|at| all[*at].0).collect();
            let results =
                needlebench_parallel::in_parallel(self.draws.threads, &wave, |(first, count)| {
                    self.block(&Block {
                        first: *first,
                        count: *count,
                        events: &asked,
                        proposal: None,
                    })
                });
            let places = open.clone();
            for result in results {
                let sums = result?;
                for (at, more) in places.iter().zip(&sums) {
                    if !open.contains(at) {
                        continue;
                    }
                    let (event, sums) = &mut all[*at];
                    sums.add(more);
                    if rare_end && self.is_rare(*event, sums) || sums.is_enough() {
                        open.retain(|other| other != at);
                    }
                }
            }
        }
        Ok(all)
    }

    /// Moved draws of one event, and to how many points; none if no point of failure was found.
    fn moved(&self, event: usize) -> Result<Option<(Sums, usize)>, EstimateError> {
        let Some((structures, margin_m)) = self.events[event].obstacles() else {
            return Ok(None);
        };
        let search = Search {
            case: self.case,
            structures,
            margin_m,
        };
        let Some(proposal) = search.proposal(&self.streams) else {
            return Ok(None);
        };
        let mut sums = Sums::new(self.origins[event].len());
        let most = MOST_MOVED.min(self.draws.most).div_ceil(MOVED_BLOCK);
        let blocks: Vec<u64> = (0..most).collect();
        let asked = [event];
        'waves: for wave in blocks.chunks(self.draws.threads.max(1)) {
            let results = needlebench_parallel::in_parallel(self.draws.threads, wave, |block| {
                self.block(&Block {
                    first: block * MOVED_BLOCK,
                    count: MOVED_BLOCK,
                    events: &asked,
                    proposal: Some(&proposal),
                })
            });
            for result in results {
                sums.add(&result?[0]);
                if sums.is_enough_moved() {
                    break 'waves;
                }
            }
        }
        let is_sound = sums.weight.is_finite() && sums.square.is_finite();
        Ok(is_sound.then_some((sums, proposal.points.len())))
    }

    fn block(&self, block: &Block<'_>) -> Result<Vec<Sums>, EstimateError> {
        let mut sums: Vec<Sums> = block
            .events
            .iter()
            .map(|event| Sums::new(self.origins[*event].len()))
            .collect();
        self.each(block, |asked, drawn, shifts| {
            let weight = drawn.weight;
            for (event, sums) in block.events.iter().zip(&mut sums) {
                let asks = &self.events[*event];
                let happens = asked.happens(asks);
                sums.draws += 1;
                if happens {
                    sums.hits += 1;
                    sums.weight += weight;
                    sums.square += weight * weight;
                    sums.largest = sums.largest.max(weight);
                }
                if happens != asks.is_wanted() {
                    let structure = asks.boundary();
                    let structure =
                        structure.filter(|each| self.case.structures[*each].boundary_sd_m > 0.0);
                    let boundary = structure.map(|structure| shifts.of(structure));
                    self.reweighting
                        .add(&drawn.values, boundary, weight, &mut sums.ratios);
                }
            }
        })?;
        Ok(sums)
    }

    /// Asks every draw of a block, with its values, its weight and its boundaries.
    fn each(
        &self,
        block: &Block<'_>,
        mut ask: impl FnMut(&mut Asked<'_, '_, A>, &Drawn, &Shifts<'_>),
    ) -> Result<(), EstimateError> {
        let law = self.case.law;
        let mut all: Option<Asked<'_, '_, A>> = None;
        for index in block.first..block.first + block.count {
            let drawn = match block.proposal {
                None => Drawn {
                    values: self.streams.values(law, index),
                    weight: 1.0,
                    moved: None,
                },
                Some(proposal) => {
                    let mut random = self.streams.moved(index);
                    proposal.draw(law, &mut random, &self.starts, index)
                }
            };
            let shifts = Shifts {
                starts: &self.starts,
                index,
                moved: drawn.moved,
            };
            let path = path(law, &drawn.values);
            let asked = match &mut all {
                Some(asked) => {
                    asked.turn_to(path, shifts);
                    asked
                }
                none => none.insert(Asked::new(self.case, path, shifts, self.is_screened)),
            };
            ask(asked, &drawn, &shifts);
            if let Some(structure) = asked.broken {
                return Err(EstimateError::Distance {
                    structure: self.case.structures[structure].name.clone(),
                });
            }
        }
        Ok(())
    }

    /// Whether the first event happens, draw by draw.
    fn outcomes(&self) -> Result<Vec<bool>, EstimateError> {
        let most = self.draws.most;
        let blocks: Vec<u64> = (0..most.div_ceil(BLOCK)).collect();
        let results = needlebench_parallel::in_parallel(self.draws.threads, &blocks, |block| {
            let first = block * BLOCK;
            let block = Block {
                first,
                count: BLOCK.min(most - first),
                events: &[0],
                proposal: None,
            };
            let mut happened = Vec::new();
            self.each(&block, |asked, _, _| {
                happened.push(asked.happens(&self.events[0]));
            })?;
            Ok(happened)
        });
        let all: Result<Vec<Vec<bool>>, EstimateError> = results.into_iter().collect();
        Ok(all?.concat())
    }

    fn estimated(&self, event: usize, sums: &Sums, method: Method) -> Estimate {
        let is_moved = matches!(method, Method::Importance { .. });
        let has_hits = sums.hits > 0;
        let probability = has_hits.then(|| sums.share());
        let mut influences: Vec<Influence> = self.origins[event]
            .iter()
            .zip(&sums.ratios)
            .map(|(origin, sum)| {
                let share = sum / sums.draws as f64;
                let is_wanted = self.events[event].is_wanted();
                Influence {
                    origin: *origin,
                    halved: if is_wanted { 1.0 - share } else { share },
                }
            })
            .collect();
        let change = |each: &Influence| (each.halved - sums.share()).abs();
        influences.sort_by(|a, b| change(b).total_cmp(&change(a)));
        if !has_hits {
            influences.clear();
        }
        Estimate {
            told: if has_hits {
                Told::Estimated
            } else {
                Told::NoHits
            },
            probability,
            interval: if is_moved {
                weighted_interval(sums.weight, sums.square, sums.draws)
            } else {
                share_interval(sums.hits, sums.draws)
            },
            draws: sums.draws,
            hits: sums.hits,
            effective_size: sums.effective_size(),
            method,
            influences,
        }
    }
}
