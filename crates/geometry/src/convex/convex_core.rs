//! What is left of a shape when the radius of spheres and capsules is taken off, and its support
//! function.

use std::sync::Arc;

use nalgebra::Vector3;

use super::polyhedron::Polyhedron;
use crate::tree::TriangleTree;

/// The part of a shape that is left when the radius of spheres and capsules is taken off.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum ConvexCore {
    /// The origin.
    Point,
    /// A segment on z.
    Segment { half_length_m: f64 },
    /// A flat-ended cylinder about z.
    Cylinder { radius_m: f64, half_length_m: f64 },
    /// A box.
    Cuboid { half_extents_m: Vector3<f64> },
    /// A convex polyhedron.
    Polyhedron(Polyhedron),
    /// A triangle.
    Triangle([Vector3<f64>; 3]),
    /// The convex hull of a surface.
    SurfaceHull(Arc<TriangleTree>),
}

impl ConvexCore {
    /// Farthest point of the core along `direction`, which need not be of unit length.
    ///
    /// `hint` is the vertex found last time on a hull; it only saves time.
    #[inline]
    pub fn support(&self, direction: &Vector3<f64>, hint: &mut usize) -> Vector3<f64> {
        match self {
            Self::Point => Vector3::zeros(),
            Self::Segment { half_length_m } => {
                Vector3::new(0.0, 0.0, half_length_m.copysign(direction.z))
            }
            Self::Cylinder {
                radius_m,
                half_length_m,
            } => {
                let across = (direction.x * direction.x + direction.y * direction.y).sqrt();
                // On the axis any point of the cap is farthest; the centre is one.
                let scale = if across > 0.0 { radius_m / across } else { 0.0 };
                Vector3::new(
                    direction.x * scale,
                    direction.y * scale,
                    half_length_m.copysign(direction.z),
                )
            }
            Self::Cuboid { half_extents_m } => half_extents_m.zip_map(direction, f64::copysign),
            Self::Polyhedron(polyhedron) => polyhedron.support(direction, hint),
            Self::Triangle([a, b, c]) => {
                let [to_a, to_b, to_c] = [a, b, c].map(|corner| direction.dot(corner));
                if to_a >= to_b && to_a >= to_c {
                    *a
                } else if to_b >= to_c {
                    *b
                } else {
                    *c
                }
            }
            Self::SurfaceHull(tree) => tree.support(direction, hint),
        }
    }

    /// A point of the core, not on its boundary unless it has no inside.
    pub(crate) fn some_point(&self) -> Vector3<f64> {
        match self {
            Self::Point | Self::Segment { .. } | Self::Cylinder { .. } | Self::Cuboid { .. } => {
                Vector3::zeros()
            }
            Self::Polyhedron(polyhedron) => {
                let vertices = polyhedron.vertices_m();
                vertices.iter().sum::<Vector3<f64>>() / vertices.len() as f64
            }
            Self::Triangle([a, b, c]) => (a + b + c) / 3.0,
            Self::SurfaceHull(tree) => tree.anchors[0],
        }
    }
}
