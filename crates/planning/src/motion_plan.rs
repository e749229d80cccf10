//! The motion of a configuration: transit, linear approach, hold; and the retreat.

use std::f64::consts::TAU;

use nalgebra::UnitVector3;
use needlebench_cell::Rule;
use needlebench_clearance::MotionCertificate;
use needlebench_kinematics::ik::{Configuration, WrapOrder, WrapSearch};
use needlebench_kinematics::trajectory::{JointPath, JointTrajectory, LineError, Phase};
use needlebench_kinematics::{JOINT_COUNT, Joints};
use needlebench_scenario::Goal;

use crate::Rejection;
use crate::limits::ByClass;
use crate::margin::{Margin, Parts, SAME_M, SearchEnd, Straight};
use crate::planner::{Candidate, Planner};
use crate::transfer::{Budget, TransferSearch};

/// What became of one configuration.
#[derive(Debug, Clone, PartialEq)]
pub struct ConfigurationPlan {
    /// Which of the eight.
    pub configuration: Configuration,
    /// Its best posture; `None` if there is none at all.
    pub candidate: Option<Candidate>,
    /// Rules that it violates, first failing one first; empty if it is feasible.
    pub rejections: Vec<Rejection>,
    /// Motion from the start posture; `None` if there is no way.
    pub trajectory: Option<JointTrajectory>,
    /// The retreat: first straight out along the needle axis. `None` unless the configuration is feasible.
    pub retreat: Option<JointTrajectory>,
    /// What the search for an alternative path cost; `None` where the straight motion was tried alone.
    pub search: Option<SearchEffort>,
    /// What the motion keeps of the clearance that the posture allows; `None` without a motion.
    pub margin: Option<Margin>,
    /// Certified clearances of the whole motion, to the scenario's tolerance.
    pub certificate: Option<MotionCertificate>,
}

impl ConfigurationPlan {
    /// Of a configuration without a posture.
    pub(crate) fn nothing(configuration: Configuration) -> Self {
        Self {
            configuration,
            candidate: None,
            rejections: Vec::new(),
            trajectory: None,
            retreat: None,
            search: None,
            margin: None,
            certificate: None,
        }
    }
}

/// A search for a motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SearchEffort {
    /// Corners of the way that was found, ends included; 0 if none was.
    pub waypoints: usize,
    /// Postures that were looked at.
    pub checks: u64,
    /// Random postures that were drawn.
    pub samples: u64,
    /// Seed of the random postures.
    pub seed: u64,
}

/// Combinations of 2π equivalents that are tried for the transit, shortest first.
const WRAP_TRIES: usize = 8;

/// How much corners of an alternative path are rounded, in the order in which it is tried.
const ROUNDINGS: [f64; 5] = [1.0, 0.5, 0.25, 0.1, 0.03];

/// Part of the postures that may be looked at that the search for all the clearance that there is may use,
/// that each further one may, but for the first for any way, and that pulling a way may: one of so many.
const FIRST_SHARE: u64 = 6;
const SHARE: u64 = 8;
const PULL_SHARE: u64 = 40;
/// How often one way is pulled at most.
const PULLS: u32 = 6;
/// What an alternative path has to gain for a longer motion to be worth it, m.
const LEAST_GAIN_M: f64 = 5e-4;

/// What searches may look at, and what they have looked at.
struct Looks<'l> {
    effort: &'l mut SearchEffort,
    /// Postures that all of them may look at; one of them, a share of these.
    whole: u64,
    /// Postures that all of them may still look at.
    left: &'l mut u64,
}

/// Where an alternative path comes from.
enum Source<'w> {
    /// From random postures, others in each round.
    Random(u64),
    /// From one that is known and is pulled to where it keeps more.
    Known(&'w Way),
}

/// A way from the start posture to where the approach begins.
#[derive(Debug, Clone)]
enum Transfer {
    Straight,
    /// Paths with a stop between one and the next.
    Around(Vec<JointPath>),
}

/// A transfer with its motion.
#[derive(Debug, Clone)]
pub(crate) struct Way {
    turns: [i32; JOINT_COUNT],
    transfer: Transfer,
    trajectory: JointTrajectory,
    /// Of the transit alone.
    pub certificate: MotionCertificate,
    /// Certified clearances of the transit.
    keeps: ByClass,
    /// Corners of the polygon that it follows, ends included.
    waypoints: Vec<Joints>,
}

/// What every motion to a posture has in common.
#[derive(Debug, Clone)]
pub(crate) struct Required {
    pub candidate: Candidate,
    /// Rules that the posture violates.
    pub rejections: Vec<Rejection>,
    line: JointPath,
    approach: MotionCertificate,
    start: ByClass,
    /// Clearances that count of start and approach.
    target: ByClass,
    wraps: Vec<[i32; JOINT_COUNT]>,
}

impl Required {
    /// Clearances of the postures that every motion takes.
    pub fn attainable(&self) -> ByClass {
        self.start.least(&ByClass::proven(&self.approach))
    }

    fn parts(&self, way: &Way) -> Parts {
        Parts {
            start: self.start,
            approach: ByClass::proven(&self.approach),
            transfer: way.keeps,
        }
    }

    /// Clearances of the whole motion.
    pub fn achieved(&self, way: &Way) -> ByClass {
        self.parts(way).achieved()
    }

    /// The transit keeps what start and approach do.
    pub(crate) fn is_reached_by(&self, way: &Way) -> bool {
        way.keeps.most_below(&self.target) <= SAME_M
    }
}

impl Planner<'_> {
    /// The part of a motion that a posture decides: its approach, certified, and the 2π equivalents with which it can
    /// be reached.
    ///
    /// # Errors
    /// The plan of a posture to which there is no motion at all.
    pub(crate) fn required(
        &self,
        goal: &Goal,
        configuration: Configuration,
        candidate: Candidate,
        mut rejections: Vec<Rejection>,
    ) -> Result<Required, Box<ConfigurationPlan>> {
        let line = self.approach_line(goal, &candidate);
        let reason = match &line {
            Err(error) => Some(Self::blocked_approach(error, goal.approach_m)),
            Ok(line) => self.wraps(line).is_empty().then(|| Rejection {
                rule: Rule::JointLimit,
                value: self.cell().robot.limits.margin(&line.start()),
                limit: 0.0,
                unit: "1",
                detail: "the approach leaves the joint ranges, for all 2 pi equivalents".to_owned(),
                class: None,
            }),
        };
        let (Ok(line), None) = (line, &reason) else {
            rejections.extend(reason);
            return Err(Box::new(ConfigurationPlan {
                candidate: Some(candidate),
                rejections,
                ..ConfigurationPlan::nothing(configuration)
            }));
        };
        let approach = JointTrajectory::starting_at(line.start())
            .then_along(Phase::Approach, line.clone(), &self.resolved.motion)
            .then_hold(Phase::Hold, self.resolved.scenario.motion.hold_s);
        let approach = self.checker.certificate(&approach);
        let start = *self.start_clearance();
        let attainable = start.least(&ByClass::proven(&approach)).of_bodies();
        let limits = self.limits();
        Ok(Required {
            wraps: self.wraps(&line),
            target: attainable.least(&limits.ample()),
            candidate,
            rejections,
            line,
            approach,
            start,
        })
    }

    /// The straight transit that keeps most, those with fewer turns first: the first that keeps what start and approach
    /// do, else the first that is free, else the first.
    pub(crate) fn straight(&self, required: &Required) -> Way {
        let first = self.straight_with(required, required.wraps[0]);
        if required.is_reached_by(&first) || !self.is_worth_a_search(required) {
            return first;
        }
        let asked = required.target.with(&required.target, |m, _| m - SAME_M);
        for least in [&asked, &self.limits().wanted().least(&asked)] {
            if first.keeps.most_below(least) <= 0.0 {
                return first;
            }
            for &turns in &required.wraps[1..] {
                let to = required.line.start() + shift(&turns);
                if !self.checker.keeps_straight(self.start(), &to, least).0 {
                    continue;
                }
                let way = self.straight_with(required, turns);
                if way.keeps.most_below(least) <= SAME_M {
                    return way;
                }
            }
        }
        first
    }

    fn straight_with(&self, required: &Required, turns: [i32; JOINT_COUNT]) -> Way {
        let line = required.line.shifted(&shift(&turns));
        let waypoints = vec![*self.start(), line.start()];
        self.certified(required, turns, Transfer::Straight, &line, waypoints)
    }

    fn certified(
        &self,
        required: &Required,
        turns: [i32; JOINT_COUNT],
        transfer: Transfer,
        line: &JointPath,
        waypoints: Vec<Joints>,
    ) -> Way {
        let trajectory = self.motion(&transfer, line);
        // What is farther than the approach does not change the motion's clearance.
        let certificate = self.checker.of_transfer(
            &trajectory,
            &ByClass::attained(&required.approach).of_bodies(),
        );
        Way {
            turns,
            transfer,
            trajectory,
            keeps: ByClass::proven(&certificate).of_bodies(),
            certificate,
            waypoints,
        }
    }

    /// Whether another transfer can help: no posture that every motion takes is below its floor. What
    /// another rule rejects needs a motion only to be simulated.
    fn is_worth_a_search(&self, required: &Required) -> bool {
        let mut rejections = required.rejections.iter();
        let is_wanted = rejections.all(|each| {
            self.planning().simulate_rejected
                && !matches!(each.rule, Rule::Collision | Rule::TooClose)
        });
        is_wanted && required.attainable().most_below(&self.limits().floors()) <= 0.0
    }

    /// The transit that keeps most of those found: as much as start and approach, or as much as the postures that may
    /// be looked at allow. What it looks at is subtracted from `checks_left`.
    pub(crate) fn improved(
        &self,
        goal: &Goal,
        configuration: Configuration,
        required: &Required,
        straight: Way,
        checks_left: &mut u64,
    ) -> (Way, Option<SearchEffort>) {
        if required.is_reached_by(&straight)
            || *checks_left == 0
            || !self.is_worth_a_search(required)
        {
            return (straight, None);
        }
        let mut effort = SearchEffort {
            waypoints: 0,
            checks: 0,
            samples: 0,
            seed: seed_of(self.resolved.scenario.seed, &goal.name, configuration),
        };
        let target = required.target;
        let floors = self.limits().floors().of_bodies();
        let is_free = |way: &Way| way.keeps.most_below(&floors) <= 0.0;
        let mut looks = Looks {
            effort: &mut effort,
            whole: *checks_left,
            left: checks_left,
        };
        let wanted = self.limits().wanted().least(&target);
        let any = floors.least(&target);
        let mut best = straight;
        // All of it; what is wanted of it; any way at all. What is found is pulled to where it keeps more; others
        // are looked for as long as that is not all.
        let asked = [&target, &wanted, &any, &target, &any, &target, &any];
        for (round, least) in (0..).zip(asked) {
            if best.keeps.most_below(&target) <= SAME_M {
                break;
            }
            let source = Source::Random(round / 3);
            let share = match round {
                0 => FIRST_SHARE,
                2 => 1,
                _ => SHARE,
            };
            let found = self.way_around(required, &source, least, share, &mut looks);
            let Some(found) = found.map(|found| self.pulled(required, found, &mut looks)) else {
                continue;
            };
            if !is_free(&best) && is_free(&found) || gains(&best, &found, &target) {
                best = found;
            }
        }
        let found = is_free(&best).then_some(best.waypoints.len());
        effort.waypoints = found.unwrap_or(0);
        (best, Some(effort))
    }

    /// A way pulled to where it keeps all that start and approach do, or as much of what is missing as it can.
    fn pulled(&self, required: &Required, mut way: Way, looks: &mut Looks<'_>) -> Way {
        let target = &required.target;
        let mut share = 1.0;
        for _ in 0..PULLS {
            let missing_m = way.keeps.most_below(target).max(0.0);
            if missing_m * share <= SAME_M {
                break;
            }
            let kept = way.keeps.least(target);
            let least = kept.with(target, |kept_m, target_m| {
                // What is not asked for has no limit, and lacks nothing.
                let more_m = share * (target_m - kept_m);
                if more_m > 0.0 {
                    kept_m + more_m
                } else {
                    kept_m
                }
            });
            let found = self.way_around(required, &Source::Known(&way), &least, PULL_SHARE, looks);
            match found {
                Some(found) if found.keeps.most_below(target) < missing_m - 0.5 * SAME_M => {
                    way = found;
                }
                _ => share *= 0.5,
            }
        }
        way
    }

    /// The plan of a posture with its motion.
    pub(crate) fn planned(
        &self,
        configuration: Configuration,
        required: &Required,
        way: Way,
        straight: &Way,
        search: Option<SearchEffort>,
    ) -> ConfigurationPlan {
        let limits = self.limits();
        let mut candidate = required.candidate.clone();
        candidate.wrap = way.turns;
        candidate.joints = way.trajectory.end();
        // Whole turns change the margin to the joint limits.
        candidate.margins = self.margins(&candidate.joints);
        let parts = required.parts(&way);
        let end = if !self.is_worth_a_search(required) {
            SearchEnd::Proof
        } else if required.is_reached_by(&way) {
            SearchEnd::Bound
        } else {
            SearchEnd::Budget
        };
        let begins_s = way
            .trajectory
            .phases()
            .iter()
            .find(|phase| phase.0 == Phase::Approach)
            .map_or(0.0, |phase| phase.1);
        let approach = required.approach.clone().later_by(begins_s);
        let is_around = matches!(way.transfer, Transfer::Around(_)) || way.turns != straight.turns;
        let straight = is_around.then(|| Straight {
            clearance_m: required.achieved(straight).of_surroundings_m(),
            instead_m: required.achieved(&way).of_surroundings_m(),
            duration_s: straight.trajectory.duration_s(),
        });
        let mut rejections = required.rejections.clone();
        // A posture that breaks a rule says so already; the motion into it adds nothing.
        if rejections.is_empty() {
            rejections.extend(self.too_near(required, &way, &approach, search.as_ref()));
        }
        let retreat = rejections.is_empty().then(|| {
            let line = required.line.shifted(&shift(&way.turns));
            self.retreat(&way.transfer, &line)
        });
        ConfigurationPlan {
            configuration,
            candidate: Some(candidate),
            rejections,
            retreat,
            search,
            margin: Some(parts.margin(limits, end, straight)),
            certificate: Some(way.certificate.and(&approach)),
            trajectory: Some(way.trajectory),
        }
    }

    /// The last, straight part of a posture's motion alone: along the needle to its place, without
    /// the way there. `None` where the line meets a singularity or leaves the workspace. Nothing is
    /// checked for collisions.
    pub fn approach(&self, goal: &Goal, candidate: &Candidate) -> Option<JointTrajectory> {
        let line = self.approach_line(goal, candidate).ok()?;
        let start = JointTrajectory::starting_at(line.start());
        Some(start.then_along(Phase::Approach, line, &self.resolved.motion))
    }

    fn approach_line(&self, goal: &Goal, candidate: &Candidate) -> Result<JointPath, LineError> {
        let robot = &self.cell().robot;
        let axis = robot.world_from_base_link.rotation.inverse() * goal.axis.into_inner();
        JointPath::line_ending_at(
            &robot.chain,
            &candidate.joints,
            &UnitVector3::new_normalize(axis),
            goal.approach_m,
        )
    }

    /// Transfer, approach and hold.
    fn motion(&self, transfer: &Transfer, line: &JointPath) -> JointTrajectory {
        let motion = &self.resolved.motion;
        let start = JointTrajectory::starting_at(self.resolved.start);
        let there = match transfer {
            Transfer::Straight => start.then_straight_to(Phase::Transfer, line.start(), motion),
            Transfer::Around(paths) => paths.iter().fold(start, |there, path| {
                there.then_through(Phase::Transfer, path.clone(), motion)
            }),
        };
        there
            .then_along(Phase::Approach, line.clone(), motion)
            .then_hold(Phase::Hold, self.resolved.scenario.motion.hold_s)
    }

    /// The same way backwards: out along the needle axis, then to the start. It passes
    /// every posture of the way in; its clearance is certified by itself in reports.
    fn retreat(&self, transfer: &Transfer, line: &JointPath) -> JointTrajectory {
        let motion = &self.resolved.motion;
        let out = JointTrajectory::starting_at(line.end()).then_along(
            Phase::Retract,
            line.reversed(),
            motion,
        );
        match transfer {
            Transfer::Straight => out.then_straight_to(Phase::Return, self.resolved.start, motion),
            Transfer::Around(paths) => paths.iter().rev().fold(out, |back, path| {
                back.then_through(Phase::Return, path.reversed(), motion)
            }),
        }
    }

    /// Searches an alternative path that keeps some clearances, to the beginning of the approach in any of its
    /// whole-turn images.
    fn way_around(
        &self,
        required: &Required,
        source: &Source<'_>,
        least: &ByClass,
        share: u64,
        looks: &mut Looks<'_>,
    ) -> Option<Way> {
        let checks = (looks.whole / share).min(*looks.left);
        // Certificates are no wider than this, and what is between two postures is little nearer; but
        // what is as near as allowed could not be proven free.
        let floors = self.limits().floors();
        let sampled = least
            .with(&floors, |least_m, floor_m| {
                (least_m - 0.5 * SAME_M).max(floor_m + SAME_M)
            })
            .least(
                &required
                    .target
                    .with(&floors, |target_m, _| target_m - 0.5 * SAME_M),
            );
        let mut search = TransferSearch::new(
            &self.checker,
            &self.cell().robot.limits,
            self.resolved.motion.velocity,
            match source {
                Source::Random(round) => looks.effort.seed.wrapping_add(*round),
                Source::Known(_) => looks.effort.seed,
            },
            sampled,
            Budget { checks },
        );
        let found = match source {
            Source::Random(_) => {
                let wraps = &required.wraps;
                let goals: Vec<Joints> = wraps
                    .iter()
                    .map(|turns| required.line.start() + shift(turns))
                    .collect();
                let found = search.search(self.start(), &goals);
                found.map(|found| (search.shortened(found.waypoints), wraps[found.goal]))
            }
            Source::Known(way) => {
                let lifted = search.lifted(&way.waypoints);
                lifted.map(|lifted| (search.straightened(lifted), way.turns))
            }
        };
        looks.effort.checks += search.checks;
        looks.effort.samples += search.samples;
        *looks.left = looks.left.saturating_sub(search.checks);
        let (waypoints, turns) = found?;
        self.rounded(required, &waypoints, turns, least)
    }

    /// The way through the waypoints with its corners rounded as much as leaves the clearances; where none
    /// does, the one that keeps most.
    fn rounded(
        &self,
        required: &Required,
        waypoints: &[Joints],
        turns: [i32; JOINT_COUNT],
        least: &ByClass,
    ) -> Option<Way> {
        let line = required.line.shifted(&shift(&turns));
        let mut best: Option<(f64, Way)> = None;
        for rounding in ROUNDINGS {
            let paths = self.fastest(waypoints, rounding)?;
            let transfer = Transfer::Around(paths);
            let way = self.certified(required, turns, transfer, &line, waypoints.to_vec());
            let lack_m = way.keeps.most_below(least);
            if lack_m <= SAME_M && way.keeps.most_below(&self.limits().floors()) <= 0.0 {
                return Some(way);
            }
            if best.as_ref().is_none_or(|(known_m, _)| lack_m < *known_m) {
                best = Some((lack_m, way));
            }
        }
        best.map(|(_, way)| way)
    }

    /// Paths through the waypoints, with stops at those corners where stopping takes less time than
    /// the whole way would at the speed that the corner allows; one stop after another, the most
    /// useful first.
    fn fastest(&self, waypoints: &[Joints], rounding: f64) -> Option<Vec<JointPath>> {
        let speed = &self.resolved.motion.velocity;
        let with_stops = |stops: &[usize]| -> Option<(f64, Vec<JointPath>)> {
            let mut ends = vec![0];
            ends.extend_from_slice(stops);
            ends.push(waypoints.len() - 1);
            let paths: Option<Vec<JointPath>> = ends
                .windows(2)
                .map(|pair| JointPath::through(&waypoints[pair[0]..=pair[1]], speed, rounding))
                .collect();
            let paths = paths?;
            let whole =
                paths
                    .iter()
                    .fold(JointTrajectory::starting_at(waypoints[0]), |whole, path| {
                        whole.then_through(Phase::Transfer, path.clone(), &self.resolved.motion)
                    });
            Some((whole.duration_s(), paths))
        };
        let mut stops: Vec<usize> = Vec::new();
        let (mut duration_s, mut paths) = with_stops(&stops)?;
        loop {
            let mut better = None;
            for corner in 1..waypoints.len() - 1 {
                let Err(place) = stops.binary_search(&corner) else {
                    continue;
                };
                let mut more = stops.clone();
                more.insert(place, corner);
                let (takes_s, with_it) = with_stops(&more)?;
                if takes_s < duration_s {
                    duration_s = takes_s;
                    better = Some((more, with_it));
                }
            }
            let Some((more, with_it)) = better else {
                return Some(paths);
            };
            (stops, paths) = (more, with_it);
        }
    }

    /// 2π equivalents with the approach inside the joint ranges, as full revolutions per joint, shortest transit first;
    /// at most one revolution either way.
    fn wraps(&self, line: &JointPath) -> Vec<[i32; JOINT_COUNT]> {
        // Where the approach may start for its end to be inside as well.
        let mut limits = self.cell().robot.limits;
        let way = line.end() - line.start();
        for (limit, way) in limits.0.iter_mut().zip(&way) {
            limit.lower_rad -= way.min(0.0);
            limit.upper_rad -= way.max(0.0);
        }
        WrapSearch::new(&limits, &self.resolved.start)
            .ordered_by(WrapOrder::LargestJoint)
            .at_most_turns(1)
            .wraps(&line.start())
            .take(WRAP_TRIES)
            .map(|wrap| wrap.turns)
            .collect()
    }
}

/// Whether a way comes nearer to what is wanted than a known one by more than what a longer motion is worth,
/// or keeps as much in less time.
fn gains(known: &Way, found: &Way, target: &ByClass) -> bool {
    let missing_m = |way: &Way| way.keeps.most_below(target).max(0.0);
    missing_m(found) < missing_m(known) - LEAST_GAIN_M
}

fn shift(turns: &[i32; JOINT_COUNT]) -> Joints {
    Joints::from_fn(|i, _| TAU * f64::from(turns[i]))
}

/// Seed of one configuration's search, whatever is planned besides it (FNV-1a of the goal's name).
fn seed_of(scenario: u64, goal: &str, configuration: Configuration) -> u64 {
    let name = goal.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    });
    scenario ^ name ^ ((configuration.index() as u64) << 56)
}
