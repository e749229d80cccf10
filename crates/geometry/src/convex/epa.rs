//! Depth of two cores that overlap.
//!
//! The depth is the least overlap `support(n) . n` over all directions `n`. A polytope that grows
//! inside the difference finds the global minimum; where it would need thousands of faces, a line
//! search finishes. Every overlap is an upper bound of the depth: what is reported is never too
//! shallow.

use nalgebra::{Rotation3, Vector3};

use super::core_separation::CoreSeparation;
use super::difference::Difference;
use super::polytope::{End, NoPolytope, Overlap, Polytope};

/// Attempts from different tetrahedra when rounding spoils one.
const ATTEMPTS: u32 = 4;

/// Polishing: rounds of line search, its steps and the angle that it looks ahead.
const POLISHING_ROUNDS: usize = 4;
const POLISHING_STEPS: usize = 50;
const POLISHING_REACH_RAD: f64 = 0.01;

/// `(3 - sqrt 5) / 2`, the section of a golden-section search.
const GOLDEN: f64 = 0.381_966_011_250_105_1;

/// Depth, as a negative distance, and witness points of two overlapping cores, or `None` if the
/// distance is certainly larger than `cutoff_m`.
///
/// Touching cores come out with a distance about zero of either sign.
pub(crate) fn depth(difference: &mut Difference<'_>, cutoff_m: f64) -> Option<CoreSeparation> {
    let mut best = None;
    for attempt in 0..ATTEMPTS {
        // Slivers can upset the surface; other slivers arise from other axes.
        let turn = f64::from(attempt);
        let axes = Rotation3::from_euler_angles(0.7 * turn, 1.1 * turn, 0.3 * turn);
        let mut polytope = match Polytope::around(difference, axes.matrix(), cutoff_m) {
            Ok(polytope) => polytope,
            Err(NoPolytope::Flat { across }) => return Some(across_flat(difference, &across)),
            Err(NoPolytope::BeyondCutoff) => return None,
        };
        let found = match polytope.grow(difference, cutoff_m, &mut best) {
            End::Certified(found) => found,
            End::Relaxed(found) => polished(difference, found),
            End::BeyondCutoff => return None,
            End::Inconsistent => continue,
        };
        let on_a = polytope.nearest_on_a(&(found.normal * found.overlap_m));
        return Some(separation(&found, &on_a));
    }
    // Still an upper bound of the depth; not seen in 1e6 random pairs.
    let direction = best.map_or(Vector3::z(), |best: Overlap| best.normal);
    Some(across_flat(difference, &direction))
}

fn separation(overlap: &Overlap, on_a: &Vector3<f64>) -> CoreSeparation {
    CoreSeparation {
        distance_m: -overlap.overlap_m,
        normal: overlap.normal,
        on_a: *on_a,
        on_b: on_a - overlap.normal * overlap.overlap_m,
    }
}

/// The lesser overlap along a direction and its opposite.
fn across_flat(difference: &mut Difference<'_>, across: &Vector3<f64>) -> CoreSeparation {
    let [along, against] = [*across, -across].map(|normal| {
        let vertex = difference.support(&normal);
        let overlap_m = normal.dot(&vertex.x);
        separation(&Overlap { overlap_m, normal }, &vertex.a)
    });
    if along.distance_m >= against.distance_m {
        along
    } else {
        against
    }
}

/// Descends the overlap from a normal that is nearly the best.
///
/// Faces approximate a smooth surface, and their normals are off by the square root of the gap.
/// A golden-section search down the slope, a few times over, brings the overlap to its minimum.
fn polished(difference: &mut Difference<'_>, start: Overlap) -> Overlap {
    let mut best = start;
    for _ in 0..POLISHING_ROUNDS {
        let normal = best.normal;
        // The gradient of the support function is the support point.
        let slope = difference.support(&normal).x;
        let Some(downhill) = (normal * normal.dot(&slope) - slope).try_normalize(0.0) else {
            break;
        };
        let mut at = |angle: f64| {
            let (sin, cos) = libm::sincos(angle);
            Overlap::along(difference, normal * cos + downhill * sin)
        };
        let (mut low, mut high) = (0.0, POLISHING_REACH_RAD);
        let (mut left, mut right) = (at(GOLDEN * high), at((1.0 - GOLDEN) * high));
        for _ in 0..POLISHING_STEPS {
            if left.overlap_m < right.overlap_m {
                high = low + (1.0 - GOLDEN) * (high - low);
                right = left;
                left = at(low + GOLDEN * (high - low));
            } else {
                low += GOLDEN * (high - low);
                left = right;
                right = at(high - GOLDEN * (high - low));
            }
        }
        for candidate in [left, right] {
            if candidate.overlap_m < best.overlap_m {
                best = candidate;
            }
        }
    }
    best
}
