//! Several recordings together.

use needlebench_breath::{Statistics, over_recordings, statistics};

use crate::synthetic::{Law, QUIET};

fn of(law: &Law, seeds: std::ops::Range<u64>) -> Vec<Statistics> {
    seeds
        .map(|seed| statistics(&law.recording(300.0, seed)).unwrap())
        .collect()
}

const NAMES: [&str; 12] = ["a", "b", "c", "d", "e", "f", "g", "h", "i", "j", "k", "l"];

#[test]
fn fewer_than_five_recordings_are_not_enough() {
    let found = over_recordings(&NAMES, &of(&QUIET, 0..4));
    assert_eq!(
        found.not_enough.as_deref(),
        Some("4 recordings, and 5 are needed")
    );
    assert!(
        found.quantiles.is_empty()
            && found.level.is_empty()
            && found.level_law_of_amplitude.is_none()
    );
    assert!(
        over_recordings(&NAMES, &of(&QUIET, 0..5))
            .not_enough
            .is_none()
    );
}

#[test]
fn two_markers_of_one_recording_are_not_two_recordings() {
    let mut all = of(&QUIET, 0..5);
    all.push(all[1].clone());
    let found = over_recordings(&NAMES, &all);
    assert!(
        found
            .not_enough
            .is_some_and(|reason| reason.starts_with("b and f have"))
    );
}

/// Of twelve recordings of one law the bound of eleven covers about nine tenths of the twelfth, and of a thirteenth
/// that talks much less.
#[test]
fn the_bound_covers_a_recording_of_its_kind_and_not_one_of_another() {
    let mut all = of(&QUIET, 0..11);
    let restless = Law {
        alone_m: 2e-3,
        ..QUIET
    };
    all.extend(of(&restless, 50..51));
    let found = over_recordings(&NAMES, &all);
    let half_minute = found
        .level
        .iter()
        .find(|level| level.after_s == 30.0)
        .unwrap();
    let (kind, other) = half_minute.coverage.split_at(11);
    let mean = kind.iter().sum::<f64>() / 11.0;
    assert!(mean > 0.88, "{half_minute:?}");
    assert!(other[0] < 0.7, "{half_minute:?}");
}

/// `numpy.quantile([...], 0.9)` of six values is half way between the fifth and the sixth.
#[test]
fn quantiles_are_over_recordings() {
    let all = of(&QUIET, 20..26);
    let mut amplitudes: Vec<f64> = all.iter().map(|each| each.amplitude_m.value).collect();
    amplitudes.sort_by(f64::total_cmp);
    let found = over_recordings(&NAMES, &all);
    let amplitude = &found.quantiles[0];
    assert_eq!(amplitude.statistic, "amplitude_m");
    assert!((amplitude.p90 - 0.5 * (amplitudes[4] + amplitudes[5])).abs() < 1e-15);
    assert!((amplitude.median - 0.5 * (amplitudes[2] + amplitudes[3])).abs() < 1e-15);
    let law = found.level_law_of_amplitude.unwrap();
    for level in &found.level {
        assert!(
            (law.after(level.after_s) / level.rms_p90 - 1.0).abs() < 0.35,
            "{law:?} {level:?}"
        );
    }
}
