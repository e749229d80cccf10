//! STL files.

use std::borrow::Cow;

use nalgebra::Point3;

use crate::topology::{Map, map_for, weld};
use crate::triangle_mesh::TriangleMesh;

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
    let refused = |error: std::io::Error| {
        if error.kind() == std::io::ErrorKind::UnexpectedEof {
            StlError::CutOff
        } else {
            StlError::Malformed(error)
        }
    };
    let mut file = std::io::Cursor::new(&bytes);
    let triangles_of_file = stl_io::create_stl_reader(&mut file).map_err(refused)?;
    // Corners with the same bits are one vertex, as the file has no others; nothing is reserved by what a
    // broken file says of itself.
    let mut known: Map<[u32; 3], u32> = map_for(0);
    let mut vertices_m: Vec<Point3<f64>> = Vec::new();
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for triangle in triangles_of_file {
        let corners = triangle.map_err(refused)?.vertices;
        let mut numbers = [0; 3];
        for (number, corner) in numbers.iter_mut().zip(corners) {
            let next = u32::try_from(vertices_m.len()).map_err(|_| StlError::TooManyVertices)?;
            *number = *known.entry(corner.0.map(f32::to_bits)).or_insert(next);
            if *number == next {
                let at = |axis: usize| f64::from(corner[axis]) * scale[axis];
                vertices_m.push(Point3::new(at(0), at(1), at(2)));
            }
        }
        triangles.push(numbers);
    }
    if let Some(bad) = vertices_m
        .iter()
        .position(|v| !v.coords.iter().all(|c| c.is_finite()))
    {
        return Err(StlError::NotFinite { vertex: bad });
    }
    if triangles.is_empty() {
        return Err(StlError::NoTriangles);
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
