//! What the encoders' noise leaves of the arm's rest.

use nalgebra::Matrix6;
use needlebench_engine::{ClosedLoop, Servo};
use needlebench_kinematics::{Dynamics, Joints};
use needlebench_numerics::random::SplitMix64;

use crate::Truth;
use crate::distribution::Variable;

/// Steps between two samples, longer than the loop's slowest motion lasts.
const STEPS_APART: usize = 60;

/// Steps until the start at rest is forgotten.
const STEPS_FIRST: usize = 400;

/// The arm's small motion under the noise of its encoders, at one posture.
pub(crate) struct Jitter {
    system: ClosedLoop,
    noise_rad: Joints,
}

impl Jitter {
    /// None where the encoders have no noise.
    pub(crate) fn new(
        servo: &Servo,
        real: &Dynamics,
        truth: &Truth,
        position: &Joints,
        timestep_s: f64,
    ) -> Option<Self> {
        let noise_rad = truth.actuation.encoder?.noise_rad;
        if noise_rad.amax() == 0.0 {
            return None;
        }
        let mass = real.mass_matrix(position);
        Some(Self {
            system: ClosedLoop::new(&mass, servo, &truth.actuation, timestep_s),
            noise_rad,
        })
    }

    /// Covariance of the joints, rad^2; zero for a loop that is unstable, which runs refuse.
    pub(crate) fn covariance(&self) -> Matrix6<f64> {
        self.system
            .joint_covariance(&self.noise_rad)
            .unwrap_or_else(Matrix6::zeros)
    }

    /// Joint errors at moments far apart, from the motion itself.
    pub(crate) fn samples(&self, count: usize, random: &mut SplitMix64) -> Vec<Joints> {
        let mut state = self.system.at_rest();
        let mut advance = |steps: usize, state: &mut nalgebra::DVector<f64>| {
            for _ in 0..steps {
                let noise = self
                    .noise_rad
                    .map(|each| each * Variable::Normal.draw(random));
                *state = self.system.step(state, &noise);
            }
        };
        advance(STEPS_FIRST, &mut state);
        (0..count)
            .map(|_| {
                advance(STEPS_APART, &mut state);
                Joints::from_column_slice(&state.as_slice()[..6])
            })
            .collect()
    }
}
