//! Solver and checker that plans are made with, and the evaluation of one posture.

use std::sync::OnceLock;

use needlebench_cell::{Cell, ClearanceClass, Rule, part_in_words};
use needlebench_clearance::{ClassMinima, ClearanceModel, Nearby};
use needlebench_kinematics::ik::{Configuration, Kinematics, Solution, SolutionKind, Solutions};
use needlebench_kinematics::{JOINT_COUNT, JOINT_LABELS, Joints, NotUrGeometry, Pose};
use needlebench_scenario::scenario::PlanningSection;
use needlebench_scenario::{Goal, ResolvedScenario};

use crate::Rejection;
use crate::limits::{ByClass, ClassLimits};
use crate::motion::MotionChecker;
use crate::rejection::of_distance;

/// Margins of a final posture from joint limits and singularities.
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

/// Distances of a posture from the three singularities, as in [`PostureMargins`].
struct Singularity {
    wrist_sine: f64,
    elbow_sine: f64,
    shoulder_m: f64,
}

/// A posture that brings the guide to its planned pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Final joint positions, rad, wrapped as the motion reaches them.
    pub joints: Joints,
    /// Angle of the guide about the needle, rad.
    pub roll_rad: f64,
    /// 2π equivalent: full revolutions added to the positions in `(-pi, pi]`.
    pub wrap: [i32; JOINT_COUNT],
    /// Distance of the flange from its planned position, m.
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

/// Plans the goals of one scenario.
#[derive(Debug)]
pub struct Planner<'a> {
    pub(crate) resolved: &'a ResolvedScenario,
    kinematics: Kinematics,
    pub(crate) checker: MotionChecker<'a>,
    /// Keys of the scenario's `[ranking]` with weights and utilities.
    ranking_aims: Vec<(&'static str, needlebench_scenario::ranking::Aim)>,
    /// Least clearances of the start posture, of bodies alone; found when a motion is planned.
    start_clearance: OnceLock<ByClass>,
}

impl<'a> Planner<'a> {
    /// Prepares the planner.
    ///
    /// # Errors
    /// [`NotUrGeometry`] if the robot is not a UR arm.
    pub fn new(
        resolved: &'a ResolvedScenario,
        clearance: &'a ClearanceModel,
    ) -> Result<Self, NotUrGeometry> {
        let kinematics = Kinematics::new(resolved.cell.robot.chain)?;
        Ok(Self::with_solver(resolved, clearance, &kinematics))
    }

    /// [`Planner::new`] with the solver of another planner, if that is of the same chain.
    ///
    /// # Errors
    /// As [`Planner::new`].
    pub fn like(
        resolved: &'a ResolvedScenario,
        clearance: &'a ClearanceModel,
        known: &Kinematics,
    ) -> Result<Self, NotUrGeometry> {
        if known.chain == resolved.cell.robot.chain {
            Ok(Self::with_solver(resolved, clearance, known))
        } else {
            Self::new(resolved, clearance)
        }
    }

    fn with_solver(
        resolved: &'a ResolvedScenario,
        clearance: &'a ClearanceModel,
        kinematics: &Kinematics,
    ) -> Self {
        let planning = &resolved.scenario.planning;
        Self {
            resolved,
            kinematics: kinematics.within(resolved.cell.robot.limits),
            checker: MotionChecker::new(
                &resolved.cell,
                clearance,
                ClassLimits::of(&resolved.scenario),
                planning,
            ),
            ranking_aims: resolved.scenario.ranking.aims().to_vec(),
            start_clearance: OnceLock::new(),
        }
    }

    pub(crate) fn cell(&self) -> &Cell {
        &self.resolved.cell
    }

    pub(crate) fn start(&self) -> &Joints {
        &self.resolved.start
    }

    /// Least clearances of the start posture.
    pub(crate) fn start_clearance(&self) -> &ByClass {
        self.start_clearance.get_or_init(|| {
            let minima = self.checker.model.minimum_per_class(self.start());
            ByClass::of_posture(&minima).of_bodies()
        })
    }

    pub(crate) fn planning(&self) -> &PlanningSection {
        &self.resolved.scenario.planning
    }

    pub(crate) fn ranking_aims(&self) -> &[(&'static str, needlebench_scenario::ranking::Aim)] {
        &self.ranking_aims
    }

    /// Limits and desired values of clearances.
    pub fn limits(&self) -> &ClassLimits {
        &self.checker.limits
    }

    /// The solver, for callers that need poses of their own.
    pub fn kinematics(&self) -> &Kinematics {
        &self.kinematics
    }

    /// Pose of the flange in `base_link` that brings the guide to a goal.
    pub fn base_link_from_flange(&self, goal: &Goal, roll_rad: f64) -> Pose {
        crate::reach::base_link_from_flange(self.resolved, goal, roll_rad)
    }

    /// Rolls that are evaluated: the full circle if it is free, else the one.
    pub fn rolls(&self, goal: &Goal, count: u32) -> Vec<f64> {
        crate::reach::rolls(goal, count)
    }

    /// Margins, clearances and violated rules of one posture. `nearby` is of the posture before.
    pub(crate) fn candidate(
        &self,
        roll_rad: f64,
        solution: &Solution,
        nearby: &mut Nearby,
    ) -> (Candidate, Vec<Rejection>) {
        let mut rejections = self.joint_rules(solution);
        let (clearance, broken) = self.clearance_rules_near(&solution.joints, nearby);
        rejections.extend(broken);
        (
            self.with_clearance(roll_rad, solution, &clearance),
            rejections,
        )
    }

    pub(crate) fn with_clearance(
        &self,
        roll_rad: f64,
        solution: &Solution,
        clearance: &ClassMinima,
    ) -> Candidate {
        Candidate {
            joints: solution.joints,
            roll_rad,
            wrap: [0; JOINT_COUNT],
            residual_m: solution.residual_m,
            residual_rad: solution.residual_rad,
            wrist_3_is_free: solution.wrist_3_is_free,
            margins: self.margins(&solution.joints),
            clearance: *clearance,
        }
    }

    /// Joint positions of a configuration that brings the guide to a goal at a roll, if it reaches it and
    /// violates no rule about its joints: the result of [`Planner::member_at`] without clearances.
    pub fn reached(
        &self,
        goal: &Goal,
        configuration: Configuration,
        roll_rad: f64,
    ) -> Option<Joints> {
        let pose = self.base_link_from_flange(goal, roll_rad);
        let kinematics = self.kinematics();
        let solution = kinematics.branch(&pose, Some(self.start()), configuration)?;
        let is_sound = self.joint_rules(&solution).is_empty();
        is_sound.then_some(solution.joints)
    }

    /// Whether a posture violates no rule: the result of [`Planner::candidate`], without numbers.
    pub(crate) fn works(&self, solution: &Solution, nearby: &mut Nearby) -> bool {
        self.joint_rules(solution).is_empty()
            && self.checker.is_free(&solution.joints, nearby, |class| {
                self.limits().get(class).floor_m
            })
    }

    /// The rules that the joint positions alone violate.
    pub(crate) fn joint_rules(&self, solution: &Solution) -> Vec<Rejection> {
        let planning = &self.resolved.scenario.planning;
        let limits = &self.resolved.cell.robot.limits;
        let mut rejections = Vec::new();
        if solution.kind == SolutionKind::Nearest {
            rejections.push(Rejection {
                rule: Rule::NearestOnly,
                value: solution.residual_m,
                limit: 1e-9,
                unit: "m",
                detail: "the refined posture does not attain the pose".to_owned(),
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
                    detail: format!("{label} is outside its range"),
                    class: None,
                });
            }
        }
        let Singularity {
            wrist_sine,
            elbow_sine,
            shoulder_m,
        } = self.singularity(&solution.joints);
        for (value, limit, unit, detail) in [
            (
                wrist_sine,
                planning.min_singularity_sine,
                "1",
                "wrist: |sin q5|",
            ),
            (
                elbow_sine,
                planning.min_singularity_sine,
                "1",
                "elbow: |sin q3|",
            ),
            (
                shoulder_m,
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
        rejections
    }

    /// Minimum clearances of a posture, and the rules about them that it violates.
    pub fn clearance_rules(&self, q: &Joints) -> (ClassMinima, Vec<Rejection>) {
        self.clearance_rules_near(q, &mut Nearby::default())
    }

    fn clearance_rules_near(
        &self,
        q: &Joints,
        nearby: &mut Nearby,
    ) -> (ClassMinima, Vec<Rejection>) {
        let mut rejections = Vec::new();
        let (clearance, collision) = self.checker.posture(q, nearby);
        if let Some(pair) = collision {
            let (rule, does) = of_distance(pair.separation.distance_m);
            rejections.push(Rejection {
                rule,
                value: pair.separation.distance_m,
                limit: self.checker.limit_m(pair.class),
                unit: "m",
                detail: {
                    let [a, b] = pair.in_words(&self.resolved.cell);
                    format!("{a} {does} {b} in the final posture")
                },
                class: Some(pair.class),
            });
        }
        if let Some(corridor) = clearance.get(ClearanceClass::NeedleCorridor)
            && self.planning().require_needle_corridor
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
                detail: format!("{} blocks the access zone", part_in_words(blocker)),
                class: Some(ClearanceClass::NeedleCorridor),
            });
        }
        (clearance, rejections)
    }

    fn singularity(&self, q: &Joints) -> Singularity {
        Singularity {
            wrist_sine: libm::sin(q[4]).abs(),
            elbow_sine: libm::sin(q[2]).abs(),
            shoulder_m: self.kinematics.geometry.wrist_forward_m(q).abs(),
        }
    }

    pub(crate) fn margins(&self, q: &Joints) -> PostureMargins {
        let jacobian = self.kinematics.chain.jacobian(q);
        let Singularity {
            wrist_sine,
            elbow_sine,
            shoulder_m,
        } = self.singularity(q);
        PostureMargins {
            joint_limit: self.resolved.cell.robot.limits.margin(q),
            wrist_sine,
            elbow_sine,
            shoulder_m,
            manipulability: jacobian.determinant().abs(),
        }
    }
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
        Unreachable::WristTooNear { .. } => "out of reach, wrist too close to the shoulder axis",
        Unreachable::ElbowTooShort { .. } => "out of reach, upper arm and forearm too short",
        Unreachable::ElbowTooLong { .. } => "out of reach, elbow cannot fold far enough",
        Unreachable::NoCounterpart { .. } => {
            "within reach of the nominal arm, not of the calibrated one"
        }
        Unreachable::NotFinite => "the pose is not finite",
        Unreachable::NotARotation => "the orientation is not a rotation",
        Unreachable::TooFar { .. } => "out of reach, pose farther away than any arm reaches",
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
            Some(twin) => format!("{configuration} coincides with {}", twin.configuration),
            None => format!("{configuration} does not exist at this pose"),
        },
        class: None,
    }
}
