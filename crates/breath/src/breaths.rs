//! Ends of expiration, and the breaths between them.

use needlebench_numerics::order::upper_median;

use crate::segment::{SAMPLE_S, Segment};

/// The trace falls to an end of expiration, and rises from it, by this share of its range at least.
const RISE: f64 = 0.3;

/// Samples of a stretch by which the range is found: 10 s hold a breath.
const STRETCH: usize = 100;

/// Samples that differ by less are equal, m: trackers repeat their digits, and projections of these round differently.
const EQUAL_M: f64 = 1e-9;

/// Share of the amplitude that counts as near.
const NEAR: f64 = 0.2;

/// An end of expiration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct End {
    pub segment: usize,
    /// Its sample in the segment.
    pub index: usize,
    pub time_s: f64,
    pub displacement_m: f64,
    /// When the trace had risen so far that it was known to be one, s.
    pub known_s: f64,
}

/// From one end of expiration to the next, without a gap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Breath {
    pub segment: usize,
    pub from: usize,
    pub to: usize,
    /// Highest sample above the mean of both ends, m.
    pub amplitude_m: f64,
    pub period_s: f64,
    /// Samples within 0.2 of the amplitude of the line between both ends.
    pub near: usize,
}

/// Range of the movement: the median, over stretches of 10 s, of highest less lowest sample, m. A single deep breath or
/// a drift changes it little.
pub(crate) fn range_m(segments: &[Segment]) -> f64 {
    let mut ranges = Vec::new();
    for segment in segments {
        let samples = &segment.displacement_m;
        let whole = samples.chunks(STRETCH.min(samples.len().max(1)));
        let whole = whole.filter(|stretch| stretch.len() == STRETCH.min(samples.len()));
        ranges.extend(whole.map(|stretch| {
            let low = stretch.iter().copied().fold(f64::INFINITY, f64::min);
            let high = stretch.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            high - low
        }));
    }
    upper_median(&mut ranges)
}

/// Ends of expiration: the lowest sample between a fall and a rise of 0.3 of the range each, which are the minima with
/// that prominence; of equal ones the first, and the middle of its run.
pub(crate) fn ends(segments: &[Segment]) -> Vec<End> {
    let rise_m = RISE * range_m(segments);
    let mut found = Vec::new();
    for (number, segment) in segments.iter().enumerate() {
        let samples = &segment.displacement_m;
        let time_s = |index: usize| segment.start_s + SAMPLE_S * index as f64;
        let mut high_m = f64::NEG_INFINITY;
        // The lowest one since the trace has fallen.
        let mut low: Option<usize> = None;
        for (index, &here_m) in samples.iter().enumerate() {
            match low {
                None => {
                    high_m = high_m.max(here_m);
                    if high_m - here_m >= rise_m {
                        low = Some(index);
                    }
                }
                Some(lowest) if here_m < samples[lowest] - EQUAL_M => low = Some(index),
                Some(lowest) if here_m - samples[lowest] >= rise_m => {
                    let equal = samples[lowest..]
                        .iter()
                        .take_while(|each| (**each - samples[lowest]).abs() < EQUAL_M);
                    let index_of_end = lowest + (equal.count() - 1) / 2;
                    found.push(End {
                        segment: number,
                        index: index_of_end,
                        time_s: time_s(index_of_end),
                        displacement_m: samples[lowest],
                        known_s: time_s(index),
                    });
                    high_m = here_m;
                    low = None;
                }
                Some(_) => {}
            }
        }
    }
    found
}

/// Breaths between ends of expiration of one segment.
pub(crate) fn breaths(segments: &[Segment], ends: &[End]) -> Vec<Breath> {
    let pairs = ends
        .windows(2)
        .filter(|pair| pair[0].segment == pair[1].segment);
    let breath = |pair: &[End]| {
        let (first, next) = (pair[0], pair[1]);
        let samples = &segments[first.segment].displacement_m[first.index..=next.index];
        let highest_m = samples.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let [start_m, end_m] = [first.displacement_m, next.displacement_m];
        let amplitude_m = highest_m - 0.5 * (start_m + end_m);
        let count = (next.index - first.index) as f64;
        let above_m = |(index, sample): (usize, &f64)| {
            sample - (start_m + (end_m - start_m) * index as f64 / count)
        };
        let inside = samples[..samples.len() - 1].iter().enumerate().map(above_m);
        Breath {
            segment: first.segment,
            from: first.index,
            to: next.index,
            amplitude_m,
            period_s: SAMPLE_S * count,
            near: inside
                .filter(|above_m| *above_m <= NEAR * amplitude_m)
                .count(),
        }
    };
    pairs.map(breath).collect()
}

/// Share of time near the end of expiration, if that is where these displacements are low; 0 without a breath.
pub(crate) fn dwell(segments: &[Segment]) -> f64 {
    let breaths = breaths(segments, &ends(segments));
    let near: usize = breaths.iter().map(|breath| breath.near).sum();
    let all: usize = breaths.iter().map(|breath| breath.to - breath.from).sum();
    near as f64 / all.max(1) as f64
}
