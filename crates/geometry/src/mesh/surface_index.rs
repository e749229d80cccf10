//! Distance of points from a surface, and on which side of it they are.

use std::sync::{Arc, OnceLock};

use nalgebra::{Point3, UnitVector3};

use super::cache::tree_of;
use crate::tree::TriangleTree;
use crate::triangle_mesh::TriangleMesh;

/// A closed surface with what finds its nearest point, its inside and its crossings with lines, which is
/// made when it is first needed.
#[derive(Debug, Clone)]
pub struct SurfaceIndex {
    mesh: TriangleMesh,
    tree: OnceLock<Arc<TriangleTree>>,
}

impl PartialEq for SurfaceIndex {
    fn eq(&self, other: &Self) -> bool {
        self.mesh == other.mesh
    }
}

impl SurfaceIndex {
    /// Of a mesh with at least one triangle.
    pub fn new(mesh: TriangleMesh) -> Self {
        Self {
            mesh,
            tree: OnceLock::new(),
        }
    }

    /// The surface.
    pub fn mesh(&self) -> &TriangleMesh {
        &self.mesh
    }

    /// Its triangles in nested boxes.
    pub(crate) fn tree(&self) -> &Arc<TriangleTree> {
        self.tree.get_or_init(|| Arc::new(tree_of(&self.mesh)))
    }

    /// Whether a point is inside.
    pub fn contains(&self, point: &Point3<f64>) -> bool {
        self.tree().contains(point)
    }

    /// Distance from the surface, m; positive outside.
    pub fn signed_distance_m(&self, point: &Point3<f64>) -> f64 {
        let distance_m = self.distance_m(point);
        if self.contains(point) {
            -distance_m
        } else {
            distance_m
        }
    }

    /// Distance from the surface on either side, m.
    pub fn distance_m(&self, point: &Point3<f64>) -> f64 {
        (self.nearest(point) - point).norm()
    }

    /// The point of the surface that is nearest to a point.
    pub fn nearest(&self, point: &Point3<f64>) -> Point3<f64> {
        self.tree().nearest(point)
    }

    /// Where a line runs inside: the distances `s` in m of `origin + s * direction`, in order.
    pub fn clip_line(&self, origin: &Point3<f64>, direction: &UnitVector3<f64>) -> Vec<(f64, f64)> {
        self.tree().clip_line(origin, direction)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitVector3, Vector3};

    use super::*;
    use crate::sample_solids::{random_points, torus};

    /// Rounding of metres.
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
            let nearest_m = super::super::fidelity::points_on(&mesh, 5e-4)
                .map(|sample| (sample - point).norm())
                .fold(f64::INFINITY, f64::min);
            let distance_m = index.distance_m(&point);
            assert!(distance_m <= nearest_m + ROUNDING_M);
            assert!(nearest_m - distance_m < 5e-4, "{nearest_m} {distance_m}");
        }
    }
}
