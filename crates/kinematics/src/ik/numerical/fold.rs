//! The two solutions that meet at a singularity near a posture.
//!
//! Along the direction `v` that moves the flange least, by `sigma u` per radian, the flange moves by
//! `sigma t + kappa t^2 / 2` along `u`; across it, a step of Gauss and Newton of rank five serves.
//! The quadratic equation has both solutions, however near to one another, where Newton's method
//! from one side crawls.

use nalgebra::{Matrix6, Vector6};

use super::descent::{Factor, curvature, gradient, normal_matrix};
use super::kernel::{Kernel, State, Target};
use crate::Joints;

/// Rounds towards the place where the two meet.
const ROUNDS: u32 = 7;

/// Where both steps are shorter, the quadratic equation is right to their squares, rad.
const SETTLED_RAD: f64 = 0.02;
const CLOSELY_SETTLED_RAD: f64 = 1e-5;

/// The two meet, if at all, within this of the start, rad.
const FARTHEST_RAD: f64 = 0.5;

/// What keeps a singular matrix factorable.
const DAMPING: f64 = 1e-13;

/// Where the two would be this near to one another were the equation's sign the other one, rad^2,
/// rounding may be all, and the place where they meet is tried.
const JUST_MISSES: f64 = 1e-8;

/// Starts near the two solutions, or near the one where they meet; none if they do not.
#[inline(always)]
pub(super) fn fold(
    kernel: &Kernel,
    target: &Target,
    start: &Joints,
    rad_per_m: f64,
) -> Option<[Joints; 2]> {
    let weight = rad_per_m * rad_per_m;
    let mut q = *start;
    for _ in 0..ROUNDS {
        let state = kernel.state(&q);
        let error = state.error(target);
        let flat = Flat::new(&state, weight)?;
        let across = flat.across(&error);
        let meet = -flat.sigma / flat.kappa;
        if meet.is_nan() || meet.abs() > FARTHEST_RAD {
            return None;
        }
        let off = across.norm().max(meet.abs());
        let root_squared = flat.sigma * flat.sigma + 2.0 * flat.kappa * flat.along(&error);
        // Where the two nearly coincide, the equation has to be right to more digits.
        let apart = root_squared > (off * flat.kappa).powi(2);
        if off < SETTLED_RAD && (apart || off < CLOSELY_SETTLED_RAD) {
            if root_squared < -JUST_MISSES * flat.kappa * flat.kappa {
                return None;
            }
            let root = root_squared.max(0.0).sqrt();
            let back = flat.across(&(flat.bend * -0.5));
            return Some([1.0, -1.0].map(|sign| {
                let t = (-flat.sigma + sign * root) / flat.kappa;
                q + across + flat.v * t + back * (t * t)
            }));
        }
        q += across + flat.v * meet;
    }
    None
}

/// The two directions of the joints that move the flange least, rad.
#[inline(always)]
pub(super) fn flattest_plane(kernel: &Kernel, q: &Joints, rad_per_m: f64) -> Option<[Joints; 2]> {
    let mut matrix = normal_matrix(&kernel.state(q).jacobian, rad_per_m * rad_per_m);
    let first = flattest(&matrix)?;
    matrix += first * first.transpose();
    Some([first, flattest(&matrix)?])
}

/// The flattest direction of a posture.
struct Flat {
    jacobian: Matrix6<f64>,
    weight: f64,
    /// Of the joints, and of the flange with lengths weighted by the root of the weight.
    v: Joints,
    u: Vector6<f64>,
    sigma: f64,
    kappa: f64,
    /// Second derivative of the flange's pose along `v`.
    bend: Vector6<f64>,
    steep: Factor,
}

impl Flat {
    #[inline(always)]
    fn new(state: &State, weight: f64) -> Option<Self> {
        let jacobian = state.jacobian;
        let root = weight.sqrt();
        let scale = Vector6::new(root, root, root, 1.0, 1.0, 1.0);
        let mut matrix = normal_matrix(&jacobian, weight);
        let v = flattest(&matrix)?;
        let left = (jacobian * jacobian.transpose()).component_mul(&(scale * scale.transpose()));
        let u = flattest(&left)?;
        let bend = curvature(&jacobian, &v);
        let along = u.component_mul(&scale);
        matrix += v * v.transpose();
        Some(Self {
            jacobian,
            weight,
            v,
            u,
            sigma: along.dot(&(jacobian * v)),
            kappa: along.dot(&bend),
            bend,
            steep: Factor::new(&matrix, 0.0),
        })
    }

    /// The step that takes the error off but for the flattest direction.
    #[inline(always)]
    fn across(&self, error: &Vector6<f64>) -> Joints {
        let gradient = gradient(&self.jacobian, error, self.weight);
        let step = self.steep.solve(&gradient);
        step - self.v * step.dot(&self.v)
    }

    /// The error in the flattest direction.
    fn along(&self, error: &Vector6<f64>) -> f64 {
        let root = self.weight.sqrt();
        (0..6)
            .map(|i| self.u[i] * error[i] * if i < 3 { root } else { 1.0 })
            .sum()
    }
}

/// Unit vector of the least eigenvalue, by inverse iteration.
#[inline(always)]
fn flattest(matrix: &Matrix6<f64>) -> Option<Joints> {
    let factor = Factor::new(matrix, DAMPING);
    let mut vector = Joints::new(1.0, -0.9, 0.8, 1.1, -0.7, 1.2);
    for _ in 0..2 {
        vector = factor.solve(&vector);
        let length = vector.norm();
        // Written so that NaN fails too.
        if !(length > 0.0 && length.is_finite()) {
            return None;
        }
        vector /= length;
    }
    Some(vector)
}
