//! Serial chain of six revolute joints, as a URDF describes it.

use nalgebra::{Matrix6, UnitQuaternion, UnitVector3, Vector3, Vector6};

use crate::{JOINT_COUNT, Joints, Pose};

/// One revolute joint: `parent_from_child(q) = parent_from_joint * rotation(axis, q)`.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ChainJoint {
    /// Pose of the joint (and of the child link at `q = 0`) in its parent link.
    pub parent_from_joint: Pose,
    /// Axis of rotation in the joint's frame, which is also the child link's.
    pub axis: UnitVector3<f64>,
}

/// The arm's chain from `base_link` to the flange.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Chain {
    /// The joints from base to flange; the first one's parent is `base_link`.
    pub joints: [ChainJoint; JOINT_COUNT],
    /// Flange (ROS `tool0`) in the frame of the last link.
    pub wrist_3_from_flange: Pose,
}

impl Chain {
    /// Poses of the six moving links in `base_link`.
    pub fn link_poses(&self, q: &Joints) -> [Pose; JOINT_COUNT] {
        let mut poses = [Pose::identity(); JOINT_COUNT];
        let mut parent = Pose::identity();
        for (i, joint) in self.joints.iter().enumerate() {
            let mut pose = parent
                * joint.parent_from_joint
                * UnitQuaternion::from_axis_angle(&joint.axis, q[i]);
            // Six products of unit quaternions drift by a few ulp; one Newton step removes it.
            pose.rotation.renormalize_fast();
            poses[i] = pose;
            parent = pose;
        }
        poses
    }

    /// Pose of the flange in `base_link`.
    pub fn base_link_from_flange(&self, q: &Joints) -> Pose {
        self.link_poses(q)[JOINT_COUNT - 1] * self.wrist_3_from_flange
    }

    /// Geometric Jacobian of a point fixed to the last link, in `base_link`.
    ///
    /// Rows 0..3 give the point's linear velocity (m/rad), rows 3..6 the angular velocity of the
    /// last link (rad/rad), both in `base_link`. Column `i` is `[z_i x (p - o_i); z_i]`.
    pub fn jacobian_at(&self, q: &Joints, point_in_flange: &Vector3<f64>) -> Matrix6<f64> {
        let (axes, velocities) = self.screws(q, point_in_flange);
        let mut jacobian = Matrix6::zeros();
        for i in 0..JOINT_COUNT {
            jacobian.set_column(i, &stacked(&velocities[i], &axes[i]));
        }
        jacobian
    }

    /// Velocity along `direction` of a point fixed to moving link `link`, per joint speed: `direction .
    /// (z_i x (p - o_i))`, m/rad, and 0 for joints beyond the link. Point and direction in `base_link`.
    ///
    /// The same numbers are the torques about the joints of a unit force along `direction`.
    pub fn point_response(
        &self,
        q: &Joints,
        link: usize,
        point_m: &Vector3<f64>,
        direction: &Vector3<f64>,
    ) -> Joints {
        let links = self.link_poses(q);
        Joints::from_fn(|i, _| {
            if i > link {
                return 0.0;
            }
            let axis = links[i].rotation * self.joints[i].axis.into_inner();
            direction.dot(&axis.cross(&(point_m - links[i].translation.vector)))
        })
    }

    /// Every joint's axis `z_i` and the velocity `z_i x (p - o_i)` that it gives the point, in
    /// `base_link`.
    fn screws(
        &self,
        q: &Joints,
        point_in_flange: &Vector3<f64>,
    ) -> ([Vector3<f64>; 6], [Vector3<f64>; 6]) {
        let links = self.link_poses(q);
        let point = links[JOINT_COUNT - 1]
            * self.wrist_3_from_flange
            * nalgebra::Point3::from(*point_in_flange);
        let axes: [Vector3<f64>; JOINT_COUNT] =
            std::array::from_fn(|i| links[i].rotation * self.joints[i].axis.into_inner());
        let velocities =
            std::array::from_fn(|i| axes[i].cross(&(point.coords - links[i].translation.vector)));
        (axes, velocities)
    }

    /// Geometric Jacobian of the flange, in `base_link`; see [`Chain::jacobian_at`].
    pub fn jacobian(&self, q: &Joints) -> Matrix6<f64> {
        self.jacobian_at(q, &Vector3::zeros())
    }

    /// How the Jacobian of the flange changes with each joint: item `k` is `dJ/dq_k`, per rad.
    ///
    /// With `z_i` and `v_i` the two halves of column `i` of [`Chain::jacobian`], column `i` of item
    /// `k` is `[z_k x v_i; z_k x z_i]` for a joint `k` before or at `i`, which turns that column as
    /// a whole, and `[z_i x v_k; 0]` for one behind, which moves the flange alone. Agrees with
    /// central differences to 1e-9 (`the_hessian_is_the_change_of_the_jacobian`).
    pub fn jacobian_hessian(&self, q: &Joints) -> [Matrix6<f64>; JOINT_COUNT] {
        let (axes, velocities) = self.screws(q, &Vector3::zeros());
        std::array::from_fn(|k| {
            let mut change = Matrix6::zeros();
            for i in 0..JOINT_COUNT {
                let linear = axes[k.min(i)].cross(&velocities[k.max(i)]);
                let angular = if k < i {
                    axes[k].cross(&axes[i])
                } else {
                    Vector3::zeros()
                };
                change.set_column(i, &stacked(&linear, &angular));
            }
            change
        })
    }

    /// Rate of change of the Jacobian of the flange, `dJ/dt = sum_k dJ/dq_k qd_k`, per second.
    ///
    /// [`Chain::jacobian_hessian`] times the velocities, without the tensor. Times `qd` it is
    /// [`Chain::flange_bias_acceleration`], to 1e-13 (`its_rate_times_the_speeds_is_the_bias`).
    pub fn jacobian_derivative(&self, q: &Joints, qd: &Joints) -> Matrix6<f64> {
        let (axes, velocities) = self.screws(q, &Vector3::zeros());
        let mut rate = Matrix6::zeros();
        // Velocity of the flange that the joints behind `i` give it.
        let mut from_behind = Vector3::zeros();
        for i in (0..JOINT_COUNT).rev() {
            let linear = axes[i].cross(&from_behind);
            rate.set_column(i, &stacked(&linear, &Vector3::zeros()));
            from_behind += velocities[i] * qd[i];
        }
        // Angular velocity of the joints before `i`, then with it.
        let mut angular_velocity = Vector3::zeros();
        for i in 0..JOINT_COUNT {
            let angular = angular_velocity.cross(&axes[i]);
            angular_velocity += axes[i] * qd[i];
            let linear = angular_velocity.cross(&velocities[i]);
            let column = rate.column(i) + stacked(&linear, &angular);
            rate.set_column(i, &column);
        }
        rate
    }

    /// Acceleration of the flange that velocity alone causes, `Jdot qd`, in `base_link`.
    ///
    /// Rows 0..3 are linear (m/s^2), rows 3..6 angular (rad/s^2).
    pub fn flange_bias_acceleration(&self, q: &Joints, qd: &Joints) -> Vector6<f64> {
        let links = self.link_poses(q);
        let flange = links[JOINT_COUNT - 1] * self.wrist_3_from_flange;
        let mut angular_velocity = Vector3::zeros();
        let mut angular_acceleration = Vector3::zeros();
        let mut linear_acceleration = Vector3::zeros();
        for i in 0..JOINT_COUNT {
            let axis = links[i].rotation * self.joints[i].axis.into_inner();
            angular_acceleration += angular_velocity.cross(&(axis * qd[i]));
            angular_velocity += axis * qd[i];
            let next = if i + 1 < JOINT_COUNT {
                &links[i + 1]
            } else {
                &flange
            };
            let arm = next.translation.vector - links[i].translation.vector;
            linear_acceleration += angular_acceleration.cross(&arm)
                + angular_velocity.cross(&angular_velocity.cross(&arm));
        }
        Vector6::new(
            linear_acceleration.x,
            linear_acceleration.y,
            linear_acceleration.z,
            angular_acceleration.x,
            angular_acceleration.y,
            angular_acceleration.z,
        )
    }
}

/// A linear vector over an angular one.
pub(crate) fn stacked(linear: &Vector3<f64>, angular: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(
        linear.x, linear.y, linear.z, angular.x, angular.y, angular.z,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::UrGeometry;
    use crate::pose_sets::PoseSet;
    use needlebench_numerics::random::SplitMix64;

    /// Step of the central differences, rad: the cube root of the rounding of a double.
    const STEP_RAD: f64 = 6e-6;

    /// Fifty times the rounding over the step, 1e-16 / 6e-6; the truncation is less.
    const DIFFERENCES: f64 = 1e-9;

    /// A hundred times the rounding of sums of six products below 10.
    const ROUNDING: f64 = 1e-13;

    fn postures() -> impl Iterator<Item = (Chain, Joints, Joints)> {
        let mut random = SplitMix64::new(5);
        // Axes and origins that no UR arm has, so that nothing hides behind parallel axes.
        let mut skewed = UrGeometry::UR3.chain();
        for joint in &mut skewed.joints {
            let turn = Vector3::new(random.uniform(-0.3, 0.3), 0.2, random.uniform(-0.3, 0.3));
            joint.parent_from_joint.rotation *= UnitQuaternion::new(turn);
            joint.axis = UnitVector3::new_normalize(Vector3::new(0.1, -0.2, 1.0));
        }
        skewed.wrist_3_from_flange.translation.vector = Vector3::new(0.02, -0.01, 0.05);
        [UrGeometry::UR3.chain(), skewed]
            .into_iter()
            .flat_map(move |chain| {
                PoseSet::ALL.into_iter().flat_map(move |set| {
                    let mut random = SplitMix64::new(6);
                    (0..10)
                        .map(|_| {
                            let q = set.sample(&UrGeometry::UR3, &mut random, 0.0);
                            let qd = Joints::from_fn(|_, _| random.uniform(-3.0, 3.0));
                            (chain, q, qd)
                        })
                        .collect::<Vec<_>>()
                })
            })
    }

    #[test]
    fn the_hessian_is_the_change_of_the_jacobian() {
        for (chain, q, _) in postures() {
            let hessian = chain.jacobian_hessian(&q);
            for (k, change) in hessian.iter().enumerate() {
                let mut step = Joints::zeros();
                step[k] = STEP_RAD;
                let difference =
                    (chain.jacobian(&(q + step)) - chain.jacobian(&(q - step))) / (2.0 * STEP_RAD);
                assert!((change - difference).amax() < DIFFERENCES);
            }
        }
    }

    #[test]
    fn the_rate_is_the_hessian_times_the_speeds() {
        for (chain, q, qd) in postures() {
            let hessian = chain.jacobian_hessian(&q);
            let sum: Matrix6<f64> = (0..JOINT_COUNT).map(|k| hessian[k] * qd[k]).sum();
            assert!((chain.jacobian_derivative(&q, &qd) - sum).amax() < ROUNDING);
        }
    }

    #[test]
    fn its_rate_times_the_speeds_is_the_bias() {
        for (chain, q, qd) in postures() {
            let bias = chain.jacobian_derivative(&q, &qd) * qd;
            assert!((bias - chain.flange_bias_acceleration(&q, &qd)).amax() < ROUNDING);
        }
    }
}
