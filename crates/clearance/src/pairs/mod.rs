//! Every pair of bodies of a cell with what becomes of it, and the evidence.
//!
//! Nothing is left out on trust. A pair that shares a joint or is bolted together is left out by
//! how the cell is built; that a pair can never touch is *proven* over the whole joint ranges
//! ([`RangeBound`]) and not concluded from random postures; and a pair that can never touch is
//! still measured, because its distance may be the least of its class.

mod range;

use std::ops::Range;

use needlebench_cell::{
    BodyPair, Cell, ClearanceClass, LeftOut, PairRule, pair_rule, place_in_chain,
};
use needlebench_kinematics::Joints;
use needlebench_numerics::random::SplitMix64;
use serde::Serialize;

use crate::ClearanceModel;
pub use range::RangeBound;
use range::{Extreme, PairRange, one_turn};

/// How pairs are examined.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairSettings {
    /// Random postures within the joint limits, of one turn where a joint has more.
    pub samples: usize,
    /// Seed of the postures.
    pub seed: u64,
    /// A proof ends when it knows the least distance to this, m.
    pub tolerance_m: f64,
    /// A proof gives up after as many boxes of joint positions.
    pub boxes: usize,
    /// No proof is tried with more joints than this between the bodies: boxes grow with the power.
    pub joints: usize,
}

impl Default for PairSettings {
    fn default() -> Self {
        Self {
            samples: 2000,
            seed: 1,
            tolerance_m: 1e-3,
            boxes: 100_000,
            joints: 3,
        }
    }
}

/// What becomes of a pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PairState {
    /// Left out: both stand in the world, or are bolted together.
    Fixed,
    /// Left out: they share a joint.
    Adjacent,
    /// Measured, but proven never to touch.
    Never,
    /// Measured, and in collision at every posture looked at: no posture of this model is free.
    Always,
    /// Measured.
    Checked,
}

impl PairState {
    /// Name as in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fixed => "fixed",
            Self::Adjacent => "adjacent",
            Self::Never => "never",
            Self::Always => "always",
            Self::Checked => "checked",
        }
    }

    /// Whether the pair's distance is measured.
    pub fn is_measured(self) -> bool {
        !matches!(self, Self::Fixed | Self::Adjacent)
    }
}

/// What should not be as it is: a flaw of the model rather than of a posture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PairConcern {
    /// Bodies that do not share a joint overlap at every posture.
    AlwaysInCollision,
    /// Links that share a joint touch at some of its angles and not at others: real collisions
    /// of this pair go unseen.
    LeftOutButDependsOnPosture,
}

/// A pair of bodies and what is known of it.
#[derive(Debug, Clone, PartialEq)]
pub struct PairExamination {
    /// Index into [`Cell::bodies`]; the body that is further from the base.
    pub a: usize,
    /// Index into [`Cell::bodies`].
    pub b: usize,
    /// The class that its distance counts for; `None` if it is not measured.
    pub class: Option<ClearanceClass>,
    /// What becomes of it.
    pub state: PairState,
    /// Joints that move one against the other.
    pub joints: Range<usize>,
    /// Least distance over the random postures, m.
    pub least_m: f64,
    /// Where it was.
    pub least_at: Joints,
    /// Share of the random postures at which the two overlap, 0 to 1.
    pub collision_rate: f64,
    /// Bounds of the least distance over all joint positions; `None` if no proof was tried.
    pub nearest: Option<RangeBound>,
    /// Bounds of the largest distance, for pairs that overlap at every random posture and for
    /// links that share a joint.
    pub farthest: Option<RangeBound>,
}

impl PairExamination {
    /// What is wrong with the model, if anything is.
    pub fn concern(&self) -> Option<PairConcern> {
        let sometimes = self.collision_rate > 0.0 && self.collision_rate < 1.0;
        match self.state {
            PairState::Always => Some(PairConcern::AlwaysInCollision),
            PairState::Adjacent if sometimes => Some(PairConcern::LeftOutButDependsOnPosture),
            _ => None,
        }
    }
}

/// Least distance and share of collisions over random postures.
#[derive(Debug, Clone, Copy)]
struct Sampled {
    least_m: f64,
    least_at: Joints,
    collisions: usize,
}

/// Examines all pairs of bodies, in the order of [`Cell::bodies`].
///
/// The same cell and settings give the same answer. Distances are those of [`ClearanceModel`].
pub fn examine_pairs(cell: &Cell, settings: &PairSettings) -> Vec<PairExamination> {
    let every = every_pair(cell);
    let sampled = sample(cell, &every, settings);
    every
        .iter()
        .zip(sampled)
        .map(|(pair, sampled)| examine(cell, *pair, &sampled, settings))
        .collect()
}

/// All pairs but a person and the space for the hand, `a` being the one further from the base.
fn every_pair(cell: &Cell) -> Vec<BodyPair> {
    let mut every = Vec::new();
    for i in 0..cell.bodies.len() {
        for j in i + 1..cell.bodies.len() {
            if pair_rule(&cell.bodies[i], &cell.bodies[j]) == PairRule::LeftOut(LeftOut::Hand) {
                continue;
            }
            let place = |body: usize| place_in_chain(cell.bodies[body].frame);
            let (a, b) = if place(i) >= place(j) { (i, j) } else { (j, i) };
            every.push(BodyPair {
                a,
                b,
                // Of no meaning where the pair is left out; the model needs one.
                class: class_of(cell, i, j).unwrap_or(ClearanceClass::SelfCollision),
            });
        }
    }
    every
}

fn class_of(cell: &Cell, a: usize, b: usize) -> Option<ClearanceClass> {
    match pair_rule(&cell.bodies[a], &cell.bodies[b]) {
        PairRule::Measured(class) => Some(class),
        PairRule::LeftOut(_) => None,
    }
}

fn sample(cell: &Cell, every: &[BodyPair], settings: &PairSettings) -> Vec<Sampled> {
    let model = ClearanceModel::new(&Cell {
        pairs: every.to_vec(),
        ..cell.clone()
    });
    let ranges = cell.robot.limits.0.each_ref().map(one_turn);
    let mut random = SplitMix64::new(settings.seed);
    let mut found = vec![
        Sampled {
            least_m: f64::INFINITY,
            least_at: Joints::zeros(),
            collisions: 0,
        };
        every.len()
    ];
    for _ in 0..settings.samples.max(1) {
        let q = Joints::from_fn(|i, _| random.uniform(ranges[i][0], ranges[i][1]));
        for (known, seen) in found.iter_mut().zip(model.all_pairs(&q)) {
            let distance_m = seen.separation.distance_m;
            known.collisions += usize::from(distance_m < 0.0);
            if distance_m < known.least_m {
                known.least_m = distance_m;
                known.least_at = q;
            }
        }
    }
    found
}

fn examine(
    cell: &Cell,
    pair: BodyPair,
    sampled: &Sampled,
    settings: &PairSettings,
) -> PairExamination {
    let BodyPair { a, b, .. } = pair;
    let rule = pair_rule(&cell.bodies[a], &cell.bodies[b]);
    let joints = place_in_chain(cell.bodies[b].frame)..place_in_chain(cell.bodies[a].frame);
    let samples = settings.samples.max(1);
    let always = sampled.collisions == samples;
    let adjacent = rule == PairRule::LeftOut(LeftOut::Adjacent);
    let mut nearest = None;
    let mut farthest = None;
    if joints.is_empty() {
        let constant = RangeBound::of_constant(sampled.least_m);
        nearest = Some(constant);
        farthest = Some(constant);
    } else if joints.len() <= settings.joints {
        let range = PairRange::new(cell, pair, joints.clone());
        // What random postures show to touch needs no proof that it does not.
        if adjacent || sampled.collisions == 0 {
            nearest = Some(range.bound(Extreme::Nearest, settings));
        }
        if adjacent || always {
            farthest = Some(range.bound(Extreme::Farthest, settings));
        }
    }
    let apart = nearest.is_some_and(|bound| bound.lower_m > 0.0);
    let state = match rule {
        PairRule::LeftOut(LeftOut::Fixed | LeftOut::Hand) => PairState::Fixed,
        PairRule::LeftOut(LeftOut::Adjacent) => PairState::Adjacent,
        PairRule::Measured(_) if always => PairState::Always,
        PairRule::Measured(_) if apart => PairState::Never,
        PairRule::Measured(_) => PairState::Checked,
    };
    PairExamination {
        a,
        b,
        class: class_of(cell, a, b),
        state,
        joints,
        least_m: sampled.least_m,
        least_at: sampled.least_at,
        collision_rate: sampled.collisions as f64 / samples as f64,
        nearest,
        farthest,
    }
}
