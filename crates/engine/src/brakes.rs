//! Brakes of the joints, and stops of category 0.
//!
//! # The model
//!
//! From the moment at which the drives are off, each joint is held by a brake that resists with
//! `coulomb + viscous |speed|`: a friction brake, and the motor's windings, which brake in
//! proportion to the speed. A joint that the brake can hold stands.
//!
//! # The numbers
//!
//! Manufacturers publish distance and time of stops of category 0 at full extension, from a speed and with
//! a load; an arm's data have them ([`BrakeFigures`]). Under a constant torque the distance would be half
//! of speed times time; a brake that goes less far is harder while it is fast. Of one joint with the
//! inertia `M`, from the speed `w`,
//!
//! ```text
//! M dw/dt = -(c + b w)     x = b w / c
//! time     = (M w / c)   ln(1 + x) / x
//! distance = (M w^2 / c) (x - ln(1 + x)) / x^2
//! ```
//!
//! so `distance / (w time)` gives `x` and the time then `c`. `M` and gravity's torque are those of the dynamics that is
//! given, stretched out level, with the load at the flange. Where the manufacturer does not say which way the joint
//! moves, *assumed* is the worse one, downwards, so the constant torque is `c` plus gravity's half way down. A joint
//! without figures has another one's brake by the ratio of their torque limits. So both parameters of a joint's brake
//! are fitted to its two figures: stops that engines make with them show how good the closed form is, not how good the
//! model is. Of other speeds, loads and postures no manufacturer has published figures of an arm that ships. A brake
//! that stands holds a multiple of what it has while it slips; the data say which.

use nalgebra::{Matrix3, Matrix6, Vector3};
use needlebench_cell::{BrakeFigure, BrakeFigures, STANDARD_GRAVITY_M_S2};
use needlebench_kinematics::{Body, Dynamics, JOINT_COUNT, Joints};

/// Speed below which a joint counts as standing, rad/s: a few millimetres a second at the end of the arm,
/// and ten times what a step of 1 ms leaves of a joint that is held while others stop from full speed.
const STANDING_RAD_S: f64 = 1e-2;

/// Most sweeps over the joints per step.
const SWEEPS: usize = 100;

/// Change of a torque below which the sweeps end, N m.
const SOLVED_NM: f64 = 1e-11;

/// Brakes of all joints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Brakes {
    /// Torque of a slipping brake at no speed, N m.
    pub coulomb_nm: Joints,
    /// Torque by speed, N m s/rad.
    pub viscous_nms_per_rad: Joints,
    /// Torque of a brake that stands over that of one that slips.
    pub standing_ratio: f64,
}

impl Brakes {
    /// The brakes of an arm with this dynamics, to which the load of the published stops is added.
    pub fn of_figures(figures: &BrakeFigures, dynamics: &Dynamics) -> Self {
        let loaded = loaded(dynamics, figures.load_kg);
        let stretched = stretched();
        let mass = loaded.mass_matrix(&stretched);
        let level = loaded.gravity_torque(&stretched);
        let mut brakes = Self {
            coulomb_nm: Joints::zeros(),
            viscous_nms_per_rad: Joints::zeros(),
            standing_ratio: figures.standing_ratio,
        };
        for (joint, figure) in figures.joints.iter().enumerate() {
            let &BrakeFigure::Published {
                distance_rad,
                time_s,
                ..
            } = figure
            else {
                continue;
            };
            let speed = figures.speed_rad_s;
            let x = viscous_share(distance_rad / (speed * time_s));
            let slowing = if x > 0.0 { libm::log1p(x) / x } else { 1.0 };
            let net_nm = mass[(joint, joint)] * speed / time_s * slowing;
            brakes.viscous_nms_per_rad[joint] = x * net_nm / speed;
            // Half way down: it falls off by a few percent over a stop.
            let mut half_way = stretched;
            half_way[joint] -= 0.5 * distance_rad * level[joint].signum();
            let gravity_nm = loaded.gravity_torque(&half_way)[joint].abs();
            brakes.coulomb_nm[joint] = net_nm + gravity_nm;
        }
        for (joint, figure) in figures.joints.iter().enumerate() {
            let &BrakeFigure::Like {
                joint: model,
                torque_ratio,
                ..
            } = figure
            else {
                continue;
            };
            brakes.coulomb_nm[joint] = torque_ratio * brakes.coulomb_nm[model];
            brakes.viscous_nms_per_rad[joint] = torque_ratio * brakes.viscous_nms_per_rad[model];
        }
        brakes
    }

    /// Largest torque at these speeds but for the viscous part, N m.
    fn friction_nm(&self, velocity: &Joints) -> Joints {
        self.coulomb_nm.zip_map(velocity, |coulomb, speed| {
            if speed.abs() < STANDING_RAD_S {
                self.standing_ratio * coulomb
            } else {
                coulomb
            }
        })
    }

    /// Torques of the brakes over a step of `timestep_s`, N m.
    ///
    /// Of all torques of dry friction within the brakes' capacity those with which every joint either
    /// stands at the step's end or slips against its whole brake, with the mass matrix and forces of
    /// `dynamics`: backward Euler, solved by projected Gauss-Seidel. The viscous part takes the mean
    /// of the speeds at both ends of the step, which is of second order.
    pub fn torque(
        &self,
        dynamics: &Dynamics,
        position: &Joints,
        velocity: &Joints,
        timestep_s: f64,
    ) -> Joints {
        let capacity = self.friction_nm(velocity);
        let half = Matrix6::from_diagonal(&(self.viscous_nms_per_rad * (0.5 * timestep_s)));
        let mass = dynamics.mass_matrix(position);
        let Some(inverse) = (mass + half).try_inverse() else {
            // Not a number: the run loop sees it.
            return Joints::repeat(f64::NAN);
        };
        let bias = dynamics.inverse_dynamics(position, velocity, &Joints::zeros());
        // Speed at the step's end, without dry friction at first.
        let mut speed = inverse * ((mass - half) * velocity - bias * timestep_s);
        let mobility = inverse * timestep_s;
        let mut friction = Joints::zeros();
        for _ in 0..SWEEPS {
            let mut largest_nm = 0.0_f64;
            for i in 0..JOINT_COUNT {
                let wanted = friction[i] - speed[i] / mobility[(i, i)];
                let change = wanted.clamp(-capacity[i], capacity[i]) - friction[i];
                friction[i] += change;
                speed += mobility.column(i) * change;
                largest_nm = largest_nm.max(change.abs());
            }
            if largest_nm < SOLVED_NM {
                break;
            }
        }
        friction - self.viscous_nms_per_rad.component_mul(&(velocity + speed)) * 0.5
    }
}

/// The arm with the load of the published stops at its flange, level, in standard gravity: manufacturers stop their
/// arms on Earth.
///
/// The mass and the inertia of a tool that is part of the last body stay: a needle guide weighs little
/// beside the load.
pub fn loaded(dynamics: &Dynamics, load_kg: f64) -> Dynamics {
    let mut loaded = *dynamics;
    let load = Body {
        mass_kg: load_kg,
        com_m: dynamics.chain.wrist_3_from_flange.translation.vector,
        inertia_kgm2: Matrix3::zeros(),
    };
    loaded.bodies[JOINT_COUNT - 1] = loaded.bodies[JOINT_COUNT - 1].combined_with(&load);
    loaded.gravity_m_s2 = -Vector3::z() * STANDARD_GRAVITY_M_S2;
    loaded
}

/// Stretched out level: all joints at zero.
pub fn stretched() -> Joints {
    Joints::zeros()
}

/// The `x` with `(x - ln(1 + x)) / (x ln(1 + x)) = ratio`; 0 for a half and more.
fn viscous_share(ratio: f64) -> f64 {
    let of = |x: f64| (x - libm::log1p(x)) / (x * libm::log1p(x));
    if ratio >= 0.5 {
        return 0.0;
    }
    let (mut low, mut high) = (1e-6, 1e6);
    for _ in 0..200 {
        let middle = f64::sqrt(low * high);
        // Falls from a half.
        if of(middle) > ratio {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dynamics() -> Dynamics {
        crate::test_cell::ur3(Vec::new()).dynamics()
    }

    fn figures() -> BrakeFigures {
        crate::test_cell::brake_figures("ur3")
    }

    #[test]
    fn a_ratio_of_distance_gives_its_share() {
        for x in [0.1_f64, 1.0, 5.2, 40.0] {
            let ratio = (x - libm::log1p(x)) / (x * libm::log1p(x));
            assert!((viscous_share(ratio) / x - 1.0).abs() < 1e-7, "{x}");
        }
        assert!(viscous_share(0.51).abs() < 1e-12);
    }

    /// Torques of the brakes make every joint stand or slip, and are never more than the brakes have.
    #[test]
    fn joints_stand_or_slip_against_the_whole_brake() {
        const SOLVED_RAD_S: f64 = 1e-9;
        const SOLVED_NM_SEEN: f64 = 1e-8;
        let dynamics = dynamics();
        let brakes = Brakes::of_figures(&figures(), &dynamics);
        let mut random = crate::test_cell::Random(3);
        let mut slipping = 0;
        for case in 0..500 {
            let q = random.joints(2.0);
            let v = random.joints(if case % 2 == 0 { 3.0 } else { 0.05 });
            let h = 1e-3;
            let torque = brakes.torque(&dynamics, &q, &v, h);
            let bias = dynamics.inverse_dynamics(&q, &v, &Joints::zeros());
            let inverse = dynamics.mass_matrix(&q).try_inverse().unwrap();
            let after = v + inverse * (torque - bias) * h;
            let capacity = brakes.friction_nm(&v);
            let friction = torque + brakes.viscous_nms_per_rad.component_mul(&(v + after)) * 0.5;
            for i in 0..JOINT_COUNT {
                assert!(friction[i].abs() < capacity[i] + SOLVED_NM_SEEN);
                if after[i].abs() > SOLVED_RAD_S {
                    slipping += 1;
                    assert!((friction[i].abs() - capacity[i]).abs() < SOLVED_NM_SEEN);
                    assert!(friction[i] * after[i] < 0.0, "{case} {i}: pushes");
                }
            }
        }
        assert!(slipping > 500, "{slipping}");
    }

    #[test]
    fn published_figures_give_these_brakes() {
        let brakes = Brakes::of_figures(&figures(), &dynamics());
        println!("{brakes:?}");
        // None is stronger at full speed than thrice the joint's torque limit, and all of them hold
        // the stretched arm with its load.
        let full = brakes.coulomb_nm + brakes.viscous_nms_per_rad * figures().speed_rad_s;
        let gravity = loaded(&dynamics(), figures().load_kg)
            .gravity_torque(&stretched())
            .abs();
        for (i, limit) in [56.0, 56.0, 28.0, 12.0, 12.0, 12.0].into_iter().enumerate() {
            assert!(full[i] < 3.0 * limit, "{i}: {}", full[i]);
            assert!(brakes.coulomb_nm[i] > gravity[i], "{i}");
        }
    }
}
