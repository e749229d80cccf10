//! Triangle meshes: reading, checking and mending them, and the convex pieces that engines need.

mod cache;
mod check;
mod decompose;
mod fidelity;
mod hull;
mod mend;
mod near;
mod solid;
mod stl;
#[cfg(test)]
pub(crate) mod test_meshes;
mod winding;

pub(crate) use check::{MeshDefect, check_closed};
use decompose::{decompose, is_convex};
pub(crate) use fidelity::{Fidelity, points_on};
pub use hull::convex_hull;
use mend::mend;
pub(crate) use near::SurfaceIndex;
pub(crate) use solid::{Use, shape_of_link, shape_of_surface};
pub(crate) use stl::read_stl;

use nalgebra::{Point3, Vector3};

use crate::shape::TriangleMesh;

/// Corners of a triangle.
pub(crate) fn corners(mesh: &TriangleMesh, triangle: [u32; 3]) -> [Point3<f64>; 3] {
    triangle.map(|vertex| mesh.vertices_m[vertex as usize])
}

/// Twice the area times the outward normal.
fn area_vector([a, b, c]: [Point3<f64>; 3]) -> Vector3<f64> {
    (b - a).cross(&(c - a))
}

/// Area of a surface, m^2.
pub(crate) fn area_m2(mesh: &TriangleMesh) -> f64 {
    let doubled: f64 = mesh
        .triangles
        .iter()
        .map(|&triangle| area_vector(corners(mesh, triangle)).norm())
        .sum();
    0.5 * doubled
}

/// Signed volume within a closed surface, m^3: negative where the surface is inside out.
pub(crate) fn volume_m3(mesh: &TriangleMesh) -> f64 {
    let Some(origin) = mesh.vertices_m.first() else {
        return 0.0;
    };
    let six_fold: f64 = mesh
        .triangles
        .iter()
        .map(|&triangle| {
            let [a, b, c] = corners(mesh, triangle).map(|corner| corner - origin);
            a.dot(&b.cross(&c))
        })
        .sum();
    six_fold / 6.0
}

/// Centroid of the volume within a closed surface.
pub(crate) fn centroid_m(mesh: &TriangleMesh) -> Point3<f64> {
    let Some(origin) = mesh.vertices_m.first() else {
        return Point3::origin();
    };
    let (mut moment, mut volume) = (Vector3::zeros(), 0.0);
    for &triangle in &mesh.triangles {
        let [a, b, c] = corners(mesh, triangle).map(|corner| corner - origin);
        let part = a.dot(&b.cross(&c));
        moment += (a + b + c) * part;
        volume += part;
    }
    origin + moment / (4.0 * volume)
}

/// Lowest and highest coordinate of a mesh along each axis, m.
pub(crate) fn extent_m(mesh: &TriangleMesh) -> [Point3<f64>; 2] {
    let start = [
        Point3::from(Vector3::repeat(f64::INFINITY)),
        Point3::from(Vector3::repeat(f64::NEG_INFINITY)),
    ];
    mesh.vertices_m.iter().fold(start, |[low, high], vertex| {
        [low.inf(vertex), high.sup(vertex)]
    })
}

/// Edges of the box around a mesh, m.
pub(crate) fn size_m(mesh: &TriangleMesh) -> Vector3<f64> {
    let [low, high] = extent_m(mesh);
    high - low
}
