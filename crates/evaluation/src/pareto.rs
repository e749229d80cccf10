//! Which configurations no other one beats.

use std::cmp::Ordering;

/// Levels of values of one metric: 0 for the best, and the same level for all that are tied.
///
/// Values are tied if a chain of values leads from one to the other in steps of at most
/// `resolution`. So differences up to the resolution never decide, being tied is transitive, and
/// the levels depend neither on the order of the values nor on noise far below the resolution.
/// `more_is_better` says which end is the best. NaN is worse than any number, and tied with NaN.
pub fn levels(values: &[f64], resolution: f64, more_is_better: bool) -> Vec<usize> {
    let cost = |index: usize| {
        let value = values[index];
        if more_is_better && !value.is_nan() {
            -value
        } else {
            value
        }
    };
    // NaN of either sign sorts last.
    let order_of = |a: f64, b: f64| {
        a.is_nan()
            .cmp(&b.is_nan())
            .then_with(|| a.partial_cmp(&b).unwrap_or(Ordering::Equal))
    };
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| order_of(cost(a), cost(b)));
    let mut levels = vec![0; values.len()];
    for pair in order.windows(2) {
        let (before, after) = (cost(pair[0]), cost(pair[1]));
        let tied =
            before == after || after - before <= resolution || before.is_nan() && after.is_nan();
        levels[pair[1]] = levels[pair[0]] + usize::from(!tied);
    }
    levels
}

/// Whether `a` dominates `b`: at least as good in every metric and better in one.
pub fn dominates(a: &[usize], b: &[usize]) -> bool {
    a.iter().zip(b).all(|(a, b)| a <= b) && a.iter().zip(b).any(|(a, b)| a < b)
}

/// Members of the Pareto set among candidates, each given by its levels in every metric.
pub fn pareto_set(candidates: &[Vec<usize>]) -> Vec<bool> {
    candidates
        .iter()
        .map(|each| !candidates.iter().any(|other| dominates(other, each)))
        .collect()
}
