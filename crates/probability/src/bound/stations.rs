//! Stations: a path that is off laterally by e at a station does not meet what is farther away than |e|.
//!
//! Off along itself it is where the planned needle, or its axis beyond entry or end, is too: clearances are the least
//! that far to both sides, and how likely it is off by more is added.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};

use nalgebra::{Matrix3, Vector2};
use needlebench_numerics::normal;

use super::along::Along;
use super::mixture::{
    Between, Cells, Normal, PHASES, Turns, bends_at, binned, fullnesses, normals, off_chord_m,
    turns,
};
use crate::breath::Body;
use crate::case::{Anatomy, Case};
use crate::law::Law;

/// Stretches of the finest cut; others merge them by these factors.
const STRETCHES: usize = 40;
const MERGED: [usize; 6] = [1, 2, 4, 8, 20, 40];

/// Standard deviations, and more than what is beyond a ball of them.
const FAR: f64 = 9.0;
const BEYOND_FAR: f64 = 2e-17;

/// Cells of the mean of what is normal.
const MEANS: usize = 40;

/// Cells of a bend in a failed hold, and of that hold.
const FAILED: (usize, usize) = (16, 48);

/// Edges of the cells of a boundary, in standard deviations: from below the first to beyond the last.
const BOUNDARY: (f64, f64, f64) = (-1.5, 7.0, 0.5);

/// Standard deviations along the needle that are looked to both sides: the best of them.
const BESIDE: [f64; 3] = [4.0, 5.5, 8.0];

/// How far the needle is off at all stations relative to a body, and how far its bend is off its chords.
struct Stations {
    all: Vec<Station>,
    /// Of the stretches of each cut, m.
    bent_m: Vec<Vec<f64>>,
}

impl Stations {
    fn new(law: &Law, end: f64, body: Body) -> Self {
        let fraction = |station: usize| end * station as f64 / STRETCHES as f64;
        let cut = |merged: usize| {
            let stretches = 0..STRETCHES / merged;
            let ends = stretches.map(|each| [each * merged, (each + 1) * merged].map(fraction));
            ends.map(|ends| bent_m(law, ends)).collect()
        };
        Self {
            all: (0..=STRETCHES)
                .map(|station| Station::new(law, fraction(station), body))
                .collect(),
            bent_m: MERGED.into_iter().map(cut).collect(),
        }
    }
}

/// `P(|e(s)| > least clearance of both stretches beside s)`, summed over the stations s.
pub(super) fn bound<A: Anatomy>(case: &Case<'_, A>, structure: usize, margin_m: f64) -> f64 {
    let seen = &case.structures[structure];
    let needed_m = case.needle.radius_m + margin_m;
    let fraction = |station: usize| case.end() * station as f64 / STRETCHES as f64;
    let Stations { all, bent_m } = Stations::new(case.law, case.end(), seen.body);
    let shifts = boundary_cells(seen.boundary_sd_m);
    let along = Along::new(case, seen.body);
    let mut best = 1.0_f64;
    let looked: Vec<f64> = BESIDE
        .iter()
        .flat_map(|times| along.shifts_m(*times))
        .collect();
    let farthest = looked.iter().copied().fold(0.0, f64::max) / case.needle.depth_m;
    let clear = Axis::new(case, structure, farthest);
    for beside_m in looked {
        let beyond = along.beyond(case, seen.body, beside_m);
        let beside = beside_m / case.needle.depth_m;
        for (merged, bent_m) in MERGED.into_iter().zip(&bent_m) {
            let clear_m: Vec<f64> = bent_m
                .iter()
                .enumerate()
                .map(|(stretch, bent_m)| {
                    let (from, to) = (stretch * merged, (stretch + 1) * merged);
                    clear.least_m([fraction(from) - beside, fraction(to) + beside])
                        - needed_m
                        - bent_m
                })
                .collect();
            let last = clear_m.len();
            let near_m = |station: usize| {
                let before = clear_m[station.saturating_sub(1)];
                before.min(clear_m[station.min(last - 1)])
            };
            let given = |shift_m: f64| -> f64 {
                if shift_m == f64::INFINITY {
                    return 1.0;
                }
                let each = (0..=last)
                    .map(|station| all[station * merged].beyond(near_m(station) - shift_m));
                each.sum::<f64>().min(1.0)
            };
            let each = shifts
                .iter()
                .map(|(share, shift_m)| share * given(*shift_m));
            best = best.min(each.sum::<f64>() + beyond);
        }
    }
    best
}

/// Clearances along the planned axis, before the entry and beyond the end too.
struct Axis {
    /// Fraction where the first stretch begins, and how long each is.
    first: f64,
    step: f64,
    stretches_m: Vec<f64>,
}

impl Axis {
    fn new<A: Anatomy>(case: &Case<'_, A>, structure: usize, beyond: f64) -> Self {
        /// Stretches of the needle itself.
        const STEPS: f64 = 120.0;
        let step = case.end() / STEPS;
        let (first, last) = (-beyond - step, case.end() + beyond + step);
        let mut stretches_m = Vec::new();
        let mut from = first;
        while from < last {
            let clear_m = case.stretch_m(structure, [from, from + step]);
            // What is not a number may be anywhere.
            stretches_m.push(if clear_m.is_nan() {
                f64::NEG_INFINITY
            } else {
                clear_m
            });
            from = first + step * stretches_m.len() as f64;
        }
        Self {
            first,
            step,
            stretches_m,
        }
    }

    /// Least clearance between two fractions, m.
    fn least_m(&self, [from, to]: [f64; 2]) -> f64 {
        let each = self.stretches_m.iter().enumerate();
        let touched = each.filter(|(index, _)| {
            let begins = self.first + self.step * *index as f64;
            begins <= to + ROUNDING && begins + self.step >= from - ROUNDING
        });
        touched
            .map(|(_, clear_m)| *clear_m)
            .fold(f64::INFINITY, f64::min)
    }
}

/// Of fractions.
const ROUNDING: f64 = 1e-9;

/// How far any curve of a bend is off its chord, m.
fn bent_m(law: &Law, ends: [f64; 2]) -> f64 {
    law.bend().map_or(0.0, |bend| {
        let curves = 0..bend.count();
        curves
            .map(|curve| off_chord_m(bend, curve, ends))
            .fold(0.0, f64::max)
    })
}

fn boundary_cells(sd_m: f64) -> Cells {
    if sd_m <= 0.0 {
        return vec![(1.0, 0.0)];
    }
    let (first, last, step) = BOUNDARY;
    let mut cells = vec![(normal::probability_below(first), first * sd_m)];
    let mut from = first;
    while from < last {
        let share = normal::probability_below(-from) - normal::probability_below(-from - step);
        cells.push((share, (from + step) * sd_m));
        from += step;
    }
    // Beyond the last edge it counts as a hit.
    cells.push((normal::probability_below(-last), f64::INFINITY));
    cells
}

/// How far the needle is off laterally at one station.
struct Station {
    states: Vec<State>,
}

/// States of the breath with one covariance.
struct State {
    /// Largest standard deviation along a lateral axis, m.
    sd_m: f64,
    /// What a normal distribution with this one along every axis is off by: 1 if it has it already, else 2.
    factor: f64,
    /// How likely, and distances of the mean from the plan, m.
    means_m: Cells,
}

impl Station {
    fn new(law: &Law, fraction: f64, body: Body) -> Self {
        let turns = law
            .bend()
            .map(|bend| turns(bend.direction()))
            .unwrap_or_default();
        let mut states: Vec<State> = Vec::new();
        for normal in &normals(law, fraction, body) {
            let (sd_m, factor) = widest(&normal.covariance_m2);
            let means_m = means_m(law, fraction, normal, &turns);
            let weighted = means_m.into_iter();
            let weighted = weighted.map(|(share, mean_m)| (normal.weight * share, mean_m));
            // States that differ in their means alone, such as levels of a held breath, are one.
            let same = |state: &&mut State| {
                normal.failed_m.is_none() && (state.sd_m, state.factor) == (sd_m, factor)
            };
            match states.iter_mut().find(same) {
                Some(state) => state.means_m.extend(weighted),
                None => states.push(State {
                    sd_m,
                    factor,
                    means_m: weighted.collect(),
                }),
            }
        }
        for state in &mut states {
            if state.means_m.len() > FAILED.1 {
                state.means_m = binned(state.means_m.iter().copied(), FAILED.1);
            }
        }
        Self { states }
    }

    /// How likely it is off by more than a distance.
    fn beyond(&self, distance_m: f64) -> f64 {
        let each = self.states.iter().map(|state| {
            let means = state.means_m.iter();
            let tails = means.map(|(share, mean_m)| share * state.tail(*mean_m, distance_m));
            tails.sum::<f64>()
        });
        each.sum()
    }
}

impl State {
    /// The smaller of two bounds of P(|m + Y| > c), Y lateral and normal with mean 0 and no wider than s along any
    /// axis:
    ///
    /// - `P(|Y| > c - |m|)`, which grows with the covariance (Anderson 1955), so s may stand for every axis;
    /// - `2 P(|m + s Z| > c)`: s Z is Y and an independent symmetric W, and of m + Y + W and m + Y - W at least one is
    ///   outside the disc if m + Y is, by the parallelogram law. Three variables instead of two make it larger, and a
    ///   closed form.
    fn tail(&self, mean_m: f64, distance_m: f64) -> f64 {
        if distance_m <= mean_m {
            return 1.0;
        }
        if self.sd_m <= 0.0 || distance_m == f64::INFINITY {
            return 0.0;
        }
        let (mean, distance) = (mean_m / self.sd_m, distance_m / self.sd_m);
        if distance - mean > FAR {
            return BEYOND_FAR;
        }
        let central = libm::exp(-0.5 * (distance - mean) * (distance - mean));
        central
            .min(self.factor * beyond_ball(mean, distance))
            .min(1.0)
    }
}

/// How likely three standard normal variables about a point at a distance from the middle are outside a ball (Marcum).
fn beyond_ball(mean: f64, radius: f64) -> f64 {
    let sides = 0.5
        * (libm::erfc((radius - mean) * FRAC_1_SQRT_2)
            + libm::erfc((radius + mean) * FRAC_1_SQRT_2));
    let product = mean * radius;
    let edge = if product < 1e-3 {
        // sinh(x) / x
        2.0 * radius
            * libm::exp(-0.5 * (radius * radius + mean * mean))
            * (1.0 + product * product / 6.0)
    } else {
        let at = |difference: f64| libm::exp(-0.5 * difference * difference);
        (at(radius - mean) - at(radius + mean)) / mean
    };
    sides + edge / TAU.sqrt()
}

/// Largest standard deviation along a lateral axis, and 1 if all are the same, else 2.
fn widest(covariance_m2: &Matrix3<f64>) -> (f64, f64) {
    /// Of eigenvalues.
    const ROUNDING: f64 = 1e-12;
    let values = covariance_m2
        .fixed_view::<2, 2>(1, 1)
        .into_owned()
        .symmetric_eigenvalues();
    let largest = values.max().max(0.0) * (1.0 + ROUNDING);
    let is_round = values.min() >= largest * (1.0 - 4.0 * ROUNDING);
    (largest.sqrt(), if is_round { 1.0 } else { 2.0 })
}

/// Cells of how far the mean of a state is off laterally, m.
fn means_m(law: &Law, fraction: f64, state: &Normal, turns: &[Turns]) -> Cells {
    let lateral = state.mean_m.yz();
    let Some(bend) = law.bend() else {
        return match &state.failed_m {
            None => vec![(1.0, lateral.norm())],
            Some(full) => failed_m(&lateral, &full.yz(), &[(1.0, 0.0)]),
        };
    };
    let bends = bends_at(bend, fraction, |_| 0.0);
    if let Some(full) = &state.failed_m {
        let sizes_m = bends.iter().map(|(share, bent, _)| (*share, bent.norm()));
        return failed_m(&lateral, &full.yz(), &binned(sizes_m, FAILED.0));
    }
    let values: Vec<(f64, f64)> = bends
        .iter()
        .flat_map(|(share, bent, _)| {
            let between = Between::new(*bent, lateral);
            turns.iter().map(move |cell| {
                let product = bent.norm() * lateral.norm() * cell.largest_cosine(&between);
                let square = lateral.norm_squared() + bent.norm_squared() + 2.0 * product;
                (share * cell.probability, square.max(0.0).sqrt())
            })
        })
        .collect();
    binned(values.iter().copied(), MEANS)
}

/// The same of a failed hold, with a bend in whatever direction.
fn failed_m(mean_m: &Vector2<f64>, full_m: &Vector2<f64>, bends_m: &[(f64, f64)]) -> Cells {
    let values: Vec<(f64, f64)> = fullnesses(PHASES)
        .into_iter()
        .flat_map(|(share, ends)| {
            let most_m = ends.map(|fullness| (mean_m + full_m * fullness).norm());
            let most_m = most_m[0].max(most_m[1]);
            bends_m
                .iter()
                .map(move |(other, more_m)| (share * other, most_m + more_m))
        })
        .collect();
    binned(values.iter().copied(), FAILED.1)
}
