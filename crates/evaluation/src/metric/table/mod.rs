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

/// The metrics, group by group, in the order of reports.
pub fn groups() -> &'static [&'static [Metric]] {
    &[
        posture::POSTURE,
        needle::PREDICTED,
        needle::SIMULATED,
        effort::EFFORT,
        effort::ENGINES_COMPARED,
        needle::BUDGET,
        people::PEOPLE,
        clearance::CLEARANCE,
        clearance::LEAST_CLEARANCE,
        clearance::ARM_TO_SKIN,
        clearance::TO_TABLE,
        clearance::TO_GANTRY,
        clearance::TO_MOUNT,
        clearance::TO_OBSTACLES,
        clearance::SELF_CLEARANCE,
        clearance::TOOL_TO_SKIN,
        clearance::GUIDE_TO_SKIN,
        clearance::NEEDLE_CORRIDOR,
        clearance::NEEDLE_ROUTE,
        clearance::MARGIN,
    ]
}
