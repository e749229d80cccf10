//! Statistics of a recording.

use needlebench_input::Finding;
use serde::Serialize;

use crate::breaths::{breaths, ends};
use crate::drift::drift_m_per_s;
use crate::interval::{Estimate, mean, share, variation};
use crate::level::{LevelChange, LevelLaw, level_changes};
use crate::recording::Recording;
use crate::segment::SAMPLE_S;
use crate::window::{Window, window};

/// Breaths at least.
const LEAST_BREATHS: usize = 3;

/// Windows, as shares of the amplitude.
const WINDOWS: [f64; 2] = [0.1, 0.2];

/// A recording that is shorter has no level after a minute, s.
const SHORT_S: f64 = 60.0;

/// Share of the time that `sin^4(pi phase)` is below a fifth of its amplitude: `2 asin(0.2^(1/4)) / pi`. The shape is
/// that of Lujan et al., Med. Phys. 26(5), 1999.
pub const SIN4_NEAR_EXPIRATION: f64 = 0.466_332_4;

/// What a recording says of breath.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Statistics {
    /// From the first to the last sample, s.
    pub duration_s: f64,
    /// Breaths from one end of expiration to the next, without a gap.
    pub breaths: usize,
    /// Mean amplitude, m: from the mean of the ends of expiration before and after to the highest between.
    pub amplitude_m: Estimate,
    /// Standard deviation of the amplitude from breath to breath, over its mean.
    pub amplitude_cv: Estimate,
    /// Mean time from one end of expiration to the next, s.
    pub period_s: Estimate,
    /// Standard deviation of the period, over its mean.
    pub period_cv: Estimate,
    /// Slope of the ends of expiration, m/s.
    pub drift_m_per_s: Estimate,
    /// End of expiration against that of some time before.
    pub level: Vec<LevelChange>,
    /// The law that is nearest to it, m; none of fewer than two times.
    pub level_law_m: Option<LevelLaw>,
    /// Time within windows of 0.1 and 0.2 of the amplitude.
    pub windows: Vec<Window>,
    /// Share of a breath within 0.2 of its amplitude of the line between its ends; [`SIN4_NEAR_EXPIRATION`] of `sin^4`.
    pub near_expiration: Estimate,
    /// Times of the ends of expiration, s.
    #[serde(skip)]
    pub ends_s: Vec<f64>,
    /// What the recording does not tell, and why.
    pub findings: Vec<Finding>,
}

/// Finds the breaths of a recording and their statistics.
///
/// # Errors
/// Fewer than three breaths.
pub fn statistics(recording: &Recording) -> Result<Statistics, Finding> {
    let segments = &recording.segments;
    let ends = ends(segments);
    let breaths = breaths(segments, &ends);
    let duration_s = recording.duration_s();
    if breaths.len() < LEAST_BREATHS {
        let found = match breaths.len() {
            0 => "no breath".to_owned(),
            1 => "one breath".to_owned(),
            count => format!("{count} breaths"),
        };
        let message =
            format!("{found} from one end of expiration to the next in {duration_s:.1} s");
        let hint =
            format!("statistics need {LEAST_BREATHS} at least, and a minute or more to be of use");
        return Err(Finding::new(&recording.file, message).hint(hint));
    }
    let values = |value: &dyn Fn(&crate::breaths::Breath) -> f64| -> Vec<f64> {
        breaths.iter().map(value).collect()
    };
    let amplitudes_m = values(&|breath| breath.amplitude_m);
    let periods_s = values(&|breath| breath.period_s);
    let near: Vec<[f64; 2]> = breaths
        .iter()
        .map(|breath| [breath.near as f64, (breath.to - breath.from) as f64])
        .collect();
    let (amplitude_m, period_s) = (mean(&amplitudes_m), mean(&periods_s));
    let level = level_changes(&ends, duration_s, period_s.value);
    let points: Vec<[f64; 2]> = level
        .iter()
        .map(|each| [each.after_s, each.rms_m.value])
        .collect();
    let of_window = |of_amplitude: f64| {
        let half_width_m = of_amplitude * amplitude_m.value;
        window(segments, &ends, &breaths, of_amplitude, half_width_m)
    };
    let mut findings = Vec::new();
    if duration_s < SHORT_S {
        let message =
            format!("the recording is {duration_s:.1} s long: no level after {SHORT_S} s and more");
        findings.push(Finding::new(&recording.file, message).hint("record several minutes"));
    }
    let recorded_s = SAMPLE_S
        * segments
            .iter()
            .map(|each| each.displacement_m.len())
            .sum::<usize>() as f64;
    let in_breaths_s: f64 = periods_s.iter().sum();
    if in_breaths_s < 0.5 * recorded_s {
        let message =
            format!("breaths make up {in_breaths_s:.0} s of the {recorded_s:.0} s recorded");
        let hint = "gaps, held breath or very unequal breaths: look at the trace";
        findings.push(Finding::new(&recording.file, message).hint(hint));
    }
    Ok(Statistics {
        duration_s,
        breaths: breaths.len(),
        amplitude_m,
        amplitude_cv: variation(&amplitudes_m),
        period_s,
        period_cv: variation(&periods_s),
        drift_m_per_s: drift_m_per_s(&ends, period_s.value),
        level_law_m: LevelLaw::fitted(&points),
        level,
        windows: WINDOWS.map(of_window).into(),
        near_expiration: share(&near),
        ends_s: ends.iter().map(|end| end.time_s).collect(),
        findings,
    })
}
