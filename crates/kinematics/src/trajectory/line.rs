//! Joint motion under which the flange moves along a straight line without turning.

use nalgebra::{UnitVector3, Vector3, Vector6};

use super::path::{JointPath, Knot};
use crate::{Chain, Joints, ik};

/// Knots per line. The quintic between two knots leaves the line by less than 1e-9 m on lines
/// of 0.2 m away from singularities (`the_flange_stays_on_the_line`).
const INTERVALS: u32 = 32;

/// Smallest singular value of the flange Jacobian (lengths over 0.5 m) that a line may pass.
const LEAST_SINGULAR_VALUE: f64 = 1e-4;

/// Largest joint step between knots, rad: beyond it the line runs through a singularity.
const LARGEST_KNOT_STEP_RAD: f64 = 0.5;

/// Why there is no joint motion along a line.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum LineError {
    /// The line passes a singularity.
    #[error(
        "the line meets a singularity {travelled_m:.4} m from its end: \
             smallest singular value {singular_value:.2e}"
    )]
    Singular {
        /// Distance from the final pose, m.
        travelled_m: f64,
        /// Smallest singular value of the Jacobian with lengths over 0.5 m.
        singular_value: f64,
    },
    /// The line leaves the workspace.
    #[error("the line leaves the workspace {travelled_m:.4} m from its end")]
    OutOfReach {
        /// Distance from the final pose, m.
        travelled_m: f64,
    },
}

impl JointPath {
    /// Path that ends at `end` after the flange has moved `length_m` along `direction`
    /// (a unit vector in `base_link`).
    ///
    /// Solved backwards from `end`, so that the branch is the one of `end`.
    pub fn line_ending_at(
        chain: &Chain,
        end: &Joints,
        direction: &UnitVector3<f64>,
        length_m: f64,
    ) -> Result<Self, LineError> {
        let base_link_from_end = chain.base_link_from_flange(end);
        let step_m = length_m / f64::from(INTERVALS);
        let mut knots = vec![knot_at(chain, end, direction, length_m, 0.0)?];
        for k in 1..=INTERVALS {
            let travelled_m = step_m * f64::from(k);
            let previous = knots[knots.len() - 1];
            let mut target = base_link_from_end;
            target.translation.vector -= direction.into_inner() * travelled_m;
            let guess = previous.position - previous.first * step_m
                + previous.second * (0.5 * step_m * step_m);
            let solved =
                ik::gauss_newton(chain, &target, &guess, &ik::GaussNewtonOptions::default());
            if !solved.converged {
                return Err(LineError::OutOfReach { travelled_m });
            }
            if (solved.joints - previous.position).amax() > LARGEST_KNOT_STEP_RAD {
                return Err(LineError::Singular {
                    travelled_m,
                    singular_value: 0.0,
                });
            }
            let left_m = length_m - travelled_m;
            // The last one is the start, exactly.
            let s_m = if k == INTERVALS { 0.0 } else { left_m };
            knots.push(knot_at(chain, &solved.joints, direction, s_m, travelled_m)?);
        }
        knots.reverse();
        Ok(Self::from_knots(knots))
    }
}

fn knot_at(
    chain: &Chain,
    q: &Joints,
    direction: &Vector3<f64>,
    s_m: f64,
    travelled_m: f64,
) -> Result<Knot, LineError> {
    const CHARACTERISTIC_LENGTH_M: f64 = 0.5;
    let jacobian = chain.jacobian(q);
    let mut scaled = jacobian;
    scaled
        .fixed_rows_mut::<3>(0)
        .scale_mut(1.0 / CHARACTERISTIC_LENGTH_M);
    let singular_value = scaled.singular_values().min();
    let lu = jacobian.lu();
    let twist = Vector6::new(direction.x, direction.y, direction.z, 0.0, 0.0, 0.0);
    let solved = lu.solve(&twist).and_then(|first| {
        // x'' = J q'' + J' q' = 0 along a straight line without turning.
        let second = lu.solve(&-chain.flange_bias_acceleration(q, &first))?;
        Some(Knot {
            s: s_m,
            position: *q,
            first,
            second,
        })
    });
    match solved {
        Some(knot) if singular_value >= LEAST_SINGULAR_VALUE => Ok(knot),
        _ => Err(LineError::Singular {
            travelled_m,
            singular_value,
        }),
    }
}
