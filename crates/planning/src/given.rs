//! A motion that somebody else planned, as a plan: the posture that it holds, and the rules that it violates.

use std::f64::consts::TAU;

use needlebench_cell::Rule;
use needlebench_clearance::{ClassCertificate, ClassMinima, MotionCertificate};
use needlebench_kinematics::ik::{Configuration, Solution};
use needlebench_kinematics::trajectory::JointTrajectory;
use needlebench_kinematics::{JOINT_COUNT, Joints, Pose, rotation_angle_between};
use needlebench_scenario::{Goal, Roll};

use crate::motion_plan::ConfigurationPlan;
use crate::planner::Planner;
use crate::{Rejection, route_rejection};

/// A posture that is held at a goal, beside the solution of the goal's pose that is nearest to it.
#[derive(Debug, Clone, PartialEq)]
pub struct Held {
    /// Joint positions that are held, rad.
    pub joints: Joints,
    /// Angle of the guide about the needle, rad, in `[0, 2 pi)`.
    pub roll_rad: f64,
    /// Distance of the guide's exit from its planned place, m.
    pub off_m: f64,
    /// Angle between the guide and the planned needle, rad; of a goal with a fixed roll, between the two orientations.
    pub off_rad: f64,
    /// The nearest of the eight; none if the pose has no solution at that roll.
    pub nearest: Option<Nearest>,
}

/// The solution of a goal's pose that is nearest to a posture.
#[derive(Debug, Clone, PartialEq)]
pub struct Nearest {
    /// The solution, at the posture's roll, each joint in `[-pi, pi]`.
    pub solution: Solution,
    /// Its 2π equivalent that is nearest to the posture, as full revolutions of each joint.
    pub turns: [i32; JOINT_COUNT],
    /// Largest difference of a joint from it then, rad.
    pub off_rad: f64,
}

/// A motion that is judged.
#[derive(Debug, Clone, PartialEq)]
pub struct GivenMotion {
    /// Until the end of the hold.
    pub trajectory: JointTrajectory,
    /// What follows the hold, if the motion goes on.
    pub retreat: Option<JointTrajectory>,
}

impl Planner<'_> {
    /// A posture as one that is held at a goal, at the roll that it has there.
    pub fn held(&self, goal: &Goal, joints: &Joints) -> Held {
        let cell = self.cell();
        let base_link_from_flange = self.kinematics().base_link_from_flange(joints);
        let exit = cell.robot.world_from_base_link
            * base_link_from_flange
            * cell.tool.flange_from_guide_exit;
        let roll_rad = match goal.roll {
            Roll::Fixed(roll_rad) => roll_rad,
            Roll::Free => {
                // The turn about the needle that brings the planned guide nearest to this one.
                let planned = goal.world_from_guide_exit_at(0.0).rotation;
                let turn = (planned.inverse() * exit.rotation).to_rotation_matrix();
                let roll_rad =
                    libm::atan2(turn[(1, 0)] - turn[(0, 1)], turn[(0, 0)] + turn[(1, 1)]);
                roll_rad.rem_euclid(TAU)
            }
        };
        let planned = goal.world_from_guide_exit_at(roll_rad);
        let pose = self.base_link_from_flange(goal, roll_rad);
        Held {
            joints: *joints,
            roll_rad,
            off_m: (exit.translation.vector - planned.translation.vector).norm(),
            off_rad: rotation_angle_between(&exit.rotation, &planned.rotation),
            nearest: self.nearest(&pose, joints),
        }
    }

    /// The solution of a pose of the flange in `base_link` that is nearest to a posture; none of a pose without any.
    pub fn nearest(&self, base_link_from_flange: &Pose, joints: &Joints) -> Option<Nearest> {
        let found = self
            .kinematics()
            .branches(base_link_from_flange, Some(joints));
        let all = found.solutions.into_iter().map(|solution| {
            let off = (joints - solution.joints) / TAU;
            let turns: [i32; JOINT_COUNT] = std::array::from_fn(|joint| whole(off[joint]));
            let left = Joints::from_fn(|joint, _| (off[joint] - f64::from(turns[joint])) * TAU);
            Nearest {
                off_rad: left.amax(),
                turns,
                solution,
            }
        });
        all.min_by(|a, b| a.off_rad.total_cmp(&b.off_rad))
    }

    /// Clearances of a solution's posture, and all rules that it violates.
    pub fn posture_rules(&self, solution: &Solution) -> (ClassMinima, Vec<Rejection>) {
        let mut rejections = self.joint_rules(solution);
        let (clearance, broken) = self.clearance_rules(&solution.joints);
        rejections.extend(broken);
        (clearance, rejections)
    }

    /// The plan that a given motion is: its certified clearances, and the rules that its posture and its course violate.
    ///
    /// The posture is the held one, off its goal or not; margins and singularities are its own.
    pub fn given(
        &self,
        goal: &Goal,
        configuration: Configuration,
        held: &Held,
        motion: GivenMotion,
    ) -> ConfigurationPlan {
        let mut rejections: Vec<Rejection> =
            route_rejection(self.resolved, goal).into_iter().collect();
        let (clearance, broken) = self.clearance_rules(&held.joints);
        let candidate = held.nearest.as_ref().map(|nearest| {
            let solution = Solution {
                joints: held.joints,
                residual_m: held.off_m,
                residual_rad: held.off_rad,
                ..nearest.solution
            };
            rejections.extend(self.joint_rules(&solution));
            let mut candidate = self.with_clearance(held.roll_rad, &solution, &clearance);
            candidate.wrap = nearest.turns;
            candidate
        });
        if candidate.is_none() {
            rejections.push(Rejection {
                rule: Rule::Unreachable,
                value: held.off_m,
                limit: 0.0,
                unit: "m",
                detail: "at the roll of the held posture the goal's pose has no solution"
                    .to_owned(),
                class: None,
            });
        }
        rejections.extend(broken);
        let certificate = self.checker.certificate(&motion.trajectory);
        let retreat = motion.retreat.as_ref();
        let retreat_certificate = retreat.map(|retreat| self.checker.certificate(retreat));
        // What the posture violates, its motion does too.
        if rejections.is_empty() {
            rejections.extend(self.nearest_in(&certificate, "t"));
            let behind = retreat_certificate.as_ref();
            rejections.extend(behind.and_then(|each| self.nearest_in(each, "after the hold, t")));
        }
        ConfigurationPlan {
            candidate,
            rejections,
            trajectory: Some(motion.trajectory),
            retreat: motion.retreat,
            certificate: Some(certificate),
            ..ConfigurationPlan::nothing(configuration)
        }
    }

    /// What comes nearer along a motion than it may, if anything does.
    fn nearest_in(&self, certificate: &MotionCertificate, clock: &str) -> Option<Rejection> {
        let found: &ClassCertificate = self.deepest(certificate)?;
        let [a, b] = found.attained.in_words(self.cell());
        let class = found.attained.class;
        let (rule, does, value) = Self::broken(found);
        Some(Rejection {
            rule,
            value,
            limit: self.limits().get(class).floor_m,
            unit: "m",
            detail: format!(
                "{a} {does} {b} in the {} ({clock} = {:.3} s)",
                found.phase.name(),
                found.time_s
            ),
            class: Some(class),
        })
    }
}

#[expect(clippy::cast_possible_truncation, reason = "joints turn a few times")]
fn whole(turns: f64) -> i32 {
    turns.round() as i32
}
