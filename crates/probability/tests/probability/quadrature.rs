//! Integrals that tests compare with: no code of the crate.

/// Nodes and weights of Gauss and Legendre on (-1, 1), by Newton's method.
fn nodes() -> &'static [(f64, f64)] {
    static NODES: std::sync::OnceLock<Vec<(f64, f64)>> = std::sync::OnceLock::new();
    NODES.get_or_init(|| {
        const COUNT: u32 = 20;
        let n = f64::from(COUNT);
        (0..COUNT)
            .map(|k| {
                let mut x = libm::cos(std::f64::consts::PI * (f64::from(k) + 0.75) / (n + 0.5));
                let mut slope = 1.0;
                for _ in 0..100 {
                    let (mut before, mut value) = (1.0, x);
                    for order in 2..=COUNT {
                        let order = f64::from(order);
                        (before, value) = (
                            value,
                            ((2.0 * order - 1.0) * x * value - (order - 1.0) * before) / order,
                        );
                    }
                    slope = n * (x * value - before) / (x * x - 1.0);
                    x -= value / slope;
                }
                (x, 2.0 / ((1.0 - x * x) * slope * slope))
            })
            .collect()
    })
}

/// Integral over an interval, in so many panels.
pub fn integral(from: f64, to: f64, panels: u32, of: impl Fn(f64) -> f64) -> f64 {
    let width = (to - from) / f64::from(panels);
    let mut sum = 0.0;
    for panel in 0..panels {
        let middle = from + width * (f64::from(panel) + 0.5);
        for (x, weight) in nodes() {
            sum += 0.5 * width * weight * of(middle + 0.5 * width * x);
        }
    }
    sum
}

pub fn below(x: f64) -> f64 {
    0.5 * libm::erfc(-x * std::f64::consts::FRAC_1_SQRT_2)
}

pub fn density(x: f64) -> f64 {
    libm::exp(-0.5 * x * x) / std::f64::consts::TAU.sqrt()
}

/// Of two standard normal variables with a correlation: either is at least its limit.
pub fn either_above(first: f64, second: f64, correlation: f64) -> f64 {
    let rest = (1.0 - correlation * correlation).sqrt();
    if rest < 1e-7 {
        return if correlation > 0.0 {
            below(-first.min(second))
        } else {
            (below(-first) + below(-second)).min(1.0)
        };
    }
    let given = |x: f64| density(x) * below((correlation * x - second) / rest);
    below(-first) + integral(-9.0, first.clamp(-9.0, 9.0), 40, given)
}

/// Normal variables with these means and standard deviations within a disc about the origin.
pub fn in_disc(mean: [f64; 2], sd: [f64; 2], radius: f64) -> f64 {
    integral(
        -std::f64::consts::FRAC_PI_2,
        std::f64::consts::FRAC_PI_2,
        6,
        |angle| {
            let (sine, cosine) = libm::sincos(angle);
            let (x, half) = (radius * sine, radius * cosine);
            let slice = below((half - mean[1]) / sd[1]) - below((-half - mean[1]) / sd[1]);
            density((x - mean[0]) / sd[0]) / sd[0] * slice * half
        },
    )
}

/// The same in a ball.
pub fn in_ball(mean: [f64; 3], sd: [f64; 3], radius: f64) -> f64 {
    if radius <= 0.0 {
        return 0.0;
    }
    integral(
        -std::f64::consts::FRAC_PI_2,
        std::f64::consts::FRAC_PI_2,
        4,
        |angle| {
            let (sine, cosine) = libm::sincos(angle);
            let (x, rest) = (radius * sine, radius * cosine);
            let slice = in_disc([mean[1], mean[2]], [sd[1], sd[2]], rest);
            density((x - mean[0]) / sd[0]) / sd[0] * slice * rest
        },
    )
}

/// Both against closed forms: a round disc (Rayleigh), a round ball (Maxwell), independent and equal variables.
#[test]
fn the_quadrature_is_exact_where_there_are_closed_forms() {
    let disc = in_disc([0.0; 2], [1.5; 2], 2.0);
    assert!(
        (disc + libm::expm1(-0.5 * 16.0 / 9.0)).abs() < 1e-12,
        "{disc}"
    );
    let ball = in_ball([0.0; 3], [1.0; 3], 2.0);
    let exact =
        libm::erf(2.0_f64.sqrt()) - 2.0 * (2.0 / std::f64::consts::PI).sqrt() * libm::exp(-2.0);
    assert!((ball - exact).abs() < 1e-12, "{ball}");
    let both = either_above(1.0, 2.0, 0.0);
    assert!(
        (both - (1.0 - below(1.0) * below(2.0))).abs() < 1e-13,
        "{both}"
    );
    assert!((either_above(2.0, 2.0, 1.0 - 1e-9) - below(-2.0)).abs() < 1e-5);
}
