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
    pub fn inverse_point(&self, point: &Vector3<f64>) -> Vector3<f64> {
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
}
