//! Windows about the level: how much of the time breath is near its end of expiration, and for how long.

use serde::Serialize;

use crate::breaths::{Breath, End};
use crate::interval::{Estimate, mean, root_of_ratio, share};
use crate::segment::{SAMPLE_S, Segment};

/// Ends of expiration whose mean is the middle of the window.
const LAST: usize = 3;

/// Time within a window about the last three ends of expiration.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Window {
    /// From the middle to either edge, as a share of the amplitude.
    pub of_amplitude: f64,
    /// The same, m.
    pub half_width_m: f64,
    /// Share of the time inside.
    pub share: Estimate,
    /// Mean length of a stay inside, s.
    pub stay_s: Estimate,
    /// Stays.
    pub stays: usize,
    /// Standard deviation of what is inside, m.
    pub inside_sd_m: Estimate,
}

/// What of a breath is in the window: numbers of samples, and sums of distances from the middle and of their squares.
#[derive(Clone, Copy, Default)]
struct Part {
    samples: f64,
    inside: f64,
    sum: f64,
    squares: f64,
}

/// A window about the mean of the last three ends of expiration. An end counts from when it was known to be one: when
/// the trace had risen by 0.3 of its range. Breaths are the units of the intervals.
pub(crate) fn window(
    segments: &[Segment],
    ends: &[End],
    breaths: &[Breath],
    of_amplitude: f64,
    half_width_m: f64,
) -> Window {
    let mut parts: Vec<Part> = Vec::new();
    let mut stays_s: Vec<f64> = Vec::new();
    let (mut known, mut breath) = (0, None);
    for (number, segment) in segments.iter().enumerate() {
        let mut stay = 0_u32;
        for (index, displacement_m) in segment.displacement_m.iter().enumerate() {
            let time_s = segment.start_s + SAMPLE_S * index as f64;
            while known < ends.len() && ends[known].known_s <= time_s {
                known += 1;
            }
            if known < LAST {
                continue;
            }
            let last = &ends[known - LAST..known];
            let middle_m = last.iter().map(|end| end.displacement_m).sum::<f64>() / LAST as f64;
            let off_m = displacement_m - middle_m;
            // A part from each end of expiration to the next, and one for what is before the first of a segment.
            let here = breaths.partition_point(|each| (each.segment, each.from) <= (number, index));
            if breath != Some((number, here)) {
                breath = Some((number, here));
                parts.push(Part::default());
            }
            let Some(part) = parts.last_mut() else {
                continue;
            };
            part.samples += 1.0;
            if off_m.abs() <= half_width_m {
                part.inside += 1.0;
                part.sum += off_m;
                part.squares += off_m * off_m;
                stay += 1;
            } else if stay > 0 {
                stays_s.push(SAMPLE_S * f64::from(stay));
                stay = 0;
            }
        }
        if stay > 0 {
            stays_s.push(SAMPLE_S * f64::from(stay));
        }
    }
    let shares: Vec<[f64; 2]> = parts
        .iter()
        .map(|part| [part.inside, part.samples])
        .collect();
    let inside: f64 = parts.iter().map(|part| part.inside).sum();
    let mean_m = parts.iter().map(|part| part.sum).sum::<f64>() / inside;
    let squares: Vec<[f64; 2]> = parts
        .iter()
        .map(|part| {
            let about_mean = part.squares - 2.0 * mean_m * part.sum + part.inside * mean_m * mean_m;
            [about_mean, part.inside]
        })
        .collect();
    Window {
        of_amplitude,
        half_width_m,
        share: share(&shares),
        stay_s: mean(&stays_s),
        stays: stays_s.len(),
        inside_sd_m: root_of_ratio(&squares),
    }
}
