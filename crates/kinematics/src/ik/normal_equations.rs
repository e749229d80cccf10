//! The damped normal equations of six unknowns, on the stack.

use super::kernel::cross;
use super::sin_cos::Lanes;
use crate::JOINT_COUNT;

/// `J^T W J` in its first six lanes; `W` weighs metres against radians.
pub(super) type Normal = [Lanes; JOINT_COUNT];

/// `J^T W J` from the rows of the Jacobian, linear before angular.
#[inline(always)]
pub(super) fn normal_matrix(rows: &[Lanes; 6], weight_squared: f64) -> Normal {
    let mut normal = [[0.0; 8]; JOINT_COUNT];
    for (i, row) in normal.iter_mut().enumerate() {
        for lane in 0..8 {
            let linear = (rows[0][i] * rows[0][lane] + rows[1][i] * rows[1][lane])
                + rows[2][i] * rows[2][lane];
            let angular = (rows[3][i] * rows[3][lane] + rows[4][i] * rows[4][lane])
                + rows[5][i] * rows[5][lane];
            row[lane] = weight_squared * linear + angular;
        }
    }
    normal
}

/// `J^T W e`.
#[inline(always)]
pub(super) fn gradient(rows: &[Lanes; 6], error: &[f64; 6], weight_squared: f64) -> Lanes {
    let mut gradient = [0.0; 8];
    for lane in 0..8 {
        let linear = (rows[0][lane] * error[0] + rows[1][lane] * error[1])
            + rows[2][lane] * error[2];
        let angular = (rows[3][lane] * error[3] + rows[4][lane] * error[4])
            + rows[5][lane] * error[5];
        gradient[lane] = weight_squared * linear + angular;
    }
    gradient
}

/// Second derivative of the pose along a step, `d^2 x / dt^2` for `q + t step`.
///
/// The column of joint `j` turns with the joints before it, and with itself:
/// `sum_j step_j (2 w_j + step_j z_j) x Jv_j` and `sum_j step_j w_j x z_j`,
/// `w_j = sum_{i < j} step_i z_i`.
#[inline(always)]
pub(super) fn curvature(rows: &[Lanes; 6], step: &Lanes) -> [f64; 6] {
    let mut turning = [[0.0; 8]; 3];
    for k in 0..3 {
        let mut sum = 0.0;
        for j in 0..JOINT_COUNT {
            turning[k][j] = sum;
            sum += rows[3 + k][j] * step[j];
        }
    }
    let mut terms = [[0.0; 8]; 6];
    for j in 0..8 {
        let linear = [rows[0][j], rows[1][j], rows[2][j]];
        let axis = [rows[3][j], rows[4][j], rows[5][j]];
        let before = [turning[0][j], turning[1][j], turning[2][j]];
        let with_itself = [0, 1, 2].map(|k| 2.0 * before[k] + step[j] * axis[k]);
        let a = cross(&with_itself, &linear);
        let b = cross(&before, &axis);
        for k in 0..3 {
            terms[k][j] = step[j] * a[k];
            terms[3 + k][j] = step[j] * b[k];
        }
    }
    terms.map(|term| ((term[0] + term[1]) + (term[2] + term[3])) + (term[4] + term[5]))
}

/// `L D L^T` of a damped normal matrix. No pivoting: the damping keeps the pivots positive, and
/// where rounding does not, the step is no descent and is rejected.
#[derive(Debug, Clone, Copy)]
pub(super) struct Factors {
    lower: [[f64; JOINT_COUNT]; JOINT_COUNT],
    inverse_pivots: [f64; JOINT_COUNT],
}

impl Factors {
    /// Of `normal + damping I`.
    #[inline(always)]
    pub fn new(normal: &Normal, damping: f64) -> Self {
        let mut lower = [[0.0; JOINT_COUNT]; JOINT_COUNT];
        let mut inverse_pivots = [0.0; JOINT_COUNT];
        let mut rest = *normal;
        for k in 0..JOINT_COUNT {
            inverse_pivots[k] = 1.0 / (rest[k][k] + damping);
            for i in k + 1..JOINT_COUNT {
                let factor = rest[k][i] * inverse_pivots[k];
                lower[i][k] = factor;
                for j in i..JOINT_COUNT {
                    rest[i][j] -= factor * rest[k][j];
                }
            }
        }
        Self {
            lower,
            inverse_pivots,
        }
    }

    /// Solves for a right-hand side; the last two lanes are zero.
    #[inline(always)]
    pub fn solve(&self, right: &Lanes) -> Lanes {
        let mut x = *right;
        for k in 0..JOINT_COUNT {
            for i in k + 1..JOINT_COUNT {
                x[i] -= self.lower[i][k] * x[k];
            }
        }
        for k in 0..JOINT_COUNT {
            x[k] *= self.inverse_pivots[k];
        }
        for k in (0..JOINT_COUNT).rev() {
            for i in 0..k {
                x[i] -= self.lower[k][i] * x[k];
            }
        }
        [x[6], x[7]] = [0.0; 2];
        x
    }
}
