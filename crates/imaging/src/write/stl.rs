//! Surfaces as binary STL, in millimetres of `ct` (LPS).

use std::io::{self, Write};
use std::path::Path;

use nalgebra::Vector3;
use needlebench_geometry::TriangleMesh;

use super::file::write_whole;
use crate::ImagingError;

/// Writes a closed surface, its triangles counter-clockwise seen from outside. Places are rounded to single precision: to
/// 0.03 um within half a metre of the origin.
///
/// # Errors
/// A file that cannot be written.
pub fn write_stl(path: &Path, mesh: &TriangleMesh) -> Result<(), ImagingError> {
    write_whole(path, |file| {
        let mut header = [0; 80];
        let words = b"binary STL, mm, axes left posterior superior";
        header[..words.len()].copy_from_slice(words);
        file.write_all(&header)?;
        let count = u32::try_from(mesh.triangles.len())
            .map_err(|_| io::Error::other("more than 2^32 triangles"))?;
        file.write_all(&count.to_le_bytes())?;
        for triangle in &mesh.triangles {
            let corners = triangle.map(|at| mesh.vertices_m[at as usize].coords * 1e3);
            let normal = (corners[1] - corners[0]).cross(&(corners[2] - corners[0]));
            let normal = normal.try_normalize(0.0).unwrap_or_else(Vector3::zeros);
            for vector in [normal].iter().chain(&corners) {
                for number in vector {
                    #[expect(
                        clippy::cast_possible_truncation,
                        reason = "STL has single precision"
                    )]
                    file.write_all(&(*number as f32).to_le_bytes())?;
                }
            }
            file.write_all(&[0, 0])?;
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use needlebench_geometry::mesh::read_stl;

    #[test]
    fn what_is_written_is_read_as_the_same_surface() {
        let mesh = needlebench_geometry::sample_solids::ell();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.stl");
        write_stl(&path, &mesh).unwrap();
        let read = read_stl(&std::fs::read(&path).unwrap(), [1e-3; 3]).unwrap();
        assert_eq!(read.triangles.len(), mesh.triangles.len());
        let volume = needlebench_geometry::mesh::volume_m3;
        assert!((volume(&read) - volume(&mesh)).abs() < 1e-6 * volume(&mesh));
        assert!(volume(&read) > 0.0);
    }
}
