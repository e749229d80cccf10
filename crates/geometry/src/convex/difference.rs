//! The set of differences of two convex cores, by its support function.

use nalgebra::Vector3;

use super::convex_core::ConvexCore;
use crate::placement::Placement;

/// A vertex of the difference `A - B` with the two points that it is made of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Vertex {
    /// `a - b`.
    pub x: Vector3<f64>,
    /// Point of core A.
    pub a: Vector3<f64>,
}

/// The set of differences `a - b` of two cores, in the frame of B.
///
/// Its support function is all that distance and depth need: the signed distance of the cores
/// is the largest `-support(n) . n` over unit vectors `n`, which point from A to B.
pub(crate) struct Difference<'s> {
    a: &'s ConvexCore,
    b: &'s ConvexCore,
    b_from_a: Placement,
    /// A is stretched along this vector.
    sweep: Vector3<f64>,
    hint_a: usize,
    hint_b: usize,
}

impl<'s> Difference<'s> {
    pub fn new(a: &'s ConvexCore, b: &'s ConvexCore, b_from_a: Placement) -> Self {
        Self {
            a,
            b,
            b_from_a,
            sweep: Vector3::zeros(),
            hint_a: usize::MAX,
            hint_b: usize::MAX,
        }
    }

    /// With A replaced by all that it covers on a straight way.
    pub fn swept(self, sweep: Vector3<f64>) -> Self {
        Self { sweep, ..self }
    }

    /// With a guess of A's first farthest vertex; it only saves time.
    pub(crate) fn with_hint(self, hint_a: usize) -> Self {
        Self { hint_a, ..self }
    }

    /// A's farthest vertex found last.
    pub fn hint(&self) -> usize {
        self.hint_a
    }

    /// Farthest difference along `direction`.
    #[inline]
    pub fn support(&mut self, direction: &Vector3<f64>) -> Vertex {
        let in_a = self.b_from_a.rotation.tr_mul(direction);
        let mut a = self
            .b_from_a
            .point(&self.a.support(&in_a, &mut self.hint_a));
        if direction.dot(&self.sweep) > 0.0 {
            a += self.sweep;
        }
        let b = self.b.support(&-direction, &mut self.hint_b);
        Vertex { x: a - b, a }
    }
}
