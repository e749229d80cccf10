//! What stands around the robot and the phantom: CT table, CT gantry and the robot's mount.
//!
//! Each is built in the world frame (z up, floor at z = 0) from convex solids.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::sync::Arc;

use nalgebra::{Point2, Point3, Translation3, UnitQuaternion, Vector3};
use needlebench_kinematics::Pose;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::shape::{ConvexMesh, Shape, Solid, TriangleMesh};

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
}

/// One rigid thing that does not move.
#[derive(Debug, Clone, PartialEq)]
pub struct Fixture {
    /// Which one.
    pub kind: FixtureKind,
    /// Convex solids, world frame.
    pub solids: Vec<Solid>,
    /// Red, green, blue, opacity, each 0 to 1 (sRGB).
    pub color_rgba: [f32; 4],
}

/// Why a fixture cannot be built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FixtureError {
    /// A value is NaN or infinite.
    #[error("{key} is {value}: not a finite number")]
    NotFinite {
        /// Key, with its unit.
        key: &'static str,
        /// The value given.
        value: f64,
    },
    /// A value is outside what such a fixture can have.
    #[error("{key} is {value}, outside [{lower}, {upper}]{hint}")]
    OutOfRange {
        /// Key, with its unit.
        key: &'static str,
        /// The value given.
        value: f64,
        /// Smallest value allowed, in the key's unit.
        lower: f64,
        /// Largest value allowed, in the key's unit.
        upper: f64,
        /// Empty, or a question about the unit that may have been meant.
        hint: &'static str,
    },
    /// The housing does not enclose the bore.
    #[error(
        "{key} is {size_mm} mm, which leaves less than {least_mm} mm of housing beside a bore of \
         {bore_mm} mm"
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
    /// A mount stands on the floor and needs a robot that stands upright.
    #[error(
        "the robot's base is tilted by {tilt_deg:.3} deg: a mount carries an upright base only \
         (leave the mount out for a robot on a wall or a ceiling)"
    )]
    BaseTilted {
        /// Angle between the base's z axis and the vertical, deg.
        tilt_deg: f64,
    },
    /// The base is on or below the floor.
    #[error(
        "the robot's base is {height_mm:.1} mm above the floor, less than the mount's plate of \
         {plate_mm} mm (leave the mount out for a base on the floor)"
    )]
    BaseTooLow {
        /// Height of `base_link` above world z = 0, mm.
        height_mm: f64,
        /// Thickness of the base plate, mm.
        plate_mm: f64,
    },
}

impl FixtureError {
    /// The key it is about, without its section; none if it is about the robot's base.
    pub(crate) fn key(&self) -> Option<&'static str> {
        match self {
            Self::NotFinite { key, .. }
            | Self::OutOfRange { key, .. }
            | Self::HousingTooSmall { key, .. } => Some(key),
            Self::BaseTilted { .. } | Self::BaseTooLow { .. } => None,
        }
    }
}

/// The CT table: one box.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TableParameters {
    /// Width across the long axis, mm. Default 420 (assumed; 400 to 430 is typical).
    pub width_mm: f64,
    /// Length along the long axis, mm. Default 2000 (assumed).
    pub length_mm: f64,
    /// Thickness, mm. Default 60 (assumed).
    pub thickness_mm: f64,
    /// Height of the upper face in the world, mm. Default 800 (assumed).
    pub top_height_mm: f64,
    /// Centre of the upper face in the world (x, y), mm. Default the origin.
    pub center_mm: [f64; 2],
    /// Direction of the long axis about world z; 0 is world x, deg. Default 0.
    pub yaw_deg: f64,
}

impl Default for TableParameters {
    fn default() -> Self {
        Self {
            width_mm: 420.0,
            length_mm: 2000.0,
            thickness_mm: 60.0,
            top_height_mm: 800.0,
            center_mm: [0.0, 0.0],
            yaw_deg: 0.0,
        }
    }
}

/// The CT gantry: a box with a cylindrical bore through it, centred on the isocentre.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GantryParameters {
    /// Diameter of the bore, mm. Default 700, the standard bore (wide bores: 800 and more).
    pub bore_diameter_mm: f64,
    /// Width of the housing, horizontal and across the bore, mm. Default 2300.
    pub outer_width_mm: f64,
    /// Height of the housing, mm. Default 1800.
    pub outer_height_mm: f64,
    /// Depth of the housing along the bore, mm. Default 800.
    pub depth_mm: f64,
    /// Centre of the bore in the world, mm. Default 900 above the floor (assumed: half the
    /// housing's height).
    pub isocentre_mm: [f64; 3],
    /// Direction of the bore's axis about world z; 0 is world x, deg. Default 0.
    pub axis_yaw_deg: f64,
    /// Tilt about the horizontal axis across the bore, deg; positive moves the top towards the
    /// direction of the bore's axis. Scanners tilt by up to 30. Default 0.
    pub tilt_deg: f64,
}

impl Default for GantryParameters {
    fn default() -> Self {
        Self {
            bore_diameter_mm: 700.0,
            outer_width_mm: 2300.0,
            outer_height_mm: 1800.0,
            depth_mm: 800.0,
            isocentre_mm: [0.0, 0.0, 900.0],
            axis_yaw_deg: 0.0,
            tilt_deg: 0.0,
        }
    }
}

/// The robot's mount: a column on the floor with a base plate, aligned with `base_link`.
///
/// The plate's upper face is the plane z = 0 of `base_link`, so robot and mount touch.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MountParameters {
    /// Size of the column along `base_link` x, mm. Default 120 (assumed).
    pub width_mm: f64,
    /// Size of the column along `base_link` y, mm. Default 120 (assumed).
    pub depth_mm: f64,
    /// Edge of the square base plate, mm. Default 160 (assumed; the base's foot is 128 wide).
    pub plate_width_mm: f64,
    /// Thickness of the base plate, mm. Default 15 (assumed).
    pub plate_thickness_mm: f64,
}

impl Default for MountParameters {
    fn default() -> Self {
        Self {
            width_mm: 120.0,
            depth_mm: 120.0,
            plate_width_mm: 160.0,
            plate_thickness_mm: 15.0,
        }
    }
}

const MILLI: f64 = 1e-3;
/// Largest coordinate of a fixture in the world: a large room.
const ROOM_MM: f64 = 20_000.0;

/// Builds the table.
pub fn table(parameters: &TableParameters) -> Result<Fixture, FixtureError> {
    let [x_mm, y_mm] = parameters.center_mm;
    check(&[
        ("width_mm", parameters.width_mm, 100.0, 2000.0),
        ("length_mm", parameters.length_mm, 300.0, 5000.0),
        ("thickness_mm", parameters.thickness_mm, 5.0, 500.0),
        ("top_height_mm", parameters.top_height_mm, -ROOM_MM, ROOM_MM),
        ("center_mm", x_mm, -ROOM_MM, ROOM_MM),
        ("center_mm", y_mm, -ROOM_MM, ROOM_MM),
        ("yaw_deg", parameters.yaw_deg, -360.0, 360.0),
    ])?;
    let center_mm = Vector3::new(
        x_mm,
        y_mm,
        parameters.top_height_mm - 0.5 * parameters.thickness_mm,
    );
    let size_mm = Vector3::new(
        parameters.length_mm,
        parameters.width_mm,
        parameters.thickness_mm,
    );
    Ok(Fixture {
        kind: FixtureKind::Table,
        solids: vec![Solid {
            name: "table".to_owned(),
            shape: Shape::Cuboid {
                half_extents_m: 0.5 * MILLI * size_mm,
            },
            parent_from_shape: Pose::from_parts(
                Translation3::from(MILLI * center_mm),
                turn_about_z(parameters.yaw_deg),
            ),
        }],
        color_rgba: [0.75, 0.78, 0.82, 1.0],
    })
}

/// Pieces of the gantry per full turn, at least.
///
/// The pieces' inner faces are chords of the bore's circle, so the obstacle reaches into the true
/// bore by the sagitta `R (1 - cos(pi / n))`: at most 0.75 mm for the standard bore. A clearance
/// against it is never optimistic.
const PIECES_PER_TURN: f64 = 48.0;

/// Builds the gantry: convex wedges around the bore, each with its outer face on the housing.
pub fn gantry(parameters: &GantryParameters) -> Result<Fixture, FixtureError> {
    /// Thinnest housing beside the bore, mm.
    const LEAST_MM: f64 = 20.0;

    check(&[
        (
            "bore_diameter_mm",
            parameters.bore_diameter_mm,
            300.0,
            2000.0,
        ),
        ("outer_width_mm", parameters.outer_width_mm, 300.0, 5000.0),
        ("outer_height_mm", parameters.outer_height_mm, 300.0, 5000.0),
        ("depth_mm", parameters.depth_mm, 50.0, 3000.0),
        (
            "isocentre_mm",
            parameters.isocentre_mm[0],
            -ROOM_MM,
            ROOM_MM,
        ),
        (
            "isocentre_mm",
            parameters.isocentre_mm[1],
            -ROOM_MM,
            ROOM_MM,
        ),
        (
            "isocentre_mm",
            parameters.isocentre_mm[2],
            -ROOM_MM,
            ROOM_MM,
        ),
        ("axis_yaw_deg", parameters.axis_yaw_deg, -360.0, 360.0),
        ("tilt_deg", parameters.tilt_deg, -45.0, 45.0),
    ])?;
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
    let tilt =
        UnitQuaternion::from_axis_angle(&Vector3::y_axis(), parameters.tilt_deg.to_radians());
    let world_from_gantry = Pose::from_parts(
        Translation3::from(MILLI * Vector3::from(parameters.isocentre_mm)),
        turn_about_z(parameters.axis_yaw_deg) * tilt,
    );
    let radius_m = 0.5 * MILLI * bore_mm;
    let half_depth_m = 0.5 * MILLI * parameters.depth_mm;
    let half_m =
        0.5 * MILLI * Vector3::new(parameters.outer_width_mm, parameters.outer_height_mm, 0.0);
    let solids = sector_boundaries_rad(half_m.x, half_m.y)
        .windows(2)
        .enumerate()
        .map(|(number, angles)| {
            let ring = |angle_rad: f64| {
                let (sine, cosine) = angle_rad.sin_cos();
                Point2::new(radius_m * cosine, radius_m * sine)
            };
            let housing = |angle_rad: f64| {
                let (sine, cosine) = angle_rad.sin_cos();
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
    let corner_rad = half_height_m.atan2(half_width_m);
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

/// Builds the mount under a robot whose base is at `world_from_base_link`.
pub fn mount(
    parameters: &MountParameters,
    world_from_base_link: &Pose,
) -> Result<Fixture, FixtureError> {
    /// Tilt of a base that counts as upright: rounding of a pose given in degrees.
    const UPRIGHT_RAD: f64 = 1e-6;
    /// A column shorter than this is left out.
    const SHORTEST_COLUMN_M: f64 = 1e-3;

    check(&[
        ("width_mm", parameters.width_mm, 20.0, 3000.0),
        ("depth_mm", parameters.depth_mm, 20.0, 3000.0),
        ("plate_width_mm", parameters.plate_width_mm, 20.0, 3000.0),
        (
            "plate_thickness_mm",
            parameters.plate_thickness_mm,
            1.0,
            200.0,
        ),
    ])?;
    let up = world_from_base_link.rotation * Vector3::z();
    let tilt_rad = up.x.hypot(up.y).atan2(up.z);
    if tilt_rad > UPRIGHT_RAD {
        return Err(FixtureError::BaseTilted {
            tilt_deg: tilt_rad.to_degrees(),
        });
    }
    let height_m = world_from_base_link.translation.z;
    let plate_m = MILLI * parameters.plate_thickness_mm;
    if height_m < plate_m {
        return Err(FixtureError::BaseTooLow {
            height_mm: height_m / MILLI,
            plate_mm: parameters.plate_thickness_mm,
        });
    }

    // A box whose upper face is at a depth below the base.
    let slab = |name: &str, size_x_m: f64, size_y_m: f64, top_m: f64, thickness_m: f64| Solid {
        name: name.to_owned(),
        shape: Shape::Cuboid {
            half_extents_m: 0.5 * Vector3::new(size_x_m, size_y_m, thickness_m),
        },
        parent_from_shape: world_from_base_link
            * Translation3::new(0.0, 0.0, -top_m - 0.5 * thickness_m),
    };
    let plate_width_m = MILLI * parameters.plate_width_mm;
    let mut solids = vec![slab(
        "mount.plate",
        plate_width_m,
        plate_width_m,
        0.0,
        plate_m,
    )];
    let column_m = height_m - plate_m;
    if column_m >= SHORTEST_COLUMN_M {
        let (width_m, depth_m) = (MILLI * parameters.width_mm, MILLI * parameters.depth_mm);
        solids.push(slab("mount.column", width_m, depth_m, plate_m, column_m));
    }
    Ok(Fixture {
        kind: FixtureKind::Mount,
        solids,
        color_rgba: [0.35, 0.37, 0.40, 1.0],
    })
}

fn turn_about_z(angle_deg: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle_deg.to_radians())
}

/// Checks keys with their values and bounds, in order.
fn check(values: &[(&'static str, f64, f64, f64)]) -> Result<(), FixtureError> {
    for &(key, value, lower, upper) in values {
        if !value.is_finite() {
            return Err(FixtureError::NotFinite { key, value });
        }
        if !(lower..=upper).contains(&value) {
            let fits = |factor: f64| {
                key.ends_with("_mm") && lower > 0.0 && (lower..=upper).contains(&(value * factor))
            };
            let hint = if fits(1000.0) {
                ": did you give metres?"
            } else if fits(10.0) {
                ": did you give centimetres?"
            } else {
                ""
            };
            return Err(FixtureError::OutOfRange {
                key,
                value,
                lower,
                upper,
                hint,
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
