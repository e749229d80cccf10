//! How deep solids are in the patient, measured where a bound of travel does not say it.

use std::cell::RefCell;

use needlebench_geometry::{Placement, PreparedShape, Solid, separation};

use super::{Corners, SOFT_M, Standing, overlap};
use crate::resolve::PlacedPhantom;
use crate::resolve::phantom::UnplacedPhantom;

/// What the patient lies beside.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Beside {
    Base,
    Mount,
    Table,
    Gantry,
    /// The obstacles that are there, which have their prepared shapes.
    Obstacles,
}

/// Number of kinds.
const KINDS: usize = 5;

/// What is known of the solids of one cell beside a patient who is moved and of which all else stays.
///
/// It only saves time: no answer depends on it. Fresh, it knows nothing.
#[derive(Debug, Default)]
pub(crate) struct KnownDepths(RefCell<[KnownKind; KINDS]>);

/// Solids of one kind.
#[derive(Debug, Default)]
struct KnownKind {
    /// Of all of them.
    gap: Option<Gap>,
    solids: Vec<KnownSolid>,
}

#[derive(Debug, Default)]
struct KnownSolid {
    shape: Option<PreparedShape>,
    corners: Option<Corners>,
    gap: Option<Gap>,
}

/// A distance from the skin, m, or less, with the patient at a place.
#[derive(Debug, Clone, Copy)]
struct Gap {
    place: Placement,
    gap_m: f64,
}

impl Standing<'_> {
    /// The number of the solid that is deepest in the patient, and how deep, m, if that is more than
    /// [`SOFT_M`]; of all that there are of a kind. `boxed` leaves out what boxes show to be no deeper.
    ///
    /// A distance above zero is less by no more than the patient's travel since it was measured, so that
    /// nobody needs to measure again where more of it is left.
    pub(super) fn depth_in_patient<'s>(
        &self,
        beside: Beside,
        solids: impl Iterator<Item = &'s Solid>,
        boxed: bool,
    ) -> Option<(usize, f64)> {
        let (placed, unplaced) = self.phantom?;
        let mut all = self.known.0.borrow_mut();
        let known = &mut all[beside as usize];
        let place = Placement::new(&placed.world_from_phantom);
        let left_m = |gap: &Gap| {
            let travel_m = if placed.modelled() == 1 {
                unplaced.travel_m(&gap.place, &place)
            } else if gap.place.rotation == place.rotation {
                (gap.place.translation - place.translation).norm()
            } else {
                // Limbs lie otherwise on a patient who is turned.
                f64::INFINITY
            };
            gap.gap_m - travel_m
        };
        if known.gap.as_ref().is_some_and(|gap| left_m(gap) > 0.0) {
            return None;
        }
        let limbs: Vec<(PreparedShape, Solid)> = placed
            .outside()
            // The couch of a scan lies where the room has its table.
            .take(placed.modelled())
            .skip(1)
            .map(|limb| (PreparedShape::new(&limb.shape), limb))
            .collect();
        let patient = patient_box(unplaced, placed);
        let skin_at = placed.world_from_phantom * placed.phantom.skin().parent_from_shape;
        let (mut deepest, mut least_m) = (None, f64::INFINITY);
        for (index, solid) in solids.enumerate() {
            if known.solids.len() == index {
                known.solids.push(KnownSolid::default());
            }
            let known = &mut known.solids[index];
            let left_m = known.gap.as_ref().map_or(f64::NEG_INFINITY, left_m);
            if left_m > 0.0 {
                least_m = least_m.min(left_m);
                continue;
            }
            if boxed {
                let corners = known.corners.get_or_insert_with(|| solid.bounding_box());
                if !overlap(corners, &patient, SOFT_M) {
                    least_m = least_m.min(gap_of_boxes_m(corners, &patient));
                    continue;
                }
            }
            let shape = match beside {
                Beside::Obstacles => self.obstacles[index].prepared(),
                _ => known
                    .shape
                    .get_or_insert_with(|| PreparedShape::new(&solid.shape)),
            };
            let at = &solid.parent_from_shape;
            let chest_m = separation(shape, at, unplaced.skin(), &skin_at).distance_m;
            let of_limbs = limbs.iter().map(|(limb, solid)| {
                separation(shape, at, limb, &solid.parent_from_shape).distance_m
            });
            let gap_m = of_limbs.fold(chest_m, f64::min);
            known.gap = Some(Gap { place, gap_m });
            least_m = least_m.min(gap_m);
            let most_m = deepest.map_or(SOFT_M, |(_, depth_m)| depth_m);
            if -gap_m > most_m {
                deepest = Some((index, -gap_m));
            }
        }
        known.gap = Some(Gap {
            place,
            gap_m: least_m,
        });
        deepest
    }
}

/// The box of all of a patient.
pub(in crate::resolve) fn patient_box(
    unplaced: &UnplacedPhantom,
    placed: &PlacedPhantom,
) -> Corners {
    let chest = unplaced.extent(&placed.world_from_phantom);
    let limbs = placed.outside().skip(1).map(|limb| limb.bounding_box());
    limbs.fold(chest, |(low, high), limb| {
        (low.inf(&limb.0), high.sup(&limb.1))
    })
}

/// How far two boxes are apart along the axis where that is most, m; negative where they overlap.
fn gap_of_boxes_m(a: &Corners, b: &Corners) -> f64 {
    let along = |axis: usize| (a.0[axis] - b.1[axis]).max(b.0[axis] - a.1[axis]);
    (0..3).map(along).fold(f64::NEG_INFINITY, f64::max)
}
