//! What is reported of a test by ISO 9283.

use std::collections::BTreeMap;

use nalgebra::Point3;
use needlebench_cell::iso9283::{Iso9283Protocol, STANDARD_CYCLES};
use needlebench_kinematics::registration::{RegistrationError, fre_rms_m, register};
use needlebench_kinematics::{Joints, Pose, rotation_vector};
use serde::Serialize;

use super::{
    Arrival, Attained, Commanded, Drift, Effort, ProtocolStatistics, StatisticsError, TrackerLog,
    drift, evaluate, stabilisation,
};
use crate::motion::EngineDifference;

/// Version of the keys of a measured report.
const SCHEMA_VERSION: u32 = 1;

/// Cycles over which the standard takes stabilisation time and overshoot.
const STABILISATION_CYCLES: u32 = 3;

/// A pose that is farther from its command was measured in another frame, m.
const FOREIGN_FRAME_M: f64 = 0.1;

/// A simulated test.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Iso9283Report {
    /// What was done.
    pub protocol: ProtocolSummary,
    /// What each engine's robot attained.
    pub engines: BTreeMap<String, EngineMeasurement>,
    /// Difference of the measured points of the two engines over the first cycles.
    pub engine_difference: Option<EngineDifference>,
    /// Files of the results folder.
    pub files: Vec<String>,
}

/// What the test was.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProtocolSummary {
    /// Configuration of the arm.
    pub configuration: &'static str,
    /// Commanded positions of P1 to P5 in the controller's base frame, m.
    pub commanded_m: Vec<[f64; 3]>,
    /// Commanded orientation at all poses.
    pub quat_wxyz: [f64; 4],
    /// Joint positions at P1 to P5, rad.
    pub joints_rad: Vec<[f64; 6]>,
    /// Cycles.
    pub cycles: u32,
    /// Duration of a cycle, s.
    pub cycle_s: f64,
    /// Duration of a cycle of approaches from three directions, s; none if they are left out.
    pub directional_cycle_s: Option<f64>,
    /// Share of the rated joint speeds that was allowed.
    pub speed_share: f64,
    /// Mass at the flange, tool included, kg.
    pub load_kg: f64,
    /// Half-width of the band of the stabilisation time, m.
    pub limit_band_m: f64,
    /// Standard deviation of the tracker's noise on each axis, m.
    pub tracker_noise_m: f64,
}

impl ProtocolSummary {
    /// Of a protocol whose postures and durations are known.
    pub fn new(
        protocol: &Iso9283Protocol,
        joints: &[Joints],
        cycle_s: f64,
        directional_cycle_s: Option<f64>,
    ) -> Self {
        let q = protocol.base_from_point[0].rotation;
        Self {
            configuration: protocol.configuration.label(),
            commanded_m: protocol
                .base_from_point
                .iter()
                .map(|pose| pose.translation.vector.into())
                .collect(),
            quat_wxyz: [q.w, q.i, q.j, q.k],
            joints_rad: joints.iter().map(|joints| (*joints).into()).collect(),
            cycles: protocol.cycles,
            cycle_s,
            directional_cycle_s,
            speed_share: protocol.speed_share,
            load_kg: protocol.load_kg,
            limit_band_m: protocol.limit_band_m,
            tracker_noise_m: protocol.tracker_noise_m,
        }
    }
}

/// What the robot of one engine attained.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EngineMeasurement {
    /// AP, RP and vAP.
    #[serde(flatten)]
    pub statistics: ProtocolStatistics,
    /// Stabilisation and overshoot, by pose.
    pub stabilisation: Vec<StabilisationReport>,
    /// Drift at P1; none with fewer than twenty cycles.
    pub drift: Option<Drift>,
    /// Cycles that were simulated. Where the first two are equal bit for bit, so are all.
    pub cycles_simulated: u32,
    /// Effort and contact.
    #[serde(flatten)]
    pub effort: Effort,
    /// What has to be known to read the numbers; none if nothing.
    pub remark: Option<String>,
}

/// Stabilisation time and overshoot at one pose.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StabilisationReport {
    /// Number of the pose; the standard asks for P1.
    pub pose: u32,
    /// Arrivals that were evaluated: at most three, as the standard has it.
    pub arrivals: usize,
    /// Mean time from the first entry into the band until it is not left any more, s; none if an
    /// arrival did not settle.
    pub time_s: Option<f64>,
    /// Mean time from the end of the planned motion until the band is not left any more, s;
    /// negative before the end.
    pub after_motion_s: Option<f64>,
    /// Largest overshoot, m; 0 if the band is never left again.
    pub overshoot_m: Option<f64>,
}

impl StabilisationReport {
    /// Of the first three arrivals at every pose.
    pub fn of_arrivals(arrivals: &[Arrival], limit_band_m: f64) -> Vec<Self> {
        let mut poses: Vec<u32> = arrivals.iter().map(|each| each.pose).collect();
        poses.sort_unstable();
        poses.dedup();
        poses
            .into_iter()
            .map(|pose| {
                let found: Vec<_> = arrivals
                    .iter()
                    .filter(|each| each.pose == pose && each.cycle <= STABILISATION_CYCLES)
                    .map(|each| stabilisation(each, limit_band_m))
                    .collect();
                let count = found.len() as f64;
                let settled: Option<Vec<_>> = found.iter().copied().collect();
                let settled = settled.filter(|settled| !settled.is_empty());
                let settled = settled.as_ref();
                Self {
                    pose,
                    arrivals: found.len(),
                    time_s: settled
                        .map(|all| all.iter().map(|each| each.time_s).sum::<f64>() / count),
                    after_motion_s: settled
                        .map(|all| all.iter().map(|each| each.after_motion_s).sum::<f64>() / count),
                    overshoot_m: settled
                        .map(|all| all.iter().map(|each| each.overshoot_m).fold(0.0, f64::max)),
                }
            })
            .collect()
    }
}

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
            "the tracker's frame was fitted to the commanded poses: AP is without the error of the \
             base's place"
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

/// What a reader of measured numbers has to be told.
fn remarks(statistics: &ProtocolStatistics, commanded: &[Commanded]) -> Vec<String> {
    let mut notes = Vec::new();
    let fewest = statistics.poses.iter().map(|each| each.count).min();
    if let Some(fewest) = fewest.filter(|fewest| *fewest < STANDARD_CYCLES as usize) {
        notes.push(format!(
            "{fewest} measurements of a pose instead of the standard's {STANDARD_CYCLES}: RP is \
             less certain"
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
            "commanded, but not measured: {}",
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
            "RP is 0 because all measurements of each pose are equal, bit for bit: no real robot \
             and no tracker does that"
                .to_owned(),
        );
    }
    notes
}
