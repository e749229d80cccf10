//! Gaps between two solids along a fixed direction, and what they prove between two postures.

use nalgebra::Vector3;
use needlebench_geometry::{BoundingCapsule, Placement, PreparedShape};

use crate::body::PlacedShape;

/// A direction fixed to the inner body, from the inner solid to the outer one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Plane {
    normal: Vector3<f64>,
    /// Largest coordinate of the inner solid along the normal, m.
    inner_m: f64,
    /// Vertex at which the last support of the outer solid was found.
    hint: usize,
}

/// Largest coordinate of a shape along a direction in its own frame, m.
fn extent_m(shape: &PreparedShape, direction: &Vector3<f64>, hint: &mut usize) -> f64 {
    shape.core_support(direction, hint).dot(direction) + shape.radius_m() * direction.norm()
}

impl Plane {
    /// Across a unit vector in the frame of the inner body.
    pub fn across(normal: Vector3<f64>, inner: &PlacedShape) -> Self {
        let direction = inner.body_from_shape.rotation.tr_mul(&normal);
        let offset_m = normal.dot(&inner.body_from_shape.translation);
        let mut hint = usize::MAX;
        Self {
            normal,
            inner_m: offset_m + extent_m(&inner.shape, &direction, &mut hint),
            hint: usize::MAX,
        }
    }

    /// Gap between the solids along the normal, m: a lower bound of their signed distance.
    pub fn gap_m(&mut self, outer: &PlacedShape, inner_from_outer: &Placement) -> f64 {
        let in_body = inner_from_outer.rotation.tr_mul(&self.normal);
        let in_shape = outer.body_from_shape.rotation.tr_mul(&in_body);
        let offset_m = self.normal.dot(&inner_from_outer.translation)
            + in_body.dot(&outer.body_from_shape.translation);
        offset_m - extent_m(&outer.shape, &-in_shape, &mut self.hint) - self.inner_m
    }
}

/// Gap between two capsules along a unit vector from the second to the first, m.
pub(super) fn capsule_gap_m(
    normal: &Vector3<f64>,
    outer: &BoundingCapsule,
    inner: &BoundingCapsule,
) -> f64 {
    normal.dot(&(outer.centre - inner.centre))
        - normal.dot(&outer.half_axis).abs()
        - normal.dot(&inner.half_axis).abs()
        - outer.radius_m
        - inner.radius_m
}

/// Gap along one direction at both ends of an interval, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Gaps {
    pub left_m: f64,
    pub right_m: f64,
}

impl Gaps {
    /// In the first half of the interval, with the gap in its middle.
    pub fn left_half(&self, middle_m: f64) -> Self {
        Self {
            right_m: middle_m,
            ..*self
        }
    }

    /// In the second half of the interval, with the gap in its middle.
    pub fn right_half(&self, middle_m: f64) -> Self {
        Self {
            left_m: middle_m,
            ..*self
        }
    }

    /// Chord minus `curvature u (1 - u) / 2`.
    fn at(&self, u: f64, curvature_m: f64) -> f64 {
        self.left_m * (1.0 - u) + self.right_m * u - 0.5 * curvature_m * u * (1.0 - u)
    }

    /// Where that is least.
    fn least_at(&self, curvature_m: f64) -> f64 {
        let rise_m = self.right_m - self.left_m;
        if rise_m.abs() >= 0.5 * curvature_m {
            return if rise_m >= 0.0 { 0.0 } else { 1.0 };
        }
        0.5 - rise_m / curvature_m
    }

    /// Least over the interval of the larger of two parabolas, m.
    pub fn least_of_larger_m(&self, other: &Self, curvature_m: f64) -> f64 {
        for (one, two) in [(self, other), (other, self)] {
            let u = one.least_at(curvature_m);
            let least_m = one.at(u, curvature_m);
            if least_m >= two.at(u, curvature_m) {
                return least_m;
            }
        }
        // Each lies below the other at its own lowest point: the larger one is least where the two
        // meet. Their curvatures are the same, so the difference is linear.
        let (left_m, right_m) = (self.left_m - other.left_m, self.right_m - other.right_m);
        let u = (left_m / (left_m - right_m)).clamp(0.0, 1.0);
        self.at(u, curvature_m).min(other.at(u, curvature_m))
    }
}

#[cfg(test)]
mod tests {
    use needlebench_numerics::random::SplitMix64;

    use super::*;

    /// Rounding of a handful of operations on numbers around one.
    const ROUNDING: f64 = 1e-12;

    #[test]
    fn least_of_the_larger_parabola_is_that_of_a_fine_grid() {
        let mut random = SplitMix64::new(3);
        let mut crossings = 0;
        for k in 0..3000 {
            let mut gaps = || Gaps {
                left_m: random.uniform(-1.0, 1.0),
                right_m: random.uniform(-1.0, 1.0),
            };
            let (one, two) = (gaps(), gaps());
            let curvature_m = [0.0, 0.3, 3.0, 30.0][k % 4];
            let larger = |u: f64| -> f64 { one.at(u, curvature_m).max(two.at(u, curvature_m)) };
            let grid = (0..=1000)
                .map(|i| larger(f64::from(i) / 1000.0))
                .fold(f64::INFINITY, f64::min);
            let found = one.least_of_larger_m(&two, curvature_m);
            assert!(found <= grid + ROUNDING, "{found} {grid}");
            // Slopes are below 2 + K / 2, and the grid has steps of 1e-3.
            assert!(found >= grid - 1e-3 * (2.0 + 0.5 * curvature_m));
            crossings += usize::from([one, two].iter().all(|gaps| {
                let least_m = gaps.at(gaps.least_at(curvature_m), curvature_m);
                found > least_m + 1e-6
            }));
        }
        assert!(crossings > 200, "{crossings}");
    }
}
