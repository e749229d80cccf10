//! Recordings to measurements, criteria and the report.
//!
//! Definitions are those of the field: see each field's documentation. SI units and radians.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

pub mod accuracy;
pub mod adjudication;
mod class_clearance;
mod clearance;
pub mod compare;
mod contact;
mod criteria;
mod engine_pairs;
pub mod events;
pub mod excitation;
pub mod iso9283;
mod judge;
pub mod judged;
pub mod metric;
mod motion;
mod needle;
pub mod pareto;
pub mod probability;
mod provenance;
pub mod ranking;
mod ranking_report;
mod reason;
pub mod referee;
pub mod report;
pub mod room;
mod sensitivity;
mod stored;
mod threshold;
pub mod trace;
mod truth;
mod verdict;

pub use clearance::{
    ClearanceSeries, Nearest, certified_clearance, certify_recording, measure_clearance,
    planned_clearance, posture_clearance, recorded_clearance, route_clearance, sample_indices,
};
pub use contact::{ContactEpisode, ForceBalance, add_approach_speeds};
pub use criteria::{
    PostureFault, check_configuration, comparing_engines, criteria_with_limits,
    first_missed_by_posture, judge_posture, worst_miss_by_posture_m,
};
pub use engine_pairs::{largest_over_pairs, pairs};
pub use judge::{EXPECTED, judge, route_is_expected};
pub use motion::{
    ContactMeasurement, EngineDifference, MotionMeasurement, SaturatedJoint, engine_difference,
    measure_motion,
};
pub use needle::{LEAST_SHADOW, NeedleMeasurement, measure_guide, measure_needle, tip_of};
pub use sensitivity::tip_sensitivity;
pub use stored::{StoredConfiguration, StoredReport};
pub use threshold::{BEST, Compared, EVERY, Loss, Rate, Subject, Threshold, ThresholdError};
pub use verdict::{UNCOMPARED, unmeasured_by};
