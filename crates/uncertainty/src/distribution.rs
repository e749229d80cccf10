//! Standard variables: normal and uniform ones, drawn one by one or as a Latin hypercube.

use needlebench_numerics::normal;
use needlebench_numerics::random::SplitMix64;

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

/// Latin hypercube (McKay, Beckman, Conover, Technometrics 21(2), 1979): every variable has one value in
/// each of `rows` equal shares of its distribution, in an order of its own.
///
/// Means of functions of single variables, and of their sums, are off by less than `1 / rows` of their range;
/// what several variables do together, odd or even, scatters as with independent draws. Rows are no
/// mirror images of each other: those would cancel the odd part of every response, right or wrong, and leave
/// but half as many draws for the even one.
pub(crate) fn hypercube(
    variables: &[Variable],
    rows: usize,
    random: &mut SplitMix64,
) -> Vec<Vec<f64>> {
    let mut samples = vec![vec![0.0; variables.len()]; rows];
    let mut order: Vec<u32> = Vec::new();
    for (column, variable) in variables.iter().enumerate() {
        order.clear();
        order.extend(0..u32::try_from(rows).expect("far fewer samples"));
        for last in (1..order.len()).rev() {
            let bound = u32::try_from(last + 1).expect("far fewer samples");
            order.swap(last, random.below(bound) as usize);
        }
        for (sample, share) in samples.iter_mut().zip(&order) {
            let below = (f64::from(*share) + random.open_unit()) / rows as f64;
            sample[column] = variable.quantile(below.min(LARGEST_SHARE));
        }
    }
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
            // Of strata: a share of 1/4000 of the scatter within one, and the tails.
            assert!(mean.abs() < 1e-3, "{mean}");
            assert!((square / variance - 1.0).abs() < 5e-3, "{square}");
        }
        let product: f64 = samples.iter().map(|row| row[0] * row[2]).sum::<f64>() / rows as f64;
        // Of 4000 independent draws: 4 standard deviations.
        assert!(product.abs() < 4.0 / (4000.0_f64).sqrt(), "{product}");
    }

    /// Standard deviation of the mean of a response over hypercubes, and the mean of the means.
    fn scatter_of_the_mean(response: impl Fn(&[f64]) -> f64) -> (f64, f64) {
        let means: Vec<f64> = (0..HYPERCUBES)
            .map(|seed| {
                let rows = hypercube(&[Variable::Normal; 3], ROWS, &mut SplitMix64::new(seed));
                rows.iter().map(|row| response(row)).sum::<f64>() / ROWS as f64
            })
            .collect();
        let mean = means.iter().sum::<f64>() / means.len() as f64;
        let square: f64 = means.iter().map(|each| (each - mean).powi(2)).sum();
        ((square / (means.len() - 1) as f64).sqrt(), mean)
    }

    const HYPERCUBES: u64 = 400;
    const ROWS: usize = 200;

    /// Relative error of a standard deviation from 400 values: four times `1 / sqrt(2 * 400)`.
    const SCATTER: f64 = 0.14;

    #[test]
    fn what_variables_do_together_scatters_as_with_independent_draws_odd_or_even() {
        let independent = (ROWS as f64).sqrt().recip();
        // Odd, then even, each of variance 1.
        for response in [
            (|row: &[f64]| row[0] * row[1] * row[2]) as fn(&[f64]) -> f64,
            |row| row[0] * row[1],
        ] {
            let (scatter, mean) = scatter_of_the_mean(response);
            // Mirrored rows would have none in the first, and 1.41 times as much in the second.
            assert!((scatter / independent - 1.0).abs() < SCATTER, "{scatter}");
            assert!(mean.abs() < 4.0 * independent / (HYPERCUBES as f64).sqrt());
        }
    }

    #[test]
    fn a_cubic_with_an_even_part_has_its_mean_and_an_error_that_shows() {
        // (s + 1/2)^3 of a sum s of three normal variables: mean 1/8 + 3/2 * 3.
        let cubic = |row: &[f64]| (row.iter().sum::<f64>() + 0.5).powi(3);
        let (scatter, mean) = scatter_of_the_mean(cubic);
        // Variances of what no single variable explains: of 3/2 s^2 the three terms 3 x y, of s^3 the six terms
        // 3 (x^2 - 1) y and the one of 6 x y z.
        let together = 3.0 * 9.0 + 6.0 * 9.0 * 2.0 + 36.0;
        let expected = (together / ROWS as f64).sqrt();
        let of_mean = expected / (HYPERCUBES as f64).sqrt();
        assert!((mean - 4.625).abs() < 4.0 * of_mean, "{mean}");
        // Mirrored rows would have 0.56 of it: twice the even part's variance, nothing of the odd one's.
        assert!(
            (scatter / expected - 1.0).abs() < SCATTER,
            "{scatter} {expected}"
        );
    }

    #[test]
    fn rows_are_no_mirror_images() {
        for rows in [7, 200] {
            let samples = hypercube(&[Variable::Uniform], rows, &mut SplitMix64::new(1));
            assert_eq!(samples.len(), rows);
            let mirrored = |row: &Vec<f64>| samples.iter().any(|other| other[0] == -row[0]);
            assert!(!samples.iter().any(mirrored));
        }
    }
}
