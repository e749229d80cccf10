//! A joint under a proportional-derivative servo that is given a step.

use nalgebra::{Matrix2, Vector2, Vector3};
use needlebench_engine::Plant;
use needlebench_kinematics::Joints;

use super::mechanism::{Mechanism, RESTING_KGM2};
use super::{referee, with_engines};

const TIMESTEP_S: f64 = 1e-3;
const DURATION_S: f64 = 1.0;
const STEP_RAD: f64 = 0.3;
const KP_NM_RAD: f64 = 200.0;
const KD_NMS_RAD: f64 = 6.0;

/// Difference from the discrete closed form: rounding over 1000 steps; 3e-15 is seen in rapier.
const DISCRETE_RAD: f64 = 1e-12;

fn mechanism() -> Mechanism {
    Mechanism {
        free_joints: vec![Vector3::z_axis()],
        lever_m: 0.5,
        ball_kg: 2.0,
        // Along the axis, where it does nothing.
        gravity_m_s2: Vector3::new(0.0, 0.0, -9.81),
        has_table: false,
        resting_kgm2: RESTING_KGM2,
    }
}

/// `q` and `q'` at `t` of `I q'' = kp (step - q) - kd q'` from rest, underdamped.
fn continuous(moment_kgm2: f64, t: f64) -> Vector2<f64> {
    let rate = (KP_NM_RAD / moment_kgm2).sqrt();
    let damping = 0.5 * KD_NMS_RAD / (moment_kgm2 * KP_NM_RAD).sqrt();
    let damped = rate * (1.0 - damping * damping).sqrt();
    let (sine, cosine) = libm::sincos(damped * t);
    let envelope = STEP_RAD * libm::exp(-damping * rate * t);
    Vector2::new(
        STEP_RAD - envelope * (cosine + damping * rate / damped * sine),
        envelope * rate * rate / damped * sine,
    )
}

/// Power of a 2 x 2 matrix by Sylvester's formula from its pair of complex eigenvalues
/// `r exp(+-i phi)`: `r^(n-1) (sin(n phi) M - r sin((n-1) phi) 1) / sin phi`.
fn power(matrix: &Matrix2<f64>, n: f64) -> Matrix2<f64> {
    let modulus = matrix.determinant().sqrt();
    let phi = {
        let cosine = 0.5 * matrix.trace() / modulus;
        libm::atan2((1.0 - cosine * cosine).sqrt(), cosine)
    };
    (matrix * libm::sin(n * phi) - Matrix2::identity() * (modulus * libm::sin((n - 1.0) * phi)))
        * (libm::pow(modulus, n - 1.0) / libm::sin(phi))
}

/// Largest differences of the position from `discrete^n (-step, 0)` and from the continuous answer.
fn worst(plant: &mut dyn Plant, moment_kgm2: f64, discrete: &Matrix2<f64>) -> [f64; 2] {
    let mut state = plant.reset(&Joints::zeros()).unwrap();
    let mut worst = [0.0_f64; 2];
    let timestep_s = plant.timestep_s();
    // A hundredth of a step is no step.
    for k in (1..).take_while(|k| f64::from(*k) * timestep_s < DURATION_S + 0.01 * timestep_s) {
        let mut torque = Joints::zeros();
        torque[0] = KP_NM_RAD * (STEP_RAD - state.position[0]) - KD_NMS_RAD * state.velocity[0];
        state = plant.step(&torque).unwrap();
        let deviation = power(discrete, f64::from(k)) * Vector2::new(-STEP_RAD, 0.0);
        let by_sampling = (state.position[0] - (STEP_RAD + deviation.x)).abs();
        let exact = continuous(moment_kgm2, f64::from(k) * timestep_s).x;
        worst[0] = worst[0].max(by_sampling);
        worst[1] = worst[1].max((state.position[0] - exact).abs());
    }
    worst
}

#[test]
fn a_servo_step_is_the_closed_form_of_its_sampling() {
    let mechanism = mechanism();
    let moment = mechanism.moment_kgm2();
    let cell = mechanism.cell();
    let matrices = |h: f64| {
        let (a, b) = (KP_NM_RAD * h / moment, KD_NMS_RAD * h / moment);
        // Deviation and velocity over one step: v' = v - a x - b v; x' = x + h v'.
        let euler = Matrix2::new(1.0 - h * a, h - h * b, -a, 1.0 - b);
        // Exact under the held torque: x' = x + h v - h (a x + b v) / 2.
        let held = Matrix2::new(1.0 - 0.5 * h * a, h - 0.5 * h * b, -a, 1.0 - b);
        (euler, held)
    };
    let half_s = 0.5 * TIMESTEP_S;
    let mut continuous_errors = [0.0; 2];
    for (which, h) in [TIMESTEP_S, half_s].into_iter().enumerate() {
        let [sampled, error] = worst(&mut referee(&cell, h), moment, &matrices(h).1);
        println!(
            "servo step, {h} s: referee {sampled:.1e} rad, from the unsampled {error:.3e} rad"
        );
        assert!(sampled < DISCRETE_RAD, "{sampled:e}");
        continuous_errors[which] = error;
    }
    // Holding a torque delays it by half a step: first order.
    let order = libm::log2(continuous_errors[0] / continuous_errors[1]);
    assert!((order - 1.0).abs() < 0.05, "{order}");
    with_engines(&cell, TIMESTEP_S, 0.0, |name, plant| {
        let [sampled, error] = worst(plant, moment, &matrices(TIMESTEP_S).0);
        println!("    {name}: {sampled:.1e} rad, from the unsampled {error:.3e} rad");
        assert!(sampled < DISCRETE_RAD, "{sampled:e}");
        // The error of a damped oscillation cannot exceed what a whole step's motion is.
        let fastest = STEP_RAD * (KP_NM_RAD / moment).sqrt();
        assert!(error < TIMESTEP_S * fastest, "{error:e}");
    });
}
