//! Pairs of cores with a closed form for both signs.

use nalgebra::Vector3;

use super::core_separation::CoreSeparation;
use crate::bounds::closest_on_segments;

/// Distance below which two segments count as crossing and the direction between them as
/// rounding, m.
const CROSSING_M: f64 = 1e-12;

/// Segments `centre_a +- half_a` and `+-half_b`; a point has no half-length.
///
/// Crossing segments have depth zero: they have no volume.
pub(crate) fn segments(
    centre_a: &Vector3<f64>,
    half_a: &Vector3<f64>,
    half_b: &Vector3<f64>,
) -> CoreSeparation {
    let (s, t) = closest_on_segments(centre_a, half_a, half_b);
    let on_a = centre_a + half_a * s;
    let on_b = half_b * t;
    let between = on_b - on_a;
    let distance_m = between.norm();
    let normal = if distance_m > CROSSING_M {
        between / distance_m
    } else {
        across(half_a, half_b)
    };
    CoreSeparation {
        distance_m,
        normal,
        on_a,
        on_b,
    }
}

/// A unit vector across both, or across the longer one if they are parallel.
fn across(one: &Vector3<f64>, two: &Vector3<f64>) -> Vector3<f64> {
    let long = if one.norm_squared() >= two.norm_squared() {
        one
    } else {
        two
    };
    let mut side = Vector3::zeros();
    side[long.iamin()] = 1.0;
    let parallel_below = 1e-9 * one.norm() * two.norm();
    one.cross(two)
        .try_normalize(parallel_below)
        .or_else(|| long.cross(&side).try_normalize(0.0))
        .unwrap_or_else(Vector3::z)
}

/// Point A against a box B centred on the origin.
pub(crate) fn point_cuboid(point: &Vector3<f64>, half_extents: &Vector3<f64>) -> CoreSeparation {
    let nearest = point.zip_map(half_extents, |x, half| x.clamp(-half, half));
    if nearest != *point {
        return from_outside(point, &nearest);
    }
    let margin = half_extents - point.abs();
    let axis = margin.imin();
    let mut outwards = Vector3::zeros();
    outwards[axis] = 1.0_f64.copysign(point[axis]);
    from_inside(point, &outwards, margin[axis])
}

/// Point A against a cylinder B about z, centred on the origin.
pub(crate) fn point_cylinder(
    point: &Vector3<f64>,
    radius_m: f64,
    half_length_m: f64,
) -> CoreSeparation {
    let from_axis = libm::hypot(point.x, point.y);
    let radial = if from_axis > 0.0 {
        Vector3::new(point.x / from_axis, point.y / from_axis, 0.0)
    } else {
        Vector3::x()
    };
    let beside = from_axis > radius_m;
    let beyond = point.z.abs() > half_length_m;
    if beside || beyond {
        let mut nearest = *point;
        if beside {
            nearest = radial * radius_m;
            nearest.z = point.z;
        }
        nearest.z = nearest.z.clamp(-half_length_m, half_length_m);
        return from_outside(point, &nearest);
    }
    let to_side = radius_m - from_axis;
    let to_cap = half_length_m - point.z.abs();
    if to_side < to_cap {
        from_inside(point, &radial, to_side)
    } else {
        let outwards = Vector3::new(0.0, 0.0, 1.0_f64.copysign(point.z));
        from_inside(point, &outwards, to_cap)
    }
}

fn from_outside(point: &Vector3<f64>, nearest: &Vector3<f64>) -> CoreSeparation {
    let between = nearest - point;
    let distance_m = between.norm();
    CoreSeparation {
        distance_m,
        normal: between / distance_m,
        on_a: *point,
        on_b: *nearest,
    }
}

fn from_inside(point: &Vector3<f64>, outwards: &Vector3<f64>, depth_m: f64) -> CoreSeparation {
    CoreSeparation {
        distance_m: -depth_m,
        normal: -outwards,
        on_a: *point,
        on_b: point + outwards * depth_m,
    }
}
