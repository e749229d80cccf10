//! Damped descent to a pose from one start.
//!
//! Levenberg and Marquardt's step, `(J^T J + lambda I) d = J^T e`, with `lambda` in proportion to
//! the squared error, which keeps Newton's quadratic convergence where the solution is isolated
//! and stays stable where it is not (Yamashita and Fukushima 2001). Two corrections make singular
//! solutions as quick: the geodesic acceleration of Transtrum and Sethna (2012), from the exact
//! second derivative along the step; and, where steps shrink by a steady factor as they do towards
//! a double root, the sum of the geometric series instead of its first term.

use super::kernel::{Kernel, Lanes, State, Target, cross};

/// How a descent is steered.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Steering {
    /// Rad that a metre counts as.
    pub rad_per_m: f64,
    /// Longest step, rad.
    pub longest_step_rad: f64,
    /// Whether steps near the pose are corrected to second order.
    pub second_order: bool,
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
    pub q: Lanes,
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
    lower: [[f64; 6]; 6],
    inverse: [f64; 6],
}

/// `J^T J` with lengths weighted.
#[inline(always)]
pub(super) fn normal_matrix(rows: &[Lanes; 6], weight: f64) -> [Lanes; 6] {
    let mut matrix = [[0.0; 8]; 6];
    for (i, row) in matrix.iter_mut().enumerate() {
        for (l, entry) in row.iter_mut().enumerate() {
            let linear =
                rows[0][i] * rows[0][l] + rows[1][i] * rows[1][l] + rows[2][i] * rows[2][l];
            let angular =
                rows[3][i] * rows[3][l] + rows[4][i] * rows[4][l] + rows[5][i] * rows[5][l];
            *entry = weight * linear + angular;
        }
    }
    matrix
}

/// `J^T e` with lengths weighted.
#[inline(always)]
pub(super) fn gradient(rows: &[Lanes; 6], e: &[f64; 6], weight: f64) -> Lanes {
    std::array::from_fn(|l| {
        let linear = rows[0][l] * e[0] + rows[1][l] * e[1] + rows[2][l] * e[2];
        let angular = rows[3][l] * e[3] + rows[4][l] * e[4] + rows[5][l] * e[5];
        weight * linear + angular
    })
}

impl Factor {
    /// `L D L^T` of `matrix + damping I`.
    #[inline(always)]
    pub(super) fn new(matrix: &[Lanes; 6], damping: f64) -> Self {
        let mut rest = *matrix;
        let (mut lower, mut inverse) = ([[0.0; 6]; 6], [0.0; 6]);
        for k in 0..6 {
            inverse[k] = 1.0 / (rest[k][k] + damping);
            for i in k + 1..6 {
                let factor = rest[k][i] * inverse[k];
                lower[i][k] = factor;
                #[expect(clippy::needless_range_loop, reason = "rows i and k of one matrix")]
                for j in i..6 {
                    rest[i][j] -= factor * rest[k][j];
                }
            }
        }
        Self { lower, inverse }
    }

    #[inline(always)]
    pub(super) fn solve(&self, right: &Lanes) -> Lanes {
        let mut y = *right;
        for k in 0..6 {
            for i in k + 1..6 {
                y[i] -= self.lower[i][k] * y[k];
            }
        }
        for (entry, inverse) in y.iter_mut().zip(&self.inverse) {
            *entry *= inverse;
        }
        for k in (0..6).rev() {
            for i in 0..k {
                y[i] -= self.lower[k][i] * y[k];
            }
        }
        y
    }
}

/// Second derivative of the pose along a joint direction: `d (dJ/dq d) d`.
#[inline(always)]
pub(super) fn curvature(rows: &[Lanes; 6], d: &Lanes) -> [f64; 6] {
    // Angular velocity of the link before each joint.
    let mut before = [[0.0; 8]; 3];
    for k in 0..3 {
        let mut sum = 0.0;
        for j in 0..6 {
            before[k][j] = sum;
            sum += rows[3 + k][j] * d[j];
        }
    }
    let mut total = [0.0; 6];
    for j in 0..6 {
        let axis = [rows[3][j], rows[4][j], rows[5][j]];
        let lever = [rows[0][j], rows[1][j], rows[2][j]];
        let omega = [before[0][j], before[1][j], before[2][j]];
        let both: [f64; 3] = std::array::from_fn(|k| 2.0 * omega[k] + d[j] * axis[k]);
        let (linear, angular) = (cross(&both, &lever), cross(&omega, &axis));
        for k in 0..3 {
            total[k] += d[j] * linear[k];
            total[3 + k] += d[j] * angular[k];
        }
    }
    total
}

fn squares(e: &[f64; 6]) -> (f64, f64) {
    (
        e[0] * e[0] + e[1] * e[1] + e[2] * e[2],
        e[3] * e[3] + e[4] * e[4] + e[5] * e[5],
    )
}

#[inline(always)]
pub(super) fn product(a: &Lanes, b: &Lanes) -> f64 {
    (0..6).map(|i| a[i] * b[i]).sum()
}

/// A posture and its error.
struct Point {
    q: Lanes,
    state: State,
    error: [f64; 6],
    /// Weighted squared error, and the greater of its two parts unweighted.
    cost: f64,
    worst: f64,
}

impl Point {
    #[inline(always)]
    fn new(kernel: &Kernel, target: &Target, q: Lanes, weight: f64) -> Self {
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
pub(super) fn descend(kernel: &Kernel, target: &Target, start: &Lanes, steering: &Steering) -> End {
    let weight = steering.rad_per_m * steering.rad_per_m;
    let content = steering.tolerance * steering.tolerance;
    let mut here = Point::new(kernel, target, *start, weight);
    let mut damping = DAMPING;
    // The last step, zero where it tells nothing of the next.
    let mut previous = [0.0; 8];
    let mut matrix = normal_matrix(&here.state.rows, weight);
    let mut right = gradient(&here.state.rows, &here.error, weight);
    let mut milestone = MILESTONE * here.cost;
    let mut since = 0;
    for count in 0..steering.steps {
        let reached = here.worst <= content;
        if reached && here.worst <= ROUNDING_SQUARED {
            return here.end(count, true);
        }
        let factor = Factor::new(&matrix, damping * here.cost + LEAST_DAMPING);
        let mut step = factor.solve(&right);
        let length_squared = product(&step, &step);
        let longest = steering.longest_step_rad;
        if length_squared > longest * longest {
            let scale = longest / length_squared.sqrt();
            step = step.map(|s| s * scale);
        } else if steering.second_order && here.cost < NEAR {
            let bend = curvature(&here.state.rows, &step).map(|h| -0.5 * h);
            let correction = factor.solve(&gradient(&here.state.rows, &bend, weight));
            // Where the correction outgrows the step, the expansion says nothing.
            if product(&correction, &correction) < length_squared {
                for i in 0..6 {
                    step[i] += correction[i];
                }
            }
        }
        let stretch = stretch(&step, &previous);
        if stretch > 1.0 {
            step = step.map(|s| s * stretch);
        }
        let step_squared = product(&step, &step);
        let mut q = here.q;
        for i in 0..6 {
            q[i] += step[i];
        }
        let next = Point::new(kernel, target, q, weight);
        if reached {
            let done = next.worst > POLISHING * here.worst;
            if next.worst < here.worst {
                here = next;
            }
            if done {
                return here.end(count + 1, true);
            }
            previous = if stretch > 1.0 { [0.0; 8] } else { step };
            matrix = normal_matrix(&here.state.rows, weight);
            right = gradient(&here.state.rows, &here.error, weight);
            continue;
        }
        let uphill = here.cost < NEAR && next.cost < UPHILL * step_squared * step_squared;
        if next.cost < here.cost || uphill {
            previous = if stretch > 1.0 { [0.0; 8] } else { step };
            here = next;
            matrix = normal_matrix(&here.state.rows, weight);
            right = gradient(&here.state.rows, &here.error, weight);
        } else {
            damping *= MORE_DAMPING;
            previous = [0.0; 8];
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
fn stretch(step: &Lanes, previous: &Lanes) -> f64 {
    let (new, old) = (product(step, step), product(previous, previous));
    let along = product(step, previous);
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
    start: &Lanes,
    rad_per_m: f64,
    steps: u32,
) -> End {
    let weight = rad_per_m * rad_per_m;
    let mut here = Point::new(kernel, target, *start, weight);
    let mut damping = 1e-3;
    for count in 0..steps {
        let matrix = normal_matrix(&here.state.rows, weight);
        let right = gradient(&here.state.rows, &here.error, weight);
        let step = Factor::new(&matrix, damping).solve(&right);
        let size = product(&step, &step).sqrt();
        if size < 1e-12 || size.is_nan() {
            return here.end(count, false);
        }
        let mut q = here.q;
        for i in 0..6 {
            q[i] += step[i];
        }
        let next = Point::new(kernel, target, q, weight);
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
