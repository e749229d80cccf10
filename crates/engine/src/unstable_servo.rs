//! A servo that cannot hold the arm.

use std::fmt;

/// Gains that a plant cannot follow.
#[derive(Debug, Clone, PartialEq)]
pub struct UnstableServo {
    /// Growth of the worst motion per step.
    pub growth: f64,
    /// Joint that moves most in it.
    pub joint: &'static str,
    /// Factor on all gains up to which the loop is stable at this step; none if no gain is.
    pub stable_factor: Option<f64>,
    /// Time step, s, up to which the loop is stable with these gains; none if none is.
    pub stable_timestep_s: Option<f64>,
}

impl fmt::Display for UnstableServo {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            formatter,
            "the servo is unstable: with kp, kd, armature and time step as given, {} oscillates \
             with growth factor {:.3} per step",
            self.joint, self.growth
        )?;
        match (self.stable_factor, self.stable_timestep_s) {
            (None, None) => write!(
                formatter,
                "; neither lower gains nor a shorter step stabilises it"
            ),
            (factor, step) => {
                if let Some(factor) = factor {
                    write!(formatter, "; stable below {factor:.3} times these gains")?;
                }
                if let Some(step_s) = step {
                    write!(
                        formatter,
                        "; stable with these gains below steps of {:.3} ms",
                        step_s * 1e3
                    )?;
                }
                Ok(())
            }
        }
    }
}
