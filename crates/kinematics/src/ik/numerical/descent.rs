//! Damped descent to a pose from one start.
//!
//! Levenberg and Marquardt's step, `(J^T J + lambda I) d = J^T e`, with `lambda` in proportion to
//! the squared error, which keeps Newton's quadratic convergence where the solution is isolated
//! and stays stable where it is not (Yamashita and Fukushima 2001). Two corrections make singular
//! solutions as quick: the geodesic acceleration of Transtrum and Sethna (2012), from the exact
//! second derivative along the step; and, where steps shrink by a steady factor as they do towards
//! a double root, the sum of the geometric series instead of its first term.

use nalgebra::{Matrix6, Vector3, Vector6};

use super::kernel::{Kernel, State, Target};
use crate::Joints;
use crate::chain::stacked;

/// How a descent is steered.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Steering {
    /// Rad that a metre counts as.
    pub rad_per_m: f64,
    /// Longest step, rad.
    pub longest_step_rad: f64,
    /// Steps in which the squared error has to fall to [`MILESTONE`] of itself, or the descent is
    /// given up, while far from the pose.
    pub patience_far: u32,
    /// Steps at most.
    pub steps: u32,
    /// Residual at which the pose is reached, m and rad.
    pub tolerance: f64,
}

/// Where a descent ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct End {
    pub q: Joints,
    pub residual_m: f64,
    pub residual_rad: f64,
    pub steps: u32,
    pub reached: bool,
}

impl End {
    pub(super) fn residual(&self) -> f64 {
        self.residual_m.max(self.residual_rad)
    }
}

/// Damping relative to the squared error, and its factor after a step that is refused.
const DAMPING: f64 = 0.04;
const MORE_DAMPING: f64 = 6.0;

/// Squared error below which the second-order correction pays, and below which a step that does
/// not reduce the error may still be taken, as in the curved valleys next to a singularity.
const NEAR: f64 = 0.1;

/// Such a step is as good as its linearisation if the new squared error is below this share of its
/// length to the fourth: what the curvature of the pose lets expect.
const UPHILL: f64 = 0.2;

/// Share to which the squared error has to fall within the patience.
const MILESTONE: f64 = 0.6;

/// Steps for that fall once the squared error is below [`CLOSE`].
const PATIENCE_CLOSE: u32 = 8;
const CLOSE: f64 = 5e-3;

/// A residual that further steps only stir, m and rad, squared.
const ROUNDING_SQUARED: f64 = 4e-30;

/// Share to which a step has to reduce the squared residual for another one to be worth it, once
/// the tolerance is met.
const POLISHING: f64 = 0.1;

/// Damping that is always there, so that a singular matrix can be factored.
const LEAST_DAMPING: f64 = 1e-16;

pub(super) struct Factor {
    lower: Matrix6<f64>,
    inverse: Vector6<f64>,
}

/// `J^T J` with lengths weighted.
#[inline(always)]
pub(super) fn normal_matrix(jacobian: &Matrix6<f64>, weight: f64) -> Matrix6<f64> {
    let (linear, angular) = (jacobian.fixed_rows::<3>(0), jacobian.fixed_rows::<3>(3));
    linear.tr_mul(&linear) * weight + angular.tr_mul(&angular)
}

/// `J^T e` with lengths weighted.
#[inline(always)]
pub(super) fn gradient(jacobian: &Matrix6<f64>, e: &Vector6<f64>, weight: f64) -> Joints {
    let (linear, angular) = (jacobian.fixed_rows::<3>(0), jacobian.fixed_rows::<3>(3));
    linear.tr_mul(&e.fixed_rows::<3>(0)) * weight + angular.tr_mul(&e.fixed_rows::<3>(3))
}

impl Factor {
    /// `L D L^T` of `matrix + damping I`.
    #[inline(always)]
    pub(super) fn new(matrix: &Matrix6<f64>, damping: f64) -> Self {
        let mut lower = *matrix;
        let mut inverse = Vector6::zeros();
        for k in 0..6 {
            inverse[k] = 1.0 / (lower[(k, k)] + damping);
            for i in k + 1..6 {
                let factor = lower[(i, k)] * inverse[k];
                for j in i..6 {
                    lower[(j, i)] -= factor * lower[(j, k)];
                }
            }
            for i in k + 1..6 {
                lower[(i, k)] *= inverse[k];
            }
        }
        Self { lower, inverse }
    }

    #[inline(always)]
    pub(super) fn solve(&self, right: &Joints) -> Joints {
        let mut y = *right;
        for k in 0..6 {
            for i in k + 1..6 {
                y[i] -= self.lower[(i, k)] * y[k];
            }
        }
        y.component_mul_assign(&self.inverse);
        for k in (0..6).rev() {
            for i in 0..k {
                y[i] -= self.lower[(k, i)] * y[k];
            }
        }
        y
    }
}

/// Second derivative of the pose along a joint direction: `d (dJ/dq d) d`.
#[inline(always)]
pub(super) fn curvature(jacobian: &Matrix6<f64>, d: &Joints) -> Vector6<f64> {
    let (mut linear, mut angular) = (Vector3::zeros(), Vector3::zeros());
    // Angular velocity of the link before the joint.
    let mut before = Vector3::zeros();
    for (column, &d) in jacobian.column_iter().zip(d) {
        let (lever, axis) = (column.fixed_rows::<3>(0), column.fixed_rows::<3>(3));
        linear += (before * 2.0 + axis * d).cross(&lever) * d;
        angular += before.cross(&axis) * d;
        before += axis * d;
    }
    stacked(&linear, &angular)
}

fn squares(e: &Vector6<f64>) -> (f64, f64) {
    let part = |row| e.fixed_rows::<3>(row).norm_squared();
    (part(0), part(3))
}

/// A posture and its error.
struct Point {
    q: Joints,
    state: State,
    error: Vector6<f64>,
    /// Weighted squared error, and the greater of its two parts unweighted.
    cost: f64,
    worst: f64,
}

impl Point {
    #[inline(always)]
    fn new(kernel: &Kernel, target: &Target, q: Joints, weight: f64) -> Self {
        let state = kernel.state(&q);
        let error = state.error(target);
        let (linear, angular) = squares(&error);
        Self {
            q,
            state,
            error,
            cost: weight * linear + angular,
            worst: linear.max(angular),
        }
    }

    /// `J^T J` and `J^T e`.
    #[inline(always)]
    fn normal_equations(&self, weight: f64) -> (Matrix6<f64>, Joints) {
        let jacobian = &self.state.jacobian;
        (
            normal_matrix(jacobian, weight),
            gradient(jacobian, &self.error, weight),
        )
    }

    fn end(&self, steps: u32, reached: bool) -> End {
        let (linear, angular) = squares(&self.error);
        End {
            q: self.q,
            residual_m: linear.sqrt(),
            residual_rad: angular.sqrt(),
            steps,
            reached,
        }
    }
}

/// Descends from `start`; within rounding of the pose once the tolerance is reached.
#[inline(always)]
pub(super) fn descend(
    kernel: &Kernel,
    target: &Target,
    start: &Joints,
    steering: &Steering,
) -> End {
    let weight = steering.rad_per_m * steering.rad_per_m;
    let content = steering.tolerance * steering.tolerance;
    let mut here = Point::new(kernel, target, *start, weight);
    let mut damping = DAMPING;
    // The last step, zero where it tells nothing of the next.
    let mut previous = Joints::zeros();
    let mut milestone = MILESTONE * here.cost;
    let mut since = 0;
    for count in 0..steering.steps {
        let reached = here.worst <= content;
        if reached && here.worst <= ROUNDING_SQUARED {
            return here.end(count, true);
        }
        let (matrix, right) = here.normal_equations(weight);
        let factor = Factor::new(&matrix, damping * here.cost + LEAST_DAMPING);
        let mut step = factor.solve(&right);
        let length_squared = step.norm_squared();
        let longest = steering.longest_step_rad;
        if length_squared > longest * longest {
            step *= longest / length_squared.sqrt();
        } else if here.cost < NEAR {
            let bend = curvature(&here.state.jacobian, &step) * -0.5;
            let correction = factor.solve(&gradient(&here.state.jacobian, &bend, weight));
            // Where the correction outgrows the step, the expansion says nothing.
            if correction.norm_squared() < length_squared {
                step += correction;
            }
        }
        let stretch = stretch(&step, &previous);
        if stretch > 1.0 {
            step *= stretch;
        }
        let step_squared = step.norm_squared();
        let next = Point::new(kernel, target, here.q + step, weight);
        if reached {
            let done = next.worst > POLISHING * here.worst;
            if next.worst < here.worst {
                here = next;
            }
            if done {
                return here.end(count + 1, true);
            }
            previous = if stretch > 1.0 { Joints::zeros() } else { step };
            continue;
        }
        let uphill = here.cost < NEAR && next.cost < UPHILL * step_squared * step_squared;
        if next.cost < here.cost || uphill {
            previous = if stretch > 1.0 { Joints::zeros() } else { step };
            here = next;
        } else {
            damping *= MORE_DAMPING;
            previous = Joints::zeros();
            if next.cost.is_nan() {
                return here.end(count + 1, false);
            }
        }
        since += 1;
        if here.cost < milestone {
            milestone = MILESTONE * here.cost;
            since = 0;
        }
        let patience = if here.cost > CLOSE {
            steering.patience_far
        } else {
            PATIENCE_CLOSE
        };
        if since >= patience && here.worst > content {
            return here.end(count + 1, false);
        }
    }
    here.end(steering.steps, here.worst <= content)
}

/// Factor that takes a step to the limit of the geometric series it belongs to; 1 if to none.
///
/// Towards a double root, plain steps shrink by 1/2 and those of second order by 3/8.
#[inline(always)]
fn stretch(step: &Joints, previous: &Joints) -> f64 {
    let (new, old) = (step.norm_squared(), previous.norm_squared());
    let along = step.dot(previous);
    // Products rather than quotients: without a previous step nothing is inside.
    let steady = new > 0.08 * old && new < 0.36 * old;
    if steady && along > 0.0 && along * along > 0.9 * new * old {
        1.0 / (1.0 - (new / old).sqrt())
    } else {
        1.0
    }
}

/// Descends to where the cost has no slope: the nearest posture in the sense of least squares.
pub(super) fn least_squares(
    kernel: &Kernel,
    target: &Target,
    start: &Joints,
    rad_per_m: f64,
    steps: u32,
) -> End {
    let weight = rad_per_m * rad_per_m;
    let mut here = Point::new(kernel, target, *start, weight);
    let mut damping = 1e-3;
    for count in 0..steps {
        let (matrix, right) = here.normal_equations(weight);
        let step = Factor::new(&matrix, damping).solve(&right);
        let size = step.norm();
        if size < 1e-12 || size.is_nan() {
            return here.end(count, false);
        }
        let next = Point::new(kernel, target, here.q + step, weight);
        if next.cost < here.cost {
            // At a minimum that is no solution, the cost settles before the joints do.
            let settled = here.cost - next.cost < 1e-14 * here.cost;
            here = next;
            if settled {
                return here.end(count + 1, false);
            }
            damping = (damping * 0.3).max(1e-9);
        } else if damping > 1e9 {
            return here.end(count, false);
        } else {
            damping *= 8.0;
        }
    }
    here.end(steps, false)
}
