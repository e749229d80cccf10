//! What a controller tells of a cycle.

use needlebench_kinematics::{JOINT_LABELS, Joints};

use crate::request::{Origin, Refusal};
use crate::state::State;

/// Something that happened in a cycle, in the order in which it did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Event {
    /// A request was carried out, or begun.
    Accepted {
        /// Whose.
        from: Origin,
    },
    /// A request was refused, or a move that had to wait for the arm to stand turned out to have no course.
    Refused {
        /// Whose.
        from: Origin,
        /// Why.
        why: Refusal,
    },
    /// The state changed.
    State {
        /// Before.
        from: State,
        /// Behind.
        to: State,
    },
    /// A move's program goes on: the move is over, its time is, or it is about to be blended.
    Done {
        /// Whose.
        from: Origin,
    },
    /// A move will not be done: stopped, or another one came.
    Cancelled {
        /// Whose.
        from: Origin,
    },
    /// Two moves are blended.
    Blend(Blend),
    /// A speed or an acceleration beyond what the arm has was reduced to that.
    Reduced {
        /// Whose.
        from: Origin,
        /// Of what, as the program calls it.
        what: &'static str,
        /// What was asked for.
        asked: f64,
        /// What it is reduced to.
        used: f64,
        /// Unit of both.
        unit: &'static str,
    },
    /// The controller made a protective stop by itself.
    Trip {
        /// Why.
        why: Trip,
        /// Smallest singular value of the flange's Jacobian (lengths over 0.5 m) at the last set-point, if a tool's
        /// way was followed.
        least_singular_value: Option<f64>,
    },
    /// All joints stop at [`StopData`](crate::StopData).
    Stopping {
        /// How far each joint goes until it stands, rad. With the deceleration `a` and the ramp `r` of the stop that is
        /// `v^2 / 2a + v r / 2` of the fastest joint, where it moves steadily before.
        way_rad: Joints,
        /// Until the last one stands, s.
        time_s: f64,
    },
}

/// Two moves that are blended: while both move, the tool's point is within the radius of the corner.
///
/// The corner itself is not passed. A certificate that is to hold for every course within the sphere covers the two
/// moves up to the corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blend {
    /// Joint positions in the corner, rad.
    pub corner_rad: Joints,
    /// Radius about the tool's point there, m.
    pub radius_m: f64,
    /// How long both move, s: 0 where the next move came too late.
    pub overlap_s: f64,
}

/// Why a controller stops by itself. Values are those of the set-point that was not taken any more.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Trip {
    /// A joint could not stop within its limits any more.
    #[error("{} would stop at {value_rad:.4} rad, beyond its limit of {limit_rad:.4} rad", JOINT_LABELS[*.joint])]
    Position {
        /// Index of the joint.
        joint: usize,
        /// Where it would stand, rad.
        value_rad: f64,
        /// Its limit, rad.
        limit_rad: f64,
    },
    /// A joint would get faster than it may.
    #[error("{} would move at {value_rad_s:.4} rad/s, limit {limit_rad_s:.4} rad/s", JOINT_LABELS[*.joint])]
    Speed {
        /// Index of the joint.
        joint: usize,
        /// Its speed, rad/s, if it were stopped from there on.
        value_rad_s: f64,
        /// Its limit, rad/s.
        limit_rad_s: f64,
    },
    /// A joint would be accelerated more than it may.
    #[error("{} would accelerate at {value_rad_s2:.4} rad/s^2, limit {limit_rad_s2:.4} rad/s^2", JOINT_LABELS[*.joint])]
    Acceleration {
        /// Index of the joint.
        joint: usize,
        /// Its acceleration, rad/s^2.
        value_rad_s2: f64,
        /// Its limit, rad/s^2.
        limit_rad_s2: f64,
    },
    /// No joint positions next to the last ones have the tool's pose: it is out of reach, or beyond a singularity.
    #[error("no joint positions next to the last set-point have the pose of the tool")]
    NoSolution,
    /// A set-point was not finite.
    #[error("the set-point of {} is not finite", JOINT_LABELS[*.joint])]
    NotFinite {
        /// Index of the joint.
        joint: usize,
    },
}
