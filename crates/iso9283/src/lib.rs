//! Accuracy and repeatability of a robot by ISO 9283:1998, from attained poses however measured:
//! simulated ones and those of a real robot go the same way.
//!
//! Positions are of the measured point in the robot's base frame. An attained orientation enters
//! as the small rotation from the commanded to the attained one, about the axes of the base frame:
//! its components are the standard's differences of angles `a`, `b` and `c` to first order, and
//! have none of the singularities of Euler angles.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

mod arrival;
mod columns;
mod drift;
mod log;
mod log_units;
mod measured;
mod number;
mod statistics;
mod table;
mod timestamp;
mod written;

pub use arrival::{Arrival, Stabilisation, stabilisation};
pub use drift::{Drift, DriftBlock, drift};
pub use log::{TrackerLog, read_commanded, read_log};
pub use log_units::{LogUnits, RotationColumns};
pub use measured::{FrameFit, MeasuredError, MeasuredReport, measured_report};
pub use statistics::{
    AngleStatistics, DirectionalVariation, PoseStatistics, ProtocolStatistics, StatisticsError,
    evaluate, mean_vector,
};
pub use written::{write_commanded, write_log};

use nalgebra::{Point3, UnitQuaternion};

/// Cycles of a test, as the standard has them.
pub const STANDARD_CYCLES: u32 = 30;

/// A commanded pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Commanded {
    /// Number of the pose, from 1.
    pub pose: u32,
    /// Position of the measured point, base frame, m.
    pub position_m: Point3<f64>,
    /// Orientation in the base frame, where it is known.
    pub orientation: Option<UnitQuaternion<f64>>,
}

/// One measurement of an attained pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Attained {
    /// Number of the pose, from 1.
    pub pose: u32,
    /// Number of the cycle, from 1.
    pub cycle: u32,
    /// Axis along which it was approached, 0 to 2 for x to z; none in the plain sequence.
    pub axis: Option<usize>,
    /// When, s, where it is known.
    pub time_s: Option<f64>,
    /// Position of the measured point, base frame, m.
    pub position_m: Point3<f64>,
    /// Orientation in the base frame, where it was measured.
    pub orientation: Option<UnitQuaternion<f64>>,
}

/// Names of the axes.
pub const AXES: [&str; 3] = ["x", "y", "z"];
