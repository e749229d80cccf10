//! Placing primitive solids by anatomical points.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_8};
use std::sync::Arc;

use nalgebra::{Point3, Translation3, UnitQuaternion, UnitVector3, Vector3};
use needlebench_geometry::{ConvexMesh, Shape, Solid};
use needlebench_kinematics::Pose;

use super::loft::{Level, loft, superellipse};

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

/// Elliptic cylinder about the segment between two points, with half an ellipsoid at either end; a
/// polyhedron around it, which goes up to 2 % of its half axes beyond.
///
/// `half_axes_m` are across and along `up`, which need not be at a right angle to the segment; the
/// ends reach the first of them further.
pub(super) fn elliptic_capsule(
    name: String,
    from: Point3<f64>,
    to: Point3<f64>,
    half_axes_m: [f64; 2],
    up: &Vector3<f64>,
) -> Solid {
    const PER_QUADRANT: usize = 4;
    // Around the ellipse, whose affine image of a circle's polygon it is.
    let around = 1.0 / libm::cos(FRAC_PI_2 / (2.0 * PER_QUADRANT as f64));
    let polygon = superellipse(half_axes_m.map(|half_m| around * half_m), 2.0, PER_QUADRANT);
    // Around a quarter of a circle: its tangents at 0, 45 and 90 degrees.
    let tangent = libm::tan(FRAC_PI_8);
    let along = to - from;
    let half_m = 0.5 * along.norm();
    let [near_m, far_m] = [tangent, 1.0].map(|share| half_m + share * half_axes_m[0]);
    let levels = [
        (-far_m, tangent),
        (-near_m, 1.0),
        (near_m, 1.0),
        (far_m, tangent),
    ]
    .map(|(z_m, scale)| Level { z_m, scale });

    let z = along.normalize();
    let y = (up - z * up.dot(&z)).normalize();
    let axes = nalgebra::Matrix3::from_columns(&[y.cross(&z), y, z]);
    let rotation =
        UnitQuaternion::from_rotation_matrix(&nalgebra::Rotation3::from_matrix_unchecked(axes));
    convex(
        name,
        loft(&polygon, &levels),
        pose(nalgebra::center(&from, &to), rotation),
    )
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

/// Ball about a point.
pub(super) fn ball(name: String, centre: Point3<f64>, radius_m: f64) -> Solid {
    Solid {
        name,
        shape: Shape::Sphere { radius_m },
        parent_from_shape: pose(centre, UnitQuaternion::identity()),
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
    fn elliptic_capsule_holds_the_smooth_one_and_little_more() {
        /// The polygon's corners, 1 / cos(pi / 16), at the height's half axis.
        const BEYOND: f64 = 0.0197;
        let half_axes_m = [0.0035, 0.00675];
        let (from, to) = (Point3::new(0.1, -0.2, 0.3), Point3::new(0.12, -0.19, 0.28));
        let up = Vector3::new(0.1, 0.3, 1.0);
        let solid = elliptic_capsule(String::new(), from, to, half_axes_m, &up);
        let Shape::Convex(mesh) = &solid.shape else {
            panic!("a polyhedron");
        };
        super::super::loft::assert_convex_and_closed(mesh);
        let faces = super::super::HalfSpaces::of(&solid).unwrap();
        let z = (to - from).normalize();
        let y = (up - z * up.dot(&z)).normalize();
        let x = y.cross(&z);
        let mut least_m = f64::INFINITY;
        for k in 0..2000 {
            // Directions all round; the smooth body's support points are those of ends and ellipse.
            let turn = 0.1 * f64::from(k);
            let (sine, cosine) = libm::sincos(turn);
            let height = 2.0 * (f64::from(k) + 0.5) / 2000.0 - 1.0;
            let across = (1.0 - height * height).sqrt();
            let of_ball = x * (half_axes_m[0] * across * cosine)
                + y * (half_axes_m[1] * across * sine)
                + z * (half_axes_m[0] * height);
            let end = if height > 0.0 { to } else { from };
            let depth_m = faces.depth_m(&(end + of_ball));
            assert!(depth_m > -ROUNDING, "{depth_m} m outside");
            least_m = least_m.min(depth_m);
        }
        assert!(least_m < 1e-5);
        let reach_m = mesh.0.vertices_m.iter().map(|p| p.y).fold(0.0, f64::max);
        assert!(reach_m / half_axes_m[1] - 1.0 < BEYOND);
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
