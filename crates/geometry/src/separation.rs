//! Signed distance with its witnesses.

use nalgebra::{Point3, Unit, UnitVector3};

use crate::placement::Placement;

/// Signed distance of two placed shapes with its witnesses.
///
/// `point_on_b - point_on_a = distance_m * normal`. While the shapes are apart the witnesses are
/// their closest points; in penetration they are the ends of a translation that parts them: moving
/// A by `distance_m * normal` makes the shapes touch. For convex shapes it is the shortest one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Separation {
    /// Positive: gap. Zero: touching. Negative: penetration depth. m.
    pub distance_m: f64,
    /// Unit vector from A to B.
    pub normal: UnitVector3<f64>,
    /// Witness on the surface of A, m.
    pub point_on_a: Point3<f64>,
    /// Witness on the surface of B, m.
    pub point_on_b: Point3<f64>,
}

impl Separation {
    /// From a frame to its parent.
    #[inline]
    pub fn placed(&self, parent_from_frame: &Placement) -> Self {
        Self {
            distance_m: self.distance_m,
            normal: Unit::new_unchecked(parent_from_frame.rotation * self.normal.into_inner()),
            point_on_a: parent_from_frame.point(&self.point_on_a.coords).into(),
            point_on_b: parent_from_frame.point(&self.point_on_b.coords).into(),
        }
    }
}
