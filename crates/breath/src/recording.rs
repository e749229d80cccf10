//! A recording: one displacement at 10 Hz.

use nalgebra::{Matrix3, SymmetricEigen, Vector3};
use needlebench_input::Finding;
use needlebench_numerics::order::{quantile_position, upper_median};
use serde::Serialize;

use crate::breaths::dwell;
use crate::clock::{LONGEST_STEP_S, checked};
use crate::samples::Samples;
use crate::segment::{SAMPLE_S, Segment};
use crate::source::Source;

/// Share of the variance along the axis below which there is a finding.
const LEAST_SHARE: f64 = 0.8;

/// Where the lesser of the times near both ends of the movement has more than this of the greater, which of them is
/// expiration is doubtful. Of 27 traces of people lying down all that were turned the wrong way had more.
const DOUBTFUL: f64 = 0.75;

/// What moves less is constant, m: the noise of a tracker.
const LEAST_RANGE_M: f64 = 2e-4;

/// No breath moves the skin farther, m; the deepest on record is 54 mm.
const MOST_RANGE_M: f64 = 0.15;

/// A step of this length and speed is no breath, m and m/s: the deepest breath on record reaches 0.08 m/s.
const JUMP_M: f64 = 0.02;
const JUMP_M_PER_S: f64 = 0.2;

/// Over a gap a marker moves by less than this many times the larger range on either side of it.
const MOST_OVER_GAP: f64 = 3.0;

/// Samples that were recorded and hold no position.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Lost {
    /// Zero in all coordinates: what trackers write where they see no marker.
    pub zero: usize,
    /// Time or coordinate missing or not finite.
    pub not_finite: usize,
    /// Time not between those of the rows around them.
    pub out_of_order: usize,
}

/// A time without samples that is longer than 0.5 s.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Gap {
    /// Time of the last sample before it, s.
    pub after_s: f64,
    /// Length, s.
    pub length_s: f64,
}

/// The axis that the marker moves along.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Axis {
    /// Unit vector towards inspiration, in the frame of the recording.
    pub direction: [f64; 3],
    /// Share of the variance of the positions along it.
    pub share: f64,
}

/// A recording that was read and checked.
#[derive(Debug, Clone)]
pub struct Recording {
    /// File as the user named it.
    pub file: String,
    /// Of its bytes; none where there is no file.
    pub sha256: Option<String>,
    /// `csv`, `mcap` or `samples`.
    pub format: &'static str,
    /// Rows or messages in the file.
    pub rows: usize,
    /// Unit of the times in the file.
    pub time_unit: &'static str,
    /// Median time between samples, s.
    pub step_s: f64,
    /// Samples that were left out.
    pub lost: Lost,
    /// Gaps, in the order of time.
    pub gaps: Vec<Gap>,
    /// The axis; none where one coordinate was recorded.
    pub axis: Option<Axis>,
    /// Share of time within a fifth of the amplitude of the end of expiration, and of that of inspiration: the marker
    /// dwells at the former.
    pub dwell: [f64; 2],
    /// What the recording has between its gaps.
    pub segments: Vec<Segment>,
    /// What is doubtful about it.
    pub findings: Vec<Finding>,
}

impl Recording {
    /// A recording of samples; `name` stands in findings. Times are taken as ms where their median step is above 1.
    ///
    /// # Errors
    /// As [`crate::read_recording`].
    pub fn from_samples(name: &str, samples: Samples) -> Result<Self, Finding> {
        Self::from_source(Source {
            file: name.to_owned(),
            sha256: String::new(),
            format: "samples",
            rows: samples.times_s.len(),
            time_unit: None,
            samples,
            notes: Vec::new(),
        })
    }

    /// Time from the first to the last sample, s.
    pub fn duration_s(&self) -> f64 {
        let end_s = |segment: &Segment| {
            segment.start_s + SAMPLE_S * (segment.displacement_m.len().saturating_sub(1)) as f64
        };
        match (self.segments.first(), self.segments.last()) {
            (Some(first), Some(last)) => end_s(last) - first.start_s,
            _ => 0.0,
        }
    }

    pub(crate) fn from_source(source: Source) -> Result<Self, Finding> {
        let Source {
            file,
            sha256,
            format,
            rows,
            time_unit,
            mut samples,
            notes: mut findings,
        } = source;
        let mut lost = remove_lost(&mut samples);
        if samples.times_s.len() < 2 {
            let message = format!("{} of {rows} rows have a position", samples.times_s.len());
            return Err(Finding::new(file, message)
                .hint("a recording has one in each 0.1 s, for a minute or more"));
        }
        let (astray, unit) = checked(&file, time_unit, &mut samples)?;
        lost.out_of_order = astray;
        let mut steps: Vec<f64> = samples
            .times_s
            .windows(2)
            .map(|pair| pair[1] - pair[0])
            .collect();
        let step_s = upper_median(&mut steps);
        let parts = parts(&samples.times_s);
        refuse_jumps(&file, &samples, &parts)?;
        let gaps = parts.windows(2).map(|pair| {
            let after_s = samples.times_s[pair[0].end - 1];
            let length_s = samples.times_s[pair[1].start] - after_s;
            Gap { after_s, length_s }
        });
        let gaps = gaps.collect();
        let resampled: Vec<(f64, Vec<Vector3<f64>>)> = parts
            .iter()
            .filter_map(|part| resampled(&samples, part.clone(), step_s))
            .collect();
        if resampled.is_empty() {
            let message = format!(
                "no {SAMPLE_S} s of the recording are without a gap above {LONGEST_STEP_S} s"
            );
            return Err(Finding::new(&file, message)
                .hint("a recording has a sample in each 0.1 s, for a minute or more"));
        }
        let (mean, eigen) = principal(&resampled);
        let largest = eigen.eigenvalues.imax();
        let direction: Vector3<f64> = eigen.eigenvectors.column(largest).into();
        let along = |direction: &Vector3<f64>| -> Vec<Segment> {
            let segment = |(start_s, points): &(f64, Vec<Vector3<f64>>)| Segment {
                start_s: *start_s,
                displacement_m: points
                    .iter()
                    .map(|point| (point - mean).dot(direction))
                    .collect(),
            };
            resampled.iter().map(segment).collect()
        };
        let segments = along(&direction);
        refuse_ranges(&file, &segments)?;
        let turned = along(&-direction);
        let (here, there) = (dwell(&segments), dwell(&turned));
        let is_turned = there > here;
        let (direction, segments, dwell) = if is_turned {
            (-direction, turned, [there, here])
        } else {
            (direction, segments, [here, there])
        };
        if dwell[1] > DOUBTFUL * dwell[0] {
            let message = format!(
                "which end of the movement is expiration is doubtful: the marker is within a fifth of the amplitude of \
                 one for {:.0} % of the time, of the other for {:.0} %",
                1e2 * dwell[0],
                1e2 * dwell[1]
            );
            let hint = "breath rests at the end of expiration, unless the patient talks: record quiet breathing";
            findings.push(Finding::new(&file, message).hint(hint));
        }
        let axis = (!samples.is_one_coordinate).then(|| Axis {
            direction: direction.into(),
            share: eigen.eigenvalues[largest] / eigen.eigenvalues.sum(),
        });
        if let Some(share) = axis
            .map(|axis| axis.share)
            .filter(|share| *share < LEAST_SHARE)
        {
            let message = format!(
                "{:.0} % of the variance is along the axis, below {:.0} %: the marker moves along no line",
                1e2 * share,
                1e2 * LEAST_SHARE
            );
            let hint = "the patient moved, or the marker is on another part of the body; statistics are along the axis";
            findings.push(Finding::new(&file, message).hint(hint));
        }
        Ok(Self {
            file,
            sha256: (!sha256.is_empty()).then_some(sha256),
            format,
            rows,
            time_unit: unit.label(),
            step_s,
            lost,
            gaps,
            axis,
            dwell,
            segments,
            findings,
        })
    }
}

/// Removes samples without a position.
fn remove_lost(samples: &mut Samples) -> Lost {
    let mut lost = Lost::default();
    let is_finite = |at: usize| {
        samples.times_s[at].is_finite()
            && samples.positions_m[at].iter().all(|each| each.is_finite())
    };
    let is_zero = |at: usize| samples.positions_m[at] == [0.0; 3];
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for (at, position) in samples.positions_m.iter().enumerate() {
        if is_finite(at) && !is_zero(at) {
            (low, high) = (low.min(position[0]), high.max(position[0]));
        }
    }
    // A single coordinate may pass through zero.
    let may_be_zero = samples.is_one_coordinate && low <= 0.0 && high >= 0.0;
    let mut kept = Vec::with_capacity(samples.times_s.len());
    for at in 0..samples.times_s.len() {
        if !is_finite(at) {
            lost.not_finite += 1;
        } else if is_zero(at) && !may_be_zero {
            lost.zero += 1;
        } else {
            kept.push(at);
        }
    }
    samples.keep(&kept);
    lost
}

/// Ranges of samples without a gap.
fn parts(times_s: &[f64]) -> Vec<std::ops::Range<usize>> {
    let mut parts = Vec::new();
    let mut start = 0;
    for at in 1..=times_s.len() {
        if at == times_s.len() || times_s[at] - times_s[at - 1] > LONGEST_STEP_S {
            parts.push(start..at);
            start = at;
        }
    }
    parts
}

/// Refuses what no marker on a breathing patient does: another patient or another marker is in the file.
fn refuse_jumps(
    file: &str,
    samples: &Samples,
    parts: &[std::ops::Range<usize>],
) -> Result<(), Finding> {
    let position = |at: usize| Vector3::from(samples.positions_m[at]);
    let refused = |at: usize, message: String| {
        let hint = "is the unit right? another patient or marker: split the file there; a single row: empty its cells";
        Err(samples.at(at, Finding::new(file, message)).hint(hint))
    };
    for part in parts {
        for at in part.start + 1..part.end {
            let length_m = (position(at) - position(at - 1)).norm();
            let time_s = samples.times_s[at] - samples.times_s[at - 1];
            if length_m > JUMP_M && length_m > JUMP_M_PER_S * time_s {
                let message = format!(
                    "the marker jumps by {:.1} mm in {time_s:.3} s",
                    1e3 * length_m
                );
                return refused(at, message);
            }
        }
    }
    let mean_and_range = |part: &std::ops::Range<usize>| {
        let points: Vec<Vector3<f64>> = part.clone().map(position).collect();
        let mean = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
        let first = points[0];
        let (low, high) = points.iter().fold((first, first), |(low, high), point| {
            (low.inf(point), high.sup(point))
        });
        (mean, (high - low).norm())
    };
    for pair in parts.windows(2) {
        let [(mean, range_m), (next, next_m)] = [&pair[0], &pair[1]].map(mean_and_range);
        let moved_m = (next - mean).norm();
        if moved_m > JUMP_M && moved_m > MOST_OVER_GAP * range_m.max(next_m) {
            let message = format!(
                "the marker is elsewhere after a gap: by {:.1} mm on average",
                1e3 * moved_m
            );
            return refused(pair[1].start, message);
        }
    }
    Ok(())
}

/// Refuses a trace without movement, or with more than a patient has.
fn refuse_ranges(file: &str, segments: &[Segment]) -> Result<(), Finding> {
    let mut all: Vec<f64> = segments
        .iter()
        .flat_map(|each| each.displacement_m.iter().copied())
        .collect();
    all.sort_by(f64::total_cmp);
    let [low_m, high_m] = [0.05, 0.95].map(|p| quantile(&all, p));
    let (range_m, least_m) = (high_m - low_m, LEAST_RANGE_M);
    if range_m < least_m || range_m.is_nan() {
        let message = format!(
            "the trace is constant: 90 % of it lie within {:.3} mm, below {:.1} mm",
            1e3 * range_m,
            1e3 * least_m
        );
        let hint = "is the right column read, and is it in the unit that was given?";
        return Err(Finding::new(file, message).hint(hint));
    }
    if range_m > MOST_RANGE_M {
        let message = format!(
            "90 % of the trace lie within {:.0} mm, above the {:.0} mm of any breath",
            1e3 * range_m,
            1e3 * MOST_RANGE_M
        );
        let hint = "is it in the unit that was given? did the patient move, or the table?";
        return Err(Finding::new(file, message).hint(hint));
    }
    Ok(())
}

/// The quantile of ascending values, as NumPy's `quantile`; not a number without values.
pub(crate) fn quantile(ascending: &[f64], p: f64) -> f64 {
    let (index, share) = quantile_position(ascending.len() as u64, p);
    let index = usize::try_from(index).unwrap_or(usize::MAX);
    let value = |at: usize| ascending.get(at).copied();
    match (value(index), value(index + 1)) {
        (Some(low), Some(high)) => low + share * (high - low),
        (Some(low), None) => low,
        _ => f64::NAN,
    }
}

/// Samples at 10 Hz: on the lines between samples; where there are more than 20 in a second, between the means of each
/// 0.1 s. None where fewer than two of them fit.
fn resampled(
    samples: &Samples,
    part: std::ops::Range<usize>,
    step_s: f64,
) -> Option<(f64, Vec<Vector3<f64>>)> {
    let start_s = samples.times_s[part.start];
    let mut knots: Vec<(f64, Vector3<f64>)> = Vec::with_capacity(part.len());
    if step_s < 0.5 * SAMPLE_S {
        let mut from = part.start;
        let bin = |at: usize| ((samples.times_s[at] - start_s) / SAMPLE_S).floor();
        for at in part.start + 1..=part.end {
            if at == part.end || bin(at) > bin(from) {
                let count = (at - from) as f64;
                let time_s = samples.times_s[from..at].iter().sum::<f64>() / count;
                let sum: Vector3<f64> = samples.positions_m[from..at]
                    .iter()
                    .map(|each| Vector3::from(*each))
                    .sum();
                knots.push((time_s, sum / count));
                from = at;
            }
        }
    } else {
        let both = samples.times_s[part.clone()]
            .iter()
            .zip(&samples.positions_m[part]);
        knots.extend(both.map(|(time_s, position)| (*time_s, Vector3::from(*position))));
    }
    let (start_s, end_s) = (knots.first()?.0, knots.last()?.0);
    let mut points = Vec::new();
    let mut next = 1;
    for count in 0_u32.. {
        let time_s = start_s + SAMPLE_S * f64::from(count);
        // The last sample may be off by the rounding of the times.
        if time_s > end_s + 1e-6 {
            break;
        }
        while next + 1 < knots.len() && knots[next].0 < time_s {
            next += 1;
        }
        let (before, after) = (knots[next - 1], *knots.get(next)?);
        let share = ((time_s - before.0) / (after.0 - before.0)).clamp(0.0, 1.0);
        points.push(before.1 + share * (after.1 - before.1));
    }
    (points.len() >= 2).then_some((start_s, points))
}

/// Mean of all points, and the eigenvalues and axes of their covariance.
fn principal(
    segments: &[(f64, Vec<Vector3<f64>>)],
) -> (Vector3<f64>, SymmetricEigen<f64, nalgebra::U3>) {
    let points = || segments.iter().flat_map(|(_, points)| points);
    let count = points().count().max(1) as f64;
    let mean = points().sum::<Vector3<f64>>() / count;
    let covariance = points().fold(Matrix3::zeros(), |sum, point| {
        let off = point - mean;
        sum + off * off.transpose()
    });
    (mean, SymmetricEigen::new(covariance / count))
}
