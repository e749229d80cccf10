//! Gaps between two solids, one or both of them surfaces, that move relative to each other.

use nalgebra::Vector3;

use crate::bounds::OrientedBox;
use crate::convex::gjk::{self, Gap};
use crate::convex::{ConvexCore, Difference};
use crate::placement::Placement;
use crate::prepared::PreparedShape;
use crate::tree::Parts;

/// Two solids at the two ends of a relative motion.
#[derive(Debug, Clone, Copy)]
pub struct MovingSolids<'s> {
    /// The one that moves.
    pub a: &'s PreparedShape,
    /// The one in whose frame it is seen.
    pub b: &'s PreparedShape,
    /// Where it is at either end.
    pub b_from_a: [Placement; 2],
}

/// Gaps that a plane of some direction leaves at both ends, m.
pub type EndGaps = [f64; 2];

/// A part of each of the two.
#[derive(Debug, Clone, Copy)]
struct Boxes {
    a: u32,
    b: u32,
}

const ROOTS: Boxes = Boxes { a: 0, b: 0 };

impl MovingSolids<'_> {
    /// A bound that holds for the distance of the two surfaces all along the motion, or `None` where that is
    /// not shown to be at least `enough_m`.
    ///
    /// `proves` says what planes of two directions, fixed to B, prove of two convex parts by the gaps that they
    /// leave at both ends. Parts that are proven to keep `aim_m` are not looked into. What is inside the
    /// other is not told: who knows that the two are apart at one time knows it, by a positive
    /// bound, of all.
    pub fn least_gap_m(
        &self,
        aim_m: f64,
        enough_m: f64,
        proves: impl Fn(EndGaps, EndGaps) -> f64,
    ) -> Option<f64> {
        let mut least_m = f64::INFINITY;
        let mut stack = vec![(self.box_bound_m(ROOTS, aim_m, &proves), ROOTS)];
        while let Some((bound_m, boxes)) = stack.pop() {
            if bound_m >= aim_m {
                least_m = least_m.min(bound_m);
                continue;
            }
            let parts = |shape: &'_ PreparedShape, part: u32| match shape.surface() {
                Some(tree) => match tree.parts(part) {
                    Parts::Boxes(halves) => Some(halves),
                    Parts::Triangles(_) => None,
                },
                None => None,
            };
            let (halves_a, halves_b) = (parts(self.a, boxes.a), parts(self.b, boxes.b));
            let radius_m =
                [block(self.a, boxes.a), block(self.b, boxes.b)].map(OrientedBox::radius_m);
            let halves = match (halves_a, halves_b) {
                (Some(halves), other) if other.is_none() || radius_m[0] > radius_m[1] => {
                    halves.map(|a| Boxes { a, ..boxes })
                }
                (_, Some(halves)) => halves.map(|b| Boxes { b, ..boxes }),
                _ => {
                    let leaves_m = self.leaves_bound_m(boxes, aim_m, enough_m, &proves)?;
                    least_m = least_m.min(leaves_m);
                    continue;
                }
            };
            let [one, other] = halves.map(|boxes| (self.box_bound_m(boxes, aim_m, &proves), boxes));
            // The nearer one is on top: where there is no proof, it shows soon.
            if one.0 <= other.0 {
                stack.extend([other, one]);
            } else {
                stack.extend([one, other]);
            }
        }
        Some(least_m)
    }

    /// What is proven of two boxes, by the directions in which they see each other at the ends.
    fn box_bound_m(
        &self,
        boxes: Boxes,
        aim_m: f64,
        proves: &impl Fn(EndGaps, EndGaps) -> f64,
    ) -> f64 {
        let (block_a, block_b) = (block(self.a, boxes.a), block(self.b, boxes.b));
        let mut known: Option<EndGaps> = None;
        let mut best_m = f64::NEG_INFINITY;
        for placement in &self.b_from_a {
            let on_b = block_b.nearest(&placement.point(&block_a.centre));
            let on_a = placement.point(&block_a.nearest(&placement.inverse_point(&on_b)));
            let Some(direction) = (on_b - on_a).try_normalize(0.0) else {
                continue;
            };
            let low_b_m = -highest(self.b, boxes.b, &-direction);
            let gaps = self.b_from_a.each_ref().map(|placement| {
                let in_a = placement.rotation.tr_mul(&direction);
                low_b_m - highest(self.a, boxes.a, &in_a) - direction.dot(&placement.translation)
            });
            best_m = best_m.max(proves(gaps, known.unwrap_or(gaps)));
            if best_m >= aim_m {
                break;
            }
            known = Some(gaps);
        }
        best_m
    }

    /// The least that is proven of any two convex pieces of two leaves.
    fn leaves_bound_m(
        &self,
        boxes: Boxes,
        aim_m: f64,
        enough_m: f64,
        proves: &impl Fn(EndGaps, EndGaps) -> f64,
    ) -> Option<f64> {
        let mut least_m = f64::INFINITY;
        for_each_core(self.a, boxes.a, |core_a, radius_a_m| {
            for_each_core(self.b, boxes.b, |core_b, radius_b_m| {
                let radius_m = radius_a_m + radius_b_m;
                let bound_m = self.core_bound_m(core_a, core_b, radius_m, aim_m, proves);
                least_m = least_m.min(bound_m);
                // Also false for what is no number.
                least_m >= enough_m
            })
        })
        .then_some(least_m)
    }

    fn core_bound_m(
        &self,
        a: &ConvexCore,
        b: &ConvexCore,
        radius_m: f64,
        aim_m: f64,
        proves: &impl Fn(EndGaps, EndGaps) -> f64,
    ) -> f64 {
        let mut known: Option<EndGaps> = None;
        let mut bound_m = f64::NEG_INFINITY;
        for placement in self.b_from_a {
            let mut difference = Difference::new(a, b, placement);
            let Gap::Apart(found) =
                gjk::distance(&mut difference, &Vector3::zeros(), f64::INFINITY)
            else {
                return f64::NEG_INFINITY;
            };
            let gaps = self.b_from_a.map(|placement| {
                let farthest = Difference::new(a, b, placement).support(&found.normal);
                -found.normal.dot(&farthest.x) - radius_m
            });
            bound_m = bound_m.max(proves(gaps, known.unwrap_or(gaps)));
            if bound_m >= aim_m {
                break;
            }
            known = Some(gaps);
        }
        bound_m
    }
}

/// A box around a part; a convex shape is one part.
fn block(shape: &PreparedShape, part: u32) -> &OrientedBox {
    match shape.surface() {
        Some(tree) => tree.block(part),
        None => &shape.block,
    }
}

/// Largest coordinate of a part along a unit vector, m.
fn highest(shape: &PreparedShape, part: u32, direction: &Vector3<f64>) -> f64 {
    let Some(tree) = shape.surface() else {
        let mut hint = usize::MAX;
        return direction.dot(&shape.core_support(direction, &mut hint)) + shape.radius_m;
    };
    match tree.parts(part) {
        Parts::Boxes(_) => tree.block(part).high(direction),
        Parts::Triangles(triangles) => triangles
            .as_flattened()
            .iter()
            .map(|corner| direction.dot(corner))
            .fold(f64::NEG_INFINITY, f64::max),
    }
}

/// Calls `visit` with the convex pieces of a leaf and the radius about each, until it returns false; whether
/// it never did.
fn for_each_core(
    shape: &PreparedShape,
    part: u32,
    mut visit: impl FnMut(&ConvexCore, f64) -> bool,
) -> bool {
    match shape.surface().map(|tree| tree.parts(part)) {
        Some(Parts::Triangles(triangles)) => triangles
            .iter()
            .all(|&triangle| visit(&ConvexCore::Triangle(triangle), 0.0)),
        _ => visit(&shape.core, shape.radius_m),
    }
}
