//! Numerical inverse kinematics: Gauss-Newton near a guess, and a restarted solver from anywhere.
//!
//! Equations 39 to 47 of the paper, corrected: the Jacobian's angular part is `[z_0 ... z_5]`, the
//! orientation error the log map `vee(log(R_d R^T))`.

mod descent;
mod fold;
mod kernel;
#[cfg(test)]
mod tests;

use std::f64::consts::PI;
use std::time::{Duration, Instant};

use fearless_simd::prelude::*;
use nalgebra::{Matrix6, Vector6};
use needlebench_numerics::random::SplitMix64;

use crate::chain::stacked;
use crate::{Chain, JOINT_COUNT, Joints, Pose, rotation_vector};
use descent::{End, Steering, descend, least_squares};
use fold::{flattest_plane, fold};
use kernel::Kernel;

pub(super) use kernel::{Placed, Target, sin_cos};

/// Which iteration [`gauss_newton`] takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GaussNewtonStep {
    /// With a damping that vanishes with the error and corrections for singular solutions:
    /// quadratic where the undamped one is, and converging where that one is not.
    Regularised,
    /// The textbook's: the pseudo-inverse's step, singular values below the rank tolerance left
    /// out. For comparison.
    Undamped,
}

/// Limits and tolerances of [`gauss_newton`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GaussNewtonOptions {
    /// Steps after which it gives up, restarts included.
    pub max_iterations: u32,
    /// Time after which it gives up, looked at between descents. With one, results depend on the
    /// machine.
    pub max_time: Option<Duration>,
    /// Residual that counts as converged: m and rad alike. The steps then go on to rounding level.
    pub tolerance: f64,
    /// The undamped step takes singular values below this fraction of the largest as zero (lengths
    /// over 0.5 m), so that it is the shortest one instead of a huge one.
    pub rank_tolerance: f64,
    /// Kind of step.
    pub step: GaussNewtonStep,
}

impl Default for GaussNewtonOptions {
    fn default() -> Self {
        Self {
            max_iterations: 500,
            max_time: None,
            tolerance: 1e-9,
            rank_tolerance: 1e-9,
            step: GaussNewtonStep::Regularised,
        }
    }
}

/// Limits and tolerances of [`Numerical::damped`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DampedOptions {
    /// Steps after which it gives up, over all restarts.
    pub max_iterations: u32,
    /// Time after which it gives up, looked at between descents. With one, results depend on the
    /// machine.
    pub max_time: Option<Duration>,
    /// Residual that counts as converged: m and rad alike. The steps then go on to rounding level.
    pub tolerance: f64,
    /// Seed of the random postures that descents start from after the first.
    pub seed: u64,
}

impl Default for DampedOptions {
    fn default() -> Self {
        Self {
            max_iterations: 20_000,
            max_time: None,
            tolerance: 1e-9,
            seed: 1,
        }
    }
}

/// Why a numerical solver stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stop {
    /// Both residuals are within the tolerance.
    Converged,
    /// A least-squares minimum that is not a solution.
    Stationary,
    /// As many steps as allowed.
    IterationLimit,
    /// As much time as allowed.
    TimeLimit,
    /// A number was not finite.
    NotFinite,
}

/// Where a numerical solver ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NumericalResult {
    /// Joint positions, rad, as near to the start as the steps took them (not wrapped): the best
    /// that were seen.
    pub joints: Joints,
    /// Steps taken, restarts included.
    pub iterations: u32,
    /// Starts given up.
    pub restarts: u32,
    /// Distance to the requested position, m.
    pub residual_m: f64,
    /// Angle to the requested orientation, rad.
    pub residual_rad: f64,
    /// Both residuals are within the tolerance.
    pub converged: bool,
    /// Why it stopped.
    pub stop: Stop,
}

/// Position and orientation error of a pose, `[p_d - p; vee(log(R_d R^T))]`, in `base_link`.
///
/// The angular part is the log map where the paper prints `Rdot R^T` (equation 45).
pub(crate) fn pose_error(target: &Pose, actual: &Pose) -> Vector6<f64> {
    let linear = target.translation.vector - actual.translation.vector;
    let angular = rotation_vector(&(target.rotation * actual.rotation.inverse()));
    stacked(&linear, &angular)
}

/// A chain prepared for numerical inverse kinematics.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Numerical {
    chain: Chain,
    kernel: Kernel,
}

/// A posture at rounding level, not wrapped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Refined {
    pub joints: Joints,
    pub residual_m: f64,
    pub residual_rad: f64,
}

/// How restarts are made, and how long they go on.
#[derive(Clone, Copy)]
struct Effort {
    steering: Steering,
    /// Restarts lie within this of the first start in every joint, rad.
    spread_rad: f64,
    /// They lie about the first start rather than about zero.
    about_start: bool,
    max_iterations: u32,
    deadline: Option<Instant>,
    seed: u64,
}

impl Numerical {
    /// Prepares a chain.
    pub fn new(chain: &Chain) -> Self {
        Self {
            chain: *chain,
            kernel: Kernel::new(chain),
        }
    }

    /// Joint positions near a guess that bring the flange to `base_link_from_flange`.
    ///
    /// From within 0.1 rad of a solution in every joint it converges on every set of
    /// [`crate::pose_sets`], singular ones included (`gauss_newton_returns_from_a_tenth_of_a_radian`),
    /// in 3 to 7 steps; quadratically where the solution is isolated. A descent that stalls is
    /// started again within 0.2 rad of the guess. From farther off it may end in any of the eight
    /// configurations, or nowhere.
    pub fn gauss_newton(
        &self,
        base_link_from_flange: &Pose,
        guess: &Joints,
        options: &GaussNewtonOptions,
    ) -> NumericalResult {
        if options.step == GaussNewtonStep::Undamped {
            return undamped(&self.chain, base_link_from_flange, guess, options);
        }
        let effort = Effort {
            steering: Steering {
                rad_per_m: self.rad_per_m(),
                longest_step_rad: 0.5,
                patience_far: 8,
                steps: 50,
                tolerance: options.tolerance,
            },
            spread_rad: 0.2,
            about_start: true,
            max_iterations: options.max_iterations,
            deadline: deadline(options.max_time),
            seed: 1,
        };
        self.solve(base_link_from_flange, guess, &effort)
    }

    /// Joint positions that bring the flange to `base_link_from_flange`, from any start.
    ///
    /// Damped descents, given up early when they stall and started again from random postures.
    /// Converges on every set of [`crate::pose_sets`] from random starts
    /// (`the_restarted_solver_always_converges`). For a pose out of reach the answer holds the best
    /// posture seen; [`Numerical::nearest`] goes on to the least-squares one.
    pub fn damped(
        &self,
        base_link_from_flange: &Pose,
        start: &Joints,
        options: &DampedOptions,
    ) -> NumericalResult {
        let effort = Effort {
            steering: Steering {
                rad_per_m: self.rad_per_m(),
                longest_step_rad: PI,
                patience_far: 3,
                steps: 50,
                tolerance: options.tolerance,
            },
            spread_rad: PI,
            about_start: false,
            max_iterations: options.max_iterations,
            deadline: deadline(options.max_time),
            seed: options.seed,
        };
        self.solve(base_link_from_flange, start, &effort)
    }

    /// The posture near a start that comes nearest to a pose, in the sense of least squares with
    /// a metre as `rad_per_m` radians. `converged` says whether it reaches the pose within 1e-9.
    pub fn nearest(
        &self,
        base_link_from_flange: &Pose,
        start: &Joints,
        rad_per_m: f64,
    ) -> NumericalResult {
        const STEPS: u32 = 200;
        let target = self.kernel.target(base_link_from_flange);
        let end = least_squares(&self.kernel, &target, start, rad_per_m, STEPS);
        let stop = if end.residual() <= 1e-9 {
            Stop::Converged
        } else if end.residual().is_nan() {
            Stop::NotFinite
        } else if end.steps < STEPS {
            Stop::Stationary
        } else {
            Stop::IterationLimit
        };
        result(&end, end.steps, 0, stop)
    }

    /// A pose prepared for [`Numerical::refined`] and [`Numerical::residuals`].
    pub(super) fn target(&self, base_link_from_flange: &Pose) -> Target {
        self.kernel.target(base_link_from_flange)
    }

    /// One descent to rounding level, without restarts; `None` if it does not get there.
    pub(super) fn refined(&self, target: &Target, start: &Joints) -> Option<Refined> {
        let steering = Steering {
            rad_per_m: self.rad_per_m(),
            longest_step_rad: 0.5,
            patience_far: 8,
            steps: 20,
            tolerance: 1e-9,
        };
        let end = descend(&self.kernel, target, start, &steering);
        end.reached.then_some(Refined {
            joints: end.q,
            residual_m: end.residual_m,
            residual_rad: end.residual_rad,
        })
    }

    /// The flange in the chain's base, from cosines and sines of the joints, postures across lanes.
    #[inline(always)]
    pub(super) fn placed<S: Simd, V: SimdFloat<S, Element = f64>>(
        &self,
        simd: S,
        cosines: &[V; JOINT_COUNT],
        sines: &[V; JOINT_COUNT],
    ) -> Placed<V> {
        self.kernel.placed(simd, cosines, sines)
    }

    /// Starts near the two solutions that meet at a singularity near a posture.
    pub(super) fn fold(&self, target: &Target, start: &Joints) -> Option<[Joints; 2]> {
        fold(&self.kernel, target, start, self.rad_per_m())
    }

    /// The two directions of the joints that move the flange least, rad.
    pub(super) fn flattest_plane(&self, q: &Joints) -> Option<[Joints; 2]> {
        flattest_plane(&self.kernel, q, self.rad_per_m())
    }

    /// Residuals of postures, m and rad.
    pub(super) fn residuals(&self, target: &Target, q: &Joints) -> (f64, f64) {
        let error = self.kernel.state(q).error(target);
        let norm = |row| error.fixed_rows::<3>(row).norm();
        (norm(0), norm(3))
    }

    /// Metres and radians made comparable: 9.2 rad/m on the UR3, which took the fewest steps; half
    /// or twice as much costs 5 %.
    fn rad_per_m(&self) -> f64 {
        6.0 / self.kernel.reach_m.max(1e-3)
    }

    fn solve(&self, pose: &Pose, start: &Joints, effort: &Effort) -> NumericalResult {
        let target = self.kernel.target(pose);
        let mut random = SplitMix64::new(effort.seed);
        let (mut q, mut iterations, mut restarts) = (*start, 0, 0);
        let mut best: Option<End> = None;
        loop {
            let mut steering = effort.steering;
            steering.steps = steering.steps.min(effort.max_iterations - iterations);
            let end = descend(&self.kernel, &target, &q, &steering);
            iterations += end.steps;
            if best.is_none_or(|best| end.reached || end.residual() < best.residual()) {
                best = Some(end);
            }
            let best = best.unwrap_or(end);
            let stop = if end.reached {
                Some(Stop::Converged)
            } else if end.residual().is_nan() {
                Some(Stop::NotFinite)
            } else if iterations >= effort.max_iterations {
                Some(Stop::IterationLimit)
            } else if effort.deadline.is_some_and(|end| Instant::now() >= end) {
                Some(Stop::TimeLimit)
            } else {
                None
            };
            if let Some(stop) = stop {
                return result(&best, iterations, restarts, stop);
            }
            restarts += 1;
            q = start.map(|joint| {
                let centre = if effort.about_start { joint } else { 0.0 };
                centre + random.uniform(-effort.spread_rad, effort.spread_rad)
            });
        }
    }
}

/// [`Numerical::gauss_newton`] on a chain that is used once.
pub fn gauss_newton(
    chain: &Chain,
    base_link_from_flange: &Pose,
    guess: &Joints,
    options: &GaussNewtonOptions,
) -> NumericalResult {
    Numerical::new(chain).gauss_newton(base_link_from_flange, guess, options)
}

fn deadline(max_time: Option<Duration>) -> Option<Instant> {
    Instant::now().checked_add(max_time?)
}

fn result(end: &End, iterations: u32, restarts: u32, stop: Stop) -> NumericalResult {
    NumericalResult {
        joints: end.q,
        iterations,
        restarts,
        residual_m: end.residual_m,
        residual_rad: end.residual_rad,
        converged: stop == Stop::Converged,
        stop,
    }
}

/// The textbook's iteration: `q + J^+ e` until the residual stops falling.
fn undamped(
    chain: &Chain,
    target: &Pose,
    guess: &Joints,
    options: &GaussNewtonOptions,
) -> NumericalResult {
    let evaluate = |q: &Joints| pose_error(target, &chain.base_link_from_flange(q));
    let size = |error: &Vector6<f64>| {
        let (m, rad) = (
            error.fixed_rows::<3>(0).norm(),
            error.fixed_rows::<3>(3).norm(),
        );
        (m, rad, m.max(rad))
    };
    let mut q = *guess;
    let mut error = evaluate(&q);
    let mut best = (q, error, 0);
    let deadline = deadline(options.max_time);
    let mut stop = Stop::IterationLimit;
    for iteration in 1..=options.max_iterations {
        // Below this, steps only stir rounding errors.
        if size(&error).2 <= 1e-14 {
            break;
        }
        let Some(step) = pseudo_inverse_step(&chain.jacobian(&q), &error, options.rank_tolerance)
        else {
            stop = Stop::NotFinite;
            break;
        };
        q += step;
        error = evaluate(&q);
        let settled = size(&best.1).2 < 1e-11 && size(&error).2 >= size(&best.1).2;
        if size(&error).2 < size(&best.1).2 {
            best = (q, error, iteration);
        }
        if settled {
            break;
        }
        if deadline.is_some_and(|end| Instant::now() >= end) {
            stop = Stop::TimeLimit;
            break;
        }
    }
    let (residual_m, residual_rad, worst) = size(&best.1);
    let converged = worst <= options.tolerance;
    NumericalResult {
        joints: best.0,
        iterations: if converged {
            best.2
        } else {
            options.max_iterations
        },
        restarts: 0,
        residual_m,
        residual_rad,
        converged,
        stop: if converged { Stop::Converged } else { stop },
    }
}

/// Lengths over 0.5 m, comparable with angles, so that one rank tolerance serves both.
fn pseudo_inverse_step(
    jacobian: &Matrix6<f64>,
    error: &Vector6<f64>,
    rank_tolerance: f64,
) -> Option<Joints> {
    if !error.iter().chain(jacobian.iter()).all(|v| v.is_finite()) {
        return None;
    }
    let mut scaled = *jacobian;
    let mut target = *error;
    scaled.fixed_rows_mut::<3>(0).scale_mut(2.0);
    target.fixed_rows_mut::<3>(0).scale_mut(2.0);
    let svd = scaled.svd(true, true);
    let cutoff = svd.singular_values.max() * rank_tolerance;
    svd.solve(&target, cutoff).ok()
}
