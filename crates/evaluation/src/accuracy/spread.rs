//! Mean, standard deviation and range of a few numbers.

use serde::Serialize;

/// What a table of a paper says of some numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    /// How many there are, at least one.
    pub count: u64,
    /// Mean.
    pub mean: f64,
    /// Standard deviation with `n - 1`; none of a single number.
    pub sd: Option<f64>,
    /// The least.
    pub least: f64,
    /// The largest.
    pub most: f64,
}

impl Spread {
    /// Of all numbers that are there; none without any.
    pub fn of(values: impl Iterator<Item = f64> + Clone) -> Option<Self> {
        let count = values.clone().count();
        if count == 0 {
            return None;
        }
        let n = count as f64;
        let mean = values.clone().sum::<f64>() / n;
        // The second sum takes back what rounding left of the mean (Chan, Golub and LeVeque 1983).
        let squares: f64 = values.clone().map(|value| (value - mean).powi(2)).sum();
        let left: f64 = values.clone().map(|value| value - mean).sum();
        let variance = (squares - left * left / n) / (n - 1.0);
        Some(Self {
            count: count as u64,
            mean,
            sd: (count > 1).then(|| variance.max(0.0).sqrt()),
            least: values.clone().fold(f64::INFINITY, f64::min),
            most: values.fold(f64::NEG_INFINITY, f64::max),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rounding of sums of a handful of numbers.
    const ROUNDING: f64 = 1e-12;

    #[test]
    fn a_small_set_has_the_figures_worked_out_by_hand() {
        // Mean 5, squares of deviations 9 + 1 + 1 + 1 + 0 + 0 + 4 + 16 = 32 over 7.
        let values = [2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0];
        let found = Spread::of(values.into_iter()).unwrap();
        assert_eq!((found.count, found.least, found.most), (8, 2.0, 9.0));
        assert!((found.mean - 5.0).abs() < ROUNDING);
        assert!((found.sd.unwrap() - (32.0_f64 / 7.0).sqrt()).abs() < ROUNDING);
    }

    #[test]
    fn one_number_has_no_deviation_and_none_has_nothing() {
        let one = Spread::of([0.3].into_iter()).unwrap();
        assert_eq!(
            (one.mean, one.sd, one.least, one.most),
            (0.3, None, 0.3, 0.3)
        );
        assert_eq!(Spread::of(std::iter::empty()), None);
    }

    #[test]
    fn a_large_offset_takes_nothing_from_the_deviation() {
        let values = [1e9, 1e9 + 1.0, 1e9 + 2.0];
        assert!((Spread::of(values.into_iter()).unwrap().sd.unwrap() - 1.0).abs() < ROUNDING);
    }
}
