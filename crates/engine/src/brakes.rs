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
//! UR3 (CB3) user manual 3.10, appendix A.1 gives stopping distance and time of stops of category 0 at
//! full extension, 183 deg/s and 3 kg: base 0.18 rad in 159 ms, shoulder 0.20 rad in 154 ms, elbow
//! 0.15 rad in 92 ms. Under a constant torque the distance would be half of speed times time: 0.254,
//! 0.246 and 0.147 rad. That is the elbow's, rounded; base and shoulder brake harder while they are
//! fast. Of one joint with the inertia `M`, from the speed `w`,
//!
//! ```text
//! M dw/dt = -(c + b w)     x = b w / c
//! time     = (M w / c)   ln(1 + x) / x
//! distance = (M w^2 / c) (x - ln(1 + x)) / x^2
//! ```
//!
//! so `distance / (w time)` gives `x` and the time then `c`. `M` and gravity's torque are those of the
//! dynamics that is given, stretched out level, with 3 kg at the flange. The manual does not say which
//! way the joint moves; *assumed* is the worse one, downwards, so the constant torque is `c` plus
//! gravity's half way down. There are no figures for the wrists; *assumed* is the elbow's brake by the ratio of the
//! torque limits.

use nalgebra::{Matrix3, Matrix6, Vector3};
use needlebench_kinematics::{Body, Dynamics, JOINT_COUNT, Joints};

/// Speed of the published stops, rad/s: 183 deg/s.
pub const PUBLISHED_SPEED_RAD_S: f64 = 183.0 * std::f64::consts::PI / 180.0;

/// Load of the published stops, kg.
pub const PUBLISHED_LOAD_KG: f64 = 3.0;

/// A published stop of category 0 at full extension.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PublishedStop {
    /// Angle travelled, rad.
    pub distance_rad: f64,
    /// Time taken, s.
    pub time_s: f64,
}

/// Stops of base, shoulder and elbow: UR3 (CB3) user manual 3.10, appendix A.1.
pub const PUBLISHED_STOPS: [PublishedStop; 3] = [
    PublishedStop {
        distance_rad: 0.18,
        time_s: 0.159,
    },
    PublishedStop {
        distance_rad: 0.20,
        time_s: 0.154,
    },
    PublishedStop {
        distance_rad: 0.15,
        time_s: 0.092,
    },
];

/// Elbow's torque limit over those of wrists 1 to 3: 28 N m, 12 N m.
const WRIST_SHARE: f64 = 12.0 / 28.0;

/// Torque of a brake that stands over that of one that slips; at least 1.6 is needed, see above.
pub const STANDING_RATIO: f64 = 2.0;

/// Speed below which a joint counts as standing, rad/s: a few millimetres a second at the end of the arm,
/// and ten times what a step of 1 ms leaves of a joint that is held while others stop from full speed.
const STANDING_RAD_S: f64 = 1e-2;

/// Sweeps over the joints per step. The worst of 10 000 random states was solved to 1e-9 N m in 60.
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
}

impl Brakes {
    /// The brakes of a UR3 with this dynamics, whose tool is replaced by the load of the published
    /// stops.
    pub fn of_ur3(dynamics: &Dynamics) -> Self {
        let loaded = loaded(dynamics);
        let stretched = stretched();
        let mass = loaded.mass_matrix(&stretched);
        let level = loaded.gravity_torque(&stretched);
        let mut brakes = Self {
            coulomb_nm: Joints::zeros(),
            viscous_nms_per_rad: Joints::zeros(),
        };
        for (joint, stop) in PUBLISHED_STOPS.iter().enumerate() {
            let speed = PUBLISHED_SPEED_RAD_S;
            let x = viscous_share(stop.distance_rad / (speed * stop.time_s));
            let slowing = if x > 0.0 { x.ln_1p() / x } else { 1.0 };
            let net_nm = mass[(joint, joint)] * speed / stop.time_s * slowing;
            brakes.viscous_nms_per_rad[joint] = x * net_nm / speed;
            // Half way down: it falls off by 4 % over the stop of the shoulder.
            let mut half_way = stretched;
            half_way[joint] -= 0.5 * stop.distance_rad * level[joint].signum();
            let gravity_nm = loaded.gravity_torque(&half_way)[joint].abs();
            brakes.coulomb_nm[joint] = net_nm + gravity_nm;
        }
        for joint in PUBLISHED_STOPS.len()..JOINT_COUNT {
            brakes.coulomb_nm[joint] = WRIST_SHARE * brakes.coulomb_nm[2];
            brakes.viscous_nms_per_rad[joint] = WRIST_SHARE * brakes.viscous_nms_per_rad[2];
        }
        brakes
    }

    /// Largest torque at these speeds but for the viscous part, N m.
    fn friction_nm(&self, velocity: &Joints) -> Joints {
        self.coulomb_nm.zip_map(velocity, |coulomb, speed| {
            if speed.abs() < STANDING_RAD_S {
                STANDING_RATIO * coulomb
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

/// The arm with the load of the published stops at its flange, and no tool.
///
/// The mass and the inertia of a tool that is part of the last body stay: a fifth of a kilogram, which
/// is a hundredth of the load's moment.
pub fn loaded(dynamics: &Dynamics) -> Dynamics {
    let mut loaded = *dynamics;
    let load = Body {
        mass_kg: PUBLISHED_LOAD_KG,
        com_m: dynamics.chain.wrist_3_from_flange.translation.vector,
        inertia_kgm2: Matrix3::zeros(),
    };
    loaded.bodies[JOINT_COUNT - 1] = loaded.bodies[JOINT_COUNT - 1].combined_with(&load);
    loaded.gravity_m_s2 = -Vector3::z() * dynamics.gravity_m_s2.norm();
    loaded
}

/// Stretched out level: all joints at zero.
pub fn stretched() -> Joints {
    Joints::zeros()
}

/// The `x` with `(x - ln(1 + x)) / (x ln(1 + x)) = ratio`; 0 for a half and more.
fn viscous_share(ratio: f64) -> f64 {
    let of = |x: f64| (x - x.ln_1p()) / (x * x.ln_1p());
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

    #[test]
    fn a_ratio_of_distance_gives_its_share() {
        for x in [0.1_f64, 1.0, 5.2, 40.0] {
            let ratio = (x - x.ln_1p()) / (x * x.ln_1p());
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
        let brakes = Brakes::of_ur3(&dynamics);
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
        let brakes = Brakes::of_ur3(&dynamics());
        println!("{brakes:?}");
        // None is stronger at full speed than thrice the joint's torque limit, and all of them hold
        // the stretched arm with its load.
        let full = brakes.coulomb_nm + brakes.viscous_nms_per_rad * PUBLISHED_SPEED_RAD_S;
        let gravity = loaded(&dynamics()).gravity_torque(&stretched()).abs();
        for (i, limit) in [56.0, 56.0, 28.0, 12.0, 12.0, 12.0].into_iter().enumerate() {
            assert!(full[i] < 3.0 * limit, "{i}: {}", full[i]);
            assert!(brakes.coulomb_nm[i] > gravity[i], "{i}");
        }
    }
}
