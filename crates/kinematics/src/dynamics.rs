//! Recursive Newton-Euler and composite-rigid-body dynamics of the arm.

use nalgebra::{Matrix3, Matrix6, Vector3};

use crate::{Chain, JOINT_COUNT, Joints};

/// Mass properties of one rigid body, in the frame of its link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Body {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass in the link frame, m.
    pub com_m: Vector3<f64>,
    /// Inertia tensor about the centre of mass, along the link's axes, kg m^2.
    pub inertia_kgm2: Matrix3<f64>,
}

impl Body {
    /// A body without mass.
    pub fn massless() -> Self {
        Self {
            mass_kg: 0.0,
            com_m: Vector3::zeros(),
            inertia_kgm2: Matrix3::zeros(),
        }
    }

    /// The two bodies as one rigid body (parallel-axis theorem); both in the same frame.
    pub fn combined_with(&self, other: &Self) -> Self {
        let mass_kg = self.mass_kg + other.mass_kg;
        if mass_kg <= 0.0 {
            return Self::massless();
        }
        let com_m = (self.com_m * self.mass_kg + other.com_m * other.mass_kg) / mass_kg;
        let inertia_kgm2 = self.inertia_about(&com_m) + other.inertia_about(&com_m);
        Self {
            mass_kg,
            com_m,
            inertia_kgm2,
        }
    }

    /// The same body seen from another frame: `a_from_b` takes this body's frame to the new one.
    pub fn transformed(&self, a_from_b: &crate::Pose) -> Self {
        let rotation = a_from_b.rotation.to_rotation_matrix();
        Self {
            mass_kg: self.mass_kg,
            com_m: (a_from_b * nalgebra::Point3::from(self.com_m)).coords,
            inertia_kgm2: rotation * self.inertia_kgm2 * rotation.inverse(),
        }
    }

    fn inertia_about(&self, point_m: &Vector3<f64>) -> Matrix3<f64> {
        let r = self.com_m - point_m;
        self.inertia_kgm2
            + (Matrix3::identity() * r.norm_squared() - r * r.transpose()) * self.mass_kg
    }
}

/// The arm as rigid bodies: inverse dynamics, mass matrix and gravity torque.
///
/// Agrees with MuJoCo's `mj_inverse` and `mj_fullM` to 1e-10 relative at random states; see
/// `tests/validation/engines/mod.rs`; and with Pinocchio to 3e-15: `tests/validation/dynamics/mod.rs`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dynamics {
    /// The joints.
    pub chain: Chain,
    /// Mass properties of the six moving links, tool included in the last.
    pub bodies: [Body; JOINT_COUNT],
    /// Reflected rotor inertia, added to the diagonal of the mass matrix, kg m^2.
    pub armature_kgm2: Joints,
    /// Acceleration of gravity in `base_link`, m/s^2.
    pub gravity_m_s2: Vector3<f64>,
}

impl Dynamics {
    /// Joint torques (N m) that produce acceleration `qdd` at state `q`, `qd`.
    ///
    /// Recursive Newton-Euler, with armature. Featherstone, *Rigid Body Dynamics Algorithms*,
    /// section 5.3, written with positions and forces in `base_link`.
    pub fn inverse_dynamics(&self, q: &Joints, qd: &Joints, qdd: &Joints) -> Joints {
        let links = self.chain.link_poses(q);
        let mut axes = [Vector3::zeros(); JOINT_COUNT];
        let mut forces = [Vector3::zeros(); JOINT_COUNT];
        let mut moments = [Vector3::zeros(); JOINT_COUNT]; // about each link's origin
        let mut omega = Vector3::zeros();
        let mut alpha = Vector3::zeros();
        // Accelerating the base upwards is the same as gravity downwards.
        let mut acceleration = -self.gravity_m_s2;
        let mut origin = Vector3::zeros();
        for i in 0..JOINT_COUNT {
            let link = &links[i];
            let arm = link.translation.vector - origin;
            acceleration += alpha.cross(&arm) + omega.cross(&omega.cross(&arm));
            origin = link.translation.vector;
            let axis = link.rotation * self.chain.joints[i].axis.into_inner();
            axes[i] = axis;
            alpha += axis * qdd[i] + omega.cross(&(axis * qd[i]));
            omega += axis * qd[i];

            let body = &self.bodies[i];
            let rotation = link.rotation.to_rotation_matrix();
            let com = rotation * body.com_m;
            let inertia = rotation * body.inertia_kgm2 * rotation.inverse();
            let com_acceleration =
                acceleration + alpha.cross(&com) + omega.cross(&omega.cross(&com));
            forces[i] = com_acceleration * body.mass_kg;
            moments[i] = inertia * alpha + omega.cross(&(inertia * omega)) + com.cross(&forces[i]);
        }
        let mut torques = Joints::zeros();
        for i in (0..JOINT_COUNT).rev() {
            torques[i] = axes[i].dot(&moments[i]) + self.armature_kgm2[i] * qdd[i];
            if i > 0 {
                let arm = links[i].translation.vector - links[i - 1].translation.vector;
                let (force, moment) = (forces[i], moments[i]);
                forces[i - 1] += force;
                moments[i - 1] += moment + arm.cross(&force);
            }
        }
        torques
    }

    /// Torques that hold the arm still at `q`, N m.
    pub fn gravity_torque(&self, q: &Joints) -> Joints {
        self.inverse_dynamics(q, &Joints::zeros(), &Joints::zeros())
    }

    /// Joint-space mass matrix with armature, kg m^2 (composite rigid bodies).
    pub fn mass_matrix(&self, q: &Joints) -> Matrix6<f64> {
        let links = self.chain.link_poses(q);
        let mut composite = Body::massless();
        let mut matrix = Matrix6::zeros();
        for i in (0..JOINT_COUNT).rev() {
            composite = composite.combined_with(&self.bodies[i].transformed(&links[i]));
            let axis = links[i].rotation * self.chain.joints[i].axis.into_inner();
            let arm = composite.com_m - links[i].translation.vector;
            // Momentum of everything beyond joint i when it alone turns at unit speed.
            let linear = axis.cross(&arm) * composite.mass_kg;
            let angular_about_com = composite.inertia_kgm2 * axis;
            for j in 0..=i {
                let axis_j = links[j].rotation * self.chain.joints[j].axis.into_inner();
                let arm_j = composite.com_m - links[j].translation.vector;
                let value = axis_j.dot(&(angular_about_com + arm_j.cross(&linear)));
                matrix[(i, j)] = value;
                matrix[(j, i)] = value;
            }
            matrix[(i, i)] += self.armature_kgm2[i];
        }
        matrix
    }
}
