//! The beta distribution, of which the binomial and Student's are cases.

/// Logarithm of the gamma function of a positive number: Lanczos, SIAM J. Numer. Anal. B 1 (1964) 86,
/// with the nine coefficients of Godfrey (2001); to 1e-14 of its value.
fn ln_gamma(x: f64) -> f64 {
    const G: f64 = 7.0;
    const FIRST: f64 = 0.999_999_999_999_809_9;
    const COEFFICIENTS: [f64; 8] = [
        676.520_368_121_885_1,
        -1_259.139_216_722_402_8,
        771.323_428_777_653_1,
        -176.615_029_162_140_6,
        12.507_343_278_686_905,
        -0.138_571_095_265_720_12,
        9.984_369_578_019_572e-6,
        1.505_632_735_149_311_6e-7,
    ];
    if x < 0.5 {
        // Reflected: gamma(x) gamma(1 - x) = pi / sin(pi x).
        let sine = libm::sin(std::f64::consts::PI * x);
        return libm::log(std::f64::consts::PI / sine) - ln_gamma(1.0 - x);
    }
    let x = x - 1.0;
    let shifted = x + G + 0.5;
    let terms = (1..).zip(COEFFICIENTS);
    let sum = terms.fold(FIRST, |sum, (k, coefficient)| {
        sum + coefficient / (x + f64::from(k))
    });
    0.5 * libm::log(std::f64::consts::TAU) + (x + 0.5) * libm::log(shifted) - shifted
        + libm::log(sum)
}

/// Probability below `x` of the beta distribution of two positive numbers: the continued fraction of
/// Abramowitz and Stegun 26.5.8 by Lentz's method.
fn probability_below(a: f64, b: f64, x: f64) -> f64 {
    if x <= 0.0 {
        return 0.0;
    }
    if x >= 1.0 {
        return 1.0;
    }
    // It converges quickly below the mean.
    if x > (a + 1.0) / (a + b + 2.0) {
        return 1.0 - probability_below(b, a, 1.0 - x);
    }
    let scale =
        ln_gamma(a + b) - ln_gamma(a) - ln_gamma(b) + a * libm::log(x) + b * libm::log1p(-x);
    libm::exp(scale) * continued_fraction(a, b, x) / a
}

fn continued_fraction(a: f64, b: f64, x: f64) -> f64 {
    /// More than the square root of the largest samples needs.
    const MOST_TERMS: u32 = 100_000;
    const TINY: f64 = 1e-300;
    let apart = |value: f64| if value.abs() < TINY { TINY } else { value };
    let mut c = 1.0;
    let mut d = 1.0 / apart(1.0 - (a + b) * x / (a + 1.0));
    let mut fraction = d;
    for m in 1..MOST_TERMS {
        let m = f64::from(m);
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        d = 1.0 / apart(1.0 + even * d);
        c = apart(1.0 + even / c);
        fraction *= d * c;
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        d = 1.0 / apart(1.0 + odd * d);
        c = apart(1.0 + odd / c);
        fraction *= d * c;
        if (d * c - 1.0).abs() < f64::EPSILON {
            break;
        }
    }
    fraction
}

/// The value that the beta distribution of two positive numbers is below with a probability: by
/// halving, to the last bits.
pub fn quantile(a: f64, b: f64, probability: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    loop {
        let middle = f64::midpoint(low, high);
        if middle <= low || middle >= high || high - low < 1e-15 * high {
            return middle;
        }
        if probability_below(a, b, middle) < probability {
            low = middle;
        } else {
            high = middle;
        }
    }
}

/// Clopper and Pearson's interval of a share that was seen in `size` independent trials, which need not be a whole
/// number: Biometrika 26 (1934) 404. The true share is beyond each end with a probability of at most `tail`; of no trials
/// it is anywhere between 0 and 1.
pub fn clopper_pearson(share: f64, size: f64, tail: f64) -> [f64; 2] {
    let share = share.clamp(0.0, 1.0);
    if size <= 0.0 || size.is_nan() {
        return [0.0, 1.0];
    }
    let (successes, failures) = (share * size, (1.0 - share) * size);
    let low = if share <= 0.0 {
        0.0
    } else {
        quantile(successes, failures + 1.0, tail)
    };
    let high = if share >= 1.0 {
        1.0
    } else {
        1.0 - quantile(failures, successes + 1.0, tail)
    };
    [low, high]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_in_n_trials_leaves_3_7_in_n() {
        for n in [100.0, 1e4, 1e6] {
            let [low, high] = clopper_pearson(0.0, n, 0.025);
            let exact = -libm::expm1(libm::log(0.025) / n);
            assert!(
                low == 0.0 && (high / exact - 1.0).abs() < 1e-7,
                "{n}: {high}"
            );
            assert!((3.6..3.7).contains(&(high * n)), "{n}: {high}");
        }
        assert_eq!(clopper_pearson(0.5, 0.0, 0.025), [0.0, 1.0]);
    }

    #[test]
    fn gamma_is_the_factorial() {
        let mut factorial = 1.0_f64;
        for n in 1..60 {
            factorial *= f64::from(n);
            let found = ln_gamma(f64::from(n) + 1.0);
            assert!((found - libm::log(factorial)).abs() < 1e-13 * libm::log(factorial).max(1.0));
        }
        assert!((ln_gamma(0.5) - 0.5 * libm::log(std::f64::consts::PI)).abs() < 1e-14);
        assert!((ln_gamma(0.25) - libm::log(3.625_609_908_221_908_f64)).abs() < 1e-13);
    }

    #[test]
    fn powers_are_beta_distributions() {
        for p in [1e-4, 0.025, 0.5, 0.99] {
            for n in [0.3, 1.0, 7.0, 4096.0, 1e7] {
                // Of a = n and b = 1 the probability below x is x^n.
                let exact = libm::pow(p, 1.0 / n);
                let found = quantile(n, 1.0, p);
                assert!(
                    (found - exact).abs() < 1e-9 * exact,
                    "{p} {n}: {found} {exact}"
                );
                let other = 1.0 - quantile(1.0, n, 1.0 - p);
                assert!((other - exact).abs() < 1e-9, "{p} {n}: {other} {exact}");
            }
        }
    }
}
