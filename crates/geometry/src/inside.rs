//! Which points are in a solid.

use nalgebra::Point3;

use crate::shape::{Shape, Solid};

impl Solid {
    /// Whether a point of the parent frame lies in the solid, its surface
    /// included.
    pub fn contains(&self, point: &Point3<f64>) -> bool {
        let local = self.parent_from_shape.inverse() * point;
        match &self.shape {
            Shape::Sphere { radius_m } => local.coords.norm() <= *radius_m,
            Shape::Cylinder {
                radius_m,
                half_length_m,
            } => local.z.abs() <= *half_length_m && libm::hypot(local.x, local.y) <= *radius_m,
            Shape::Capsule {
                radius_m,
                half_length_m,
            } => {
                let on_axis = local.z.clamp(-half_length_m, *half_length_m);
                (local - Point3::new(0.0, 0.0, on_axis)).norm() <= *radius_m
            }
            Shape::Cuboid { half_extents_m } => {
                (0..3).all(|axis| local[axis].abs() <= half_extents_m[axis])
            }
            Shape::Convex(mesh) => mesh.0.triangles.iter().all(|triangle| {
                let [a, b, c] = triangle.map(|i| mesh.0.vertices_m[i as usize]);
                (b - a).cross(&(c - a)).dot(&(local - a)) <= 0.0
            }),
            Shape::Mesh(mesh) => mesh.surface().winding_number(&local) != 0,
        }
    }
}
