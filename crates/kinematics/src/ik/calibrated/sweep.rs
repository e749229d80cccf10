//! Every solution of one shoulder, by a sweep over `q2 + q3 + q4`.
//!
//! The values of `q2 + q3 + q4` at which the elbow closes are intervals of a cosine. Elbow up and
//! elbow down meet at the ends of each, so that an interval is a closed loop of postures. Solutions
//! are the zeros of one number along the loops ([`super::chart`]): where it changes its sign between two
//! samples, there is one; where it turns back just before, there may be two.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::super::numerical::{Placed, sin_cos};
use super::chart::{BLOCK, Block, Chart, Lanes};
use crate::{Joints, UrGeometry};

/// Samples of half a loop, a multiple of half a block.
const HALF: usize = 32;
const COUNT: usize = 2 * HALF;

/// Blocks of a loop: each lane walks along a part of it.
const STRIDE: usize = COUNT / BLOCK;

/// Rounds of correction at the first block of a loop, and at each further one.
const FIRST_ROUNDS: u32 = 4;
const ROUNDS: u32 = 2;

/// How often the neighbourhood of a turning point is looked at, and what may be zero there.
const ZOOMS: u32 = 2;
const TOUCHES: f64 = 1e-4;

/// Where samples lie: by the angle at the wrist centre between the shoulder's opposite direction
/// and wrist 1, rad.
#[derive(Debug, Clone, Copy)]
enum Loop {
    /// Both elbows between two ends, where they meet.
    Interval { from: f64, to: f64 },
    /// One elbow, all round.
    Circle { elbow: f64 },
}

/// Sweeps one shoulder and hands a start near every solution to `take`.
///
/// `margin_m` is by how much lengths may differ from the nominal ones.
pub(super) fn sweep(
    chart: &Chart<'_>,
    geometry: &UrGeometry,
    margin_m: f64,
    mut take: impl FnMut(&Joints),
) {
    let centre = chart.centre();
    // Next to the shoulder's singularity lengths move the wrist centre far.
    let squares = 2.0 * geometry.d4.abs() * margin_m;
    if centre.root_squared < -squares {
        return;
    }
    let ahead_of = |root_squared: f64| chart.shoulder * root_squared.max(0.0).sqrt();
    let range = [
        ahead_of(centre.root_squared - squares),
        ahead_of(centre.root_squared + squares),
    ];
    // The opening is the angle of wrist 1 over that of the wrist centre, a quarter turn off.
    let beyond = range.map(|ahead| libm::atan2(centre.up, ahead));
    let straight = 0.5 * (beyond[0] + beyond[1]) - FRAC_PI_2;
    let slack = 0.5 * (beyond[0] - beyond[1]).abs();
    let (straight, slack) = if slack > FRAC_PI_2 {
        // Either side of the cut behind the shoulder.
        (straight + PI, PI - slack)
    } else {
        (straight, slack)
    };
    let straight = if geometry.d5 < 0.0 {
        straight + PI
    } else {
        straight
    };
    let d5 = geometry.d5.abs();
    let longest = (geometry.a2 + geometry.a3).abs() + margin_m;
    let shortest = ((geometry.a2 - geometry.a3).abs() - margin_m).max(0.0);
    let cosine = |length: f64, distance: f64| {
        let span = (2.0 * distance * d5).max(f64::MIN_POSITIVE);
        (length * length - distance * distance - d5 * d5) / span
    };
    let distances = range.map(|ahead| libm::hypot(ahead, centre.up));
    let angle_of = |cosine: f64| {
        let cosine = cosine.clamp(-1.0, 1.0);
        libm::atan2(((1.0 - cosine) * (1.0 + cosine)).sqrt(), cosine)
    };
    // Wrist 1 has to be nearer than the longest and farther than the shortest: openings from
    // `least` to `most`.
    let greatest_cosine = cosine(longest, distances[0]).max(cosine(longest, distances[1]));
    let least_cosine = cosine(shortest, distances[0]).min(cosine(shortest, distances[1]));
    if greatest_cosine < -1.0 || least_cosine > 1.0 {
        return;
    }
    let (least, most) = (
        angle_of(greatest_cosine) - slack,
        angle_of(least_cosine) + slack,
    );
    let loops = match (least <= 0.0, most >= PI) {
        (true, true) => [
            Some(Loop::Circle { elbow: 1.0 }),
            Some(Loop::Circle { elbow: -1.0 }),
        ],
        (true, false) => [
            Some(Loop::Interval {
                from: -most,
                to: most,
            }),
            None,
        ],
        (false, true) => [
            Some(Loop::Interval {
                from: least,
                to: TAU - least,
            }),
            None,
        ],
        (false, false) => [
            Some(Loop::Interval {
                from: least,
                to: most,
            }),
            Some(Loop::Interval {
                from: -most,
                to: -least,
            }),
        ],
    };
    for each in loops.into_iter().flatten() {
        Sweep {
            chart,
            straight,
            each,
        }
        .run(&mut take);
    }
}

struct Sweep<'a> {
    chart: &'a Chart<'a>,
    /// `q2 + q3 + q4` at opening 0, rad.
    straight: f64,
    each: Loop,
}

/// What the loop is like at a place.
#[derive(Debug, Clone, Copy)]
struct Sample {
    askew: f64,
    corrected: Placed<f64>,
}

impl Sweep<'_> {
    /// Settles a block at places `along` the loop, in units of samples.
    fn settle(&self, block: &mut Block, along: &Lanes, rounds: u32) {
        let angles = along.map(|along| along * (PI / HALF as f64));
        let openings = match self.each {
            Loop::Interval { from, to } => {
                let (sines, cosines) = sin_cos(&angles);
                block.elbow = sines.map(|sine| 1.0_f64.copysign(sine));
                let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
                cosines.map(|cosine| middle - half * cosine)
            }
            Loop::Circle { elbow } => {
                block.elbow = [elbow; BLOCK];
                angles
            }
        };
        (block.sin_234, block.cos_234) = sin_cos(&openings.map(|opening| self.straight + opening));
        self.chart.settle(block, rounds);
    }

    fn run(&self, take: &mut impl FnMut(&Joints)) {
        let blank = Sample {
            askew: 0.0,
            corrected: self.chart.wanted,
        };
        let mut samples = [blank; COUNT];
        let mut block = Block::near(&self.chart.wanted);
        for step in 0..STRIDE {
            let along = std::array::from_fn(|lane| (lane * STRIDE + step) as f64);
            let rounds = if step == 0 { FIRST_ROUNDS } else { ROUNDS };
            self.settle(&mut block, &along, rounds);
            for lane in 0..BLOCK {
                samples[lane * STRIDE + step] = Sample {
                    askew: block.askew[lane],
                    corrected: block.corrected(lane),
                };
            }
        }
        for i in 0..COUNT {
            let (here, next) = (&samples[i], &samples[(i + 1) % COUNT]);
            let at = i as f64;
            if (here.askew < 0.0) == (next.askew < 0.0) {
                let before = &samples[(i + COUNT - 1) % COUNT];
                let turns = (before.askew < 0.0) == (here.askew < 0.0)
                    && here.askew.abs() <= before.askew.abs()
                    && here.askew.abs() < next.askew.abs();
                if turns {
                    let ends = [before.askew, next.askew];
                    self.turning(here, at, 1.0, ends, ZOOMS, take);
                }
            } else {
                self.bracketed(
                    &here.corrected,
                    (at, here.askew),
                    (at + 1.0, next.askew),
                    take,
                );
            }
        }
    }

    /// Where the number may turn back beyond zero, within `step` of a place between two `ends` of
    /// its sign.
    fn turning(
        &self,
        middle: &Sample,
        at: f64,
        step: f64,
        ends: [f64; 2],
        zooms: u32,
        take: &mut impl FnMut(&Joints),
    ) {
        const SHARES: Lanes = [-0.8, -0.6, -0.4, -0.2, 0.2, 0.4, 0.6, 0.8];
        const HALF_BLOCK: usize = BLOCK / 2;
        let mut block = Block::near(&middle.corrected);
        let along = SHARES.map(|share| at + share * step);
        self.settle(&mut block, &along, ROUNDS);
        // With the ends and the middle.
        let mut row = [(at, middle.askew); BLOCK + 3];
        row[0] = (at - step, ends[0]);
        row[BLOCK + 2] = (at + step, ends[1]);
        for (lane, sample) in along.into_iter().zip(block.askew).enumerate() {
            row[lane + if lane < HALF_BLOCK { 1 } else { 2 }] = sample;
        }
        let mut crosses = false;
        for pair in row.windows(2) {
            if (pair[0].1 < 0.0) != (pair[1].1 < 0.0) {
                crosses = true;
                self.bracketed(&middle.corrected, pair[0], pair[1], take);
            }
        }
        if crosses {
            return;
        }
        let lowest = (1..BLOCK + 2)
            .min_by(|&i, &j| row[i].1.abs().total_cmp(&row[j].1.abs()))
            .unwrap_or(HALF_BLOCK + 1);
        if zooms > 1 {
            let nearest = Sample {
                askew: row[lowest].1,
                corrected: middle.corrected,
            };
            let ends = [row[lowest - 1].1, row[lowest + 1].1];
            self.turning(&nearest, row[lowest].0, 0.2 * step, ends, zooms - 1, take);
        } else if row[lowest].1.abs() < TOUCHES {
            self.settle(&mut block, &[row[lowest].0; BLOCK], ROUNDS);
            take(&block.joints(0));
        }
    }

    /// The zeros between two places: the number changes its sign.
    fn bracketed(
        &self,
        near: &Placed<f64>,
        low: (f64, f64),
        high: (f64, f64),
        take: &mut impl FnMut(&Joints),
    ) {
        let mut block = Block::near(near);
        let part = (high.0 - low.0) / (BLOCK + 1) as f64;
        let along = std::array::from_fn(|lane| low.0 + part * (lane + 1) as f64);
        self.settle(&mut block, &along, ROUNDS);
        let mut before = low;
        let mut zeros = [0.0; BLOCK];
        let mut count = 0;
        for here in along.into_iter().zip(block.askew).chain([high]) {
            if (before.1 < 0.0) != (here.1 < 0.0) && count < BLOCK {
                let share = before.1 / (before.1 - here.1);
                zeros[count] = before.0 + share * (here.0 - before.0);
                count += 1;
            }
            before = here;
        }
        for lane in count..BLOCK {
            zeros[lane] = zeros[0];
        }
        let mut block = Block::near(near);
        self.settle(&mut block, &zeros, ROUNDS);
        for lane in 0..count {
            take(&block.joints(lane));
        }
    }
}
