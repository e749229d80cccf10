//! What makes a triangle mesh the surface of a solid.

use std::collections::hash_map::Entry;

use nalgebra::Point3;

use crate::measure::{area_vector, corners, size_m, volume_m3};
use crate::topology::{Map, connected_parts, map_for};
use crate::tree::TriangleTree;
use crate::triangle_mesh::TriangleMesh;

/// How far beside a surface its sides are looked at, relative to the mesh's size.
const BESIDE: f64 = 1e-7;

/// Why a mesh is not the surface of a solid. Triangles count from 0, in the file's order; places
/// are in metres, in the mesh's own frame.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeshDefect {
    /// A triangle without an area.
    #[error(
        "triangle {triangle} at {} has zero area{}",
        place(at_m),
        and_others(*count, "such triangle", "such triangles")
    )]
    NoArea {
        /// The first such triangle.
        triangle: usize,
        /// Its first corner.
        at_m: Point3<f64>,
        /// Such triangles.
        count: usize,
    },
    /// Two triangles with the same corners.
    #[error(
        "triangles {first} and {second} have the same three corners, at {}{}",
        place(at_m),
        and_others(*count, "such pair", "such pairs")
    )]
    Twice {
        /// The first triangle of the first such pair.
        first: usize,
        /// The second one.
        second: usize,
        /// Their first corner.
        at_m: Point3<f64>,
        /// Such pairs.
        count: usize,
    },
    /// Edges that belong to one triangle only.
    #[error(
        "the surface is open: {edges} of its edges belong to one triangle only, the first of them \
         at {}",
        place(at_m)
    )]
    Open {
        /// Such edges.
        edges: usize,
        /// Middle of the first one in the file.
        at_m: Point3<f64>,
    },
    /// A closed part that is inside out.
    #[error(
        "the surface is inside out at {}: triangle {triangle} faces the solid's inside{}",
        place(at_m),
        and_others(*count, "such closed part", "such closed parts")
    )]
    Inverted {
        /// The largest triangle of the first such part.
        triangle: usize,
        /// Its first corner.
        at_m: Point3<f64>,
        /// Closed parts that are inside out.
        count: usize,
    },
    /// The volume within is zero.
    #[error("it encloses no volume")]
    NoVolume,
}

impl MeshDefect {
    /// How to fix it.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::NoArea { .. } => {
                "remove it in a mesh editor (MeshLab: Remove Zero Area Faces, or merge close \
                 vertices)"
            }
            Self::Twice { .. } => {
                "remove one of them in a mesh editor (MeshLab: Remove Duplicate Faces)"
            }
            Self::Open { .. } => {
                "a solid needs a closed surface: close the holes (MeshLab: Close Holes), or export \
                 the segmentation with its ends capped"
            }
            Self::Inverted { .. } => {
                "invert the triangles (MeshLab: Invert Faces Orientation), so that their \
                 corners run counter-clockwise seen from outside"
            }
            Self::NoVolume => "a solid needs a volume: is this a single sheet?",
        }
    }
}

fn place(at_m: &Point3<f64>) -> String {
    let mm = at_m * 1e3;
    format!("[{:.3}, {:.3}, {:.3}] mm", mm.x, mm.y, mm.z)
}

fn and_others(count: usize, one: &str, many: &str) -> String {
    match count {
        0 | 1 => String::new(),
        2 => format!(" (and 1 other {one})"),
        _ => format!(" (and {} other {many})", count - 1),
    }
}

/// Properties of a closed mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeshFacts {
    /// Closed parts that share no vertex.
    pub components: usize,
    /// Edges at which more than two triangles meet: the surface touches itself there.
    pub shared_edges: usize,
    /// Volume within, m^3.
    pub volume_m3: f64,
}

/// Checks that a welded mesh is the surface of a solid: no triangle without an area or given twice,
/// every directed edge with its opposite, and facing outwards everywhere.
///
/// A triangle has no area if two of its corners are the same or rounding cannot tell its corners
/// from a line; slivers are sound. Edges and corners at which the surface touches itself are sound
/// as long as every triangle at an edge has its counterpart. A closed part inside another, facing
/// into its own inside, is a cavity.
pub fn check_closed(mesh: &TriangleMesh) -> Result<MeshFacts, MeshDefect> {
    if let Some(defect) = without_area(mesh) {
        return Err(defect);
    }
    if let Some(defect) = twice(mesh) {
        return Err(defect);
    }
    let edges = EdgeCounts::of(mesh);
    if let Some(defect) = edges.open(mesh) {
        return Err(defect);
    }
    let volume_m3 = volume_m3(mesh);
    let parts = components(mesh);
    let components = parts.len();
    if let Some(defect) = first_inverted(mesh, parts) {
        return Err(defect);
    }
    if volume_m3 <= 0.0 {
        return Err(MeshDefect::NoVolume);
    }
    Ok(MeshFacts {
        components,
        shared_edges: edges.shared(),
        volume_m3,
    })
}

/// Edges that lack an opposite.
pub fn open_edges(mesh: &TriangleMesh) -> usize {
    EdgeCounts::of(mesh).unmatched().len()
}

/// The first part of a closed surface that is inside out, if one is.
pub fn inverted_part(mesh: &TriangleMesh) -> Option<MeshDefect> {
    first_inverted(mesh, components(mesh))
}

/// A closed mesh without its parts that are inside out, such as cavities whose shell was reduced until it no longer
/// encloses them: what they took from the solid is filled.
pub fn without_inverted_parts(mesh: &TriangleMesh) -> TriangleMesh {
    let inverted = inverted(mesh, components(mesh));
    let parts = connected_parts(mesh);
    let stays = |part: &&Vec<usize>| !part.iter().any(|triangle| inverted.contains(triangle));
    let mut kept: Vec<usize> = parts.iter().filter(stays).flatten().copied().collect();
    kept.sort_unstable();
    let triangles: Vec<[u32; 3]> = kept.into_iter().map(|it| mesh.triangles[it]).collect();
    let mut used: Vec<u32> = triangles.iter().flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    let number = |vertex| u32::try_from(used.partition_point(|&it| it < vertex));
    TriangleMesh {
        vertices_m: used
            .iter()
            .map(|&it| mesh.vertices_m[it as usize])
            .collect(),
        triangles: triangles
            .iter()
            .map(|corners| corners.map(|vertex| number(vertex).unwrap_or(u32::MAX)))
            .collect(),
    }
}

/// Of the parts that these triangles belong to.
fn first_inverted(mesh: &TriangleMesh, parts: Vec<usize>) -> Option<MeshDefect> {
    let inverted = inverted(mesh, parts);
    let &triangle = inverted.first()?;
    Some(MeshDefect::Inverted {
        triangle,
        at_m: corners(mesh, mesh.triangles[triangle])[0],
        count: inverted.len(),
    })
}

/// Those of some triangles that face inwards.
fn inverted(mesh: &TriangleMesh, parts: Vec<usize>) -> Vec<usize> {
    /// A tree takes about as long to build as so many looks at every triangle.
    const FEW_PARTS: usize = 100;
    let tree = (parts.len() > FEW_PARTS).then(|| TriangleTree::new(mesh));
    let winding_number = |point: &Point3<f64>| match &tree {
        Some(tree) => tree.winding_number(point),
        None => mesh.winding_number(point),
    };
    let beside_m = BESIDE * size_m(mesh).norm();
    let faces_inward = |&triangle: &usize| {
        let [a, b, c] = corners(mesh, mesh.triangles[triangle]);
        let middle = Point3::from((a.coords + b.coords + c.coords) / 3.0);
        let normal = area_vector([a, b, c]).normalize();
        winding_number(&(middle + normal * beside_m)) < 0
    };
    parts.into_iter().filter(faces_inward).collect()
}

/// Whether rounding cannot tell a triangle from a line or a point.
pub fn has_no_area(mesh: &TriangleMesh, triangle: [u32; 3]) -> bool {
    /// Twice the area over the longest edge squared: rounding of its computation.
    const ROUNDING: f64 = 1e-14;
    let [a, b, c] = triangle;
    if a == b || b == c || c == a {
        return true;
    }
    let at = corners(mesh, triangle);
    let longest = (0..3)
        .map(|k| (at[(k + 1) % 3] - at[k]).norm_squared())
        .fold(0.0, f64::max);
    area_vector(at).norm() <= ROUNDING * longest
}

fn without_area(mesh: &TriangleMesh) -> Option<MeshDefect> {
    let mut flat = (0..mesh.triangles.len()).filter(|&i| has_no_area(mesh, mesh.triangles[i]));
    let triangle = flat.next()?;
    Some(MeshDefect::NoArea {
        triangle,
        at_m: corners(mesh, mesh.triangles[triangle])[0],
        count: 1 + flat.count(),
    })
}

fn twice(mesh: &TriangleMesh) -> Option<MeshDefect> {
    let mut seen = map_for(mesh.triangles.len());
    let mut found = None;
    let mut count = 0;
    for (second, triangle) in mesh.triangles.iter().enumerate() {
        let mut key = *triangle;
        key.sort_unstable();
        match seen.entry(key) {
            Entry::Vacant(entry) => {
                entry.insert(second);
            }
            Entry::Occupied(entry) => {
                count += 1;
                found.get_or_insert((*entry.get(), second));
            }
        }
    }
    let (first, second) = found?;
    Some(MeshDefect::Twice {
        first,
        second,
        at_m: corners(mesh, mesh.triangles[first])[0],
        count,
    })
}

/// How many triangles run along each edge, in either direction.
pub(super) struct EdgeCounts(Map<(u32, u32), [i32; 2]>);

impl EdgeCounts {
    pub(super) fn of(mesh: &TriangleMesh) -> Self {
        let mut counts: Map<(u32, u32), [i32; 2]> = map_for(mesh.triangles.len() * 3 / 2);
        for [a, b, c] in &mesh.triangles {
            for (from, to) in [(*a, *b), (*b, *c), (*c, *a)] {
                let way = usize::from(from > to);
                counts.entry((from.min(to), from.max(to))).or_default()[way] += 1;
            }
        }
        Self(counts)
    }

    /// Directed edges that lack an opposite, each as often as it does, in order.
    pub(super) fn unmatched(&self) -> Vec<(u32, u32)> {
        let mut edges: Vec<(u32, u32)> = self
            .0
            .iter()
            .flat_map(|(&(low, high), &[forth, back])| {
                let edge = if forth > back {
                    (low, high)
                } else {
                    (high, low)
                };
                std::iter::repeat_n(edge, forth.abs_diff(back) as usize)
            })
            .collect();
        edges.sort_unstable();
        edges
    }

    fn open(&self, mesh: &TriangleMesh) -> Option<MeshDefect> {
        let open = self.unmatched();
        // The first in the file, for whoever looks for it there.
        let [a, b] = mesh.triangles.iter().find_map(|&[a, b, c]| {
            [[a, b], [b, c], [c, a]]
                .into_iter()
                .find(|&[from, to]| open.binary_search(&(from, to)).is_ok())
        })?;
        let [a, b] = [a, b].map(|vertex| mesh.vertices_m[vertex as usize]);
        Some(MeshDefect::Open {
            edges: open.len(),
            at_m: nalgebra::center(&a, &b),
        })
    }

    fn shared(&self) -> usize {
        let uses = |counts: &&[i32; 2]| counts[0] + counts[1] > 2;
        self.0.values().filter(uses).count()
    }
}

/// The largest triangle of every part that shares no vertex with another, in order.
fn components(mesh: &TriangleMesh) -> Vec<usize> {
    let area = |&triangle: &usize| area_vector(corners(mesh, mesh.triangles[triangle])).norm();
    let mut largest: Vec<usize> = connected_parts(mesh)
        .iter()
        .filter_map(|part| {
            let by_area = |a: &&usize, b: &&usize| area(a).total_cmp(&area(b)).then(b.cmp(a));
            part.iter().max_by(by_area).copied()
        })
        .collect();
    largest.sort_unstable();
    largest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample_solids::{both, bowl, cuboid, ell, inverted, torus};

    const BOX: [f64; 3] = [0.03, 0.02, 0.01];

    #[test]
    fn cavities_outside_their_shell_are_dropped() {
        let shell = cuboid(BOX);
        let cavity = inverted(cuboid(BOX.map(|half| 0.2 * half)));
        let enclosed = both(&shell, &cavity, [0.0; 3]);
        assert_eq!(without_inverted_parts(&enclosed), enclosed);
        let mut outside = both(&cavity, &shell, [0.0; 3]);
        for vertex in &mut outside.vertices_m[..cavity.vertices_m.len()] {
            vertex.x += 0.1;
        }
        assert!(check_closed(&outside).is_err());
        assert_eq!(without_inverted_parts(&outside), shell);
    }

    #[test]
    fn closed_surfaces_are_sound() {
        for mesh in [cuboid(BOX), ell(), bowl(), torus(24, 12)] {
            let facts = check_closed(&mesh).unwrap();
            assert_eq!((facts.components, facts.shared_edges), (1, 0));
        }
        let volume = check_closed(&cuboid(BOX)).unwrap().volume_m3;
        assert!((volume / (8.0 * 0.03 * 0.02 * 0.01) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn two_parts_are_sound_and_so_is_a_cavity() {
        let apart = both(&cuboid(BOX), &cuboid(BOX), [0.1, 0.0, 0.0]);
        assert_eq!(check_closed(&apart).unwrap().components, 2);
        let hollow = both(
            &cuboid(BOX),
            &inverted(cuboid([0.01, 0.01, 0.005])),
            [0.0; 3],
        );
        let facts = check_closed(&hollow).unwrap();
        assert_eq!(facts.components, 2);
        assert!((facts.volume_m3 - 8.0 * (6e-6 - 0.5e-6)).abs() < 1e-15);
    }

    #[test]
    fn missing_triangle_leaves_three_open_edges() {
        let mut mesh = bowl();
        mesh.triangles.remove(40);
        let defect = check_closed(&mesh).unwrap_err();
        assert!(
            matches!(defect, MeshDefect::Open { edges: 3, .. }),
            "{defect}"
        );
    }

    #[test]
    fn inside_out_is_told_from_a_cavity() {
        let defect = check_closed(&inverted(ell())).unwrap_err();
        assert!(
            matches!(defect, MeshDefect::Inverted { count: 1, .. }),
            "{defect}"
        );
        let beside = both(&cuboid(BOX), &inverted(cuboid(BOX)), [0.1, 0.0, 0.0]);
        let Err(MeshDefect::Inverted { at_m, .. }) = check_closed(&beside) else {
            panic!("the second box is inside out");
        };
        assert!(at_m.x > 0.06, "it is the second box: {at_m}");
    }

    #[test]
    fn one_turned_triangle_opens_the_surface() {
        let mut mesh = ell();
        mesh.triangles[3].swap(0, 1);
        let defect = check_closed(&mesh).unwrap_err();
        assert!(
            matches!(defect, MeshDefect::Open { edges: 6, .. }),
            "{defect}"
        );
    }

    #[test]
    fn triangle_without_area_is_named() {
        let mut mesh = ell();
        mesh.triangles.insert(5, [0, 1, 1]);
        let defect = check_closed(&mesh).unwrap_err();
        assert!(matches!(
            defect,
            MeshDefect::NoArea {
                triangle: 5,
                count: 1,
                ..
            }
        ));
        // A point in the middle of an edge.
        let mut mesh = ell();
        mesh.vertices_m
            .push(nalgebra::center(&mesh.vertices_m[0], &mesh.vertices_m[1]));
        let middle = u32::try_from(mesh.vertices_m.len() - 1).unwrap();
        mesh.triangles.push([0, middle, 1]);
        let defect = check_closed(&mesh).unwrap_err();
        assert!(matches!(defect, MeshDefect::NoArea { .. }), "{defect}");
    }

    #[test]
    fn sliver_is_sound() {
        let mut mesh = cuboid(BOX);
        for vertex in &mut mesh.vertices_m {
            vertex.x *= 1e-7;
        }
        assert!(check_closed(&mesh).is_ok());
    }

    #[test]
    fn triangle_given_twice_is_named_with_its_twin() {
        let mut mesh = ell();
        mesh.triangles.push([
            mesh.triangles[2][1],
            mesh.triangles[2][2],
            mesh.triangles[2][0],
        ]);
        let last = mesh.triangles.len() - 1;
        let defect = check_closed(&mesh).unwrap_err();
        let named = matches!(defect, MeshDefect::Twice { first: 2, second, .. } if second == last);
        assert!(named, "{defect}");
    }

    #[test]
    fn edge_of_four_triangles_is_counted() {
        // Two boxes that share an edge.
        let mut mesh = both(&cuboid(BOX), &cuboid(BOX), [0.06, 0.04, 0.0]);
        crate::topology::weld(&mut mesh);
        let facts = check_closed(&mesh).unwrap();
        assert_eq!(facts.shared_edges, 1);
    }
}
