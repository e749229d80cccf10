//! Gauss-Newton on the pose error (equations 39 to 47, corrected).

use nalgebra::{Matrix6, Vector6};

use crate::{Chain, Joints, Pose, rotation_vector};

/// Limits and tolerances of [`gauss_newton`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GaussNewtonOptions {
    /// Steps after which it gives up.
    pub max_iterations: u32,
    /// Residual at which it is content: m and rad alike.
    pub tolerance: f64,
    /// Singular values below this fraction of the largest count as zero (lengths over 0.5 m), so
    /// that the step is the shortest one instead of a huge one.
    pub rank_tolerance: f64,
}

impl Default for GaussNewtonOptions {
    fn default() -> Self {
        Self {
            max_iterations: 50,
            tolerance: 1e-13,
            rank_tolerance: 1e-9,
        }
    }
}

/// Where [`gauss_newton`] ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GaussNewtonResult {
    /// Joint positions, rad, as near to the guess as the steps took them (not wrapped).
    pub joints: Joints,
    /// Steps taken.
    pub iterations: u32,
    /// Distance to the wanted position, m.
    pub residual_m: f64,
    /// Angle to the wanted orientation, rad.
    pub residual_rad: f64,
    /// Both residuals are within the tolerance.
    pub converged: bool,
}

/// Position and orientation error of a pose, `[p_d - p; vee(log(R_d R^T))]`, in `base_link`.
///
/// The angular part is the log map where the paper prints `Rdot R^T` (equation 45).
pub(crate) fn pose_error(target: &Pose, actual: &Pose) -> Vector6<f64> {
    let linear = target.translation.vector - actual.translation.vector;
    let angular = rotation_vector(&(target.rotation * actual.rotation.inverse()));
    Vector6::new(
        linear.x, linear.y, linear.z, angular.x, angular.y, angular.z,
    )
}

/// Joint positions that bring the flange to `base_link_from_flange`, from a guess.
///
/// Undamped; converges quadratically from within about 0.1 rad and ends in any of the eight
/// configurations from farther off. The step is rank-aware: at a singularity it is the
/// pseudo-inverse's. When the residual stops falling at rounding level the best point is kept.
pub fn gauss_newton(
    chain: &Chain,
    base_link_from_flange: &Pose,
    guess: &Joints,
    options: &GaussNewtonOptions,
) -> GaussNewtonResult {
    let evaluate = |joints: Joints, iterations: u32| {
        let error = pose_error(base_link_from_flange, &chain.base_link_from_flange(&joints));
        let residual_m = error.fixed_rows::<3>(0).norm();
        let residual_rad = error.fixed_rows::<3>(3).norm();
        let converged = residual_m.max(residual_rad) <= options.tolerance;
        (
            error,
            GaussNewtonResult {
                joints,
                iterations,
                residual_m,
                residual_rad,
                converged,
            },
        )
    };
    let (mut error, mut best) = evaluate(*guess, 0);
    let mut current = best;
    for iteration in 1..=options.max_iterations {
        if current.converged {
            return current;
        }
        let step = rank_aware_step(&chain.jacobian(&current.joints), &error, options);
        let (next_error, next) = evaluate(current.joints + step, iteration);
        // Below this, steps only stir rounding errors.
        let settled = best.residual_m.max(best.residual_rad) < 1e-11
            && next.residual_m.max(next.residual_rad) >= best.residual_m.max(best.residual_rad);
        if next.residual_m.max(next.residual_rad) < best.residual_m.max(best.residual_rad) {
            best = next;
        }
        if settled {
            break;
        }
        (error, current) = (next_error, next);
    }
    // Rounding may keep a residual a little above a tolerance of a few ulp.
    best.converged |= best.residual_m.max(best.residual_rad) <= options.tolerance.max(1e-12);
    best
}

fn rank_aware_step(
    jacobian: &Matrix6<f64>,
    error: &Vector6<f64>,
    options: &GaussNewtonOptions,
) -> Joints {
    // Lengths over 0.5 m: comparable with angles, so that one rank tolerance serves both.
    let mut scaled = *jacobian;
    let mut target = *error;
    scaled.fixed_rows_mut::<3>(0).scale_mut(2.0);
    target.fixed_rows_mut::<3>(0).scale_mut(2.0);
    let svd = scaled.svd(true, true);
    let cutoff = svd.singular_values.max() * options.rank_tolerance;
    svd.solve(&target, cutoff)
        .unwrap_or_else(|_| Joints::zeros())
}
