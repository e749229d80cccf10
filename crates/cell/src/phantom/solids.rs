//! Placing primitive solids by anatomical points.

use std::sync::Arc;

use nalgebra::{Point3, Translation3, UnitQuaternion, UnitVector3, Vector3};
use needlebench_geometry::{ConvexMesh, Shape, Solid};
use needlebench_kinematics::Pose;

/// Capsule around the segment between two points.
pub(super) fn capsule(name: String, from: Point3<f64>, to: Point3<f64>, radius_m: f64) -> Solid {
    let along = to - from;
    Solid {
        name,
        shape: Shape::Capsule {
            radius_m,
            half_length_m: 0.5 * along.norm(),
        },
        parent_from_shape: pose(nalgebra::center(&from, &to), z_towards(&along)),
    }
}

/// Cylinder between the centres of its end faces.
pub(super) fn cylinder(name: String, from: Point3<f64>, to: Point3<f64>, radius_m: f64) -> Solid {
    let along = to - from;
    Solid {
        name,
        shape: Shape::Cylinder {
            radius_m,
            half_length_m: 0.5 * along.norm(),
        },
        parent_from_shape: pose(nalgebra::center(&from, &to), z_towards(&along)),
    }
}

/// Box centred on a pose.
pub(super) fn cuboid(name: String, half_extents_m: Vector3<f64>, parent_from_shape: Pose) -> Solid {
    Solid {
        name,
        shape: Shape::Cuboid { half_extents_m },
        parent_from_shape,
    }
}

/// Convex mesh placed by a pose.
pub(super) fn convex(name: String, mesh: ConvexMesh, parent_from_shape: Pose) -> Solid {
    Solid {
        name,
        shape: Shape::Convex(Arc::new(mesh)),
        parent_from_shape,
    }
}

/// Pose with an origin and a rotation.
pub(super) fn pose(origin: Point3<f64>, rotation: UnitQuaternion<f64>) -> Pose {
    Pose::from_parts(Translation3::from(origin.coords), rotation)
}

/// Shortest rotation that turns z towards a direction; none for a zero vector.
pub(super) fn z_towards(direction: &Vector3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::rotation_between(&Vector3::z(), direction).unwrap_or_else(|| {
        UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI)
    })
}

/// Rotation with z along a surface's outward normal, x to the right (horizontal) and y up, as
/// somebody sees them who faces the surface; for a vertical normal, x stays x.
pub(super) fn facing(normal: &UnitVector3<f64>) -> UnitQuaternion<f64> {
    /// Below this, the normal counts as vertical.
    const VERTICAL: f64 = 1e-9;
    let horizontal = Vector3::z().cross(normal);
    let x = if horizontal.norm() > VERTICAL {
        horizontal.normalize()
    } else {
        Vector3::x()
    };
    let y = normal.cross(&x);
    let axes = nalgebra::Matrix3::from_columns(&[x, y, normal.into_inner()]);
    UnitQuaternion::from_rotation_matrix(&nalgebra::Rotation3::from_matrix_unchecked(axes))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rounding of unit vectors through a quaternion.
    const ROUNDING: f64 = 1e-14;

    #[test]
    fn capsule_axis_runs_between_its_points_in_every_direction() {
        for along in [
            Vector3::new(0.01, 0.02, 0.03),
            Vector3::new(0.0, 0.0, 0.04),
            Vector3::new(0.0, 0.0, -0.04),
            Vector3::new(-0.05, 0.0, 0.0),
        ] {
            let from = Point3::new(0.1, -0.2, 0.3);
            let solid = capsule(String::new(), from, from + along, 0.005);
            let Shape::Capsule { half_length_m, .. } = solid.shape else {
                panic!("not a capsule");
            };
            let ends = [-half_length_m, half_length_m]
                .map(|z_m| solid.parent_from_shape * Point3::new(0.0, 0.0, z_m));
            assert!((ends[0] - from).norm() < ROUNDING);
            assert!((ends[1] - (from + along)).norm() < ROUNDING);
        }
    }

    #[test]
    fn facing_turns_z_to_the_normal_and_keeps_x_horizontal() {
        for normal in [
            Vector3::new(0.3, -0.9, 0.2),
            Vector3::new(-1.0, 0.1, -0.4),
            Vector3::z(),
        ] {
            let normal = UnitVector3::new_normalize(normal);
            let rotation = facing(&normal);
            assert!((rotation * Vector3::z() - normal.into_inner()).norm() < ROUNDING);
            assert!((rotation * Vector3::x()).z.abs() < ROUNDING);
        }
    }
}
