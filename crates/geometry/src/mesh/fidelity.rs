//! Fidelity of convex pieces to a solid.

use std::ops::Range;

use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};

use super::surface_index::SurfaceIndex;
use crate::measure::{area_m2, area_vector, corners};
use crate::triangle_mesh::{ConvexMesh, TriangleMesh};

/// Samples over all pieces, and over the surface, about.
const SAMPLES: f64 = 20_000.0;

/// How far convex pieces are from their solid; measured on samples.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Fidelity {
    /// Convex pieces.
    pub pieces: usize,
    /// Largest distance from the solid of a point of a piece, m.
    pub overhang_m: f64,
    /// Mean of that distance over the pieces' outer surface, m.
    pub mean_overhang_m: f64,
    /// Largest distance from the pieces of a point of the solid's surface, m.
    pub uncovered_m: f64,
    /// Distance between neighbouring samples on either surface, m.
    pub spacing_m: f64,
}

impl Fidelity {
    /// Measures `pieces` against the solid.
    pub fn measure(solid: &SurfaceIndex, pieces: &[ConvexMesh]) -> Self {
        let area: f64 = area_m2(solid.mesh());
        let spacing_m = (area / SAMPLES).sqrt();
        let planes: Vec<PlaneTree> = pieces.iter().map(PlaneTree::of).collect();
        let (mut overhang_m, mut sum_m, mut count) = (0.0_f64, 0.0, 0_u32);
        for (i, piece) in pieces.iter().enumerate() {
            for point in points_on(&piece.0, spacing_m) {
                let hidden = planes
                    .iter()
                    .enumerate()
                    .any(|(j, other)| j != i && other.holds(&point));
                if hidden {
                    continue;
                }
                count += 1;
                if !solid.contains(&point) {
                    let out_m = solid.distance_m(&point);
                    overhang_m = overhang_m.max(out_m);
                    sum_m += out_m;
                }
            }
        }
        let mut uncovered_m = 0.0;
        // The piece that holds a point holds most of its neighbours.
        let mut order: Vec<usize> = (0..planes.len()).collect();
        for point in points_on(solid.mesh(), spacing_m) {
            let mut nearest_m = f64::INFINITY;
            for at in 0..order.len() {
                let piece = &planes[order[at]];
                nearest_m = nearest_m.min(piece.height_within(&point, uncovered_m, nearest_m));
                if nearest_m <= uncovered_m {
                    order.swap(0, at);
                    break;
                }
            }
            uncovered_m = nearest_m.max(uncovered_m);
        }
        Self {
            pieces: pieces.len(),
            overhang_m,
            mean_overhang_m: sum_m / f64::from(count.max(1)),
            uncovered_m,
            spacing_m,
        }
    }
}

impl Fidelity {
    /// For notes.
    pub fn in_words(&self) -> String {
        format!(
            "in the engines it consists of {} convex pieces, which reach up to {:.2} mm beyond its \
             surface (mean {:.2} mm) and leave up to {:.4} mm of it uncovered (samples every \
             {:.1} mm)",
            self.pieces,
            self.overhang_m * 1e3,
            self.mean_overhang_m * 1e3,
            self.uncovered_m * 1e3,
            self.spacing_m * 1e3
        )
    }
}

/// Face planes of a convex piece, those of like normals together.
struct PlaneTree {
    planes: Vec<Plane>,
    /// A binary tree: each node is followed by all that are below it.
    nodes: Vec<Node>,
    /// The middle of the vertices.
    centre: Point3<f64>,
    /// Largest coordinate, which rounding is relative to, m.
    reach_m: f64,
}

#[derive(Clone, Copy)]
struct Plane {
    normal: Vector3<f64>,
    offset_m: f64,
}

impl Plane {
    fn height_m(&self, point: &Point3<f64>) -> f64 {
        self.normal.dot(&point.coords) - self.offset_m
    }
}

/// Some planes, and what bounds the height of a point over all of them.
struct Node {
    planes: Range<usize>,
    /// The node that comes after all that are below this one.
    after: usize,
    /// A point in one of the planes, beside the piece's middle.
    on: Point3<f64>,
    /// The middle of the normals, and how far they are from it.
    normal: Vector3<f64>,
    spread: f64,
    /// Height of the point over any of the planes at most, m.
    above_m: f64,
}

impl PlaneTree {
    fn of(piece: &ConvexMesh) -> Self {
        let planes = piece.0.triangles.iter().filter_map(|&triangle| {
            let at = corners(&piece.0, triangle);
            let normal = area_vector(at).try_normalize(0.0)?;
            let offset_m = normal.dot(&at[0].coords);
            Some(Plane { normal, offset_m })
        });
        let vertices = &piece.0.vertices_m;
        let middle = vertices
            .iter()
            .map(|vertex| vertex.coords)
            .sum::<Vector3<f64>>()
            / vertices.len() as f64;
        let coordinates = piece.0.vertices_m.iter().map(|vertex| vertex.coords.amax());
        let mut tree = Self {
            planes: planes.collect(),
            nodes: Vec::new(),
            centre: Point3::from(middle),
            reach_m: coordinates.fold(0.0, f64::max),
        };
        tree.divide(0..tree.planes.len());
        tree
    }

    fn divide(&mut self, range: Range<usize>) {
        /// Planes that are asked one by one.
        const FEW: usize = 8;
        let planes = &mut self.planes[range.clone()];
        let Some(first) = planes.first() else {
            return;
        };
        let on = self.centre - first.normal * first.height_m(&self.centre);
        let (low, high) = planes
            .iter()
            .fold((first.normal, first.normal), |(low, high), plane| {
                (low.inf(&plane.normal), high.sup(&plane.normal))
            });
        let normal = (low + high) * 0.5;
        let spreads = planes.iter().map(|plane| (plane.normal - normal).norm());
        let heights_m = planes.iter().map(|plane| plane.height_m(&on));
        let node = self.nodes.len();
        self.nodes.push(Node {
            planes: range.clone(),
            after: 0,
            on,
            normal,
            spread: spreads.fold(0.0, f64::max),
            above_m: heights_m.fold(f64::NEG_INFINITY, f64::max),
        });
        if planes.len() > FEW && low != high {
            let axis = (high - low).imax();
            let middle = planes.len() / 2;
            planes.select_nth_unstable_by(middle, |a, b| a.normal[axis].total_cmp(&b.normal[axis]));
            let middle = range.start + middle;
            self.divide(range.start..middle);
            self.divide(middle..range.end);
        }
        self.nodes[node].after = self.nodes.len();
    }

    /// Height of a point over the plane that it is highest over: its distance where it is outside, or a little less;
    /// negative inside. `low_m` if it is no higher; where it is as high as `high_m`, anything from there to it.
    fn height_within(&self, point: &Point3<f64>, low_m: f64, high_m: f64) -> f64 {
        /// Rounding of heights, of coordinates.
        const ROUNDING: f64 = 1e-13;
        let rounding_m = ROUNDING * (self.reach_m + point.coords.amax());
        let mut highest_m = low_m;
        let mut at = 0;
        while let Some(node) = self.nodes.get(at) {
            let from = point - node.on;
            let bound_m = node.normal.dot(&from) + node.spread * from.norm() + node.above_m;
            if bound_m + rounding_m <= highest_m {
                at = node.after;
                continue;
            }
            at += 1;
            if at == node.after {
                for plane in &self.planes[node.planes.clone()] {
                    highest_m = highest_m.max(plane.height_m(point));
                }
                if highest_m >= high_m {
                    break;
                }
            }
        }
        highest_m
    }

    /// Whether a point is inside.
    fn holds(&self, point: &Point3<f64>) -> bool {
        self.height_within(point, -f64::MIN_POSITIVE, 0.0) < 0.0
    }
}

/// Points spread evenly over a surface, about `spacing_m` apart: one at least on every triangle
/// that is as large as their share, and as many more as its area asks for. The vertices come too.
pub fn points_on(mesh: &TriangleMesh, spacing_m: f64) -> impl Iterator<Item = Point3<f64>> {
    let share = spacing_m * spacing_m;
    let mut owed = 0.0_f64;
    let mut number = 0.0_f64;
    let within = mesh.triangles.iter().flat_map(move |&triangle| {
        let [a, b, c] = corners(mesh, triangle);
        owed += 0.5 * area_vector([a, b, c]).norm() / share;
        let mut points = Vec::new();
        while owed >= 1.0 {
            owed -= 1.0;
            number += 1.0;
            // Roberts' R2 sequence: even in the square, folded into the triangle.
            let (u, v) = (
                (number * 0.754_877_666_246_692_7).fract(),
                (number * 0.569_840_290_998_053_3).fract(),
            );
            let (u, v) = if u + v > 1.0 {
                (1.0 - u, 1.0 - v)
            } else {
                (u, v)
            };
            points.push(a + (b - a) * u + (c - a) * v);
        }
        points
    });
    mesh.vertices_m.iter().copied().chain(within)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::convex_hull;
    use crate::sample_solids::{ellipsoid, random_points, torus};

    /// Few planes are asked of each point; it has to be as if all were.
    #[test]
    fn the_height_over_a_piece_is_the_greatest_over_its_planes() {
        for mesh in [
            ellipsoid(40, 60, Vector3::new(0.3, 0.02, 0.1)),
            torus(48, 24),
        ] {
            let piece = convex_hull(&mesh.vertices_m).unwrap();
            let planes = PlaneTree::of(&piece);
            let points = random_points(&mesh, 300);
            let (mut outside, mut inside) = (0, 0);
            for point in points.iter().chain(&mesh.vertices_m) {
                let heights_m = planes.planes.iter().map(|plane| plane.height_m(point));
                let highest_m = heights_m.fold(f64::NEG_INFINITY, f64::max);
                let found_m = planes.height_within(point, f64::NEG_INFINITY, f64::INFINITY);
                assert_eq!(found_m, highest_m);
                assert_eq!(planes.holds(point), highest_m < 0.0);
                for low_m in [-1e-2, 0.0, 1e-5] {
                    let found_m = planes.height_within(point, low_m, f64::INFINITY);
                    assert_eq!(found_m, highest_m.max(low_m));
                }
                if highest_m > 0.0 {
                    outside += 1;
                } else {
                    inside += 1;
                }
            }
            assert!(outside > 100 && inside > 10, "{outside} {inside}");
        }
    }
}
