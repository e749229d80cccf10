//! Engine-neutral geometry: what the clearance checker and both engines are given.

use std::sync::Arc;

use nalgebra::{Point3, Vector3};
use needlebench_kinematics::Pose;

/// A convex solid, centred on its own frame.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// Ball about the origin.
    Sphere {
        /// Radius, m.
        radius_m: f64,
    },
    /// Right circular cylinder about z, centred on the origin.
    Cylinder {
        /// Radius, m.
        radius_m: f64,
        /// Half of the length along z, m.
        half_length_m: f64,
    },
    /// Points within `radius_m` of a segment on z, centred on the origin.
    Capsule {
        /// Radius, m.
        radius_m: f64,
        /// Half of the segment's length, m; the capsule reaches `radius_m` further.
        half_length_m: f64,
    },
    /// Box along the axes, centred on the origin.
    Cuboid {
        /// Half of the edge lengths, m.
        half_extents_m: Vector3<f64>,
    },
    /// Convex polyhedron.
    Convex(Arc<ConvexMesh>),
}

impl Shape {
    /// Radius of a ball about the shape's origin that holds it, m.
    pub fn bounding_radius_m(&self) -> f64 {
        match self {
            Self::Sphere { radius_m } => *radius_m,
            Self::Cylinder {
                radius_m,
                half_length_m,
            } => radius_m.hypot(*half_length_m),
            Self::Capsule {
                radius_m,
                half_length_m,
            } => radius_m + half_length_m,
            Self::Cuboid { half_extents_m } => half_extents_m.norm(),
            Self::Convex(mesh) => mesh
                .0
                .vertices_m
                .iter()
                .map(|vertex| vertex.coords.norm())
                .fold(0.0, f64::max),
        }
    }
}

/// A closed triangle mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct TriangleMesh {
    /// Vertices, m.
    pub vertices_m: Vec<Point3<f64>>,
    /// Vertex indices, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// A convex polyhedron: a closed triangle mesh of which every vertex is an extreme point.
#[derive(Debug, Clone, PartialEq)]
pub struct ConvexMesh(pub TriangleMesh);

/// A shape at a place of its parent frame (a link, the tool, the phantom or the world).
#[derive(Debug, Clone, PartialEq)]
pub struct Solid {
    /// Unique within the cell, e.g. `upper_arm.1`, `skin`, `rib_left_4.2`.
    pub name: String,
    /// The shape.
    pub shape: Shape,
    /// Pose of the shape in its parent frame.
    pub parent_from_shape: Pose,
}

/// A coloured surface, for pictures only.
#[derive(Debug, Clone, PartialEq)]
pub struct Visual {
    /// Surface in its own frame, m.
    pub mesh: Arc<TriangleMesh>,
    /// Pose of the surface in its parent frame.
    pub parent_from_visual: Pose,
    /// Red, green, blue, opacity, each 0 to 1 (sRGB).
    pub color_rgba: [f32; 4],
}
