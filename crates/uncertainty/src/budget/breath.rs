//! Moments of how far the breath has moved.

use needlebench_scenario::imperfections::Breathing;

/// Mean and variance of `sin^4(pi phase)`: by its Fourier series under a normal or uniform phase.
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
    (first, (any(&EIGHTH) - first * first).max(0.0))
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
        };
        // Held exactly at the end of expiration there is no motion; a tenth fails.
        let (mean, variance) = breath_moments(&breathing(0.1));
        assert!((mean - 0.0375).abs() < QUADRATURE);
        assert!((variance - (0.1 * 35.0 / 128.0 - 0.0375_f64.powi(2))).abs() < QUADRATURE);
        let (mean, _) = breath_moments(&breathing(0.0));
        assert!(mean.abs() < QUADRATURE);
    }
}
