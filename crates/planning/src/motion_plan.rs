//! The motion of a configuration: transfer, straight approach, hold; and the way back out.

use std::f64::consts::TAU;

use nalgebra::UnitVector3;
use needlebench_cell::Goal;
use needlebench_kinematics::ik::{Configuration, WrapOrder, WrapSearch};
use needlebench_kinematics::trajectory::{JointPath, JointTrajectory, LineError, Phase};
use needlebench_kinematics::{JOINT_COUNT, Joints};

use crate::motion::Violation;
use crate::planner::{Candidate, Planner};
use crate::transfer::{Budget, TransferSearch};
use crate::{Rejection, Rule};

/// What became of one configuration.
#[derive(Debug, Clone, PartialEq)]
pub struct ConfigurationPlan {
    /// Which of the eight.
    pub configuration: Configuration,
    /// Its best posture; `None` if there is none at all.
    pub candidate: Option<Candidate>,
    /// Rules that it breaks, first failing one first; empty if it works.
    pub rejections: Vec<Rejection>,
    /// Motion from the start posture; `None` if there is no way.
    pub trajectory: Option<JointTrajectory>,
    /// The same way back: straight out along the needle axis first. `None` unless the configuration
    /// works.
    pub retreat: Option<JointTrajectory>,
    /// What the search for a way around cost; `None` where the straight motion was tried alone.
    pub search: Option<SearchEffort>,
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

/// Combinations of whole turns that are tried for the transfer, shortest first.
const WRAP_TRIES: usize = 8;

/// How much corners of a way around are rounded, in the order in which it is tried.
const ROUNDINGS: [f64; 5] = [1.0, 0.5, 0.25, 0.1, 0.03];

/// A way from the start posture to where the approach begins.
#[derive(Debug, Clone)]
enum Transfer {
    Straight,
    /// Paths with a stop between one and the next.
    Around(Vec<JointPath>),
}

/// A way around, with the whole turns of its goal.
struct Around {
    turns: [i32; JOINT_COUNT],
    paths: Vec<JointPath>,
    trajectory: JointTrajectory,
}

impl Planner<'_> {
    /// Adds the motion: transfer, straight approach, hold.
    ///
    /// The transfer is straight in the joints where that is free. Where it is not, and with
    /// `checks_left`, a way around is searched, and what it takes is subtracted there.
    pub(crate) fn plan_motion(
        &self,
        goal: &Goal,
        configuration: Configuration,
        mut candidate: Candidate,
        mut rejections: Vec<Rejection>,
        checks_left: Option<&mut u64>,
    ) -> ConfigurationPlan {
        let limits = &self.cell().robot.limits;
        let mut plan = ConfigurationPlan {
            configuration,
            candidate: None,
            rejections: Vec::new(),
            trajectory: None,
            retreat: None,
            search: None,
        };
        let line = match self.approach_line(goal, &candidate) {
            Ok(line) => line,
            Err(error) => {
                rejections.push(blocked_approach(&error, goal.approach_m));
                plan.candidate = Some(candidate);
                plan.rejections = rejections;
                return plan;
            }
        };
        let approach = JointTrajectory::starting_at(line.start()).then_along(
            Phase::Approach,
            line.clone(),
            &self.resolved.motion,
        );
        // Whole turns, or a way around, change the transfer, but neither the approach nor the
        // posture.
        let approach_is_free = rejections
            .iter()
            .all(|rejection| rejection.rule != Rule::Collision)
            && self.checker.first_collision(&approach).is_none();
        let wraps = self.wraps(&line);
        let mut first_failure = None;
        let mut chosen: Option<([i32; JOINT_COUNT], Transfer, JointTrajectory)> = None;
        for &turns in &wraps {
            let trajectory = self.motion(&Transfer::Straight, &line.shifted(&shift(&turns)));
            let collision = self.checker.first_collision(&trajectory);
            let works = collision.is_none();
            if works || chosen.is_none() {
                chosen = Some((turns, Transfer::Straight, trajectory));
                first_failure = collision;
            }
            if works || !approach_is_free {
                break;
            }
        }
        if let (Some(_), true, Some(checks_left)) = (&first_failure, approach_is_free, checks_left)
        {
            let (found, effort) = self.way_around(goal, configuration, &line, &wraps, *checks_left);
            *checks_left = checks_left.saturating_sub(effort.checks);
            plan.search = Some(effort);
            if let Some(around) = found {
                first_failure = None;
                chosen = Some((
                    around.turns,
                    Transfer::Around(around.paths),
                    around.trajectory,
                ));
            }
        }
        let Some((turns, transfer, trajectory)) = chosen else {
            rejections.push(Rejection {
                rule: Rule::JointLimit,
                value: limits.margin(&line.start()),
                limit: 0.0,
                unit: "1",
                detail: "the approach leaves the joint ranges".to_owned(),
                class: None,
            });
            plan.candidate = Some(candidate);
            plan.rejections = rejections;
            return plan;
        };
        candidate.wrap = turns;
        candidate.joints = trajectory.end();
        // Whole turns change the margin to the joint limits.
        candidate.margins = self.margins(&candidate.joints);
        // A posture that collides says so already; the motion into it adds nothing.
        let known = rejections
            .iter()
            .any(|rejection| rejection.rule == Rule::Collision);
        match first_failure {
            Some(violation) if !known => {
                rejections.push(self.blocked(&violation, plan.search.as_ref()));
            }
            Some(_) => {}
            None => {
                plan.retreat = Some(self.retreat(&transfer, &line.shifted(&shift(&turns))));
            }
        }
        rejections.sort_by_key(|rejection| rejection.rule);
        plan.candidate = Some(candidate);
        plan.rejections = rejections;
        plan.trajectory = Some(trajectory);
        plan
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

    /// The same way backwards: out along the needle axis, then to the start. It is as free as the
    /// way in, whose every posture it passes.
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

    /// Searches a way around to the beginning of the approach in any of its whole-turn images.
    fn way_around(
        &self,
        goal: &Goal,
        configuration: Configuration,
        line: &JointPath,
        wraps: &[[i32; JOINT_COUNT]],
        checks: u64,
    ) -> (Option<Around>, SearchEffort) {
        let seed = seed_of(self.resolved.scenario.seed, &goal.name, configuration);
        let mut search = TransferSearch::new(
            &self.checker,
            &self.cell().robot.limits,
            self.resolved.motion.velocity,
            seed,
            Budget { checks },
        );
        let goals: Vec<Joints> = wraps
            .iter()
            .map(|turns| line.start() + shift(turns))
            .collect();
        let found = search
            .search(&self.resolved.start, &goals)
            .and_then(|found| {
                let waypoints = search.shortened(found.waypoints);
                let turns = wraps[found.goal];
                let (paths, trajectory) =
                    self.rounded(&waypoints, &line.shifted(&shift(&turns)))?;
                let around = Around {
                    turns,
                    paths,
                    trajectory,
                };
                Some((around, waypoints.len()))
            });
        let effort = SearchEffort {
            waypoints: found.as_ref().map_or(0, |(_, waypoints)| *waypoints),
            checks: search.checks,
            samples: search.samples,
            seed,
        };
        (found.map(|(around, _)| around), effort)
    }

    /// The way through the waypoints with its corners rounded as much as stays free.
    fn rounded(
        &self,
        waypoints: &[Joints],
        line: &JointPath,
    ) -> Option<(Vec<JointPath>, JointTrajectory)> {
        ROUNDINGS.into_iter().find_map(|rounding| {
            let paths = self.fastest(waypoints, rounding)?;
            let trajectory = self.motion(&Transfer::Around(paths.clone()), line);
            let free = self.checker.first_collision(&trajectory).is_none();
            free.then_some((paths, trajectory))
        })
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

    fn blocked(&self, violation: &Violation, search: Option<&SearchEffort>) -> Rejection {
        let (a, b) = violation.pair.solid_names(self.cell());
        let place = format!(
            "{a} and {b} in the {} at {:.2} s",
            violation.phase.name(),
            violation.time_s
        );
        match search {
            Some(effort) => Rejection {
                rule: Rule::NoMotion,
                value: violation.pair.separation.distance_m,
                limit: violation.limit_m,
                unit: "m",
                detail: format!(
                    "no way around was found among {} random postures ({} looked at); the straight \
                     motion is blocked by {place}",
                    effort.samples, effort.checks
                ),
                class: Some(violation.pair.class),
            },
            None => Rejection {
                rule: Rule::Collision,
                value: violation.pair.separation.distance_m,
                limit: violation.limit_m,
                unit: "m",
                detail: place,
                class: Some(violation.pair.class),
            },
        }
    }

    /// Whole turns that keep the approach inside the joint ranges, shortest transfer first; at most
    /// one either way.
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

fn blocked_approach(error: &LineError, approach_m: f64) -> Rejection {
    let free_m = match error {
        LineError::Singular { travelled_m, .. } | LineError::OutOfReach { travelled_m } => {
            *travelled_m
        }
    };
    Rejection {
        rule: Rule::Approach,
        value: free_m,
        limit: approach_m,
        unit: "m",
        detail: error.to_string(),
        class: None,
    }
}
