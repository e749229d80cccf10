//! Integration of smooth, autonomous ordinary differential equations to a stated tolerance.
//!
//! Dormand and Prince's pair of order 8 with embedded orders 5 and 3 (`DOP853`); Hairer, Nørsett,
//! Wanner, *Solving Ordinary Differential Equations I*, 2nd edition, section II.10, whose published
//! coefficients and error estimate these are.

use nalgebra::SVector;

/// Steps that one call may take, rejected ones included; a smooth motion needs one or two.
const MOST_STEPS: u32 = 10_000;

/// The usual caution when the next step is chosen, and by how much it may change.
const SAFETY: f64 = 0.9;
const LEAST_FACTOR: f64 = 0.2;
const MOST_FACTOR: f64 = 5.0;

/// The tolerance could not be satisfied: the solution is not smooth, or not finite.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "no step satisfies the tolerance of {tolerance:e} at {elapsed_s} s of an interval of {interval_s} s"
)]
pub struct NotSmooth {
    /// Allowed error per step.
    pub tolerance: f64,
    /// Where it failed, from the start of the interval, s.
    pub elapsed_s: f64,
    /// The interval, s.
    pub interval_s: f64,
}

/// State after `interval_s` of `y' = slope(y)`.
///
/// `tolerance` bounds the estimated error of each component in each step, relative to the larger of
/// 1 and the component; the true error is mostly far smaller, because the estimate is of order 5 and
/// the result of order 8. The first step tried is the whole interval: calls with short intervals,
/// as between two samples of a controller, cost one step of 12 evaluations.
///
/// Measured order: 8.0 (`the_order_is_eight`). Same input, same bytes.
pub fn integrate<const N: usize>(
    slope: impl Fn(&SVector<f64, N>) -> SVector<f64, N>,
    start: &SVector<f64, N>,
    interval_s: f64,
    tolerance: f64,
) -> Result<SVector<f64, N>, NotSmooth> {
    let mut state = *start;
    let mut elapsed_s = 0.0;
    let mut step_s = interval_s;
    for _ in 0..MOST_STEPS {
        let remaining_s = interval_s - elapsed_s;
        let is_last = step_s >= remaining_s;
        let taken_s = if is_last { remaining_s } else { step_s };
        let (next, error) = step(&slope, &state, taken_s, tolerance);
        // An error of NaN refuses the step and shortens it as far as allowed.
        let is_good = error <= 1.0;
        if is_good {
            state = next;
            elapsed_s += taken_s;
            if is_last {
                return Ok(state);
            }
        }
        let factor = SAFETY * libm::pow(error, -1.0 / 8.0);
        step_s = taken_s
            * if factor.is_nan() {
                LEAST_FACTOR
            } else {
                factor.clamp(LEAST_FACTOR, if is_good { MOST_FACTOR } else { 1.0 })
            };
        if elapsed_s + step_s == elapsed_s {
            break;
        }
    }
    Err(NotSmooth {
        tolerance,
        elapsed_s,
        interval_s,
    })
}

/// One step, and its estimated error as a multiple of the tolerance.
fn step<const N: usize>(
    slope: &impl Fn(&SVector<f64, N>) -> SVector<f64, N>,
    start: &SVector<f64, N>,
    step_s: f64,
    tolerance: f64,
) -> (SVector<f64, N>, f64) {
    let mut slopes = [SVector::<f64, N>::zeros(); STAGES.len() + 1];
    slopes[0] = slope(start);
    for (i, weights) in STAGES.iter().enumerate() {
        let at = start + weighted(weights, &slopes) * step_s;
        slopes[i + 1] = slope(&at);
    }
    let next = start + weighted(&RESULT, &slopes) * step_s;
    let scale = start.zip_map(&next, |a, b| tolerance * a.abs().max(b.abs()).max(1.0));
    let of_order_5 = weighted(&ERROR_5, &slopes).component_div(&scale).amax();
    let of_order_3 = weighted(&ERROR_3, &slopes).component_div(&scale).amax();
    let sum = of_order_5.powi(2) + 0.01 * of_order_3.powi(2);
    // `amax` passes over NaN.
    let error = if next.iter().any(|value| !value.is_finite()) {
        f64::NAN
    } else if sum == 0.0 {
        0.0
    } else {
        step_s.abs() * of_order_5.powi(2) / sum.sqrt()
    };
    (next, error)
}

fn weighted<const N: usize>(
    weights: &[(usize, f64)],
    slopes: &[SVector<f64, N>],
) -> SVector<f64, N> {
    let mut sum = SVector::<f64, N>::zeros();
    for &(stage, weight) in weights {
        sum.axpy(weight, &slopes[stage], 1.0);
    }
    sum
}

/// Weights of the earlier slopes in each stage, zeros left out: stage `i + 1` starts from
/// `y + h sum(a k_j)`.
const STAGES: [&[(usize, f64)]; 11] = [
    &[(0, 0.05260015195876773)],
    &[(0, 0.0197250569845379), (1, 0.0591751709536137)],
    &[(0, 0.02958758547680685), (2, 0.08876275643042054)],
    &[
        (0, 0.2413651341592667),
        (2, -0.8845494793282861),
        (3, 0.924834003261792),
    ],
    &[
        (0, 0.037037037037037035),
        (3, 0.17082860872947386),
        (4, 0.12546768756682242),
    ],
    &[
        (0, 0.037109375),
        (3, 0.17025221101954405),
        (4, 0.06021653898045596),
        (5, -0.017578125),
    ],
    &[
        (0, 0.03709200011850479),
        (3, 0.17038392571223998),
        (4, 0.10726203044637328),
        (5, -0.015319437748624402),
        (6, 0.008273789163814023),
    ],
    &[
        (0, 0.6241109587160757),
        (3, -3.3608926294469414),
        (4, -0.868219346841726),
        (5, 27.59209969944671),
        (6, 20.154067550477894),
        (7, -43.48988418106996),
    ],
    &[
        (0, 0.47766253643826434),
        (3, -2.4881146199716677),
        (4, -0.590290826836843),
        (5, 21.230051448181193),
        (6, 15.279233632882423),
        (7, -33.28821096898486),
        (8, -0.020331201708508627),
    ],
    &[
        (0, -0.9371424300859873),
        (3, 5.186372428844064),
        (4, 1.0914373489967295),
        (5, -8.149787010746927),
        (6, -18.52006565999696),
        (7, 22.739487099350505),
        (8, 2.4936055526796523),
        (9, -3.0467644718982196),
    ],
    &[
        (0, 2.273310147516538),
        (3, -10.53449546673725),
        (4, -2.0008720582248625),
        (5, -17.9589318631188),
        (6, 27.94888452941996),
        (7, -2.8589982771350235),
        (8, -8.87285693353063),
        (9, 12.360567175794303),
        (10, 0.6433927460157636),
    ],
];

/// Weights of the slopes in the result, order 8.
const RESULT: [(usize, f64); 8] = [
    (0, 0.054293734116568765),
    (5, 4.450312892752409),
    (6, 1.8915178993145003),
    (7, -5.801203960010585),
    (8, 0.3111643669578199),
    (9, -0.1521609496625161),
    (10, 0.20136540080403034),
    (11, 0.04471061572777259),
];

/// Difference of the result from an embedded one of order 3.
const ERROR_3: [(usize, f64); 8] = [
    (0, -0.18980075407240762),
    (5, 4.450312892752409),
    (6, 1.8915178993145003),
    (7, -5.801203960010585),
    (8, -0.4226823213237919),
    (9, -0.1521609496625161),
    (10, 0.20136540080403034),
    (11, 0.02265179219836082),
];

/// Difference of the result from an embedded one of order 5.
const ERROR_5: [(usize, f64); 8] = [
    (0, 0.01312004499419488),
    (5, -1.2251564463762044),
    (6, -0.4957589496572502),
    (7, 1.6643771824549864),
    (8, -0.35032884874997366),
    (9, 0.3341791187130175),
    (10, 0.08192320648511571),
    (11, -0.022355307863886294),
];
#[cfg(test)]
mod tests {
    use nalgebra::{Vector1, Vector2};

    use super::*;

    /// Some roundings of sums of numbers below 10.
    const ROUNDING: f64 = 1e-14;

    /// Sums of the weights of each stage: the time within the step that it stands for.
    fn nodes() -> [f64; 12] {
        let mut nodes = [0.0; 12];
        for (i, weights) in STAGES.iter().enumerate() {
            nodes[i + 1] = weights.iter().map(|(_, weight)| weight).sum();
        }
        nodes
    }

    #[test]
    fn the_weights_integrate_polynomials_of_degree_seven() {
        let nodes = nodes();
        for power in 0..8 {
            let sum: f64 = RESULT
                .iter()
                .map(|&(stage, weight)| weight * nodes[stage].powi(power))
                .sum();
            let exact = 1.0 / f64::from(power + 1);
            assert!((sum - exact).abs() < ROUNDING, "{power}: {sum}");
        }
        // The embedded orders: the differences vanish up to degree 2 and 4.
        for (error, degree) in [(&ERROR_3[..], 2), (&ERROR_5[..], 4)] {
            for power in 0..=degree {
                let sum: f64 = error
                    .iter()
                    .map(|&(stage, weight)| weight * nodes[stage].powi(power))
                    .sum();
                assert!(sum.abs() < ROUNDING, "{degree} {power}: {sum}");
            }
        }
    }

    /// A nonlinear oscillator, with its energy's derivative zero: `x'' = -sin x`.
    fn pendulum(state: &Vector2<f64>) -> Vector2<f64> {
        Vector2::new(state.y, -libm::sin(state.x))
    }

    #[test]
    fn the_order_is_eight() {
        let start = Vector2::new(2.0, 0.3);
        let after = |steps: u32| {
            let mut state = start;
            for _ in 0..steps {
                state = step(&pendulum, &state, 4.0 / f64::from(steps), 1.0).0;
            }
            state
        };
        let exact = after(128);
        let coarse = (after(8) - exact).norm();
        let fine = (after(16) - exact).norm();
        let order = libm::log2(coarse / fine);
        assert!((7.5..9.0).contains(&order), "{order}");
    }

    #[test]
    fn the_tolerance_is_kept() {
        let start = Vector2::new(2.0, 0.3);
        let energy = |state: &Vector2<f64>| 0.5 * state.y.powi(2) - libm::cos(state.x);
        for tolerance in [1e-6, 1e-9, 1e-12] {
            let end = integrate(pendulum, &start, 20.0, tolerance).unwrap();
            // Some thirty steps, whose errors add up at worst.
            let error = (energy(&end) - energy(&start)).abs();
            assert!(error < 30.0 * tolerance, "{tolerance:e}: {error:e}");
        }
    }

    #[test]
    fn what_blows_up_is_an_error() {
        // 1 / (1 - t).
        let error = integrate(
            |state: &Vector1<f64>| state.component_mul(state),
            &Vector1::new(1.0),
            2.0,
            1e-10,
        )
        .unwrap_err();
        assert!((error.elapsed_s - 1.0).abs() < 0.01, "{error}");
        let not_a_number = integrate(|_| Vector1::new(f64::NAN), &Vector1::new(1.0), 1.0, 1e-10);
        assert!(not_a_number.is_err());
    }
}
