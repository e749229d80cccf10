//! Moments of how far the breath has moved.

use needlebench_scenario::imperfections::Breathing;

/// Mean and variance of `level + sin^4(pi phase)`: of the shape by its Fourier series under a normal or uniform phase.
///
/// Exact, as the level is independent of phase and failed holds.
pub(super) fn breath_moments(breathing: &Breathing) -> (f64, f64) {
    /// `sin^4 x = 3/8 - 1/2 cos 2x + 1/8 cos 4x`.
    const FOURTH: [f64; 5] = [3.0 / 8.0, -0.5, 0.125, 0.0, 0.0];
    /// `sin^8 x = 35/128 - 7/16 cos 2x + 7/32 cos 4x - 1/16 cos 6x + 1/128 cos 8x`.
    const EIGHTH: [f64; 5] = [
        35.0 / 128.0,
        -7.0 / 16.0,
        7.0 / 32.0,
        -1.0 / 16.0,
        1.0 / 128.0,
    ];
    let mean = |series: &[f64; 5]| -> f64 {
        series
            .iter()
            .enumerate()
            .map(|(k, coefficient)| {
                let rate = std::f64::consts::TAU * k as f64;
                let expected = match breathing.phase_spread {
                    // E cos(a (m + s z)) = cos(a m) exp(-(a s)^2 / 2)
                    Some(spread) => {
                        libm::cos(rate * breathing.phase)
                            * libm::exp(-0.5 * (rate * spread).powi(2))
                    }
                    None if k == 0 => 1.0,
                    None => 0.0,
                };
                coefficient * expected
            })
            .sum()
    };
    // Holds that fail are at any phase.
    let any = |series: &[f64; 5]| {
        let failed = breathing.hold_failure;
        (1.0 - failed) * mean(series) + failed * series[0]
    };
    let first = any(&FOURTH);
    let of_shape = (any(&EIGHTH) - first * first).max(0.0);
    let variance = breathing
        .level_sd
        .map_or(of_shape, |level_sd| level_sd * level_sd + of_shape);
    (first, variance)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    /// Mean of 2e5 equal steps, of a smooth function: rounding.
    const QUADRATURE: f64 = 1e-9;

    #[test]
    fn moments_of_the_breath_are_those_of_a_quadrature() {
        for (phase_spread, hold_failure) in [(Some(0.08), 0.0), (Some(0.3), 0.0), (None, 0.0)] {
            let breathing = Breathing {
                skin_m: Vector3::zeros(),
                target_m: Vector3::zeros(),
                period_s: 4.0,
                phase: 0.1,
                phase_spread,
                hold_failure,
                level_sd: None,
                is_level_measured: false,
                drift_m: None,
            };
            let (mut weight, mut first, mut second) = (0.0, 0.0, 0.0);
            let steps = 200_000;
            for k in 0..steps {
                let u = (f64::from(k) + 0.5) / f64::from(steps);
                let (phase, density) = match phase_spread {
                    Some(spread) => {
                        let z = 16.0 * u - 8.0;
                        (0.1 + spread * z, libm::exp(-0.5 * z * z))
                    }
                    None => (u, 1.0),
                };
                let share = crate::truth::breath(phase);
                weight += density;
                first += density * share;
                second += density * share * share;
            }
            first /= weight;
            second /= weight;
            let (mean, variance) = breath_moments(&breathing);
            assert!((mean - first).abs() < QUADRATURE, "{mean} {first}");
            assert!((variance - (second - first * first)).abs() < QUADRATURE);
        }
    }

    /// `sin^4` of a uniform phase has mean 3/8 and mean square 35/128: a mixture is between.
    #[test]
    fn holds_that_fail_mix_in_every_phase() {
        let breathing = |hold_failure| Breathing {
            skin_m: Vector3::zeros(),
            target_m: Vector3::zeros(),
            period_s: 4.0,
            phase: 0.0,
            phase_spread: Some(0.0),
            hold_failure,
            level_sd: None,
            is_level_measured: false,
            drift_m: None,
        };
        // Held exactly at the end of expiration there is no motion; a tenth fails.
        let (mean, variance) = breath_moments(&breathing(0.1));
        assert!((mean - 0.0375).abs() < QUADRATURE);
        assert!((variance - (0.1 * 35.0 / 128.0 - 0.0375_f64.powi(2))).abs() < QUADRATURE);
        let (mean, _) = breath_moments(&breathing(0.0));
        assert!(mean.abs() < QUADRATURE);
    }
    /// A mixture by hand: with `a` held at the end of expiration and `b` at any phase, both about a level of sd 0.11, the
    /// mean square is `a 0.11^2 + b (0.11^2 + 35/128)`.
    #[test]
    fn a_level_adds_its_variance_to_held_and_failed_breaths() {
        let breathing = Breathing {
            skin_m: Vector3::zeros(),
            target_m: Vector3::zeros(),
            period_s: 4.0,
            phase: 0.0,
            phase_spread: Some(0.0),
            hold_failure: 0.05,
            level_sd: Some(0.11),
            is_level_measured: false,
            drift_m: None,
        };
        let (mean, variance) = breath_moments(&breathing);
        let square = 0.95 * 0.0121 + 0.05 * (0.0121 + 35.0 / 128.0);
        assert!((mean - 0.01875).abs() < QUADRATURE, "{mean}");
        let expected = square - 0.01875 * 0.01875;
        assert!((variance - expected).abs() < QUADRATURE, "{variance}");
    }
}
