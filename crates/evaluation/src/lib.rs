//! Recordings to measurements, criteria and the report.
//!
//! Definitions are those of the field: see each field's documentation. SI units and radians.

mod clearance;
mod criteria;
mod judge;
mod motion;
mod needle;
pub mod report;

pub use clearance::{
    ClearanceSeries, certify_recording, measure_clearance, needle_route, planned_clearance,
    posture_clearance, sample_indices,
};
pub use criteria::{Criterion, check_configuration};
pub use judge::{judge, recommend};
pub use motion::{EngineDifference, MotionMeasurement, engine_difference, measure_motion};
pub use needle::{NeedleMeasurement, measure_needle};
