//! What is reported of a test by ISO 9283.

use std::collections::BTreeMap;

use needlebench_iso9283::{Arrival, Drift, ProtocolStatistics, stabilisation};
use needlebench_kinematics::Joints;
use needlebench_scenario::iso9283::Iso9283Protocol;
use serde::Serialize;

use super::Effort;
use crate::motion::EngineDifference;

/// Cycles over which the standard takes stabilisation time and overshoot.
const STABILISATION_CYCLES: u32 = 3;

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
    /// Remarks required to interpret the numbers.
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
