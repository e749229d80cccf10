//! Engine-neutral geometry: what the clearance checker and both engines are given.

use std::sync::Arc;

use nalgebra::{Point3, Vector3};
use needlebench_kinematics::Pose;
use serde::{Deserialize, Serialize};

use crate::mesh::{SolidMesh, as_convex};
use crate::triangle_mesh::{ConvexMesh, TriangleMesh};

/// Vertices of the largest convex mesh that stays one.
const MOST_CONVEX_VERTICES: usize = 2000;

/// A solid in its own frame; primitives are centred on it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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
    /// Solid inside a closed surface that need not be convex.
    Mesh(Arc<SolidMesh>),
}

impl Shape {
    /// The solid within a sound, closed surface: the exact hull of a convex one, and all others as they
    /// are.
    pub fn of_surface(surface: TriangleMesh) -> Self {
        let small = surface.vertices_m.len() <= MOST_CONVEX_VERTICES;
        if small && let Some(hull) = as_convex(&surface) {
            return Self::Convex(Arc::new(hull));
        }
        Self::Mesh(Arc::new(SolidMesh::new(surface)))
    }

    /// Radius of a ball about the shape's origin that holds it, m.
    pub fn bounding_radius_m(&self) -> f64 {
        match self {
            Self::Sphere { radius_m } => *radius_m,
            Self::Cylinder {
                radius_m,
                half_length_m,
            } => libm::hypot(*radius_m, *half_length_m),
            Self::Capsule {
                radius_m,
                half_length_m,
            } => radius_m + half_length_m,
            Self::Cuboid { half_extents_m } => half_extents_m.norm(),
            Self::Convex(mesh) => mesh.0.bounding_radius_m(),
            Self::Mesh(mesh) => mesh.surface().bounding_radius_m(),
        }
    }
}

/// A shape at a place of its parent frame (a link, the tool, the phantom or the world).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Solid {
    /// Unique within the cell, e.g. `upper_arm.1`, `skin`, `rib_left_4.2`.
    pub name: String,
    /// The shape.
    pub shape: Shape,
    /// Pose of the shape in its parent frame.
    pub parent_from_shape: Pose,
}

impl Solid {
    /// Lowest and highest corner of a box along the parent's axes that holds the solid, m. A little
    /// wider than the tightest, so that rounding leaves no point outside.
    pub fn bounding_box(&self) -> (Point3<f64>, Point3<f64>) {
        /// More than the rounding of some metres.
        const ROUNDING_M: f64 = 1e-9;
        let rotation = self.parent_from_shape.rotation.to_rotation_matrix();
        let centre = self.parent_from_shape.translation.vector;
        let of_vertices = |mesh: &TriangleMesh| {
            let start = (
                Vector3::repeat(f64::INFINITY),
                Vector3::repeat(f64::NEG_INFINITY),
            );
            mesh.vertices_m.iter().fold(start, |(low, high), vertex| {
                let at = rotation * vertex.coords;
                (low.inf(&at), high.sup(&at))
            })
        };
        let about_centre = |half: Vector3<f64>| (-half, half);
        // How far the axis of a cylinder, and the disc across it, reach along each axis.
        let axis = rotation.matrix().column(2).abs();
        let across = axis.map(|share| (1.0 - share * share).max(0.0).sqrt());
        let (low, high) = match &self.shape {
            Shape::Sphere { radius_m } => about_centre(Vector3::repeat(*radius_m)),
            Shape::Cylinder {
                radius_m,
                half_length_m,
            } => about_centre(axis * *half_length_m + across * *radius_m),
            Shape::Capsule {
                radius_m,
                half_length_m,
            } => about_centre((axis * *half_length_m).add_scalar(*radius_m)),
            Shape::Cuboid { half_extents_m } => {
                about_centre(rotation.matrix().abs() * half_extents_m)
            }
            Shape::Convex(mesh) => of_vertices(&mesh.0),
            Shape::Mesh(mesh) => of_vertices(mesh.surface()),
        };
        (
            (centre + low.add_scalar(-ROUNDING_M)).into(),
            (centre + high.add_scalar(ROUNDING_M)).into(),
        )
    }
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
