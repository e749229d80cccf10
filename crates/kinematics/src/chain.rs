//! Serial chain of six revolute joints, as a URDF describes it.

use nalgebra::{Matrix6, UnitQuaternion, UnitVector3, Vector3, Vector6};

use crate::{JOINT_COUNT, Joints, Pose};

/// One revolute joint: `parent_from_child(q) = parent_from_joint * rotation(axis, q)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChainJoint {
    /// Pose of the joint (and of the child link at `q = 0`) in its parent link.
    pub parent_from_joint: Pose,
    /// Axis of rotation in the joint's frame, which is also the child link's.
    pub axis: UnitVector3<f64>,
}

/// The arm's chain from `base_link` to the flange.
#[derive(Debug, Clone, Copy, PartialEq)]
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
        let links = self.link_poses(q);
        let point = links[JOINT_COUNT - 1]
            * self.wrist_3_from_flange
            * nalgebra::Point3::from(*point_in_flange);
        let mut jacobian = Matrix6::zeros();
        for (i, link) in links.iter().enumerate() {
            let axis = link.rotation * self.joints[i].axis.into_inner();
            let linear = axis.cross(&(point.coords - link.translation.vector));
            jacobian.set_column(
                i,
                &Vector6::new(linear.x, linear.y, linear.z, axis.x, axis.y, axis.z),
            );
        }
        jacobian
    }

    /// Geometric Jacobian of the flange, in `base_link`; see [`Chain::jacobian_at`].
    pub fn jacobian(&self, q: &Joints) -> Matrix6<f64> {
        self.jacobian_at(q, &Vector3::zeros())
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
