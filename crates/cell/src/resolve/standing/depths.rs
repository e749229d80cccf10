//! How deep solids are in the patient, measured where a bound of travel does not say it.

use std::cell::RefCell;
use std::collections::BTreeMap;

use needlebench_geometry::{Placement, PreparedShape, Solid, separation};

use super::{Corners, SOFT_M, Standing, overlap, skin_pose};

/// A solid beside which the patient lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Beside {
    /// One of the solids of the robot's base.
    Base(usize),
    Mount(usize),
    Table(usize),
    Gantry(usize),
    /// One of the obstacles that are there, which have their prepared shapes.
    Obstacle(usize),
}

/// What is known of the solids of one cell beside a patient who is moved and of which all else stays.
///
/// It only saves time: no answer depends on it. Fresh, it knows nothing.
#[derive(Debug, Default)]
pub(crate) struct KnownDepths(RefCell<BTreeMap<Beside, Known>>);

#[derive(Debug, Default)]
struct Known {
    shape: Option<PreparedShape>,
    corners: Option<Corners>,
    /// Where the patient lay when the distance from the skin was measured, and the distance, m.
    gap: Option<(Placement, f64)>,
}

impl Standing<'_> {
    /// How deep a solid is in the patient, m; nothing where they are apart. `boxed` leaves out what boxes
    /// show to be no deeper than [`SOFT_M`].
    ///
    /// A distance above zero is less by no more than the patient's travel since it was measured, so that
    /// nobody needs to measure again where more of it is left.
    pub(super) fn depth_in_patient(&self, beside: Beside, solid: &Solid, boxed: bool) -> f64 {
        let Some((placed, unplaced)) = self.phantom else {
            return 0.0;
        };
        let mut all = self.known.0.borrow_mut();
        let known = all.entry(beside).or_default();
        let place = Placement::new(&placed.world_from_phantom);
        let is_apart = |(from, gap_m): &(Placement, f64)| unplaced.travel_m(from, &place) < *gap_m;
        if known.gap.as_ref().is_some_and(is_apart) {
            return 0.0;
        }
        if boxed {
            let corners = known.corners.get_or_insert_with(|| solid.bounding_box());
            if !overlap(
                corners,
                &unplaced.extent(&placed.world_from_phantom),
                SOFT_M,
            ) {
                return 0.0;
            }
        }
        let shape = match beside {
            Beside::Obstacle(place) => self.obstacles[place].prepared(),
            _ => known
                .shape
                .get_or_insert_with(|| PreparedShape::new(&solid.shape)),
        };
        let at = &solid.parent_from_shape;
        let found = separation(shape, at, unplaced.skin(), &skin_pose(placed));
        known.gap = Some((place, found.distance_m));
        (-found.distance_m).max(0.0)
    }
}
