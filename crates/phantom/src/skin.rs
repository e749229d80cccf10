//! The skin as what lines pierce and points are under.

use nalgebra::{Point3, UnitVector3, Vector3};
use needlebench_geometry::mesh::SurfaceIndex;

use super::half_spaces::HalfSpaces;

/// The outer surface, in the phantom frame.
#[derive(Debug, Clone, PartialEq)]
pub enum SkinSurface {
    /// Face planes of a convex skin.
    Convex(HalfSpaces),
    /// Any other closed surface.
    Mesh(Box<SurfaceIndex>),
}

impl SkinSurface {
    /// See `Phantom::skin_intersection`.
    pub(super) fn clip_line(
        &self,
        origin: &Point3<f64>,
        direction: &UnitVector3<f64>,
    ) -> Option<(f64, f64)> {
        match self {
            Self::Convex(faces) => faces.clip_line(origin, direction),
            Self::Mesh(surface) => {
                let inside = surface.clip_line(origin, direction);
                let ahead = inside.iter().find(|(_, leaves_m)| *leaves_m > 0.0);
                ahead.or(inside.last()).copied()
            }
        }
    }

    /// Whether a point is inside.
    pub fn contains(&self, point: &Point3<f64>) -> bool {
        match self {
            Self::Convex(faces) => faces.depth_m(point) >= 0.0,
            Self::Mesh(surface) => surface.contains(point),
        }
    }

    /// See `Phantom::skin_normal`.
    pub(super) fn normal(&self, point: &Point3<f64>) -> UnitVector3<f64> {
        /// How far from the surface it is asked for its direction, m: more than rounding, less than any face.
        const STEP_M: f64 = 1e-5;
        let face = match self {
            Self::Convex(faces) => faces.nearest_normal(point),
            Self::Mesh(_) => None,
        };
        face.unwrap_or_else(|| {
            let slope = Vector3::from_fn(|axis, _| {
                let mut step = Vector3::zeros();
                step[axis] = STEP_M;
                self.depth_m(&(point - step)) - self.depth_m(&(point + step))
            });
            UnitVector3::try_new(slope, f64::MIN_POSITIVE).unwrap_or_else(Vector3::z_axis)
        })
    }

    /// See `Phantom::skin_signed_depth`.
    pub fn depth_m(&self, point: &Point3<f64>) -> f64 {
        match self {
            Self::Convex(faces) => faces.depth_m(point),
            Self::Mesh(surface) => -surface.signed_distance_m(point),
        }
    }
}
