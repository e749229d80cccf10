//! What engines differ by: over all pairs of them.

use std::iter;

/// All pairs of what several engines made, the earlier engine first.
pub fn pairs<T>(items: &[T]) -> impl Iterator<Item = [&T; 2]> {
    items.iter().enumerate().flat_map(|(at, second)| {
        let earlier = items[..at].iter();
        earlier
            .zip(iter::repeat(second))
            .map(|(first, second)| [first, second])
    })
}

/// The largest difference over all pairs; none unless there are two engines, or if a pair has none.
pub fn largest_over_pairs<T>(
    items: &[T],
    mut difference: impl FnMut(&T, &T) -> Option<f64>,
) -> Option<f64> {
    pairs(items)
        .map(|[a, b]| difference(a, b))
        .reduce(|largest, next| Some(largest?.max(next?)))
        .flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pair_comes_once() {
        let found: Vec<[i32; 2]> = pairs(&[1, 2, 3])
            .map(|pair| pair.map(|each| *each))
            .collect();
        assert_eq!(found, [[1, 2], [1, 3], [2, 3]]);
        assert_eq!(pairs(&[1]).count(), 0);
    }

    #[test]
    fn largest_difference_is_known_if_every_pairs_is() {
        let apart = |a: &f64, b: &f64| Some((a - b).abs());
        assert_eq!(largest_over_pairs(&[1.0, 4.0, 2.0], apart), Some(3.0));
        assert_eq!(largest_over_pairs(&[1.0], apart), None);
        let near = |a: &f64, b: &f64| apart(a, b).filter(|apart| *apart < 2.5);
        assert_eq!(largest_over_pairs(&[1.0, 4.0, 2.0], near), None);
    }
}
