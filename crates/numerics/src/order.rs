//! Order statistics.

/// Where the quantile of `count` ascending values lies that `p` of them are below: the index, from 0, of the value at
/// or below it, and the share of the way to the next. Type 7 of Hyndman and Fan (The American Statistician 50 (1996)
/// 361), as NumPy's `quantile`. 0 and 0 without values.
pub fn quantile_position(count: u64, p: f64) -> (u64, f64) {
    let position = count.saturating_sub(1) as f64 * p;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 0 and the number of values"
    )]
    let index = position.floor() as u64;
    (index, position.fract())
}

/// Middle one of the values, the upper one of an even number; not a number without values. Sorts them.
pub fn upper_median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_lie_where_numpy_has_them() {
        // numpy.quantile([0, 1, 2, 3], 0.4) == 1.2.
        let (index, share) = quantile_position(4, 0.4);
        assert_eq!(index, 1);
        assert!((share - 0.2).abs() < 1e-15);
        assert_eq!(quantile_position(4, 1.0), (3, 0.0));
        assert_eq!(quantile_position(0, 0.5), (0, 0.0));
    }

    #[test]
    fn medians_are_values_that_occur() {
        assert_eq!(upper_median(&mut [5.0, 1.0, 3.0]), 3.0);
        assert_eq!(upper_median(&mut [4.0, 1.0, 3.0, 2.0]), 3.0);
        assert!(upper_median(&mut []).is_nan());
    }
}
