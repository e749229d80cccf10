//! Convex pieces of a solid, for engines that collide with nothing else.

use std::collections::HashSet;

use nalgebra::{Point3, Vector3};

use super::fidelity::points_on;
use super::hull::{convex_hull, simplified_hull};
use super::surface_index::SurfaceIndex;
use crate::measure::{area_m2, corners, size_m, volume_m3};
use crate::triangle_mesh::{ConvexMesh, TriangleMesh};

/// Most pieces of a solid.
const MOST_PIECES: usize = 16;

/// A piece is cut no further once no sample of its hull is further than this from the solid, m.
const GOOD_ENOUGH_M: f64 = 1e-3;

/// How far a point may be outside the hull of its piece, m: finely drawn surfaces have thousands of
/// points that make no difference to an engine but time.
const LEFT_OUT_M: f64 = 2e-5;

/// Samples of a piece's hull by which it is judged.
const HULL_SAMPLES: f64 = 1500.0;

/// Triangles of a piece by which cuts are judged, at most.
const CUT_TRIANGLES: usize = 400;

/// Samples of a half's hull by which a cut is judged.
const CUT_SAMPLES: f64 = 300.0;

/// Cuts that are tried along each direction.
const CUTS: u32 = 7;

/// Cuts that are looked at more closely.
const LOOKED_AT: usize = 8;

/// Mean distance between a solid and its hull below which it counts as convex, relative to its
/// size: coordinates in single precision are rounded by `6e-8` of theirs.
const CONVEX: f64 = 1e-7;

/// Convex pieces that together contain the solid within a closed surface.
///
/// The surface is cut by planes, and each piece is the hull of what lies between them, so that the
/// pieces leave nothing of the solid uncovered but some 0.02 mm by which hulls are simplified. Always the piece that reaches furthest beyond the
/// solid is cut next, where the hulls of its two halves have the least volume together; planes are
/// along the axes of the solid's box. Nothing is random.
pub fn decompose(solid: &SurfaceIndex) -> Vec<ConvexMesh> {
    let triangles: Vec<Triangle> = solid
        .mesh()
        .triangles
        .iter()
        .map(|&triangle| corners(solid.mesh(), triangle))
        .collect();
    let mut parts: Vec<Part> = Part::new(triangles, solid).into_iter().collect();
    while parts.len() < MOST_PIECES {
        let worst = parts
            .iter()
            .enumerate()
            .filter(|(_, part)| part.overhang_m > GOOD_ENOUGH_M)
            .max_by(|a, b| {
                a.1.overhang_m
                    .total_cmp(&b.1.overhang_m)
                    .then(b.0.cmp(&a.0))
            });
        let Some((index, part)) = worst else { break };
        match part.halves(solid) {
            Some([a, b]) => {
                parts[index] = a;
                parts.insert(index + 1, b);
            }
            None => parts[index].overhang_m = 0.0,
        }
    }
    parts.into_iter().map(|part| part.hull).collect()
}

/// The convex hull of a closed surface that is its own, within the rounding of an STL file.
pub(crate) fn as_convex(mesh: &TriangleMesh) -> Option<ConvexMesh> {
    let hull = convex_hull(&mesh.vertices_m).ok()?;
    let gap_m = (volume_m3(&hull.0) - volume_m3(mesh)) / area_m2(&hull.0);
    (gap_m <= CONVEX * size_m(mesh).norm()).then_some(hull)
}

type Triangle = [Point3<f64>; 3];

/// Points `p` with `normal . p = offset_m`.
#[derive(Clone, Copy)]
struct Plane {
    normal: Vector3<f64>,
    offset_m: f64,
}

impl Plane {
    fn height_m(&self, point: &Point3<f64>) -> f64 {
        self.normal.dot(&point.coords) - self.offset_m
    }

    fn turned(self) -> Self {
        Self {
            normal: -self.normal,
            offset_m: -self.offset_m,
        }
    }
}

/// Directions across which solids are cut: along the axes, and half way between two of them.
fn cut_normals() -> impl Iterator<Item = Vector3<f64>> {
    const ALONG: [[f64; 3]; 9] = [
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [1.0, 1.0, 0.0],
        [1.0, -1.0, 0.0],
        [1.0, 0.0, 1.0],
        [1.0, 0.0, -1.0],
        [0.0, 1.0, 1.0],
        [0.0, 1.0, -1.0],
    ];
    ALONG
        .into_iter()
        .map(|along| Vector3::from(along).normalize())
}

/// What of the surface lies between some planes.
struct Part {
    triangles: Vec<Triangle>,
    hull: ConvexMesh,
    /// Largest distance of a sample of the hull from the solid, m.
    overhang_m: f64,
    /// Point of the solid's surface that is nearest to that sample.
    below: Point3<f64>,
}

impl Part {
    /// None for a part without a volume.
    fn new(triangles: Vec<Triangle>, solid: &SurfaceIndex) -> Option<Self> {
        let hull = simplified_hull(&distinct(&triangles), LEFT_OUT_M).ok()?;
        let (overhang_m, below) = overhang(&hull, solid, HULL_SAMPLES);
        Some(Self {
            triangles,
            hull,
            overhang_m,
            below,
        })
    }

    /// The two halves on either side of the best plane that leaves two with a volume.
    fn halves(&self, solid: &SurfaceIndex) -> Option<[Self; 2]> {
        self.cuts_by_merit(solid).into_iter().find_map(|plane| {
            let half = |side: Plane| {
                let triangles = self
                    .triangles
                    .iter()
                    .flat_map(|triangle| {
                        let kept = clipped(triangle, side);
                        (2..kept.len()).map(move |k| [kept[0], kept[k - 1], kept[k]])
                    })
                    .collect();
                Self::new(triangles, solid)
            };
            Some([half(plane.turned())?, half(plane)?])
        })
    }

    /// Planes to cut along, the best first.
    fn cuts_by_merit(&self, solid: &SurfaceIndex) -> Vec<Plane> {
        let stride = self.triangles.len().div_ceil(CUT_TRIANGLES);
        let sample: Vec<&Triangle> = self.triangles.iter().step_by(stride).collect();
        let area = area_m2(&self.hull.0);
        // By volume first, and then by overhang too, which takes longer to find out.
        let mut ranked: Vec<(f64, Plane)> = self
            .cuts()
            .filter_map(|plane| {
                let halves = rough_halves(&sample, plane)?;
                let volume: f64 = halves.iter().map(|half| volume_m3(&half.0)).sum();
                Some((volume / area, plane))
            })
            .collect();
        ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
        ranked.truncate(LOOKED_AT);
        let through_the_worst = cut_normals().map(|normal| Plane {
            normal,
            offset_m: normal.dot(&self.below.coords),
        });
        let mut judged: Vec<(f64, Plane)> = ranked
            .into_iter()
            .map(|(_, plane)| plane)
            .chain(through_the_worst)
            .filter_map(|plane| {
                let halves = rough_halves(&sample, plane)?;
                let volume: f64 = halves.iter().map(|half| volume_m3(&half.0)).sum();
                let [a, b] = halves.map(|half| overhang(&half, solid, CUT_SAMPLES).0);
                let cost_m = a.max(b) + 0.5 * a.min(b) + 2.0 * volume / area;
                Some((cost_m, plane))
            })
            .collect();
        judged.sort_by(|a, b| a.0.total_cmp(&b.0));
        judged.into_iter().map(|(_, plane)| plane).collect()
    }

    /// Planes across the part, evenly spaced.
    fn cuts(&self) -> impl Iterator<Item = Plane> {
        cut_normals().flat_map(|normal| {
            let reach = |sign: f64| {
                let vertices = self.hull.0.vertices_m.iter();
                let reach = vertices.map(|v| sign * normal.dot(&v.coords));
                sign * reach.fold(f64::NEG_INFINITY, f64::max)
            };
            let (low, high) = (reach(-1.0), reach(1.0));
            (1..=CUTS).map(move |cut| Plane {
                normal,
                offset_m: low + (high - low) * f64::from(cut) / f64::from(CUTS + 1),
            })
        })
    }
}

/// Largest distance of a sample of a piece from the solid, m, and the solid's nearest point.
fn overhang(piece: &ConvexMesh, solid: &SurfaceIndex, samples: f64) -> (f64, Point3<f64>) {
    let spacing_m = (area_m2(&piece.0) / samples).sqrt();
    let mut worst = None;
    for point in points_on(&piece.0, spacing_m) {
        let nearest = solid.nearest(&point);
        let distance_m = (nearest - point).norm();
        // Whether it is inside takes longer to find out, and does not matter of most.
        let is_farther = worst.is_none_or(|(worst_m, _)| distance_m >= worst_m);
        if is_farther && !solid.contains(&point) {
            worst = Some((distance_m, nearest));
        }
    }
    worst.unwrap_or((0.0, Point3::origin()))
}

/// About the hulls of what lies on either side of a plane.
fn rough_halves(triangles: &[&Triangle], plane: Plane) -> Option<[ConvexMesh; 2]> {
    let half = |side: Plane| {
        let points: Vec<Point3<f64>> = triangles
            .iter()
            .flat_map(|triangle| clipped(triangle, side))
            .collect();
        rough_hull(&points)
    };
    Some([half(plane.turned())?, half(plane)?])
}

/// Corners of triangles, each once.
fn distinct(triangles: &[Triangle]) -> Vec<Point3<f64>> {
    let mut seen = HashSet::with_capacity(triangles.len());
    let corners = triangles.as_flattened().iter();
    corners
        .filter(|corner| seen.insert([corner.x, corner.y, corner.z].map(f64::to_bits)))
        .copied()
        .collect()
}

/// What of a triangle lies above a plane: corners of a convex polygon.
fn clipped(triangle: &Triangle, plane: Plane) -> Vec<Point3<f64>> {
    let mut kept = Vec::with_capacity(4);
    for k in 0..3 {
        let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
        let (over_a, over_b) = (plane.height_m(&a), plane.height_m(&b));
        if over_a >= 0.0 {
            kept.push(a);
        }
        if over_a > 0.0 && over_b < 0.0 || over_a < 0.0 && over_b > 0.0 {
            kept.push(a + (b - a) * (over_a / (over_a - over_b)));
        }
    }
    kept
}

/// About the hull of points: that of those which are furthest along some directions.
fn rough_hull(points: &[Point3<f64>]) -> Option<ConvexMesh> {
    let mut extreme: Vec<usize> = directions()
        .filter_map(|direction| {
            let reach = |i: &usize| direction.dot(&points[*i].coords);
            (0..points.len()).max_by(|i, j| reach(i).total_cmp(&reach(j)))
        })
        .collect();
    extreme.sort_unstable();
    extreme.dedup();
    let points: Vec<Point3<f64>> = extreme.into_iter().map(|i| points[i]).collect();
    simplified_hull(&points, LEFT_OUT_M).ok()
}

/// Directions spread evenly over the sphere (a Fibonacci lattice).
fn directions() -> impl Iterator<Item = Vector3<f64>> {
    const COUNT: u32 = 64;
    const GOLDEN_ANGLE_RAD: f64 = 2.399_963_229_728_653;
    (0..COUNT).map(|i| {
        let z = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(COUNT);
        let (sine, cosine) = libm::sincos(f64::from(i) * GOLDEN_ANGLE_RAD);
        let across = (1.0 - z * z).sqrt();
        Vector3::new(across * cosine, across * sine, z)
    })
}

#[cfg(test)]
mod tests {
    use super::super::fidelity::Fidelity;
    use super::*;
    use crate::sample_solids::{bowl, cuboid, ell, torus};

    /// What hulls leave out: within that of a face, and of those that replace it. 33 um is seen.
    const LEFT_OUT_AT_MOST_M: f64 = 3.0 * LEFT_OUT_M;

    /// Rounding of coordinates of a decimetre, through planes.
    const ROUNDING_M: f64 = 1e-12;

    fn fidelity(mesh: TriangleMesh) -> Fidelity {
        let solid = SurfaceIndex::new(mesh);
        let pieces = decompose(&solid);
        let found = Fidelity::measure(&solid, &pieces);
        println!("{found:?}");
        found
    }

    #[test]
    fn box_is_convex_and_its_own_piece() {
        let mesh = cuboid([0.03, 0.02, 0.01]);
        assert!(as_convex(&mesh).is_some());
        let found = fidelity(mesh);
        assert_eq!(found.pieces, 1);
        assert!(found.overhang_m < ROUNDING_M && found.uncovered_m < ROUNDING_M);
    }

    #[test]
    fn hollow_solids_are_not_convex() {
        for mesh in [ell(), bowl(), torus(24, 12)] {
            assert!(as_convex(&mesh).is_none());
        }
    }

    #[test]
    fn pieces_leave_nothing_uncovered_and_keep_close() {
        // The L falls into two boxes. The hull of the L is 37 mm from it in its corner, that of the bowl 40 mm.
        for (mesh, overhang_m) in [(ell(), 1e-6), (bowl(), 15e-3), (torus(48, 24), 7e-3)] {
            let found = fidelity(mesh);
            assert!(found.uncovered_m < LEFT_OUT_AT_MOST_M, "{found:?}");
            assert!(found.overhang_m < overhang_m, "{found:?}");
            assert!(found.mean_overhang_m < 0.1 * overhang_m, "{found:?}");
        }
    }

    #[test]
    fn pieces_are_the_same_every_time() {
        let solid = SurfaceIndex::new(bowl());
        assert_eq!(decompose(&solid), decompose(&solid));
    }
}
