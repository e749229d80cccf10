//! What the planned needle passes on its way.

use needlebench_cell::phantom::{Phantom, Tissue};
use needlebench_cell::{Cell, Goal, PlacedPhantom};
use needlebench_clearance::ROUNDING_M;
use needlebench_geometry::{PreparedSolids, Separation};

use crate::clearance::class_clearance;
use crate::report::ClassClearance;

/// Bones, vessels and organs of a phantom, made ready for many needles.
#[derive(Debug)]
pub struct RouteObstacles {
    solids: PreparedSolids,
    /// Name and organ of each.
    parts: Vec<(String, Option<String>)>,
}

impl RouteObstacles {
    /// Prepares what a needle of this phantom should keep away from. Lesions and the skin do not
    /// count.
    pub fn new(phantom: &Phantom) -> Self {
        let parts = phantom
            .parts
            .iter()
            .filter(|part| matches!(part.tissue, Tissue::Bone | Tissue::Vessel | Tissue::Organ));
        let solids: Vec<_> = parts.clone().map(|part| part.solid.clone()).collect();
        Self {
            solids: PreparedSolids::new(&solids),
            parts: parts
                .map(|part| (part.solid.name.clone(), part.organ.clone()))
                .collect(),
        }
    }

    /// What the planned needle, from skin to target, comes nearest to: its name, and the signed
    /// distance with the needle as A.
    ///
    /// The organ that contains the target is left out: the needle has to enter it. `placed` is the
    /// phantom that this was made of.
    pub fn nearest(
        &self,
        cell: &Cell,
        placed: &PlacedPhantom,
        goal: &Goal,
    ) -> Option<(&str, Separation)> {
        let entry = goal.entry_m?;
        let counts =
            |index: usize| goal.target_organ.is_none() || self.parts[index].1 != goal.target_organ;
        let (index, separation) = self.solids.nearest_to_segment(
            &entry,
            &goal.target_m,
            0.5 * cell.tool.needle.outer_diameter_m,
            &placed.world_from_phantom,
            counts,
        )?;
        Some((&self.parts[index].0, separation))
    }
}

/// Clearance of the planned needle, from skin to target, from bone, vessels and organs; see
/// [`RouteObstacles`].
pub fn needle_route(cell: &Cell, placed: &PlacedPhantom, goal: &Goal) -> Option<ClassClearance> {
    let obstacles = RouteObstacles::new(&placed.phantom);
    let (solid, separation) = obstacles.nearest(cell, placed, goal)?;
    Some(ClassClearance {
        // One exact distance that is never optimistic, but for rounding.
        certified_lower_bound_m: Some(separation.distance_m - ROUNDING_M),
        ..class_clearance(("needle", solid), &separation, "insertion", None, None)
    })
}
