//! One branch of the closed form with its roots clamped: a posture even where there is none.

use nalgebra::Vector3;

use super::super::{Configuration, wrap_angle};
use crate::{Joints, Pose, UrGeometry};

/// The posture of a configuration, in doubles; where the configuration does not exist, the one
/// that points from the shoulder to where wrist 1 should be. `seed_6_rad` is `q6` where the wrist
/// is free. A starting point for iterations.
pub(in super::super) fn clamped(
    geometry: &UrGeometry,
    base_from_flange: &Pose,
    configuration: Configuration,
    seed_6_rad: f64,
) -> Joints {
    let rotation = base_from_flange.rotation.to_rotation_matrix().into_inner();
    let (n, o, a) = (rotation.column(0), rotation.column(1), rotation.column(2));
    let centre = base_from_flange.translation.vector - a * geometry.d6;
    let rho_squared = centre.x.powi(2) + centre.y.powi(2);
    let root = (rho_squared - geometry.d4.powi(2)).max(0.0).sqrt();
    let shoulder = configuration.shoulder;
    let q1 = libm::atan2(geometry.d4, shoulder.sign() * root) + libm::atan2(centre.y, centre.x); // eq 9
    let (s1, c1) = libm::sincos(q1);
    let (axis, forward) = (Vector3::new(s1, -c1, 0.0), Vector3::new(c1, s1, 0.0));
    let sign = configuration.wrist.sign(shoulder);
    let (n1, o1) = (n.dot(&axis), o.dot(&axis));
    let s5 = libm::hypot(n1, o1);
    let q5 = libm::atan2(sign * s5, a.dot(&axis)); // eq 10
    let q6 = if s5 < 1e-12 {
        seed_6_rad
    } else {
        libm::atan2(-o1 * sign, n1 * sign) // eq 11
    };
    let (s6, c6) = libm::sincos(q6);
    let to_wrist_1 = o * c6 + n * s6; // eq 20 to 22
    let q234 = libm::atan2(-to_wrist_1.dot(&forward), to_wrist_1.z); // eq 19
    let wrist_1 = centre + to_wrist_1 * geometry.d5;
    let (ahead, up) = (wrist_1.dot(&forward), wrist_1.z - geometry.d1);
    let (q2, q3) = geometry.elbow(ahead, up, configuration.elbow.sign(shoulder));
    Joints::from_column_slice(&[q1, q2, q3, q234 - q2 - q3, q5, q6].map(wrap_angle))
}
