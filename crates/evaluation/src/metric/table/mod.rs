//! The table of metrics, group by group.
//!
//! `CONTRIBUTING.md` says how to add one. Within a family, and among metrics with the same ranking
//! key, role or criterion, what says less stands before what says more.

mod clearance;
mod effort;
mod needle;
mod people;
mod posture;

use needlebench_scenario::study::StudyMode::{self, Dynamic, Planned, Static};

use super::entry::Metric;

/// Assumed: too little to move a robot for.
const CLEARANCE_RESOLUTION_M: f64 = 0.5e-3;
/// Far below what any needle robot reaches, far above the rounding of two engines.
const NEEDLE_RESOLUTION_M: f64 = 1e-6;
/// One per cent of a quantity from 0 to 1.
const SHARE_RESOLUTION: f64 = 0.01;

const MM: f64 = 1e-3;

/// Cases that are evaluated without engines.
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
    group("Posture", posture::POSTURE),
    group("Needle, static equilibrium", needle::PREDICTED),
    group("Needle, simulated", needle::SIMULATED),
    group("Motion and effort", effort::EFFORT),
    group("Engine differences", effort::ENGINES_COMPARED),
    group("Needle, arm and patient population", needle::BUDGET),
    group("People", people::PEOPLE),
    group("Clearance from the surroundings", clearance::CLEARANCE),
    group(
        "Minimum clearance of all bodies",
        clearance::LEAST_CLEARANCE,
    ),
    group("Arm to skin", clearance::ARM_TO_SKIN),
    group("Arm and tool to table", clearance::TO_TABLE),
    group("Arm and tool to gantry", clearance::TO_GANTRY),
    group("Arm and tool to mount", clearance::TO_MOUNT),
    group("Arm and tool to obstacles", clearance::TO_OBSTACLES),
    group("Arm and tool to people", clearance::TO_PEOPLE),
    group("Self-clearance", clearance::SELF_CLEARANCE),
    group("Tool to skin", clearance::TOOL_TO_SKIN),
    group("Guide to skin", clearance::GUIDE_TO_SKIN),
    group("Access zone behind the guide", clearance::NEEDLE_CORRIDOR),
    group("Needle path", clearance::NEEDLE_ROUTE),
    group("Motion margins", clearance::MARGIN),
];
