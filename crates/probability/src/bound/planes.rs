//! Half-planes: a structure beyond a plane along the needle is met only by a needle that is off towards it.

use std::f64::consts::TAU;

use nalgebra::Vector3;
use needlebench_numerics::normal;

use super::along::{Along, tail, tail_of};
use super::mixture::{Between, Cells, bends_at, binned, fullnesses, normals, off_chord_m, turns};
use crate::bend::{BendDirection, turned};
use crate::breath::Body;
use crate::case::{Anatomy, Case};
use crate::law::Law;
use crate::planes::HalfPlane;

/// Standard deviations along the needle, and of the boundary, that a stretch is longer by: the first of them beyond
/// which hardly anything is, compared with the tails.
const LONGER: [f64; 5] = [3.0, 4.0, 5.0, 6.0, 8.0];
const SETTLED: f64 = 0.05;

/// Cells of a bend towards a plane.
const BENDS: usize = 64;

/// Covers whose bound is computed, of those that come first by their tails without cells.
const COMPUTED: usize = 2;

/// None without planes.
pub(super) fn bound<A: Anatomy>(
    case: &Case<'_, A>,
    structure: usize,
    margin_m: f64,
) -> Option<f64> {
    let needed_m = case.needle.radius_m + margin_m;
    let mut ranked: Vec<(f64, &Vec<HalfPlane>)> = case.structures[structure]
        .covers
        .iter()
        .map(|cover| {
            let planes = cover.iter();
            (
                planes
                    .map(|plane| about(case, structure, plane, needed_m))
                    .sum(),
                cover,
            )
        })
        .collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    let of_cover = |cover: &Vec<HalfPlane>| -> f64 {
        let planes = cover.iter();
        planes
            .map(|plane| of_plane(case, structure, plane, needed_m))
            .sum()
    };
    let computed = ranked.iter().take(COMPUTED);
    computed.map(|(_, cover)| of_cover(cover)).reduce(f64::min)
}

/// About how likely a needle is off beyond a plane: a few curves of its bend stand for all. It orders planes, no more.
fn about<A: Anatomy>(
    case: &Case<'_, A>,
    structure: usize,
    plane: &HalfPlane,
    needed_m: f64,
) -> f64 {
    /// Shares of the curves, by their size, and of a full turn or of the standard deviation of a turn.
    const SIZES: [f64; 2] = [0.5, 0.97];
    const ANGLES: [f64; 4] = [0.0, 1.0, 2.0, 3.0];
    let seen = &case.structures[structure];
    let fullnesses = fullnesses(4);
    let towards = Vector3::new(0.0, plane.normal.x, plane.normal.y);
    let ends = plane
        .stretch_m
        .map(|x_m| (x_m / case.needle.depth_m).clamp(0.0, case.end()));
    let at = |fraction: f64| {
        let states = normals(case.law, fraction, seen.body);
        let bends = case.law.bend().map_or_else(
            || vec![(1.0, 0.0)],
            |bend| {
                let turn = |angle: f64| match bend.direction() {
                    BendDirection::Known { spread_rad } => spread_rad * (angle - 1.5),
                    BendDirection::Unknown => TAU * angle / 4.0,
                };
                let pairs = SIZES
                    .iter()
                    .flat_map(|size| ANGLES.iter().map(move |angle| (size, angle)));
                let each = pairs.map(|(size, angle)| {
                    let value = bend.at(crate::draw::nth(bend.count(), *size), fraction);
                    let bent = turned(value, crate::draw::cosine_and_sine(turn(*angle)));
                    (
                        ((SIZES.len() * ANGLES.len()) as f64).recip(),
                        bent.dot(&plane.normal),
                    )
                });
                each.collect()
            },
        );
        tail_of(
            &states,
            &towards,
            (&bends, &fullnesses),
            plane.offset_m - needed_m,
            seen.boundary_sd_m,
        )
    };
    at(ends[0]) + at(ends[1])
}

fn of_plane<A: Anatomy>(
    case: &Case<'_, A>,
    structure: usize,
    plane: &HalfPlane,
    needed_m: f64,
) -> f64 {
    let seen = &case.structures[structure];
    let (body, sd_m) = (seen.body, seen.boundary_sd_m);
    let along = Along::new(case, body);
    let towards = Vector3::new(0.0, plane.normal.x, plane.normal.y);
    let mut best = 1.0_f64;
    for times in LONGER {
        let beyond_m = needed_m + times * sd_m;
        let boundary = if sd_m > 0.0 {
            normal::probability_below(-times)
        } else {
            0.0
        };
        for shift_m in along.shifts_m(times) {
            let other = boundary + along.beyond(case, body, shift_m);
            if other >= best {
                continue;
            }
            let ends = [
                plane.stretch_m[0] - beyond_m - shift_m,
                plane.stretch_m[1] + beyond_m + shift_m,
            ];
            let ends = ends.map(|x_m| (x_m / case.needle.depth_m).clamp(0.0, case.end()));
            let distance_m = plane.offset_m - needed_m;
            let main = tails(case.law, body, &towards, ends, distance_m, sd_m);
            best = best.min(main + other);
            if other <= SETTLED * main {
                // A longer stretch would only make the other part less.
                return best;
            }
        }
    }
    best
}

/// How likely the needle is off towards a plane by a distance anywhere on a stretch: at either end of it.
fn tails(
    law: &Law,
    body: Body,
    towards: &Vector3<f64>,
    ends: [f64; 2],
    distance_m: f64,
    boundary_sd_m: f64,
) -> f64 {
    let at = |fraction: f64| {
        let states = normals(law, fraction, body);
        let bends = bends(law, towards, fraction, ends);
        tail(&states, towards, &bends, distance_m, boundary_sd_m)
    };
    if ends[0] >= ends[1] {
        at(ends[0])
    } else {
        at(ends[0]) + at(ends[1])
    }
}

/// Cells of the bend towards a plane, with what a curve is off its chord.
fn bends(law: &Law, towards: &Vector3<f64>, fraction: f64, ends: [f64; 2]) -> Cells {
    let Some(bend) = law.bend() else {
        return vec![(1.0, 0.0)];
    };
    let turns = turns(bend.direction());
    let curves = bends_at(bend, fraction, |curve| off_chord_m(bend, curve, ends));
    let values: Vec<(f64, f64)> = curves
        .iter()
        .flat_map(|(share, value, off_m)| {
            let between = Between::new(*value, towards.yz());
            let size_m = value.norm();
            turns.iter().map(move |cell| {
                let most_m = size_m * cell.largest_cosine(&between);
                (share * cell.probability, most_m + off_m)
            })
        })
        .collect();
    binned(values.iter().copied(), BENDS)
}
