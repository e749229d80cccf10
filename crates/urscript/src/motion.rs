//! What a program wants of the arm.

use nalgebra::Vector3;
use needlebench_kinematics::{Joints, Pose};

use crate::place::Place;

/// One motion of a program.
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    /// Where it stands in the program.
    pub place: Place,
    /// What moves.
    pub kind: MotionKind,
    /// The tool's point in the flange's frame that the program believes in, where the motion needs one.
    pub flange_from_tcp: Option<Pose>,
}

/// Kinds of motions. Lengths in m, angles in rad; poses are `base_from_tcp`, in the controller's base frame.
#[derive(Debug, Clone, PartialEq)]
pub enum MotionKind {
    /// `movej`: all joints together.
    Joints {
        /// Where to, rad.
        to: Joints,
        /// Acceleration and speed of the leading joint, or a time.
        pace: Pace,
        /// Distance of the tool's point from the end at which the next motion may begin, m.
        blend_m: f64,
    },
    /// `movel`: the tool's point along a straight line.
    Line {
        /// Where to.
        to: Pose,
        /// Acceleration and speed of the tool's point, or a time.
        pace: Pace,
        /// As of [`MotionKind::Joints`].
        blend_m: f64,
    },
    /// `movec`: the tool's point along a circle, the tool turning evenly about one axis.
    Circle {
        /// A place between begin and end.
        via_m: Vector3<f64>,
        /// Where to.
        to: Pose,
        /// Acceleration and speed of the tool's point.
        pace: Pace,
        /// As of [`MotionKind::Joints`].
        blend_m: f64,
    },
    /// `movep`: a line at constant speed.
    Process {
        /// Where to.
        to: Pose,
        /// Acceleration and speed of the tool's point.
        pace: Pace,
        /// As of [`MotionKind::Joints`].
        blend_m: f64,
    },
    /// `servoj`: joint positions of one moment.
    Servo {
        /// Where to, rad.
        to: Joints,
        /// Until the next one, s.
        time_s: f64,
        /// Time by which the controller looks ahead, s.
        lookahead_s: f64,
        /// How stiffly it follows.
        gain: f64,
    },
    /// `stopj` and `stopl`.
    Stop {
        /// Deceleration: of joints, rad/s^2, or of the tool's point, m/s^2.
        deceleration: f64,
        /// The tool's point stops on its line, not the joints on theirs.
        is_linear: bool,
    },
}

/// How fast a motion is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pace {
    /// Acceleration of what leads, rad/s^2 or m/s^2.
    pub acceleration: f64,
    /// Speed of what leads, rad/s or m/s.
    pub speed: f64,
    /// Duration, s: counts instead of the others where it is there.
    pub time_s: Option<f64>,
}

/// What a program tells its controller of the tool.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Belief {
    /// Tool's point in the flange's frame, from `set_tcp`.
    pub flange_from_tcp: Option<Pose>,
    /// What the flange carries, kg.
    pub payload_kg: Option<f64>,
    /// Centre of that in the flange's frame, m.
    pub centre_m: Option<[f64; 3]>,
    /// Against what the arm is accelerated when it stands, in the controller's base frame, m/s^2: up.
    pub gravity_m_s2: Option<[f64; 3]>,
}
