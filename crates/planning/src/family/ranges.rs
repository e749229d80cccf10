//! Connected ranges of roll in which a configuration is feasible, and the best roll of each.

use std::f64::consts::TAU;

use needlebench_kinematics::ik::{Configuration, wrap_angle};
use needlebench_kinematics::{JOINT_COUNT, Joints};
use needlebench_scenario::Goal;

use super::{Aim, At, Glance, Level, Member, Merit, Sweep, nearest_missing};
use crate::Rejection;
use crate::limits::Shortfall;
use crate::planner::Planner;

/// Where a range ends.
#[derive(Debug, Clone, PartialEq)]
pub struct Edge {
    /// First roll found outside, at most [`EDGE_RAD`] from the last one inside, rad.
    pub roll_rad: f64,
    /// The first rule that is violated there.
    pub rejection: Rejection,
}

/// Best member of a range.
#[derive(Debug, Clone, PartialEq)]
pub struct Best {
    /// What it is best at.
    pub aim: Aim,
    /// Its value ([`Planner::value`]).
    pub value: f64,
    /// The member; it is feasible.
    pub member: Member,
}

/// Consecutive rolls at which a configuration is feasible.
#[derive(Debug, Clone, PartialEq)]
pub struct RollRange {
    /// First feasible roll, rad, in `[0, 2 pi)`.
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
    /// The guide can be turned from one end to the other without leaving the joint ranges, with the right 2π
    /// equivalents at the start.
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
    /// Feasible ranges, from roll zero upwards.
    pub ranges: Vec<RollRange>,
}

/// Width within which an edge is located, rad: 0.01 degrees.
pub const EDGE_RAD: f64 = 1.745e-4;
/// Part of the way between a knot's neighbours to which the best roll is found.
const REFINED: f64 = 1.0 / 64.0;
/// Half the width of the widest range that may be missed where nothing on the grid keeps what is wanted, rad.
const SCAN_RAD: f64 = 2.5e-3;
/// A local extreme of the constraint margin is searched where it is nearer to zero than this many times the rise to its
/// neighbours.
const CLOSER_LOOK: f64 = 2.0;

/// A roll that was looked at.
#[derive(Debug, Clone, Copy)]
struct Knot {
    roll_rad: f64,
    works: bool,
    surplus: f64,
}

impl Knot {
    fn of(member: &Member) -> Self {
        Self {
            roll_rad: member.roll_rad,
            works: member.works(),
            surplus: member.surplus,
        }
    }
}

/// Neighbouring feasible rolls: the number of the first one, and how many there are.
type Stretch = (usize, usize);

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
            let ranges = if only.works() {
                vec![self.range(goal, &mut sweep, std::slice::from_ref(only), None, aims)]
            } else {
                Vec::new()
            };
            return Family { ranges, ..empty };
        }
        let knots: Vec<Knot> = grid.iter().map(Knot::of).collect();
        let mut members = grid.to_vec();
        let between = closer_look(&knots, &mut sweep).into_iter();
        members.extend(between.map(|roll_rad| sweep.member(roll_rad)));
        members.sort_by(|a, b| a.roll_rad.total_cmp(&b.roll_rad));
        members.dedup_by(|a, b| a.roll_rad == b.roll_rad);
        let works: Vec<bool> = members.iter().map(Member::works).collect();
        if works.iter().all(|works| *works) {
            let mut range = self.range(goal, &mut sweep, &members, None, aims);
            range.is_whole_circle = true;
            range.to_rad = range.from_rad + TAU;
            return Family {
                ranges: vec![range],
                ..empty
            };
        }
        let count = members.len();
        let mut ranges: Vec<RollRange> = Vec::new();
        for (from, length) in stretches(&works) {
            let at = |k: usize| Member {
                roll_rad: unrolled(k, count, |k| members[k].roll_rad),
                ..members[k % count].clone()
            };
            let mut inside: Vec<Member> = (from..from + length).map(at).collect();
            // What precedes a stretch does not work: it is not the first of all.
            let [before, after] = [at(from - 1), at(from + length)];
            let (low, before) = edge(&inside[0], &before, &mut sweep);
            let (high, after) = edge(&inside[length - 1], &after, &mut sweep);
            inside.splice(0..0, low);
            inside.extend(high);
            ranges.push(self.range(goal, &mut sweep, &inside, Some((before, after)), aims));
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
        members: &[Member],
        edges: Option<(Edge, Edge)>,
        aims: &[Aim],
    ) -> RollRange {
        let rolls: Vec<f64> = members.iter().map(|member| member.roll_rad).collect();
        // Of a whole circle the last one precedes the first.
        let beyond_rad = if edges.is_none() && members.len() > 1 {
            [rolls[rolls.len() - 1] - TAU, rolls[0] + TAU]
        } else {
            [rolls[0], rolls[rolls.len() - 1]]
        };
        let best = aims.iter().map(|&aim| {
            let merits: Vec<Merit> = members
                .iter()
                .map(|member| match &member.candidate {
                    Some(candidate) if member.works() => self.merit(goal, aim, candidate),
                    _ => Merit::NONE,
                })
                .collect();
            let peak = highest(sweep, aim, &rolls, &merits, beyond_rad);
            Best {
                aim,
                value: peak.merit.value,
                member: match peak.knot {
                    Some(knot) => members[knot].clone(),
                    None => sweep.member(peak.roll_rad.rem_euclid(TAU)),
                },
            }
        });
        let best = best.collect();
        let (low, high) = joint_extent(members);
        let limits = &self.cell().robot.limits;
        let fits_joint_limits = (0..JOINT_COUNT).all(|joint| {
            let limit = limits.0[joint];
            limit.turns(low[joint]).is_some_and(|mut turns| {
                turns.any(|k| high[joint] + TAU * f64::from(k) <= limit.upper_rad)
            })
        });
        let (before, after) = edges.unzip();
        RollRange {
            from_rad: rolls[0],
            to_rad: rolls[rolls.len() - 1],
            is_whole_circle: false,
            before,
            after,
            best,
            joint_span_rad: high - low,
            fits_joint_limits,
        }
    }

    /// The feasible member of a configuration that is best for an aim, else the one on the grid of rolls with the
    /// largest constraint margin.
    ///
    /// Where no member on the grid has the required clearances with their reserve, the rolls between are examined too
    /// ([`scan`]): a configuration is infeasible, or lacks the reserve, only where all rolls are or do.
    pub(crate) fn best_member(
        &self,
        goal: &Goal,
        configuration: Configuration,
        rolls_rad: &[f64],
        aim: Aim,
    ) -> Member {
        let mut sweep = Sweep::new(self, goal, configuration);
        let places: Vec<At> = rolls_rad.iter().map(|&roll| sweep.at(roll)).collect();
        let grid: Vec<Seen> = rolls_rad
            .iter()
            .zip(&places)
            .map(|(&roll_rad, at)| Seen {
                roll_rad,
                glance: sweep.glance_at(aim, at),
            })
            .collect();
        let mut best = highest_of_circle(&mut sweep, aim, &grid);
        let shortfall = best.as_ref().map(|best| best.merit.shortfall);
        if shortfall != Some(Shortfall::NONE) {
            // Something between the rolls of the grid may keep more.
            let is_judged = shortfall.is_some_and(|shortfall| shortfall.judged_m >= 0.0);
            let level = if is_judged {
                Level::Wanted
            } else {
                Level::Judged
            };
            let glances: Vec<Glance> = grid
                .iter()
                .zip(&places)
                .map(|(seen, at)| {
                    let known = sweep.keeps_by(level, at, &seen.glance);
                    known.unwrap_or_else(|| sweep.keeps_at(level, at))
                })
                .collect();
            let count = grid.len();
            let knot = |k: usize| Looked {
                roll_rad: unrolled(k, count, |k| grid[k].roll_rad),
                at: &places[k % count],
                glance: &glances[k % count],
            };
            let mut found = Vec::new();
            for k in 0..count {
                scan(&mut sweep, level, knot(k), knot(k + 1), &mut found);
            }
            if !found.is_empty() {
                let mut all = grid.clone();
                let found = found.into_iter();
                all.extend(found.map(|roll_rad| Seen::at(&mut sweep, aim, roll_rad)));
                all.sort_by(|a, b| a.roll_rad.total_cmp(&b.roll_rad));
                best = highest_of_circle(&mut sweep, aim, &all);
            }
        }
        if let Some(best) = best {
            return sweep.member(best.roll_rad.rem_euclid(TAU));
        }
        let mut nearest: Option<(f64, f64)> = None;
        for (seen, at) in grid
            .iter()
            .zip(&places)
            .filter(|(seen, _)| seen.glance.exists)
        {
            let most = nearest.map_or(f64::NEG_INFINITY, |(most, _)| most);
            let surplus = sweep.keeps_more_than(most, Level::Floor, at).surplus;
            if nearest.is_none() || surplus > most {
                nearest = Some((surplus, seen.roll_rad));
            }
        }
        if let Some((_, roll_rad)) = nearest {
            return sweep.member(roll_rad);
        }
        let grid = rolls_rad.iter().map(|&roll_rad| sweep.member(roll_rad));
        nearest_missing(grid.collect())
    }
}

/// A roll with what a choice needs to know of its member.
#[derive(Debug, Clone, Copy)]
struct Seen {
    roll_rad: f64,
    glance: Glance,
}

impl Seen {
    fn at(sweep: &mut Sweep<'_>, aim: Aim, roll_rad: f64) -> Self {
        Self {
            roll_rad,
            glance: sweep.glance(aim, roll_rad.rem_euclid(TAU)),
        }
    }
}

/// A roll at which a level of clearances was asked for.
#[derive(Clone, Copy)]
struct Looked<'s> {
    roll_rad: f64,
    at: &'s At,
    glance: &'s Glance,
}

/// The best of all feasible stretches on a circle of rolls in ascending order; of equal ones the first.
fn highest_of_circle(sweep: &mut Sweep<'_>, aim: Aim, all: &[Seen]) -> Option<Peak> {
    let count = all.len();
    let works: Vec<bool> = all.iter().map(|seen| seen.glance.works).collect();
    let mut found = stretches(&works);
    // In the order of the rolls at which they begin.
    found.sort_by_key(|(from, _)| *from % count);
    let peaks = found.into_iter().map(|(from, length)| {
        let roll = |k: usize| unrolled(k, count, |k| all[k].roll_rad);
        let rolls: Vec<f64> = (from..from + length).map(roll).collect();
        let merit = |k: usize| all[k % count].glance.merit;
        let merits: Vec<Merit> = (from..from + length).map(merit).collect();
        // What lies beyond does not work, or is the other end of the circle.
        let beyond_rad = [roll(from + count - 1) - TAU, roll(from + length)];
        highest(sweep, aim, &rolls, &merits, beyond_rad)
    });
    peaks.reduce(|best, peak| {
        if peak.merit.better_first(&best.merit).is_lt() {
            peak
        } else {
            best
        }
    })
}

/// Looks for rolls that keep a level of clearances between two that do not, and adds what it finds.
///
/// A half of the way is left out where what is broken at the end is broken by more than the arm moves from there
/// to the middle: nothing in it keeps the level, as far as the arm goes there by the shortest way. What remains is
/// looked at down to [`SCAN_RAD`].
fn scan(
    sweep: &mut Sweep<'_>,
    level: Level,
    low: Looked<'_>,
    high: Looked<'_>,
    found: &mut Vec<f64>,
) {
    if low.glance.works || high.glance.works || high.roll_rad - low.roll_rad < 2.0 * SCAN_RAD {
        return;
    }
    let middle_rad = f64::midpoint(low.roll_rad, high.roll_rad);
    let at = sweep.at(middle_rad.rem_euclid(TAU));
    let mut is_excluded = |end: Looked<'_>| sweep.excludes(end.at, end.glance, &at);
    if is_excluded(low) && is_excluded(high) {
        return;
    }
    let glance = sweep.keeps_at(level, &at);
    if glance.works {
        found.push(middle_rad.rem_euclid(TAU));
    }
    let middle = Looked {
        roll_rad: middle_rad,
        at: &at,
        glance: &glance,
    };
    scan(sweep, level, low, middle, found);
    scan(sweep, level, middle, high, found);
}

/// The roll of a knot, counted on beyond the last one.
fn unrolled(k: usize, count: usize, roll_rad: impl Fn(usize) -> f64) -> f64 {
    roll_rad(k % count) + TAU * (k / count) as f64
}

/// The stretches of what works on a circle, the first one beginning behind the first that does not; all of
/// them if all work.
fn stretches(works: &[bool]) -> Vec<Stretch> {
    let count = works.len();
    let Some(first) = works.iter().position(|works| !works) else {
        return vec![(0, count)];
    };
    let mut found: Vec<Stretch> = Vec::new();
    let mut goes_on = false;
    for k in first..first + count {
        let here = works[k % count];
        match found.last_mut() {
            Some((_, length)) if here && goes_on => *length += 1,
            _ if here => found.push((k, 1)),
            _ => {}
        }
        goes_on = here;
    }
    found
}

/// The best of a range.
struct Peak {
    roll_rad: f64,
    merit: Merit,
    /// The knot, if it is one.
    knot: Option<usize>,
}

/// The best knot, refined between its neighbours; where even that falls short of what is wanted,
/// the best of all knots that are better than their neighbours, each refined. What lies next to the first and
/// the last knot, if they have no neighbour, is `beyond_rad`.
fn highest(
    sweep: &mut Sweep<'_>,
    aim: Aim,
    rolls_rad: &[f64],
    merits: &[Merit],
    beyond_rad: [f64; 2],
) -> Peak {
    let last = merits.len() - 1;
    let mut peaks: Vec<usize> = (0..=last)
        .filter(|&k| {
            let (before, after) = (k.saturating_sub(1), (k + 1).min(last));
            merits[k] >= merits[before] && merits[k] >= merits[after]
        })
        .collect();
    // Equal ones stay in the order of roll.
    peaks.sort_by(|&a, &b| merits[a].better_first(&merits[b]));
    let first = peaks.first().copied().unwrap_or(0);
    let mut most = Peak {
        roll_rad: rolls_rad[first],
        merit: merits[first],
        knot: Some(first),
    };
    for index in peaks {
        let before = index.checked_sub(1).map(|k| rolls_rad[k]);
        let mut bracket = Bracket {
            low_rad: before.unwrap_or(beyond_rad[0]),
            middle_rad: rolls_rad[index],
            high_rad: rolls_rad.get(index + 1).copied().unwrap_or(beyond_rad[1]),
            best: merits[index],
        };
        let end_rad = REFINED * bracket.width_rad();
        while bracket.width_rad() > end_rad {
            bracket.narrow(|roll_rad| sweep.glance(aim, roll_rad.rem_euclid(TAU)).merit);
        }
        if bracket.best > most.merit {
            most = Peak {
                roll_rad: bracket.middle_rad,
                merit: bracket.best,
                knot: None,
            };
        }
        if most.merit.shortfall == Shortfall::NONE {
            break;
        }
    }
    most
}

/// Rolls between those of the grid where the constraint margin changes its sign twice.
fn closer_look(grid: &[Knot], sweep: &mut Sweep<'_>) -> Vec<f64> {
    let count = grid.len();
    let step_rad = TAU / count as f64;
    let mut between = Vec::new();
    for k in 0..count {
        let here = &grid[k];
        let (last, next) = (&grid[(k + count - 1) % count], &grid[(k + 1) % count]);
        let alike = last.works == here.works && next.works == here.works;
        // Rises towards what the others lack.
        let sign = if here.works { -1.0 } else { 1.0 };
        let rise = |other: &Knot| sign * (here.surplus - other.surplus);
        let peak = rise(last).min(rise(next)) >= 0.0;
        let steep = rise(last).max(rise(next));
        if !(alike && peak && here.surplus.abs() < CLOSER_LOOK * steep) {
            continue;
        }
        let mut bracket = Bracket {
            low_rad: here.roll_rad - step_rad,
            middle_rad: here.roll_rad,
            high_rad: here.roll_rad + step_rad,
            best: sign * here.surplus,
        };
        let mut found = false;
        while !found && bracket.width_rad() > REFINED * 2.0 * step_rad {
            bracket.narrow(|roll_rad| {
                let (surplus, works) = sweep.surplus(roll_rad.rem_euclid(TAU));
                if works != here.works {
                    between.push(roll_rad.rem_euclid(TAU));
                    found = true;
                }
                sign * surplus
            });
        }
    }
    between
}

/// A roll between two others with what was found there; none of the other two is better.
#[derive(Debug, Clone, Copy)]
struct Bracket<V> {
    low_rad: f64,
    middle_rad: f64,
    high_rad: f64,
    /// What was found in the middle.
    best: V,
}

impl<V: PartialOrd> Bracket<V> {
    fn width_rad(&self) -> f64 {
        self.high_rad - self.low_rad
    }

    /// Looks at a roll of the wider part by the golden section; whichever of the two is better is the new middle.
    fn narrow(&mut self, value: impl FnOnce(f64) -> V) {
        const SECTION: f64 = 0.381_966_011_250_105;
        let (below_rad, above_rad) = (
            self.middle_rad - self.low_rad,
            self.high_rad - self.middle_rad,
        );
        let is_above = above_rad > below_rad;
        let roll_rad = if is_above {
            self.middle_rad + SECTION * above_rad
        } else {
            self.middle_rad - SECTION * below_rad
        };
        let here = value(roll_rad);
        let (bound, other) = if is_above {
            (&mut self.high_rad, &mut self.low_rad)
        } else {
            (&mut self.low_rad, &mut self.high_rad)
        };
        if here > self.best {
            *other = self.middle_rad;
            (self.middle_rad, self.best) = (roll_rad, here);
        } else {
            *bound = roll_rad;
        }
    }
}

/// The last roll that was found to work before one that does not, and the first one beyond.
fn bisect(inside_rad: f64, outside_rad: f64, sweep: &mut Sweep<'_>) -> (f64, f64) {
    let (mut good_rad, mut bad_rad) = (inside_rad, outside_rad);
    while (good_rad - bad_rad).abs() > EDGE_RAD {
        let middle_rad = f64::midpoint(good_rad, bad_rad);
        if sweep.works(middle_rad.rem_euclid(TAU)) {
            good_rad = middle_rad;
        } else {
            bad_rad = middle_rad;
        }
    }
    (good_rad, bad_rad)
}

/// Last feasible member before an edge, if it is not `inside` itself, and the edge.
fn edge(inside: &Member, outside: &Member, sweep: &mut Sweep<'_>) -> (Option<Member>, Edge) {
    let (good_rad, bad_rad) = bisect(inside.roll_rad, outside.roll_rad, sweep);
    let mut at = |roll_rad: f64, known: &Member| {
        (roll_rad != known.roll_rad).then(|| sweep.member(roll_rad.rem_euclid(TAU)))
    };
    let rejections = match at(bad_rad, outside) {
        Some(bad) => bad.rejections,
        None => outside.rejections.clone(),
    };
    let edge = Edge {
        roll_rad: bad_rad,
        rejection: rejections
            .into_iter()
            .next()
            .expect("what does not work breaks a rule"),
    };
    let last = at(good_rad, inside).map(|member| Member {
        roll_rad: good_rad,
        ..member
    });
    (last, edge)
}

/// Smallest and largest position of each joint along some members, without jumps by full revolutions, rad.
fn joint_extent(members: &[Member]) -> (Joints, Joints) {
    let mut joints = members
        .iter()
        .filter_map(|member| member.candidate.as_ref())
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
