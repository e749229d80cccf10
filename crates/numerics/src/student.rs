//! Student's distribution.

use crate::beta;

/// The value that a variable of Student's distribution exceeds with a probability below one half; infinite without
/// degrees of freedom.
///
/// Abramowitz and Stegun 26.7.1: with t of `n` degrees of freedom, `n / (n + t^2)` is of the beta distribution.
pub fn exceeded_with(probability: f64, degrees_of_freedom: f64) -> f64 {
    if degrees_of_freedom <= 0.0 {
        return f64::INFINITY;
    }
    let x = beta::quantile(0.5 * degrees_of_freedom, 0.5, 2.0 * probability);
    (degrees_of_freedom * (1.0 - x) / x).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_those_of_published_tables() {
        // Abramowitz and Stegun, table 26.10.
        for (probability, degrees, expected) in [
            (0.025, 1.0, 12.706),
            (0.025, 10.0, 2.228),
            (0.005, 4.0, 4.604),
            (0.05, 120.0, 1.658),
        ] {
            let found = exceeded_with(probability, degrees);
            assert!((found - expected).abs() < 5e-4, "{degrees}: {found}");
        }
        assert!(exceeded_with(0.025, 0.0).is_infinite());
    }
}
