//! What a controller knows of its arm.

use needlebench_kinematics::ik::Kinematics;
use needlebench_kinematics::{JOINT_COUNT, JOINT_LABELS, JointLimits, Joints};

/// Data of an arm and its controller.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArmData {
    /// The arm's kinematics.
    pub kinematics: Kinematics,
    /// Positions and speeds of the joints.
    pub limits: JointLimits,
    /// Largest accelerations of the joints, rad/s^2. A `movej` has at most half of them, so that a blend, and a pause,
    /// which add two accelerations, stay within.
    pub acceleration_rad_s2: Joints,
    /// Time between two set-points, s: 0.002 of the e-Series, 0.008 of CB3.
    pub period_s: f64,
    /// Time in which a motion reaches its full acceleration, s: 0.14 as measured of a UR3e.
    pub ramp_s: f64,
    /// How much later than by the filter's look-ahead time `servoj` follows, s: 0.004 where 34 ms were measured at a
    /// look-ahead time of 30 ms. Rounded to whole cycles.
    pub servo_delay_s: f64,
    /// How protective and emergency stops, and programs that end, stop the arm.
    pub stop: StopData,
}

/// A stop of all joints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StopData {
    /// Deceleration of the joint whose speed changes most, rad/s^2; the others stop with it.
    pub deceleration_rad_s2: f64,
    /// Time in which it is reached, s.
    pub ramp_s: f64,
}

/// Why data are not those of an arm.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum NotAnArm {
    /// A value that has to be positive and finite.
    #[error("{what} is {value} {unit}; it must be positive and finite")]
    NotPositive {
        /// What it is.
        what: &'static str,
        /// Its value.
        value: f64,
        /// Its unit.
        unit: &'static str,
    },
    /// A value that has to be zero or positive, and finite.
    #[error("{what} is {value} {unit}; it must be finite and not negative")]
    Negative {
        /// What it is.
        what: &'static str,
        /// Its value.
        value: f64,
        /// Its unit.
        unit: &'static str,
    },
    /// The start posture is outside the joints' limits, or not finite.
    #[error("{} starts at {value_rad} rad, outside its limits", JOINT_LABELS[*.joint])]
    Start {
        /// Index of the joint.
        joint: usize,
        /// Its position, rad.
        value_rad: f64,
    },
}

impl ArmData {
    /// # Errors
    /// [`NotAnArm`].
    pub(crate) fn check(&self, start: &Joints) -> Result<(), NotAnArm> {
        let Self {
            limits,
            acceleration_rad_s2,
            period_s,
            ramp_s,
            servo_delay_s,
            stop,
            kinematics: _,
        } = self;
        let mut positive = vec![
            ("the period", *period_s, "s"),
            ("the ramp", *ramp_s, "s"),
            (
                "the deceleration of a stop",
                stop.deceleration_rad_s2,
                "rad/s^2",
            ),
            ("the ramp of a stop", stop.ramp_s, "s"),
        ];
        for joint in 0..JOINT_COUNT {
            let acceleration = acceleration_rad_s2[joint];
            positive.push(("the acceleration of a joint", acceleration, "rad/s^2"));
            let speed = limits.0[joint].velocity_rad_s;
            positive.push(("the speed of a joint", speed, "rad/s"));
        }
        for (what, value, unit) in positive {
            if !(value.is_finite() && value > 0.0) {
                return Err(NotAnArm::NotPositive { what, value, unit });
            }
        }
        if !(servo_delay_s.is_finite() && *servo_delay_s >= 0.0) {
            return Err(NotAnArm::Negative {
                what: "the delay of servoj",
                value: *servo_delay_s,
                unit: "s",
            });
        }
        for (joint, limit) in limits.0.iter().enumerate() {
            let value_rad = start[joint];
            if !value_rad.is_finite() || limit.admit(value_rad).is_none() {
                return Err(NotAnArm::Start { joint, value_rad });
            }
        }
        Ok(())
    }
}
