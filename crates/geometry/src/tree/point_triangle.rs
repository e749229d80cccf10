//! The point of a triangle that is nearest to a point.

use nalgebra::Vector3;

/// The foot of the perpendicular where it is inside the triangle, or else the nearest point of the
/// edges that the point is beyond.
///
/// Barycentric coordinates by products of dot products would lose all digits on slivers that are
/// far away; sides of edges and feet on them do not.
#[inline]
pub(super) fn nearest_on_triangle(
    point: &Vector3<f64>,
    [a, b, c]: &[Vector3<f64>; 3],
) -> Vector3<f64> {
    let normal = (b - a).cross(&(c - a));
    let mut nearest: Option<(f64, Vector3<f64>)> = None;
    for (from, to) in [(a, b), (b, c), (c, a)] {
        let edge = to - from;
        let offset = point - from;
        // Also true of a triangle without an area, which is its edges.
        let is_beyond = edge.cross(&offset).dot(&normal) <= 0.0;
        if is_beyond {
            let squared = edge.norm_squared();
            let along = if squared > 0.0 {
                (edge.dot(&offset) / squared).clamp(0.0, 1.0)
            } else {
                0.0
            };
            let foot = from + edge * along;
            let distance_squared = (point - foot).norm_squared();
            if nearest.is_none_or(|(least, _)| distance_squared < least) {
                nearest = Some((distance_squared, foot));
            }
        }
    }
    match nearest {
        Some((_, foot)) => foot,
        None => point - normal * (normal.dot(&(point - a)) / normal.norm_squared()),
    }
}

#[cfg(test)]
mod tests {
    use needlebench_numerics::random::SplitMix64;

    use super::*;

    /// Rounding of metres.
    const ROUNDING_M: f64 = 1e-14;

    /// The point of a triangle that is nearest to another is so to all its points: the way to it
    /// makes no acute angle with the way on to any corner.
    fn is_nearest(
        point: &Vector3<f64>,
        triangle: &[Vector3<f64>; 3],
        found: &Vector3<f64>,
    ) -> bool {
        let way = (point - found).normalize();
        triangle
            .iter()
            .all(|corner| way.dot(&(corner - found)) <= ROUNDING_M)
    }

    #[test]
    fn no_point_of_the_triangle_is_nearer() {
        let mut random = SplitMix64::new(5);
        let mut vector = |reach: f64| Vector3::from_fn(|_, _| random.uniform(-reach, reach));
        for k in 0..20_000 {
            let [a, b] = [vector(0.1), vector(0.1)];
            // A sliver of down to a millionth of its length, and points far from it.
            let c = match k % 4 {
                0 => vector(0.1),
                1 => a + (b - a) * 0.3 + vector(1e-4),
                2 => a + (b - a) * 0.7 + vector(1e-7),
                _ => a + (b - a) * 0.5,
            };
            let point = vector([0.05, 0.2, 2.0][k % 3]);
            let found = nearest_on_triangle(&point, &[a, b, c]);
            assert!(
                is_nearest(&point, &[a, b, c], &found),
                "{a} {b} {c} {point}"
            );
        }
    }

    #[test]
    fn triangle_without_an_area_is_its_edges() {
        let (a, b) = (Vector3::zeros(), Vector3::x());
        let above = Vector3::new(0.3, 0.0, 0.4);
        for triangle in [[a, b, b], [a, a, b], [b, a, (a + b) * 0.25]] {
            assert!(
                (nearest_on_triangle(&above, &triangle) - above * 1.0).norm() - 0.4 < ROUNDING_M
            );
        }
        assert_eq!(nearest_on_triangle(&above, &[b; 3]), b);
    }
}
