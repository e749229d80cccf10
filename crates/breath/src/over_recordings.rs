//! What holds over several recordings.

use serde::Serialize;

use crate::level::LevelLaw;
use crate::recording::quantile;
use crate::statistics::Statistics;

/// Recordings at least: a 90th percentile of fewer is the largest of them.
const LEAST: usize = 5;

/// The percentile over recordings, and within each of them.
const BOUND: f64 = 0.9;

/// Ends of expiration that count as the same, s: markers of one recording have the breaths in common.
const SAME_S: f64 = 0.5;

/// Share of the ends that two markers of one recording have in common at least.
const SAME_SHARE: f64 = 0.8;

/// Quantiles of one statistic over recordings.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Quantiles {
    /// Key of the statistic.
    pub statistic: &'static str,
    /// Median over recordings.
    pub median: f64,
    /// 90th percentile over recordings.
    pub p90: f64,
}

/// Level over recordings, as shares of the amplitude of each.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LevelOverRecordings {
    /// Time between both ends of expiration, s.
    pub after_s: f64,
    /// Recordings that are long enough.
    pub recordings: usize,
    /// 90th percentile over recordings of the root mean square.
    pub rms_p90: f64,
    /// 90th percentile over recordings of the 90 % quantile of the absolute differences within each.
    pub bound: f64,
    /// Share of the differences of each recording, in the order of the files, that the bound of the others covers.
    pub coverage: Vec<f64>,
}

/// What holds over recordings, or why that cannot be told.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OverRecordings {
    /// How many.
    pub recordings: usize,
    /// Why there is nothing else: then defaults stay.
    pub not_enough: Option<String>,
    /// Quantiles of amplitude, period and the like.
    pub quantiles: Vec<Quantiles>,
    /// Level, at the times for which there are five recordings.
    pub level: Vec<LevelOverRecordings>,
    /// The law that is nearest to `rms_p90`, as a share of the amplitude.
    pub level_law_of_amplitude: Option<LevelLaw>,
}

/// What holds over recordings, one of each patient: quantiles over *recordings*, as breaths of one recording are alike.
///
/// The bound of each is tried on what it was not made of: it is made again without a recording, and the share of that
/// recording's differences that it covers is in `coverage`; 0.9 is what it should be. `names` stand in the reason.
pub fn over_recordings(names: &[&str], all: &[Statistics]) -> OverRecordings {
    let mut found = OverRecordings {
        recordings: all.len(),
        not_enough: not_enough(names, all),
        quantiles: Vec::new(),
        level: Vec::new(),
        level_law_of_amplitude: None,
    };
    if found.not_enough.is_some() {
        return found;
    }
    let of = |statistic: &'static str, value: &dyn Fn(&Statistics) -> f64| Quantiles {
        statistic,
        median: quantile_of(all.iter().map(value), 0.5),
        p90: quantile_of(all.iter().map(value), BOUND),
    };
    let share = |each: &Statistics, at: usize| each.windows[at].share.value;
    found.quantiles = vec![
        of("amplitude_m", &|each| each.amplitude_m.value),
        of("amplitude_cv", &|each| each.amplitude_cv.value),
        of("period_s", &|each| each.period_s.value),
        of("period_cv", &|each| each.period_cv.value),
        of("absolute_drift_m_per_s", &|each| {
            each.drift_m_per_s.value.abs()
        }),
        of("share_within_0.1", &|each| share(each, 0)),
        of("share_within_0.2", &|each| share(each, 1)),
    ];
    let mut times_s: Vec<f64> = all
        .iter()
        .flat_map(|each| &each.level)
        .map(|each| each.after_s)
        .collect();
    times_s.sort_by(f64::total_cmp);
    times_s.dedup();
    found.level = times_s
        .iter()
        .filter_map(|after_s| level(all, *after_s))
        .collect();
    let points: Vec<[f64; 2]> = found
        .level
        .iter()
        .map(|each| [each.after_s, each.rms_p90])
        .collect();
    found.level_law_of_amplitude = LevelLaw::fitted(&points);
    found
}

fn not_enough(names: &[&str], all: &[Statistics]) -> Option<String> {
    if all.len() < LEAST {
        let recordings = if all.len() == 1 {
            "recording"
        } else {
            "recordings"
        };
        return Some(format!(
            "{} {recordings}, and {LEAST} are needed",
            all.len()
        ));
    }
    let is_same = |one: &Statistics, other: &Statistics| {
        let (few, many) = if one.ends_s.len() < other.ends_s.len() {
            (&one.ends_s, &other.ends_s)
        } else {
            (&other.ends_s, &one.ends_s)
        };
        let is_there = |end_s: &f64| {
            let after = many.partition_point(|each| *each < end_s - SAME_S);
            many.get(after).is_some_and(|each| *each <= end_s + SAME_S)
        };
        let common = few.iter().filter(|end_s| is_there(end_s)).count();
        common as f64 >= SAME_SHARE * many.len() as f64
    };
    for (at, other) in all.iter().enumerate() {
        if let Some(one) = all[..at].iter().position(|one| is_same(one, other)) {
            let [one, other] = [one, at].map(|each| names.get(each).copied().unwrap_or_default());
            return Some(format!(
                "{one} and {other} have their breaths at the same times: give one marker of a recording"
            ));
        }
    }
    None
}

/// The quantile of values in any order.
fn quantile_of(values: impl Iterator<Item = f64>, p: f64) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    quantile(&values, p)
}

/// Level after one time; none where fewer than five recordings have it.
fn level(all: &[Statistics], after_s: f64) -> Option<LevelOverRecordings> {
    // Root mean square and absolute differences of each.
    let of_amplitude: Vec<(f64, Vec<f64>)> = all
        .iter()
        .filter_map(|each| {
            let level = each.level.iter().find(|level| level.after_s == after_s)?;
            let share = |metres: f64| metres.abs() / each.amplitude_m.value;
            let changes = level
                .changes_m
                .iter()
                .map(|change_m| share(*change_m))
                .collect();
            Some((share(level.rms_m.value), changes))
        })
        .collect();
    if of_amplitude.len() < LEAST {
        return None;
    }
    let within: Vec<f64> = of_amplitude
        .iter()
        .map(|(_, changes)| quantile_of(changes.iter().copied(), BOUND))
        .collect();
    let coverage = of_amplitude
        .iter()
        .enumerate()
        .map(|(left_out, (_, changes))| {
            let others = within.iter().enumerate().filter(|(at, _)| *at != left_out);
            let bound = quantile_of(others.map(|(_, each)| *each), BOUND);
            let covered = changes.iter().filter(|change| **change <= bound).count();
            covered as f64 / changes.len() as f64
        });
    Some(LevelOverRecordings {
        after_s,
        recordings: of_amplitude.len(),
        rms_p90: quantile_of(of_amplitude.iter().map(|(rms, _)| *rms), BOUND),
        bound: quantile_of(within.iter().copied(), BOUND),
        coverage: coverage.collect(),
    })
}
