//! The table of metrics, group by group.
//!
//! `CONTRIBUTING.md` says how to add one. Within a family, and among metrics with the same ranking
//! key, role or criterion, what says less stands before what says more.

mod clearance;
mod effort;
mod needle;
mod people;
mod posture;

use needlebench_cell::study::StudyMode::{self, Dynamic, Planned, Static};

use super::entry::Metric;

/// Assumed: less than anybody would move a robot for.
const CLEARANCE_RESOLUTION_M: f64 = 0.5e-3;
/// Far below what any needle robot reaches, far above the rounding of two engines.
const NEEDLE_RESOLUTION_M: f64 = 1e-6;
/// One per cent of a quantity from 0 to 1.
const SHARE_RESOLUTION: f64 = 0.01;

const MM: f64 = 1e-3;

/// Cases that are judged without engines.
const UNSIMULATED: &[StudyMode] = &[Static, Planned];
/// Cases that have a motion.
const MOVING: &[StudyMode] = &[Planned, Dynamic];
const ALL: &[StudyMode] = &[Static, Planned, Dynamic];

/// Metrics that stand together, under a heading.
#[derive(Debug, Clone, Copy)]
pub struct Group {
    /// What they are of, as a heading.
    pub title: &'static str,
    /// The metrics, in the order of reports.
    pub metrics: &'static [Metric],
}

const fn group(title: &'static str, metrics: &'static [Metric]) -> Group {
    Group { title, metrics }
}

/// The metrics, group by group, in the order of reports.
pub const GROUPS: &[Group] = &[
    group("The posture", posture::POSTURE),
    group("The needle, without engines", needle::PREDICTED),
    group("The needle, simulated", needle::SIMULATED),
    group("Motion and effort", effort::EFFORT),
    group("Engines compared", effort::ENGINES_COMPARED),
    group("The needle, over all arms and patients", needle::BUDGET),
    group("People", people::PEOPLE),
    group(
        "Clearance of arm and tool from their surroundings",
        clearance::CLEARANCE,
    ),
    group("Least clearance of all", clearance::LEAST_CLEARANCE),
    group("Arm to skin", clearance::ARM_TO_SKIN),
    group("To the table", clearance::TO_TABLE),
    group("To the gantry", clearance::TO_GANTRY),
    group("To the mount", clearance::TO_MOUNT),
    group("To obstacles", clearance::TO_OBSTACLES),
    group("To people", clearance::TO_PEOPLE),
    group("The arm from itself", clearance::SELF_CLEARANCE),
    group("Tool to skin", clearance::TOOL_TO_SKIN),
    group("Guide to skin", clearance::GUIDE_TO_SKIN),
    group("Behind the guide", clearance::NEEDLE_CORRIDOR),
    group("The needle's route", clearance::NEEDLE_ROUTE),
    group("What a motion may keep", clearance::MARGIN),
];
