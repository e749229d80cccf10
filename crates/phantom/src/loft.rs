//! Convex meshes that are convex by construction.
//!
//! A loft stacks scaled copies of one convex polygon. Copies in parallel planes have parallel
//! edges, so each side face is a planar trapezoid; and where the scale is a strictly concave
//! function of height (and the centre of scaling lies inside the polygon), every face plane
//! supports the body and every vertex is an extreme point. No hull algorithm is needed, and the
//! same numbers always give the same bytes.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{Point2, Point3, Vector3};
use needlebench_geometry::{ConvexMesh, TriangleMesh};

/// Height (m) and scale of one copy of the polygon. Scale 0 is a single vertex (a pole).
#[derive(Debug, Clone, Copy)]
pub(super) struct Level {
    pub z_m: f64,
    pub scale: f64,
}

/// Stacks `polygon` (counter-clockwise seen from +z) at ascending `levels`.
///
/// The polygon is scaled about its own origin, which must lie strictly inside. Only the first and
/// last scale may be 0; scales must be strictly concave in height. At least two levels, one of
/// which has a positive scale.
pub(super) fn loft(polygon: &[Point2<f64>], levels: &[Level]) -> ConvexMesh {
    debug_assert!(polygon.len() >= 3 && levels.len() >= 2);
    let mut vertices_m = Vec::new();
    let mut rings: Vec<Ring> = Vec::new();
    for level in levels {
        let first = index(vertices_m.len());
        if level.scale > 0.0 {
            vertices_m.extend(
                polygon
                    .iter()
                    .map(|p| Point3::new(level.scale * p.x, level.scale * p.y, level.z_m)),
            );
            rings.push(Ring::Polygon(first));
        } else {
            vertices_m.push(Point3::new(0.0, 0.0, level.z_m));
            rings.push(Ring::Pole(first));
        }
    }

    let count = index(polygon.len());
    let mut triangles = Vec::new();
    for pair in rings.windows(2) {
        for k in 0..count {
            let next = (k + 1) % count;
            match (pair[0], pair[1]) {
                (Ring::Polygon(low), Ring::Polygon(high)) => {
                    triangles.push([low + k, low + next, high + next]);
                    triangles.push([low + k, high + next, high + k]);
                }
                (Ring::Polygon(low), Ring::Pole(top)) => {
                    triangles.push([low + k, low + next, top]);
                }
                (Ring::Pole(bottom), Ring::Polygon(high)) => {
                    triangles.push([bottom, high + next, high + k]);
                }
                (Ring::Pole(_), Ring::Pole(_)) => {}
            }
        }
    }
    if let Some(Ring::Polygon(first)) = rings.first() {
        triangles.extend((1..count - 1).map(|k| [*first, first + k + 1, first + k]));
    }
    if let Some(Ring::Polygon(first)) = rings.last() {
        triangles.extend((1..count - 1).map(|k| [*first, first + k, first + k + 1]));
    }
    ConvexMesh(TriangleMesh {
        vertices_m,
        triangles,
    })
}

#[derive(Clone, Copy)]
enum Ring {
    Polygon(u32),
    Pole(u32),
}

fn index(count: usize) -> u32 {
    u32::try_from(count).expect("a loft has a few hundred vertices")
}

/// Superellipse `|x/a|^n + |y/b|^n = 1` as a counter-clockwise polygon of `4 * per_quadrant`
/// vertices.
///
/// The four axis points are vertices exactly, and the polygon is mirror-symmetric to the bit.
pub(super) fn superellipse(
    half_axes_m: [f64; 2],
    exponent: f64,
    per_quadrant: usize,
) -> Vec<Point2<f64>> {
    let quadrant: Vec<[f64; 2]> = (0..=per_quadrant)
        .map(|k| match k {
            0 => [half_axes_m[0], 0.0],
            k if k == per_quadrant => [0.0, half_axes_m[1]],
            k => {
                let (sine, cosine) = libm::sincos(FRAC_PI_2 * k as f64 / per_quadrant as f64);
                [
                    half_axes_m[0] * libm::pow(cosine, 2.0 / exponent),
                    half_axes_m[1] * libm::pow(sine, 2.0 / exponent),
                ]
            }
        })
        .collect();
    let mut polygon = Vec::with_capacity(4 * per_quadrant);
    let (rising, falling) = (&quadrant[..per_quadrant], &quadrant[1..]);
    polygon.extend(rising.iter().map(|[x, y]| Point2::new(*x, *y)));
    polygon.extend(falling.iter().rev().map(|[x, y]| Point2::new(-x, *y)));
    polygon.extend(rising.iter().map(|[x, y]| Point2::new(-x, -y)));
    polygon.extend(falling.iter().rev().map(|[x, y]| Point2::new(*x, -y)));
    polygon
}

/// Ellipsoid about the origin, inscribed: its vertices lie on the true surface.
pub(super) fn ellipsoid(semi_axes_m: Vector3<f64>) -> ConvexMesh {
    const PER_QUADRANT: usize = 4;
    const BANDS: usize = 8;
    let polygon = superellipse([semi_axes_m.x, semi_axes_m.y], 2.0, PER_QUADRANT);
    let levels: Vec<Level> = (0..=BANDS)
        .map(|k| {
            let (sine, cosine) = libm::sincos(PI * k as f64 / BANDS as f64);
            Level {
                z_m: -semi_axes_m.z * cosine,
                scale: if k == 0 || k == BANDS { 0.0 } else { sine },
            }
        })
        .collect();
    loft(&polygon, &levels)
}

#[cfg(test)]
pub(crate) use tests::assert_convex_and_closed;

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    /// Rounding of coordinates below 1 m, with two decimal digits to spare.
    const PLANE_TOLERANCE_M: f64 = 1e-12;

    /// Checks all that `ConvexMesh` promises and returns the volume, m^3.
    pub(crate) fn assert_convex_and_closed(mesh: &ConvexMesh) -> f64 {
        let ConvexMesh(mesh) = mesh;
        let vertex = |i: u32| mesh.vertices_m[i as usize];
        let mut edges: BTreeMap<(u32, u32), u32> = BTreeMap::new();
        let mut volume = 0.0;
        for &[a, b, c] in &mesh.triangles {
            for edge in [(a, b), (b, c), (c, a)] {
                *edges.entry(edge).or_default() += 1;
            }
            let normal = (vertex(b) - vertex(a)).cross(&(vertex(c) - vertex(a)));
            assert!(normal.norm() > 1e-10, "triangle without area");
            let normal = normal.normalize();
            for point in &mesh.vertices_m {
                let above_m = normal.dot(&(point - vertex(a)));
                assert!(above_m <= PLANE_TOLERANCE_M, "{above_m} m above a face");
            }
            volume += vertex(a)
                .coords
                .dot(&vertex(b).coords.cross(&vertex(c).coords))
                / 6.0;
        }
        for (&(a, b), &count) in &edges {
            assert_eq!(count, 1, "edge {a}-{b} used twice in one direction");
            assert!(edges.contains_key(&(b, a)), "edge {a}-{b} is open");
        }
        for (i, point) in mesh.vertices_m.iter().enumerate() {
            // Extreme: the mean of the outward normals around a vertex of a strictly convex corner
            // is a direction in which that vertex alone is the furthest.
            let mut around = Vector3::zeros();
            for &[a, b, c] in &mesh.triangles {
                if [a, b, c].contains(&index(i)) {
                    around += (vertex(b) - vertex(a))
                        .cross(&(vertex(c) - vertex(a)))
                        .normalize();
                }
            }
            let reach = around.normalize().dot(&point.coords);
            for (j, other) in mesh.vertices_m.iter().enumerate() {
                assert!(
                    i == j || around.normalize().dot(&other.coords) < reach - 1e-9,
                    "vertex {i} is not extreme"
                );
            }
        }
        volume
    }

    #[test]
    fn ellipsoid_is_convex_closed_and_slightly_smaller_than_the_true_one() {
        let semi_axes_m = Vector3::new(0.06, 0.05, 0.04);
        let volume = assert_convex_and_closed(&ellipsoid(semi_axes_m));
        let true_volume = 4.0 / 3.0 * PI * semi_axes_m.product();
        assert!(volume < true_volume && volume > 0.9 * true_volume);
    }

    #[test]
    fn superellipse_is_symmetric_to_the_bit_and_touches_its_axes() {
        let polygon = superellipse([0.15, 0.12], 2.4, 6);
        assert_eq!(polygon.len(), 24);
        assert!(polygon.contains(&Point2::new(0.15, 0.0)));
        assert!(polygon.iter().any(|p| p.x == 0.0 && p.y == -0.12));
        for p in &polygon {
            assert!(polygon.iter().any(|q| q.x == -p.x && q.y == p.y));
            assert!(polygon.iter().any(|q| q.x == p.x && q.y == -p.y));
            let value = libm::pow(p.x.abs() / 0.15, 2.4) + libm::pow(p.y.abs() / 0.12, 2.4);
            assert!((value - 1.0).abs() < 1e-14);
        }
    }

    #[test]
    fn flat_ended_loft_has_the_volume_of_its_frusta() {
        let square = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]
            .map(|[x, y]| Point2::new(0.1 * x, 0.1 * y));
        let levels = [(0.0, 0.5), (0.1, 1.0), (0.2, 0.5)].map(|(z_m, scale)| Level { z_m, scale });
        let volume = assert_convex_and_closed(&loft(&square, &levels));
        // Two frusta: h/3 (A1 + A2 + sqrt(A1 A2)) with A = 0.04 and 0.01 m^2.
        assert!((volume - 2.0 * 0.1 / 3.0 * (0.04 + 0.01 + 0.02)).abs() < 1e-15);
    }
}
