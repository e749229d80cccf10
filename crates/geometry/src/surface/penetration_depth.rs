//! Depth of a convex core or a surface that is partly or wholly inside a solid.
//!
//! The depth of a penetration is the length of the shortest motion without turning that ends it.
//! Beyond convex shapes that cannot be found in reasonable time. Reported is the shortest of a set
//! of straight ways out, each proven: an upper bound, so that the signed distance is never
//! optimistic. Tried are the shortest way out of the convex hull, the way to the nearest point
//! of the surface, and the ways across the pieces of surface that are touched; the best is then
//! refined as the shortest way out of the convex hull of the surface around it.

use nalgebra::{Point3, Vector3};

use super::nearest::{Nearest, nearest};
use super::separating_translation::{
    SeparatingTranslation, is_touched, separating_translation, touches,
};
use super::sides::{Boxes, Hint, Mover, ROOTS, Sides, Step};
use crate::bounds::BoundingCapsule;
use crate::convex::gjk::{self, Gap};
use crate::convex::{ConvexCore, CoreSeparation, Difference, Polyhedron, epa};
use crate::placement::Placement;
use crate::tree::by_coordinates;

/// Touched triangles that are looked at for directions. More are left out, which can only make
/// the way out longer.
const TOUCHED: usize = 256;

/// Directions taken from touched triangles.
const ACROSS: usize = 8;

/// Cosine above which two directions count as one: 20 degrees.
const ALIKE: f64 = 0.94;

/// Rounds of refinement.
const REFINEMENTS: usize = 6;

/// Difference of unit vectors below which the refinement has settled.
const SAME_DIRECTION: f64 = 1e-9;

/// How far down a patch is continued, in its own extents.
const PATCH_DEPTH: f64 = 4.0;

/// The shortest way out that is found, or `None` if one is so short that the signed distance is
/// certainly above `cutoff_m`.
pub(crate) fn penetration_depth(
    sides: &Sides<'_>,
    radius_m: f64,
    cutoff_m: f64,
) -> Option<SeparatingTranslation> {
    let mut best = out_of_hull(sides, radius_m);
    let is_short = |best: &SeparatingTranslation| -best.length_m > cutoff_m;
    for direction in directions(sides, radius_m) {
        if is_short(&best) {
            return None;
        }
        if let Some(found) = separating_translation(sides, radius_m, &direction, best.length_m) {
            best = found;
        }
    }
    let mut around = Vec::new();
    let mut direction = best.direction;
    for _ in 0..REFINEMENTS {
        if is_short(&best) {
            return None;
        }
        let way = sides.swept(&(direction * best.length_m));
        around.extend(touched(&way, radius_m, &direction).into_iter().flatten());
        around.sort_unstable_by(by_coordinates);
        around.dedup();
        let Some(next) = out_of_patch(sides, &around, &best.direction, best.length_m) else {
            break;
        };
        if (next - direction).norm() < SAME_DIRECTION {
            break;
        }
        direction = next;
        if let Some(found) = separating_translation(sides, radius_m, &direction, best.length_m) {
            best = found;
        }
    }
    if is_short(&best) { None } else { Some(best) }
}

/// The shortest way out of the hull of everything: exact where the solid is convex.
fn out_of_hull(sides: &Sides<'_>, radius_m: f64) -> SeparatingTranslation {
    let [a, b] = sides.hulls;
    let found = signed(&mut Difference::new(a, b, sides.b_from_a));
    SeparatingTranslation {
        length_m: (radius_m - found.distance_m).max(0.0),
        direction: -found.normal,
        on_a: found.on_a,
    }
}

fn signed(difference: &mut Difference<'_>) -> CoreSeparation {
    match gjk::distance(difference, &Vector3::zeros(), f64::INFINITY) {
        Gap::Apart(found) => found,
        Gap::Overlap | Gap::BeyondCutoff => {
            epa::depth(difference, f64::INFINITY).expect("no distance is beyond an infinite cutoff")
        }
    }
}

/// Directions to try, the most promising first.
fn directions(sides: &Sides<'_>, radius_m: f64) -> Vec<Vector3<f64>> {
    let mut directions = Vec::new();
    let centre = sides.centre_a();
    let point = ConvexCore::Point;
    let from_centre = Sides {
        a: Mover::Convex {
            core: &point,
            bound: BoundingCapsule::on_z(0.0, 0.0),
        },
        b_from_a: Placement {
            translation: centre,
            ..sides.b_from_a
        },
        ..*sides
    };
    if let Nearest::Apart(found) = nearest(&from_centre, f64::INFINITY) {
        let outwards = if sides.b.contains(&centre.into()) {
            1.0
        } else {
            -1.0
        };
        directions.push(found.normal * outwards);
    }
    let mut across: Vec<_> = touched(sides, radius_m, &Vector3::zeros())
        .iter()
        .map(|[a, b, c]| (b - a).cross(&(c - a)))
        .collect();
    directions.extend(across.iter().sum::<Vector3<f64>>().try_normalize(0.0));
    across.sort_by(|one, other| other.norm_squared().total_cmp(&one.norm_squared()));
    let most = directions.len() + ACROSS;
    for normal in across {
        let Some(normal) = normal.try_normalize(0.0) else {
            continue;
        };
        if directions.iter().all(|other| other.dot(&normal) < ALIKE) {
            directions.push(normal);
        }
        if directions.len() == most {
            break;
        }
    }
    directions
}

/// Triangles that A touches, those first that reach farthest along a direction.
fn touched(sides: &Sides<'_>, radius_m: f64, along: &Vector3<f64>) -> Vec<[Vector3<f64>; 3]> {
    let mut found = Vec::new();
    let mut hint = Hint(usize::MAX);
    let mut open: Vec<Boxes> = vec![ROOTS];
    while let Some(boxes) = open.pop() {
        match sides.open(boxes) {
            Step::Boxes(parts) => {
                let mut parts = parts;
                // The farther one is looked at first.
                parts.sort_by(|one, other| {
                    let [one, other] = [one, other].map(|part| sides.b.block(part.b).high(along));
                    one.total_cmp(&other)
                });
                let near = parts
                    .into_iter()
                    .filter(|&boxes| is_touched(sides, boxes, radius_m, &mut hint));
                open.extend(near);
            }
            Step::Leaves(ones, others) => {
                for other in others {
                    let touched = !sides.each_pair(ones, std::slice::from_ref(other), |a, b| {
                        !touches(sides, (a, b), radius_m)
                    });
                    if touched && found.last() != Some(other) {
                        found.push(*other);
                    }
                }
                if found.len() >= TOUCHED {
                    break;
                }
            }
        }
    }
    found
}

/// Direction of the shortest way out of the hull of a patch, made deep against `out`.
fn out_of_patch(
    sides: &Sides<'_>,
    patch: &[Vector3<f64>],
    out: &Vector3<f64>,
    length_m: f64,
) -> Option<Vector3<f64>> {
    let first = patch.first()?;
    let extent_m = patch
        .iter()
        .map(|corner| (corner - first).norm())
        .fold(length_m, f64::max);
    let points: Vec<_> = patch.iter().map(|corner| Point3::from(*corner)).collect();
    let patch = ConvexCore::Polyhedron(Polyhedron::new(&points, &[]));
    // A patch that is continued downwards is met by A where A continued upwards meets the patch.
    let mut difference = Difference::new(sides.hulls[0], &patch, sides.b_from_a)
        .swept(out * (PATCH_DEPTH * extent_m));
    let found = signed(&mut difference);
    Some(-found.normal)
}
