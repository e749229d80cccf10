//! Surfaces made of triangles.

use nalgebra::Point3;
use serde::{Deserialize, Serialize};

/// A closed triangle mesh.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TriangleMesh {
    /// Vertices, m.
    pub vertices_m: Vec<Point3<f64>>,
    /// Vertex indices, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl TriangleMesh {
    /// Radius of a ball about the origin that holds all vertices, m.
    pub fn bounding_radius_m(&self) -> f64 {
        self.vertices_m
            .iter()
            .map(|vertex| vertex.coords.norm())
            .fold(0.0, f64::max)
    }
}

/// A convex polyhedron: a closed triangle mesh of which every vertex is an extreme point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ConvexMesh(pub TriangleMesh);
