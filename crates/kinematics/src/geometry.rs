//! The six lengths that define the kinematics of a UR arm.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{Translation3, UnitQuaternion, Vector3};
use needlebench_numerics::random::SplitMix64;

use crate::{Chain, ChainJoint, Joints, Pose, rotation_angle_between};

/// Standard Denavit-Hartenberg lengths of a UR arm, m.
///
/// Link twists are `pi/2, 0, 0, pi/2, -pi/2, 0`; `a2` and `a3` are negative.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UrGeometry {
    /// Height of the shoulder axis over the base plane.
    pub d1: f64,
    /// Length of the upper arm, negative.
    pub a2: f64,
    /// Length of the forearm, negative.
    pub a3: f64,
    /// Offset of wrist 1 along the shoulder axis.
    pub d4: f64,
    /// Offset of wrist 2.
    pub d5: f64,
    /// Offset of the flange.
    pub d6: f64,
}

/// A chain that is not, even roughly, that of a UR arm.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "the joint origins are not those of a UR arm: the nearest UR geometry misses the flange by \
     {position_error_m:.4} m and {angle_error_rad:.4} rad"
)]
pub struct NotUrGeometry {
    /// Largest position error over the probed postures, m.
    pub position_error_m: f64,
    /// Largest angle error over the probed postures, rad.
    pub angle_error_rad: f64,
}

/// A chain within this of its nominal geometry is a nominal one, m: URDFs print angles to ten
/// digits.
const NOMINAL_M: f64 = 1e-8;

/// A chain within this of a nominal UR arm is a calibrated one: six real UR3s differ from nominal
/// by at most 3.2 mm at a tip 200 mm beyond the flange.
const CALIBRATED_POSITION_M: f64 = 0.02;
const CALIBRATED_ANGLE_RAD: f64 = 0.05;

impl UrGeometry {
    /// UR3 (CB3): Universal Robots, DH parameters for calculations of kinematics and dynamics.
    pub const UR3: Self = Self {
        d1: 0.1519,
        a2: -0.24365,
        a3: -0.21325,
        d4: 0.11235,
        d5: 0.08535,
        d6: 0.0819,
    };

    /// Pose of the flange in the controller's `base` frame: the product of the six DH transforms
    /// (equations 1 to 3 of the paper), as plain matrices.
    pub fn base_from_flange(&self, q: &Joints) -> Pose {
        let rows = [
            (q[0], self.d1, 0.0, FRAC_PI_2),
            (q[1], 0.0, self.a2, 0.0),
            (q[2], 0.0, self.a3, 0.0),
            (q[3], self.d4, 0.0, FRAC_PI_2),
            (q[4], self.d5, 0.0, -FRAC_PI_2),
            (q[5], self.d6, 0.0, 0.0),
        ];
        rows.iter()
            .fold(Pose::identity(), |base_from_link, &(theta, d, a, alpha)| {
                base_from_link
                    * Pose::from_parts(
                        Translation3::new(0.0, 0.0, d),
                        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), theta),
                    )
                    * Pose::from_parts(
                        Translation3::new(a, 0.0, 0.0),
                        UnitQuaternion::from_axis_angle(&Vector3::x_axis(), alpha),
                    )
            })
    }

    /// The same arm as a chain from `base_link`, with the joint frames of ROS's `ur_description`.
    pub fn chain(&self) -> Chain {
        let z = Vector3::z_axis();
        let joint = |x: f64, y: f64, height: f64, roll: f64, pitch: f64, yaw: f64| ChainJoint {
            parent_from_joint: Pose::from_parts(
                Translation3::new(x, y, height),
                UnitQuaternion::from_euler_angles(roll, pitch, yaw),
            ),
            axis: z,
        };
        Chain {
            joints: [
                joint(0.0, 0.0, self.d1, 0.0, 0.0, PI),
                joint(0.0, 0.0, 0.0, FRAC_PI_2, 0.0, 0.0),
                joint(self.a2, 0.0, 0.0, 0.0, 0.0, 0.0),
                joint(self.a3, 0.0, self.d4, 0.0, 0.0, 0.0),
                joint(0.0, -self.d5, 0.0, FRAC_PI_2, 0.0, 0.0),
                joint(0.0, self.d6, 0.0, FRAC_PI_2, PI, PI),
            ],
            wrist_3_from_flange: Pose::identity(),
        }
    }

    /// How far wrist 2's centre lies ahead of the shoulder axis in the arm's plane, m.
    ///
    /// Positive with a right shoulder, negative with a left one; its magnitude is
    /// `sqrt(rho^2 - d4^2)`, which is 0 where the two meet.
    pub fn wrist_forward_m(&self, q: &Joints) -> f64 {
        self.a2 * libm::cos(q[1])
            + self.a3 * libm::cos(q[1] + q[2])
            + self.d5 * libm::sin(q[1] + q[2] + q[3])
    }

    /// `q2` and `q3` that bring wrist 1 to `(ahead, up)` of the shoulder in the arm's plane, with
    /// the given sign of `sin q3` (equations 31 to 36); clamped where the elbow does not close.
    pub(crate) fn elbow(&self, ahead_m: f64, up_m: f64, sign: f64) -> (f64, f64) {
        let (a2, a3) = (self.a2, self.a3);
        let reach_squared = ahead_m.powi(2) + up_m.powi(2);
        // Without cancellation at the stretched and at the folded elbow.
        let one_minus = ((a2 + a3).powi(2) - reach_squared) / (2.0 * a2 * a3);
        let one_plus = (reach_squared - (a2 - a3).powi(2)) / (2.0 * a2 * a3);
        let c3 = (0.5 * (one_plus - one_minus)).clamp(-1.0, 1.0);
        let s3 = sign * (one_minus * one_plus).max(0.0).sqrt();
        let (bx, by) = (a2 + a3 * c3, a3 * s3);
        let q2 = libm::atan2(up_m * bx - ahead_m * by, ahead_m * bx + up_m * by);
        (q2, libm::atan2(s3, c3))
    }

    /// Nearest UR geometry of a chain, read off its joint axes at `q = 0`.
    ///
    /// # Errors
    /// [`NotUrGeometry`] if the two disagree by more than any factory calibration explains.
    pub fn of_chain(chain: &Chain) -> Result<Self, NotUrGeometry> {
        let base_from_base_link = base_from_base_link();
        let links = chain
            .link_poses(&Joints::zeros())
            .map(|pose| base_from_base_link * pose);
        let origin = |i: usize| links[i].translation.vector;
        let flange = base_from_base_link * chain.base_link_from_flange(&Joints::zeros());
        // At q = 0 the arm is stretched along -x; axes 2, 3, 4 and 6 point along -y, axis 5 down.
        let d1 = origin(1).z;
        let (a2, reach) = (origin(2).x, origin(3).x);
        let d4 = -origin(4).y;
        let d5 = d1 - origin(5).z;
        let d6 = -flange.translation.vector.y - d4;
        let geometry = Self {
            d1,
            a2,
            a3: reach - a2,
            d4,
            d5,
            d6,
        };
        // A nominal chain is read off exactly; a calibrated one is fitted.
        let geometry = if geometry.position_error_m(chain, &PROBES[1]) < NOMINAL_M {
            geometry
        } else {
            geometry.fitted(chain)
        };
        let (mut position_error_m, mut angle_error_rad): (f64, f64) = (0.0, 0.0);
        for probe in PROBES {
            let q = Joints::from_column_slice(&probe);
            let nominal = geometry.base_from_flange(&q);
            let actual = base_from_base_link * chain.base_link_from_flange(&q);
            position_error_m = position_error_m
                .max((nominal.translation.vector - actual.translation.vector).norm());
            angle_error_rad =
                angle_error_rad.max(rotation_angle_between(&nominal.rotation, &actual.rotation));
        }
        // Written so that NaN fails too.
        if position_error_m <= CALIBRATED_POSITION_M && angle_error_rad <= CALIBRATED_ANGLE_RAD {
            Ok(geometry)
        } else {
            Err(NotUrGeometry {
                position_error_m,
                angle_error_rad,
            })
        }
    }
}

impl UrGeometry {
    fn of_lengths(lengths: &Joints) -> Self {
        Self {
            d1: lengths[0],
            a2: lengths[1],
            a3: lengths[2],
            d4: lengths[3],
            d5: lengths[4],
            d6: lengths[5],
        }
    }

    fn position_error_m(&self, chain: &Chain, q: &[f64; 6]) -> f64 {
        let q = Joints::from_column_slice(q);
        let nominal = self.base_from_flange(&q).translation.vector;
        let actual = base_from_base_link() * chain.base_link_from_flange(&q);
        (nominal - actual.translation.vector).norm()
    }

    /// Lengths that place the flange best over many postures, in the sense of least squares. The
    /// flange's position is linear in the lengths, so this takes one step.
    fn fitted(&self, chain: &Chain) -> Self {
        const POSTURES: u32 = 64;
        let mut random = SplitMix64::new(1);
        let mut normal = nalgebra::Matrix6::zeros();
        let mut right = nalgebra::Vector6::zeros();
        for _ in 0..POSTURES {
            let q = any_posture(&mut random);
            let actual = base_from_base_link() * chain.base_link_from_flange(&q);
            let columns: [Vector3<f64>; 6] = std::array::from_fn(|i| {
                let unit = Joints::from_fn(|k, _| if k == i { 1.0 } else { 0.0 });
                Self::of_lengths(&unit)
                    .base_from_flange(&q)
                    .translation
                    .vector
            });
            for i in 0..6 {
                right[i] += columns[i].dot(&actual.translation.vector);
                for k in 0..6 {
                    normal[(i, k)] += columns[i].dot(&columns[k]);
                }
            }
        }
        // Six lengths act in different directions over 64 postures, so that the factor exists.
        normal
            .cholesky()
            .map_or(*self, |factor| Self::of_lengths(&factor.solve(&right)))
    }
}

/// How far a chain is from its nominal geometry, at most over many postures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Mismatch {
    /// Of the flange's position, m.
    pub position_m: f64,
    /// Of the flange's orientation, rad.
    pub angle_rad: f64,
}

impl Mismatch {
    pub(crate) fn of(chain: &Chain, geometry: &UrGeometry) -> Self {
        let mut random = SplitMix64::new(2);
        let mut most = Self {
            position_m: 0.0,
            angle_rad: 0.0,
        };
        for _ in 0..64 {
            let q = any_posture(&mut random);
            let nominal = geometry.base_from_flange(&q);
            let actual = base_from_base_link() * chain.base_link_from_flange(&q);
            let shift = nominal.translation.vector - actual.translation.vector;
            most.position_m = most.position_m.max(shift.norm());
            most.angle_rad = most
                .angle_rad
                .max(rotation_angle_between(&nominal.rotation, &actual.rotation));
        }
        most
    }

    /// The chain is a nominal arm, but for the digits that a file prints.
    pub(crate) fn is_nominal(&self) -> bool {
        self.position_m.max(self.angle_rad) < NOMINAL_M
    }
}

/// Every joint uniform in `(-pi, pi)`.
fn any_posture(random: &mut SplitMix64) -> Joints {
    let pi = std::f64::consts::PI;
    Joints::from_fn(|_, _| random.uniform(-pi, pi))
}

/// Postures that move every joint, for telling a UR chain from others.
const PROBES: [[f64; 6]; 4] = [
    [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [0.7, -1.1, 1.3, 0.4, -0.9, 0.5],
    [-2.1, 0.6, -0.8, 2.2, 1.7, -1.4],
    [1.5, -2.4, 2.0, -0.6, 0.8, 2.9],
];

/// `base_link` in the controller's base frame, and the other way round: turned by 180 degrees about
/// z. Exact, where a rotation by `PI` would be off by 1.2e-16.
pub fn base_from_base_link() -> Pose {
    Pose::from_parts(
        Translation3::identity(),
        nalgebra::Unit::new_unchecked(nalgebra::Quaternion::new(0.0, 0.0, 0.0, 1.0)),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Twenty times the rounding of seven products of lengths below 0.5 m.
    const FK_M: f64 = 2e-15;

    #[test]
    fn the_chain_is_the_dh_product_turned_by_half_a_revolution() {
        let chain = UrGeometry::UR3.chain();
        for probe in PROBES {
            let q = Joints::from_column_slice(&probe);
            let dh = UrGeometry::UR3.base_from_flange(&q);
            let ros = base_from_base_link() * chain.base_link_from_flange(&q);
            assert!((dh.translation.vector - ros.translation.vector).norm() < FK_M);
            assert!(rotation_angle_between(&dh.rotation, &ros.rotation) < FK_M);
        }
    }

    #[test]
    fn the_stretched_arm_stands_where_the_maker_says() {
        let flange = UrGeometry::UR3
            .chain()
            .base_link_from_flange(&Joints::zeros());
        let expected = Vector3::new(0.4569, 0.19425, 0.06655);
        assert!((flange.translation.vector - expected).norm() < FK_M);
    }

    #[test]
    fn geometry_is_read_back_from_its_chain() {
        let geometry = UrGeometry {
            d1: 0.2,
            a2: -0.5,
            a3: -0.4,
            d4: 0.13,
            d5: 0.1,
            d6: 0.09,
        };
        let read = UrGeometry::of_chain(&geometry.chain()).unwrap();
        assert!((read.d5 - geometry.d5).abs() < FK_M && (read.d6 - geometry.d6).abs() < FK_M);
        assert!((read.a3 - geometry.a3).abs() < FK_M && (read.d4 - geometry.d4).abs() < FK_M);
    }

    #[test]
    fn another_arm_is_refused() {
        let mut chain = UrGeometry::UR3.chain();
        chain.joints[3].parent_from_joint.rotation =
            UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 0.4);
        assert!(UrGeometry::of_chain(&chain).is_err());
    }
}
