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

use needlebench_cell::Goal;
use needlebench_kinematics::ik::{Configuration, Solutions};

pub use aim::Aim;
pub use ranges::{Best, EDGE_RAD, Edge, Family, RollRange};

use crate::limits::{ByClass, Shortfall};
use crate::planner::{Candidate, Planner, PostureMargins, absent};
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

/// How good a posture is among those that break no rule; the order is that of preference.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub struct Merit {
    /// Of clearances, and of distances from singularities in its reserve.
    pub shortfall: Shortfall,
    /// Value for the aim.
    pub value: f64,
}

impl Merit {
    /// Less than any other.
    const NONE: Self = Self {
        shortfall: Shortfall {
            judged_m: f64::NEG_INFINITY,
            reserve_m: f64::NEG_INFINITY,
        },
        value: f64::NEG_INFINITY,
    };

    /// Everything that will be judged by clearances is met.
    fn meets_what_is_judged(&self) -> bool {
        self.shortfall.judged_m >= 0.0
    }

    /// The better one first.
    pub(crate) fn better_first(&self, other: &Self) -> std::cmp::Ordering {
        other
            .shortfall
            .judged_m
            .total_cmp(&self.shortfall.judged_m)
            .then(
                other
                    .shortfall
                    .reserve_m
                    .total_cmp(&self.shortfall.reserve_m),
            )
            .then(other.value.total_cmp(&self.value))
    }
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

    /// Distances from the rules about singularities, m.
    fn singular_surplus_m(&self, margins: &PostureMargins) -> [f64; 3] {
        let planning = self.planning();
        let sine = |sine: f64| METRES_PER_UNIT * (sine - planning.min_singularity_sine);
        [
            sine(margins.wrist_sine),
            sine(margins.elbow_sine),
            margins.shoulder_m - planning.min_shoulder_distance_mm * 1e-3,
        ]
    }

    /// How good a posture is: first how little it falls short of the clearances that will be judged, then
    /// of the reserve, from singularities too, and then by the aim. The order is that of preference.
    pub fn merit(&self, goal: &Goal, aim: Aim, candidate: &Candidate) -> Merit {
        let mut shortfall = self
            .limits()
            .shortfall(&ByClass::of_posture(&candidate.clearance));
        let reserve_m = self.planning().clearance_reserve_mm * 1e-3;
        shortfall.reserve_m += self
            .singular_surplus_m(&candidate.margins)
            .iter()
            .map(|surplus_m| (surplus_m - reserve_m).min(0.0))
            .sum::<f64>();
        Merit {
            shortfall,
            value: self.value(goal, aim, candidate),
        }
    }

    /// Least distance of a posture from breaking a rule.
    ///
    /// Of `rejections` those for its joint limits and for what it misses count: the others say what
    /// the candidate's own numbers say.
    pub fn surplus(&self, candidate: &Candidate, rejections: &[Rejection]) -> f64 {
        let margins = &candidate.margins;
        let clearances = candidate
            .clearance
            .iter()
            .map(|pair| pair.separation.distance_m - self.limits().get(pair.class).floor_m);
        let singular = self.singular_surplus_m(margins);
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
            .chain(singular)
            .chain(others)
            .fold(f64::INFINITY, f64::min)
    }
}
