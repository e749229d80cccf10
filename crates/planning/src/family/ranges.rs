//! Connected ranges of roll in which a configuration works, and the best roll of each.

use std::f64::consts::TAU;

use needlebench_cell::Goal;
use needlebench_kinematics::ik::{Configuration, wrap_angle};
use needlebench_kinematics::{JOINT_COUNT, Joints};

use super::{Aim, Member, Merit, Sweep};
use crate::Rejection;
use crate::planner::Planner;

/// Where a range ends.
#[derive(Debug, Clone, PartialEq)]
pub struct Edge {
    /// First roll found outside, at most [`EDGE_RAD`] from the last one inside, rad.
    pub roll_rad: f64,
    /// The first rule that is broken there.
    pub rejection: Rejection,
}

/// Best member of a range.
#[derive(Debug, Clone, PartialEq)]
pub struct Best {
    /// What it is best at.
    pub aim: Aim,
    /// Its value ([`Planner::value`]).
    pub value: f64,
    /// The member; it works.
    pub member: Member,
}

/// Rolls in a row at which a configuration works.
#[derive(Debug, Clone, PartialEq)]
pub struct RollRange {
    /// First roll that works, rad, in `[0, 2 pi)`.
    pub from_rad: f64,
    /// Last one, rad; not below the first, and above `2 pi` where the range runs through zero.
    pub to_rad: f64,
    /// The whole circle: there are no edges.
    pub is_whole_circle: bool,
    /// Why it begins where it does; `None` for a whole circle and for a fixed roll.
    pub before: Option<Edge>,
    /// Why it ends where it does.
    pub after: Option<Edge>,
    /// The best member for each aim, in the order of [`Aim::ALL`].
    pub best: Vec<Best>,
    /// How far each joint turns on the way from one end to the other, largest position less
    /// smallest, rad.
    pub joint_span_rad: Joints,
    /// The guide can be turned from one end to the other without leaving the joint ranges, with the
    /// right whole turns at the start.
    pub fits_joint_limits: bool,
}

impl RollRange {
    /// Width, rad.
    pub fn width_rad(&self) -> f64 {
        if self.is_whole_circle {
            TAU
        } else {
            self.to_rad - self.from_rad
        }
    }

    /// The best member for an aim.
    pub fn best_for(&self, aim: Aim) -> &Best {
        self.best
            .iter()
            .find(|best| best.aim == aim)
            .expect("a range has a best member for every aim")
    }
}

/// One configuration over all rolls.
#[derive(Debug, Clone, PartialEq)]
pub struct Family {
    /// Which of the eight.
    pub configuration: Configuration,
    /// Ranges that work, from roll zero upwards.
    pub ranges: Vec<RollRange>,
}

/// Width within which an edge is located, rad: 0.01 degrees.
pub const EDGE_RAD: f64 = 1.745e-4;
/// Steps of a golden-section search: each leaves 0.618 of the interval.
const SEARCH_STEPS: u32 = 9;
/// A local extreme of the surplus is searched where it is nearer to zero than this many times the
/// rise to its neighbours.
const CLOSER_LOOK: f64 = 2.0;

/// A member of the sweep with its place on the unrolled circle.
struct Knot {
    roll_rad: f64,
    member: Member,
}

impl Planner<'_> {
    /// Ranges of one configuration from its members on an even grid of rolls, in ascending order
    /// from 0; or from the one member of a goal with a fixed roll.
    pub fn family(&self, goal: &Goal, configuration: Configuration, grid: &[Member]) -> Family {
        self.family_for(goal, configuration, grid, &Aim::ALL)
    }

    /// [`Planner::family`] with the best members for some aims alone.
    pub(crate) fn family_for(
        &self,
        goal: &Goal,
        configuration: Configuration,
        grid: &[Member],
        aims: &[Aim],
    ) -> Family {
        let mut sweep = Sweep::new(self, goal, configuration);
        let empty = Family {
            configuration,
            ranges: Vec::new(),
        };
        if let [only] = grid {
            let knots = [Knot {
                roll_rad: only.roll_rad,
                member: only.clone(),
            }];
            let ranges = if only.works() {
                vec![self.range(goal, &mut sweep, &knots, None, None, aims)]
            } else {
                Vec::new()
            };
            return Family { ranges, ..empty };
        }
        let knots = closer_look(grid, &mut sweep);
        if knots.iter().all(|knot| knot.member.works()) {
            let mut range = self.range(goal, &mut sweep, &knots, None, None, aims);
            range.is_whole_circle = true;
            range.to_rad = range.from_rad + TAU;
            return Family {
                ranges: vec![range],
                ..empty
            };
        }
        // Begin behind a knot that does not work, so that no range is cut at roll zero.
        let Some(first) = knots.iter().position(|knot| !knot.member.works()) else {
            return empty;
        };
        let count = knots.len();
        let turned: Vec<Knot> = (0..=count)
            .map(|k| {
                let knot = &knots[(first + k) % count];
                let turns = f64::from(u8::from(first + k >= count));
                Knot {
                    roll_rad: knot.roll_rad + turns * TAU,
                    member: knot.member.clone(),
                }
            })
            .collect();
        let mut ranges = Vec::new();
        let mut begin = None;
        for k in 1..turned.len() {
            match (turned[k - 1].member.works(), turned[k].member.works()) {
                (false, true) => begin = Some(k),
                (true, false) => {
                    let from = begin.take().unwrap_or(1);
                    let (low, before) = bisect(&turned[from], &turned[from - 1], &mut sweep);
                    let (high, after) = bisect(&turned[k - 1], &turned[k], &mut sweep);
                    let mut inside = Vec::with_capacity(k - from + 2);
                    inside.extend(low);
                    inside.extend(turned[from..k].iter().map(|knot| Knot {
                        roll_rad: knot.roll_rad,
                        member: knot.member.clone(),
                    }));
                    inside.extend(high);
                    ranges.push(self.range(
                        goal,
                        &mut sweep,
                        &inside,
                        Some(before),
                        Some(after),
                        aims,
                    ));
                }
                _ => {}
            }
        }
        for range in &mut ranges {
            let turns = (range.from_rad / TAU).floor() * TAU;
            range.from_rad -= turns;
            range.to_rad -= turns;
        }
        ranges.sort_by(|a, b| a.from_rad.total_cmp(&b.from_rad));
        Family { ranges, ..empty }
    }

    /// A range from all its members in ascending order, which all work.
    fn range(
        &self,
        goal: &Goal,
        sweep: &mut Sweep<'_>,
        knots: &[Knot],
        before: Option<Edge>,
        after: Option<Edge>,
        aims: &[Aim],
    ) -> RollRange {
        let whole = before.is_none() && knots.len() > 1;
        let (from_rad, to_rad) = (knots[0].roll_rad, knots[knots.len() - 1].roll_rad);
        let best = aims
            .iter()
            .map(|aim| self.best(goal, sweep, knots, whole, *aim))
            .collect();
        let (low, high) = joint_extent(knots);
        let limits = &self.cell().robot.limits;
        let fits_joint_limits = (0..JOINT_COUNT).all(|joint| {
            let limit = limits.0[joint];
            limit.turns(low[joint]).is_some_and(|mut turns| {
                turns.any(|k| high[joint] + TAU * f64::from(k) <= limit.upper_rad)
            })
        });
        RollRange {
            from_rad,
            to_rad,
            is_whole_circle: false,
            before,
            after,
            best,
            joint_span_rad: high - low,
            fits_joint_limits,
        }
    }

    /// The best knot, refined between its neighbours; where even that falls short of what will be judged,
    /// the best of all knots that are better than their neighbours, each refined.
    fn best(
        &self,
        goal: &Goal,
        sweep: &mut Sweep<'_>,
        knots: &[Knot],
        whole: bool,
        aim: Aim,
    ) -> Best {
        let merit = |member: &Member| match &member.candidate {
            Some(candidate) if member.works() => self.merit(goal, aim, candidate),
            _ => Merit::NONE,
        };
        let merits: Vec<Merit> = knots.iter().map(|knot| merit(&knot.member)).collect();
        let last = knots.len() - 1;
        let roll = |k: usize| knots[k].roll_rad;
        let mut peaks: Vec<usize> = (0..knots.len())
            .filter(|&k| {
                let (before, after) = match (k, whole) {
                    (0, true) => (last, 1.min(last)),
                    (k, true) if k == last => (last - 1, 0),
                    (k, _) => (k.saturating_sub(1), (k + 1).min(last)),
                };
                merits[k] >= merits[before] && merits[k] >= merits[after]
            })
            .collect();
        // Equal ones stay in the order of roll.
        peaks.sort_by(|&a, &b| merits[a].better_first(&merits[b]));
        let first = peaks.first().copied().unwrap_or(0);
        let (mut most, mut better_rad) = (merits[first], None);
        for index in peaks {
            let (low, high) = match (index, whole) {
                (0, true) => (roll(last) - TAU, roll(1)),
                (k, true) if k == last => (roll(last - 1), roll(0) + TAU),
                (k, _) => (roll(k.saturating_sub(1)), roll((k + 1).min(last))),
            };
            golden(low, high, |roll_rad| {
                let roll_rad = roll_rad.rem_euclid(TAU);
                let here = sweep.merit(aim, roll_rad);
                if here > most {
                    (most, better_rad) = (here, Some(roll_rad));
                }
                here
            });
            if most.meets_what_is_judged() {
                break;
            }
        }
        Best {
            aim,
            value: most.value,
            member: match better_rad {
                Some(roll_rad) => sweep.member(roll_rad),
                None => knots[first].member.clone(),
            },
        }
    }
}

/// The grid, with members between its rolls where the surplus may change its sign twice.
fn closer_look(grid: &[Member], sweep: &mut Sweep<'_>) -> Vec<Knot> {
    let count = grid.len();
    let step_rad = TAU / count as f64;
    let mut knots: Vec<Knot> = Vec::with_capacity(count);
    for k in 0..count {
        let here = &grid[k];
        let (last, next) = (&grid[(k + count - 1) % count], &grid[(k + 1) % count]);
        let alike = last.works() == here.works() && next.works() == here.works();
        // Rises towards what the others lack.
        let sign = if here.works() { -1.0 } else { 1.0 };
        let rise = |other: &Member| sign * (here.surplus - other.surplus);
        let peak = rise(last).min(rise(next)) >= 0.0;
        let steep = rise(last).max(rise(next));
        knots.push(Knot {
            roll_rad: here.roll_rad,
            member: here.clone(),
        });
        if !(alike && peak && here.surplus.abs() < CLOSER_LOOK * steep) {
            continue;
        }
        let mut found_rad: Option<f64> = None;
        golden(
            here.roll_rad - step_rad,
            here.roll_rad + step_rad,
            |roll_rad| {
                let roll_rad = roll_rad.rem_euclid(TAU);
                let (surplus, works) = sweep.surplus(roll_rad);
                if works != here.works() && found_rad.is_none() {
                    found_rad = Some(roll_rad);
                }
                sign * surplus
            },
        );
        if let Some(roll_rad) = found_rad {
            let member = sweep.member(roll_rad);
            knots.push(Knot { roll_rad, member });
        }
    }
    knots.sort_by(|a, b| a.roll_rad.total_cmp(&b.roll_rad));
    knots.dedup_by(|a, b| a.roll_rad == b.roll_rad);
    knots
}

/// Looks for the largest value between two rolls; `value` keeps what it finds.
fn golden<V: PartialOrd>(mut low: f64, mut high: f64, mut value: impl FnMut(f64) -> V) {
    const SECTION: f64 = 0.618_033_988_749_895;
    if high <= low {
        return;
    }
    let mut left = high - SECTION * (high - low);
    let mut right = low + SECTION * (high - low);
    let (mut at_left, mut at_right) = (value(left), value(right));
    for _ in 0..SEARCH_STEPS {
        if at_left >= at_right {
            high = right;
            (right, at_right) = (left, at_left);
            left = high - SECTION * (high - low);
            at_left = value(left);
        } else {
            low = left;
            (left, at_left) = (right, at_right);
            right = low + SECTION * (high - low);
            at_right = value(right);
        }
    }
}

/// Last member that works before an edge, if it is not `inside` itself, and the edge.
fn bisect(inside: &Knot, outside: &Knot, sweep: &mut Sweep<'_>) -> (Option<Knot>, Edge) {
    let (mut good_rad, mut bad_rad) = (inside.roll_rad, outside.roll_rad);
    while (good_rad - bad_rad).abs() > EDGE_RAD {
        let middle_rad = f64::midpoint(good_rad, bad_rad);
        if sweep.works(middle_rad.rem_euclid(TAU)) {
            good_rad = middle_rad;
        } else {
            bad_rad = middle_rad;
        }
    }
    let mut at = |roll_rad: f64, known: &Knot| {
        (roll_rad != known.roll_rad).then(|| sweep.member(roll_rad.rem_euclid(TAU)))
    };
    let rejections = match at(bad_rad, outside) {
        Some(bad) => bad.rejections,
        None => outside.member.rejections.clone(),
    };
    let edge = Edge {
        roll_rad: bad_rad,
        rejection: rejections
            .into_iter()
            .next()
            .expect("what does not work breaks a rule"),
    };
    let knot = at(good_rad, inside).map(|member| Knot {
        roll_rad: good_rad,
        member,
    });
    (knot, edge)
}

/// Smallest and largest position of each joint along the knots, without jumps by whole turns, rad.
fn joint_extent(knots: &[Knot]) -> (Joints, Joints) {
    let mut joints = knots
        .iter()
        .filter_map(|knot| knot.member.candidate.as_ref())
        .map(|candidate| candidate.joints);
    let Some(first) = joints.next() else {
        return (Joints::zeros(), Joints::zeros());
    };
    let (mut here, mut low, mut high) = (first, first, first);
    for next in joints {
        here += (next - here).map(wrap_angle);
        low = low.inf(&here);
        high = high.sup(&here);
    }
    (low, high)
}
