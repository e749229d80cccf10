//! Coverage of the confidence intervals of rates, where cases of a point are correlated.

use needlebench_numerics::random::SplitMix64;

use super::interval::{CONFIDENCE, Rate, TAIL};
use super::moments::{GROUPS, Grouped};

/// How the cases of a point come to be alike.
#[derive(Debug, Clone, Copy)]
enum Alike {
    /// Each case has its point's fate with this probability, and otherwise its own: the correlation of two
    /// cases of a point is the square.
    Often(f64),
    /// Half of a point's cases share its outcome, the others are always feasible: one lesion that cannot be reached
    /// from everywhere among others that can.
    Half,
}

/// One sample of points, and the interval that it gives.
fn sampled(random: &mut SplitMix64, points: u64, repeats: u64, truth: f64, alike: Alike) -> Rate {
    let mut grouped = Grouped::default();
    let mut successes = 0;
    // Points fall into groups by chance, as they do in a table: some share one.
    let salt = random.next_u64();
    for point in 0..points {
        let group = SplitMix64::new(salt ^ point).next_u64() % GROUPS as u64;
        let group = usize::try_from(group).unwrap();
        let fate = random.uniform(0.0, 1.0);
        for case in 0..repeats {
            let works = match alike {
                Alike::Often(share) => {
                    if random.uniform(0.0, 1.0) < share {
                        fate < truth
                    } else {
                        random.uniform(0.0, 1.0) < truth
                    }
                }
                Alike::Half => case % 2 == 0 || fate < 2.0 * truth - 1.0,
            };
            grouped.push(group, f64::from(u8::from(works)));
            successes += u64::from(works);
        }
    }
    let size = grouped.effective_size(repeats, TAIL);
    Rate::new(successes, points * repeats, size)
}

/// Share of the samples whose interval contains the true value.
fn coverage(samples: u32, points: u64, repeats: u64, truth: f64, alike: Alike) -> f64 {
    let mut random = SplitMix64::new(points ^ repeats << 16);
    let covered = (0..samples).filter(|_| {
        let interval = sampled(&mut random, points, repeats, truth, alike).interval;
        interval.is_some_and(|interval| interval.low <= truth && truth <= interval.high)
    });
    covered.count() as f64 / f64::from(samples)
}

/// Samples of each kind.
const SAMPLES: u32 = 1000;

/// Four standard errors of a share of 95 % of so many samples, 2.8 %: of 78 kinds, one in three hundred
/// such tests would fail by chance if each were at 95 % exactly.
fn margin() -> f64 {
    4.0 * (CONFIDENCE * (1.0 - CONFIDENCE) / f64::from(SAMPLES)).sqrt()
}

fn holds(points: u64, repeats: u64) {
    let often = [0.0, 0.5, 0.9, 1.0].map(Alike::Often);
    for truth in [0.01, 0.5, 0.8, 0.95, 0.99, 0.998] {
        for alike in often.into_iter().chain([Alike::Half]) {
            if matches!(alike, Alike::Half) && truth <= 0.5 {
                continue;
            }
            let found = coverage(SAMPLES, points, repeats, truth, alike);
            assert!(
                found >= CONFIDENCE - margin(),
                "{points} points in {repeats} cases each, truth {truth}, {alike:?}: {found}"
            );
        }
    }
}

#[test]
fn intervals_hold_the_truth_of_sixteen_points() {
    holds(16, 6);
    holds(16, 24);
}

#[test]
fn intervals_hold_the_truth_of_thirty_two_points() {
    holds(32, 6);
    holds(32, 24);
}

#[test]
fn intervals_hold_the_truth_of_two_hundred_and_fifty_six_points() {
    holds(256, 6);
}

/// Most that the interval of a rate may be wider than that of independent cases, where cases are.
const MOST_WIDER: f64 = 1.15;

#[test]
fn intervals_of_independent_cases_are_hardly_wider() {
    let mut random = SplitMix64::new(3);
    let mut wider = 0.0;
    for _ in 0..SAMPLES {
        let rate = sampled(&mut random, 256, 6, 0.8, Alike::Often(0.0));
        let interval = rate.interval.unwrap();
        let alone = Rate::new(rate.successes, rate.of, rate.of as f64);
        let alone = alone.interval.unwrap();
        wider += (interval.high - interval.low) / (alone.high - alone.low) / f64::from(SAMPLES);
    }
    assert!((1.0..MOST_WIDER).contains(&wider), "{wider}");
}

#[test]
fn where_all_cases_work_points_are_counted() {
    // 0 failures in 1536 cases of 256 points: the 2.5 % quantile of x^256, not of x^1536.
    let mut random = SplitMix64::new(1);
    let rate = sampled(&mut random, 256, 6, 1.0, Alike::Often(0.5));
    assert_eq!((rate.successes, rate.of), (1536, 1536));
    assert!((rate.effective_size - 256.0).abs() < 1e-9);
    let interval = rate.interval.unwrap();
    assert!(
        (interval.low - libm::pow(0.025_f64, 1.0 / 256.0)).abs() < 1e-9 && interval.high >= 1.0
    );
}
