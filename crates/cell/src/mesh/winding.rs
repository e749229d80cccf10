//! Which points are inside a closed surface: whole winding numbers by counted crossings.

use nalgebra::Point3;

use super::{corners, extent_m};
use crate::shape::TriangleMesh;

/// Cells of the grid per triangle, and at most this many along an axis.
const CELLS_PER_TRIANGLE: f64 = 0.5;
const MOST_CELLS: f64 = 1024.0;

/// Triangles by where rays along x meet them.
///
/// The ray from a point towards +x leaves the solid once more than it enters it exactly if the
/// point is inside. Every edge is judged the same way for both of its triangles, so that a ray
/// never slips through between them or counts both; the count is a whole number for every closed
/// surface, and is exact but for points within rounding of the surface.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Winding {
    low: [f64; 2],
    per_m: [f64; 2],
    cells: [usize; 2],
    /// Where each cell's triangles start in `triangles`.
    starts: Vec<u32>,
    triangles: Vec<u32>,
}

impl Winding {
    pub(super) fn new(mesh: &TriangleMesh) -> Self {
        let [low, high] = extent_m(mesh);
        let wanted = (CELLS_PER_TRIANGLE * mesh.triangles.len() as f64)
            .sqrt()
            .ceil()
            .clamp(1.0, MOST_CELLS);
        let size = [high.y - low.y, high.z - low.z];
        let mut index = Self {
            low: [low.y, low.z],
            per_m: size.map(|size| if size > 0.0 { wanted / size } else { 0.0 }),
            cells: [whole(wanted); 2],
            starts: Vec::new(),
            triangles: Vec::new(),
        };
        let covered = |triangle: [u32; 3]| {
            let [a, b, c] = corners(mesh, triangle);
            let range = |axis: usize| {
                let ends = [a[axis + 1], b[axis + 1], c[axis + 1]];
                let cell = |value: f64| index.cell(axis, value);
                let low = ends.iter().copied().fold(f64::INFINITY, f64::min);
                let high = ends.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                cell(low)..=cell(high)
            };
            let columns = range(1);
            range(0).flat_map(move |row| columns.clone().map(move |column| (row, column)))
        };
        let mut counts = vec![0_u32; index.cells[0] * index.cells[1] + 1];
        for &triangle in &mesh.triangles {
            for (row, column) in covered(triangle) {
                counts[row * index.cells[1] + column + 1] += 1;
            }
        }
        for i in 1..counts.len() {
            counts[i] += counts[i - 1];
        }
        let total = counts.last().copied().unwrap_or(0);
        let mut filled = counts.clone();
        let mut triangles = vec![0; total as usize];
        for (number, &triangle) in (0_u32..).zip(&mesh.triangles) {
            for (row, column) in covered(triangle) {
                let next = &mut filled[row * index.cells[1] + column];
                triangles[*next as usize] = number;
                *next += 1;
            }
        }
        index.starts = counts;
        index.triangles = triangles;
        index
    }

    fn cell(&self, axis: usize, value: f64) -> usize {
        let last = self.cells[axis] - 1;
        whole((value - self.low[axis]) * self.per_m[axis]).min(last)
    }

    /// How often the surface winds about a point.
    pub(super) fn at(&self, mesh: &TriangleMesh, point: &Point3<f64>) -> i32 {
        let cell = self.cell(0, point.y) * self.cells[1] + self.cell(1, point.z);
        let range = self.starts[cell] as usize..self.starts[cell + 1] as usize;
        self.triangles[range]
            .iter()
            .map(|&triangle| crossing(mesh, mesh.triangles[triangle as usize], point))
            .sum()
    }
}

/// Not negative, without its fraction.
fn whole(value: f64) -> usize {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a cast of a negative number or NaN is 0, which is meant"
    )]
    let whole = value as usize;
    whole
}

/// 1 where the ray from `point` towards +x leaves through the triangle, -1 where it enters.
fn crossing(mesh: &TriangleMesh, triangle: [u32; 3], point: &Point3<f64>) -> i32 {
    let [a, b, c] = triangle;
    let seen = |vertex: u32| {
        let v = mesh.vertices_m[vertex as usize] - point;
        [v.y, v.z]
    };
    let sides = [side(b, c, seen), side(c, a, seen), side(a, b, seen)];
    if sides[0].1 != sides[1].1 || sides[1].1 != sides[2].1 {
        return 0;
    }
    let total: f64 = sides.iter().map(|side| side.0).sum();
    if total == 0.0 {
        return 0;
    }
    let corners = corners(mesh, triangle);
    let x = (0..3).map(|k| sides[k].0 * corners[k].x).sum::<f64>() / total;
    match (x > point.x, sides[0].1) {
        (false, _) => 0,
        (true, true) => 1,
        (true, false) => -1,
    }
}

/// On which side of an edge a ray passes: twice the area, and the verdict, which is opposite for the
/// opposite edge even where the area is zero. `seen` gives vertices relative to the ray, seen along
/// it.
pub(super) fn side(from: u32, to: u32, seen: impl Fn(u32) -> [f64; 2]) -> (f64, bool) {
    let [u, v] = [from.min(to), from.max(to)].map(seen);
    let area = u[0] * v[1] - u[1] * v[0];
    if from < to {
        (area, area >= 0.0)
    } else {
        (-area, area < 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_meshes::{bowl, random_points, torus};
    use super::*;

    #[test]
    fn winding_is_that_of_the_solid_angles() {
        for mesh in [bowl(), torus(24, 16)] {
            let winding = Winding::new(&mesh);
            let mut inside = 0;
            for point in random_points(&mesh, 2000) {
                let exact = winding.at(&mesh, &point);
                // The sum of solid angles is a whole number but for rounding.
                assert!((mesh.winding_number(&point) - f64::from(exact)).abs() < 1e-6);
                inside += exact;
            }
            assert!(inside > 100, "the points tell something: {inside}");
        }
    }
}
