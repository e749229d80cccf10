//! Distance of points from a surface, and on which side of it they are.

use nalgebra::{Point3, UnitVector3};
use parry3d_f64::math::Vector;
use parry3d_f64::query::PointQuery;
use parry3d_f64::shape::TriMesh;

use super::corners;
use super::winding::{Winding, side};
use crate::shape::TriangleMesh;

/// parry's tolerances are absolute, and meant for numbers of order one: it works in millimetres.
const PER_M: f64 = 1e3;

/// A closed surface with what finds its nearest point, its inside and its crossings with lines.
#[derive(Clone)]
pub(crate) struct SurfaceIndex {
    mesh: TriangleMesh,
    winding: Winding,
    tree: TriMesh,
}

impl PartialEq for SurfaceIndex {
    fn eq(&self, other: &Self) -> bool {
        // All else follows from the mesh.
        self.mesh == other.mesh
    }
}

impl std::fmt::Debug for SurfaceIndex {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.mesh.fmt(formatter)
    }
}

impl SurfaceIndex {
    /// Of a mesh with at least one triangle.
    pub(crate) fn new(mesh: TriangleMesh) -> Self {
        let vertices = mesh.vertices_m.iter().map(millimetres).collect();
        Self {
            winding: Winding::new(&mesh),
            tree: TriMesh::new(vertices, mesh.triangles.clone())
                .expect("a checked mesh has triangles"),
            mesh,
        }
    }

    /// The surface.
    pub(crate) fn mesh(&self) -> &TriangleMesh {
        &self.mesh
    }

    /// The surface, given back.
    pub(crate) fn into_mesh(self) -> TriangleMesh {
        self.mesh
    }

    /// Whether a point is inside.
    pub(crate) fn contains(&self, point: &Point3<f64>) -> bool {
        self.winding.at(&self.mesh, point) > 0
    }

    /// Distance from the surface, m; positive outside.
    pub(crate) fn signed_distance_m(&self, point: &Point3<f64>) -> f64 {
        let distance_m = self.distance_m(point);
        if self.contains(point) {
            -distance_m
        } else {
            distance_m
        }
    }

    /// Distance from the surface on either side, m.
    pub(crate) fn distance_m(&self, point: &Point3<f64>) -> f64 {
        (self.nearest(point) - point).norm()
    }

    /// The point of the surface that is nearest to a point.
    pub(crate) fn nearest(&self, point: &Point3<f64>) -> Point3<f64> {
        let found = self.tree.project_local_point(millimetres(point), false);
        let Vector { x, y, z } = found.point / PER_M;
        Point3::new(x, y, z)
    }

    /// Where a line runs inside: the distances `s` in m of `origin + s * direction`, in order.
    pub(crate) fn clip_line(
        &self,
        origin: &Point3<f64>,
        direction: &UnitVector3<f64>,
    ) -> Vec<(f64, f64)> {
        // Seen along the line every edge has a side; as for rays along x.
        let (first, second) = across(direction);
        let mut crossings: Vec<(f64, i32)> = Vec::new();
        for &triangle in &self.mesh.triangles {
            let side = |from: u32, to: u32| {
                side(from, to, |vertex| {
                    let v = self.mesh.vertices_m[vertex as usize] - origin;
                    [v.dot(&first), v.dot(&second)]
                })
            };
            let [a, b, c] = triangle;
            let sides = [side(b, c), side(c, a), side(a, b)];
            let total: f64 = sides.iter().map(|side| side.0).sum();
            if sides[0].1 != sides[1].1 || sides[1].1 != sides[2].1 || total == 0.0 {
                continue;
            }
            let at = corners(&self.mesh, triangle);
            let s_m = (0..3)
                .map(|k| sides[k].0 * (at[k] - origin).dot(direction))
                .sum::<f64>()
                / total;
            // Counter-clockwise seen against the line: it leaves.
            crossings.push((s_m, if sides[0].1 { -1 } else { 1 }));
        }
        crossings.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        let (mut depth, mut entered_m) = (0, 0.0);
        let mut inside = Vec::new();
        for (s_m, step) in crossings {
            if depth == 0 && step > 0 {
                entered_m = s_m;
            }
            depth += step;
            if depth == 0 && step < 0 && s_m > entered_m {
                inside.push((entered_m, s_m));
            }
        }
        inside
    }
}

fn millimetres(point: &Point3<f64>) -> Vector {
    Vector::new(point.x, point.y, point.z) * PER_M
}

/// Two directions across a direction; the three are right-handed.
fn across(direction: &UnitVector3<f64>) -> (nalgebra::Vector3<f64>, nalgebra::Vector3<f64>) {
    let helper = if direction.x.abs() < 0.6 {
        nalgebra::Vector3::x()
    } else {
        nalgebra::Vector3::y()
    };
    let first = helper.cross(direction).normalize();
    (first, direction.cross(&first))
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitVector3, Vector3};

    use super::super::test_meshes::{random_points, torus};
    use super::*;

    /// Rounding of metres, twice through millimetres.
    const ROUNDING_M: f64 = 1e-14;

    #[test]
    fn line_through_a_ring_is_inside_twice() {
        let ring = SurfaceIndex::new(torus(64, 32));
        let along = UnitVector3::new_normalize(Vector3::new(1.0, 1e-3, 2e-3));
        let inside = ring.clip_line(&Point3::origin(), &along);
        assert_eq!(inside.len(), 2);
        for (enters_m, leaves_m) in inside {
            for s_m in [enters_m, leaves_m] {
                let point = Point3::from(along.into_inner() * s_m);
                assert!(ring.distance_m(&point) < ROUNDING_M);
            }
            let middle = Point3::from(along.into_inner() * (0.5 * (enters_m + leaves_m)));
            assert!(ring.contains(&middle));
        }
    }

    #[test]
    fn distance_is_that_of_the_nearest_triangle() {
        let mesh = torus(24, 16);
        let index = SurfaceIndex::new(mesh.clone());
        for point in random_points(&mesh, 100) {
            // Every point of the surface is at least as far; sampled densely, hardly further.
            let nearest_m = super::super::points_on(&mesh, 5e-4)
                .map(|sample| (sample - point).norm())
                .fold(f64::INFINITY, f64::min);
            let distance_m = index.distance_m(&point);
            assert!(distance_m <= nearest_m + ROUNDING_M);
            assert!(nearest_m - distance_m < 5e-4, "{nearest_m} {distance_m}");
        }
    }
}
