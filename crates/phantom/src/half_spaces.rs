//! Convex bodies as an intersection of half-spaces: exact inside tests and line clipping.

use nalgebra::{Point3, UnitVector3, Vector3};
use needlebench_geometry::{ConvexMesh, Shape, Solid};

/// Points `p` with `normal . p <= offset_m`.
#[derive(Debug, Clone, PartialEq)]
struct HalfSpace {
    normal: UnitVector3<f64>,
    offset_m: f64,
}

/// The face planes of a convex body, in the frame that the body's solid is placed in.
#[derive(Debug, Clone, PartialEq)]
pub struct HalfSpaces(Vec<HalfSpace>);

impl HalfSpaces {
    /// Points `p` with `normal . p <= offset_m` for all of these normals and offsets.
    pub fn new(planes: impl IntoIterator<Item = (UnitVector3<f64>, f64)>) -> Self {
        let planes = planes.into_iter();
        Self(
            planes
                .map(|(normal, offset_m)| HalfSpace { normal, offset_m })
                .collect(),
        )
    }

    /// Face planes of a convex solid; `None` if the solid is not a convex mesh.
    pub fn of(solid: &Solid) -> Option<Self> {
        let Shape::Convex(mesh) = &solid.shape else {
            return None;
        };
        let ConvexMesh(mesh) = mesh.as_ref();
        let at = |i: u32| solid.parent_from_shape * mesh.vertices_m[i as usize];
        let planes = mesh.triangles.iter().filter_map(|&[a, b, c]| {
            let normal = UnitVector3::try_new((at(b) - at(a)).cross(&(at(c) - at(a))), 0.0)?;
            Some(HalfSpace {
                offset_m: normal.dot(&at(a).coords),
                normal,
            })
        });
        Some(Self(planes.collect()))
    }

    /// Depth of a point below the surface, m: positive inside, negative outside.
    ///
    /// Exact inside (the nearest surface point of a convex body lies on the nearest face plane).
    /// Outside, its magnitude is the distance to the furthest violated face plane: never more than
    /// the true distance, and equal to it opposite a face.
    pub fn depth_m(&self, point: &Point3<f64>) -> f64 {
        self.0
            .iter()
            .map(|plane| plane.offset_m - plane.normal.dot(&point.coords))
            .fold(f64::INFINITY, f64::min)
    }

    /// Depth of the shallowest point of a solid, m; negative when it sticks out.
    pub(crate) fn depth_of_solid_m(&self, solid: &Solid) -> f64 {
        /// More than the rounding of a ball's reach.
        const ROUNDING_M: f64 = 1e-9;
        // A ball around the solid shows most planes to be farther away than the nearest one.
        let centre = &solid.parent_from_shape.translation.vector;
        let radius_m = solid.shape.bounding_radius_m() + ROUNDING_M;
        self.0.iter().fold(f64::INFINITY, |least_m, plane| {
            if plane.offset_m - plane.normal.dot(centre) - radius_m > least_m {
                least_m
            } else {
                least_m.min(plane.offset_m - reach_m(solid, &plane.normal))
            }
        })
    }

    /// Widest gap between this body and a solid across one of this body's face planes, m.
    ///
    /// Positive proves that the two are apart, and never exceeds their true distance. Negative
    /// proves nothing.
    #[cfg(test)]
    pub fn gap_m(&self, solid: &Solid) -> f64 {
        self.0
            .iter()
            .map(|plane| -reach_m(solid, &-plane.normal) - plane.offset_m)
            .fold(f64::NEG_INFINITY, f64::max)
    }

    /// Face whose plane is nearest to a point of the surface: its outward normal.
    pub(crate) fn nearest_normal(&self, point: &Point3<f64>) -> Option<UnitVector3<f64>> {
        let depth_m = |plane: &HalfSpace| plane.offset_m - plane.normal.dot(&point.coords);
        self.0
            .iter()
            .min_by(|a, b| depth_m(a).abs().total_cmp(&depth_m(b).abs()))
            .map(|plane| plane.normal)
    }

    /// Where the line `origin + s * direction` enters and leaves, as `s` in m (negative: behind the
    /// origin). `None` when it misses or only grazes.
    pub fn clip_line(
        &self,
        origin: &Point3<f64>,
        direction: &UnitVector3<f64>,
    ) -> Option<(f64, f64)> {
        let mut enter_m = f64::NEG_INFINITY;
        let mut leave_m = f64::INFINITY;
        for plane in &self.0 {
            let height_m = plane.offset_m - plane.normal.dot(&origin.coords);
            let slope = plane.normal.dot(direction);
            if slope > 0.0 {
                leave_m = leave_m.min(height_m / slope);
            } else if slope < 0.0 {
                enter_m = enter_m.max(height_m / slope);
            } else if height_m < 0.0 {
                return None;
            }
        }
        (enter_m < leave_m).then_some((enter_m, leave_m))
    }
}

/// Support function: how far a solid reaches along a direction of its parent frame, m.
fn reach_m(solid: &Solid, direction: &UnitVector3<f64>) -> f64 {
    let local: Vector3<f64> = solid
        .parent_from_shape
        .rotation
        .inverse_transform_vector(direction);
    let reach = match &solid.shape {
        Shape::Sphere { radius_m } => *radius_m,
        Shape::Cylinder {
            radius_m,
            half_length_m,
        } => radius_m * libm::hypot(local.x, local.y) + half_length_m * local.z.abs(),
        Shape::Capsule {
            radius_m,
            half_length_m,
        } => radius_m + half_length_m * local.z.abs(),
        Shape::Cuboid { half_extents_m } => half_extents_m.dot(&local.abs()),
        Shape::Convex(mesh) => mesh
            .0
            .vertices_m
            .iter()
            .map(|vertex| local.dot(&vertex.coords))
            .fold(f64::NEG_INFINITY, f64::max),
        Shape::Mesh(mesh) => mesh
            .surface()
            .vertices_m
            .iter()
            .map(|vertex| local.dot(&vertex.coords))
            .fold(f64::NEG_INFINITY, f64::max),
    };
    reach + direction.dot(&solid.parent_from_shape.translation.vector)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{Point2, UnitQuaternion};
    use needlebench_kinematics::Pose;

    use super::super::loft::{Level, loft};
    use super::*;

    /// Rounding of unit-cube coordinates.
    const ROUNDING_M: f64 = 1e-14;

    /// Cube-like body: half side 0.1 m at mid height, tapering to 0.05 m at z = +-0.1 m.
    fn barrel(parent_from_shape: Pose) -> Solid {
        let square = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]
            .map(|[x, y]| Point2::new(0.1 * x, 0.1 * y));
        let levels = [(-0.1, 0.5), (0.0, 1.0), (0.1, 0.5)].map(|(z_m, scale)| Level { z_m, scale });
        Solid {
            name: "barrel".to_owned(),
            shape: Shape::Convex(Arc::new(loft(&square, &levels))),
            parent_from_shape,
        }
    }

    #[test]
    fn line_is_clipped_where_it_pierces_the_faces() {
        let spaces = HalfSpaces::of(&barrel(Pose::translation(1.0, 0.0, 0.0))).unwrap();
        let (enter_m, leave_m) = spaces
            .clip_line(&Point3::new(0.5, 0.02, 0.0), &Vector3::x_axis())
            .unwrap();
        assert!((enter_m - 0.4).abs() < ROUNDING_M && (leave_m - 0.6).abs() < ROUNDING_M);
        let from_inside = spaces.clip_line(&Point3::new(1.0, 0.0, 0.05), &Vector3::y_axis());
        let (enter_m, leave_m) = from_inside.unwrap();
        assert!((enter_m + 0.075).abs() < ROUNDING_M && (leave_m - 0.075).abs() < ROUNDING_M);
        assert_eq!(
            spaces.clip_line(&Point3::new(0.0, 0.2, 0.0), &Vector3::x_axis()),
            None
        );
    }

    #[test]
    fn depth_is_exact_inside_and_never_overstates_outside() {
        let spaces = HalfSpaces::of(&barrel(Pose::identity())).unwrap();
        // The side faces slope by 0.05 over 0.1, so the centre is nearest to them.
        let to_side_m = 0.1 * 0.1 / libm::hypot(0.1_f64, 0.05);
        assert!((spaces.depth_m(&Point3::origin()) - to_side_m).abs() < ROUNDING_M);
        assert!((spaces.depth_m(&Point3::new(0.0, 0.0, 0.3)) + 0.2).abs() < ROUNDING_M);
        let off_corner = Point3::new(0.2, 0.2, 0.0);
        let true_distance_m = libm::hypot(0.1_f64, 0.1);
        assert!(spaces.depth_m(&off_corner) < 0.0);
        assert!(-spaces.depth_m(&off_corner) <= true_distance_m);
    }

    #[test]
    fn depth_of_a_solid_is_that_of_its_shallowest_point() {
        let spaces = HalfSpaces::of(&barrel(Pose::identity())).unwrap();
        let turned = Pose::from_parts(
            nalgebra::Translation3::new(0.0, 0.0, 0.02),
            UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 0.3),
        );
        let (sine, cosine) = libm::sincos(0.3_f64);
        let cases = [
            (Shape::Sphere { radius_m: 0.01 }, 0.01),
            (
                Shape::Capsule {
                    radius_m: 0.01,
                    half_length_m: 0.06,
                },
                0.01 + 0.06 * cosine,
            ),
            (
                Shape::Cylinder {
                    radius_m: 0.01,
                    half_length_m: 0.06,
                },
                0.01 * sine + 0.06 * cosine,
            ),
            (
                Shape::Cuboid {
                    half_extents_m: Vector3::new(0.002, 0.01, 0.06),
                },
                0.01 * sine + 0.06 * cosine,
            ),
        ];
        for (shape, reach_up_m) in cases {
            let solid = Solid {
                name: String::new(),
                shape,
                parent_from_shape: turned,
            };
            let top_m = 0.02 + reach_up_m;
            assert!((reach_m(&solid, &Vector3::z_axis()) - top_m).abs() < ROUNDING_M);
            assert!(spaces.depth_of_solid_m(&solid) <= 0.1 - top_m + ROUNDING_M);
        }
    }
}
