//! Whether groups differ by more than chance: tests by ranks, which take no distribution for granted.
//!
//! Groups that were drawn independently are compared by Kruskal and Wallis's test, groups whose members
//! belong together (the same draw of arm and patient in each) by Friedman's. Both take the chi-squared
//! distribution for that of their statistic, which holds for enough members only; below that nothing is
//! tested.

use serde::Serialize;

/// Least members of each group for Kruskal and Wallis's test: from five on its statistic is near enough to
/// chi-squared (Siegel and Castellan, Nonparametric Statistics, 1988, 8.4).
pub(crate) const LEAST_MEMBERS: usize = 5;

/// Least blocks for Friedman's test. With three groups the exact tables end at about this many (Siegel and
/// Castellan, 7.2).
pub const LEAST_BLOCKS: usize = 10;

/// Which test was made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Test {
    /// Kruskal and Wallis's, of independent groups.
    KruskalWallis,
    /// Friedman's, of blocks.
    Friedman,
}

impl Test {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::KruskalWallis => "Kruskal-Wallis",
            Self::Friedman => "Friedman",
        }
    }
}

/// The outcome of a test.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Tested {
    /// The test.
    pub test: Test,
    /// Probability of such a difference or a larger one between groups that do not differ.
    pub p: f64,
    /// Members of the smallest group, or blocks.
    pub members: usize,
}

/// Kruskal and Wallis's test of independent groups, corrected for ties.
///
/// # Errors
/// Why there is nothing to test.
pub(crate) fn kruskal_wallis(groups: &[Vec<f64>]) -> Result<Tested, &'static str> {
    if groups.len() < 2 {
        return Err("there is only one group");
    }
    let members = groups.iter().map(Vec::len).min().unwrap_or(0);
    if members < LEAST_MEMBERS {
        return Err("a group has fewer than 5 independent values");
    }
    let all: Vec<f64> = groups.concat();
    let (ranks, ties) = ranks(&all);
    let n = all.len() as f64;
    let mut first = 0;
    let mut sum = 0.0;
    for group in groups {
        let of_group = &ranks[first..first + group.len()];
        first += group.len();
        sum += of_group.iter().sum::<f64>().powi(2) / group.len() as f64;
    }
    let statistic = 12.0 / (n * (n + 1.0)) * sum - 3.0 * (n + 1.0);
    let correction = 1.0 - ties / (n.powi(3) - n);
    if correction <= 0.0 {
        return Err("all values are equal");
    }
    Ok(Tested {
        test: Test::KruskalWallis,
        p: upper_tail(statistic / correction, groups.len() - 1),
        members,
    })
}

/// Friedman's test of blocks, each with one value per group, corrected for ties.
///
/// # Errors
/// Why there is nothing to test.
pub(crate) fn friedman(blocks: &[Vec<f64>]) -> Result<Tested, &'static str> {
    let groups = blocks.first().map_or(0, Vec::len);
    if blocks.len() < LEAST_BLOCKS {
        return Err("fewer than 10 draws have a value in every group");
    }
    if groups < 2 {
        return Err("there is only one group");
    }
    let (b, k) = (blocks.len() as f64, groups as f64);
    let mut sums = vec![0.0; groups];
    let mut all_ties = 0.0;
    for block in blocks {
        let (ranks, ties) = ranks(block);
        all_ties += ties;
        for (sum, rank) in sums.iter_mut().zip(ranks) {
            *sum += rank;
        }
    }
    let squares: f64 = sums.iter().map(|sum| sum * sum).sum();
    let statistic = 12.0 / (b * k * (k + 1.0)) * squares - 3.0 * b * (k + 1.0);
    let correction = 1.0 - all_ties / (b * (k.powi(3) - k));
    if correction <= 0.0 {
        return Err("all values are equal");
    }
    Ok(Tested {
        test: Test::Friedman,
        p: upper_tail(statistic / correction, groups - 1),
        members: blocks.len(),
    })
}

/// Ranks from 1, the mean of them where values tie; and the sum of `t^3 - t` over the ties.
fn ranks(values: &[f64]) -> (Vec<f64>, f64) {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut ranks = vec![0.0; values.len()];
    let mut ties = 0.0;
    for tied in order.chunk_by(|&a, &b| values[a] == values[b]) {
        let before = order.partition_point(|&at| values[at] < values[tied[0]]);
        let t = tied.len() as f64;
        for &at in tied {
            ranks[at] = before as f64 + 0.5 * (t + 1.0);
        }
        ties += t.powi(3) - t;
    }
    (ranks, ties)
}

/// Probability of more than `x` under chi-squared of so many degrees of freedom, by its recurrence in steps
/// of two (Abramowitz and Stegun 26.4.8): exact but for rounding.
fn upper_tail(x: f64, degrees: usize) -> f64 {
    if x <= 0.0 {
        return 1.0;
    }
    let half = 0.5 * x;
    let (mut tail, mut term, mut k) = if degrees.is_multiple_of(2) {
        (0.0, libm::exp(-half), 2.0)
    } else {
        let tail = erfc(half.sqrt());
        (
            tail,
            (2.0 * x / std::f64::consts::PI).sqrt() * libm::exp(-half),
            3.0,
        )
    };
    // `term` is what the distribution of k degrees has more than that of k - 2.
    while k <= degrees as f64 {
        tail += term;
        term *= x / k;
        k += 2.0;
    }
    tail.clamp(0.0, 1.0)
}

/// Complementary error function of a number that is not negative: its series, or from 2 on its continued
/// fraction, each until nothing changes.
fn erfc(x: f64) -> f64 {
    let root_pi = std::f64::consts::PI.sqrt();
    if x < 2.0 {
        let (mut sum, mut term) = (x, x);
        for n in 1..200 {
            term *= 2.0 * x * x / (2.0 * f64::from(n) + 1.0);
            sum += term;
            if term < f64::EPSILON * sum {
                break;
            }
        }
        return 1.0 - 2.0 / root_pi * libm::exp(-x * x) * sum;
    }
    let mut fraction = 0.0;
    for n in (1..=120).rev() {
        fraction = 0.5 * f64::from(n) / (x + fraction);
    }
    libm::exp(-x * x) / (root_pi * (x + fraction))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rounding of a dozen operations.
    const ROUNDING: f64 = 1e-12;

    #[test]
    fn tails_of_chi_squared_are_those_of_closed_forms() {
        // Two degrees are an exponential distribution; four add x/2 times it.
        for x in [0.1_f64, 1.0, 5.99, 20.0] {
            assert!((upper_tail(x, 2) - libm::exp(-0.5 * x)).abs() < ROUNDING);
            let four = libm::exp(-0.5 * x) * (1.0 + 0.5 * x);
            assert!((upper_tail(x, 4) - four).abs() < ROUNDING);
        }
        // Tables: the 95 % points of 1, 3, 5 and 10 degrees, to their printed digits.
        for (x, degrees) in [(3.841, 1), (7.815, 3), (11.070, 5), (18.307, 10)] {
            assert!((upper_tail(x, degrees) - 0.05).abs() < 2e-5, "{degrees}");
        }
        // Where the error function changes from series to fraction both are the same.
        assert!((erfc(2.0 - 1e-9) - erfc(2.0)).abs() < 1e-10);
        assert!((erfc(2.0) - 0.004_677_734_981_047_266).abs() < ROUNDING);
        assert_eq!(upper_tail(-1e-15, 3), 1.0);
    }

    #[test]
    fn kruskal_and_wallis_is_worked_out_by_hand() {
        // Ranks 1 to 5, 6 to 10, 11 to 15: sums 15, 40, 65. H = 12/(15*16)*(225+1600+4225)/5 - 48 = 12.5.
        let groups = [1.0, 6.0, 11.0].map(|from| (0..5).map(|k| from + f64::from(k)).collect());
        let found = kruskal_wallis(&groups).unwrap();
        assert!((found.p - libm::exp(-6.25_f64)).abs() < ROUNDING);
        assert_eq!(found.members, 5);
    }

    #[test]
    fn ties_share_their_ranks_and_correct_the_statistic() {
        // 1 1 2 3 4 and 1 2 2 5 6: ranks 2 2 5 7 8 = 24 and 2 5 5 9 10 = 31, ties 24 + 24 of 990.
        // H = (12/110*(24^2 + 31^2)/5 - 33)/(1 - 48/990).
        let groups = [vec![1.0, 1.0, 2.0, 3.0, 4.0], vec![1.0, 2.0, 2.0, 5.0, 6.0]];
        let h = (12.0 / 110.0 * (576.0 + 961.0) / 5.0 - 33.0) / (1.0 - 48.0 / 990.0);
        let found = kruskal_wallis(&groups).unwrap();
        assert!((found.p - erfc((0.5_f64 * h).sqrt())).abs() < ROUNDING);
    }

    #[test]
    fn friedman_is_worked_out_by_hand() {
        // Ten blocks that all rank three groups alike: sums 10, 20, 30;
        // 12/(10*3*4)*(100+400+900) - 3*10*4 = 20, p = exp(-10).
        let blocks: Vec<Vec<f64>> = (0..10)
            .map(|block| vec![f64::from(block), 20.0, 30.0])
            .collect();
        let found = friedman(&blocks).unwrap();
        assert!((found.p - libm::exp(-10.0_f64)).abs() < ROUNDING);
        assert_eq!((found.members, found.test), (10, Test::Friedman));
    }

    #[test]
    fn too_little_is_not_tested() {
        let five = || vec![1.0, 2.0, 3.0, 4.0, 5.0];
        assert!(kruskal_wallis(&[five()]).is_err());
        assert!(kruskal_wallis(&[five(), vec![1.0; 4]]).is_err());
        assert!(kruskal_wallis(&[vec![7.0; 5], vec![7.0; 5]]).is_err());
        assert!(friedman(&vec![vec![1.0, 2.0]; 9]).is_err());
        assert!(friedman(&vec![vec![1.0, 1.0]; 12]).is_err());
        assert!(friedman(&[]).is_err());
    }
}
