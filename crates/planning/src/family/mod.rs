//! Families: a configuration at every angle of the guide about the needle.
//!
//! Turning the guide about the needle changes nothing for the needle, so each of the eight
//! configurations is a one-parameter family of postures. Its members are looked at one by one, on a
//! grid of rolls; between the grid's rolls the edges of the ranges that work are bisected and the
//! best member is searched for.
//!
//! # What a sweep can miss
//!
//! A member works where its [`surplus`](Member::surplus) is not negative. The surplus is a
//! continuous function of roll as long as the branch exists, so between a roll that works and one
//! that does not there is an edge, and bisection finds it. A range, or a gap, that begins and ends
//! between two neighbouring rolls of the grid shows only as a local maximum or minimum of the
//! surplus; where a parabola through the three rolls next to one comes near to zero, it is searched
//! for. One that is narrower still and steeper than that is missed: a finer grid finds it.

mod aim;
mod ranges;

use needlebench_cell::{ClearanceClass, Goal};
use needlebench_kinematics::ik::{Configuration, Solutions};

pub use aim::Aim;
pub use ranges::{Best, EDGE_RAD, Edge, Family, RollRange};

use crate::planner::{Candidate, Planner, absent};
use crate::{Rejection, Rule};

/// One configuration at one angle of the guide about the needle.
#[derive(Debug, Clone, PartialEq)]
pub struct Member {
    /// Angle of the guide about the needle, rad.
    pub roll_rad: f64,
    /// The posture; `None` where the configuration does not reach the pose.
    pub candidate: Option<Candidate>,
    /// Rules that the posture breaks, first failing one first; empty if it works.
    pub rejections: Vec<Rejection>,
    /// Distance from breaking a rule, or how far the worst broken one is broken (negative): metres
    /// for clearances and reach, a tenth of a metre per unit for sines and radians.
    pub surplus: f64,
}

/// Metres that a unit of a sine or a radian counts in a [`Member::surplus`]: about the lever of the
/// wrist.
const METRES_PER_UNIT: f64 = 0.1;

/// Surplus of a configuration that is the same posture as another: it is at most at single rolls.
const MERGED_SURPLUS: f64 = -1e-12;

impl Member {
    /// The posture breaks no rule.
    pub fn works(&self) -> bool {
        self.rejections.is_empty()
    }

    /// The same where the needle's route is refused: the first rule that it breaks.
    #[must_use]
    pub fn on_route(mut self, refused: Option<&Rejection>) -> Self {
        if let Some(route) = refused {
            self.surplus = self.surplus.min(route.value - route.limit);
            self.rejections.insert(0, route.clone());
        }
        self
    }
}

impl Planner<'_> {
    /// All eight configurations at one roll, in the order of [`Configuration::ALL`]: postures only,
    /// no motions.
    pub fn members_at(&self, goal: &Goal, roll_rad: f64) -> [Member; 8] {
        let found = self.solutions_at(goal, roll_rad);
        Configuration::ALL.map(|configuration| self.member_of(roll_rad, configuration, &found))
    }

    /// One configuration at one roll.
    pub fn member_at(&self, goal: &Goal, configuration: Configuration, roll_rad: f64) -> Member {
        let found = self.solutions_at(goal, roll_rad);
        self.member_of(roll_rad, configuration, &found)
    }

    fn solutions_at(&self, goal: &Goal, roll_rad: f64) -> Solutions {
        let pose = self.base_link_from_flange(goal, roll_rad);
        self.kinematics().branches(&pose, Some(self.start()))
    }

    fn member_of(&self, roll_rad: f64, configuration: Configuration, found: &Solutions) -> Member {
        let solution = found
            .solutions
            .iter()
            .find(|each| each.configuration == configuration);
        if let Some(solution) = solution {
            let (candidate, rejections) = self.candidate(roll_rad, solution);
            return Member {
                roll_rad,
                surplus: self.surplus(&candidate, &rejections),
                candidate: Some(candidate),
                rejections,
            };
        }
        let rejection = absent(configuration, found);
        Member {
            roll_rad,
            candidate: None,
            surplus: if rejection.rule == Rule::Unreachable {
                -rejection.value.max(f64::MIN_POSITIVE)
            } else {
                MERGED_SURPLUS
            },
            rejections: vec![rejection],
        }
    }

    /// Least distance of a posture from breaking a rule.
    ///
    /// Of `rejections` those for its joint limits and for what it misses count: the others say what
    /// the candidate's own numbers say.
    pub fn surplus(&self, candidate: &Candidate, rejections: &[Rejection]) -> f64 {
        let planning = self.planning();
        let margins = &candidate.margins;
        let clearances = candidate.clearance.iter().map(|pair| {
            let limit_m = if pair.class.is_physical() {
                self.limit_m(pair.class)
            } else if pair.class == ClearanceClass::NeedleCorridor
                && planning.require_needle_corridor
            {
                0.0
            } else {
                f64::NEG_INFINITY
            };
            pair.separation.distance_m - limit_m
        });
        let sines = [margins.wrist_sine, margins.elbow_sine]
            .map(|sine| METRES_PER_UNIT * (sine - planning.min_singularity_sine));
        let shoulder = margins.shoulder_m - planning.min_shoulder_distance_mm * 1e-3;
        let others = rejections
            .iter()
            .filter_map(|rejection| match rejection.rule {
                Rule::JointLimit => {
                    Some(-METRES_PER_UNIT * (rejection.value - rejection.limit).abs())
                }
                Rule::NearestOnly => Some(rejection.limit - rejection.value),
                _ => None,
            });
        clearances
            .chain(sines)
            .chain([shoulder])
            .chain(others)
            .fold(f64::INFINITY, f64::min)
    }
}
