//! Standard variables: normal and uniform ones, drawn one by one or as a Latin hypercube.

use needlebench_kinematics::normal;
use needlebench_kinematics::random::SplitMix64;

/// Distribution of a standard variable; both are symmetric about 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Variable {
    /// Mean 0, variance 1.
    Normal,
    /// Uniform in (-1, 1).
    Uniform,
}

impl Variable {
    /// The value below which a share `p` in (0, 1) of the distribution lies.
    fn quantile(self, p: f64) -> f64 {
        match self {
            Self::Normal => normal::quantile(p),
            Self::Uniform => 2.0 * p - 1.0,
        }
    }

    /// One value.
    pub(crate) fn draw(self, random: &mut SplitMix64) -> f64 {
        self.quantile(random.open_unit())
    }
}

/// Latin hypercube of mirrored pairs: row `2 k + 1` is row `2 k` negated.
///
/// Every variable is stratified: it has one value in each of `rows / 2` equal shares of its
/// distribution's upper half in magnitude, with a random sign, and its mirror image. Means of odd
/// functions are exact, and variances of sums nearly so (McKay, Beckman, Conover, Technometrics
/// 21(2), 1979; antithetic pairs: Hammersley and Morton, 1956).
pub(crate) fn hypercube(
    variables: &[Variable],
    rows: usize,
    random: &mut SplitMix64,
) -> Vec<Vec<f64>> {
    let pairs = rows.div_ceil(2);
    let mut samples = vec![vec![0.0; variables.len()]; 2 * pairs];
    let mut order: Vec<u32> = Vec::new();
    for (column, variable) in variables.iter().enumerate() {
        order.clear();
        order.extend(0..u32::try_from(pairs).expect("far fewer samples"));
        for last in (1..order.len()).rev() {
            let bound = u32::try_from(last + 1).expect("far fewer samples");
            order.swap(last, random.below(bound) as usize);
        }
        for (pair, stratum) in order.iter().enumerate() {
            let within = (f64::from(*stratum) + random.uniform(0.0, 1.0)) / pairs as f64;
            let magnitude = variable.quantile(0.5 + 0.5 * within.min(LARGEST_SHARE));
            let value = if random.below(2) == 0 {
                magnitude
            } else {
                -magnitude
            };
            samples[2 * pair][column] = value;
            samples[2 * pair + 1][column] = -value;
        }
    }
    samples.truncate(rows);
    samples
}

/// Largest share whose quantile is finite.
const LARGEST_SHARE: f64 = 1.0 - f64::EPSILON;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hypercube_has_the_moments_of_its_variables() {
        let variables = [Variable::Normal, Variable::Uniform, Variable::Normal];
        let rows = 4000;
        let samples = hypercube(&variables, rows, &mut SplitMix64::new(3));
        for (column, variance) in [1.0, 1.0 / 3.0, 1.0].into_iter().enumerate() {
            let mean: f64 = samples.iter().map(|row| row[column]).sum::<f64>() / rows as f64;
            let square: f64 =
                samples.iter().map(|row| row[column].powi(2)).sum::<f64>() / rows as f64;
            // Mirrored pairs cancel to rounding; strata leave a share of 1e-3 in the variance.
            assert!(mean.abs() < 1e-15, "{mean}");
            assert!((square / variance - 1.0).abs() < 5e-3, "{square}");
        }
        let product: f64 = samples.iter().map(|row| row[0] * row[2]).sum::<f64>() / rows as f64;
        // Of 2000 independent pairs: 4 standard deviations.
        assert!(product.abs() < 4.0 / (2000.0_f64).sqrt(), "{product}");
    }
}
