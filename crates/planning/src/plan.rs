//! Candidates for each configuration of a goal.

use std::f64::consts::TAU;

use needlebench_cell::scenario::PlanningSection;
use needlebench_cell::{Cell, ClearanceClass, Goal, ResolvedScenario, Roll};
use needlebench_clearance::{ClassMinima, ClearanceModel};
use needlebench_kinematics::ik::{
    Configuration, Kinematics, Solution, SolutionKind, Solutions, wrap_angle,
};
use needlebench_kinematics::trajectory::JointTrajectory;
use needlebench_kinematics::{JOINT_COUNT, JOINT_LABELS, Joints, NotUrGeometry, Pose};

use crate::family::Member;
use crate::motion::MotionChecker;
use crate::{Rejection, Rule};

/// Where a final posture stands between its limits and singularities.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PostureMargins {
    /// 1 in the middle of every joint's range, 0 at a limit.
    pub joint_limit: f64,
    /// `|sin q5|`.
    pub wrist_sine: f64,
    /// `|sin q3|`.
    pub elbow_sine: f64,
    /// `sqrt(rho^2 - d4^2)`, m.
    pub shoulder_m: f64,
    /// `sqrt(det J J^T)` of the flange.
    pub manipulability: f64,
}

/// A posture that brings the guide to its place.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Final joint positions, rad, wrapped as the motion reaches them.
    pub joints: Joints,
    /// Angle of the guide about the needle, rad.
    pub roll_rad: f64,
    /// Whole turns that were added to the positions in `(-pi, pi]`.
    pub wrap: [i32; JOINT_COUNT],
    /// Distance of the flange from its planned place, m.
    pub residual_m: f64,
    /// Angle of the flange from its planned orientation, rad.
    pub residual_rad: f64,
    /// Wrist 3 is free at this pose.
    pub wrist_3_is_free: bool,
    /// Margins of the posture.
    pub margins: PostureMargins,
    /// Least clearance of the final posture, per class.
    pub clearance: ClassMinima,
}

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

/// All eight configurations of one goal.
#[derive(Debug, Clone, PartialEq)]
pub struct GoalPlan {
    /// The configurations, in the order of [`Configuration::ALL`].
    pub configurations: Vec<ConfigurationPlan>,
}

/// Plans the goals of one scenario.
#[derive(Debug)]
pub struct Planner<'a> {
    pub(crate) resolved: &'a ResolvedScenario,
    kinematics: Kinematics,
    pub(crate) checker: MotionChecker<'a>,
    /// Keys of the scenario's `[ranking]` with weights and utilities.
    ranking_aims: Vec<(&'static str, needlebench_cell::ranking::Aim)>,
}

/// Postures of one configuration for which a motion is tried, best first.
const MOTION_TRIES: usize = 12;
/// Postures of one configuration for which a way around is searched where the straight motion is
/// blocked.
const SEARCH_TRIES: usize = 3;

impl<'a> Planner<'a> {
    /// Prepares the planner.
    ///
    /// # Errors
    /// [`NotUrGeometry`] if the robot is not a UR arm.
    pub fn new(
        resolved: &'a ResolvedScenario,
        clearance: &'a ClearanceModel,
    ) -> Result<Self, NotUrGeometry> {
        let planning = &resolved.scenario.planning;
        Ok(Self {
            resolved,
            kinematics: Kinematics::new(resolved.cell.robot.chain)?
                .within(resolved.cell.robot.limits),
            checker: MotionChecker::new(
                &resolved.cell,
                clearance,
                planning.min_clearance_mm * 1e-3,
                planning.min_self_clearance_mm * 1e-3,
                planning.sample_spacing_mm * 1e-3,
            ),
            ranking_aims: resolved.scenario.ranking.aims().to_vec(),
        })
    }

    pub(crate) fn cell(&self) -> &Cell {
        &self.resolved.cell
    }

    pub(crate) fn start(&self) -> &Joints {
        &self.resolved.start
    }

    pub(crate) fn planning(&self) -> &PlanningSection {
        &self.resolved.scenario.planning
    }

    pub(crate) fn ranking_aims(&self) -> &[(&'static str, needlebench_cell::ranking::Aim)] {
        &self.ranking_aims
    }

    /// Least clearance that a class of physical bodies may have, m.
    pub(crate) fn limit_m(&self, class: ClearanceClass) -> f64 {
        self.checker.limit_m(class)
    }

    /// The solver, for callers that need poses of their own.
    pub fn kinematics(&self) -> &Kinematics {
        &self.kinematics
    }

    /// Pose of the flange in `base_link` that brings the guide to a goal.
    pub fn base_link_from_flange(&self, goal: &Goal, roll_rad: f64) -> Pose {
        let cell = &self.resolved.cell;
        cell.robot.world_from_base_link.inverse()
            * goal.world_from_guide_exit_at(roll_rad)
            * cell.tool.flange_from_guide_exit.inverse()
    }

    /// Rolls that are looked at: all round where it is free, else the one.
    pub fn rolls(&self, goal: &Goal, count: u32) -> Vec<f64> {
        match goal.roll {
            Roll::Fixed(roll_rad) => vec![roll_rad],
            Roll::Free => (0..count)
                .map(|k| TAU * f64::from(k) / f64::from(count))
                .collect(),
        }
    }

    /// Plans all eight configurations of a goal.
    pub fn plan(&self, goal: &Goal) -> GoalPlan {
        let configurations = Configuration::ALL
            .into_iter()
            .zip(self.grids(goal))
            .map(|(configuration, grid)| self.plan_configuration(goal, configuration, grid))
            .collect();
        GoalPlan { configurations }
    }

    /// For each of the eight configurations the posture that a plan tries first: of those that break
    /// no rule the best by the scenario's `roll_aim`, else the one that comes nearest to working. No
    /// motions are looked at.
    pub fn postures(&self, goal: &Goal) -> [Member; 8] {
        if let Roll::Fixed(roll_rad) = goal.roll {
            return self.members_at(goal, roll_rad);
        }
        let mut grids = self.grids(goal).into_iter();
        Configuration::ALL.map(|configuration| {
            let grid = grids.next().expect("there are eight");
            let ranked = self.ranked(goal, configuration, &grid);
            ranked.into_iter().next().unwrap_or_else(|| nearest(grid))
        })
    }

    /// All members at the rolls that are looked at, by configuration.
    fn grids(&self, goal: &Goal) -> [Vec<Member>; 8] {
        let rolls = self.rolls(goal, self.planning().roll_samples);
        let mut grids: [Vec<Member>; 8] = std::array::from_fn(|_| Vec::with_capacity(rolls.len()));
        for &roll_rad in &rolls {
            for (grid, member) in grids.iter_mut().zip(self.members_at(goal, roll_rad)) {
                grid.push(member);
            }
        }
        grids
    }

    /// Members with a posture: those that work, best first, or if none does all, nearest to working
    /// first.
    fn ranked(&self, goal: &Goal, configuration: Configuration, grid: &[Member]) -> Vec<Member> {
        let aim = self.planning().roll_aim;
        // The best of each range that works, then the rest of what works.
        let mut members: Vec<Member> = self
            .family_for(goal, configuration, grid, &[aim])
            .ranges
            .into_iter()
            .map(|range| range.best_for(aim).member.clone())
            .collect();
        let some_work = !members.is_empty();
        let of_grid = grid
            .iter()
            .filter(|member| member.candidate.is_some() && (member.works() || !some_work));
        members.extend(of_grid.cloned());
        // Equal ones stay in the order of roll.
        if some_work {
            members.sort_by(|a, b| {
                let value = |member: &Member| {
                    let candidate = member.candidate.as_ref();
                    candidate.map_or(f64::NEG_INFINITY, |each| self.value(goal, aim, each))
                };
                value(b).total_cmp(&value(a))
            });
        } else {
            members.sort_by(|a, b| b.surplus.total_cmp(&a.surplus));
        }
        members
    }

    fn plan_configuration(
        &self,
        goal: &Goal,
        configuration: Configuration,
        grid: Vec<Member>,
    ) -> ConfigurationPlan {
        let members = self.ranked(goal, configuration, &grid);
        let candidates: Vec<(Candidate, Vec<Rejection>)> = members
            .into_iter()
            .filter_map(|member| Some((member.candidate?, member.rejections)))
            .collect();
        if candidates.is_empty() {
            let rejections = nearest(grid).rejections;
            return ConfigurationPlan {
                configuration,
                candidate: None,
                rejections,
                trajectory: None,
                retreat: None,
                search: None,
            };
        }
        let mut best: Option<ConfigurationPlan> = None;
        let mut blocked = Vec::new();
        for (candidate, rejections) in spread_over_rolls(candidates).into_iter().take(MOTION_TRIES)
        {
            // The best posture breaks a rule, so all do: one motion shows what would happen.
            let hopeless = !rejections.is_empty();
            let plan = self.plan_motion(goal, configuration, candidate.clone(), rejections, None);
            if plan.rejections.is_empty() {
                return plan;
            }
            if hopeless {
                return best.unwrap_or(plan);
            }
            blocked.push(candidate);
            let better = best
                .as_ref()
                .is_none_or(|known| plan.trajectory.is_some() && known.trajectory.is_none());
            if better {
                best = Some(plan);
            }
        }
        // No straight motion to any of them: a way around is searched for the best ones.
        let mut checks_left = u64::from(self.planning().motion_checks);
        for candidate in blocked.into_iter().take(SEARCH_TRIES) {
            if checks_left == 0 {
                break;
            }
            let plan = self.plan_motion(
                goal,
                configuration,
                candidate,
                Vec::new(),
                Some(&mut checks_left),
            );
            if plan.rejections.is_empty() {
                return plan;
            }
            let searched = plan.rejections[0].rule == Rule::NoMotion;
            let better = best
                .as_ref()
                .is_none_or(|known| searched && known.rejections[0].rule != Rule::NoMotion);
            if better {
                best = Some(plan);
            }
        }
        best.expect("there is at least one candidate")
    }

    /// Margins, clearances and broken rules of one posture.
    pub(crate) fn candidate(
        &self,
        roll_rad: f64,
        solution: &Solution,
    ) -> (Candidate, Vec<Rejection>) {
        let planning = &self.resolved.scenario.planning;
        let limits = &self.resolved.cell.robot.limits;
        let mut rejections = Vec::new();
        if solution.kind == SolutionKind::Nearest {
            rejections.push(Rejection {
                rule: Rule::NearestOnly,
                value: solution.residual_m,
                limit: 1e-9,
                unit: "m",
                detail: "the refined posture misses the pose".to_owned(),
                class: None,
            });
        }
        for (joint, label) in JOINT_LABELS.into_iter().enumerate() {
            if limits.0[joint].turns(solution.joints[joint]).is_none() {
                let (position, limit) = (solution.joints[joint], limits.0[joint]);
                rejections.push(Rejection {
                    rule: Rule::JointLimit,
                    value: position,
                    limit: if position > limit.upper_rad {
                        limit.upper_rad
                    } else {
                        limit.lower_rad
                    },
                    unit: "rad",
                    detail: format!("{label} has no place in its range"),
                    class: None,
                });
            }
        }
        let margins = self.margins(&solution.joints);
        for (value, limit, unit, detail) in [
            (
                margins.wrist_sine,
                planning.min_singularity_sine,
                "1",
                "wrist: |sin q5|",
            ),
            (
                margins.elbow_sine,
                planning.min_singularity_sine,
                "1",
                "elbow: |sin q3|",
            ),
            (
                margins.shoulder_m,
                planning.min_shoulder_distance_mm * 1e-3,
                "m",
                "shoulder: sqrt(rho^2 - d4^2)",
            ),
        ] {
            if value < limit {
                rejections.push(Rejection {
                    rule: Rule::Singular,
                    value,
                    limit,
                    unit,
                    detail: detail.to_owned(),
                    class: None,
                });
            }
        }
        let (clearance, collision) = self.checker.posture(&solution.joints);
        if let Some(pair) = collision {
            rejections.push(Rejection {
                rule: Rule::Collision,
                value: pair.separation.distance_m,
                limit: self.checker.limit_m(pair.class),
                unit: "m",
                detail: {
                    let (a, b) = pair.solid_names(&self.resolved.cell);
                    format!("{a} and {b} in the final posture")
                },
                class: Some(pair.class),
            });
        }
        if let Some(corridor) = clearance.get(ClearanceClass::NeedleCorridor)
            && planning.require_needle_corridor
            && corridor.separation.distance_m < 0.0
        {
            let (a, b) = corridor.solid_names(&self.resolved.cell);
            let blocker = match a {
                "needle_corridor" | "hand_cone" => b,
                _ => a,
            };
            rejections.push(Rejection {
                rule: Rule::NeedleCorridor,
                value: corridor.separation.distance_m,
                limit: 0.0,
                unit: "m",
                detail: format!("{blocker} stands behind the guide"),
                class: Some(ClearanceClass::NeedleCorridor),
            });
        }
        let candidate = Candidate {
            joints: solution.joints,
            roll_rad,
            wrap: [0; JOINT_COUNT],
            residual_m: solution.residual_m,
            residual_rad: solution.residual_rad,
            wrist_3_is_free: solution.wrist_3_is_free,
            margins,
            clearance,
        };
        (candidate, rejections)
    }

    pub(crate) fn margins(&self, q: &Joints) -> PostureMargins {
        let jacobian = self.kinematics.chain.jacobian(q);
        PostureMargins {
            joint_limit: self.resolved.cell.robot.limits.margin(q),
            wrist_sine: q[4].sin().abs(),
            elbow_sine: q[2].sin().abs(),
            shoulder_m: self.kinematics.geometry.wrist_forward_m(q).abs(),
            manipulability: jacobian.determinant().abs(),
        }
    }
}

/// Of members without a posture the one that comes nearest, which says most, with the rule that it
/// breaks.
fn nearest(grid: Vec<Member>) -> Member {
    let missing = |member: &Member| {
        let values = member.rejections.iter().map(|rejection| rejection.value);
        values.fold(f64::INFINITY, f64::min)
    };
    grid.into_iter()
        .min_by(|a, b| missing(a).total_cmp(&missing(b)))
        .expect("at least one roll is looked at")
}

/// Angle between two rolls that count as different for a motion, rad.
const ROLL_SPREAD_RAD: f64 = 0.5;

/// The same candidates, those first that are best within their neighbourhood of rolls: where the
/// motion to one roll collides, that to the next one mostly does too.
fn spread_over_rolls<T>(candidates: Vec<(Candidate, T)>) -> Vec<(Candidate, T)> {
    let mut first: Vec<(Candidate, T)> = Vec::new();
    let mut rest = Vec::new();
    for (candidate, extra) in candidates {
        let apart = |other: &Candidate| wrap_angle(candidate.roll_rad - other.roll_rad).abs();
        if first
            .iter()
            .all(|(other, _)| apart(other) >= ROLL_SPREAD_RAD)
        {
            first.push((candidate, extra));
        } else {
            rest.push((candidate, extra));
        }
    }
    first.extend(rest);
    first
}

/// Why a configuration is not among the solutions of a pose.
pub(crate) fn absent(configuration: Configuration, found: &Solutions) -> Rejection {
    match found.unreachable.iter().find(|(c, _)| *c == configuration) {
        Some((_, reason)) => Rejection {
            rule: Rule::Unreachable,
            value: reason.missing_m(),
            limit: 0.0,
            unit: "m",
            detail: unreachable_detail(*reason),
            class: None,
        },
        None => merged(configuration, &found.solutions),
    }
}

fn unreachable_detail(reason: needlebench_kinematics::ik::Unreachable) -> String {
    use needlebench_kinematics::ik::Unreachable;
    match reason {
        Unreachable::WristTooNear { .. } => "the wrist is too near to the shoulder axis",
        Unreachable::ElbowTooShort { .. } => "upper arm and forearm are too short",
        Unreachable::ElbowTooLong { .. } => "the elbow cannot fold so far",
        Unreachable::NoCounterpart { .. } => {
            "the nominal arm reaches the pose, the calibrated one does not"
        }
        Unreachable::NotFinite => "the pose is not finite",
    }
    .to_owned()
}

fn merged(configuration: Configuration, solutions: &[Solution]) -> Rejection {
    let twin = solutions
        .iter()
        .find(|each| each.merged || each.wrist_3_is_free);
    Rejection {
        rule: Rule::Merged,
        value: 0.0,
        limit: 0.0,
        unit: "1",
        detail: match twin {
            Some(twin) => format!(
                "{configuration} is the same posture as {}",
                twin.configuration
            ),
            None => format!("{configuration} does not exist at this pose"),
        },
        class: None,
    }
}
