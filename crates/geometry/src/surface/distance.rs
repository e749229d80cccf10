//! Signed distance of a convex shape or a mesh from a mesh.

use nalgebra::{Unit, Vector3};

use super::nearest::{self, Nearest};
use super::penetration_depth::penetration_depth;
use super::separating_translation::{SeparatingTranslation, is_within};
use super::sides::{Mover, Sides};
use crate::convex::ConvexCore;
use crate::placement::Placement;
use crate::prepared::PreparedShape;
use crate::separation::Separation;
use crate::tree::TriangleTree;

/// What a straight way back may lack for a round shape to be clear of a surface, m: the
/// certificate of the distance and rounding.
const CLEAR_M: f64 = 3e-10;

/// Signed distance in the frame of B, or `None` if it is certainly larger than the cutoff; what
/// is returned does not depend on the cutoff. One of the two has to be a mesh.
pub(crate) fn separation_within(
    a: &PreparedShape,
    b: &PreparedShape,
    b_from_a: &Placement,
    cutoff_m: f64,
) -> Option<Separation> {
    if let ConvexCore::SurfaceHull(tree) = &b.core {
        return from_surface(a, tree, [&a.core, &b.core], b_from_a, cutoff_m);
    }
    let ConvexCore::SurfaceHull(tree) = &a.core else {
        unreachable!("called for meshes only")
    };
    let a_from_b = b_from_a.inverse_after(&Placement::IDENTITY);
    let swapped = from_surface(b, tree, [&b.core, &a.core], &a_from_b, cutoff_m)?;
    Some(
        Separation {
            normal: -swapped.normal,
            point_on_a: swapped.point_on_b,
            point_on_b: swapped.point_on_a,
            ..swapped
        }
        .placed(b_from_a),
    )
}

/// Whether the signed distance is less than a positive limit, or is not a number. One of the two has to be a mesh.
pub(crate) fn is_nearer(
    a: &PreparedShape,
    b: &PreparedShape,
    b_from_a: &Placement,
    limit_m: f64,
) -> bool {
    let (a, tree, hulls, b_from_a) = match (&a.core, &b.core) {
        (_, ConvexCore::SurfaceHull(tree)) => (a, tree, [&a.core, &b.core], *b_from_a),
        (ConvexCore::SurfaceHull(tree), _) => {
            let a_from_b = b_from_a.inverse_after(&Placement::IDENTITY);
            (b, tree, [&b.core, &a.core], a_from_b)
        }
        _ => unreachable!("called for meshes only"),
    };
    if !is_finite(&b_from_a) {
        return true;
    }
    let sides = sides(a, tree, hulls, &b_from_a);
    match nearest::nearest(&sides, limit_m + a.radius_m) {
        Nearest::BeyondCutoff => is_within(&sides),
        Nearest::Apart(found) => found.distance_m - a.radius_m < limit_m || is_within(&sides),
        Nearest::Crossing => true,
    }
}

fn is_finite(place: &Placement) -> bool {
    (place.rotation.sum() + place.translation.sum()).is_finite()
}

fn sides<'s>(
    a: &'s PreparedShape,
    tree: &'s TriangleTree,
    hulls: [&'s ConvexCore; 2],
    b_from_a: &Placement,
) -> Sides<'s> {
    Sides {
        a: Mover::new(a),
        b: tree,
        hulls,
        b_from_a: *b_from_a,
        sweep: Vector3::zeros(),
    }
}

fn from_surface(
    a: &PreparedShape,
    tree: &TriangleTree,
    hulls: [&ConvexCore; 2],
    b_from_a: &Placement,
    cutoff_m: f64,
) -> Option<Separation> {
    let sides = sides(a, tree, hulls, b_from_a);
    let radius_m = a.radius_m;
    if !is_finite(b_from_a) {
        return Some(not_a_number());
    }
    // What counts below is whether the surface is touched, however deep the cutoff.
    match nearest::nearest(&sides, cutoff_m.max(0.0) + radius_m) {
        Nearest::BeyondCutoff if !is_within(&sides) => return None,
        Nearest::Apart(found) if !is_within(&sides) => {
            let distance_m = found.distance_m - radius_m;
            if distance_m >= 0.0 || is_clear(&sides, &(found.normal * distance_m), radius_m) {
                return Some(Separation {
                    distance_m,
                    normal: Unit::new_unchecked(found.normal),
                    point_on_a: (found.on_a + found.normal * radius_m).into(),
                    point_on_b: found.on_b.into(),
                });
            }
        }
        _ => {}
    }
    let SeparatingTranslation {
        length_m,
        direction,
        on_a,
    } = penetration_depth(&sides, radius_m, cutoff_m)?;
    let point_on_a = on_a - direction * radius_m;
    Some(Separation {
        distance_m: -length_m,
        normal: Unit::new_unchecked(-direction),
        point_on_a: point_on_a.into(),
        point_on_b: (point_on_a + direction * length_m).into(),
    })
}

/// Whether a round shape is clear of the surface once it is moved: then its depth is the way,
/// for no motion gains more distance from the nearest point than its length.
fn is_clear(sides: &Sides<'_>, way: &Vector3<f64>, radius_m: f64) -> bool {
    let there = sides.moved(way);
    let is_clear = match nearest::nearest(&there, radius_m) {
        Nearest::BeyondCutoff => true,
        Nearest::Apart(found) => found.distance_m >= radius_m - CLEAR_M,
        Nearest::Crossing => false,
    };
    is_clear && !is_within(&there)
}

/// Joint positions that are not finite must not pass for free.
fn not_a_number() -> Separation {
    let nan = Vector3::repeat(f64::NAN);
    Separation {
        distance_m: f64::NAN,
        normal: Unit::new_unchecked(nan),
        point_on_a: nan.into(),
        point_on_b: nan.into(),
    }
}
