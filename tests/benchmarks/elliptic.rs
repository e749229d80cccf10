//! The exact pendulum: Jacobi's elliptic functions by the arithmetic-geometric mean.

/// Landen steps; the mean converges quadratically, to rounding in five or six.
const STEPS: usize = 8;

/// Complete elliptic integral of the first kind of the modulus `k`.
fn complete(k: f64) -> f64 {
    let (mut a, mut b) = (1.0_f64, (1.0 - k * k).sqrt());
    for _ in 0..STEPS {
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
    }
    std::f64::consts::FRAC_PI_2 / a
}

/// `sn(u, k)` and the amplitude's cosine `cn(u, k)`.
///
/// Abramowitz and Stegun, *Handbook of Mathematical Functions*, 16.4.
fn sn_cn(u: f64, k: f64) -> (f64, f64) {
    let mut a = [0.0; STEPS + 1];
    let mut c = [0.0; STEPS + 1];
    let mut b = (1.0 - k * k).sqrt();
    (a[0], c[0]) = (1.0, k);
    for n in 0..STEPS {
        a[n + 1] = 0.5 * (a[n] + b);
        c[n + 1] = 0.5 * (a[n] - b);
        b = (a[n] * b).sqrt();
    }
    let mut amplitude = f64::from(1_u32 << STEPS) * a[STEPS] * u;
    for n in (1..=STEPS).rev() {
        let sine = (c[n] / a[n] * libm::sin(amplitude)).clamp(-1.0, 1.0);
        amplitude = 0.5 * (amplitude + libm::atan2(sine, (1.0 - sine * sine).sqrt()));
    }
    libm::sincos(amplitude)
}

/// Angle from the lowest point at time `t_s` of a pendulum released at rest from `start_rad`, with
/// the small-swing frequency `rate_rad_s = sqrt(m g l / I)`.
///
/// `sin(angle / 2) = k sn(K - rate t)`, `k = sin(start / 2)`.
pub fn pendulum_rad(start_rad: f64, rate_rad_s: f64, t_s: f64) -> f64 {
    let k = libm::sin(0.5 * start_rad);
    let (sn, _) = sn_cn(complete(k) - rate_rad_s * t_s, k);
    let sine = k * sn;
    2.0 * libm::atan2(sine, (1.0 - sine * sine).sqrt())
}

#[test]
fn the_exact_pendulum_obeys_its_equation() {
    let (start, rate) = (2.5, 3.0);
    // Released at rest, and back after the period 4 K / rate.
    assert!((pendulum_rad(start, rate, 0.0) - start).abs() < 1e-14);
    let period = 4.0 * complete(libm::sin(0.5 * start)) / rate;
    assert!((pendulum_rad(start, rate, period) - start).abs() < 1e-13);
    // Second differences: 1e-4 truncation, 1e-16 / 1e-8 rounding.
    let step = 1e-4;
    for k in 1..40 {
        let t = 0.05 * f64::from(k);
        let [before, at, after] = [t - step, t, t + step].map(|t| pendulum_rad(start, rate, t));
        let acceleration = (before - 2.0 * at + after) / (step * step);
        let residual = acceleration + rate * rate * libm::sin(at);
        assert!(residual.abs() < 1e-6, "{t}: {residual:e}");
    }
}
