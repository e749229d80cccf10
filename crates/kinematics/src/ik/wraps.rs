//! 2π equivalents (wraps) of a posture within joint limits, nearest to a seed first.
//!
//! A full revolution of a joint moves no link. So one solution of the closed form has up to 64 2π equivalents
//! on an arm whose joints turn by 360 degrees either way, eight solutions have 512, and there are infinitely
//! many where wrist 3 is unlimited. They are found one by one in the order of their distance, so that the
//! nearest one is found without the others.
//!
//! Every joint has its ladder: the admitted numbers of turns, nearest to the seed first. A node is
//! a rung on each of the six ladders, and its children are one rung further on one ladder, which
//! must not lie before any ladder climbed. Every node then has one parent, so that none comes
//! twice; no node comes before its parent in the order, so that best first is sorted.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;
use std::f64::consts::TAU;

use crate::limits::{nearest_whole, turned};
use crate::{JOINT_COUNT, JointLimits, Joints};

/// A 2π equivalent of a posture: full revolutions added to its joints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wrap {
    /// Which of the given postures it is, counted from zero.
    pub posture: usize,
    /// Joint positions, rad, within the limits: the given ones plus full revolutions, up to
    /// [`LIMIT_ROUNDING_RAD`](crate::LIMIT_ROUNDING_RAD) at a limit.
    pub joints: Joints,
    /// Turns added to every joint.
    pub turns: [i32; JOINT_COUNT],
    /// Distance from the seed, `sqrt(sum_i w_i (q_i - seed_i)^2)`, rad with weights of one.
    pub distance_rad: f64,
}

impl Wrap {
    fn of(posture: usize, rungs: [&Rung; JOINT_COUNT]) -> Self {
        Self {
            posture,
            joints: Joints::from(rungs.map(|rung| rung.position_rad)),
            turns: rungs.map(|rung| rung.turns),
            distance_rad: rungs.map(|rung| rung.cost).iter().sum::<f64>().sqrt(),
        }
    }
}

/// What "near" means.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum WrapOrder {
    /// By [`Wrap::distance_rad`].
    #[default]
    Distance,
    /// By the largest `w_i (q_i - seed_i)^2` of any joint, then by distance: with weights
    /// `1 / speed_i^2` the joint that takes longest decides, as it does for the time of a motion.
    LargestJoint,
}

/// A weight that orders nothing.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("the weight of {} is {weight}: it must be positive and finite", crate::JOINT_LABELS[*.joint])]
pub struct InvalidWeight {
    /// Index of the joint.
    pub joint: usize,
    /// Its weight as given.
    pub weight: f64,
}

/// Where to look for wraps, and from where.
#[derive(Debug, Clone, Copy)]
pub struct WrapSearch<'a> {
    limits: &'a JointLimits,
    seed: Joints,
    weights: Joints,
    max_turns: i32,
    order: WrapOrder,
}

impl<'a> WrapSearch<'a> {
    /// All wraps within the limits, by their distance from the seed, all joints weighing the same.
    pub fn new(limits: &'a JointLimits, seed: &Joints) -> Self {
        Self {
            limits,
            seed: *seed,
            weights: Joints::repeat(1.0),
            max_turns: crate::MAX_TURNS,
            order: WrapOrder::Distance,
        }
    }

    /// The same with one weight per joint.
    ///
    /// # Errors
    /// [`InvalidWeight`] unless all are positive and finite.
    pub fn weighted(self, weights: &Joints) -> Result<Self, InvalidWeight> {
        let valid = |weight: f64| weight > 0.0 && weight.is_finite();
        match (0..JOINT_COUNT).find(|&joint| !valid(weights[joint])) {
            Some(joint) => Err(InvalidWeight {
                joint,
                weight: weights[joint],
            }),
            None => Ok(Self {
                weights: *weights,
                ..self
            }),
        }
    }

    /// The same with at most so many turns added to a joint either way, which makes the wraps of an
    /// unlimited joint finitely many.
    pub fn at_most_turns(self, turns: u32) -> Self {
        Self {
            max_turns: i32::try_from(turns).map_or(self.max_turns, |n| n.min(self.max_turns)),
            ..self
        }
    }

    /// The same in another order.
    pub fn ordered_by(self, order: WrapOrder) -> Self {
        Self { order, ..self }
    }

    /// The nearest wrap of a posture: the first that [`WrapSearch::wraps`] gives, without the rest.
    ///
    /// `None` where a joint has no place in its range, and if posture or seed are not finite.
    pub fn nearest(&self, posture: &Joints) -> Option<Wrap> {
        let rungs = self.bottom(posture)?;
        Some(Wrap::of(0, rungs.each_ref()))
    }

    /// The wraps of a posture, nearest first; see [`WrapSearch::wraps_of_all`].
    pub fn wraps(&self, posture: &Joints) -> Wraps<'a> {
        self.wraps_of_all([*posture])
    }

    /// The wraps of several postures, all eight of a pose say, nearest first.
    ///
    /// Each comes once, in nondecreasing order. Of equal ones the earlier posture comes first, then
    /// that whose first joints are nearer to the seed, then that of lower turns. Wraps of two equal
    /// postures are two. None come from a posture one joint of which has no place in its range, nor
    /// if posture or seed are not finite. An item takes `O(log n)` after `n` of them.
    pub fn wraps_of_all(&self, postures: impl IntoIterator<Item = Joints>) -> Wraps<'a> {
        let mut wraps = Wraps {
            search: *self,
            starts: Vec::new(),
            rungs: Vec::new(),
            open: BinaryHeap::new(),
            last: None,
        };
        for (index, joints) in postures.into_iter().enumerate() {
            if let Some(bottom) = self.bottom(&joints) {
                wraps.start(index, joints, bottom);
            }
        }
        wraps
    }

    /// The lowest rung of every ladder: the nearest wrap.
    fn bottom(&self, posture: &Joints) -> Option<[Rung; JOINT_COUNT]> {
        let mut rungs = [Rung::BLANK; JOINT_COUNT];
        for (i, rung) in rungs.iter_mut().enumerate() {
            *rung = self.lowest(i, posture[i])?;
        }
        Some(rungs)
    }

    fn lowest(&self, i: usize, position_rad: f64) -> Option<Rung> {
        let about = nearest_whole((self.seed[i] - position_rad) * (1.0 / TAU));
        if let Some(rung) = self.rung(i, position_rad, about)
            && (rung.position_rad - self.seed[i]).abs() < CLEARLY_NEAREST_RAD
        {
            return Some(rung);
        }
        // The seed is beyond the range, or half a turn off, or nothing is finite.
        if !self.seed[i].is_finite() {
            return None;
        }
        let range = self.limits.0[i].turns(position_rad)?;
        let least = (*range.start()).max(-self.max_turns);
        let most = (*range.end()).min(self.max_turns);
        if least > most {
            return None;
        }
        let about = about.clamp(least, most);
        (about - 1..=about + 1)
            .filter_map(|turns| self.rung(i, position_rad, turns))
            .min_by(|a, b| a.cost.total_cmp(&b.cost))
    }

    /// A number of turns of a joint, if it is admitted.
    ///
    /// The cost does not decrease with the distance of `turns` from the best ones, rounding
    /// included, since every operation in it is monotonic.
    fn rung(&self, i: usize, position_rad: f64, turns: i32) -> Option<Rung> {
        if turns.abs() > self.max_turns {
            return None;
        }
        let position_rad = self.limits.0[i].admit(turned(position_rad, turns))?;
        let way_rad = position_rad - self.seed[i];
        Some(Rung {
            position_rad,
            cost: self.weights[i] * (way_rad * way_rad),
            turns,
            passed: [turns, turns],
            next: Next::Unknown,
        })
    }

    /// What orders nodes: the first number, then the second. No less than that of costs of which
    /// none is more.
    fn key(&self, costs: [f64; JOINT_COUNT]) -> [f64; 2] {
        let sum = costs.iter().sum();
        match self.order {
            WrapOrder::Distance => [sum, 0.0],
            WrapOrder::LargestJoint => [costs.into_iter().fold(0.0, f64::max), sum],
        }
    }
}

/// A joint nearer than this to its seed, rad, is nearer than with any other number of turns: less
/// than half a turn by more than any rounding.
const CLEARLY_NEAREST_RAD: f64 = 3.0;

/// The nearest wrap of a posture within the limits, all joints weighing the same; see
/// [`WrapSearch::nearest`].
pub fn nearest_within_limits(
    posture: &Joints,
    limits: &JointLimits,
    seed: &Joints,
) -> Option<Wrap> {
    WrapSearch::new(limits, seed).nearest(posture)
}

/// Wraps of one or more postures, nearest first; from [`WrapSearch::wraps_of_all`].
#[derive(Debug, Clone)]
pub struct Wraps<'a> {
    search: WrapSearch<'a>,
    /// The postures that have wraps, with their places among those given.
    starts: Vec<(usize, Joints)>,
    /// All rungs reached: the lowest ones of the first start, of the second and so on, then others
    /// in the order of their discovery.
    rungs: Vec<Rung>,
    open: BinaryHeap<Reverse<Node>>,
    /// The node given last. Its children wait until they are asked for.
    last: Option<Node>,
}

/// A number of turns of one joint of one posture.
#[derive(Debug, Clone, Copy)]
struct Rung {
    position_rad: f64,
    /// Weighted square of the way from the seed.
    cost: f64,
    turns: i32,
    /// Least and most turns of the rungs below, this one included: a ladder leaves no gaps.
    passed: [i32; 2],
    next: Next,
}

impl Rung {
    /// A place to write to.
    const BLANK: Self = Self {
        position_rad: 0.0,
        cost: 0.0,
        turns: 0,
        passed: [0, 0],
        next: Next::Unknown,
    };
}

/// The next rung of a ladder.
#[derive(Debug, Clone, Copy)]
enum Next {
    Unknown,
    End,
    At(u32),
}

/// One rung on each ladder.
#[derive(Debug, Clone, Copy)]
struct Node {
    key: [f64; 2],
    /// Index of the posture among the starts.
    start: u32,
    /// Indices of the rungs, which increase along a ladder.
    rungs: [u32; JOINT_COUNT],
}

impl Iterator for Wraps<'_> {
    type Item = Wrap;

    fn next(&mut self) -> Option<Wrap> {
        if let Some(parent) = self.last.take() {
            self.open_children(&parent);
        }
        let Reverse(node) = self.open.pop()?;
        self.last = Some(node);
        let (posture, _) = self.starts[node.start as usize];
        let rungs = node.rungs.map(|at| &self.rungs[at as usize]);
        Some(Wrap::of(posture, rungs))
    }
}

impl std::iter::FusedIterator for Wraps<'_> {}

impl Wraps<'_> {
    fn start(&mut self, index: usize, joints: Joints, bottom: [Rung; JOINT_COUNT]) {
        let first = id(self.rungs.len());
        let node = Node {
            key: self.search.key(bottom.map(|rung| rung.cost)),
            start: id(self.starts.len()),
            rungs: std::array::from_fn(|i| first + id(i)),
        };
        self.starts.push((index, joints));
        self.rungs.extend(bottom);
        self.open.push(Reverse(node));
    }

    fn open_children(&mut self, parent: &Node) {
        let lowest_rungs = id(JOINT_COUNT * self.starts.len());
        let climbed = parent.rungs.iter().rposition(|&at| at >= lowest_rungs);
        let mut costs = parent.rungs.map(|at| self.rungs[at as usize].cost);
        for joint in climbed.unwrap_or(0)..JOINT_COUNT {
            let Some(next) = self.above(parent, joint) else {
                continue;
            };
            let cost = std::mem::replace(&mut costs[joint], self.rungs[next as usize].cost);
            let mut child = Node {
                key: self.search.key(costs),
                ..*parent
            };
            child.rungs[joint] = next;
            costs[joint] = cost;
            self.open.push(Reverse(child));
        }
    }

    /// One rung further on the ladder of a joint.
    fn above(&mut self, node: &Node, joint: usize) -> Option<u32> {
        let at = node.rungs[joint] as usize;
        match self.rungs[at].next {
            Next::At(next) => return Some(next),
            Next::End => return None,
            Next::Unknown => {}
        }
        let position_rad = self.starts[node.start as usize].1[joint];
        let [low, high] = self.rungs[at].passed;
        let down = self.search.rung(joint, position_rad, low - 1);
        let up = self.search.rung(joint, position_rad, high + 1);
        let found = match (down, up) {
            (Some(down), Some(up)) if up.cost < down.cost => Some(up),
            (Some(down), _) => Some(down),
            (None, up) => up,
        };
        let Some(rung) = found else {
            self.rungs[at].next = Next::End;
            return None;
        };
        let next = id(self.rungs.len());
        self.rungs[at].next = Next::At(next);
        self.rungs.push(Rung {
            passed: [low.min(rung.turns), high.max(rung.turns)],
            ..rung
        });
        Some(next)
    }
}

fn id(index: usize) -> u32 {
    u32::try_from(index).expect("memory ends before four thousand million rungs")
}

impl Ord for Node {
    fn cmp(&self, other: &Self) -> Ordering {
        self.key[0]
            .total_cmp(&other.key[0])
            .then_with(|| self.key[1].total_cmp(&other.key[1]))
            .then_with(|| self.start.cmp(&other.start))
            .then_with(|| self.rungs.cmp(&other.rungs))
    }
}

impl PartialOrd for Node {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Node {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Node {}
