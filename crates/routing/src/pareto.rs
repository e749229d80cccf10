//! What nothing beats in all aims.

/// Indices of the items that no other one is at least as good as in all aims and better in one; of equals all.
/// Less is better. In the order of the items.
pub fn pareto<const AIMS: usize>(items: &[[f64; AIMS]]) -> Vec<usize> {
    let beats = |a: &[f64; AIMS], b: &[f64; AIMS]| {
        let mut pairs = a.iter().zip(b);
        pairs.clone().all(|(a, b)| a <= b) && pairs.any(|(a, b)| a < b)
    };
    (0..items.len())
        .filter(|&index| !items.iter().any(|other| beats(other, &items[index])))
        .collect()
}
