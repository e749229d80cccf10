//! Surfaces that come from files.

use nalgebra::Point3;

use super::{open_edges, size_m};
use crate::topology::{weld, weld_near};
use crate::triangle_mesh::TriangleMesh;

/// Corners that are nearer than this share of the mesh are one: a few steps of single precision.
const NEAR: f64 = 1e-6;

/// Why a file is not a mesh.
#[derive(Debug, thiserror::Error)]
pub enum MeshFileError {
    /// The file ends before its last triangle.
    #[error("it is empty or cut off")]
    CutOff,
    /// What Git LFS leaves where it has not fetched a file.
    #[error("it is a Git LFS pointer, not the file itself: fetch it with `git lfs pull`")]
    LfsPointer,
    /// Not of its format, or of a part of it that is not read.
    #[error("{0}")]
    Malformed(String),
    /// A coordinate is infinite or no number.
    #[error("vertex {vertex} is not finite")]
    NotFinite {
        /// The first such vertex, from 0.
        vertex: usize,
    },
    /// An empty mesh.
    #[error("it has no triangles")]
    NoTriangles,
    /// Vertices are numbered by 32 bits.
    #[error("more than 2^32 vertices")]
    TooManyVertices,
}

/// A mesh of the corners and triangles that a file has; `scale` multiplies the coordinates (URDF's `scale`). Equal vertices
/// are welded; where that leaves edges open, those that are as near as rounding leaves them, too.
///
/// # Errors
/// No triangles, or a corner that is not finite.
pub fn surface_of_file(
    mut vertices_m: Vec<Point3<f64>>,
    mut triangles: Vec<[u32; 3]>,
    scale: [f64; 3],
) -> Result<TriangleMesh, MeshFileError> {
    for vertex in &mut vertices_m {
        for axis in 0..3 {
            vertex[axis] *= scale[axis];
        }
    }
    if let Some(bad) = vertices_m
        .iter()
        .position(|v| !v.coords.iter().all(|c| c.is_finite()))
    {
        return Err(MeshFileError::NotFinite { vertex: bad });
    }
    if triangles.is_empty() {
        return Err(MeshFileError::NoTriangles);
    }
    // A mirrored surface would be inside out.
    if scale.iter().product::<f64>() < 0.0 {
        for triangle in &mut triangles {
            triangle.swap(1, 2);
        }
    }
    let mut mesh = TriangleMesh {
        vertices_m,
        triangles,
    };
    weld(&mut mesh);
    if open_edges(&mesh) > 0 {
        let near = weld_near(&mesh, NEAR * size_m(&mesh).norm());
        if open_edges(&near) < open_edges(&mesh) {
            mesh = near;
        }
    }
    Ok(mesh)
}
