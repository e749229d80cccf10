//! Which vertices and triangles of a mesh belong together.

use std::collections::HashMap;

use foldhash::fast::FixedState;
use nalgebra::Point3;

use crate::triangle_mesh::TriangleMesh;

/// A map of which nobody asks for the order.
pub(crate) type Map<K, V> = HashMap<K, V, FixedState>;

/// An empty one.
pub(crate) fn map_for<K, V>(count: usize) -> Map<K, V> {
    Map::with_capacity_and_hasher(count, FixedState::default())
}

/// Makes one vertex of those with the same coordinates, in the order of the first of each; vertices
/// that no triangle uses are left out.
pub fn weld(mesh: &mut TriangleMesh) {
    // Adding 0 turns -0 into 0.
    for vertex in &mut mesh.vertices_m {
        *vertex = vertex.map(|coordinate| coordinate + 0.0);
    }
    let mut known: Map<[u64; 3], usize> = map_for(mesh.vertices_m.len());
    let first_at_place: Vec<usize> = mesh
        .vertices_m
        .iter()
        .enumerate()
        .map(|(index, vertex)| {
            let key = [vertex.x, vertex.y, vertex.z].map(f64::to_bits);
            *known.entry(key).or_insert(index)
        })
        .collect();
    let mut numbers: Vec<Option<u32>> = vec![None; mesh.vertices_m.len()];
    let mut kept = Vec::with_capacity(known.len());
    for corner in mesh.triangles.iter_mut().flatten() {
        let first = first_at_place[*corner as usize];
        *corner = *numbers[first].get_or_insert_with(|| {
            kept.push(mesh.vertices_m[first]);
            u32::try_from(kept.len() - 1).expect("no more than there were before")
        });
    }
    mesh.vertices_m = kept;
}

/// A cell and those around it.
const AROUND: [[i64; 3]; 27] = {
    let mut all = [[0; 3]; 27];
    let (mut index, mut at) = (0_usize, 0_i64);
    while index < 27 {
        all[index] = [at % 3 - 1, at / 3 % 3 - 1, at / 9 - 1];
        (index, at) = (index + 1, at + 1);
    }
    all
};

/// The mesh with one vertex for those that are nearer to it than `near_m`, the first of them; triangles that lose
/// their area by that are left out.
pub(crate) fn weld_near(mesh: &TriangleMesh, near_m: f64) -> TriangleMesh {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a millionth of the mesh fits it some million times"
    )]
    let cell_of = |at: &Point3<f64>| {
        at.coords
            .map(|each| (each / near_m).floor())
            .map(|each| each as i64)
    };
    let mut firsts: Map<[i64; 3], Vec<u32>> = map_for(mesh.vertices_m.len());
    let mut stands_for = Vec::with_capacity(mesh.vertices_m.len());
    for (number, vertex) in (0_u32..).zip(&mesh.vertices_m) {
        let cell = cell_of(vertex);
        let known = AROUND.iter().flat_map(|by| {
            let beside = std::array::from_fn(|axis| cell[axis].saturating_add(by[axis]));
            firsts.get(&beside).into_iter().flatten().copied()
        });
        let place = |first: u32| mesh.vertices_m[first as usize];
        let near = known
            .filter(|&first| (place(first) - vertex).norm() <= near_m)
            .min();
        if near.is_none() {
            firsts.entry(cell.into()).or_default().push(number);
        }
        stands_for.push(near.unwrap_or(number));
    }
    let mut welded = TriangleMesh {
        vertices_m: mesh.vertices_m.clone(),
        triangles: mesh
            .triangles
            .iter()
            .map(|corners| corners.map(|corner| stands_for[corner as usize]))
            .filter(|[a, b, c]| a != b && b != c && c != a)
            .collect(),
    };
    weld(&mut welded);
    welded
}

/// The triangles of each part that shares no vertex with another; parts by their first triangle,
/// triangles in their order. All triangles must name vertices that are there.
pub fn connected_parts(mesh: &TriangleMesh) -> Vec<Vec<usize>> {
    // A forest of vertices: each tree is a part, and its root stands for it.
    let mut above: Vec<u32> = (0..).take(mesh.vertices_m.len()).collect();
    for &[a, b, c] in &mesh.triangles {
        let root = root_of(&mut above, a);
        for other in [b, c] {
            let other = root_of(&mut above, other);
            above[other as usize] = root;
        }
    }
    let mut part_of_root: Vec<Option<usize>> = vec![None; above.len()];
    let mut parts: Vec<Vec<usize>> = Vec::new();
    for (index, triangle) in mesh.triangles.iter().enumerate() {
        let root = root_of(&mut above, triangle[0]);
        let part = *part_of_root[root as usize].get_or_insert_with(|| {
            parts.push(Vec::new());
            parts.len() - 1
        });
        parts[part].push(index);
    }
    parts
}

/// The root of a vertex's tree, whose ways are made shorter.
fn root_of(above: &mut [u32], mut vertex: u32) -> u32 {
    loop {
        let next = above[vertex as usize];
        if next == vertex {
            return vertex;
        }
        above[vertex as usize] = above[next as usize];
        vertex = next;
    }
}
