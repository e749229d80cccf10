//! The numerical method, equation by equation: as printed, mended, and damped.

use nalgebra::Vector6;
use needlebench_kinematics::ik::wrap_angle;

use super::dh::Arm;
use super::equations::differential::{
    jacobian, jacobian_printed, pose_difference, pseudo_inverse_step, turn,
};

/// A pose to be reached.
pub type Wanted = nalgebra::Matrix4<f64>;

/// Where an iteration ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ended {
    /// Joint positions, rad, wrapped.
    pub joints: [f64; 6],
    pub iterations: u32,
    pub converged: bool,
}

/// Position (m) and orientation (rad) error at which an iteration is content.
pub const CONTENT: f64 = 1e-9;
/// Steps after which an iteration gives up. The undamped one wanders before it converges: from anywhere
/// it needs more than [`EARLY_STEPS`] in one of twelve cases that converge, more than these in one of 200.
pub const STEPS: u32 = 200;
/// Steps that are told apart: who gives up after these finds the undamped method worse than it is.
pub const EARLY_STEPS: u32 = 50;

fn is_content(error: &Vector6<f64>, content: f64) -> bool {
    error
        .fixed_rows::<3>(0)
        .norm()
        .max(error.fixed_rows::<3>(3).norm())
        <= content
}

fn plus(joints: &[f64; 6], step: &Vector6<f64>) -> [f64; 6] {
    std::array::from_fn(|i| wrap_angle(joints[i] + step[i]))
}

/// Equation 47 repeated, with the angles of the log map.
///
/// `as_printed` takes the Jacobian of equation 39 as it stands.
pub fn gauss_newton(arm: &Arm<f64>, wanted: &Wanted, guess: &[f64; 6], as_printed: bool) -> Ended {
    trace(arm, wanted, guess, as_printed, CONTENT, |_| {})
}

/// As [`gauss_newton`] down to `content`, calling `visit` with every joint vector on the way.
pub fn trace(
    arm: &Arm<f64>,
    wanted: &Wanted,
    guess: &[f64; 6],
    as_printed: bool,
    content: f64,
    mut visit: impl FnMut(&[f64; 6]),
) -> Ended {
    let mut joints = *guess;
    for iterations in 0..=STEPS {
        visit(&joints);
        let frames = arm.frames(&joints);
        let error = pose_difference(wanted, &frames[6], turn);
        if is_content(&error, content) {
            return Ended {
                joints,
                iterations,
                converged: true,
            };
        }
        let matrix = if as_printed {
            jacobian_printed(&frames)
        } else {
            jacobian(&frames)
        };
        let step = pseudo_inverse_step(&matrix, &error);
        if !step.iter().all(|each| each.is_finite()) {
            break;
        }
        joints = plus(&joints, &step);
    }
    Ended {
        joints,
        iterations: STEPS,
        converged: false,
    }
}

/// Length that counts as much as a radian, m: half of the arm's reach, about.
const LENGTH_M: f64 = 0.25;

/// Levenberg's and Marquardt's damping on the same Jacobian and the same error, with Nielsen's
/// rule for the damping (*Damping parameter in Marquardt's method*, 1999).
pub fn levenberg_marquardt(arm: &Arm<f64>, wanted: &Wanted, guess: &[f64; 6]) -> Ended {
    let scale = |error: &Vector6<f64>| {
        let mut scaled = *error;
        scaled.fixed_rows_mut::<3>(0).unscale_mut(LENGTH_M);
        scaled
    };
    let mut joints = *guess;
    let mut frames = arm.frames(&joints);
    let mut error = pose_difference(wanted, &frames[6], turn);
    let (mut damping, mut growth) = (1e-2, 2.0);
    for iterations in 0..=STEPS {
        if is_content(&error, CONTENT) {
            return Ended {
                joints,
                iterations,
                converged: true,
            };
        }
        let mut matrix = jacobian(&frames);
        matrix.fixed_rows_mut::<3>(0).unscale_mut(LENGTH_M);
        let scaled = scale(&error);
        let gradient = matrix.transpose() * scaled;
        let normal = matrix.transpose() * matrix + nalgebra::Matrix6::identity() * damping;
        let Some(cholesky) = normal.cholesky() else {
            break;
        };
        let step = cholesky.solve(&gradient);
        let next = plus(&joints, &step);
        let next_frames = arm.frames(&next);
        let next_error = pose_difference(wanted, &next_frames[6], turn);
        let gained = scaled.norm_squared() - scale(&next_error).norm_squared();
        let promised = step.dot(&(step * damping + gradient));
        if gained > 0.0 && promised > 0.0 {
            let ratio = gained / promised;
            damping *= (1.0_f64 / 3.0).max(1.0 - (2.0 * ratio - 1.0).powi(3));
            growth = 2.0;
            (joints, frames, error) = (next, next_frames, next_error);
        } else {
            damping *= growth;
            growth *= 2.0;
        }
    }
    Ended {
        joints,
        iterations: STEPS,
        converged: false,
    }
}
