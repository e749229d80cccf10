//! Motion that torques cause: forward dynamics, energy and momentum of the arm.

use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

use crate::{Dynamics, JOINT_COUNT, Joints};

/// Linear and angular part of a spatial vector, the angular one about the origin of `base_link`.
///
/// Of momentum: kg m/s and kg m^2/s. Of a force: N and N m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AboutBase {
    /// Momentum or force.
    pub linear: Vector3<f64>,
    /// Angular momentum or moment about the origin of `base_link`.
    pub angular: Vector3<f64>,
}

/// A link in motion, as spatial vectors at the origin of `base_link`, angular part first.
///
/// All links share the one frame, so that sums along the chain need no transforms (Featherstone,
/// *Rigid Body Dynamics Algorithms*, chapter 2). The price is some rounding: the inertia of a small
/// link is seen from up to a metre away, which costs three of the sixteen digits.
struct MovingLink {
    axis: Vector6<f64>,
    inertia: Matrix6<f64>,
    velocity: Vector6<f64>,
}

impl Dynamics {
    /// Joint accelerations (rad/s^2) under torques (N m), with armature.
    ///
    /// Articulated bodies; Featherstone, *Rigid Body Dynamics Algorithms*, section 7.3. Its inverse
    /// is [`Dynamics::inverse_dynamics`], to 1e-11 relative without any armature
    /// (`forward_and_inverse_dynamics_undo_each_other`). Not finite where the mass matrix is
    /// singular.
    pub fn forward_dynamics(&self, q: &Joints, qd: &Joints, torque_nm: &Joints) -> Joints {
        let links = self.moving_links(q, qd);
        // Velocity products, and the forces that they need.
        let bias: [Vector6<f64>; JOINT_COUNT] =
            std::array::from_fn(|i| cross_motion(&links[i].velocity, &(links[i].axis * qd[i])));
        let mut inertia = links[JOINT_COUNT - 1].inertia;
        let mut force = resting_force(&links[JOINT_COUNT - 1]);
        let mut along = [Vector6::zeros(); JOINT_COUNT];
        let mut resistance = Joints::zeros();
        let mut drive = Joints::zeros();
        for i in (0..JOINT_COUNT).rev() {
            along[i] = inertia * links[i].axis;
            resistance[i] = links[i].axis.dot(&along[i]) + self.armature_kgm2[i];
            drive[i] = torque_nm[i] - links[i].axis.dot(&force);
            if i > 0 {
                // The rotor turns with the joint alone: its armature stays out of what the parent
                // feels along other directions.
                inertia -= along[i] * along[i].transpose() / resistance[i];
                force += inertia * bias[i] + along[i] * (drive[i] / resistance[i]);
                inertia += links[i - 1].inertia;
                force += resting_force(&links[i - 1]);
            }
        }
        // Accelerating the base upwards is the same as gravity downwards.
        let mut acceleration = stacked(&Vector3::zeros(), &-self.gravity_m_s2);
        let mut qdd = Joints::zeros();
        for i in 0..JOINT_COUNT {
            acceleration += bias[i];
            qdd[i] = (drive[i] - along[i].dot(&acceleration)) / resistance[i];
            acceleration += links[i].axis * qdd[i];
        }
        qdd
    }

    /// Kinetic energy of links and rotors, J.
    pub fn kinetic_energy_j(&self, q: &Joints, qd: &Joints) -> f64 {
        let links: f64 = self
            .moving_links(q, qd)
            .iter()
            .map(|link| link.velocity.dot(&(link.inertia * link.velocity)))
            .sum();
        let rotors = self.armature_kgm2.dot(&qd.component_mul(qd));
        0.5 * (links + rotors)
    }

    /// Potential energy in the field of gravity, J; zero with all mass at the origin of
    /// `base_link`.
    pub fn potential_energy_j(&self, q: &Joints) -> f64 {
        -self
            .first_moments_kgm(q)
            .iter()
            .map(|moment| self.gravity_m_s2.dot(moment))
            .sum::<f64>()
    }

    /// Momentum of the links.
    ///
    /// Rotors are only inertia along their own joint, in this model as in the engines: they carry
    /// energy but no momentum of the arm.
    pub fn momentum(&self, q: &Joints, qd: &Joints) -> AboutBase {
        let sum: Vector6<f64> = self
            .moving_links(q, qd)
            .iter()
            .map(|link| link.inertia * link.velocity)
            .sum();
        AboutBase::from_spatial(&sum)
    }

    /// Force and moment that `base_link` bears the arm with when it moves so.
    ///
    /// Together with [`Dynamics::gravity_load`] it is the rate of change of [`Dynamics::momentum`].
    pub fn base_reaction(&self, q: &Joints, qd: &Joints, qdd: &Joints) -> AboutBase {
        let links = self.moving_links(q, qd);
        let mut acceleration = stacked(&Vector3::zeros(), &-self.gravity_m_s2);
        let mut reaction = Vector6::zeros();
        for (i, link) in links.iter().enumerate() {
            acceleration += cross_motion(&link.velocity, &(link.axis * qd[i])) + link.axis * qdd[i];
            reaction += link.inertia * acceleration + resting_force(link);
        }
        AboutBase::from_spatial(&reaction)
    }

    /// Weight of the arm.
    pub fn gravity_load(&self, q: &Joints) -> AboutBase {
        let mut load = AboutBase {
            linear: Vector3::zeros(),
            angular: Vector3::zeros(),
        };
        for (body, moment) in self.bodies.iter().zip(self.first_moments_kgm(q)) {
            load.linear += self.gravity_m_s2 * body.mass_kg;
            load.angular += moment.cross(&self.gravity_m_s2);
        }
        load
    }

    /// Power that torques feed into the arm, W.
    pub fn power_w(qd: &Joints, torque_nm: &Joints) -> f64 {
        qd.dot(torque_nm)
    }

    /// Mass times centre of mass of every link, in `base_link`, kg m.
    fn first_moments_kgm(&self, q: &Joints) -> [Vector3<f64>; JOINT_COUNT] {
        let poses = self.chain.link_poses(q);
        std::array::from_fn(|i| {
            let body = &self.bodies[i];
            (poses[i].translation.vector + poses[i].rotation * body.com_m) * body.mass_kg
        })
    }

    fn moving_links(&self, q: &Joints, qd: &Joints) -> [MovingLink; JOINT_COUNT] {
        let poses = self.chain.link_poses(q);
        let mut velocity = Vector6::zeros();
        std::array::from_fn(|i| {
            let origin = poses[i].translation.vector;
            let rotation = poses[i].rotation.to_rotation_matrix();
            let direction = rotation * self.chain.joints[i].axis.into_inner();
            let axis = stacked(&direction, &origin.cross(&direction));
            velocity += axis * qd[i];
            let body = &self.bodies[i];
            let com = origin + rotation * body.com_m;
            let about_com = rotation * body.inertia_kgm2 * rotation.transpose();
            MovingLink {
                axis,
                inertia: spatial_inertia(body.mass_kg, &com, &about_com),
                velocity,
            }
        })
    }
}

impl AboutBase {
    fn from_spatial(vector: &Vector6<f64>) -> Self {
        Self {
            linear: vector.fixed_rows::<3>(3).into_owned(),
            angular: vector.fixed_rows::<3>(0).into_owned(),
        }
    }
}

/// Inertia about the origin of the frame in which `com` is given, angular rows first.
fn spatial_inertia(mass_kg: f64, com_m: &Vector3<f64>, about_com: &Matrix3<f64>) -> Matrix6<f64> {
    let cross = com_m.cross_matrix();
    let coupling = cross * mass_kg;
    let mut inertia = Matrix6::zeros();
    inertia
        .fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&(about_com - coupling * cross));
    inertia.fixed_view_mut::<3, 3>(0, 3).copy_from(&coupling);
    inertia.fixed_view_mut::<3, 3>(3, 0).copy_from(&-coupling);
    inertia.fixed_view_mut::<3, 3>(3, 3).fill_diagonal(mass_kg);
    inertia
}

/// Force that keeps a link at constant spatial velocity, `v x* I v`.
fn resting_force(link: &MovingLink) -> Vector6<f64> {
    let momentum = AboutBase::from_spatial(&(link.inertia * link.velocity));
    let AboutBase { linear, angular } = AboutBase::from_spatial(&link.velocity);
    stacked(
        &(angular.cross(&momentum.angular) + linear.cross(&momentum.linear)),
        &angular.cross(&momentum.linear),
    )
}

/// Rate of change of a motion vector that is carried along with velocity `v`, `v x m`.
fn cross_motion(v: &Vector6<f64>, m: &Vector6<f64>) -> Vector6<f64> {
    let (v, m) = (AboutBase::from_spatial(v), AboutBase::from_spatial(m));
    stacked(
        &v.angular.cross(&m.angular),
        &(v.angular.cross(&m.linear) + v.linear.cross(&m.angular)),
    )
}

/// Spatial vector from its parts.
fn stacked(angular: &Vector3<f64>, linear: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(
        angular.x, angular.y, angular.z, linear.x, linear.y, linear.z,
    )
}
#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, SVector};

    use super::*;
    use crate::{Body, UrGeometry, integrate};
    use needlebench_numerics::random::SplitMix64;

    /// Ten times the worst that is seen over the states below, without armature.
    const INVERSE: f64 = 1e-11;

    /// Ten times the worst that is seen: sums of some ten products.
    const ROUNDING: f64 = 1e-13;

    fn random_vector(random: &mut SplitMix64, half_width: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| random.uniform(-half_width, half_width))
    }

    /// A UR3's chain with bodies about as heavy as its own, none of them symmetric.
    fn arm(random: &mut SplitMix64, armature_kgm2: f64) -> Dynamics {
        let masses = [2.0, 3.4, 1.3, 0.8, 0.8, 0.5];
        let bodies = masses.map(|mass_kg| {
            // Moments of three point pairs, so that the triangle inequality holds.
            let spread = random_vector(random, 0.1).map(|each| (0.02 + each.abs()).powi(2));
            let moments = Vector3::new(
                spread.y + spread.z,
                spread.x + spread.z,
                spread.x + spread.y,
            );
            let turn = Rotation3::new(random_vector(random, 2.0));
            Body {
                mass_kg,
                com_m: random_vector(random, 0.1),
                inertia_kgm2: turn
                    * Matrix3::from_diagonal(&(moments * (mass_kg / 3.0)))
                    * turn.inverse(),
            }
        });
        Dynamics {
            chain: UrGeometry::UR3.chain(),
            bodies,
            armature_kgm2: Joints::repeat(armature_kgm2),
            gravity_m_s2: Vector3::new(1.0, -2.0, -9.5),
        }
    }

    fn random_joints(random: &mut SplitMix64, half_width: f64) -> Joints {
        Joints::from_fn(|_, _| random.uniform(-half_width, half_width))
    }

    #[test]
    fn forward_and_inverse_dynamics_undo_each_other() {
        let mut random = SplitMix64::new(11);
        for armature_kgm2 in [0.0, 0.05] {
            let mut worst: f64 = 0.0;
            for _ in 0..200 {
                let arm = arm(&mut random, armature_kgm2);
                let [q, qd, qdd] = [3.0, 3.0, 20.0].map(|most| random_joints(&mut random, most));
                let torque = arm.inverse_dynamics(&q, &qd, &qdd);
                let found = arm.forward_dynamics(&q, &qd, &torque);
                worst = worst.max((found - qdd).amax() / qdd.amax());
            }
            println!("armature {armature_kgm2}: {worst:e}");
            assert!(worst < INVERSE, "{worst:e}");
        }
    }

    #[test]
    fn kinetic_energy_is_that_of_the_mass_matrix() {
        let mut random = SplitMix64::new(12);
        for _ in 0..100 {
            let arm = arm(&mut random, 0.05);
            let [q, qd] = [3.0, 3.0].map(|most| random_joints(&mut random, most));
            let expected = 0.5 * qd.dot(&(arm.mass_matrix(&q) * qd));
            let energy = arm.kinetic_energy_j(&q, &qd);
            assert!((energy - expected).abs() < ROUNDING * expected.max(1.0));
        }
    }

    #[test]
    fn gravity_torque_is_the_slope_of_the_potential_energy() {
        /// Step of the central differences, rad, and what truncation and rounding leave of it.
        const STEP_RAD: f64 = 1e-5;
        const DIFFERENCES_NM: f64 = 1e-8;
        let mut random = SplitMix64::new(13);
        for _ in 0..20 {
            let arm = arm(&mut random, 0.05);
            let q = random_joints(&mut random, 3.0);
            let gravity = arm.gravity_torque(&q);
            for i in 0..JOINT_COUNT {
                let mut step = Joints::zeros();
                step[i] = STEP_RAD;
                let slope = (arm.potential_energy_j(&(q + step))
                    - arm.potential_energy_j(&(q - step)))
                    / (2.0 * STEP_RAD);
                assert!((slope - gravity[i]).abs() < DIFFERENCES_NM);
            }
        }
    }

    #[test]
    fn the_reaction_about_the_first_axis_is_its_torque() {
        let mut random = SplitMix64::new(14);
        for _ in 0..50 {
            let arm = arm(&mut random, 0.0);
            let [q, qd, qdd] = [3.0, 3.0, 20.0].map(|most| random_joints(&mut random, most));
            let torque = arm.inverse_dynamics(&q, &qd, &qdd);
            let reaction = arm.base_reaction(&q, &qd, &qdd);
            // The first joint's axis is z of `base_link` through its origin.
            assert!((reaction.angular.z - torque[0]).abs() < ROUNDING * torque.amax().max(1.0));
            let rest = arm.base_reaction(&q, &Joints::zeros(), &Joints::zeros());
            let load = arm.gravity_load(&q);
            assert!((rest.linear + load.linear).amax() < ROUNDING * 100.0);
            assert!((rest.angular + load.angular).amax() < ROUNDING * 100.0);
        }
    }

    /// Required of the reference integrator: a relative imbalance below 1e-9 over 10 s.
    const BALANCE: f64 = 1e-9;

    /// Joint state, work of the torques, and impulse of everything that acts on the arm.
    type Ledger = SVector<f64, 19>;

    /// Largest departures from the balances of energy and momentum over 10 s under torques that
    /// change every 10 ms, relative to the largest energy and momentum on the way.
    fn imbalance(arm: &Dynamics, torque: impl Fn(u32, &Joints, &Joints) -> Joints) -> [f64; 3] {
        let split = |ledger: &Ledger| -> (Joints, Joints) {
            (
                ledger.fixed_rows::<6>(0).into_owned(),
                ledger.fixed_rows::<6>(6).into_owned(),
            )
        };
        let momentum = |q: &Joints, qd: &Joints| {
            let AboutBase { linear, angular } = arm.momentum(q, qd);
            stacked(&angular, &linear)
        };
        let mut ledger = Ledger::zeros();
        let start = Joints::new(0.2, -1.6, 1.5, -1.2, -1.4, 0.3);
        ledger.fixed_rows_mut::<6>(0).copy_from(&start);
        let potential_j = arm.potential_energy_j(&start);
        let [mut energy_scale, mut momentum_scale] = [0.0_f64; 2];
        let [mut energy_gap, mut momentum_gap, mut work_gap] = [0.0_f64; 3];
        let mut work_by_angles_j = 0.0;
        for k in 0..1000 {
            let (before, speed) = split(&ledger);
            let held = torque(k, &before, &speed);
            let slope = |ledger: &Ledger| {
                let (q, qd) = split(ledger);
                let qdd = arm.forward_dynamics(&q, &qd, &held);
                let (reaction, load) = (arm.base_reaction(&q, &qd, &qdd), arm.gravity_load(&q));
                let mut slope = Ledger::zeros();
                slope.fixed_rows_mut::<6>(0).copy_from(&qd);
                slope.fixed_rows_mut::<6>(6).copy_from(&qdd);
                slope[12] = Dynamics::power_w(&qd, &held);
                let force = stacked(
                    &(reaction.angular + load.angular),
                    &(reaction.linear + load.linear),
                );
                slope.fixed_rows_mut::<6>(13).copy_from(&force);
                slope
            };
            ledger = integrate(slope, &ledger, 0.01, 1e-12).unwrap();
            let (q, qd) = split(&ledger);
            // Under held torques the work is known without any integral.
            work_by_angles_j += held.dot(&(q - before));
            let kinetic_j = arm.kinetic_energy_j(&q, &qd);
            let energy_j = kinetic_j + arm.potential_energy_j(&q) - potential_j;
            energy_scale = energy_scale.max(kinetic_j);
            energy_gap = energy_gap.max((energy_j - ledger[12]).abs());
            work_gap = work_gap.max((work_by_angles_j - ledger[12]).abs());
            let carried = momentum(&q, &qd);
            momentum_scale = momentum_scale.max(carried.norm());
            momentum_gap =
                momentum_gap.max((carried - ledger.fixed_rows::<6>(13).into_owned()).norm());
        }
        [
            energy_gap / energy_scale,
            work_gap / energy_scale,
            momentum_gap / momentum_scale,
        ]
    }

    #[test]
    fn energy_work_and_momentum_balance_over_ten_seconds() {
        let mut random = SplitMix64::new(15);
        // A free swing, and an arm without rotors that is thrown about.
        let free = imbalance(&arm(&mut random, 0.05), |_, _, _| Joints::zeros());
        let bare = arm(&mut random, 0.0);
        let driven = imbalance(&bare, |k, q, qd| {
            let turn = Joints::from_fn(|i, _| libm::sin(f64::from(k) * 0.02 + i as f64));
            bare.gravity_torque(q) + turn * 0.5 - qd * 0.1
        });
        println!("energy, work, momentum: free {free:?}, driven {driven:?}");
        for gap in free.into_iter().chain(driven) {
            assert!(gap < BALANCE, "{gap:e}");
        }
    }
}
