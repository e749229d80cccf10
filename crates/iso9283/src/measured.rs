//! A test of a real robot, from a tracker's log.

use nalgebra::Point3;
use needlebench_kinematics::registration::{RegistrationError, fre_rms_m, register};
use needlebench_kinematics::{Pose, rotation_vector};
use serde::Serialize;

use super::{
    Attained, Commanded, Drift, ProtocolStatistics, STANDARD_CYCLES, StatisticsError, TrackerLog,
    drift, evaluate,
};

/// Version of the keys of a measured report.
const SCHEMA_VERSION: u32 = 1;

/// A pose that is farther from its command was measured in another frame, m.
const FOREIGN_FRAME_M: f64 = 0.1;

/// A test of a real robot, from a tracker's log.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MeasuredReport {
    /// Version of the keys.
    pub schema_version: u32,
    /// The log, as given.
    pub log: String,
    /// The commanded poses, as given.
    pub commanded: String,
    /// AP, RP and vAP.
    #[serde(flatten)]
    pub statistics: ProtocolStatistics,
    /// Drift at the first pose; none with fewer than twenty cycles.
    pub drift: Option<Drift>,
    /// The tracker's frame, where it was fitted to the commanded poses.
    pub frame_fit: Option<FrameFit>,
    /// What was assumed, left out or is suspicious.
    pub notes: Vec<String>,
}

/// The tracker's frame in the robot's base frame, fitted to the mean attained positions.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FrameFit {
    /// Position of the tracker's frame in the base frame, m.
    pub position_m: [f64; 3],
    /// Its rotation vector, rad.
    pub rotvec_rad: [f64; 3],
    /// Poses that the fit is of.
    pub poses: usize,
    /// Root mean square distance that is left, m.
    pub residual_rms_m: f64,
}

/// Evaluates a tracker's log; gives the measurements in the base frame too.
///
/// With `fit_frame`, the tracker's frame is not known to be the robot's base: the rigid transform
/// that brings the mean positions nearest to the commanded ones is applied first. AP is then
/// free of the error of the base's place, and smaller than the standard's.
///
/// # Errors
/// Too few measurements, poses without a command, and mean positions that no frame can be fitted
/// to.
pub fn measured_report(
    log_file: &str,
    commanded_file: &str,
    commanded: &[Commanded],
    log: TrackerLog,
    fit_frame: bool,
) -> Result<(MeasuredReport, Vec<Attained>), MeasuredError> {
    let TrackerLog {
        mut attained,
        mut notes,
    } = log;
    let frame_fit = if fit_frame {
        let (fit, base_from_tracker) = fitted_frame(commanded, &attained)?;
        for each in &mut attained {
            each.position_m = base_from_tracker * each.position_m;
            each.orientation = each
                .orientation
                .map(|orientation| base_from_tracker.rotation * orientation);
        }
        notes.push(
            "the tracker's frame was fitted to the commanded poses: AP excludes the base placement \
             error"
                .to_owned(),
        );
        Some(fit)
    } else {
        None
    };
    let statistics = evaluate(commanded, &attained)?;
    notes.extend(remarks(&statistics, commanded));
    let first = commanded
        .iter()
        .find(|each| each.pose == statistics.poses[0].pose);
    let report = MeasuredReport {
        schema_version: SCHEMA_VERSION,
        log: log_file.to_owned(),
        commanded: commanded_file.to_owned(),
        drift: first.and_then(|first| drift(first, &attained)),
        statistics,
        frame_fit,
        notes,
    };
    Ok((report, attained))
}

/// Why a log cannot be evaluated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeasuredError {
    /// Too few measurements, or poses without a command.
    #[error(transparent)]
    Statistics(#[from] StatisticsError),
    /// No frame can be fitted.
    #[error("the tracker's frame cannot be fitted to the commanded poses: {0}")]
    Fit(#[from] RegistrationError),
}

fn fitted_frame(
    commanded: &[Commanded],
    attained: &[Attained],
) -> Result<(FrameFit, Pose), RegistrationError> {
    let (mut from, mut to) = (Vec::new(), Vec::new());
    for command in commanded {
        let here: Vec<&Point3<f64>> = attained
            .iter()
            .filter(|each| each.pose == command.pose && each.axis.is_none())
            .map(|each| &each.position_m)
            .collect();
        if here.is_empty() {
            continue;
        }
        let sum = here
            .iter()
            .fold(Point3::origin(), |sum, each| sum + each.coords);
        from.push(sum / here.len() as f64);
        to.push(command.position_m);
    }
    let base_from_tracker = register(&from, &to)?;
    let fit = FrameFit {
        position_m: base_from_tracker.translation.vector.into(),
        rotvec_rad: rotation_vector(&base_from_tracker.rotation).into(),
        poses: from.len(),
        residual_rms_m: fre_rms_m(&base_from_tracker, &from, &to),
    };
    Ok((fit, base_from_tracker))
}

/// Remarks on measured numbers.
fn remarks(statistics: &ProtocolStatistics, commanded: &[Commanded]) -> Vec<String> {
    let mut notes = Vec::new();
    let fewest = statistics.poses.iter().map(|each| each.count).min();
    if let Some(fewest) = fewest.filter(|fewest| *fewest < STANDARD_CYCLES as usize) {
        notes.push(format!(
            "{fewest} measurements of a pose instead of the standard's {STANDARD_CYCLES}: RP has a \
             larger uncertainty"
        ));
    }
    let unmeasured: Vec<String> = commanded
        .iter()
        .filter(|command| {
            statistics
                .poses
                .iter()
                .all(|each| each.pose != command.pose)
        })
        .map(|command| format!("P{}", command.pose))
        .collect();
    if !unmeasured.is_empty() {
        notes.push(format!(
            "commanded but not measured: {}",
            unmeasured.join(", ")
        ));
    }
    if statistics.ap_m > FOREIGN_FRAME_M {
        notes.push(format!(
            "a pose is {:.0} mm from its command: if the tracker's frame is not the robot's base, \
             give --fit-frame",
            statistics.ap_m * 1e3
        ));
    }
    if statistics.nothing_random {
        notes.push(
            "RP is 0 because all measurements of each pose are bit-identical, which no real robot \
             or tracker produces"
                .to_owned(),
        );
    }
    notes
}
