//! The servo and the arm at rest as one linear, sampled system: is it stable, and how does noise
//! move it?

use nalgebra::{DMatrix, Matrix6};
use needlebench_kinematics::{JOINT_COUNT, JOINT_LABELS, Joints};

use crate::{Actuation, Servo, UnstableServo};

/// Spectral radius below which motions die out; 1 with a margin for its rounding.
const STABLE: f64 = 1.0 - 1e-7;

/// Bisections for the highest stable factor: a ten-thousandth of the range.
const BISECTIONS: usize = 14;

/// Small motions about a posture at rest: joint errors and speeds, and torques on the way to the
/// motors where there is a delay.
///
/// ```text
/// v' = v - h M^-1 S (kp (x + n) + kd v + sigma_0 x + sigma_1 v)      x' = x + h v'
/// ```
///
/// with the mass matrix `M` (armature included), the encoder's error `n`, the bristles of a friction
/// that sticks, and `S = 1 / (1 + kp C)` for gears of compliance `C`, where they are stiffest, which is nearest to
/// instability: the semi-implicit Euler step of
/// the plants under torques that are held. Gravity's change with the posture is left out: it is a
/// hundredth of the gains.
#[derive(Debug, Clone, PartialEq)]
pub struct ClosedLoop {
    /// State transition of one step.
    transition: DMatrix<f64>,
    /// Response of the state to the encoders' errors, rad.
    from_noise: DMatrix<f64>,
}

impl ClosedLoop {
    /// The loop at a posture with this mass matrix (kg m^2, armature included).
    pub fn new(mass: &Matrix6<f64>, servo: &Servo, actuation: &Actuation, timestep_s: f64) -> Self {
        let n = JOINT_COUNT;
        let kp = Joints::from(servo.gains.kp_nm_per_rad);
        let kd = Joints::from(servo.gains.kd_nms_per_rad);
        let softening = kp
            .component_mul(&actuation.gears.stiffest_rad_per_nm())
            .map(|each| (1.0 + each).recip());
        let (bristle, damping) = actuation.friction.map_or_else(
            || (Joints::zeros(), Joints::zeros()),
            |friction| {
                (
                    friction.bristle_stiffness_nm_per_rad,
                    friction.bristle_damping_nms_per_rad
                        + friction
                            .viscous_nms_per_rad
                            .component_mul(&friction.true_over_nominal),
                )
            },
        );
        let inverse = mass.try_inverse().unwrap_or_else(Matrix6::zeros) * timestep_s;
        let scaled = |diagonal: Joints| {
            inverse * Matrix6::from_diagonal(&diagonal.component_mul(&softening))
        };
        let (by_x, by_v) = (scaled(kp), scaled(kd));
        // What needs no measurement acts at once.
        let (now_x, now_v) = (scaled(bristle), scaled(damping));
        let delay = actuation.delay_steps(timestep_s);
        let size = 2 * n + n * delay;
        let mut transition = DMatrix::zeros(size, size);
        let mut from_noise = DMatrix::zeros(size, n);
        let identity = Matrix6::<f64>::identity();
        let set = |matrix: &mut DMatrix<f64>, row: usize, column: usize, block: &Matrix6<f64>| {
            matrix.view_mut((row, column), (n, n)).copy_from(block);
        };
        // Rows: x, v, then the torques on the way, newest first.
        let mut velocity_x = -now_x;
        let mut velocity_v = identity - now_v;
        let mut velocity_noise = Matrix6::zeros();
        if delay == 0 {
            velocity_x -= by_x;
            velocity_v -= by_v;
            velocity_noise = -by_x;
        } else {
            // Torques are kept as accelerations times the step.
            let newest = 2 * n;
            set(&mut transition, newest, 0, &-by_x);
            set(&mut transition, newest, n, &-by_v);
            set(&mut from_noise, newest, 0, &-by_x);
            for k in 1..delay {
                set(
                    &mut transition,
                    newest + k * n,
                    newest + (k - 1) * n,
                    &identity,
                );
            }
            let oldest = newest + (delay - 1) * n;
            set(&mut transition, n, oldest, &identity);
            set(&mut transition, 0, oldest, &(identity * timestep_s));
        }
        set(&mut transition, n, 0, &velocity_x);
        set(&mut transition, n, n, &velocity_v);
        set(&mut transition, 0, 0, &(identity + velocity_x * timestep_s));
        set(&mut transition, 0, n, &(velocity_v * timestep_s));
        set(&mut from_noise, n, 0, &velocity_noise);
        set(&mut from_noise, 0, 0, &(velocity_noise * timestep_s));
        Self {
            transition,
            from_noise,
        }
    }

    /// Largest magnitude of an eigenvalue: below 1 every motion dies out.
    ///
    /// Gelfand's formula by squaring, `|A^n|^(1/n)` with `n = 2^32`: within 1e-8 of it even where
    /// eigenvalues are defective, as those of a delay are, on which QR iterations may not end.
    pub fn spectral_radius(&self) -> f64 {
        const SQUARINGS: i32 = 32;
        let mut power = self.transition.clone();
        let mut logarithm = 0.0;
        for k in 0..=SQUARINGS {
            let size = power.norm();
            if size == 0.0 {
                return 0.0;
            }
            if !size.is_finite() {
                return f64::INFINITY;
            }
            logarithm += libm::log(size) / 2.0_f64.powi(k);
            power /= size;
            if k < SQUARINGS {
                power = &power * &power;
            }
        }
        libm::exp(logarithm)
    }

    /// Covariance of the joints at rest under independent errors of the encoders, rad^2;
    /// `noise_rad` are their standard deviations. None if the loop is unstable.
    ///
    /// Solves `P = A P A^T + Q` by doubling (Smith, SIAM J. Applied Mathematics 16(1), 1968).
    pub fn joint_covariance(&self, noise_rad: &Joints) -> Option<Matrix6<f64>> {
        /// 2^24 steps.
        const DOUBLINGS: usize = 24;
        let spread = DMatrix::from_diagonal(&nalgebra::DVector::from_iterator(
            JOINT_COUNT,
            noise_rad.iter().map(|each| each * each),
        ));
        let mut power = self.transition.clone();
        let mut sum = &self.from_noise * spread * self.from_noise.transpose();
        for _ in 0..DOUBLINGS {
            let added = &power * &sum * power.transpose();
            let (gained, known) = (added.amax(), sum.amax());
            if !gained.is_finite() || known > 1e12 {
                return None;
            }
            sum += added;
            if gained <= 1e-17 * known {
                return Some(
                    sum.fixed_view::<JOINT_COUNT, JOINT_COUNT>(0, 0)
                        .into_owned(),
                );
            }
            power = &power * &power;
        }
        None
    }

    /// One step of the small motion `state` under encoder errors, rad; the first six values are the
    /// joints' errors. Start from [`ClosedLoop::at_rest`].
    pub fn step(
        &self,
        state: &nalgebra::DVector<f64>,
        noise_rad: &Joints,
    ) -> nalgebra::DVector<f64> {
        let noise = nalgebra::DVector::from_column_slice(noise_rad.as_slice());
        &self.transition * state + &self.from_noise * noise
    }

    /// No motion.
    pub fn at_rest(&self) -> nalgebra::DVector<f64> {
        nalgebra::DVector::zeros(self.transition.nrows())
    }

    /// Says whether the loop is unstable at a posture, why, and what would be stable.
    pub(crate) fn instability(
        mass: &Matrix6<f64>,
        servo: &Servo,
        actuation: &Actuation,
        timestep_s: f64,
    ) -> Option<UnstableServo> {
        let made = Self::new(mass, servo, actuation, timestep_s);
        let growth = made.spectral_radius();
        if growth < STABLE {
            return None;
        }
        let stable_at = |factor: f64, step_s: f64| {
            Self::new(mass, &servo.scaled(factor), actuation, step_s).spectral_radius() < STABLE
        };
        let highest = |stable: &dyn Fn(f64) -> bool, top: f64| {
            let (mut low, mut high) = (0.0, top);
            for _ in 0..BISECTIONS {
                let middle = 0.5 * (low + high);
                if stable(middle) {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            (low > 0.0).then_some(low)
        };
        Some(UnstableServo {
            growth,
            joint: made.fastest_growing_joint(),
            stable_factor: highest(&|factor| stable_at(factor, timestep_s), 1.0),
            stable_timestep_s: highest(&|step_s| stable_at(1.0, step_s), timestep_s),
        })
    }

    /// Joint that moves most in the motion that grows fastest, by power iteration.
    fn fastest_growing_joint(&self) -> &'static str {
        let mut state = nalgebra::DVector::from_element(self.transition.nrows(), 1.0);
        for _ in 0..1000 {
            state = &self.transition * state;
            let size = state.amax();
            if size > 0.0 {
                state /= size;
            }
        }
        JOINT_LABELS[state.rows(0, JOINT_COUNT).icamax()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{JointFriction, ServoGains};
    use nalgebra::{Complex, ComplexField as _};
    use needlebench_numerics::random::SplitMix64;

    const POSTURE: Joints = Joints::new(0.3, -1.2, 1.4, -0.3, 0.7, 0.2);

    fn servo() -> Servo {
        let cell = crate::test_cell::ur3(Vec::new());
        Servo {
            dynamics: cell.dynamics(),
            gains: ServoGains::default(),
            effort_limit_nm: cell.robot.limits.efforts_nm(),
        }
    }

    /// A mass alone: `z^2 - (2 - a - b) z + (1 - b)`, `a = kp h^2 / I`, `b = kd h / I`.
    #[test]
    fn a_single_mass_has_the_roots_of_its_polynomial() {
        let servo = servo();
        let (inertia, h) = (0.4, 1e-3);
        let mass = Matrix6::identity() * inertia;
        let radius = ClosedLoop::new(&mass, &servo, &Actuation::default(), h).spectral_radius();
        let gains = servo.gains.kp_nm_per_rad.iter();
        let largest = gains.zip(&servo.gains.kd_nms_per_rad).map(|(kp, kd)| {
            let (a, b) = (kp * h * h / inertia, kd * h / inertia);
            let half = Complex::from(0.5 * (2.0 - a - b));
            let root = (half * half - (1.0 - b)).sqrt();
            f64::max((half + root).modulus(), (half - root).modulus())
        });
        let expected = largest.fold(0.0, f64::max);
        assert!((radius - expected).abs() < 1e-8, "{radius} {expected}");
    }

    #[test]
    fn default_gains_are_stable_and_a_hundred_times_are_not() {
        let mut servo = servo();
        let mass = servo.dynamics.mass_matrix(&POSTURE);
        let ideal = Actuation::default();
        assert_eq!(ClosedLoop::instability(&mass, &servo, &ideal, 1e-3), None);
        servo.gains.kp_nm_per_rad = [200_000.0; JOINT_COUNT];
        servo.gains.kd_nms_per_rad = [6000.0; JOINT_COUNT];
        let found = ClosedLoop::instability(&mass, &servo, &ideal, 1e-3).unwrap();
        assert!(found.growth > 1.0);
        // The wrists, where there is little but the armature, set the limit.
        assert!(found.joint.starts_with("wrist"), "{}", found.joint);
        let factor = found.stable_factor.unwrap();
        let at = |factor: f64| {
            ClosedLoop::new(&mass, &servo.scaled(factor), &ideal, 1e-3).spectral_radius()
        };
        assert!(
            at(0.99 * factor) < 1.0 && at(1.01 * factor) > 1.0,
            "{factor}"
        );
    }

    #[test]
    fn a_delay_of_the_torque_takes_stability() {
        let servo = servo();
        let mass = servo.dynamics.mass_matrix(&POSTURE);
        let radius = |delay_s| {
            let actuation = Actuation {
                torque_delay_s: delay_s,
                ..Actuation::default()
            };
            ClosedLoop::new(&mass, &servo, &actuation, 1e-3).spectral_radius()
        };
        assert!(radius(0.0) < 1.0);
        assert!(radius(0.02) > 1.0);
    }

    /// 40 000 steps of which some hundred are independent: 4 standard deviations.
    const SAMPLING: f64 = 0.15;

    #[test]
    fn noise_at_rest_has_the_covariance_of_the_loops_own_motion() {
        let mut servo = servo();
        // With a step of delay, 43 N m s/rad on the wrists' armature is near to unstable.
        servo.gains.kd_nms_per_rad = [20.0; JOINT_COUNT];
        let mass = servo.dynamics.mass_matrix(&POSTURE);
        let friction = JointFriction {
            coulomb_nm: Joints::repeat(1.0),
            stiction_nm: Joints::repeat(1.0),
            stribeck_rad_s: Joints::repeat(0.01),
            viscous_nms_per_rad: Joints::zeros(),
            bristle_stiffness_nm_per_rad: Joints::repeat(20_000.0),
            bristle_damping_nms_per_rad: Joints::repeat(20.0),
            compensation: 0.0,
            true_over_nominal: Joints::repeat(1.0),
        };
        let actuation = Actuation {
            friction: Some(friction),
            torque_delay_s: 1e-3,
            ..Actuation::default()
        };
        let system = ClosedLoop::new(&mass, &servo, &actuation, 1e-3);
        let noise_rad = Joints::repeat(1e-4);
        let expected = system.joint_covariance(&noise_rad).unwrap();
        let mut random = SplitMix64::new(9);
        let mut state = system.at_rest();
        let mut sum = Matrix6::zeros();
        let steps = 40_000;
        for _ in 0..steps {
            // Uniform with the variance of the noise.
            let noise = noise_rad.map(|each| each * 3.0_f64.sqrt() * random.uniform(-1.0, 1.0));
            state = system.step(&state, &noise);
            let x = state.fixed_rows::<JOINT_COUNT>(0);
            sum += x * x.transpose();
        }
        let measured = sum / f64::from(steps);
        for i in 0..JOINT_COUNT {
            let ratio = measured[(i, i)] / expected[(i, i)];
            assert!((ratio - 1.0).abs() < SAMPLING, "{i}: {ratio}");
        }
    }
}
