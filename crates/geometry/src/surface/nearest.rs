//! Least distance of a convex core or a surface from a surface.
//!
//! Boxes are opened in the order of a lower bound of their distance, by planes: one across the
//! best direction found so far, one across the direction in which the boxes see each other, and
//! the one that their parents left them. The order does not depend on the cutoff, so neither does
//! the result.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use nalgebra::Vector3;

use super::sides::{Boxes, Hint, Mover, ROOTS, Sides, Step};
use crate::convex::gjk::{self, Gap};
use crate::convex::{ConvexCore, CoreSeparation};

/// What is known of a distance from a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Nearest {
    /// The nearest points, on or in the core and on the surface.
    Apart(CoreSeparation),
    /// The distance is certainly larger than the cutoff.
    BeyondCutoff,
    /// A triangle is touched or crossed.
    Crossing,
}

#[derive(Debug, Clone, Copy)]
struct Entry {
    lower_m: f64,
    boxes: Boxes,
    /// Across which the lower bound was found.
    direction: Vector3<f64>,
}

impl PartialEq for Entry {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Entry {}

impl Ord for Entry {
    fn cmp(&self, other: &Self) -> Ordering {
        other
            .lower_m
            .total_cmp(&self.lower_m)
            .then(other.boxes.b.cmp(&self.boxes.b))
            .then(other.boxes.a.cmp(&self.boxes.a))
    }
}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// Distance of A from the surface B, whichever side of it A is on.
///
/// A proven lower bound, at most 1e-10 m and rounding below the distance.
pub(crate) fn nearest(sides: &Sides<'_>, cutoff_m: f64) -> Nearest {
    let mut search = Search {
        sides,
        best: None,
        best_m: f64::INFINITY,
        best_high_m: None,
        hint: Hint(usize::MAX),
    };
    let mut heap = BinaryHeap::with_capacity(64);
    let start = Entry {
        lower_m: f64::NEG_INFINITY,
        boxes: ROOTS,
        direction: Vector3::zeros(),
    };
    heap.push(search.bounded(ROOTS, &start));
    // Something is farther than the cutoff, and was left out.
    let mut is_beyond = false;
    while let Some(entry) = heap.pop() {
        if entry.lower_m > cutoff_m && search.best_m > cutoff_m {
            return Nearest::BeyondCutoff;
        }
        if entry.lower_m >= search.best_m {
            break;
        }
        match sides.open(entry.boxes) {
            Step::Boxes(parts) => {
                for boxes in parts {
                    let part = search.bounded(boxes, &entry);
                    if part.lower_m > cutoff_m {
                        is_beyond = true;
                    } else if part.lower_m < search.best_m {
                        heap.push(part);
                    }
                }
            }
            Step::Leaves(ones, others) => {
                let apart = sides.each_pair(ones, others, |a, b| search.try_pair(a, b, &entry));
                if !apart {
                    return Nearest::Crossing;
                }
            }
        }
    }
    match search.best {
        Some(best) if best.distance_m <= cutoff_m || !is_beyond => Nearest::Apart(best),
        _ if is_beyond => Nearest::BeyondCutoff,
        // Only numbers that are not finite compare with nothing.
        _ => Nearest::Crossing,
    }
}

struct Search<'s> {
    sides: &'s Sides<'s>,
    best: Option<CoreSeparation>,
    best_m: f64,
    /// Largest coordinate along the best normal of a convex A, the same for all boxes of B.
    best_high_m: Option<f64>,
    hint: Hint,
}

impl Search<'_> {
    /// Lower bound of the boxes' distance, never below their parents'.
    fn bounded(&mut self, boxes: Boxes, parent: &Entry) -> Entry {
        let mut entry = Entry { boxes, ..*parent };
        let improve = |entry: &mut Entry, direction: &Vector3<f64>, gap_m: f64| {
            if gap_m > entry.lower_m {
                entry.lower_m = gap_m;
                entry.direction = *direction;
            }
        };
        if let Some(CoreSeparation { normal, .. }) = self.best {
            let gap_m = match self.best_high_m {
                Some(high_m) => self.sides.b.block(boxes.b).low(&normal) - high_m,
                None => self.sides.gap_m(boxes, &normal, &mut self.hint),
            };
            improve(&mut entry, &normal, gap_m);
            if entry.lower_m >= self.best_m {
                return entry;
            }
        }
        if let Some(direction) = self.sides.direction(boxes) {
            let gap_m = self.sides.gap_m(boxes, &direction, &mut self.hint);
            improve(&mut entry, &direction, gap_m);
        }
        entry
    }

    /// Whether the pair is apart.
    fn try_pair(&mut self, a: &ConvexCore, b: &ConvexCore, entry: &Entry) -> bool {
        // Most triangles are beyond the plane of the best one.
        if let (Some(best), Some(high_m), ConvexCore::Triangle(corners)) =
            (&self.best, self.best_high_m, b)
        {
            let low_m = corners.map(|corner| best.normal.dot(&corner));
            if low_m.into_iter().all(|low_m| low_m - high_m >= self.best_m) {
                return true;
            }
        }
        let mut difference = self.sides.difference(a, b, self.hint);
        let towards = match &self.best {
            Some(best) => best.normal,
            None => entry.direction,
        };
        match gjk::distance(&mut difference, &towards, self.best_m) {
            Gap::Apart(found) => {
                if found.distance_m < self.best_m {
                    self.best_m = found.distance_m;
                    self.best = Some(found);
                    let is_convex = matches!(self.sides.a, Mover::Convex { .. });
                    self.best_high_m = is_convex
                        .then(|| self.sides.high_a(ROOTS.a, &found.normal, &mut self.hint));
                }
            }
            Gap::BeyondCutoff => {}
            Gap::Overlap => return false,
        }
        self.hint = Hint(difference.hint());
        true
    }
}
