//! Change of accuracy and repeatability from the first cycles to later ones.

use serde::Serialize;

use super::statistics::pose_statistics;
use super::{Attained, Commanded};

/// Cycles per block: the standard measures drift by ten cycles at a time.
const BLOCK_CYCLES: usize = 10;

/// Drift of pose characteristics at one pose, from blocks of ten cycles.
///
/// The standard's test lasts eight hours from a cold start; this is the same evaluation of however
/// long the measurements took.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Drift {
    /// Number of the pose.
    pub pose: u32,
    /// Largest `|AP of the first block - AP of a later one|`, m.
    pub dap_m: f64,
    /// Largest `|RP of the first block - RP of a later one|`, m.
    pub drp_m: f64,
    /// The blocks.
    pub blocks: Vec<DriftBlock>,
}

/// Ten cycles.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DriftBlock {
    /// First cycle.
    pub first_cycle: u32,
    /// Last cycle.
    pub last_cycle: u32,
    /// Time of the first measurement, s, where it is known.
    pub time_s: Option<f64>,
    /// AP of the block, m.
    pub ap_m: f64,
    /// RP of the block, m.
    pub rp_m: f64,
}

/// Drift at a commanded pose, by the cycles in their order; none with fewer than two blocks.
/// Cycles beyond the last whole block are left out.
pub fn drift(command: &Commanded, attained: &[Attained]) -> Option<Drift> {
    let mut here: Vec<&Attained> = attained
        .iter()
        .filter(|each| each.pose == command.pose && each.axis.is_none())
        .collect();
    here.sort_by_key(|each| each.cycle);
    let blocks: Vec<DriftBlock> = here
        .chunks_exact(BLOCK_CYCLES)
        .map(|block| {
            let statistics = pose_statistics(command, block);
            DriftBlock {
                first_cycle: block[0].cycle,
                last_cycle: block[BLOCK_CYCLES - 1].cycle,
                time_s: block[0].time_s,
                ap_m: statistics.ap_m,
                rp_m: statistics.rp_m,
            }
        })
        .collect();
    let (first, later) = blocks.split_first()?;
    if later.is_empty() {
        return None;
    }
    let largest = |value: fn(&DriftBlock) -> f64| {
        let changes = later.iter().map(|each| (value(each) - value(first)).abs());
        changes.fold(0.0, f64::max)
    };
    Some(Drift {
        pose: command.pose,
        dap_m: largest(|each| each.ap_m),
        drp_m: largest(|each| each.rp_m),
        blocks,
    })
}
