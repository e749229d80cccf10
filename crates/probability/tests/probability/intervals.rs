//! Intervals against published values and closed forms.

use needlebench_numerics::random::SplitMix64;
use needlebench_probability::{Difference, share_interval, weighted_interval};

/// Ends of Clopper and Pearson's interval, `scipy.stats.binomtest(k, n).proportion_ci()`, SciPy 1.17.1.
const SCIPY: [(u64, u64, f64, f64); 3] = [
    (10, 100, 0.049_004_689_221_485_95, 0.176_222_597_740_175_32),
    (
        1,
        10_000,
        2.531_777_563_270_631e-6,
        5.570_369_979_869_689e-4,
    ),
    (961, 1000, 0.947_069_064_214_555, 0.972_122_851_204_663_6),
];

/// Of the beta quantile at 10 000 trials, relative.
const QUANTILE: f64 = 1e-7;

#[test]
fn shares_have_the_intervals_of_the_literature() {
    for (hits, draws, low, high) in SCIPY {
        let found = share_interval(hits, draws);
        assert!(
            (found.low / low - 1.0).abs() < QUANTILE,
            "{hits} of {draws}: {found:?}"
        );
        assert!(
            (found.high / high - 1.0).abs() < QUANTILE,
            "{hits} of {draws}: {found:?}"
        );
    }
    // Nothing in n: 1 - 0.025^(1/n).
    let none = share_interval(0, 1_000_000);
    assert!(
        none.low == 0.0 && (none.high - 3.688_872e-6).abs() < 1e-11,
        "{none:?}"
    );
}

/// Fewer than 183 of 200 intervals of 95 % hold the value in 1 % of all runs.
const FEWEST: u32 = 183;

#[test]
fn weights_have_intervals_that_cover() {
    // Beyond 4 of an exponential variable, from draws of another of twice the mean.
    let exact = libm::exp(-4.0);
    let mut covered = 0;
    for seed in 0..200 {
        let mut random = SplitMix64::new(seed);
        let (mut sum, mut squares) = (0.0, 0.0);
        for _ in 0..2000 {
            let x = -2.0 * libm::log(random.open_unit());
            let weight = if x > 4.0 {
                2.0 * libm::exp(-0.5 * x)
            } else {
                0.0
            };
            sum += weight;
            squares += weight * weight;
        }
        covered += u32::from(weighted_interval(sum, squares, 2000).contains(exact));
    }
    assert!(covered >= FEWEST, "{covered}");
    let none = weighted_interval(0.0, 0.0, 1000);
    assert_eq!((none.low, none.high), (0.0, 1.0));
}

#[test]
fn paired_differences_cover_and_are_narrower_than_two_intervals() {
    // Two cases that share nine tenths of what happens.
    let (shared, first, second) = (0.02, 0.004, 0.001);
    let draws = 20_000;
    let mut covered = 0;
    for seed in 0..200 {
        let mut random = SplitMix64::new(1000 + seed);
        let mut found = Difference {
            only_first: 0,
            only_second: 0,
            draws,
        };
        let mut hits = 0;
        for _ in 0..draws {
            let u = random.open_unit();
            found.only_first += u64::from(u < first);
            found.only_second += u64::from((first..first + second).contains(&u));
            hits += u64::from(u > 1.0 - shared || u < first);
        }
        let interval = found.interval();
        covered += u32::from(interval.contains(first - second));
        let alone = share_interval(hits, draws);
        assert!(interval.high - interval.low < 2.0 * (alone.high - alone.low));
        assert!(!found.is_tied());
    }
    assert!(covered >= FEWEST, "{covered}");
    let same = Difference {
        only_first: 12,
        only_second: 9,
        draws: 10_000,
    };
    assert!(same.is_tied() && (same.value() - 3e-4).abs() < 1e-15);
}
