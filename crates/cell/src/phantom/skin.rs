//! The skin as what lines pierce and points are under.

use nalgebra::{Point3, UnitVector3};
use needlebench_geometry::mesh::SurfaceIndex;

use super::half_spaces::HalfSpaces;

/// The outer surface, in the phantom frame.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum SkinSurface {
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
    pub(crate) fn contains(&self, point: &Point3<f64>) -> bool {
        match self {
            Self::Convex(faces) => faces.depth_m(point) >= 0.0,
            Self::Mesh(surface) => surface.contains(point),
        }
    }

    /// See `Phantom::skin_signed_depth`.
    pub(crate) fn depth_m(&self, point: &Point3<f64>) -> f64 {
        match self {
            Self::Convex(faces) => faces.depth_m(point),
            Self::Mesh(surface) => -surface.signed_distance_m(point),
        }
    }
}
