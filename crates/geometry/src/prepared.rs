//! Shapes as the solver sees them: a convex core and a radius around it, or a surface.

use std::sync::Arc;

use nalgebra::{Point3, Vector3};

use crate::bounds::{BoundingCapsule, OrientedBox};
use crate::convex::{ConvexCore, Polyhedron};
use crate::shape::Shape;
use crate::tree::TriangleTree;

/// A shape made ready for distances, rays and inside tests.
#[derive(Debug, Clone, PartialEq)]
pub struct PreparedShape {
    pub(crate) core: ConvexCore,
    pub(crate) radius_m: f64,
    /// Encloses the whole shape.
    pub(crate) bound: BoundingCapsule,
    /// A box around the whole shape.
    pub(crate) block: OrientedBox,
}

impl PreparedShape {
    /// Splits the shape into core and radius and encloses it; meshes get their adjacency.
    pub fn new(shape: &Shape) -> Self {
        match shape {
            Shape::Sphere { radius_m } => Self {
                core: ConvexCore::Point,
                radius_m: *radius_m,
                bound: BoundingCapsule::on_z(0.0, *radius_m),
                block: OrientedBox::upright(&Vector3::repeat(*radius_m)),
            },
            Shape::Capsule {
                radius_m,
                half_length_m,
            } => Self::segment(*half_length_m, *radius_m),
            Shape::Cylinder {
                radius_m,
                half_length_m,
            } => Self {
                core: ConvexCore::Cylinder {
                    radius_m: *radius_m,
                    half_length_m: *half_length_m,
                },
                radius_m: 0.0,
                bound: BoundingCapsule::around_cylinder(*radius_m, *half_length_m),
                block: OrientedBox::upright(&Vector3::new(*radius_m, *radius_m, *half_length_m)),
            },
            Shape::Cuboid { half_extents_m } => Self {
                core: ConvexCore::Cuboid {
                    half_extents_m: *half_extents_m,
                },
                radius_m: 0.0,
                bound: BoundingCapsule::around_cuboid(half_extents_m),
                block: OrientedBox::upright(half_extents_m),
            },
            Shape::Convex(mesh) => {
                let hull = Polyhedron::new(&mesh.0.vertices_m, &mesh.0.triangles);
                let bound = BoundingCapsule::around_points(hull.vertices_m().iter());
                let (block, _) = OrientedBox::around(&hull.vertices_m().iter());
                Self {
                    core: ConvexCore::Polyhedron(hull),
                    radius_m: 0.0,
                    bound,
                    block,
                }
            }
            Shape::Mesh(mesh) => {
                let tree = Arc::clone(mesh.tree());
                let bound = BoundingCapsule::around_points(tree.vertices_m());
                Self {
                    block: tree.root().clone(),
                    core: ConvexCore::SurfaceHull(tree),
                    radius_m: 0.0,
                    bound,
                }
            }
        }
    }

    /// Points within `radius_m` of a segment on z.
    pub(crate) fn segment(half_length_m: f64, radius_m: f64) -> Self {
        Self {
            core: ConvexCore::Segment { half_length_m },
            radius_m,
            bound: BoundingCapsule::on_z(half_length_m, radius_m),
            block: OrientedBox::upright(&Vector3::new(
                radius_m,
                radius_m,
                half_length_m + radius_m,
            )),
        }
    }

    pub(crate) fn is_surface(&self) -> bool {
        matches!(self.core, ConvexCore::SurfaceHull(_))
    }

    /// The surface of a mesh.
    pub fn surface(&self) -> Option<&TriangleTree> {
        match &self.core {
            ConvexCore::SurfaceHull(tree) => Some(tree),
            _ => None,
        }
    }

    /// Whether the solid is convex, so that planes separate it from other such solids.
    pub fn is_convex(&self) -> bool {
        !self.is_surface()
    }

    /// Farthest point of the core along `direction`, which need not be of unit length, in the shape's
    /// frame; the shape reaches [`PreparedShape::radius_m`] further.
    ///
    /// `hint` is the vertex found last time, or `usize::MAX`; it only saves time. A mesh has the
    /// support of its convex hull.
    #[inline]
    pub fn core_support(&self, direction: &Vector3<f64>, hint: &mut usize) -> Vector3<f64> {
        self.core.support(direction, hint)
    }

    /// Radius around the core, m: that of spheres and capsules, zero for all others.
    #[inline]
    pub fn radius_m(&self) -> f64 {
        self.radius_m
    }

    /// A capsule around the whole shape, in its frame.
    #[inline]
    pub fn bounding_capsule(&self) -> &BoundingCapsule {
        &self.bound
    }

    /// A box around the whole shape, in its frame.
    #[inline]
    pub fn bounding_box(&self) -> &OrientedBox {
        &self.block
    }

    /// Centre and radius of a ball around the shape, in the shape's frame, m.
    pub fn bounding_sphere_m(&self) -> (Point3<f64>, f64) {
        (Point3::from(self.bound.centre), self.bound.ball_radius_m)
    }
}
