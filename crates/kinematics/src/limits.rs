//! Joint limits: positions, speeds, torques; and the usual values of manufacturers and users.

use std::f64::consts::{PI, TAU};
use std::ops::RangeInclusive;

use crate::{JOINT_COUNT, Joints, UrModel};

/// A position beyond a limit by no more than this counts as on the limit, rad.
///
/// Eleven units in the last place at 2 pi. A joint angle of the closed form is rounded by less, and
/// moving it that far onto the limit moves the flange by less than 1.5e-14 m per metre of reach.
pub const LIMIT_ROUNDING_RAD: f64 = 1e-14;

/// Most full revolutions ever added to a position. Beyond it a double holds the angle to no better than
/// 1e-9 rad.
pub const MAX_TURNS: i32 = 1_000_000;

/// Limits of one joint.
///
/// A revolute joint of a URDF gives its `lower` and `upper`; a continuous joint, which has neither,
/// gives `-inf` and `inf`.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct JointLimit {
    /// Lowest position, rad; `-inf` for an unlimited joint.
    pub lower_rad: f64,
    /// Highest position, rad; `inf` for an unlimited joint.
    pub upper_rad: f64,
    /// Highest speed, rad/s.
    pub velocity_rad_s: f64,
    /// Highest torque, N m.
    pub effort_nm: f64,
}

impl JointLimit {
    /// The position if it is within the limits, and the limit if it is beyond by no more than
    /// [`LIMIT_ROUNDING_RAD`]. Both ends are allowed. `None` outside, and for NaN.
    pub fn admit(&self, position_rad: f64) -> Option<f64> {
        let inside = position_rad >= self.lower_rad - LIMIT_ROUNDING_RAD
            && position_rad <= self.upper_rad + LIMIT_ROUNDING_RAD;
        inside.then(|| position_rad.max(self.lower_rad).min(self.upper_rad))
    }

    /// Numbers of full revolutions that give a 2π equivalent of a position which [`JointLimit::admit`] accepts, at
    /// most [`MAX_TURNS`] each way. `None` if there are none, and for a position that is not finite.
    pub fn turns(&self, position_rad: f64) -> Option<RangeInclusive<i32>> {
        if !position_rad.is_finite() || self.lower_rad.is_nan() || self.upper_rad.is_nan() {
            return None;
        }
        let lower = self.lower_rad - LIMIT_ROUNDING_RAD;
        let upper = self.upper_rad + LIMIT_ROUNDING_RAD;
        // At most one off, for the rounding of the quotient too: tried, not trusted.
        let lowest = nearest_whole((lower - position_rad) * (1.0 / TAU));
        let highest = nearest_whole((upper - position_rad) * (1.0 / TAU));
        let lowest = (lowest - 1..=lowest + 1).find(|&k| turned(position_rad, k) >= lower)?;
        let highest = (highest - 1..=highest + 1)
            .rev()
            .find(|&k| turned(position_rad, k) <= upper)?;
        let lowest = lowest.max(-MAX_TURNS);
        let highest = highest.min(MAX_TURNS);
        (lowest <= highest).then_some(lowest..=highest)
    }
}

/// A position with full revolutions added, rad.
pub(crate) fn turned(position_rad: f64, turns: i32) -> f64 {
    position_rad + TAU * f64::from(turns)
}

/// The nearest integer, either one of two, cut off a little beyond [`MAX_TURNS`]; 0 for NaN.
#[expect(
    clippy::cast_possible_truncation,
    reason = "integral and within the range of i32 after the clamp"
)]
pub(crate) fn nearest_whole(turns: f64) -> i32 {
    // Adding this leaves no bits for a fraction; `f64::round` is a call without SSE 4.1.
    const INTEGERS: f64 = 1.5 * (1_u64 << 52) as f64;
    let most = f64::from(MAX_TURNS + 1);
    ((turns.clamp(-most, most) + INTEGERS) - INTEGERS) as i32
}

/// Limits of all joints.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct JointLimits(pub [JointLimit; JOINT_COUNT]);

impl JointLimits {
    /// Highest speeds, rad/s.
    pub fn velocities_rad_s(&self) -> Joints {
        Joints::from_fn(|i, _| self.0[i].velocity_rad_s)
    }

    /// Highest torques, N m.
    pub fn efforts_nm(&self) -> Joints {
        Joints::from_fn(|i, _| self.0[i].effort_nm)
    }

    /// First joint outside its limits, if any.
    pub fn first_violation(&self, q: &Joints) -> Option<usize> {
        (0..JOINT_COUNT).find(|&i| q[i] < self.0[i].lower_rad || q[i] > self.0[i].upper_rad)
    }

    /// `min_i min(q_i - lower_i, upper_i - q_i) / half range_i`: 1 in the middle of every range,
    /// 0 at a limit, negative outside. Unlimited joints do not count.
    pub fn margin(&self, q: &Joints) -> f64 {
        self.0
            .iter()
            .zip(q.iter())
            .filter(|(limit, _)| limit.lower_rad.is_finite() && limit.upper_rad.is_finite())
            .map(|(limit, &position)| {
                let half_range = 0.5 * (limit.upper_rad - limit.lower_rad);
                (position - limit.lower_rad).min(limit.upper_rad - position) / half_range
            })
            .fold(f64::INFINITY, f64::min)
    }
}

/// How far every joint may turn either way from zero: a policy, not a property of the arm alone.
///
/// The manufacturer lets every joint turn by 360 degrees either way, and wrist 3 of the UR3 and the UR3e
/// without end (user manuals UR3/CB3 3.13 and UR3e 5.8). ROS halves the range of the elbow, which
/// the arm's own shoulder stops near 180 degrees anyway (`config/*/joint_limits.yaml` of
/// `ur_description`), so that planners do not fall between two unconnected halves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LimitPolicy {
    /// Largest magnitude of every joint's position, rad; `inf` for an unlimited joint.
    pub reach_rad: [f64; JOINT_COUNT],
}

impl LimitPolicy {
    /// Every joint by 360 degrees either way.
    pub const FULL_TURNS: Self = Self {
        reach_rad: [TAU; JOINT_COUNT],
    };

    /// Every joint by 180 degrees either way: one wrap of every posture, two on a limit.
    pub const HALF_TURNS: Self = Self {
        reach_rad: [PI; JOINT_COUNT],
    };

    /// What the user manual of an arm states.
    pub const fn of_manual(model: UrModel) -> Self {
        match model {
            UrModel::Ur3 | UrModel::Ur3e => Self::FULL_TURNS.with_unlimited_wrist_3(),
            _ => Self::FULL_TURNS,
        }
    }

    /// What `ur_description` for ROS 2 states: the manual's, with half the range of the elbow.
    pub const fn of_ros(model: UrModel) -> Self {
        Self::of_manual(model).with_elbow_half_turn()
    }

    /// The same with the elbow at 180 degrees either way.
    pub const fn with_elbow_half_turn(mut self) -> Self {
        self.reach_rad[2] = PI;
        self
    }

    /// The same with wrist 3 turning without end.
    pub const fn with_unlimited_wrist_3(mut self) -> Self {
        self.reach_rad[5] = f64::INFINITY;
        self
    }

    /// Limits that take their positions from here and their speeds and torques from elsewhere.
    pub fn replacing_positions_of(&self, limits: &JointLimits) -> JointLimits {
        JointLimits(std::array::from_fn(|i| JointLimit {
            lower_rad: -self.reach_rad[i],
            upper_rad: self.reach_rad[i],
            ..limits.0[i]
        }))
    }

    /// Limits of an arm: positions from here, speeds from its user manual, torques from Universal
    /// Robots, *Max. joint torques*, 2020; of UR20 and UR30 both from `ur_description` 2.4.5.
    ///
    /// Of the torques `ur_description` deviates by up to 3 N m for some arms of the e-Series.
    pub fn limits_of(&self, model: UrModel) -> JointLimits {
        let (degrees_per_second, efforts_nm) = match model {
            UrModel::Ur3 | UrModel::Ur3e => (
                [180.0, 180.0, 180.0, 360.0, 360.0, 360.0],
                [56.0, 56.0, 28.0, 12.0, 12.0, 12.0],
            ),
            UrModel::Ur5 | UrModel::Ur5e => ([180.0; 6], [150.0, 150.0, 150.0, 28.0, 28.0, 28.0]),
            UrModel::Ur10 | UrModel::Ur10e | UrModel::Ur16e => (
                [120.0, 120.0, 180.0, 180.0, 180.0, 180.0],
                [330.0, 330.0, 150.0, 56.0, 56.0, 56.0],
            ),
            UrModel::Ur20 | UrModel::Ur30 => (
                [120.0, 120.0, 150.0, 210.0, 210.0, 210.0],
                [738.0, 738.0, 433.0, 107.0, 107.0, 107.0],
            ),
        };
        JointLimits(std::array::from_fn(|i| JointLimit {
            lower_rad: -self.reach_rad[i],
            upper_rad: self.reach_rad[i],
            velocity_rad_s: f64::to_radians(degrees_per_second[i]),
            effort_nm: efforts_nm[i],
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn between(lower_rad: f64, upper_rad: f64) -> JointLimit {
        JointLimit {
            lower_rad,
            upper_rad,
            velocity_rad_s: 1.0,
            effort_nm: 1.0,
        }
    }

    #[test]
    fn both_ends_of_a_range_are_allowed_and_a_rounding_beyond_is_on_the_limit() {
        let limit = between(-PI, PI);
        assert_eq!(limit.turns(PI), Some(-1..=0));
        assert_eq!(limit.turns(-PI), Some(0..=1));
        assert_eq!(limit.turns(PI.next_up()), Some(-1..=0));
        assert_eq!(limit.admit(PI.next_up()), Some(PI));
        assert_eq!(limit.admit(-PI - 0.5 * LIMIT_ROUNDING_RAD), Some(-PI));
        assert_eq!(limit.admit(PI + 2.0 * LIMIT_ROUNDING_RAD), None);
        assert_eq!(limit.turns(PI - 2.0 * LIMIT_ROUNDING_RAD), Some(0..=0));
        assert_eq!(between(-TAU, TAU).turns(0.0), Some(-1..=1));
    }

    #[test]
    fn turns_bring_a_far_position_back() {
        let limit = between(-TAU, TAU);
        assert_eq!(limit.turns(7.0 * TAU + 1.0), Some(-8..=-7));
        assert_eq!(between(1.0, 1.5).turns(0.0), None);
        assert_eq!(between(2.0, 1.0).turns(1.5), None);
        assert_eq!(
            between(f64::NEG_INFINITY, f64::INFINITY).turns(1.0),
            Some(-MAX_TURNS..=MAX_TURNS)
        );
        assert_eq!(
            between(f64::NEG_INFINITY, 0.0).turns(1.0),
            Some(-MAX_TURNS..=-1)
        );
    }

    #[test]
    fn what_is_no_position_has_no_turns() {
        let unlimited = between(f64::NEG_INFINITY, f64::INFINITY);
        assert_eq!(unlimited.turns(f64::NAN), None);
        assert_eq!(unlimited.turns(f64::INFINITY), None);
        assert_eq!(unlimited.admit(f64::NAN), None);
        assert_eq!(between(f64::NAN, 1.0).turns(0.0), None);
        assert_eq!(between(-TAU, TAU).turns(1e300), None);
    }

    #[test]
    fn policies_state_what_their_sources_state() {
        let ur3 = LimitPolicy::of_ros(UrModel::Ur3).limits_of(UrModel::Ur3);
        assert_eq!(ur3.0[2].upper_rad, PI);
        assert_eq!(ur3.0[5].lower_rad, f64::NEG_INFINITY);
        assert_eq!(ur3.velocities_rad_s()[3], TAU);
        assert_eq!(ur3.efforts_nm()[2], 28.0);
        let ur10 = LimitPolicy::of_manual(UrModel::Ur10e).limits_of(UrModel::Ur10e);
        assert!(
            ur10.0
                .iter()
                .all(|each| each.upper_rad == TAU && each.lower_rad == -TAU)
        );
        assert_eq!(ur10.efforts_nm()[5], 56.0);
        let mixed = LimitPolicy::HALF_TURNS.replacing_positions_of(&ur10);
        assert_eq!(mixed.0[0].upper_rad, PI);
        assert_eq!(mixed.efforts_nm(), ur10.efforts_nm());
    }
}
