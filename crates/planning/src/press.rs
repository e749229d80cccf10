//! Prescribed contacts: an obstacle in the way of a planned posture, and a motion into it.

use nalgebra::{Translation3, Vector3};
use needlebench_cell::{Cell, ClearanceClass, Frame};
use needlebench_clearance::{ClearanceModel, PairClearance};
use needlebench_kinematics::trajectory::{JointTrajectory, MotionLimits, Phase, ProfileLimits};
use needlebench_kinematics::{Joints, Pose};
use std::borrow::Cow;

/// Steps of the search for a posture of a given depth.
const TRIES: usize = 60;

/// Tolerance of the prescribed depth, m.
const DEPTH_TOLERANCE_M: f64 = 1e-8;

/// Largest step of the search, as a motion of the point that touches, m.
const LARGEST_STEP_M: f64 = 2e-3;

/// Time at rest after the retreat, s: tips recover within 0.2 s.
const REST_S: f64 = 0.4;

/// An obstacle in the way, and the motion into it and back.
#[derive(Debug, Clone)]
pub struct PressPlan {
    /// What touches what.
    pub class: ClearanceClass,
    /// Bodies that are to touch, as indices into the cell's bodies: what moves first.
    pub bodies: [usize; 2],
    /// Names of the solids that are nearest.
    pub solids: [String; 2],
    /// The cell with the obstacle moved.
    pub cell: Cell,
    /// Its clearances.
    pub model: ClearanceModel,
    /// How far the obstacle was moved, in the world, m.
    pub displacement_m: Vector3<f64>,
    /// From the planned posture into the obstacle, hold, and back, with a rest at the end.
    pub trajectory: JointTrajectory,
}

/// Why a contact cannot be had.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PressError {
    /// No bodies of that class.
    #[error("the cell has no bodies of the class {class}")]
    NoBodies {
        /// The class.
        class: &'static str,
    },
    /// The search for a posture of the depth did not get there.
    #[error(
        "no posture penetrates the obstacle by {depth_m} m: the search ended at {reached_m:.6} m"
    )]
    NotReached {
        /// Prescribed depth, m.
        depth_m: f64,
        /// Depth reached, m; negative is a gap.
        reached_m: f64,
    },
    /// Something else would touch as well.
    #[error("{a} and {b} would also touch")]
    Blocked {
        /// First solid.
        a: String,
        /// Second solid.
        b: String,
    },
    /// A joint would leave its range.
    #[error("a joint would leave its range")]
    JointLimit,
}

/// Moves the nearest obstacle of a class to `gap_m` before a posture, and plans a motion of the arm
/// that lies `depth_m` in it.
///
/// The obstacle moves along the shortest way between it and the arm. The arm moves straight in the
/// joints to the posture that is the least joint motion away, the touching point at `speed_m_s` but
/// for the ramps.
///
/// # Errors
/// [`PressError`].
pub fn stage_press(
    cell: &Cell,
    model: &ClearanceModel,
    posture: &Joints,
    class: ClearanceClass,
    (gap_m, depth_m): (f64, f64),
    speed_m_s: f64,
    hold_s: f64,
) -> Result<PressPlan, PressError> {
    let missing = PressError::NoBodies {
        class: class.name(),
    };
    let nearest =
        |model: &ClearanceModel, q: &Joints| model.minimum_per_class(q).get(class).copied();
    let first = nearest(model, posture).ok_or(missing.clone())?;
    // Twice: the nearest points of a curved obstacle are others once it has moved.
    let mut moved = cell.clone();
    let mut moved_model = model.clone();
    let mut displacement_m = Vector3::zeros();
    let mut at = first;
    for _ in 0..4 {
        let by = at.separation.normal.into_inner() * (gap_m - at.separation.distance_m);
        displacement_m += by;
        shift_obstacle(&mut moved, cell.pairs[first.pair].b, &by);
        moved_model = ClearanceModel::new(&moved);
        at = nearest(&moved_model, posture).ok_or(missing.clone())?;
    }
    let pressed = pressed_posture(cell, &moved_model, posture, depth_m, nearest)?;
    let (q, at) = pressed;
    let pair = cell.pairs[at.pair];
    if (0..q.len()).any(|i| {
        let limit = &cell.robot.limits.0[i];
        !(limit.lower_rad..=limit.upper_rad).contains(&q[i])
    }) {
        return Err(PressError::JointLimit);
    }
    for known in [posture, &q] {
        let other = moved_model
            .minimum_per_class(known)
            .iter()
            .find(|each| {
                each.class != class && each.class.is_physical() && each.separation.distance_m < 0.0
            })
            .copied();
        if let Some(other) = other {
            let [a, b] = other.in_words(&moved).map(Cow::into_owned);
            return Err(PressError::Blocked { a, b });
        }
    }
    let (a, b) = at.solid_names(&moved);
    let solids = [a.to_owned(), b.to_owned()];
    Ok(PressPlan {
        class,
        bodies: [pair.a, pair.b],
        solids,
        trajectory: motion(posture, &q, speed_m_s / (gap_m + depth_m), hold_s),
        model: moved_model,
        cell: moved,
        displacement_m,
    })
}

/// All bodies of the obstacle's kind move together.
fn shift_obstacle(cell: &mut Cell, obstacle: usize, by: &Vector3<f64>) {
    let kind = cell.bodies[obstacle].kind;
    let shift = Pose::from(Translation3::from(*by));
    for body in &mut cell.bodies {
        if body.kind == kind && body.frame == Frame::World {
            for solid in &mut body.solids {
                solid.parent_from_shape = shift * solid.parent_from_shape;
            }
        }
    }
}

/// From a posture, along the steepest descent of the distance, to where it is `-depth_m`.
fn pressed_posture(
    cell: &Cell,
    model: &ClearanceModel,
    posture: &Joints,
    depth_m: f64,
    nearest: impl Fn(&ClearanceModel, &Joints) -> Option<PairClearance>,
) -> Result<(Joints, PairClearance), PressError> {
    let mut q = *posture;
    let mut reached_m = f64::NEG_INFINITY;
    for _ in 0..TRIES {
        let Some(at) = nearest(model, &q) else { break };
        reached_m = -at.separation.distance_m;
        let missing_m = depth_m - reached_m;
        if missing_m.abs() < DEPTH_TOLERANCE_M {
            return Ok((q, at));
        }
        let Frame::Link(link) = cell.bodies[cell.pairs[at.pair].a].frame else {
            break;
        };
        let to_base = cell.robot.world_from_base_link.inverse();
        let response = cell.robot.chain.point_response(
            &q,
            link,
            &(to_base * at.separation.point_on_a).coords,
            &(to_base.rotation * at.separation.normal.into_inner()),
        );
        let squared = response.norm_squared();
        if squared <= 0.0 {
            break;
        }
        q += response * (missing_m.clamp(-LARGEST_STEP_M, LARGEST_STEP_M) / squared);
    }
    Err(PressError::NotReached { depth_m, reached_m })
}

/// There, hold and back; `rate_per_s` is the share of the way per second.
fn motion(from: &Joints, to: &Joints, rate_per_s: f64, hold_s: f64) -> JointTrajectory {
    let way = (to - from).abs();
    // Full speed after a quarter of the time that the way takes at it.
    let acceleration = 4.0 * rate_per_s.powi(2);
    let limits = MotionLimits {
        velocity: way * rate_per_s,
        acceleration: way * acceleration,
        jerk: way * (10.0 * rate_per_s * acceleration),
        // No lines.
        line: ProfileLimits {
            velocity: 1.0,
            acceleration: 1.0,
            jerk: 1.0,
        },
    };
    JointTrajectory::starting_at(*from)
        .then_straight_to(Phase::Press, *to, &limits)
        .then_hold(Phase::Hold, hold_s)
        .then_straight_to(Phase::Release, *from, &limits)
        .then_hold(Phase::Release, REST_S)
}
