//! The joint servo that drives every engine.

use needlebench_kinematics::trajectory::JointState;
use needlebench_kinematics::{Dynamics, JOINT_COUNT, Joints};
use serde::{Deserialize, Serialize};

use crate::EngineError;

/// Gains of the servo, per joint.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ServoGains {
    /// Proportional gain, N m/rad.
    pub kp_nm_per_rad: [f64; JOINT_COUNT],
    /// Derivative gain, N m s/rad.
    pub kd_nms_per_rad: [f64; JOINT_COUNT],
}

impl Default for ServoGains {
    /// Those of the shipped UR3 and UR3e: 2800 N m/rad and 90 N m s/rad at base, shoulder and elbow, half of
    /// that at the wrists.
    ///
    /// With 2.0 kg m^2 about the shoulder, which the stretched arm has with its rated load, the natural frequency is
    /// 6 Hz and the damping ratio 0.6. At a wrist the armature of 0.07 kg m^2 is nearly the whole inertia, and the
    /// explicit servo is stable up to steps of 3.2 ms (see [`Servo::stability_ratio`]).
    fn default() -> Self {
        Self {
            kp_nm_per_rad: [2800.0, 2800.0, 2800.0, 1400.0, 1400.0, 1400.0],
            kd_nms_per_rad: [90.0, 90.0, 90.0, 43.0, 43.0, 43.0],
        }
    }
}

/// Torque of one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ServoOutput {
    /// Torque after the effort clamp, N m.
    pub torque_nm: Joints,
    /// Whether the clamp changed a joint's torque.
    pub saturated: [bool; JOINT_COUNT],
}

/// Joint servo: inverse dynamics of the reference plus a proportional-derivative term.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Servo {
    /// The robot as the controller assumes it to be: the *nominal* model, armature included.
    pub dynamics: Dynamics,
    /// Gains.
    pub gains: ServoGains,
    /// Highest torque per joint, N m.
    pub effort_limit_nm: Joints,
}

impl Servo {
    /// `clamp(RNEA(q_r, qd_r, qdd_r) + kp (q_r - q) + kd (qd_r - qd))`.
    ///
    /// The feed-forward is that of the reference, not of the measured state: with a perfect model
    /// the error then obeys a linear, damped equation whose rest is the reference itself.
    pub fn torque(
        &self,
        reference: &JointState,
        position: &Joints,
        velocity: &Joints,
    ) -> ServoOutput {
        let forward_nm = self.forward_nm(reference);
        self.limited(&self.wanted_nm(forward_nm, reference, position, velocity))
    }

    /// The torque within the limits.
    pub(crate) fn limited(&self, wanted_nm: &Joints) -> ServoOutput {
        // NaN passes the clamp unchanged, so that the run loop sees the divergence.
        let torque_nm = wanted_nm.zip_map(&self.effort_limit_nm, |torque, limit| {
            torque.clamp(-limit, limit)
        });
        ServoOutput {
            torque_nm,
            saturated: std::array::from_fn(|i| torque_nm[i] != wanted_nm[i]),
        }
    }

    /// Torque that the model says a reference needs, N m.
    pub(crate) fn forward_nm(&self, reference: &JointState) -> Joints {
        self.dynamics.inverse_dynamics(
            &reference.position,
            &reference.velocity,
            &reference.acceleration,
        )
    }

    /// That torque with what the gains add, without the clamp, N m.
    pub(crate) fn wanted_nm(
        &self,
        forward_nm: Joints,
        reference: &JointState,
        position: &Joints,
        velocity: &Joints,
    ) -> Joints {
        let kp = Joints::from(self.gains.kp_nm_per_rad);
        let kd = Joints::from(self.gains.kd_nms_per_rad);
        forward_nm
            + kp.component_mul(&(reference.position - position))
            + kd.component_mul(&(reference.velocity - velocity))
    }

    /// The same servo with all gains times a factor.
    pub fn scaled(&self, factor: f64) -> Self {
        Self {
            gains: ServoGains {
                kp_nm_per_rad: self.gains.kp_nm_per_rad.map(|gain| gain * factor),
                kd_nms_per_rad: self.gains.kd_nms_per_rad.map(|gain| gain * factor),
            },
            ..*self
        }
    }

    /// `max_i (2 kd_i h + kp_i h^2) / (4 armature_i)` for a step `h`: below 1 the servo is stable
    /// at every posture, by a bound that takes the arm for its rotors alone.
    ///
    /// Held over a step, `I v' = -kp x - kd v` with semi-implicit Euler has the characteristic
    /// polynomial `z^2 - (2 - a - b) z + (1 - b)`, `a = kp h^2 / I`, `b = kd h / I`, whose roots
    /// are inside the unit circle if `a + 2 b < 4` (Jury). The mass matrix exceeds the armature's
    /// diagonal by a positive semi-definite matrix, so the worst `I` is the armature.
    ///
    /// Infinite without armature; then only the mass matrix can tell.
    pub fn stability_ratio(&self, timestep_s: f64) -> f64 {
        (0..JOINT_COUNT)
            .map(|i| {
                let (kp, kd) = (self.gains.kp_nm_per_rad[i], self.gains.kd_nms_per_rad[i]);
                (2.0 * kd * timestep_s + kp * timestep_s.powi(2))
                    / (4.0 * self.dynamics.armature_kgm2[i])
            })
            .fold(0.0, f64::max)
    }

    /// Refuses gains and limits that are negative or not finite.
    pub(crate) fn check(&self) -> Result<(), EngineError> {
        let gains = [
            ("kp_nm_per_rad", self.gains.kp_nm_per_rad),
            ("kd_nms_per_rad", self.gains.kd_nms_per_rad),
        ];
        for (key, values) in gains {
            for value in values {
                if !(value >= 0.0 && value.is_finite()) {
                    let expected = "finite and not negative";
                    return Err(EngineError::BadSetting {
                        key,
                        value,
                        expected,
                    });
                }
            }
        }
        for &value in &self.effort_limit_nm {
            // Infinite is a limit that never acts.
            if value <= 0.0 || value.is_nan() {
                let (key, expected) = ("effort_limit_nm", "positive");
                return Err(EngineError::BadSetting {
                    key,
                    value,
                    expected,
                });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn servo() -> Servo {
        let cell = crate::test_cell::ur3(Vec::new());
        Servo {
            dynamics: cell.dynamics(),
            gains: ServoGains::default(),
            effort_limit_nm: cell.robot.limits.efforts_nm(),
        }
    }

    #[test]
    fn without_error_the_torque_is_the_inverse_dynamics() {
        let servo = servo();
        let reference = JointState {
            position: Joints::new(0.1, -1.2, 1.4, -0.3, 0.7, 0.2),
            velocity: Joints::new(0.3, -0.2, 0.1, 0.5, -0.6, 0.4),
            acceleration: Joints::new(0.5, 0.4, -0.6, 0.2, 0.3, -0.1),
        };
        let output = servo.torque(&reference, &reference.position, &reference.velocity);
        let wanted = servo.dynamics.inverse_dynamics(
            &reference.position,
            &reference.velocity,
            &reference.acceleration,
        );
        assert_eq!(
            (output.torque_nm, output.saturated),
            (wanted, [false; JOINT_COUNT])
        );
    }

    #[test]
    fn torque_stops_at_the_effort_limit() {
        let servo = servo();
        let reference = JointState::at_rest(Joints::zeros());
        let output = servo.torque(&reference, &Joints::repeat(1.0), &Joints::zeros());
        assert_eq!(output.saturated, [true; JOINT_COUNT]);
        assert_eq!(output.torque_nm, -servo.effort_limit_nm);
    }

    #[test]
    fn nan_is_handed_on() {
        let servo = servo();
        let reference = JointState::at_rest(Joints::zeros());
        let output = servo.torque(&reference, &Joints::repeat(f64::NAN), &Joints::zeros());
        assert!(output.torque_nm.iter().all(|torque| torque.is_nan()));
    }

    #[test]
    fn default_gains_are_stable_at_one_millisecond() {
        let ratio = servo().stability_ratio(1e-3);
        assert!(ratio < 0.35, "{ratio}");
    }

    /// The bound is sharp for one joint: a rotor alone diverges just above it and settles below.
    #[test]
    fn stability_bound_is_where_a_single_rotor_diverges() {
        let servo = servo();
        // Wrist 1: of the joints the one with the least rotor for its gains.
        let (kp, kd) = (servo.gains.kp_nm_per_rad[3], servo.gains.kd_nms_per_rad[3]);
        let inertia = servo.dynamics.armature_kgm2[3];
        let error_after = |timestep_s: f64| {
            let (mut x, mut v) = (1e-3, 0.0);
            for _ in 0..2000 {
                v -= timestep_s / inertia * (kp * x + kd * v);
                x += timestep_s * v;
            }
            f64::abs(x)
        };
        let mut limit_s = 1e-3;
        while servo.stability_ratio(limit_s) < 1.0 {
            limit_s *= 1.001;
        }
        assert!(error_after(0.98 * limit_s) < 1e-6);
        assert!(error_after(1.02 * limit_s) > 1.0);
    }
}
