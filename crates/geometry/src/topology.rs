//! Which vertices and triangles of a mesh belong together.

use std::collections::HashMap;

use parry3d_f64::shape::{TriMesh, TriMeshFlags};

use crate::parry;
use crate::shape::TriangleMesh;

/// Makes one vertex of those with the same coordinates, in the order of the first of each; vertices
/// that no triangle uses are left out.
pub fn weld(mesh: &mut TriangleMesh) {
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

/// The triangles of each part that shares no vertex with another; parts by their first triangle,
/// triangles in their order. All triangles must name vertices that are there.
pub(crate) fn connected_parts(mesh: &TriangleMesh) -> Vec<Vec<usize>> {
    let flags = TriMeshFlags::CONNECTED_COMPONENTS;
    // Without triangles there are no parts.
    let Ok(parry) = TriMesh::with_flags(parry::vertices(mesh), mesh.triangles.clone(), flags)
    else {
        return Vec::new();
    };
    let components = parry.connected_components().expect("they were asked for");
    let mut parts: Vec<Vec<usize>> = components
        .ranges
        .windows(2)
        .map(|range| {
            let triangles = &components.grouped_faces[range[0]..range[1]];
            let mut part: Vec<usize> = triangles.iter().map(|&i| i as usize).collect();
            part.sort_unstable();
            part
        })
        .collect();
    parts.sort_unstable();
    parts
}
