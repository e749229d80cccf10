//! Cameras, and the view that a camera has.

use nalgebra::{Matrix3, Point3, Vector2, Vector3};

/// Nearest visible distance in front of the eye, m.
const NEAR_M: f64 = 0.01;

/// Field of view of [`Camera::framing`]: narrow enough that shapes keep their proportions.
const FRAMING_FOV_RAD: f64 = 0.5;

/// Part of the picture that [`Camera::framing`] fills.
const FRAMING_FILL: f64 = 0.92;

/// Geometry is clipped at this multiple of the picture's half sides, so that coordinates fit the
/// rasteriser's integers while triangles that merely reach over the rim need no clipping.
const GUARD: f64 = 4.0;

/// Longest side of a picture, px: bounds memory and the rasteriser's coordinates.
const MAX_SIDE_PX: u32 = 8192;

/// How space is mapped to the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// As an eye sees.
    Perspective {
        /// Angle between the picture's top and bottom, rad.
        vertical_fov_rad: f64,
    },
    /// Along parallel rays: lengths across the view are to scale.
    Orthographic {
        /// Height of the piece of space that is shown, m.
        height_m: f64,
    },
}

/// Where a picture is taken from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Position of the eye in the world, m.
    pub eye_m: Point3<f64>,
    /// Point in the world that appears in the picture's centre, m.
    pub target_m: Point3<f64>,
    /// Direction in the world that appears upwards.
    pub up: Vector3<f64>,
    /// How space is mapped to the picture.
    pub projection: Projection,
    /// Width of the picture, 1 to 8192 (else the nearer of these is taken).
    pub width_px: u32,
    /// Height of the picture, 1 to 8192 (else the nearer of these is taken).
    pub height_px: u32,
}

impl Camera {
    /// The camera that looks along `direction`, world z upwards, from as near as it can have all
    /// `points_m` in the picture.
    ///
    /// Points that are not finite are ignored; without points the unit cube about the origin is
    /// framed.
    pub fn framing(
        points_m: &[Point3<f64>],
        direction: Vector3<f64>,
        [width_px, height_px]: [u32; 2],
    ) -> Self {
        let axes = axes(direction, Vector3::z());
        let slopes = slopes(FRAMING_FOV_RAD, width_px, height_px) * FRAMING_FILL;
        // With z forward, a point is inside when |x - eye_x| <= slope (z - eye_z), so the eye has
        // to be behind the planes through the outermost points of both sides.
        let mut sides = [[f64::NEG_INFINITY; 2]; 2];
        let mut nearest_z_m = f64::INFINITY;
        for seen_m in framed(points_m).map(|point_m| axes * point_m.coords) {
            for axis in 0..2 {
                let back_m = slopes[axis] * seen_m.z;
                sides[axis][0] = sides[axis][0].max(seen_m[axis] - back_m);
                sides[axis][1] = sides[axis][1].max(-seen_m[axis] - back_m);
            }
            nearest_z_m = nearest_z_m.min(seen_m.z);
        }
        let back_m = |axis: usize| (sides[axis][0] + sides[axis][1]) / (2.0 * slopes[axis]);
        let eye = Vector3::new(
            (sides[0][0] - sides[0][1]) / 2.0,
            (sides[1][0] - sides[1][1]) / 2.0,
            // In front of the nearest point in any case, even of a single one.
            (-back_m(0).max(back_m(1))).min(nearest_z_m - 10.0 * NEAR_M),
        );
        let target = Vector3::new(eye.x, eye.y, eye.z + 1.0);
        Self {
            eye_m: Point3::from(axes.transpose() * eye),
            target_m: Point3::from(axes.transpose() * target),
            up: Vector3::z(),
            projection: Projection::Perspective {
                vertical_fov_rad: FRAMING_FOV_RAD,
            },
            width_px,
            height_px,
        }
    }

    /// Like [`Camera::framing`], along parallel rays.
    pub fn framing_orthographic(
        points_m: &[Point3<f64>],
        direction: Vector3<f64>,
        [width_px, height_px]: [u32; 2],
    ) -> Self {
        let axes = axes(direction, Vector3::z());
        let mut low = Vector3::repeat(f64::INFINITY);
        let mut high = Vector3::repeat(f64::NEG_INFINITY);
        for seen_m in framed(points_m).map(|point_m| axes * point_m.coords) {
            low = low.inf(&seen_m);
            high = high.sup(&seen_m);
        }
        let size = high - low;
        let aspect = f64::from(width_px.max(1)) / f64::from(height_px.max(1));
        let height_m = size.y.max(size.x / aspect).max(NEAR_M) / FRAMING_FILL;
        let mut target = (low + high) / 2.0;
        target.z = low.z;
        let eye = target - Vector3::z();
        Self {
            eye_m: Point3::from(axes.transpose() * eye),
            target_m: Point3::from(axes.transpose() * target),
            up: Vector3::z(),
            projection: Projection::Orthographic { height_m },
            width_px,
            height_px,
        }
    }
}

/// The points to frame.
fn framed(points_m: &[Point3<f64>]) -> impl Iterator<Item = Point3<f64>> {
    let finite = |point_m: &&Point3<f64>| point_m.coords.iter().all(|x| x.is_finite());
    let cube = [-0.5, 0.5].into_iter().flat_map(|x| {
        [-0.5, 0.5]
            .into_iter()
            .flat_map(move |y| [-0.5, 0.5].map(|z| Point3::new(x, y, z)))
    });
    let empty = !points_m.iter().any(|point_m| finite(&point_m));
    points_m
        .iter()
        .filter(finite)
        .copied()
        .chain(cube.filter(move |_| empty))
}

/// Rows: the world directions that appear to the right, downwards and forwards.
fn axes(direction: Vector3<f64>, up: Vector3<f64>) -> Matrix3<f64> {
    let forward = direction
        .try_normalize(f64::MIN_POSITIVE)
        .unwrap_or_else(Vector3::y);
    let right = [up, Vector3::y(), Vector3::x()]
        .iter()
        .find_map(|up| {
            forward
                .cross(&up.try_normalize(f64::MIN_POSITIVE)?)
                .try_normalize(1e-6)
        })
        .unwrap_or_else(Vector3::x);
    let down = forward.cross(&right);
    Matrix3::from_rows(&[right.transpose(), down.transpose(), forward.transpose()])
}

/// Half width and half height of the picture per distance from the eye.
fn slopes(vertical_fov_rad: f64, width_px: u32, height_px: u32) -> Vector2<f64> {
    let fov_rad = if vertical_fov_rad.is_finite() {
        vertical_fov_rad
    } else {
        FRAMING_FOV_RAD
    };
    let vertical = libm::tan(fov_rad.clamp(1e-3, 3.0) / 2.0);
    let aspect = f64::from(width_px.max(1)) / f64::from(height_px.max(1));
    Vector2::new(vertical * aspect, vertical)
}

/// A camera ready for use. Eye frame: x to the right, y downwards, z forwards.
#[derive(Debug, Clone)]
pub(crate) struct View {
    /// Rotation to the eye frame from the world.
    pub eye_from_world: Matrix3<f64>,
    /// The eye in the world, m.
    pub eye_m: Point3<f64>,
    /// Width of the picture, px.
    pub width_px: usize,
    /// Height of the picture, px.
    pub height_px: usize,
    perspective: bool,
    /// Pixels per metre: at the distance of 1 m, or everywhere along parallel rays.
    scale_px: f64,
    /// Inverse of `scale_px`.
    pixel_m: f64,
}

/// A half space of the eye frame, `normal . point + offset >= 0`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct HalfSpace {
    pub normal: Vector3<f64>,
    pub offset: f64,
}

impl HalfSpace {
    /// Positive inside.
    pub fn depth(&self, eye_point: &Vector3<f64>) -> f64 {
        self.normal.dot(eye_point) + self.offset
    }
}

/// A point of the picture, px from its top left corner, with its nearness.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Projected {
    pub x_px: f64,
    pub y_px: f64,
    /// Grows towards the eye and is linear across the picture on every plane of space: 1 / depth in
    /// perspective, -depth along parallel rays.
    pub nearness: f64,
}

impl View {
    pub fn new(camera: &Camera) -> Self {
        let (width_px, height_px) = (
            camera.width_px.clamp(1, MAX_SIDE_PX),
            camera.height_px.clamp(1, MAX_SIDE_PX),
        );
        let half_height_px = f64::from(height_px) / 2.0;
        let (perspective, half_height_m) = match camera.projection {
            Projection::Perspective { vertical_fov_rad } => {
                (true, slopes(vertical_fov_rad, width_px, height_px).y)
            }
            Projection::Orthographic { height_m } => {
                (false, if height_m > 0.0 { height_m / 2.0 } else { 0.5 })
            }
        };
        Self {
            eye_from_world: axes(camera.target_m - camera.eye_m, camera.up),
            eye_m: camera.eye_m,
            width_px: width_px as usize,
            height_px: height_px as usize,
            perspective,
            scale_px: half_height_px / half_height_m,
            pixel_m: half_height_m / half_height_px,
        }
    }

    /// A point of the world in the eye frame, m.
    pub(crate) fn eye_point(&self, world_m: &Point3<f64>) -> Vector3<f64> {
        self.eye_from_world * (world_m - self.eye_m)
    }

    fn center_px(&self) -> [f64; 2] {
        [self.width_px as f64 / 2.0, self.height_px as f64 / 2.0]
    }

    /// A point of the eye frame, which must be in front of the eye, in the picture.
    pub fn project(&self, eye_point: &Vector3<f64>) -> Projected {
        let [center_x_px, center_y_px] = self.center_px();
        let (scale_px, nearness) = if self.perspective {
            (self.scale_px / eye_point.z, 1.0 / eye_point.z)
        } else {
            (self.scale_px, -eye_point.z)
        };
        Projected {
            x_px: center_x_px + scale_px * eye_point.x,
            y_px: center_y_px + scale_px * eye_point.y,
            nearness,
        }
    }

    /// The ray through a place of the picture: start and direction in the eye frame; the
    /// direction's z is 1.
    pub fn ray(&self, x_px: f64, y_px: f64) -> (Vector3<f64>, Vector3<f64>) {
        let [center_x_px, center_y_px] = self.center_px();
        let across = Vector3::new(
            (x_px - center_x_px) * self.pixel_m,
            (y_px - center_y_px) * self.pixel_m,
            0.0,
        );
        if self.perspective {
            (Vector3::zeros(), across + Vector3::z())
        } else {
            (across, Vector3::z())
        }
    }

    /// Depth along z of the eye frame, m.
    pub fn depth_m(&self, nearness: f64) -> f64 {
        if self.perspective {
            1.0 / nearness
        } else {
            -nearness
        }
    }

    /// Inverse of [`View::depth_m`].
    pub(crate) fn nearness(&self, depth_m: f64) -> f64 {
        if self.perspective {
            1.0 / depth_m
        } else {
            -depth_m
        }
    }

    /// What geometry is clipped to: in front of the eye and within [`GUARD`] pictures.
    pub(crate) fn guards(&self) -> [HalfSpace; 5] {
        let half_space = |x: f64, y: f64, side_px: f64| {
            let slope = GUARD * side_px / self.scale_px;
            let normal = Vector3::new(x, y, if self.perspective { slope } else { 0.0 });
            HalfSpace {
                normal,
                offset: if self.perspective { 0.0 } else { slope },
            }
        };
        let [half_width_px, half_height_px] = self.center_px();
        [
            HalfSpace {
                normal: Vector3::z(),
                offset: -NEAR_M,
            },
            half_space(1.0, 0.0, half_width_px),
            half_space(-1.0, 0.0, half_width_px),
            half_space(0.0, 1.0, half_height_px),
            half_space(0.0, -1.0, half_height_px),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rounding of a few operations on pixel coordinates of about a thousand.
    const ROUNDING_PX: f64 = 1e-9;

    fn cloud() -> Vec<Point3<f64>> {
        let spread = |index: u32, step: f64| libm::sin(f64::from(index) * step);
        (0..50)
            .map(|i| {
                Point3::new(
                    spread(i, 1.3),
                    2.0 + 0.3 * spread(i, 2.1),
                    0.5 * spread(i, 0.7),
                )
            })
            .collect()
    }

    fn extremes_px(camera: &Camera, points_m: &[Point3<f64>]) -> ([f64; 2], [f64; 2]) {
        let view = View::new(camera);
        let mut low = [f64::INFINITY; 2];
        let mut high = [f64::NEG_INFINITY; 2];
        for point_m in points_m {
            let at = view.project(&view.eye_point(point_m));
            for (axis, value) in [at.x_px, at.y_px].into_iter().enumerate() {
                low[axis] = low[axis].min(value);
                high[axis] = high[axis].max(value);
            }
        }
        (low, high)
    }

    #[test]
    fn framing_fits_all_points_and_touches_the_margin() {
        let direction = Vector3::new(0.4, 1.0, -0.5);
        for camera in [
            Camera::framing(&cloud(), direction, [1200, 900]),
            Camera::framing_orthographic(&cloud(), direction, [1200, 900]),
        ] {
            let (low, high) = extremes_px(&camera, &cloud());
            let margins = [(low[0], high[0], 1200.0), (low[1], high[1], 900.0)].map(
                |(low_px, high_px, side_px)| {
                    let margin_px = side_px * (1.0 - FRAMING_FILL) / 2.0;
                    (low_px - margin_px).min(side_px - margin_px - high_px)
                },
            );
            assert!(
                margins[0].min(margins[1]).abs() < ROUNDING_PX,
                "{margins:?}"
            );
        }
    }

    #[test]
    fn target_appears_in_the_centre_and_up_is_upwards() {
        let camera = Camera {
            eye_m: Point3::new(1.0, -2.0, 1.5),
            target_m: Point3::new(0.1, 0.2, 0.3),
            up: Vector3::z(),
            projection: Projection::Perspective {
                vertical_fov_rad: 0.7,
            },
            width_px: 640,
            height_px: 480,
        };
        let view = View::new(&camera);
        let at = |point_m: Point3<f64>| view.project(&view.eye_point(&point_m));
        let center = at(camera.target_m);
        assert!((center.x_px - 320.0).abs().max((center.y_px - 240.0).abs()) < ROUNDING_PX);
        let above = at(camera.target_m + 0.1 * Vector3::z());
        assert!(above.y_px < center.y_px && (above.x_px - center.x_px).abs() < ROUNDING_PX);
        let to_the_right = at(camera.target_m + Vector3::new(0.2, 0.09, 0.0));
        assert!(to_the_right.x_px > center.x_px);
    }

    #[test]
    fn a_ray_leads_back_to_the_projected_point() {
        for camera in [
            Camera::framing(&cloud(), Vector3::new(0.4, 1.0, -0.5), [1200, 900]),
            Camera::framing_orthographic(&cloud(), Vector3::new(0.4, 1.0, -0.5), [1200, 900]),
        ] {
            let view = View::new(&camera);
            for point_m in cloud() {
                let eye_point = view.eye_point(&point_m);
                let at = view.project(&eye_point);
                let (start, direction) = view.ray(at.x_px, at.y_px);
                let back = start + direction * view.depth_m(at.nearness);
                assert!(
                    (back - eye_point).norm() < ROUNDING_PX,
                    "{back} {eye_point}"
                );
            }
        }
    }

    #[test]
    fn senseless_cameras_still_have_a_view() {
        let empty = Camera::framing(&[], Vector3::zeros(), [0, 0]);
        let down = Camera::framing(&cloud(), -Vector3::z(), [90_000, 10]);
        let single = Camera::framing(&[Point3::origin()], Vector3::x(), [10, 10]);
        for camera in [empty, down, single] {
            let view = View::new(&camera);
            assert!((view.eye_from_world.determinant() - 1.0).abs() < ROUNDING_PX);
            assert!(view.width_px >= 1 && view.width_px <= 8192 && view.height_px >= 1);
            assert!(
                camera.eye_m.coords.iter().all(|x| x.is_finite()),
                "{camera:?}"
            );
        }
    }
}
