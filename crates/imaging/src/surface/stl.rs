//! Surfaces as binary STL, in millimetres of `ct` (LPS).

use nalgebra::Vector3;
use needlebench_geometry::TriangleMesh;
use needlebench_volume::VolumeError;

/// Bytes of text before the number of triangles.
const HEAD_BYTES: usize = 80;
/// Bytes of a triangle.
const TRIANGLE_BYTES: usize = 50;

/// A closed surface as the bytes of a file, its triangles counter-clockwise seen from outside. Places are rounded to
/// single precision: to 0.03 um within half a metre of the origin.
///
/// # Errors
/// More triangles than the format can count.
pub fn stl_bytes(mesh: &TriangleMesh) -> Result<Vec<u8>, VolumeError> {
    let count = u32::try_from(mesh.triangles.len())
        .map_err(|_| VolumeError::refused("more than 2^32 triangles, the most of an STL file"))?;
    let mut bytes = Vec::with_capacity(HEAD_BYTES + 4 + TRIANGLE_BYTES * mesh.triangles.len());
    bytes.extend_from_slice(b"binary STL, mm, axes left posterior superior");
    bytes.resize(HEAD_BYTES, 0);
    bytes.extend_from_slice(&count.to_le_bytes());
    for triangle in &mesh.triangles {
        let corners = triangle.map(|at| mesh.vertices_m[at as usize].coords * 1e3);
        let normal = (corners[1] - corners[0]).cross(&(corners[2] - corners[0]));
        let normal = normal.try_normalize(0.0).unwrap_or_else(Vector3::zeros);
        for vector in [normal].iter().chain(&corners) {
            for number in vector {
                #[expect(clippy::cast_possible_truncation, reason = "STL has single precision")]
                bytes.extend_from_slice(&(*number as f32).to_le_bytes());
            }
        }
        bytes.extend_from_slice(&[0, 0]);
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use needlebench_geometry::mesh::read_stl;

    #[test]
    fn what_is_written_is_read_as_the_same_surface() {
        let mesh = needlebench_geometry::sample_solids::ell();
        let read = read_stl(&stl_bytes(&mesh).unwrap(), [1e-3; 3]).unwrap();
        assert_eq!(read.triangles.len(), mesh.triangles.len());
        let volume = needlebench_geometry::mesh::volume_m3;
        assert!((volume(&read) - volume(&mesh)).abs() < 1e-6 * volume(&mesh));
        assert!(volume(&read) > 0.0);
    }
}
