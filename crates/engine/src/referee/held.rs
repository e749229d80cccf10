//! The reference integrator over short stretches of an engine's motion, under the torques that the engine's run
//! recorded and nothing else.

use nalgebra::{Matrix6, SymmetricEigen};
use needlebench_kinematics::{Dynamics, Joints};

use super::{RefereePlant, halves, phase};
use crate::{EngineError, PlantState, Recording};

/// Newton-like steps to the position half a step before a state; each leaves a share of the order of
/// (half step / 0.2 s)^2, so the third is rounding.
const STEPS_BACK: usize = 3;

/// Step of the central differences of the gravity torque, rad: truncation and rounding leave 1e-8 of it.
const DIFFERENCE_RAD: f64 = 1e-5;

/// Where the reference integrator arrives at the end of a window of a recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeldWindow {
    /// State of the recording that the window starts from.
    pub first: usize,
    /// State of the recording that it ends at.
    pub last: usize,
    /// The reference integrator at its end.
    pub state: PlantState,
    /// How many times as large gravity makes a difference of position over the window, at most.
    pub growth: f64,
}

impl RefereePlant {
    /// The reference integrator over the windows of `window_steps` steps that the first `steps` steps of a recording
    /// fall into, the last one moved back so that it ends with them; none if they are fewer.
    ///
    /// Each window starts from the engine's own state and goes under the engine's recorded torques, held as the engine
    /// applies them. Nothing pulls the reference integrator back to the recording: neither gains nor reference are
    /// known here. So what it ends away from the recording by is the engine's dynamics and integration over the window,
    /// whatever servo made the torques. Windows have to be short because nothing holds a raised arm:
    /// [`HeldWindow::growth`] says how much that matters.
    ///
    /// An engine whose velocities belong to `a` before the time of their states computes them from
    /// torques that act from `a` before their sample: `a` is half a step in the engines (see
    /// [`TorqueHold`](super::TorqueHold)) and 0 for a drive that holds a torque from its sample on.
    ///
    /// # Errors
    /// [`EngineError::Unstable`] where the reference integrator cannot follow the torques.
    pub fn held_windows(
        &self,
        recording: &Recording,
        steps: usize,
        window_steps: usize,
    ) -> Result<Vec<HeldWindow>, EngineError> {
        let steps = steps.min(recording.steps());
        if window_steps == 0 || steps < window_steps {
            return Ok(Vec::new());
        }
        let whole = (0..steps / window_steps).map(|k| k * window_steps);
        let rest = (!steps.is_multiple_of(window_steps)).then_some(steps - window_steps);
        whole
            .chain(rest)
            .map(|first| self.held_window(recording, first, first + window_steps))
            .collect()
    }

    fn held_window(
        &self,
        recording: &Recording,
        first: usize,
        last: usize,
    ) -> Result<HeldWindow, EngineError> {
        let h = recording.timestep_s;
        let age_s = recording.velocity_age_s;
        let start = &recording.state[first];
        let torque_nm = &recording.torque_nm;
        let mut position = start.position;
        // At rest before the first torque, whatever the age.
        let mut interval_s = h - age_s;
        if first > 0 {
            interval_s = h;
            for _ in 0..STEPS_BACK {
                let there = phase(&position, &start.velocity);
                let carried = self.advanced(&there, age_s, &torque_nm[first - 1])?;
                position += start.position - halves(&carried).0;
            }
        }
        let mut settled = phase(&position, &start.velocity);
        for torque_nm in &torque_nm[first..last] {
            settled = self.advanced(&settled, interval_s, torque_nm)?;
            interval_s = h;
        }
        let velocity = halves(&settled).1;
        let ahead = self.advanced(&settled, age_s, &torque_nm[last - 1])?;
        let window_s = (last - first) as f64 * h;
        Ok(HeldWindow {
            first,
            last,
            state: self.observe(halves(&ahead).0, velocity),
            growth: growth(&self.dynamics, &start.position, window_s),
        })
    }
}

/// How many times as large gravity makes a small difference of position after `duration_s` under torques
/// that are held: `cosh(rate t)`, with the fastest rate of `M x'' = -(dg/dq) x`.
fn growth(dynamics: &Dynamics, position: &Joints, duration_s: f64) -> f64 {
    let mut slope = Matrix6::zeros();
    for i in 0..slope.ncols() {
        let [ahead, behind] = [1.0, -1.0].map(|sign| {
            let mut at = *position;
            at[i] += sign * DIFFERENCE_RAD;
            dynamics.gravity_torque(&at)
        });
        slope.set_column(i, &((ahead - behind) / (2.0 * DIFFERENCE_RAD)));
    }
    // Symmetric but for rounding: the second derivative of the potential energy.
    let slope = 0.5 * (slope + slope.transpose());
    let Some(root) = dynamics.mass_matrix(position).cholesky() else {
        return f64::INFINITY;
    };
    let Some(inverse) = root.l().try_inverse() else {
        return f64::INFINITY;
    };
    let modes = SymmetricEigen::new(inverse * slope * inverse.transpose());
    let rate = (-modes.eigenvalues.min()).max(0.0).sqrt();
    libm::cosh(rate * duration_s)
}
