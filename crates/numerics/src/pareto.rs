//! What nothing else is better than in all respects.

/// Indices of the items that no other one dominates, in the order of the items; of equals all.
///
/// `dominates(a, b)` says whether `a` is at least as good as `b` in every respect and better in one; it must be
/// transitive. Takes a comparison per pair at most.
pub fn pareto_front<T>(items: &[T], dominates: impl Fn(&T, &T) -> bool) -> Vec<usize> {
    (0..items.len())
        .filter(|&index| !items.iter().any(|other| dominates(other, &items[index])))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn members_are_those_that_nothing_dominates_and_equals_stay_together() {
        let less = |a: &[i32; 2], b: &[i32; 2]| a != b && a[0] <= b[0] && a[1] <= b[1];
        let items = [[3, 1], [1, 3], [2, 2], [2, 2], [3, 3], [4, 1]];
        assert_eq!(pareto_front(&items, less), [0, 1, 2, 3]);
        assert_eq!(pareto_front(&[], less), [0; 0]);
    }
}
