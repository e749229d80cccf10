//! Joint limits: positions, speeds, torques.

use crate::{JOINT_COUNT, Joints};

/// Limits of one joint.
#[derive(Debug, Clone, Copy, PartialEq)]
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

/// Limits of all joints.
#[derive(Debug, Clone, Copy, PartialEq)]
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
