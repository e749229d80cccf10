//! Joint motion under which the flange moves along a straight line without turning.

use nalgebra::{UnitVector3, Vector3, Vector6};

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

#[derive(Debug, Clone, Copy, PartialEq)]
struct Knot {
    position: Joints,
    /// d q / d s, rad/m.
    first: Joints,
    /// d^2 q / d s^2, rad/m^2.
    second: Joints,
}

/// Joint positions over the distance `s` along a line, `0 <= s <= length`.
#[derive(Debug, Clone, PartialEq)]
pub struct LinePath {
    knots: Vec<Knot>,
    length_m: f64,
}

/// Point of a path with its derivatives by distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathPoint {
    /// Joint positions, rad.
    pub position: Joints,
    /// First derivative, rad/m.
    pub first: Joints,
    /// Second derivative, rad/m^2.
    pub second: Joints,
    /// Third derivative, rad/m^3.
    pub third: Joints,
}

impl LinePath {
    /// Path that ends at `end` after the flange has moved `length_m` along `direction`
    /// (a unit vector in `base_link`).
    ///
    /// Solved backwards from `end`, so that the branch is the one of `end`.
    pub fn ending_at(
        chain: &Chain,
        end: &Joints,
        direction: &UnitVector3<f64>,
        length_m: f64,
    ) -> Result<Self, LineError> {
        let base_link_from_end = chain.base_link_from_flange(end);
        let step_m = length_m / f64::from(INTERVALS);
        let mut knots = vec![knot_at(chain, end, direction, 0.0)?];
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
            knots.push(knot_at(chain, &solved.joints, direction, travelled_m)?);
        }
        knots.reverse();
        Ok(Self { knots, length_m })
    }

    /// Length, m.
    pub fn length_m(&self) -> f64 {
        self.length_m
    }

    /// Joint positions at the line's start, rad.
    pub fn start(&self) -> Joints {
        self.knots[0].position
    }

    /// Joint positions at the line's end, rad.
    pub fn end(&self) -> Joints {
        self.knots[self.knots.len() - 1].position
    }

    /// The same line with whole turns added to joints.
    pub fn shifted(&self, shift: &Joints) -> Self {
        let mut path = self.clone();
        for knot in &mut path.knots {
            knot.position += shift;
        }
        path
    }

    /// Point at distance `s_m` from the start: quintic Hermite interpolation.
    pub fn sample(&self, s_m: f64) -> PathPoint {
        let intervals = self.intervals();
        let h = self.length_m / intervals as f64;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped"
        )]
        let index = ((s_m / h).floor().max(0.0) as usize).min(intervals - 1);
        let u = (s_m / h - index as f64).clamp(0.0, 1.0);
        let [c0, c1, c2, c3, c4, c5] = self.coefficients(index);
        PathPoint {
            position: c0 + (c1 + (c2 + (c3 + (c4 + c5 * u) * u) * u) * u) * u,
            first: (c1 + (c2 * 2.0 + (c3 * 3.0 + (c4 * 4.0 + c5 * (5.0 * u)) * u) * u) * u) / h,
            second: (c2 * 2.0 + (c3 * 6.0 + (c4 * 12.0 + c5 * (20.0 * u)) * u) * u) / (h * h),
            third: (c3 * 6.0 + (c4 * 24.0 + c5 * (60.0 * u)) * u) / (h * h * h),
        }
    }

    /// Number of intervals between knots.
    pub(super) fn intervals(&self) -> usize {
        self.knots.len() - 1
    }

    /// Coefficients of the quintic between knots `index` and `index + 1`, by rising powers of
    /// `u`, which runs from 0 to 1 between them.
    pub(super) fn coefficients(&self, index: usize) -> [Joints; 6] {
        let h = self.length_m / self.intervals() as f64;
        let (a, b) = (&self.knots[index], &self.knots[index + 1]);
        // The knots' values, first and second derivatives (by u).
        let (v0, v1) = (a.first * h, b.first * h);
        let (w0, w1) = (a.second * (h * h), b.second * (h * h));
        let d = b.position - a.position;
        [
            a.position,
            v0,
            w0 * 0.5,
            d * 10.0 - v0 * 6.0 - v1 * 4.0 - w0 * 1.5 + w1 * 0.5,
            d * -15.0 + v0 * 8.0 + v1 * 7.0 + w0 * 1.5 - w1,
            d * 6.0 - v0 * 3.0 - v1 * 3.0 - w0 * 0.5 + w1 * 0.5,
        ]
    }
}

fn knot_at(
    chain: &Chain,
    q: &Joints,
    direction: &Vector3<f64>,
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
