//! STL files.

use std::borrow::Cow;
use std::collections::HashMap;

use nalgebra::Point3;

use crate::shape::TriangleMesh;

/// Reads a binary or text STL; `scale` multiplies the coordinates (URDF's `scale`). Equal vertices
/// are welded.
pub(crate) fn read_stl(bytes: &[u8], scale: [f64; 3]) -> Result<TriangleMesh, String> {
    let bytes = with_plain_header(bytes);
    let mesh = stl_io::read_stl(&mut std::io::Cursor::new(bytes)).map_err(|error| {
        if error.kind() == std::io::ErrorKind::UnexpectedEof {
            "it is empty or cut off".to_owned()
        } else {
            error.to_string()
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
        return Err(format!("vertex {bad} is not finite"));
    }
    if mesh.faces.is_empty() {
        return Err("it has no triangles".to_owned());
    }
    let index = |i: usize| u32::try_from(i).map_err(|_| "more than 2^32 vertices".to_owned());
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
        .collect::<Result<_, String>>()?;
    let mut mesh = TriangleMesh {
        vertices_m,
        triangles,
    };
    weld(&mut mesh);
    Ok(mesh)
}

/// Makes one vertex of those with the same coordinates, in the order of the first of each; vertices
/// that no triangle uses are left out.
pub(super) fn weld(mesh: &mut TriangleMesh) {
    let mut known: HashMap<[u64; 3], u32> = HashMap::with_capacity(mesh.vertices_m.len());
    let mut kept = Vec::new();
    for corner in mesh.triangles.iter_mut().flatten() {
        // Adding 0 turns -0 into 0.
        let vertex = mesh.vertices_m[*corner as usize].map(|coordinate| coordinate + 0.0);
        let key = [vertex.x, vertex.y, vertex.z].map(f64::to_bits);
        *corner = *known.entry(key).or_insert_with(|| {
            kept.push(vertex);
            u32::try_from(kept.len() - 1).expect("no more than there were before")
        });
    }
    mesh.vertices_m = kept;
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
