//! What a law is made of besides normal variables, as cells with a probability each.

use std::f64::consts::{PI, TAU};

use nalgebra::{Matrix3, Matrix6, Vector2, Vector3};
use needlebench_numerics::normal;

use crate::bend::{Bend, BendDirection};
use crate::breath::Body;
use crate::draw::cosine_and_sine;
use crate::law::Law;

/// Cells with their probabilities and the largest value in each.
pub(super) type Cells = Vec<(f64, f64)>;

/// How likely the fullness of a breath is between two values, and both.
pub(super) type Fullness = (f64, [f64; 2]);

/// Angles from one to another, and how likely a turn is among them.
pub(super) struct Turns {
    pub probability: f64,
    ends_rad: [f64; 2],
    /// Cosines and sines of both.
    ends: [[f64; 2]; 2],
}

impl Turns {
    fn new(probability: f64, ends_rad: [f64; 2]) -> Self {
        Self {
            probability,
            ends_rad,
            ends: ends_rad.map(cosine_and_sine),
        }
    }

    /// Largest cosine of the angle between two vectors if one is turned by any of these; `between` is how far it is
    /// ahead of the other before, rad, and its cosine and sine.
    pub fn largest_cosine(&self, between: &Between) -> f64 {
        let from_rad = between.angle_rad + self.ends_rad[0];
        // The next full turn after the beginning.
        if (from_rad / TAU).ceil() * TAU <= between.angle_rad + self.ends_rad[1] {
            return 1.0;
        }
        let [cosine, sine] = between.direction;
        let [from, to] = self.ends.map(|[c, s]| c * cosine - s * sine);
        // Rounding of the sums of angles.
        (from.max(to) + 1e-12).min(1.0)
    }
}

/// Angle from one lateral vector to another.
pub(super) struct Between {
    angle_rad: f64,
    direction: [f64; 2],
}

impl Between {
    /// Any angle will do for vectors of length 0.
    pub fn new(of: Vector2<f64>, from: Vector2<f64>) -> Self {
        let angle_rad = libm::atan2(of.y, of.x) - libm::atan2(from.y, from.x);
        Self {
            angle_rad,
            direction: cosine_and_sine(angle_rad),
        }
    }
}

/// Cells of a turn that may be any.
const TURNS: u32 = 48;

/// Edges of the cells of a turn that is normal, in standard deviations; beyond the outer ones it may be anything.
const TURN_EDGES: f64 = 5.0;
const TURN_CELLS: u32 = 40;

/// Cells of the phase of a failed hold; its second half is the mirror image of the first.
pub(super) const PHASES: u32 = 128;

/// A law that is normal: one state of the breath at a station.
pub(super) struct Normal {
    pub weight: f64,
    pub mean_m: Vector3<f64>,
    pub covariance_m2: Matrix3<f64>,
    /// Of a failed hold, displacement of the needle relative to the body at a full breath.
    pub failed_m: Option<Vector3<f64>>,
}

/// What is normal of how far a needle is off at a fraction of its depth, by state of the breath.
pub(super) fn normals(law: &Law, fraction: f64, body: Body) -> Vec<Normal> {
    let (at_entry, at_tip) = (1.0 - fraction, fraction);
    let block = |row: usize, column: usize| -> Matrix3<f64> {
        let covariance: &Matrix6<f64> = law.covariance_m2();
        covariance
            .fixed_view::<3, 3>(3 * row, 3 * column)
            .into_owned()
    };
    let line_m2 = block(0, 0) * (at_entry * at_entry)
        + block(1, 1) * (at_tip * at_tip)
        + (block(0, 1) + block(1, 0)) * (at_entry * at_tip);
    let mean_m: Vector3<f64> =
        law.mean_m().fixed_rows::<3>(0) * at_entry + law.mean_m().fixed_rows::<3>(3) * at_tip;
    let index = body.index();
    let square = |vector: &Vector3<f64>| vector * vector.transpose();
    let holds = law.holds().iter().filter(|hold| hold.weight > 0.0);
    holds
        .map(|hold| Normal {
            weight: hold.weight,
            mean_m: mean_m - hold.drift_m[index],
            covariance_m2: line_m2
                + square(&hold.level_sd_m[index])
                + square(&hold.drift_sd_m[index]),
            failed_m: hold.failed_m.map(|full| -full[index]),
        })
        .collect()
}

/// Cells of the turn of a bend.
pub(super) fn turns(direction: BendDirection) -> Vec<Turns> {
    match direction {
        BendDirection::Unknown => (0..TURNS)
            .map(|cell| {
                let edge = |cell: u32| TAU * f64::from(cell) / f64::from(TURNS);
                Turns::new(f64::from(TURNS).recip(), [cell, cell + 1].map(edge))
            })
            .collect(),
        BendDirection::Known { spread_rad } if spread_rad <= 0.0 => {
            vec![Turns::new(1.0, [0.0; 2])]
        }
        BendDirection::Known { spread_rad } => {
            let edge =
                |cell: u32| TURN_EDGES * (2.0 * f64::from(cell) / f64::from(TURN_CELLS) - 1.0);
            let mut cells: Vec<Turns> = (0..TURN_CELLS)
                .map(|cell| {
                    let edges = [cell, cell + 1].map(edge);
                    let below = edges.map(normal::probability_below);
                    Turns::new(below[1] - below[0], edges.map(|edge| spread_rad * edge))
                })
                .collect();
            let beyond = 2.0 * normal::probability_below(-TURN_EDGES);
            cells.push(Turns::new(beyond, [0.0, TAU]));
            cells
        }
    }
}

/// Values of fullness of a breath, sin^4(pi u) of a uniform phase, as cells: their probabilities and both ends.
pub(super) fn fullnesses(count: u32) -> Vec<Fullness> {
    let at = |cell: u32| {
        let sine = libm::sin(0.5 * PI * f64::from(cell) / f64::from(count));
        let square = sine * sine;
        square * square
    };
    (0..count)
        .map(|cell| (f64::from(count).recip(), [at(cell), at(cell + 1)]))
        .collect()
}

/// Cells with values as few cells: values are rounded up.
pub(super) fn binned(values: impl Iterator<Item = (f64, f64)> + Clone, count: usize) -> Cells {
    let ends = values.clone().fold(
        (f64::INFINITY, f64::NEG_INFINITY),
        |(low, high), (_, value)| (low.min(value), high.max(value)),
    );
    let (low, high) = ends;
    if low >= high {
        return vec![(values.map(|(probability, _)| probability).sum(), high)];
    }
    let width = (high - low) / count as f64;
    let mut cells: Cells = (0..count)
        .map(|cell| (0.0, low + width * (cell as f64 + 1.0)))
        .collect();
    cells[count - 1].1 = high;
    for (probability, value) in values {
        let mut cell = crate::draw::nth(count, (value - low) / (high - low));
        // Rounding of the division.
        while cells[cell].1 < value {
            cell += 1;
        }
        cells[cell].0 += probability;
    }
    cells.retain(|(probability, _)| *probability > 0.0);
    cells
}

/// Bends at a fraction that stand for all of them: how likely, where, and how far the curve is off what it is taken for, m.
/// Where any turn is as likely, those of like size are one, of the largest size.
pub(super) fn bends_at(
    bend: &Bend,
    fraction: f64,
    off_m: impl Fn(usize) -> f64,
) -> Vec<(f64, Vector2<f64>, f64)> {
    /// Sizes.
    const SIZES: usize = 48;
    let share = (bend.count() as f64).recip();
    let each = (0..bend.count()).map(|curve| (share, bend.at(curve, fraction), off_m(curve)));
    if bend.direction() != BendDirection::Unknown {
        return each.collect();
    }
    let all: Vec<(f64, Vector2<f64>, f64)> = each.collect();
    let largest_m = all
        .iter()
        .map(|(_, bent, _)| bent.norm())
        .fold(0.0, f64::max);
    let mut sizes = vec![(0.0, 0.0_f64, 0.0_f64); SIZES];
    for (share, bent, off_m) in all {
        let size_m = bent.norm();
        let cell = crate::draw::nth(
            SIZES,
            if largest_m > 0.0 {
                size_m / largest_m
            } else {
                0.0
            },
        );
        let (likely, most_m, most_off_m) = &mut sizes[cell];
        *likely += share;
        *most_m = most_m.max(size_m);
        *most_off_m = most_off_m.max(off_m);
    }
    let found = sizes.into_iter().filter(|(likely, ..)| *likely > 0.0);
    found
        .map(|(likely, size_m, off_m)| (likely, Vector2::new(size_m, 0.0), off_m))
        .collect()
}

/// Curves of a bend at some fractions, and how far each is off its chord between the first and the last at most, m.
pub(super) fn off_chord_m(bend: &Bend, curve: usize, [from, to]: [f64; 2]) -> f64 {
    let inner = bend.fractions().iter().copied();
    let inner = inner.filter(|each| (from..to).contains(each) && *each > from);
    let mut fractions = vec![from];
    fractions.extend(inner);
    fractions.push(to);
    let values: Vec<Vector2<f64>> = fractions.iter().map(|each| bend.at(curve, *each)).collect();
    crate::case::off_chord_m(&fractions, &values)
}
