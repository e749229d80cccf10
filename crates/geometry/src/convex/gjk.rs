//! Distance of two cores that lie apart (Gilbert, Johnson, Keerthi), with a certificate.

use nalgebra::Vector3;

use super::core_separation::CoreSeparation;
use super::difference::Difference;
use super::simplex::Simplex;

/// Width of the certificate, m: the reported distance is a proven lower bound and at most this
/// much below the distance of the witness points.
///
/// Not reached only where rounding stops progress first; what is then left is asserted by
/// `tests/geometry/against_coal.rs`.
pub(crate) const CERTIFIED_GAP_M: f64 = 1e-10;

/// Distance below which cores count as touching and are passed on to the depth solver, m.
const TOUCHING_M: f64 = 1e-11;

/// Bound on the iterations; smooth pairs take about 20.
const MAX_ITERATIONS: usize = 200;

/// What is known of the signed distance of two cores.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Gap {
    /// The cores are apart.
    Apart(CoreSeparation),
    /// The distance is certainly larger than the cutoff.
    BeyondCutoff,
    /// The cores touch or overlap.
    Overlap,
}

/// Distance of the cores unless they overlap or are farther apart than `cutoff_m`.
///
/// `towards_b` is a guess of the direction from A to B; it only saves time.
pub(crate) fn distance(
    difference: &mut Difference<'_>,
    towards_b: &Vector3<f64>,
    cutoff_m: f64,
) -> Gap {
    // Support planes bound the distance from below: no difference is closer than its plane.
    let mut lower_m = f64::NEG_INFINITY;

    let guess = towards_b.norm();
    let first = if guess > 0.0 {
        let normal = towards_b / guess;
        let vertex = difference.support(&normal);
        lower_m = -normal.dot(&vertex.x);
        if lower_m > cutoff_m {
            return Gap::BeyondCutoff;
        }
        vertex
    } else {
        difference.support(&Vector3::x())
    };
    let mut simplex = Simplex::corner(&first);
    let mut upper_m = first.x.norm();
    for _ in 0..MAX_ITERATIONS {
        if upper_m <= TOUCHING_M {
            return Gap::Overlap;
        }
        let normal = simplex.closest / -upper_m;
        let vertex = difference.support(&normal);
        lower_m = lower_m.max(-normal.dot(&vertex.x));
        if lower_m > cutoff_m {
            return Gap::BeyondCutoff;
        }
        if upper_m - lower_m <= CERTIFIED_GAP_M || simplex.contains(&vertex) {
            break;
        }
        let Some(reduced) = simplex.with(&vertex) else {
            return Gap::Overlap;
        };
        let reduced_m = reduced.closest.norm();
        if reduced_m >= upper_m {
            break;
        }
        simplex = reduced;
        upper_m = reduced_m;
    }
    if lower_m <= 0.0 {
        return Gap::Overlap;
    }
    let on_a = simplex.on_a();
    Gap::Apart(CoreSeparation {
        distance_m: lower_m,
        normal: simplex.closest / -upper_m,
        on_a,
        on_b: on_a - simplex.closest,
    })
}
