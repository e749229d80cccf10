//! Equations 39 to 47 as functions, as printed and as corrected, and the numerical method that they make up: as
//! printed, corrected, and damped.

use nalgebra::{Matrix3, Matrix4, Matrix6, Rotation3, UnitQuaternion, Vector3, Vector6};
use needlebench_kinematics::ik::wrap_angle;
use needlebench_kinematics::rotation_vector;

use super::dh::{Arm, origin, rotation};

/// A function that gives a Jacobian from frames 0 to 6: m and 1 per rad.
pub type Jacobian = fn(&[Matrix4<f64>; 7]) -> Matrix6<f64>;
/// A function that gives the rotation vector from an actual to a target orientation, rad.
pub type Turn = fn(&Matrix3<f64>, &Matrix3<f64>) -> Vector3<f64>;

/// Six numbers from their halves.
pub fn stacked(linear: Vector3<f64>, angular: Vector3<f64>) -> Vector6<f64> {
    Vector6::from_fn(|i, _| if i < 3 { linear[i] } else { angular[i - 3] })
}

/// Equation 39 with the axes `z_(first) ... z_(first + 5)` in its angular part.
fn jacobian_with_axes_from(frames: &[Matrix4<f64>; 7], first: usize) -> Matrix6<f64> {
    let z_axis = |frame: &Matrix4<f64>| frame.fixed_view::<3, 1>(0, 2).into_owned();
    let flange = origin(&frames[6]);
    Matrix6::from_columns(&std::array::from_fn::<_, 6, _>(|i| {
        // The partial derivative of the position by a joint turning about z_(i).
        let linear = z_axis(&frames[i]).cross(&(flange - origin(&frames[i])));
        stacked(linear, z_axis(&frames[i + first]))
    }))
}

/// Equation 39 as printed: `J_w = [z_1 ... z_6]`.
pub fn jacobian_printed(frames: &[Matrix4<f64>; 7]) -> Matrix6<f64> {
    jacobian_with_axes_from(frames, 1)
}

/// Equation 39 corrected: `J_w = [z_0 ... z_5]`.
pub fn jacobian(frames: &[Matrix4<f64>; 7]) -> Matrix6<f64> {
    jacobian_with_axes_from(frames, 0)
}

/// The three entries of a matrix in which equation 46 has plus signs.
pub fn vee(s: &Matrix3<f64>) -> Vector3<f64> {
    Vector3::new(s[(2, 1)], s[(0, 2)], s[(1, 0)])
}

/// Equation 45 as printed, with the derivative of the rotation taken as the difference
/// `R_d - R_0`.
pub fn turn_printed(wanted: &Matrix3<f64>, actual: &Matrix3<f64>) -> Vector3<f64> {
    vee(&((wanted - actual) * actual.transpose()))
}

/// Equation 45 corrected: `vee(log(R_d R_0^T))`, in the base frame, rad.
pub fn turn(wanted: &Matrix3<f64>, actual: &Matrix3<f64>) -> Vector3<f64> {
    let relative = Rotation3::from_matrix_unchecked(wanted * actual.transpose());
    rotation_vector(&UnitQuaternion::from_rotation_matrix(&relative))
}

/// Right side of equation 47: `[P_d - P_0; omega]`, m and rad.
pub fn pose_difference(wanted: &Matrix4<f64>, actual: &Matrix4<f64>, turn: Turn) -> Vector6<f64> {
    let angular = turn(&rotation(wanted), &rotation(actual));
    stacked(origin(wanted) - origin(actual), angular)
}

/// Singular values below this share of the largest count as zero.
const RANK: f64 = 1e-9;

/// `J^+ dx`: the inverse where the matrix has full rank, as the paper has it, else the
/// pseudo-inverse by singular values.
pub fn pseudo_inverse_step(jacobian: &Matrix6<f64>, dx: &Vector6<f64>) -> Vector6<f64> {
    let lu = jacobian.lu();
    let pivots = lu.u().diagonal().abs();
    if pivots.min() > RANK * pivots.max()
        && let Some(step) = lu.solve(dx)
    {
        return step;
    }
    let svd = jacobian.svd(true, true);
    let cutoff = RANK * svd.singular_values.max();
    svd.solve(dx, cutoff).unwrap_or_else(|_| Vector6::zeros())
}

/// `J^T (J J^T)^-1 dx`, as printed; `None` where the product has no inverse.
pub fn printed_pseudo_inverse_step(
    jacobian: &Matrix6<f64>,
    dx: &Vector6<f64>,
) -> Option<Vector6<f64>> {
    let inverse = (jacobian * jacobian.transpose()).try_inverse()?;
    Some(jacobian.transpose() * inverse * dx)
}

/// Final state of a converged iteration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ended {
    /// Joint positions, rad, wrapped.
    pub joints: [f64; 6],
    pub steps: u32,
}

/// Position (m) and orientation (rad) error at which an iteration has converged.
pub const CONTENT: f64 = 1e-9;
/// Step limit of an iteration. The undamped one may wander before it converges: from arbitrary guesses
/// it needs more than 50 in one of twelve cases that converge, more than these in one of 200.
const STEPS: u32 = 200;

fn is_content(error: &Vector6<f64>, content: f64) -> bool {
    let [linear, angular] = [0, 3].map(|from| error.fixed_rows::<3>(from).norm());
    linear.max(angular) <= content
}

fn plus(joints: &[f64; 6], step: &Vector6<f64>) -> [f64; 6] {
    std::array::from_fn(|i| wrap_angle(joints[i] + step[i]))
}

/// Equation 47 iterated with the angles of the log map, down to `content`; calls `visit` with every joint
/// vector.
pub fn gauss_newton(
    arm: &Arm<f64>,
    wanted: &Matrix4<f64>,
    guess: &[f64; 6],
    jacobian: Jacobian,
    content: f64,
    mut visit: impl FnMut(&[f64; 6]),
) -> Option<Ended> {
    let mut joints = *guess;
    for steps in 0..=STEPS {
        visit(&joints);
        let frames = arm.frames(&joints);
        let error = pose_difference(wanted, &frames[6], turn);
        if is_content(&error, content) {
            return Some(Ended { joints, steps });
        }
        let step = pseudo_inverse_step(&jacobian(&frames), &error);
        if !step.iter().all(|each| each.is_finite()) {
            break;
        }
        joints = plus(&joints, &step);
    }
    None
}

/// Length equivalent to a radian, m: about half of the arm's reach.
const LENGTH_M: f64 = 0.25;

/// Levenberg's and Marquardt's damping on the same Jacobian and the same error, with Nielsen's
/// rule for the damping (*Damping parameter in Marquardt's method*, 1999).
pub fn levenberg_marquardt(
    arm: &Arm<f64>,
    wanted: &Matrix4<f64>,
    guess: &[f64; 6],
) -> Option<Ended> {
    let scale = |error: &Vector6<f64>| {
        let mut scaled = *error;
        scaled.fixed_rows_mut::<3>(0).unscale_mut(LENGTH_M);
        scaled
    };
    let at = |joints: [f64; 6]| {
        let frames = arm.frames(&joints);
        let error = pose_difference(wanted, &frames[6], turn);
        (joints, frames, error)
    };
    let (mut joints, mut frames, mut error) = at(*guess);
    let (mut damping, mut growth) = (1e-2, 2.0);
    for steps in 0..=STEPS {
        if is_content(&error, CONTENT) {
            return Some(Ended { joints, steps });
        }
        let mut matrix = jacobian(&frames);
        matrix.fixed_rows_mut::<3>(0).unscale_mut(LENGTH_M);
        let scaled = scale(&error);
        let gradient = matrix.transpose() * scaled;
        let normal = matrix.transpose() * matrix + Matrix6::identity() * damping;
        let step = normal.cholesky()?.solve(&gradient);
        let next = at(plus(&joints, &step));
        let gained = scaled.norm_squared() - scale(&next.2).norm_squared();
        let promised = step.dot(&(step * damping + gradient));
        if gained > 0.0 && promised > 0.0 {
            let ratio = gained / promised;
            damping *= (1.0_f64 / 3.0).max(1.0 - (2.0 * ratio - 1.0).powi(3));
            growth = 2.0;
            (joints, frames, error) = next;
        } else {
            damping *= growth;
            growth *= 2.0;
        }
    }
    None
}
