//! Translations of A, each proven to part the two sides.
//!
//! A triangle's *exit* along a direction is the length of way after which A has left it for good.
//! A way of length `t` parts A from the surface if no triangle that A touches on the way has a
//! larger exit: what A would still touch at its end, it has touched on the way. Whether A is then
//! outside and not within the solid is left to a winding number.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use nalgebra::Vector3;

use super::nearest::{Nearest, nearest};
use super::sides::{Boxes, Hint, Mover, ROOTS, Sides, Step};
use crate::convex::ConvexCore;
use crate::convex::gjk::{self, Gap};

/// Exits are found to this, m.
const EXIT_GAP_M: f64 = 1e-11;

/// How far beyond its end a way is asked for what is inside of what, m.
const BEYOND_M: f64 = 1e-9;

/// Steps from a plane above a triangle down to its exit. They converge faster than any power;
/// where rounding ends them early, the exit is too late, which is the safe side.
const EXIT_STEPS: usize = 40;

/// Rounds in which a way is prolonged because it meets something new.
const ROUNDS: usize = 100;

/// A straight way that parts A from a solid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SeparatingTranslation {
    pub length_m: f64,
    /// Unit vector along which A leaves.
    pub direction: Vector3<f64>,
    /// Point of A's core that touches last, before it moves.
    pub on_a: Vector3<f64>,
}

/// Where A, with a radius around it, leaves the surface for good if it moves along a direction.
#[derive(Debug, Clone, Copy)]
struct Exit {
    length_m: f64,
    on_a: Vector3<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Entry {
    /// Upper bound of the exit.
    latest_m: f64,
    boxes: Boxes,
}

impl Eq for Entry {}

impl Ord for Entry {
    fn cmp(&self, other: &Self) -> Ordering {
        self.latest_m
            .total_cmp(&other.latest_m)
            .then(other.boxes.b.cmp(&self.boxes.b))
            .then(other.boxes.a.cmp(&self.boxes.a))
    }
}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// The shortest way along `direction` that the rounds find, if it is shorter than `limit_m`.
pub(crate) fn separating_translation(
    sides: &Sides<'_>,
    radius_m: f64,
    direction: &Vector3<f64>,
    limit_m: f64,
) -> Option<SeparatingTranslation> {
    let mut length_m = 0.0;
    let mut last: Option<Exit> = None;
    for _ in 0..ROUNDS {
        while let Some(exit) = latest_exit(sides, radius_m, direction, length_m, limit_m) {
            length_m = exit.length_m;
            last = Some(exit);
            if length_m >= limit_m {
                return None;
            }
        }
        // A little further, because a point on the surface is neither inside nor outside.
        let there = sides.moved(&(direction * (length_m + BEYOND_M)));
        if !is_within(&there) {
            let on_a = last.map_or_else(|| sides.centre_a(), |exit| exit.on_a);
            return Some(SeparatingTranslation {
                length_m,
                direction: *direction,
                on_a,
            });
        }
        // Inside and free to all sides: on to where something may be touched again.
        let Nearest::Apart(found) = nearest(&there, f64::INFINITY) else {
            return None;
        };
        length_m += BEYOND_M + found.distance_m;
        last = None;
        if length_m >= limit_m {
            return None;
        }
    }
    None
}

/// Whether one side is within the other, given that their surfaces do not cross.
pub(crate) fn is_within(sides: &Sides<'_>) -> bool {
    match &sides.a {
        Mover::Convex { core, .. } => sides
            .b
            .contains(&sides.b_from_a.point(&core.some_point()).into()),
        Mover::Surface(tree) => {
            let place = &sides.b_from_a;
            let mut of_a = tree.anchors.iter();
            let mut of_b = sides.b.anchors.iter();
            of_a.any(|anchor| sides.b.contains(&place.point(anchor).into()))
                || of_b.any(|anchor| tree.contains(&place.inverse_point(anchor).into()))
        }
    }
}

/// The latest exit, beyond `length_m`, of the triangles that A touches on its way of that length; one that is
/// no earlier than `limit_m` where there is such a one.
///
/// Boxes are opened from the latest that they could be left.
fn latest_exit(
    sides: &Sides<'_>,
    radius_m: f64,
    direction: &Vector3<f64>,
    length_m: f64,
    limit_m: f64,
) -> Option<Exit> {
    let way = sides.swept(&(direction * length_m));
    let mut hint = Hint(usize::MAX);
    let backwards = -direction;
    let latest_m = |boxes: Boxes, hint: &mut Hint| {
        sides.b.block(boxes.b).high(direction) + sides.high_a(boxes.a, &backwards, hint) + radius_m
    };
    let mut latest: Option<Exit> = None;
    let mut beyond_m = length_m + EXIT_GAP_M;
    let mut heap = BinaryHeap::with_capacity(64);
    heap.push(Entry {
        latest_m: latest_m(ROOTS, &mut hint),
        boxes: ROOTS,
    });
    while let Some(entry) = heap.pop() {
        if entry.latest_m <= beyond_m {
            break;
        }
        match sides.open(entry.boxes) {
            Step::Boxes(parts) => {
                for boxes in parts {
                    let part = Entry {
                        latest_m: latest_m(boxes, &mut hint),
                        boxes,
                    };
                    if part.latest_m > beyond_m && is_touched(&way, boxes, radius_m, &mut hint) {
                        heap.push(part);
                    }
                }
            }
            Step::Leaves(ones, others) => {
                sides.each_pair(ones, others, |a, b| {
                    let found = exit(
                        sides,
                        &way,
                        (a, b),
                        radius_m,
                        direction,
                        [beyond_m, limit_m],
                    );
                    if let Some(found) = found {
                        beyond_m = found.length_m;
                        latest = Some(found);
                    }
                    beyond_m < limit_m
                });
                if beyond_m >= limit_m {
                    break;
                }
            }
        }
    }
    latest
}

/// Whether no plane that is tried shows the boxes to be apart by more than the radius.
pub(crate) fn is_touched(sides: &Sides<'_>, boxes: Boxes, radius_m: f64, hint: &mut Hint) -> bool {
    sides
        .direction(boxes)
        .is_none_or(|across| sides.gap_m(boxes, &across, hint) <= radius_m)
}

/// Whether two pieces come within the radius of each other, sides swept or not.
pub(crate) fn touches(
    sides: &Sides<'_>,
    (a, b): (&ConvexCore, &ConvexCore),
    radius_m: f64,
) -> bool {
    let mut difference = sides.difference(a, b, Hint(usize::MAX));
    let towards = sides.b.block(0).centre - sides.b_from_a.translation;
    match gjk::distance(&mut difference, &towards, radius_m) {
        Gap::Overlap => true,
        Gap::BeyondCutoff => false,
        Gap::Apart(found) => found.distance_m <= radius_m,
    }
}

/// When A leaves a triangle, if it touches it on its way and leaves it after `beyond_m`; the limit itself where
/// that is later.
fn exit(
    sides: &Sides<'_>,
    way: &Sides<'_>,
    (a, b): (&ConvexCore, &ConvexCore),
    radius_m: f64,
    direction: &Vector3<f64>,
    [beyond_m, limit_m]: [f64; 2],
) -> Option<Exit> {
    let farthest = sides
        .difference(a, b, Hint(usize::MAX))
        .support(&-direction);
    // Here a plane across the direction has A on one side and the triangle on the other.
    let mut length_m = radius_m - direction.dot(&farthest.x);
    if length_m <= beyond_m || !touches(way, (a, b), radius_m) {
        return None;
    }
    let mut on_a = farthest.a;
    // Still touched there: when exactly it is left does not matter.
    if length_m > limit_m && touches(&sides.moved(&(direction * limit_m)), (a, b), radius_m) {
        let length_m = limit_m;
        return Some(Exit { length_m, on_a });
    }
    for _ in 0..EXIT_STEPS {
        let there = sides.moved(&(direction * length_m));
        let mut difference = there.difference(a, b, Hint(usize::MAX));
        let Gap::Apart(found) = gjk::distance(&mut difference, &-direction, f64::INFINITY) else {
            break;
        };
        let gap_m = found.distance_m - radius_m;
        // Back along the way, the plane that parts the two comes closer at this rate.
        let rate = -direction.dot(&found.normal);
        if gap_m <= EXIT_GAP_M || rate <= 0.0 {
            break;
        }
        on_a = found.on_a - direction * length_m;
        length_m -= gap_m / rate;
        if length_m <= beyond_m {
            return None;
        }
    }
    Some(Exit { length_m, on_a })
}
