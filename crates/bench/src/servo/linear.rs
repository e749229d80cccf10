//! The closed loop of servo and arm for small motions about a posture, in closed form.

use nalgebra::{Complex, ComplexField as _, Matrix6, Vector6};
use needlebench_engine::{Actuation, ClosedLoop, Servo};
use needlebench_kinematics::{JOINT_COUNT, Joints};
use serde::Serialize;

/// Step of the difference quotient of gravity, rad: its error is 1e-10 of the gravity.
const GRADIENT_RAD: f64 = 1e-5;

/// Factors on gains up to which a margin is looked for.
const LARGEST_FACTOR: f64 = 1e3;

/// Bisections of a margin: six digits.
const BISECTIONS: usize = 32;

/// `radius exp(i angle_rad)`.
pub(super) fn polar(radius: f64, angle_rad: f64) -> Complex<f64> {
    let (sine, cosine) = libm::sincos(angle_rad);
    Complex::new(radius * cosine, radius * sine)
}

/// Servo, arm and time step, linear about a posture at rest.
///
/// The semi-implicit Euler step `v' = v + h M^-1 (kp (r - x) + kd (r_v - v) - K x)`, `x' = x + h v'`
/// with the mass matrix `M` (armature included) and the change `K` of gravity with the posture. The
/// feed-forward torque holds the posture.
#[derive(Debug, Clone)]
pub struct Linear {
    mass: Matrix6<f64>,
    gravity_gradient: Matrix6<f64>,
    kp: Joints,
    kd: Joints,
    timestep_s: f64,
}

/// One joint of the closed loop by the textbook: the others stand still.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct JointLoop {
    /// Inertia about the joint with the other joints held, rotor included, kg m^2.
    pub inertia_kgm2: f64,
    /// Undamped natural frequency, Hz.
    pub natural_frequency_hz: f64,
    /// Damping ratio.
    pub damping_ratio: f64,
    /// Frequency at which the response has fallen to 1/sqrt 2, Hz; from the sampled 6-joint loop.
    pub bandwidth_hz: Option<f64>,
    /// Factor on this joint's gains at which the joint alone becomes unstable at this time step.
    pub gain_margin: f64,
}

impl Linear {
    /// Linear about a posture at rest.
    pub fn new(servo: &Servo, posture: &Joints, timestep_s: f64) -> Self {
        let mut gravity_gradient = Matrix6::zeros();
        for joint in 0..JOINT_COUNT {
            let mut ends = [*posture; 2];
            ends[0][joint] -= GRADIENT_RAD;
            ends[1][joint] += GRADIENT_RAD;
            let [low, high] = ends.map(|q| servo.dynamics.gravity_torque(&q));
            gravity_gradient.set_column(joint, &((high - low) / (2.0 * GRADIENT_RAD)));
        }
        Self {
            mass: servo.dynamics.mass_matrix(posture),
            gravity_gradient,
            kp: servo.gains.kp_nm_per_rad.into(),
            kd: servo.gains.kd_nms_per_rad.into(),
            timestep_s,
        }
    }

    /// Motion of a joint over a sinusoidal set-point of that joint, whose speed is given to the
    /// servo half a step late, as every run gives it.
    ///
    /// With `z = exp(i w h)` and `s = (z - 1) / h`: `(s^2/z M + s/z Kd + Kp + K) X = Kp R + Kd R_v`.
    pub fn response(&self, joint: usize, frequency_hz: f64) -> Complex<f64> {
        let omega = std::f64::consts::TAU * frequency_hz;
        let h = self.timestep_s;
        let z = polar(1.0, omega * h);
        let s = (z - 1.0) / h;
        let complex = |value: f64| Complex::new(value, 0.0);
        let mut matrix = self.mass.map(complex) * (s * s / z)
            + self.gravity_gradient.map(complex)
            + Matrix6::from_diagonal(&self.kp.map(complex));
        matrix += Matrix6::from_diagonal(&self.kd.map(complex)) * (s / z);
        let mut wanted = Vector6::zeros();
        wanted[joint] = complex(self.kp[joint])
            + polar(self.kd[joint] * omega, -0.5 * omega * h) * Complex::i();
        // A singular matrix is a resonance without damping.
        matrix
            .lu()
            .solve(&wanted)
            .map_or(complex(f64::INFINITY), |motion| motion[joint])
    }

    /// Course of a joint after a step of its set-point by 1, one value per time step from 0; the
    /// torque of the servo beside it, N m/rad.
    pub(crate) fn step_response(&self, joint: usize, steps: usize) -> Vec<f64> {
        let inverse = self.mass.try_inverse().unwrap_or_else(Matrix6::zeros);
        let (mut x, mut v) = (Joints::zeros(), Joints::zeros());
        let mut reference = Joints::zeros();
        reference[joint] = 1.0;
        // The feed-forward of the servo holds the new set-point.
        let held = self.gravity_gradient * reference;
        let mut course = vec![0.0];
        for _ in 0..steps {
            let torque = held + self.kp.component_mul(&(reference - x))
                - self.kd.component_mul(&v)
                - self.gravity_gradient * x;
            v += inverse * torque * self.timestep_s;
            x += v * self.timestep_s;
            course.push(x[joint]);
        }
        course
    }

    /// Closed loop of one joint, the others held.
    pub fn joint(&self, joint: usize) -> JointLoop {
        let inertia = self.mass[(joint, joint)];
        let (kp, kd, h) = (self.kp[joint], self.kd[joint], self.timestep_s);
        JointLoop {
            inertia_kgm2: inertia,
            natural_frequency_hz: (kp / inertia).sqrt() / std::f64::consts::TAU,
            damping_ratio: 0.5 * kd / (kp * inertia).sqrt(),
            bandwidth_hz: self.bandwidth_hz(joint),
            // See `Servo::stability_ratio`.
            gain_margin: 4.0 * inertia / (2.0 * kd * h + kp * h * h),
        }
    }

    fn bandwidth_hz(&self, joint: usize) -> Option<f64> {
        const DECADE_POINTS: i32 = 40;
        let fallen = |hz: f64| self.response(joint, hz).modulus() < std::f64::consts::FRAC_1_SQRT_2;
        let nyquist_hz = 0.5 / self.timestep_s;
        let points =
            (0..).map(|k| 0.1 * libm::pow(10_f64, f64::from(k) / f64::from(DECADE_POINTS)));
        let beyond = points
            .take_while(|hz| *hz < nyquist_hz)
            .find(|hz| fallen(*hz))?;
        let (mut low, mut high) = (
            beyond * libm::pow(10_f64, -1.0 / f64::from(DECADE_POINTS)),
            beyond,
        );
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            if fallen(middle) {
                high = middle;
            } else {
                low = middle;
            }
        }
        Some(high)
    }
}

/// Stability of all joints together.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Margins {
    /// Decay of the slowest motion per step; stable below 1.
    pub spectral_radius: f64,
    /// Factor on all gains up to which the loop stays stable.
    pub gain_factor: Option<f64>,
    /// Time step up to which the loop stays stable with these gains, s.
    pub timestep_s: Option<f64>,
}

impl Margins {
    /// Margins of gains and time step about a posture.
    pub fn new(servo: &Servo, posture: &Joints, timestep_s: f64) -> Self {
        let mass = servo.dynamics.mass_matrix(posture);
        let ideal = Actuation::default();
        let radius = |factor: f64, step_s: f64| {
            ClosedLoop::new(&mass, &servo.scaled(factor), &ideal, step_s).spectral_radius()
        };
        Self {
            spectral_radius: radius(1.0, timestep_s),
            gain_factor: last_stable(|factor| radius(factor, timestep_s) < 1.0),
            timestep_s: last_stable(|factor| radius(1.0, timestep_s * factor) < 1.0)
                .map(|factor| factor * timestep_s),
        }
    }
}

/// Largest factor from 1 upwards that is stable; none if 1 is not, or if all are.
fn last_stable(stable: impl Fn(f64) -> bool) -> Option<f64> {
    if !stable(1.0) {
        return None;
    }
    let mut high = 1.0;
    while stable(high) {
        high *= 1.5;
        if high > LARGEST_FACTOR {
            return None;
        }
    }
    let mut low = high / 1.5;
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        if stable(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    Some(low)
}

#[cfg(test)]
mod tests {
    use needlebench_engine::ServoGains;
    use needlebench_scenario::{Overrides, load_scenario};

    use super::*;

    const TIMESTEP_S: f64 = 1e-3;

    fn linear() -> (Servo, Joints, Linear) {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/table3.toml");
        let scenario = load_scenario(path.as_ref(), &Overrides::default()).unwrap();
        let servo = Servo {
            dynamics: scenario.cell.dynamics(),
            gains: ServoGains::default(),
            effort_limit_nm: scenario.cell.robot.limits.efforts_nm(),
        };
        let linear = Linear::new(&servo, &scenario.start, TIMESTEP_S);
        (servo, scenario.start, linear)
    }

    /// Of the amplitude: what is left of the transient after 2 s, and rounding.
    const STEADY: f64 = 1e-9;

    /// The closed form in `z` against the recursion that it stands for.
    #[test]
    fn sine_settles_at_the_closed_form() {
        let (_, _, linear) = linear();
        let inverse = linear.mass.try_inverse().unwrap();
        let (joint, hz) = (1, 8.0);
        let omega = std::f64::consts::TAU * hz;
        let expected = linear.response(joint, hz);
        let (mut x, mut v) = (Joints::zeros(), Joints::zeros());
        let mut worst: f64 = 0.0;
        for step in 0..3000 {
            let time_s = f64::from(step) * TIMESTEP_S;
            if time_s > 2.0 {
                let steady = (expected * polar(1.0, omega * time_s)).im;
                worst = worst.max((x[joint] - steady).abs());
            }
            let (mut reference, mut speed) = (Joints::zeros(), Joints::zeros());
            reference[joint] = libm::sin(omega * time_s);
            speed[joint] = omega * libm::cos(omega * (time_s - 0.5 * TIMESTEP_S));
            let torque = linear.kp.component_mul(&(reference - x))
                + linear.kd.component_mul(&(speed - v))
                - linear.gravity_gradient * x;
            v += inverse * torque * TIMESTEP_S;
            x += v * TIMESTEP_S;
        }
        assert!(worst < STEADY, "{worst:e}");
    }

    #[test]
    fn slow_motions_are_followed_and_fast_ones_are_not() {
        let (_, _, linear) = linear();
        for joint in 0..JOINT_COUNT {
            let slow = linear.response(joint, 0.01).modulus();
            // Gravity bends the servo by its gradient over kp.
            assert!((slow - 1.0).abs() < 0.03, "{joint}: {slow}");
            let bandwidth_hz = linear.joint(joint).bandwidth_hz.unwrap();
            let there = linear.response(joint, bandwidth_hz).modulus();
            assert!((there - std::f64::consts::FRAC_1_SQRT_2).abs() < 1e-6);
            let beyond = linear.response(joint, 1.2 * bandwidth_hz).modulus();
            assert!(beyond < 0.95 * there, "{joint}: {beyond}");
        }
    }

    #[test]
    fn margins_are_where_stability_ends() {
        let (servo, posture, _) = linear();
        let margins = Margins::new(&servo, &posture, TIMESTEP_S);
        assert!(margins.spectral_radius < 1.0);
        let step_s = margins.timestep_s.unwrap();
        for (factor, stable) in [(0.999, true), (1.001, false)] {
            let there = Margins::new(&servo, &posture, factor * step_s);
            assert_eq!(there.spectral_radius < 1.0, stable, "{factor}");
        }
        let factor = margins.gain_factor.unwrap();
        let servo = servo.scaled(1.001 * factor);
        let beyond = Margins::new(&servo, &posture, TIMESTEP_S);
        assert!(beyond.spectral_radius > 1.0);
        assert_eq!((beyond.gain_factor, beyond.timestep_s), (None, None));
    }
}
