//! Shapes as the solver sees them: a convex core, its support function, and a radius around it.

use std::sync::Arc;

use nalgebra::{Matrix3, Point3, Vector3};
use needlebench_cell::shape::Shape;
use needlebench_kinematics::Pose;

use crate::bounds::Capsule;
use crate::hull::Hull;
use crate::mesh::{MeshTree, Node};

/// A rotation as a matrix and a translation: half the cost of a quaternion per point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Placement {
    pub rotation: Matrix3<f64>,
    pub translation: Vector3<f64>,
}

impl Placement {
    pub fn new(pose: &Pose) -> Self {
        Self {
            rotation: pose.rotation.to_rotation_matrix().into_inner(),
            translation: pose.translation.vector,
        }
    }

    pub fn point(&self, local: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * local + self.translation
    }

    pub fn inverse_point(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.rotation.tr_mul(&(point - self.translation))
    }

    /// `self * other`.
    pub fn after(&self, other: &Self) -> Self {
        Self {
            rotation: self.rotation * other.rotation,
            translation: self.point(&other.translation),
        }
    }

    /// `self^-1 * other`.
    pub fn inverse_after(&self, other: &Self) -> Self {
        Self {
            rotation: self.rotation.tr_mul(&other.rotation),
            translation: self.inverse_point(&other.translation),
        }
    }
}

/// The part of a shape that is left when the radius of spheres and capsules is taken off.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Core {
    /// The origin.
    Point,
    /// A segment on z.
    Segment { half_length_m: f64 },
    /// A flat-ended cylinder about z.
    Cylinder { radius_m: f64, half_length_m: f64 },
    /// A box.
    Cuboid { half_extents_m: Vector3<f64> },
    /// A convex polyhedron.
    Hull(Hull),
    /// A triangle.
    Triangle([Vector3<f64>; 3]),
    /// A surface, which is its convex hull to everything here but the `mesh` module.
    Mesh(Arc<MeshTree>),
}

impl Core {
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
            Self::Hull(hull) => hull.support(direction, hint),
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
            Self::Mesh(tree) => tree.support(direction, hint),
        }
    }

    /// A point of the core, not on its boundary unless it has no inside.
    pub fn some_point(&self) -> Vector3<f64> {
        match self {
            Self::Point | Self::Segment { .. } | Self::Cylinder { .. } | Self::Cuboid { .. } => {
                Vector3::zeros()
            }
            Self::Hull(hull) => {
                let vertices = hull.vertices_m();
                vertices.iter().sum::<Vector3<f64>>() / vertices.len() as f64
            }
            Self::Triangle([a, b, c]) => (a + b + c) / 3.0,
            Self::Mesh(tree) => tree.anchors[0],
        }
    }
}

/// A convex shape made ready for distance queries.
#[derive(Debug, Clone, PartialEq)]
pub struct PreparedShape {
    pub(crate) core: Core,
    pub(crate) radius_m: f64,
    /// Encloses the whole shape.
    pub(crate) bound: Capsule,
    /// A box around the whole shape.
    pub(crate) block: Node,
}

impl PreparedShape {
    /// Splits the shape into core and radius and encloses it; meshes get their adjacency.
    pub fn new(shape: &Shape) -> Self {
        match shape {
            Shape::Sphere { radius_m } => Self {
                core: Core::Point,
                radius_m: *radius_m,
                bound: Capsule::on_z(0.0, *radius_m),
                block: Node::upright(&Vector3::repeat(*radius_m)),
            },
            Shape::Capsule {
                radius_m,
                half_length_m,
            } => Self::segment(*half_length_m, *radius_m),
            Shape::Cylinder {
                radius_m,
                half_length_m,
            } => Self {
                core: Core::Cylinder {
                    radius_m: *radius_m,
                    half_length_m: *half_length_m,
                },
                radius_m: 0.0,
                bound: Capsule::around_cylinder(*radius_m, *half_length_m),
                block: Node::upright(&Vector3::new(*radius_m, *radius_m, *half_length_m)),
            },
            Shape::Cuboid { half_extents_m } => Self {
                core: Core::Cuboid {
                    half_extents_m: *half_extents_m,
                },
                radius_m: 0.0,
                bound: Capsule::around_cuboid(half_extents_m),
                block: Node::upright(half_extents_m),
            },
            Shape::Convex(mesh) => {
                let hull = Hull::new(&mesh.0.vertices_m, &mesh.0.triangles);
                let bound = Capsule::around_points(hull.vertices_m().iter());
                let (block, _) = Node::around(&hull.vertices_m().iter());
                Self {
                    core: Core::Hull(hull),
                    radius_m: 0.0,
                    bound,
                    block,
                }
            }
            Shape::Mesh(mesh) => {
                let tree = MeshTree::new(&mesh.surface);
                let bound = Capsule::around_points(tree.vertices_m());
                Self {
                    block: tree.root().clone(),
                    core: Core::Mesh(Arc::new(tree)),
                    radius_m: 0.0,
                    bound,
                }
            }
        }
    }

    /// Points within `radius_m` of a segment on z.
    pub(crate) fn segment(half_length_m: f64, radius_m: f64) -> Self {
        Self {
            core: Core::Segment { half_length_m },
            radius_m,
            bound: Capsule::on_z(half_length_m, radius_m),
            block: Node::upright(&Vector3::new(radius_m, radius_m, half_length_m + radius_m)),
        }
    }

    pub(crate) fn is_mesh(&self) -> bool {
        matches!(self.core, Core::Mesh(_))
    }

    /// Whether the solid is convex, so that planes separate it from other such solids.
    pub(crate) fn is_convex(&self) -> bool {
        !self.is_mesh()
    }

    /// Centre and radius of a ball around the shape, in the shape's frame, m.
    pub fn bounding_sphere_m(&self) -> (Point3<f64>, f64) {
        (Point3::from(self.bound.centre), self.bound.ball_radius_m)
    }
}

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
    a: &'s Core,
    b: &'s Core,
    b_from_a: Placement,
    /// A is stretched along this vector.
    sweep: Vector3<f64>,
    hint_a: usize,
    hint_b: usize,
}

impl<'s> Difference<'s> {
    pub fn new(a: &'s Core, b: &'s Core, b_from_a: Placement) -> Self {
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
    pub fn with_hint(self, hint_a: usize) -> Self {
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
