//! Fidelity of convex pieces to a solid.

use nalgebra::Point3;
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
        let planes: Vec<Planes> = pieces.iter().map(Planes::of).collect();
        let (mut overhang_m, mut sum_m, mut count) = (0.0_f64, 0.0, 0_u32);
        for (i, piece) in pieces.iter().enumerate() {
            for point in points_on(&piece.0, spacing_m) {
                let hidden = planes
                    .iter()
                    .enumerate()
                    .any(|(j, other)| j != i && other.height_m(&point) < 0.0);
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
        let uncovered_m = points_on(solid.mesh(), spacing_m)
            .map(|point| {
                planes
                    .iter()
                    .map(|piece| piece.height_m(&point))
                    .fold(f64::INFINITY, f64::min)
            })
            .fold(0.0, f64::max);
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

/// Face planes of a convex piece.
struct Planes(Vec<(nalgebra::Vector3<f64>, f64)>);

impl Planes {
    fn of(piece: &ConvexMesh) -> Self {
        let planes = piece.0.triangles.iter().filter_map(|&triangle| {
            let at = corners(&piece.0, triangle);
            let normal = area_vector(at).try_normalize(0.0)?;
            Some((normal, normal.dot(&at[0].coords)))
        });
        Self(planes.collect())
    }

    /// Height of a point over the plane that it is highest over: its distance where it is outside,
    /// or a little less; negative inside.
    fn height_m(&self, point: &Point3<f64>) -> f64 {
        self.0
            .iter()
            .map(|(normal, offset)| normal.dot(&point.coords) - offset)
            .fold(f64::NEG_INFINITY, f64::max)
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
