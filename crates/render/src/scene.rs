//! Scenes: the contents of pictures.

use std::sync::Arc;

use nalgebra::{Point2, Point3};
use needlebench_geometry::TriangleMesh;
use needlebench_kinematics::Pose;

/// The contents of a picture. Everything is in the world frame, z up.
#[derive(Debug, Clone, Default)]
pub struct Scene {
    /// Solid and translucent surfaces.
    pub surfaces: Vec<SurfaceInstance>,
    /// Lines in space, hidden by the opaque surfaces in front of them.
    pub lines: Vec<Line3>,
    /// Texts, on top of everything.
    pub labels: Vec<Label>,
    /// A floor with a grid and soft shadows.
    pub floor: Option<Floor>,
}

/// A surface at a place in the world.
#[derive(Debug, Clone)]
pub struct SurfaceInstance {
    /// Triangles, counter-clockwise seen from outside; need not be closed.
    pub mesh: Arc<TriangleMesh>,
    /// Pose of the surface in the world.
    pub world_from_surface: Pose,
    /// Red, green, blue, opacity, each 0 to 1 (sRGB).
    pub color_rgba: [f32; 4],
}

/// A straight line in space.
#[derive(Debug, Clone, PartialEq)]
pub struct Line3 {
    /// One end, m.
    pub from_m: Point3<f64>,
    /// Other end, m.
    pub to_m: Point3<f64>,
    /// Red, green, blue, opacity, each 0 to 1 (sRGB); lines are not shaded.
    pub color_rgba: [f32; 4],
    /// Width in pixels, whatever the distance.
    pub width_px: f64,
}

/// A text on a translucent box; `\n` breaks lines.
///
/// A box that would cover an earlier label moves down to the first free place.
#[derive(Debug, Clone, PartialEq)]
pub struct Label {
    /// The text, in Latin-1; other characters show as `?`.
    pub text: String,
    /// Its position.
    pub anchor: Anchor,
}

/// Position of a label.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Anchor {
    /// Beside a point of the world, in m, with a leader line to it; not drawn when the point is out
    /// of sight.
    World(Point3<f64>),
    /// Top left corner of the picture.
    TopLeft,
    /// Top right corner of the picture.
    TopRight,
    /// Bottom left corner of the picture; later labels go above earlier ones.
    BottomLeft,
    /// Bottom right corner of the picture; later labels go above earlier ones.
    BottomRight,
}

/// A round piece of horizontal floor that fades out towards its rim.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Floor {
    /// Centre in the world's x and y, m.
    pub center_m: Point2<f64>,
    /// Height in the world, m.
    pub z_m: f64,
    /// Where it has faded out, m.
    pub radius_m: f64,
    /// Distance of the grid's lines, which go through the world's origin, m.
    pub spacing_m: f64,
}
