//! Lengths, areas and volumes of triangle meshes.

use nalgebra::{Point3, Vector3};
use parry3d_f64::mass_properties::details::trimesh_signed_volume_and_center_of_mass;
use parry3d_f64::math::Vector;

use crate::parry;
use crate::triangle_mesh::TriangleMesh;

/// Corners of a triangle.
pub fn corners(mesh: &TriangleMesh, triangle: [u32; 3]) -> [Point3<f64>; 3] {
    triangle.map(|vertex| mesh.vertices_m[vertex as usize])
}

/// Twice the area times the outward normal.
pub(crate) fn area_vector([a, b, c]: [Point3<f64>; 3]) -> Vector3<f64> {
    (b - a).cross(&(c - a))
}

/// Area of a surface, m^2.
pub fn area_m2(mesh: &TriangleMesh) -> f64 {
    let doubled: f64 = mesh
        .triangles
        .iter()
        .map(|&triangle| area_vector(corners(mesh, triangle)).norm())
        .sum();
    0.5 * doubled
}

/// Signed volume within a closed surface, m^3: negative where the surface is inside out.
pub fn volume_m3(mesh: &TriangleMesh) -> f64 {
    volume_and_centroid(mesh).0
}

/// Centroid of the volume within a closed surface.
pub fn centroid_m(mesh: &TriangleMesh) -> Point3<f64> {
    volume_and_centroid(mesh).1
}

/// parry's: within 3e-14 of the closed forms of solids of decimetres.
fn volume_and_centroid(mesh: &TriangleMesh) -> (f64, Point3<f64>) {
    if mesh.vertices_m.is_empty() {
        return (0.0, Point3::origin());
    }
    let (volume_m3, Vector { x, y, z }) =
        trimesh_signed_volume_and_center_of_mass(&parry::vertices(mesh), &mesh.triangles);
    (volume_m3, Point3::new(x, y, z))
}

/// Lowest and highest coordinate of a mesh along each axis, m.
pub fn extent_m(mesh: &TriangleMesh) -> [Point3<f64>; 2] {
    let start = [
        Point3::from(Vector3::repeat(f64::INFINITY)),
        Point3::from(Vector3::repeat(f64::NEG_INFINITY)),
    ];
    mesh.vertices_m.iter().fold(start, |[low, high], vertex| {
        [low.inf(vertex), high.sup(vertex)]
    })
}

/// Edges of the box around a mesh, m.
pub fn size_m(mesh: &TriangleMesh) -> Vector3<f64> {
    let [low, high] = extent_m(mesh);
    high - low
}
