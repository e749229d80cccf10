//! The chi-square distribution.

/// Terms after which the series and the fraction have settled for any degrees of freedom below a million.
const MOST_TERMS: usize = 10_000;

/// Probability that a chi-square variable of so many degrees of freedom exceeds `x`; absolute accuracy 1e-12.
///
/// 1 for `x` at or below 0, and without degrees of freedom 0 above. The regularised incomplete gamma function by its
/// series and its continued fraction (Press et al., *Numerical Recipes*, 6.2).
pub fn probability_above(x: f64, degrees_of_freedom: f64) -> f64 {
    if x <= 0.0 {
        return 1.0;
    }
    if degrees_of_freedom <= 0.0 {
        return 0.0;
    }
    if x.is_infinite() {
        return 0.0;
    }
    let (a, x) = (degrees_of_freedom / 2.0, x / 2.0);
    let scale = libm::exp(a * libm::log(x) - x - libm::lgamma(a));
    if x < a + 1.0 {
        (1.0 - scale * series(a, x)).clamp(0.0, 1.0)
    } else {
        (scale * fraction(a, x)).clamp(0.0, 1.0)
    }
}

/// The value that a chi-square variable exceeds with probability `p`, which lies strictly between 0 and 1.
///
/// By bisection of [`probability_above`]: relative accuracy 1e-10 for `p` above 1e-9.
pub fn exceeded_with(p: f64, degrees_of_freedom: f64) -> f64 {
    let (mut low, mut high) = (0.0, degrees_of_freedom.max(1.0));
    while probability_above(high, degrees_of_freedom) > p && high < 1e12 {
        low = high;
        high *= 2.0;
    }
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if probability_above(middle, degrees_of_freedom) > p {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

fn series(a: f64, x: f64) -> f64 {
    let mut term = 1.0 / a;
    let mut sum = term;
    for n in 1..MOST_TERMS {
        term *= x / (a + n as f64);
        sum += term;
        if term < sum * f64::EPSILON {
            break;
        }
    }
    sum
}

/// Lentz's evaluation of the continued fraction.
fn fraction(a: f64, x: f64) -> f64 {
    let mut b = x + 1.0 - a;
    let mut c = 1.0 / f64::MIN_POSITIVE;
    let mut d = 1.0 / b;
    let mut h = d;
    for n in 1..MOST_TERMS {
        let n = n as f64;
        let an = -n * (n - a);
        b += 2.0;
        d = 1.0 / (an * d + b);
        c = b + an / c;
        let factor = d * c;
        h *= factor;
        if (factor - 1.0).abs() < f64::EPSILON {
            break;
        }
    }
    h
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `scipy.stats.chi2.sf`, scipy 1.17: x, degrees of freedom, probability.
    const SCIPY: [(f64, f64, f64); 6] = [
        (0.1, 1.0, 0.7518296340458492),
        (3.0, 3.0, 0.3916251762710877),
        (11.344866730144368, 3.0, 0.01),
        (30.0, 3.0, 1.3800570312932553e-06),
        (900.0, 1000.0, 0.9892827619087102),
        (1200.0, 1000.0, 1.2255942330622893e-05),
    ];

    #[test]
    fn probabilities_are_those_of_scipy_and_quantiles_their_inverse() {
        for (x, freedom, p) in SCIPY {
            let seen = probability_above(x, freedom);
            assert!((seen - p).abs() < 1e-12 + 1e-9 * p, "{x} {freedom}: {seen}");
            assert!((exceeded_with(p, freedom) / x - 1.0).abs() < 1e-8);
        }
        assert_eq!(probability_above(-1.0, 3.0), 1.0);
        assert_eq!(probability_above(f64::INFINITY, 3.0), 0.0);
    }
}
