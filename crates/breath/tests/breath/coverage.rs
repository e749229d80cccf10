//! Statistics of made traces against what they were made by.

use std::collections::BTreeMap;

use needlebench_breath::{Estimate, SIN4_NEAR_EXPIRATION, Statistics, statistics};

use crate::synthetic::{Law, QUIET, REGULAR};

/// Repeats, and how many of them must hold the truth: 190 are expected of 95 % intervals, three standard deviations
/// fewer are 181; the project asks for 183.
const REPEATS: u64 = 200;
const LEAST: usize = 183;

/// Lengths of traces, s: those of the published recordings.
const LENGTHS_S: [f64; 2] = [130.0, 300.0];
const LENGTH_S: f64 = 300.0;

fn holds(estimate: &Estimate, truth: f64) -> bool {
    estimate
        .interval_95
        .is_some_and(|[low, high]| low <= truth && truth <= high)
}

/// A statistic by its name, what is true of it, and where it is found.
type Truth = (&'static str, f64, fn(&Statistics) -> Estimate);

/// How many of the repeats hold each truth.
fn held(law: &Law, length_s: f64, truths: &[Truth]) -> BTreeMap<&'static str, usize> {
    let mut held: BTreeMap<&'static str, usize> = BTreeMap::new();
    for seed in 0..REPEATS {
        let found = statistics(&law.recording(length_s, seed)).unwrap();
        for (name, truth, estimate) in truths {
            *held.entry(name).or_default() += usize::from(holds(&estimate(&found), *truth));
        }
    }
    held
}

fn all_hold(law: &Law, truths: &[Truth]) {
    for length_s in LENGTHS_S {
        let held = held(law, length_s, truths);
        println!("{length_s} s: {held:?}");
        assert!(
            held.values().all(|count| *count >= LEAST),
            "{length_s} s: {held:?}"
        );
    }
}

#[test]
fn intervals_hold_amplitude_and_period_and_their_variation() {
    let irregular = Law {
        amplitude_cv: 0.3,
        period_cv: 0.2,
        ..QUIET
    };
    let correlated = Law {
        amplitude_correlation: 0.5,
        ..QUIET
    };
    for law in [QUIET, irregular, correlated] {
        all_hold(
            &law,
            &[
                ("amplitude", law.amplitude_m, |found| found.amplitude_m),
                ("amplitude cv", law.amplitude_cv, |found| found.amplitude_cv),
                ("period", law.period_s, |found| found.period_s),
                ("period cv", law.period_cv, |found| found.period_cv),
            ],
        );
    }
}

/// Values that are 10 % off, and a drift the other way, are outside most of the time.
#[test]
fn intervals_do_not_hold_what_is_not_true() {
    let truths: [Truth; 3] = [
        ("amplitude", 1.1 * QUIET.amplitude_m, |found| {
            found.amplitude_m
        }),
        ("period", 0.9 * QUIET.period_s, |found| found.period_s),
        ("drift", -20.0 * QUIET.drift_m_per_s, |found| {
            found.drift_m_per_s
        }),
    ];
    let held = held(&QUIET, LENGTH_S, &truths);
    assert!(held.values().all(|count| *count < 20), "{held:?}");
}

#[test]
fn intervals_hold_the_drift_of_a_level_that_is_noise_and_of_one_that_walks() {
    for (walk_m, alone_m) in [(0.0, 3e-4), (1e-4, 3e-4), (3e-4, 1e-4)] {
        let law = Law {
            walk_m,
            alone_m,
            ..QUIET
        };
        all_hold(
            &law,
            &[("drift", law.drift_m_per_s, |found| found.drift_m_per_s)],
        );
    }
}

#[test]
fn intervals_hold_the_level_after_each_time() {
    for (walk_m, alone_m) in [(0.0, 3e-4), (1e-4, 3e-4), (3e-4, 1e-4)] {
        let law = Law {
            walk_m,
            alone_m,
            drift_m_per_s: 0.0,
            ..QUIET
        };
        let truth = |after_s: f64| (2.0 * alone_m * alone_m + walk_m * walk_m * after_s).sqrt();
        all_hold(
            &law,
            &[
                ("15 s", truth(15.0), |found| found.level[1].rms_m),
                ("30 s", truth(30.0), |found| found.level[2].rms_m),
                ("60 s", truth(60.0), |found| found.level[3].rms_m),
            ],
        );
        let two_minutes: Truth = ("120 s", truth(120.0), |found| found.level[4].rms_m);
        let held = held(&law, LENGTH_S, &[two_minutes]);
        assert!(held["120 s"] >= LEAST, "{held:?}");
        // The nearest end to 5 s before is that of the breath before: a period.
        all_hold(
            &law,
            &[("5 s", truth(law.period_s), |found| found.level[0].rms_m)],
        );
    }
}

#[test]
fn intervals_hold_share_stay_and_spread_in_windows() {
    // The truth is that of a trace of 28 hours, whose own intervals are 20 times narrower.
    let law = Law {
        drift_m_per_s: 0.0,
        ..QUIET
    };
    let long = statistics(&law.recording(1e5, 1_000_003)).unwrap();
    let of = |at: usize| &long.windows[at];
    all_hold(
        &law,
        &[
            ("share 0.1", of(0).share.value, |found| {
                found.windows[0].share
            }),
            ("share 0.2", of(1).share.value, |found| {
                found.windows[1].share
            }),
            ("stay 0.1", of(0).stay_s.value, |found| {
                found.windows[0].stay_s
            }),
            ("stay 0.2", of(1).stay_s.value, |found| {
                found.windows[1].stay_s
            }),
            ("inside 0.1", of(0).inside_sd_m.value, |found| {
                found.windows[0].inside_sd_m
            }),
            ("inside 0.2", of(1).inside_sd_m.value, |found| {
                found.windows[1].inside_sd_m
            }),
            ("near", long.near_expiration.value, |found| {
                found.near_expiration
            }),
        ],
    );
}

/// Samples of 0.1 s find a share of a breath of 5.5 s to 1 in 55, and its highest point to `(pi 0.05 / 5.5)^2 * 2`.
#[test]
fn a_regular_breath_has_the_closed_forms_of_sin4() {
    let found = statistics(&REGULAR.recording(LENGTH_S, 7)).unwrap();
    assert_eq!(found.breaths, 53);
    assert!((found.amplitude_m.value - REGULAR.amplitude_m).abs() < 2e-3 * REGULAR.amplitude_m);
    assert!((found.period_s.value - REGULAR.period_s).abs() < 0.1 / 53.0);
    assert!((found.near_expiration.value - SIN4_NEAR_EXPIRATION).abs() < 1.0 / 55.0);
    // The ends are all the same, so the window is about the lowest point.
    let below = |share: f64| 2.0 * libm::asin(share.sqrt().sqrt()) / std::f64::consts::PI;
    for window in &found.windows {
        let expected = below(window.of_amplitude);
        assert!(
            (window.share.value - expected).abs() < 1.0 / 55.0,
            "{window:?}"
        );
        assert!(
            (window.stay_s.value - expected * REGULAR.period_s).abs() < 0.1,
            "{window:?}"
        );
        // Of sin^4 below a share, by quadrature.
        let inside = |power: i32| {
            let steps = 10_000_u32;
            let value = |step: u32| {
                let phase = 0.5 * expected * (f64::from(step) + 0.5) / f64::from(steps);
                libm::sin(std::f64::consts::PI * phase).powi(4 * power)
            };
            (0..steps).map(value).sum::<f64>() / f64::from(steps)
        };
        let sd_m = REGULAR.amplitude_m * (inside(2) - inside(1) * inside(1)).sqrt();
        assert!(
            (window.inside_sd_m.value - sd_m).abs() < 0.05 * sd_m,
            "{window:?} {sd_m}"
        );
    }
    for level in &found.level {
        assert!(level.worst_m < 1e-6, "{level:?}");
    }
}

#[test]
fn a_drift_alone_is_found_and_grows_the_level_with_time() {
    let law = Law {
        drift_m_per_s: -4e-5,
        ..REGULAR
    };
    let found = statistics(&law.recording(LENGTH_S, 3)).unwrap();
    assert!(
        (found.drift_m_per_s.value + 4e-5).abs() < 2e-7,
        "{:?}",
        found.drift_m_per_s
    );
    let minute = found
        .level
        .iter()
        .find(|level| level.after_s == 60.0)
        .unwrap();
    // The nearest end is at 60.5 s.
    assert!(
        (minute.rms_m.value - 4e-5 * 60.5).abs() < 2e-5,
        "{minute:?}"
    );
    let law = found.level_law_m.unwrap();
    assert!((law.per_s - 4e-5).abs() < 2e-6, "{law:?}");
    assert!((law.after(120.0) - 4.8e-3).abs() < 1e-4);
}

#[test]
fn the_interval_of_the_level_is_narrower_than_none_and_absent_where_the_recording_is_short() {
    let found = statistics(&QUIET.recording(200.0, 1)).unwrap();
    let has = |after_s: f64| {
        let level = found.level.iter().find(|level| level.after_s == after_s);
        level.unwrap().rms_m.interval_95.is_some()
    };
    assert!(has(60.0) && !has(120.0));
    let found = statistics(&QUIET.recording(50.0, 1)).unwrap();
    assert!(found.level.iter().all(|level| level.after_s < 60.0));
    assert!(
        found.findings[0].message.contains("no level after 60 s"),
        "{:?}",
        found.findings
    );
}
