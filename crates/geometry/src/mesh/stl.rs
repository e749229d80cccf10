//! STL files.

use std::borrow::Cow;

use nalgebra::Point3;

use crate::shape::TriangleMesh;
use crate::topology::weld;

/// Why a file is not a mesh.
#[derive(Debug, thiserror::Error)]
pub enum StlError {
    /// The file ends before its last triangle.
    #[error("it is empty or cut off")]
    CutOff,
    /// Neither a binary nor a text STL.
    #[error("{0}")]
    Malformed(std::io::Error),
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

/// Reads a binary or text STL; `scale` multiplies the coordinates (URDF's `scale`). Equal vertices
/// are welded.
///
/// # Errors
/// See [`StlError`].
pub fn read_stl(bytes: &[u8], scale: [f64; 3]) -> Result<TriangleMesh, StlError> {
    let bytes = with_plain_header(bytes);
    let mesh = stl_io::read_stl(&mut std::io::Cursor::new(bytes)).map_err(|error| {
        if error.kind() == std::io::ErrorKind::UnexpectedEof {
            StlError::CutOff
        } else {
            StlError::Malformed(error)
        }
    })?;
    let vertices_m: Vec<Point3<f64>> = mesh
        .vertices
        .iter()
        .map(|v| {
            Point3::new(
                f64::from(v[0]) * scale[0],
                f64::from(v[1]) * scale[1],
                f64::from(v[2]) * scale[2],
            )
        })
        .collect();
    if let Some(bad) = vertices_m
        .iter()
        .position(|v| !v.coords.iter().all(|c| c.is_finite()))
    {
        return Err(StlError::NotFinite { vertex: bad });
    }
    if mesh.faces.is_empty() {
        return Err(StlError::NoTriangles);
    }
    let index = |i: usize| u32::try_from(i).map_err(|_| StlError::TooManyVertices);
    // A mirrored surface would be inside out.
    let order = if scale.iter().product::<f64>() < 0.0 {
        [0, 2, 1]
    } else {
        [0, 1, 2]
    };
    let triangles = mesh
        .faces
        .iter()
        .map(|face| {
            Ok([
                index(face.vertices[order[0]])?,
                index(face.vertices[order[1]])?,
                index(face.vertices[order[2]])?,
            ])
        })
        .collect::<Result<_, StlError>>()?;
    let mut mesh = TriangleMesh {
        vertices_m,
        triangles,
    };
    weld(&mut mesh);
    Ok(mesh)
}

/// Header of a binary STL: free text and the number of triangles.
const STL_HEADER_BYTES: usize = 84;
const STL_TRIANGLE_BYTES: usize = 50;

/// The file with a header from which its kind can be told: some writers start binary files with
/// `solid`, and some give the solid of a text file no name.
fn with_plain_header(bytes: &[u8]) -> Cow<'_, [u8]> {
    let count = bytes
        .get(80..STL_HEADER_BYTES)
        .and_then(|count| count.try_into().ok())
        .map(u32::from_le_bytes);
    let is_binary = count.is_some_and(|count| {
        Some(bytes.len() - STL_HEADER_BYTES) == (count as usize).checked_mul(STL_TRIANGLE_BYTES)
    });
    if is_binary {
        let mut plain = bytes.to_vec();
        plain[..80].fill(0);
        return plain.into();
    }
    match bytes.strip_prefix(b"solid") {
        Some(rest) if rest.starts_with(b"\n") || rest.starts_with(b"\r") => {
            [b"solid unnamed", rest].concat().into()
        }
        _ => bytes.into(),
    }
}
