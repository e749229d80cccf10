//! What stands around the robot and the phantom: CT table, CT gantry, the robot's mount, and obstacles.
//!
//! Each is in the world frame (z up, floor at z = 0). Table, gantry and mount are built from convex
//! solids.

mod mount;

use std::f64::consts::{FRAC_PI_2, TAU};
use std::sync::Arc;

use nalgebra::{Point2, Point3, Translation3, UnitQuaternion, Vector3};
use needlebench_geometry::{ConvexMesh, Shape, Solid, TriangleMesh};
use needlebench_kinematics::Pose;
use serde::{Deserialize, Serialize};

use crate::scenario::{GantrySection, TableSection};
pub use mount::mount;

/// Which fixture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FixtureKind {
    /// The table that the phantom lies on.
    Table,
    /// The CT scanner's housing with its bore.
    Gantry,
    /// What the robot's base is bolted to.
    Mount,
    /// One of the scenario's obstacles.
    Obstacle,
    /// Somebody who stands in the room.
    Person,
}

/// One rigid thing that does not move.
#[derive(Debug, Clone, PartialEq)]
pub struct Fixture {
    /// Which one.
    pub kind: FixtureKind,
    /// Its solids, world frame.
    pub solids: Vec<Solid>,
    /// Red, green, blue, opacity, each 0 to 1 (sRGB). Opaque, so that inner faces of a gantry made of
    /// convex pieces stay hidden.
    pub color_rgba: [f32; 4],
}

impl Fixture {
    /// Its solids, by the colour that they are drawn in: walls and ceilings are seen through.
    pub fn by_color(&self) -> Vec<([f32; 4], Vec<&Solid>)> {
        /// Opacity of what would hide the cell.
        const FAINT: f32 = 0.12;
        let (faint, plain): (Vec<&Solid>, Vec<&Solid>) =
            self.solids.iter().partition(|solid| mount::is_slab(solid));
        let [red, green, blue, _] = self.color_rgba;
        let groups = [(self.color_rgba, plain), ([red, green, blue, FAINT], faint)];
        let there = groups.into_iter().filter(|(_, solids)| !solids.is_empty());
        there.collect()
    }
}

/// Why a fixture cannot be built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FixtureError {
    /// The housing does not enclose the bore.
    #[error(
        "{key} is {size_mm} mm: less than {least_mm} mm of housing beside a bore of {bore_mm} mm"
    )]
    HousingTooSmall {
        /// `outer_width_mm` or `outer_height_mm`.
        key: &'static str,
        /// The value given, mm.
        size_mm: f64,
        /// Diameter of the bore, mm.
        bore_mm: f64,
        /// Smallest thickness of the housing beside the bore, mm.
        least_mm: f64,
    },
    /// The base has an orientation that this kind of mount does not support.
    #[error(
        "the robot's base is tilted by {tilt_deg:.3} deg from upright, but a mount of kind `{kind}` \
         supports {carries}"
    )]
    BaseTilted {
        /// As in a scenario.
        kind: &'static str,
        /// Angle between the base's z axis and the vertical, deg.
        tilt_deg: f64,
        /// The supported orientations.
        carries: &'static str,
    },
    /// There is not enough space between the base and what the mount stands on or hangs from.
    #[error(
        "the robot's base is {height_mm:.1} mm {from}, less than the {needs_mm:.1} mm of the mount's {parts}"
    )]
    BaseTooNear {
        /// Distance of `base_link` from the floor or the ceiling, mm.
        height_mm: f64,
        /// "above the floor" or "below the ceiling".
        from: &'static str,
        /// What the mount needs, mm.
        needs_mm: f64,
        /// What it needs that for.
        parts: &'static str,
    },
    /// The plate's edge would reach past the end of the wedge.
    #[error(
        "`wedge_height_mm` is {height_mm} mm, but the plate's edge extends {edge_mm:.1} mm behind its \
         centre"
    )]
    WedgeTooLow {
        /// Height of the wedge, mm.
        height_mm: f64,
        /// How far the plate reaches along the column behind the middle of its back, mm.
        edge_mm: f64,
    },
    /// A mount on the table's rail, without a table.
    #[error("a mount of kind `table_rail` requires a [table]")]
    NoTable,
}

impl FixtureError {
    /// The key it is about, without its section; none if it is about the robot's base.
    pub(crate) fn key(&self) -> Option<&'static str> {
        match self {
            Self::HousingTooSmall { key, .. } => Some(key),
            Self::WedgeTooLow { .. } => Some("wedge_height_mm"),
            Self::NoTable => Some("kind"),
            Self::BaseTilted { .. } | Self::BaseTooNear { .. } => None,
        }
    }

    /// How to fix it.
    pub(crate) fn hint(&self) -> &'static str {
        match self {
            Self::HousingTooSmall { .. } => "lengths are in millimetres",
            Self::WedgeTooLow { .. } => "use a higher wedge or a narrower plate",
            Self::NoTable => "add a [table], or choose another kind",
            Self::BaseTilted { .. } => {
                "`base_rpy_deg` under [robot] turns the base; kinds are column (upright), wedge \
                 (tilted), wall, ceiling (hanging) and table_rail"
            }
            Self::BaseTooNear { .. } => {
                "see `base_position_mm` under [robot]; omit [mount] for a base bolted to the \
                 floor or the ceiling"
            }
        }
    }
}

const MILLI: f64 = 1e-3;

/// The table's frame: x along it, y across, z up; in the middle of its upper face.
pub(crate) fn world_from_table(parameters: &TableSection) -> Pose {
    let [x_mm, y_mm] = parameters.center_mm;
    Pose::from_parts(
        Translation3::new(x_mm * MILLI, y_mm * MILLI, parameters.top_height_mm * MILLI),
        turn_about_z(parameters.yaw_deg),
    )
}

/// Builds the table.
pub(crate) fn table(parameters: &TableSection) -> Fixture {
    let size_mm = Vector3::new(
        parameters.length_mm,
        parameters.width_mm,
        parameters.thickness_mm,
    );
    Fixture {
        kind: FixtureKind::Table,
        solids: vec![Solid {
            name: "table".to_owned(),
            shape: Shape::Cuboid {
                half_extents_m: 0.5 * MILLI * size_mm,
            },
            parent_from_shape: world_from_table(parameters)
                * Translation3::new(0.0, 0.0, -0.5 * MILLI * parameters.thickness_mm),
        }],
        color_rgba: [0.75, 0.78, 0.82, 1.0],
    }
}

/// Pieces of the gantry per full turn, at least.
///
/// The pieces' inner faces are chords of the bore's circle, so the obstacle reaches into the true
/// bore by the sagitta `R (1 - cos(pi / n))`: at most 0.75 mm for the standard bore. A clearance
/// against it is never optimistic.
const PIECES_PER_TURN: f64 = 48.0;

/// The gantry's frame: x along the bore, y across, z up while it is not tilted; in its isocentre.
pub(crate) fn world_from_gantry(parameters: &GantrySection) -> Pose {
    let tilt =
        UnitQuaternion::from_axis_angle(&Vector3::y_axis(), parameters.tilt_deg.to_radians());
    Pose::from_parts(
        Translation3::from(MILLI * Vector3::from(parameters.isocentre_mm)),
        turn_about_z(parameters.axis_yaw_deg) * tilt,
    )
}

/// Builds the gantry: convex wedges around the bore, each with its outer face on the housing.
pub(crate) fn gantry(parameters: &GantrySection) -> Result<Fixture, FixtureError> {
    /// Thinnest housing beside the bore, mm.
    const LEAST_MM: f64 = 20.0;

    let bore_mm = parameters.bore_diameter_mm;
    for (key, size_mm) in [
        ("outer_width_mm", parameters.outer_width_mm),
        ("outer_height_mm", parameters.outer_height_mm),
    ] {
        if size_mm < bore_mm + 2.0 * LEAST_MM {
            return Err(FixtureError::HousingTooSmall {
                key,
                size_mm,
                bore_mm,
                least_mm: LEAST_MM,
            });
        }
    }

    // Gantry frame: x along the bore, z up when not tilted. Cross-section in (y, z).
    let world_from_gantry = world_from_gantry(parameters);
    let radius_m = 0.5 * MILLI * bore_mm;
    let half_depth_m = 0.5 * MILLI * parameters.depth_mm;
    let half_m =
        0.5 * MILLI * Vector3::new(parameters.outer_width_mm, parameters.outer_height_mm, 0.0);
    let solids = sector_boundaries_rad(half_m.x, half_m.y)
        .windows(2)
        .enumerate()
        .map(|(number, angles)| {
            let ring = |angle_rad: f64| {
                let (sine, cosine) = libm::sincos(angle_rad);
                Point2::new(radius_m * cosine, radius_m * sine)
            };
            let housing = |angle_rad: f64| {
                let (sine, cosine) = libm::sincos(angle_rad);
                let reach_m = (half_m.x / cosine.abs()).min(half_m.y / sine.abs());
                Point2::new(reach_m * cosine, reach_m * sine)
            };
            // Counter-clockwise seen from +x, with y to the right and z up.
            let quadrilateral = [
                ring(angles[0]),
                housing(angles[0]),
                housing(angles[1]),
                ring(angles[1]),
            ];
            let (mesh, center) = prism(&quadrilateral, half_depth_m);
            Solid {
                name: format!("gantry.{}", number + 1),
                shape: Shape::Convex(Arc::new(mesh)),
                parent_from_shape: world_from_gantry * Translation3::new(0.0, center.x, center.y),
            }
        })
        .collect();
    Ok(Fixture {
        kind: FixtureKind::Gantry,
        solids,
        color_rgba: [0.92, 0.93, 0.94, 1.0],
    })
}

/// Angles that divide a full turn into sectors which end at the corners of a rectangle, rad.
///
/// Between two corners all sectors are equally wide, and none is wider than one piece may be.
fn sector_boundaries_rad(half_width_m: f64, half_height_m: f64) -> Vec<f64> {
    let corner_rad = libm::atan2(half_height_m, half_width_m);
    let mut boundaries_rad = vec![-corner_rad];
    for side in 0..4_u32 {
        let span_rad = if side % 2 == 0 {
            2.0 * corner_rad
        } else {
            2.0 * (FRAC_PI_2 - corner_rad)
        };
        let from_rad = *boundaries_rad.last().expect("starts with one boundary");
        let widest_rad = TAU / PIECES_PER_TURN;
        let pieces = (1..u32::MAX)
            .find(|&pieces| span_rad / f64::from(pieces) <= widest_rad)
            .expect("a side spans less than half a turn");
        boundaries_rad.extend(
            (1..=pieces).map(|piece| from_rad + span_rad * f64::from(piece) / f64::from(pieces)),
        );
    }
    boundaries_rad
}

/// Prism along x over a convex quadrilateral in (y, z), about the mean of its corners, which is
/// returned too.
fn prism(quadrilateral: &[Point2<f64>; 4], half_length_m: f64) -> (ConvexMesh, Point2<f64>) {
    let sum = quadrilateral
        .iter()
        .fold(nalgebra::Vector2::zeros(), |sum, corner| {
            sum + corner.coords
        });
    let center = Point2::from(0.25 * sum);
    let vertices_m = [-half_length_m, half_length_m]
        .into_iter()
        .flat_map(|x_m| {
            quadrilateral.map(|corner| Point3::new(x_m, corner.x - center.x, corner.y - center.y))
        })
        .collect();
    let mut triangles = vec![[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]];
    for k in 0..4 {
        let next = (k + 1) % 4;
        triangles.push([k, next, next + 4]);
        triangles.push([k, next + 4, k + 4]);
    }
    let mesh = ConvexMesh(TriangleMesh {
        vertices_m,
        triangles,
    });
    (mesh, center)
}

fn turn_about_z(angle_deg: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle_deg.to_radians())
}

#[cfg(test)]
mod tests;
