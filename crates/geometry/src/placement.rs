//! Poses in the form that is quickest to apply.

use nalgebra::{Matrix3, Vector3};
use needlebench_kinematics::Pose;

/// A rotation as a matrix and a translation: half the cost of a quaternion per point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Rotation matrix.
    pub rotation: Matrix3<f64>,
    /// Translation, m.
    pub translation: Vector3<f64>,
}

/// Slack of [`Placement::travel_m`] for rounding: of the rotation's trace, and in m.
const TRACE_SLACK: f64 = 1e-14;
const TRAVEL_SLACK_M: f64 = 1e-12;

impl Placement {
    /// At the origin, not turned.
    pub const IDENTITY: Self = Self {
        rotation: Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        translation: Vector3::new(0.0, 0.0, 0.0),
    };

    /// Of a pose.
    #[inline]
    pub fn new(pose: &Pose) -> Self {
        Self {
            rotation: pose.rotation.to_rotation_matrix().into_inner(),
            translation: pose.translation.vector,
        }
    }

    /// A point of the placed frame, seen from its parent.
    #[inline]
    pub fn point(&self, local: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * local + self.translation
    }

    /// A point of the parent, seen from the placed frame.
    #[inline]
    pub(crate) fn inverse_point(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.rotation.tr_mul(&(point - self.translation))
    }

    /// `self * other`.
    #[inline]
    pub fn after(&self, other: &Self) -> Self {
        Self {
            rotation: self.rotation * other.rotation,
            translation: self.point(&other.translation),
        }
    }

    /// `self^-1 * other`.
    #[inline]
    pub fn inverse_after(&self, other: &Self) -> Self {
        Self {
            rotation: self.rotation.tr_mul(&other.rotation),
            translation: self.inverse_point(&other.translation),
        }
    }
    /// Most that a point of a ball moves on the way from this placement to another, m: an upper bound.
    ///
    /// A point at `c + u` from the ball's centre `c`, `|u| <= r`, moves by no more than
    /// `|c' - c| + |R' - R| r`, and `|R' - R| = 2 sin(phi / 2) = sqrt(3 - trace(R' R^T))` where `phi` is the
    /// angle between the two orientations.
    #[inline]
    pub fn travel_m(&self, to: &Self, centre: &Vector3<f64>, radius_m: f64) -> f64 {
        let trace = self.rotation.dot(&to.rotation);
        let turn = ((3.0 - trace).max(0.0) + TRACE_SLACK).sqrt();
        (to.point(centre) - self.point(centre)).norm() + turn * radius_m + TRAVEL_SLACK_M
    }
}
