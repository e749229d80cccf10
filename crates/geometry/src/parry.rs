//! Meshes as parry takes them.

use parry3d_f64::math::Vector;

use crate::triangle_mesh::TriangleMesh;

/// Vertices in metres: what is asked of parry here has no tolerance of its own.
pub(crate) fn vertices(mesh: &TriangleMesh) -> Vec<Vector> {
    mesh.vertices_m
        .iter()
        .map(|vertex| Vector::new(vertex.x, vertex.y, vertex.z))
        .collect()
}
