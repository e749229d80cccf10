//! Motions from the start posture to the pre-entry posture where the straight one is blocked, or comes
//! nearer to anything than it must.
//!
//! A bidirectional rapidly-exploring random tree (RRT-Connect: Kuffner and `LaValle`, 2000) in joint
//! space finds a polygon of straight pieces that keep some clearances, class by class, at all postures looked
//! at; shortcuts then shorten it. Who asks for it certifies the motion and chooses the clearances. One tree grows from the
//! start, the other from all whole-turn images of the goal at once. Everything random comes from a
//! seed, and effort is counted in postures looked at, not in seconds: the same input gives the same
//! motion on any machine.

mod lift;

use needlebench_kinematics::{JOINT_COUNT, JointLimits, Joints};
use needlebench_numerics::random::SplitMix64;

use crate::limits::ByClass;
use crate::motion::MotionChecker;

/// What a search may cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Budget {
    /// Postures that may be looked at.
    pub checks: u64,
}

/// A polygon of free straight pieces, and what it cost.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Found {
    /// From the start to one of the goals.
    pub waypoints: Vec<Joints>,
    /// Which of the goals.
    pub goal: usize,
}

/// Searches motions of one cell.
#[derive(Debug)]
pub(crate) struct TransferSearch<'s> {
    checker: &'s MotionChecker<'s>,
    limits: &'s JointLimits,
    /// Speeds that joints may have, rad/s: what the length of a way is measured by.
    speed: Joints,
    random: SplitMix64,
    budget: Budget,
    /// Required clearances of every posture.
    least_m: ByClass,
    /// Postures looked at so far.
    pub checks: u64,
    /// Random postures drawn so far.
    pub samples: u64,
}

/// Most postures of a tree: searching for the nearest takes time in proportion.
const MOST_NODES: usize = 20_000;
/// Motion of any point by which a tree grows at most in one step, m.
const STEP_M: f64 = 0.5;
/// Part of a step that is tried where all of it is blocked.
const SHORT: f64 = 0.2;
/// Margin around the box of start and goals from which postures are drawn at first, rad, and how
/// much it grows with each posture drawn.
const FIRST_MARGIN_RAD: f64 = 0.6;
const MARGIN_GROWTH_RAD: f64 = 0.01;
/// Attempts to shorten a polygon.
const SHORTCUTS: u32 = 120;

/// A posture of a tree and the one it was reached from.
struct Node {
    position: Joints,
    parent: Option<usize>,
}

/// How far a tree got.
enum Growth {
    Blocked,
    Advanced(usize),
    Reached(usize),
}

impl<'s> TransferSearch<'s> {
    pub fn new(
        checker: &'s MotionChecker<'s>,
        limits: &'s JointLimits,
        speed: Joints,
        seed: u64,
        least_m: ByClass,
        budget: Budget,
    ) -> Self {
        Self {
            checker,
            limits,
            speed,
            random: SplitMix64::new(seed),
            budget,
            least_m,
            checks: 0,
            samples: 0,
        }
    }

    /// A free way from the start to any of the goals, all of which are free postures within the
    /// limits; `None` if the budget runs out first.
    pub fn search(&mut self, start: &Joints, goals: &[Joints]) -> Option<Found> {
        let mut from_start = vec![root(start)];
        let mut from_goals: Vec<Node> = goals.iter().map(root).collect();
        let mut start_grows = true;
        while self.checks < self.budget.checks
            && from_start.len().max(from_goals.len()) < MOST_NODES
        {
            let towards = self.draw(start, goals);
            let (growing, other) = if start_grows {
                (&mut from_start, &mut from_goals)
            } else {
                (&mut from_goals, &mut from_start)
            };
            start_grows = !start_grows;
            let (Growth::Advanced(tip) | Growth::Reached(tip)) = self.extend(growing, &towards)
            else {
                continue;
            };
            let meeting = growing[tip].position;
            if let Some(partner) = self.connect(other, &meeting) {
                // `start_grows` has been switched: the tree that grew is the other one.
                let (of_start, of_goal) = if start_grows {
                    (partner, tip)
                } else {
                    (tip, partner)
                };
                let mut waypoints = way_to_root(&from_start, of_start);
                waypoints.reverse();
                let back = way_to_root(&from_goals, of_goal);
                waypoints.extend_from_slice(&back[1..]);
                let end = waypoints[waypoints.len() - 1];
                let goal = goals.iter().position(|goal| *goal == end)?;
                return Some(Found { waypoints, goal });
            }
        }
        None
    }

    /// A shorter polygon with the same ends: corners cut off and pieces left out where what replaces
    /// them is free and takes less time.
    pub(crate) fn shortened(&mut self, mut waypoints: Vec<Joints>) -> Vec<Joints> {
        self.leave_out(&mut waypoints);
        for _ in 0..SHORTCUTS {
            if waypoints.len() < 3 || self.checks >= self.budget.checks {
                break;
            }
            let lengths: Vec<f64> = waypoints
                .windows(2)
                .map(|pair| self.duration_s(&pair[0], &pair[1]))
                .collect();
            let whole: f64 = lengths.iter().sum();
            let (a, b) = (
                self.random.uniform(0.0, whole),
                self.random.uniform(0.0, whole),
            );
            let (low, from) = place(&waypoints, &lengths, a.min(b));
            let (high, to) = place(&waypoints, &lengths, a.max(b));
            let saved = (b - a).abs() - self.duration_s(&from, &to);
            if low == high || saved < LEAST_SAVING * whole || !self.is_free(&from, &to) {
                continue;
            }
            waypoints.splice(low + 1..=high, [from, to]);
        }
        self.leave_out(&mut waypoints);
        waypoints
    }

    /// The polygon without the waypoints that can be passed by.
    pub(crate) fn straightened(&mut self, mut waypoints: Vec<Joints>) -> Vec<Joints> {
        self.leave_out(&mut waypoints);
        waypoints
    }

    /// Leaves out waypoints that can be passed by, those next to the start first.
    fn leave_out(&mut self, waypoints: &mut Vec<Joints>) {
        let mut first = 0;
        while first + 2 < waypoints.len() {
            let reach = (first + 2..waypoints.len()).rev().find(|&last| {
                let (from, to) = (waypoints[first], waypoints[last]);
                self.checks < self.budget.checks && self.is_free(&from, &to)
            });
            if let Some(last) = reach {
                waypoints.drain(first + 1..last);
            }
            first += 1;
        }
    }

    /// A posture between, or around, start and goals.
    fn draw(&mut self, start: &Joints, goals: &[Joints]) -> Joints {
        self.samples += 1;
        let margin_rad = FIRST_MARGIN_RAD + MARGIN_GROWTH_RAD * self.samples as f64;
        // One goal at a time: the box around images whole turns apart is mostly waste.
        let choice = self
            .random
            .below(u32::try_from(goals.len()).unwrap_or(u32::MAX)) as usize;
        let goal = &goals[choice.min(goals.len() - 1)];
        Joints::from_fn(|joint, _| {
            let limit = self.limits.0[joint];
            let low = (start[joint].min(goal[joint]) - margin_rad).max(limit.lower_rad);
            let high = (start[joint].max(goal[joint]) + margin_rad).min(limit.upper_rad);
            self.random.uniform(low, high)
        })
    }

    fn extend(&mut self, tree: &mut Vec<Node>, towards: &Joints) -> Growth {
        let nearest = self.nearest(tree, towards);
        let from = tree[nearest].position;
        let way_m = self.checker.largest_displacement_m(&from, towards);
        if way_m <= 0.0 {
            return Growth::Reached(nearest);
        }
        let mut reaches = way_m <= STEP_M;
        let mut to = if reaches {
            *towards
        } else {
            from + (towards - from) * (STEP_M / way_m)
        };
        if !self.is_free(&from, &to) {
            // In narrow places a short step may do; a blocked long one shows early and costs little.
            reaches = false;
            to = from + (to - from) * SHORT;
            if !self.is_free(&from, &to) {
                return Growth::Blocked;
            }
        }
        tree.push(Node {
            position: to,
            parent: Some(nearest),
        });
        if reaches {
            Growth::Reached(tree.len() - 1)
        } else {
            Growth::Advanced(tree.len() - 1)
        }
    }

    fn connect(&mut self, tree: &mut Vec<Node>, towards: &Joints) -> Option<usize> {
        loop {
            match self.extend(tree, towards) {
                Growth::Reached(node) => return Some(node),
                Growth::Advanced(_) if self.checks < self.budget.checks => {}
                Growth::Advanced(_) | Growth::Blocked => return None,
            }
        }
    }

    fn nearest(&self, tree: &[Node], to: &Joints) -> usize {
        let mut best = (0, f64::INFINITY);
        for (index, node) in tree.iter().enumerate() {
            let way_m = self.checker.largest_displacement_m(&node.position, to);
            if way_m < best.1 {
                best = (index, way_m);
            }
        }
        best.0
    }

    /// Whether the straight way between two postures is free, its first end excepted.
    fn is_free(&mut self, from: &Joints, to: &Joints) -> bool {
        let (free, checks) = self.checker.keeps_straight(from, to, &self.least_m);
        self.checks += checks;
        free
    }

    /// Time that the slowest joint needs for a straight way at full speed, s.
    fn duration_s(&self, from: &Joints, to: &Joints) -> f64 {
        (0..JOINT_COUNT)
            .map(|i| (to[i] - from[i]).abs() / self.speed[i])
            .fold(0.0, f64::max)
    }
}

/// Share of the whole path that a shortcut must save.
const LEAST_SAVING: f64 = 1e-3;

fn root(position: &Joints) -> Node {
    Node {
        position: *position,
        parent: None,
    }
}

fn way_to_root(tree: &[Node], from: usize) -> Vec<Joints> {
    let mut way = Vec::new();
    let mut at = Some(from);
    while let Some(index) = at {
        way.push(tree[index].position);
        at = tree[index].parent;
    }
    way
}

/// Piece of a polygon and the place on it at a length from its start.
fn place(waypoints: &[Joints], lengths: &[f64], mut at: f64) -> (usize, Joints) {
    for (index, &length) in lengths.iter().enumerate() {
        if at <= length || index + 1 == lengths.len() {
            let share = if length > 0.0 {
                (at / length).min(1.0)
            } else {
                0.0
            };
            let (from, to) = (waypoints[index], waypoints[index + 1]);
            return (index, from + (to - from) * share);
        }
        at -= length;
    }
    unreachable!("a polygon has pieces")
}
