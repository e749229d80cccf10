//! Which configurations no other one beats.

use std::cmp::Ordering;

/// How values of one metric compare.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    /// Differences up to this are none.
    pub resolution: f64,
    /// Whether more is better.
    pub more_is_better: bool,
}

impl Scale {
    /// `Greater` if `a` is better than `b` by more than the resolution, `Less` if it is worse by more than
    /// that.
    ///
    /// Two values are compared by themselves, whatever lies between them: a chain of small steps never
    /// makes a large difference vanish. So being even is not transitive. NaN is worse than any number,
    /// and even with NaN.
    pub fn compare(&self, a: f64, b: f64) -> Ordering {
        let is_even = a == b || (a - b).abs() <= self.resolution;
        if a.is_nan() || b.is_nan() {
            b.is_nan().cmp(&a.is_nan())
        } else if is_even {
            Ordering::Equal
        } else if (a > b) == self.more_is_better {
            Ordering::Greater
        } else {
            Ordering::Less
        }
    }
}

/// Whether `a` dominates `b`: worse in no metric and better in one, each beyond its resolution.
pub fn dominates(a: &[f64], b: &[f64], scales: &[Scale]) -> bool {
    let mut better = false;
    for ((a, b), scale) in a.iter().zip(b).zip(scales) {
        match scale.compare(*a, *b) {
            Ordering::Less => return false,
            Ordering::Greater => better = true,
            Ordering::Equal => {}
        }
    }
    better
}

/// Members of the Pareto set among candidates, each given by its values in every metric: those that
/// nothing dominates.
///
/// With resolutions candidates may dominate each other in a circle, each in another metric by little.
/// They are equals, and count as one: all are members unless something outside dominates one of them.
/// So the set is never empty.
pub fn pareto_set(candidates: &[Vec<f64>], scales: &[Scale]) -> Vec<bool> {
    let count = candidates.len();
    // By pairs: whether a chain of dominance leads from one to the other.
    let mut beats: Vec<Vec<bool>> = candidates
        .iter()
        .map(|a| candidates.iter().map(|b| dominates(a, b, scales)).collect())
        .collect();
    for through in 0..count {
        let onwards = beats[through].clone();
        for from in beats.iter_mut().filter(|from| from[through]) {
            for (to, beaten) in from.iter_mut().zip(&onwards) {
                *to |= *beaten;
            }
        }
    }
    (0..count)
        .map(|each| (0..count).all(|other| !beats[other][each] || beats[each][other]))
        .collect()
}
