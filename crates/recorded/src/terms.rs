//! What the torques of a row are made of, term by term.

use nalgebra::{Matrix3, Vector3};
use needlebench_kinematics::{Body, Chain, JOINT_COUNT, Joints};

/// Numbers per joint and row.
pub(crate) const TERMS: usize = 21;

/// What the terms are, by their places. Torques in N m, of gravity per m/s^2.
pub(crate) mod term {
    /// The torque that is to be explained.
    pub(crate) const TORQUE: usize = 0;
    /// Inertia of the links as points at their centres of mass.
    pub const LINKS: usize = 1;
    /// Inertia of the links about their centres.
    pub(crate) const TENSORS: usize = 2;
    /// Gravity on the links.
    pub(crate) const LINKS_GRAVITY: usize = 3;
    /// Of a load, per kg and kg m in the flange's frame: mass, then mass times centre.
    pub const LOAD: usize = 4;
    /// Gravity on it, in the same order.
    pub(crate) const LOAD_GRAVITY: usize = 8;
    /// Its inertia about the flange's origin, per kg m^2: xx, yy, zz, xy, xz, yz.
    pub(crate) const LOAD_INERTIA: usize = 12;
    /// The joint's acceleration.
    pub(crate) const ACCELERATION: usize = 18;
    /// The joint's speed.
    pub(crate) const SPEED: usize = 19;
    /// The sign of its speed; 0 at rest.
    pub const DIRECTION: usize = 20;
}

/// An arm whose torques are taken apart.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Arm {
    pub chain: Chain,
    pub bodies: [Body; JOINT_COUNT],
    /// Upwards in `base_link`, where the arm stands.
    pub up: Vector3<f64>,
}

/// Force at the flange's origin and moment about it.
type Wrench = (Vector3<f64>, Vector3<f64>);

impl Arm {
    /// The terms of all joints at a state, without the torque itself.
    ///
    /// The recursion is written a second time, beside the one of `Dynamics`, because it keeps apart what
    /// that adds up; `they_add_up_to_the_inverse_dynamics` holds one against the other.
    pub fn terms(&self, q: &Joints, qd: &Joints, qdd: &Joints) -> [[f64; TERMS]; JOINT_COUNT] {
        let links = self.chain.link_poses(q);
        let mut axes = [Vector3::zeros(); JOINT_COUNT];
        // Force and moment about each link's origin of what moves with it: points, tensors, gravity.
        let mut wrenches = [[(Vector3::zeros(), Vector3::zeros()); 3]; JOINT_COUNT];
        let (mut omega, mut alpha) = (Vector3::zeros(), Vector3::zeros());
        let (mut acceleration, mut origin) = (Vector3::zeros(), Vector3::zeros());
        for i in 0..JOINT_COUNT {
            let arm = links[i].translation.vector - origin;
            acceleration += alpha.cross(&arm) + omega.cross(&omega.cross(&arm));
            origin = links[i].translation.vector;
            axes[i] = links[i].rotation * self.chain.joints[i].axis.into_inner();
            alpha += axes[i] * qdd[i] + omega.cross(&(axes[i] * qd[i]));
            omega += axes[i] * qd[i];
            let body = &self.bodies[i];
            let com = links[i].rotation * body.com_m;
            let force =
                (acceleration + alpha.cross(&com) + omega.cross(&omega.cross(&com))) * body.mass_kg;
            let rotation = links[i].rotation.to_rotation_matrix();
            let inertia = rotation * body.inertia_kgm2 * rotation.transpose();
            let weight = self.up * body.mass_kg;
            wrenches[i] = [
                (force, com.cross(&force)),
                (
                    Vector3::zeros(),
                    inertia * alpha + omega.cross(&(inertia * omega)),
                ),
                (weight, com.cross(&weight)),
            ];
        }
        let mut terms = [[0.0; TERMS]; JOINT_COUNT];
        for i in (0..JOINT_COUNT).rev() {
            for (place, (_, moment)) in [term::LINKS, term::TENSORS, term::LINKS_GRAVITY]
                .into_iter()
                .zip(wrenches[i])
            {
                terms[i][place] = axes[i].dot(&moment);
            }
            if i > 0 {
                let arm = links[i].translation.vector - links[i - 1].translation.vector;
                let (before, from) = wrenches.split_at_mut(i);
                for (sum, (force, moment)) in before[i - 1].iter_mut().zip(from[0]) {
                    sum.0 += force;
                    sum.1 += moment + arm.cross(&force);
                }
            }
        }
        let flange = links[JOINT_COUNT - 1] * self.chain.wrist_3_from_flange;
        let arm = flange.translation.vector - origin;
        let at_flange = acceleration + alpha.cross(&arm) + omega.cross(&omega.cross(&arm));
        let rotation = flange.rotation.to_rotation_matrix().into_inner();
        let load = self.load(&rotation, &at_flange, &omega, &alpha);
        for (i, terms) in terms.iter_mut().enumerate() {
            let arm = flange.translation.vector - links[i].translation.vector;
            for (place, (force, moment)) in load.iter().enumerate() {
                terms[term::LOAD + place] = axes[i].dot(&(arm.cross(force) + moment));
            }
            terms[term::ACCELERATION] = qdd[i];
            terms[term::SPEED] = qd[i];
            terms[term::DIRECTION] = if qd[i] == 0.0 { 0.0 } else { qd[i].signum() };
        }
        terms
    }

    /// Wrenches of a load: per unit of mass, of mass times centre, gravity of both, and of inertia.
    fn load(
        &self,
        rotation: &Matrix3<f64>,
        acceleration: &Vector3<f64>,
        omega: &Vector3<f64>,
        alpha: &Vector3<f64>,
    ) -> [Wrench; 14] {
        let mut found = [(Vector3::zeros(), Vector3::zeros()); 14];
        found[0].0 = *acceleration;
        found[4].0 = self.up;
        for k in 0..3 {
            let axis = rotation.column(k).into_owned();
            let force = alpha.cross(&axis) + omega.cross(&omega.cross(&axis));
            found[1 + k] = (force, axis.cross(acceleration));
            found[5 + k].1 = axis.cross(&self.up);
        }
        let (local_omega, local_alpha) =
            (rotation.transpose() * omega, rotation.transpose() * alpha);
        for (place, (a, b)) in [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
            .into_iter()
            .enumerate()
        {
            let mut inertia = Matrix3::zeros();
            inertia[(a, b)] = 1.0;
            inertia[(b, a)] = 1.0;
            let moment = inertia * local_alpha + local_omega.cross(&(inertia * local_omega));
            found[8 + place].1 = rotation * moment;
        }
        found
    }
}

/// Inertia of a point load about the flange's origin, in the order of the terms, kg m^2.
pub(crate) fn point_inertia(mass_kg: f64, centre_m: &Vector3<f64>) -> [f64; 6] {
    let c = centre_m;
    let square = c.norm_squared();
    [
        mass_kg * (square - c.x * c.x),
        mass_kg * (square - c.y * c.y),
        mass_kg * (square - c.z * c.z),
        -mass_kg * c.x * c.y,
        -mass_kg * c.x * c.z,
        -mass_kg * c.y * c.z,
    ]
}

#[cfg(test)]
mod tests {
    use needlebench_kinematics::Dynamics;
    use needlebench_numerics::random::SplitMix64;
    use needlebench_scenario::{Overrides, load_robot};

    use super::*;

    /// Rounding of sums of a hundred products of up to 100 N m.
    const ROUNDING_NM: f64 = 1e-11;

    #[test]
    fn they_add_up_to_the_inverse_dynamics() {
        let overrides = Overrides {
            arm: Some("ur3e".to_owned()),
            ..Overrides::default()
        };
        let robot = load_robot(&overrides).unwrap();
        let up = Vector3::new(0.3, -0.2, 0.9).normalize();
        let gravity = 9.82;
        let arm = Arm {
            chain: robot.chain,
            bodies: robot.bodies,
            up,
        };
        let (mass_kg, centre_m) = (1.3, Vector3::new(0.02, -0.03, 0.06));
        let load = Body {
            mass_kg,
            com_m: centre_m,
            inertia_kgm2: Matrix3::zeros(),
        };
        let mut bodies = robot.bodies;
        bodies[5] = bodies[5].combined_with(&load.transformed(&robot.chain.wrist_3_from_flange));
        let dynamics = Dynamics {
            chain: robot.chain,
            bodies,
            armature_kgm2: Joints::new(0.6, 0.5, 0.4, 0.3, 0.2, 0.1),
            gravity_m_s2: -up * gravity,
        };
        let mut random = SplitMix64::new(3);
        for _ in 0..200 {
            let mut draw = || Joints::from_fn(|_, _| random.uniform(-3.0, 3.0));
            let (q, qd, qdd) = (draw(), draw(), draw());
            let terms = arm.terms(&q, &qd, &qdd);
            let wanted = dynamics.inverse_dynamics(&q, &qd, &qdd);
            for i in 0..JOINT_COUNT {
                let of = |place: usize| terms[i][place];
                let c = centre_m * mass_kg;
                let loads = [mass_kg, c.x, c.y, c.z];
                let mut sum =
                    of(term::LINKS) + of(term::TENSORS) + gravity * of(term::LINKS_GRAVITY);
                for (k, value) in loads.into_iter().enumerate() {
                    sum += value * (of(term::LOAD + k) + gravity * of(term::LOAD_GRAVITY + k));
                }
                for (k, value) in point_inertia(mass_kg, &centre_m).into_iter().enumerate() {
                    sum += value * of(term::LOAD_INERTIA + k);
                }
                sum += dynamics.armature_kgm2[i] * of(term::ACCELERATION);
                assert!(
                    (sum - wanted[i]).abs() < ROUNDING_NM,
                    "{} {}",
                    sum,
                    wanted[i]
                );
            }
        }
    }
}
