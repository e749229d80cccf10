//! STL files.

use std::borrow::Cow;

use nalgebra::Point3;

use super::file::{MeshFileError, surface_of_file};
use crate::topology::{Map, map_for};
use crate::triangle_mesh::TriangleMesh;

/// Reads a binary or text STL, as [`surface_of_file`].
///
/// # Errors
/// See [`MeshFileError`].
pub fn read_stl(bytes: &[u8], scale: [f64; 3]) -> Result<TriangleMesh, MeshFileError> {
    if is_lfs_pointer(bytes) {
        return Err(MeshFileError::LfsPointer);
    }
    let bytes = with_plain_header(bytes);
    let refused = |error: std::io::Error| {
        if error.kind() == std::io::ErrorKind::UnexpectedEof {
            MeshFileError::CutOff
        } else {
            MeshFileError::Malformed(error.to_string())
        }
    };
    let mut file = std::io::Cursor::new(&bytes);
    let triangles_of_file = stl_io::create_stl_reader(&mut file).map_err(refused)?;
    // Corners with the same bits are one vertex, as the file has no others; nothing is reserved by what a
    // broken file says of itself.
    let mut known: Map<[u32; 3], u32> = map_for(0);
    let mut vertices: Vec<Point3<f64>> = Vec::new();
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for triangle in triangles_of_file {
        let corners = triangle.map_err(refused)?.vertices;
        let mut numbers = [0; 3];
        for (number, corner) in numbers.iter_mut().zip(corners) {
            let next = u32::try_from(vertices.len()).map_err(|_| MeshFileError::TooManyVertices)?;
            *number = *known.entry(corner.0.map(f32::to_bits)).or_insert(next);
            if *number == next {
                vertices.push(Point3::from(corner.0.map(f64::from)));
            }
        }
        triangles.push(numbers);
    }
    surface_of_file(vertices, triangles, scale)
}

/// Whether a file is what Git LFS leaves where it has not fetched one.
pub fn is_lfs_pointer(bytes: &[u8]) -> bool {
    bytes.starts_with(b"version https://git-lfs")
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
    // Some writers shout.
    let lower: Cow<'_, [u8]> = match bytes.get(..5) {
        Some(word) if word != b"solid" && word.eq_ignore_ascii_case(b"solid") => {
            bytes.to_ascii_lowercase().into()
        }
        _ => bytes.into(),
    };
    match lower.strip_prefix(b"solid") {
        Some(rest) if rest.starts_with(b"\n") || rest.starts_with(b"\r") => {
            [b"solid unnamed", rest].concat().into()
        }
        _ => lower,
    }
}
