//! Wavefront OBJ files.

use std::path::Path;

use nalgebra::Point3;
use tobj::{LoadError, LoadOptions, load_obj_buf};

use needlebench_geometry::mesh::MeshFileError;

use super::Surface;

/// The lines of corners and faces alone: normals, textures, colours and materials shape nothing, and their numbers may be
/// wrong. A `\\` at the end of a line joins it to the next.
///
/// # Errors
/// A curved surface, or another file that is read in: without them the shape would lack a part.
fn corners_and_faces(bytes: &[u8]) -> Result<String, MeshFileError> {
    let text = String::from_utf8_lossy(bytes);
    let joined = text.replace("\\\r\n", " ").replace("\\\n", " ");
    let mut kept = String::new();
    for line in joined.lines() {
        let mut words = line.split_whitespace();
        let (tag, most) = match words.next() {
            Some("v") => ("v", 3),
            Some("f") => ("f", usize::MAX),
            Some(tag @ ("surf" | "call")) => {
                return Err(MeshFileError::Malformed(format!(
                    "`{tag}` is not supported"
                )));
            }
            _ => continue,
        };
        kept += tag;
        for word in words.take(most) {
            kept.push(' ');
            // `corner/texture/normal`
            kept += word.split('/').next().unwrap_or(word);
        }
        kept.push('\n');
    }
    Ok(kept)
}

/// Surface of all objects of an OBJ file; materials, lines and points are left out.
///
/// # Errors
/// Malformed, or too many corners.
pub(super) fn read(bytes: &[u8]) -> Result<Surface, MeshFileError> {
    let text = corners_and_faces(bytes)?;
    let options = LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..LoadOptions::default()
    };
    // Colours matter to nobody here.
    let no_materials = |_: &Path| Err(LoadError::OpenFileFailed);
    let (models, _) = load_obj_buf(&mut std::io::Cursor::new(text), &options, no_materials)
        .map_err(|error| MeshFileError::Malformed(format!("cannot read the OBJ file: {error}")))?;
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for model in models {
        let first = u32::try_from(vertices.len()).map_err(|_| MeshFileError::TooManyVertices)?;
        let corners = model.mesh.positions.chunks_exact(3);
        vertices.extend(corners.map(|at| Point3::new(at[0], at[1], at[2])));
        let numbered = model.mesh.indices.chunks_exact(3);
        for corners in numbered {
            let corner = |at: usize| {
                first
                    .checked_add(corners[at])
                    .ok_or(MeshFileError::TooManyVertices)
            };
            triangles.push([corner(0)?, corner(1)?, corner(2)?]);
        }
    }
    Ok((vertices, triangles))
}

#[cfg(test)]
mod tests {
    use needlebench_geometry::mesh::{check_closed, volume_m3};

    use crate::mesh_file::{MeshFormat, read_mesh};

    /// A cube of two: faces of four corners, some counted from the end, two objects, what is not read.
    const CUBE: &str = "# a cube\nmtllib none.mtl\no lower\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n\
        vn 0 0 1\nvt 0 0\nv 0 0 1 1.0\nv 1 0 1\nv 1 1 1\nv 0 1 1\nusemtl none\ns off\n\
        f 1/1/1 4/1/1 3/1/1 2/1/1\nf -4 -3 -2 -1\no upper\nl 1 2 3\n\
        f 1 2 6 5\nf 2//9 3//-9 7//1 \\\n6//1\nf 3 4 8 7\nf 4 1 5 8\n";

    #[test]
    fn quads_of_several_objects_are_one_closed_surface() {
        let mesh = read_mesh(CUBE.as_bytes(), MeshFormat::Obj, [2.0, 1.0, 1.0]).unwrap();
        assert_eq!((mesh.vertices_m.len(), mesh.triangles.len()), (8, 12));
        assert!(check_closed(&mesh).is_ok());
        assert!((volume_m3(&mesh) - 2.0).abs() < 1e-12);
    }

    #[test]
    fn what_cannot_be_read_is_an_error() {
        for text in [
            "",
            "v 0 0 0\nf 1 2 3\n",
            "v 0 0 x\n",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nsurf 0 1 0 1 1 2 3\n",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -9\n",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9223372036854775807\n",
            "v 0 0 0\nv 1 0 0\nv 0 inf 0\nf 1 2 3\n",
        ] {
            assert!(
                read_mesh(text.as_bytes(), MeshFormat::Obj, [1.0; 3]).is_err(),
                "{text}"
            );
        }
    }
}
