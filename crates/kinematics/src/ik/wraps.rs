//! Whole turns of a posture within joint limits, nearest to a seed first.
//!
//! Adding whole turns to joints moves no link, so that one row of the closed form is up to 64
//! postures of an arm whose joints turn by 360 degrees either way, eight rows are 512, and there is
//! no end of them where wrist 3 turns without end. They are found one by one in the order of their
//! distance, so that whoever needs the nearest pays for the nearest.
//!
//! Every joint has its ladder: the admitted numbers of turns, nearest to the seed first. A node is
//! a rung on each of the six ladders, and its children are one rung further on one ladder, which
//! must not lie before the ladder last climbed. Every node then has one parent, and none comes
//! twice; its distance is never below its parent's, and best first is sorted.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

use crate::limits::{turned, whole};
use crate::{JOINT_COUNT, JointLimits, Joints};

/// A posture with whole turns added.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wrap {
    /// Which of the given postures it is, counted from zero.
    pub posture: usize,
    /// Joint positions, rad, within the limits: the given ones plus whole turns, up to
    /// [`LIMIT_ROUNDING_RAD`](crate::LIMIT_ROUNDING_RAD) at a limit.
    pub joints: Joints,
    /// Turns added to every joint.
    pub turns: [i32; JOINT_COUNT],
    /// Distance from the seed, `sqrt(sum_i w_i (q_i - seed_i)^2)`, rad with weights of one.
    pub distance_rad: f64,
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
        let ladders = Ladders::new(self, 0, *posture)?;
        Some(ladders.wrap(self, &ladders.bottom(self)))
    }

    /// The wraps of a posture, nearest first; see [`WrapSearch::wraps_of_all`].
    pub fn wraps(&self, posture: &Joints) -> Wraps<'a> {
        self.wraps_of_all([*posture])
    }

    /// The wraps of several postures, all eight of a pose say, nearest first.
    ///
    /// Each comes once, in nondecreasing order. Equal distances come in the order of the postures,
    /// then of the turns, first joint first; sums whose difference rounding swallows come in an
    /// order that depends on nothing but the arguments. Wraps of two equal postures are
    /// two. None come from a posture one joint of which has no place in its range, nor if posture
    /// or seed are not finite. An item takes `O(log n)` after `n` of them.
    pub fn wraps_of_all(&self, postures: impl IntoIterator<Item = Joints>) -> Wraps<'a> {
        let ladders: Vec<Ladders> = postures
            .into_iter()
            .enumerate()
            .filter_map(|(index, joints)| Ladders::new(self, index, joints))
            .collect();
        let nodes = ladders.iter().enumerate().map(|(at, each)| {
            Reverse(Node {
                ladders: at,
                ..each.bottom(self)
            })
        });
        Wraps {
            search: *self,
            open: nodes.collect(),
            last: None,
            ladders,
        }
    }
}

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
    ladders: Vec<Ladders>,
    open: BinaryHeap<Reverse<Node>>,
    /// The node given last. Its children wait until they are asked for.
    last: Option<Node>,
}

impl Iterator for Wraps<'_> {
    type Item = Wrap;

    fn next(&mut self) -> Option<Wrap> {
        if let Some(parent) = self.last.take() {
            let ladders = &self.ladders[parent.ladders];
            for joint in usize::from(parent.climbed)..JOINT_COUNT {
                if let Some(child) = ladders.above(&self.search, &parent, joint) {
                    self.open.push(Reverse(child));
                }
            }
        }
        let Reverse(node) = self.open.pop()?;
        self.last = Some(node);
        Some(self.ladders[node.ladders].wrap(&self.search, &node))
    }
}

impl std::iter::FusedIterator for Wraps<'_> {}

/// A posture and the least and most turns that the limits let be added to each joint.
#[derive(Debug, Clone, Copy)]
struct Ladders {
    posture: usize,
    joints: Joints,
    range: [[i32; 2]; JOINT_COUNT],
}

/// One rung on each ladder.
#[derive(Debug, Clone, Copy)]
struct Node {
    /// Orders nodes: the first number, then the second.
    key: [f64; 2],
    /// Index of the ladders.
    ladders: usize,
    turns: [i32; JOINT_COUNT],
    /// Least and most turns of the rungs passed, this one included: a ladder leaves no gaps.
    passed: [[i32; 2]; JOINT_COUNT],
    /// Ladder last climbed.
    climbed: u8,
}

impl Ladders {
    fn new(search: &WrapSearch, posture: usize, joints: Joints) -> Option<Self> {
        if !search.seed.iter().all(|seed| seed.is_finite()) {
            return None;
        }
        let mut range = [[0; 2]; JOINT_COUNT];
        for (i, [least, most]) in range.iter_mut().enumerate() {
            let turns = search.limits.0[i].turns(joints[i])?;
            *least = (*turns.start()).max(-search.max_turns);
            *most = (*turns.end()).min(search.max_turns);
            if least > most {
                return None;
            }
        }
        Some(Self {
            posture,
            joints,
            range,
        })
    }

    fn position(&self, search: &WrapSearch, i: usize, turns: i32) -> f64 {
        let limit = &search.limits.0[i];
        let position = turned(self.joints[i], turns);
        limit
            .admit(position)
            .expect("turns outside the limits are on no ladder")
    }

    /// Weighted square of a joint's way. It does not decrease with the distance of `turns` from the
    /// best ones, rounding included, since every operation in it is monotonic.
    fn cost(&self, search: &WrapSearch, i: usize, turns: i32) -> f64 {
        let way = self.position(search, i, turns) - search.seed[i];
        search.weights[i] * (way * way)
    }

    /// Ordered by the cost of every joint; never below that of costs none of which is more.
    fn key(&self, search: &WrapSearch, turns: &[i32; JOINT_COUNT]) -> [f64; 2] {
        let costs: [f64; JOINT_COUNT] = std::array::from_fn(|i| self.cost(search, i, turns[i]));
        let sum = costs.iter().sum();
        match search.order {
            WrapOrder::Distance => [sum, 0.0],
            WrapOrder::LargestJoint => [costs.into_iter().fold(0.0, f64::max), sum],
        }
    }

    /// The lowest rung of every ladder: the nearest wrap.
    fn bottom(&self, search: &WrapSearch) -> Node {
        let turns = std::array::from_fn(|i| {
            let [least, most] = self.range[i];
            let about = whole(((search.seed[i] - self.joints[i]) / std::f64::consts::TAU).round());
            // The seed may be half a turn off or beyond the range, and the quotient is rounded.
            let about = about.clamp(least, most);
            let cost = |turns| self.cost(search, i, turns);
            let mut best = about;
            if about > least && cost(about - 1) <= cost(best) {
                best = about - 1;
            }
            if about < most && cost(about + 1) < cost(best) {
                best = about + 1;
            }
            best
        });
        Node {
            key: self.key(search, &turns),
            ladders: 0,
            turns,
            passed: turns.map(|turns| [turns, turns]),
            climbed: 0,
        }
    }

    /// One rung further on the ladder of a joint.
    fn above(&self, search: &WrapSearch, node: &Node, joint: usize) -> Option<Node> {
        let [least, most] = self.range[joint];
        let [low, high] = node.passed[joint];
        let mut child = Node {
            climbed: u8::try_from(joint).expect("six joints"),
            ..*node
        };
        let down = match (low > least, high < most) {
            (false, false) => return None,
            (true, true) => self.cost(search, joint, low - 1) <= self.cost(search, joint, high + 1),
            (down, _) => down,
        };
        let passed = &mut child.passed[joint];
        child.turns[joint] = if down {
            passed[0] -= 1;
            passed[0]
        } else {
            passed[1] += 1;
            passed[1]
        };
        child.key = self.key(search, &child.turns);
        Some(child)
    }

    fn wrap(&self, search: &WrapSearch, node: &Node) -> Wrap {
        let [first, sum] = node.key;
        let squared = match search.order {
            WrapOrder::Distance => first,
            WrapOrder::LargestJoint => sum,
        };
        Wrap {
            posture: self.posture,
            joints: Joints::from_fn(|i, _| self.position(search, i, node.turns[i])),
            turns: node.turns,
            distance_rad: squared.sqrt(),
        }
    }
}

impl Ord for Node {
    fn cmp(&self, other: &Self) -> Ordering {
        self.key[0]
            .total_cmp(&other.key[0])
            .then_with(|| self.key[1].total_cmp(&other.key[1]))
            .then_with(|| self.ladders.cmp(&other.ladders))
            .then_with(|| self.turns.cmp(&other.turns))
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
