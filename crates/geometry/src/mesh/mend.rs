//! Closing the seams of a surface that somebody else has made.

use std::collections::{BTreeMap, HashSet};

use super::check::{EdgeCounts, has_no_area};
use crate::measure::{area_m2, area_vector, corners};
use crate::triangle_mesh::TriangleMesh;

/// A surface with its seams closed, and what that took.
#[derive(Debug, Clone, PartialEq)]
pub struct Mended {
    /// The closed surface. It holds every triangle of the given one that has an area.
    pub mesh: TriangleMesh,
    /// Triangles that were left out: without area, or the same as another.
    pub dropped: usize,
    /// Loops of open edges that were filled.
    pub loops: usize,
    /// Share of the surface's area that was filled.
    pub filled_share: f64,
    /// Longest edge that was put in, m.
    pub longest_m: f64,
}

/// Closes a welded surface by triangles over its loops of open edges.
///
/// Triangles are only added where the edges of others lack their counterpart, so that a distance
/// from the mended surface is never more than from the given one. Loops are filled by cutting off
/// the corner with the shortest new edge, again and again.
pub fn mend(mut mesh: TriangleMesh) -> Mended {
    let before = mesh.triangles.len();
    let mut seen = HashSet::new();
    let sound: Vec<[u32; 3]> = mesh
        .triangles
        .iter()
        .copied()
        .filter(|&triangle| {
            let turn = (0..3).min_by_key(|&k| triangle[k]).unwrap_or(0);
            let mut key = triangle;
            key.rotate_left(turn);
            !has_no_area(&mesh, triangle) && seen.insert(key)
        })
        .collect();
    mesh.triangles = sound;
    let dropped = before - mesh.triangles.len();
    let area = area_m2(&mesh);
    let loops = open_loops(&mesh);
    let (mut filled, mut longest_m) = (0.0, 0.0_f64);
    for corner_loop in &loops {
        for (triangle, new_edge_m) in fill(&mesh, corner_loop) {
            longest_m = longest_m.max(new_edge_m);
            // A corner on the edge of its neighbour leaves a gap without an area.
            if !has_no_area(&mesh, triangle) {
                filled += 0.5 * area_vector(corners(&mesh, triangle)).norm();
                mesh.triangles.push(triangle);
            }
        }
    }
    Mended {
        mesh,
        dropped,
        loops: loops.len(),
        filled_share: if area > 0.0 { filled / area } else { 1.0 },
        longest_m,
    }
}

/// Loops of the edges that are missing, none of which visits a vertex twice.
fn open_loops(mesh: &TriangleMesh) -> Vec<Vec<u32>> {
    // What is missing runs against what is there.
    let mut onward: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for (from, to) in EdgeCounts::of(mesh).unmatched() {
        onward.entry(to).or_default().push(from);
    }
    let starts: Vec<u32> = onward.keys().copied().collect();
    let mut loops = Vec::new();
    for start in starts {
        let mut path = vec![start];
        // At every vertex as many edges end as start, so that the path only ends where it began.
        while let Some(next) = path
            .last()
            .and_then(|vertex| onward.get_mut(vertex))
            .and_then(Vec::pop)
        {
            if let Some(at) = path.iter().position(|&vertex| vertex == next) {
                loops.push(path.split_off(at));
            }
            path.push(next);
        }
    }
    loops
}

/// Triangles over a loop, each with the length of its new edge, m.
fn fill(mesh: &TriangleMesh, corner_loop: &[u32]) -> Vec<([u32; 3], f64)> {
    let mut rest = corner_loop.to_vec();
    let mut triangles = Vec::new();
    let at = |vertex: u32| mesh.vertices_m[vertex as usize];
    while rest.len() >= 3 {
        let count = rest.len();
        let ear = |i: usize| {
            [
                rest[(i + count - 1) % count],
                rest[i],
                rest[(i + 1) % count],
            ]
        };
        let cut = |i: usize| {
            let [a, _, c] = ear(i);
            (at(c) - at(a)).norm()
        };
        let shortest = (0..count)
            .min_by(|&i, &j| cut(i).total_cmp(&cut(j)))
            .unwrap_or(0);
        let new_edge_m = if count > 3 { cut(shortest) } else { 0.0 };
        triangles.push((ear(shortest), new_edge_m));
        rest.remove(shortest);
    }
    triangles
}

#[cfg(test)]
mod tests {
    use super::super::check::check_closed;
    use super::*;
    use crate::measure::volume_m3;
    use crate::sample_solids::{bowl, torus};

    #[test]
    fn sound_surface_is_left_as_it_is() {
        let mended = mend(torus(24, 12));
        assert_eq!(mended.mesh, torus(24, 12));
        assert_eq!((mended.dropped, mended.loops), (0, 0));
    }

    #[test]
    fn holes_are_closed_and_their_size_is_told() {
        let mut mesh = bowl();
        let whole = volume_m3(&mesh);
        // Two beside each other, one apart, one given twice and one without area.
        let removed = [mesh.triangles.remove(60), mesh.triangles.remove(60)];
        mesh.triangles.remove(10);
        mesh.triangles.push(mesh.triangles[5]);
        mesh.triangles.push([0, 3, 3]);
        let mended = mend(mesh);
        assert_eq!((mended.dropped, mended.loops), (2, 2));
        assert!(mended.longest_m > 0.0 && mended.filled_share < 0.1);
        let volume = check_closed(&mended.mesh).unwrap().volume_m3;
        // The filled ones may fold over the other diagonal.
        assert!((volume / whole - 1.0).abs() < 1e-2, "{removed:?}");
    }

    #[test]
    fn vertex_beside_an_edge_leaves_no_gap() {
        // A corner on the long edge of its neighbour, as exporters of CAD leave them.
        let mut mesh = bowl();
        let [a, b, c] = mesh.triangles[30];
        let middle = nalgebra::center(&mesh.vertices_m[a as usize], &mesh.vertices_m[b as usize]);
        mesh.vertices_m.push(middle);
        let m = u32::try_from(mesh.vertices_m.len() - 1).unwrap();
        mesh.triangles[30] = [a, m, c];
        mesh.triangles.push([m, b, c]);
        let mended = mend(mesh);
        assert_eq!(mended.loops, 1);
        assert!(mended.filled_share < 1e-12, "{}", mended.filled_share);
    }
}
