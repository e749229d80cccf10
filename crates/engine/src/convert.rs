//! Our geometry and mass properties as rapier's, and back: units and conventions.

use nalgebra::{Rotation3, UnitQuaternion, UnitVector3, Vector3};
use needlebench_geometry::{Shape, Solid, TriangleMesh};
use needlebench_kinematics::{Body, Pose};
use rapier3d_f64::geometry::SharedShape;
use rapier3d_f64::math::{self, Rotation, Vector};
use rapier3d_f64::parry::mass_properties::MassProperties;

use crate::EngineError;
use crate::pieces::convex_pieces;

/// rapier's world is in units of `1/1024` m: nearly a millimetre, and scaling is free of rounding.
///
/// The tolerances of rapier's collision detection are absolute. In metres the normal of a contact
/// that penetrates by 1 um was off by 0.01 rad, which moved a pressed tip by 80 um.
pub(crate) const UNITS_PER_M: f64 = 1024.0;

/// A length, speed or acceleration per metre, in rapier's units.
pub(crate) fn vector(v: &Vector3<f64>) -> Vector {
    Vector::new(v.x, v.y, v.z) * UNITS_PER_M
}

/// A pose, in rapier's units.
pub(crate) fn pose(pose: &Pose) -> math::Pose {
    let mut scaled = *pose;
    scaled.translation.vector *= UNITS_PER_M;
    scaled.into()
}

/// A pose from rapier, in metres.
pub(crate) fn pose_m(pose: &math::Pose) -> Pose {
    let mut scaled: Pose = (*pose).into();
    scaled.translation.vector /= UNITS_PER_M;
    scaled
}

/// A solid's shapes in rapier's units, with their pose in the parent frame in metres: one, but for a
/// mesh its convex pieces.
pub(crate) fn collider_shapes(solid: &Solid) -> Result<Vec<(SharedShape, Pose)>, EngineError> {
    let pieces = match &solid.shape {
        Shape::Mesh(mesh) => convex_pieces(solid, mesh)?,
        _ => return Ok(vec![collider_shape(solid)?]),
    };
    pieces
        .iter()
        .map(|piece| {
            // Its faces are known to be right; parry's hulls of points from a cut are not always.
            let points = points_of(&piece.0);
            let shape = SharedShape::convex_mesh(points, &piece.0.triangles)
                .ok_or_else(|| no_volume(solid))?;
            Ok((shape, solid.parent_from_shape))
        })
        .collect()
}

fn collider_shape(solid: &Solid) -> Result<(SharedShape, Pose), EngineError> {
    // rapier's cylinders stand on y, ours on z.
    let y_to_z = || {
        Pose::from_parts(
            nalgebra::Translation3::identity(),
            UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::FRAC_PI_2),
        )
    };
    let scaled = |length_m: &f64| length_m * UNITS_PER_M;
    let (shape, shape_from_rapier) = match &solid.shape {
        Shape::Sphere { radius_m } => (SharedShape::ball(scaled(radius_m)), Pose::identity()),
        Shape::Cylinder {
            radius_m,
            half_length_m,
        } => (
            SharedShape::cylinder(scaled(half_length_m), scaled(radius_m)),
            y_to_z(),
        ),
        Shape::Capsule {
            radius_m,
            half_length_m,
        } => {
            let shape = SharedShape::capsule_z(scaled(half_length_m), scaled(radius_m));
            (shape, Pose::identity())
        }
        Shape::Cuboid { half_extents_m } => {
            let half = vector(half_extents_m);
            (
                SharedShape::cuboid(half.x, half.y, half.z),
                Pose::identity(),
            )
        }
        Shape::Convex(mesh) => (hull_of(solid, &mesh.0)?, Pose::identity()),
        Shape::Mesh(_) => unreachable!("a mesh collides as its pieces"),
    };
    Ok((shape, solid.parent_from_shape * shape_from_rapier))
}

/// The hull of a mesh's points, which is also what MuJoCo makes of them.
fn hull_of(solid: &Solid, mesh: &TriangleMesh) -> Result<SharedShape, EngineError> {
    SharedShape::convex_hull(&points_of(mesh)).ok_or_else(|| no_volume(solid))
}

fn points_of(mesh: &TriangleMesh) -> Vec<Vector> {
    let points = mesh.vertices_m.iter();
    points.map(|point| vector(&point.coords)).collect()
}

fn no_volume(solid: &Solid) -> EngineError {
    EngineError::BadSolid {
        solid: solid.name.clone(),
        reason: "its points have no hull with a volume",
    }
}

/// Mass properties in rapier's form and units: principal moments and their frame.
pub(crate) fn mass_properties(body: &Body) -> MassProperties {
    // nalgebra's iteration is accurate to rounding.
    let mut eigen = body.inertia_kgm2.symmetric_eigen();
    if eigen.eigenvectors.determinant() < 0.0 {
        eigen.eigenvectors.column_mut(0).neg_mut();
    }
    let rotation = Rotation3::from_matrix_unchecked(eigen.eigenvectors);
    let frame = UnitQuaternion::from_rotation_matrix(&rotation);
    MassProperties::with_principal_inertia_frame(
        vector(&body.com_m),
        body.mass_kg,
        vector(&(eigen.eigenvalues * UNITS_PER_M)),
        Rotation::from(frame),
    )
}

/// Rotation that takes x, the axis of rapier's revolute joints, to `axis`.
pub(crate) fn rotation_from_x(axis: &UnitVector3<f64>) -> Pose {
    let rotation = UnitQuaternion::rotation_between_axis(&Vector3::x_axis(), axis)
        // Opposite: half a turn about z.
        .unwrap_or_else(|| {
            UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(0.0, 0.0, 0.0, 1.0))
        });
    Pose::from_parts(nalgebra::Translation3::identity(), rotation)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_axis_is_reached_from_x() {
        for axis in [
            Vector3::x_axis(),
            -Vector3::x_axis(),
            Vector3::y_axis(),
            -Vector3::z_axis(),
        ] {
            let reached = rotation_from_x(&axis) * Vector3::x();
            assert!((reached - axis.into_inner()).norm() < 1e-15);
        }
    }
}
