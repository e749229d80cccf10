//! Feasibility and clearance of the eight configurations at a goal.

use std::f64::consts::TAU;

use nalgebra::{UnitQuaternion, Vector3};
use needlebench_cell::ClearanceClass;
use needlebench_clearance::PairClearance;
use needlebench_kinematics::ik::{Configuration, Kinematics, Solution, SolutionKind, Solutions};
use needlebench_kinematics::{JOINT_COUNT, Joints, Pose};
use needlebench_scenario::Roll;

use crate::live::Live;
use crate::scene::CLASS_COUNT;

/// Halvings of the step between rolls: 0.01 deg from 10 deg.
const HALVINGS: u32 = 10;

/// Outcome of a configuration, from worst to best.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Outcome {
    /// It does not reach the goal.
    Unreachable,
    /// It coincides with another configuration.
    Merged,
    /// A joint is beyond its limits.
    JointLimit,
    /// It is too close to a singularity.
    Singular,
    /// A clearance is below the scenario's floor.
    TooNear,
    /// No rule is violated, but a criterion on clearances fails.
    Misses,
    /// The posture is feasible.
    Works,
}

/// A configuration at the best of the rolls that were checked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reach {
    /// Its outcome.
    pub outcome: Outcome,
    /// Angle of the guide about the needle, rad.
    pub roll_rad: f64,
    /// Joint positions within their ranges, rad, where it reaches the goal.
    pub joints: Option<Joints>,
    /// Order of rolls with the same outcome: constraint margin, or the shortfall to a goal out of reach
    /// (negative), m.
    pub surplus_m: f64,
    /// The pair closest to its limit, where clearances were computed.
    pub nearest: Option<PairClearance>,
}

impl Reach {
    fn without_posture(outcome: Outcome, roll_rad: f64, surplus_m: f64) -> Self {
        Self {
            outcome,
            roll_rad,
            joints: None,
            surplus_m,
            nearest: None,
        }
    }

    fn is_better_than(&self, other: &Self) -> bool {
        (self.outcome, self.surplus_m) > (other.outcome, other.surplus_m)
    }
}

impl Live {
    /// All eight configurations at a goal, in the order of [`Configuration::ALL`]: each at the best roll
    /// found, from the best of `rolls` rolls over the full circle, or at the goal's roll if it is fixed. Empty
    /// for an arm without UR geometry.
    ///
    /// # Panics
    /// If there is no such goal.
    pub fn reach(&self, goal: usize, rolls: u32) -> Vec<Reach> {
        let Some(kinematics) = &self.kinematics else {
            return Vec::new();
        };
        let step_rad = TAU / f64::from(rolls);
        let (rolls, is_free) = match self.scene.goals[goal].roll {
            Roll::Fixed(roll_rad) => (vec![roll_rad], false),
            Roll::Free => ((0..rolls).map(|k| step_rad * f64::from(k)).collect(), true),
        };
        let mut best: Vec<Option<Reach>> = vec![None; Configuration::ALL.len()];
        for roll_rad in rolls {
            let pose = self.base_link_from_flange(goal, roll_rad);
            let found = kinematics.branches(&pose, Some(&self.scene.start));
            for (best, configuration) in best.iter_mut().zip(Configuration::ALL) {
                let reach = self.look(kinematics, configuration, roll_rad, &found);
                if best.is_none_or(|best| reach.is_better_than(&best)) {
                    *best = Some(reach);
                }
            }
        }
        let best = best.into_iter().flatten().zip(Configuration::ALL);
        best.map(|(reach, configuration)| {
            if is_free && reach.joints.is_some() && reach.outcome != Outcome::Works {
                self.climbed(goal, kinematics, configuration, reach, step_rad)
            } else {
                reach
            }
        })
        .collect()
    }

    /// The best roll found between a roll and its neighbours: a feasible range may lie between two of the
    /// grid.
    fn climbed(
        &self,
        goal: usize,
        kinematics: &Kinematics,
        configuration: Configuration,
        mut best: Reach,
        mut step_rad: f64,
    ) -> Reach {
        for _ in 0..HALVINGS {
            step_rad *= 0.5;
            for roll_rad in [best.roll_rad - step_rad, best.roll_rad + step_rad] {
                let roll_rad = roll_rad.rem_euclid(TAU);
                let pose = self.base_link_from_flange(goal, roll_rad);
                let found = kinematics.branches(&pose, Some(&self.scene.start));
                let reach = self.look(kinematics, configuration, roll_rad, &found);
                if reach.is_better_than(&best) {
                    best = reach;
                }
            }
        }
        best
    }

    fn base_link_from_flange(&self, goal: usize, roll_rad: f64) -> Pose {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), roll_rad);
        self.world_from_base_link.inverse()
            * (self.scene.goals[goal].world_from_guide_exit * turn)
            * self.scene.flange_from_guide_exit.inverse()
    }

    fn look(
        &self,
        kinematics: &Kinematics,
        configuration: Configuration,
        roll_rad: f64,
        found: &Solutions,
    ) -> Reach {
        let without = |outcome, surplus_m| Reach::without_posture(outcome, roll_rad, surplus_m);
        let mut solutions = found.solutions.iter();
        let solution = solutions.find(|solution| solution.configuration == configuration);
        let Some(solution) = solution.filter(|it| it.kind != SolutionKind::Nearest) else {
            let mut unreachable = found.unreachable.iter();
            return match unreachable.find(|(each, _)| *each == configuration) {
                Some((_, why)) => without(Outcome::Unreachable, -why.missing_m()),
                None => without(Outcome::Merged, 0.0),
            };
        };
        let Some(joints) = self.within_limits(solution) else {
            return without(Outcome::JointLimit, 0.0);
        };
        self.judged(kinematics, joints, roll_rad)
    }

    /// The 2 pi equivalent with every joint within its limits and the fewest turns.
    fn within_limits(&self, solution: &Solution) -> Option<Joints> {
        let mut joints = solution.joints;
        for joint in 0..JOINT_COUNT {
            let limit = self.scene.joint_limits.0[joint];
            let turns = limit.turns(joints[joint])?;
            let fewest = turns.min_by_key(|turns| turns.abs())?;
            joints[joint] = limit.admit(joints[joint] + TAU * f64::from(fewest))?;
        }
        Some(joints)
    }

    fn judged(&self, kinematics: &Kinematics, joints: Joints, roll_rad: f64) -> Reach {
        let limits = &self.scene.limits;
        let minima = self.model.minimum_per_class(&joints);
        // The least distance beyond the limits of the classes, and the pair that has it.
        let beyond = |limits_m: &[f64; CLASS_COUNT]| {
            let mut least = (f64::INFINITY, None);
            for pair in minima.iter() {
                let surplus_m = pair.separation.distance_m - limits_m[pair.class as usize];
                if surplus_m < least.0 {
                    least = (surplus_m, Some(*pair));
                }
            }
            least
        };
        let (over_floor_m, below_floor) = beyond(&limits.floor_m);
        let (over_judged_m, nearest) = beyond(&limits.judged_m);
        let sines = [joints[4], joints[2]].map(|q| libm::sin(q).abs());
        let is_singular = sines.iter().any(|sine| *sine < limits.singularity_sine)
            || kinematics.geometry.wrist_forward_m(&joints).abs() < limits.shoulder_m;
        let (outcome, surplus_m, nearest) = if is_singular {
            (Outcome::Singular, over_judged_m, nearest)
        } else if over_floor_m < 0.0 {
            (Outcome::TooNear, over_floor_m, below_floor)
        } else if over_judged_m < 0.0 {
            (Outcome::Misses, over_judged_m, nearest)
        } else {
            (Outcome::Works, over_judged_m, nearest)
        };
        Reach {
            outcome,
            roll_rad,
            joints: Some(joints),
            surplus_m,
            nearest,
        }
    }
}

/// The classes' order is the one that limits are given in.
const _: () = assert!(ClearanceClass::NeedleRoute as usize == CLASS_COUNT - 1);
