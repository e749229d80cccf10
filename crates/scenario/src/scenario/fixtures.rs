//! Fixtures around the robot and the phantom: `[table]`, `[gantry]` and `[mount]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The CT table: a box.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TableSection {
    /// Width across the long axis, mm. Default 420 (assumed; 400 to 430 is typical).
    #[schemars(range(min = 100.0, max = 2000.0))]
    pub width_mm: f64,
    /// Length along the long axis, mm. Default 2000 (assumed).
    #[schemars(range(min = 300.0, max = 5000.0))]
    pub length_mm: f64,
    /// Thickness, mm. Default 60 (assumed).
    #[schemars(range(min = 5.0, max = 500.0))]
    pub thickness_mm: f64,
    /// Height of the upper face above the floor, mm. Default 800 (assumed).
    #[schemars(range(min = 100.0, max = 2000.0))]
    pub top_height_mm: f64,
    /// Centre of the upper face in the world (x, y), mm. Default: the origin.
    #[schemars(inner(range(min = -20_000.0, max = 20_000.0)))]
    pub center_mm: [f64; 2],
    /// Direction of the long axis about world z, deg; 0 is world x. Default 0.
    #[schemars(range(min = -360.0, max = 360.0))]
    pub yaw_deg: f64,
}

impl Default for TableSection {
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
pub struct GantrySection {
    /// Diameter of the bore, mm. Default 700, the standard bore (wide bores: 800 and more).
    #[schemars(range(min = 300.0, max = 2000.0))]
    pub bore_diameter_mm: f64,
    /// Width of the housing, horizontal and across the bore, mm. Default 2300.
    #[schemars(range(min = 300.0, max = 5000.0))]
    pub outer_width_mm: f64,
    /// Height of the housing, mm. Default 1800.
    #[schemars(range(min = 300.0, max = 5000.0))]
    pub outer_height_mm: f64,
    /// Depth of the housing along the bore, mm. Default 800.
    #[schemars(range(min = 50.0, max = 3000.0))]
    pub depth_mm: f64,
    /// Isocentre in the world, mm. Default 900 above the floor (assumed: half the height of the housing).
    #[schemars(inner(range(min = -20_000.0, max = 20_000.0)))]
    pub isocentre_mm: [f64; 3],
    /// Direction of the bore axis about world z, deg; 0 is world x. Default 0.
    #[schemars(range(min = -360.0, max = 360.0))]
    pub axis_yaw_deg: f64,
    /// Tilt about the horizontal axis across the bore, deg; positive moves the top in the direction of the bore axis.
    /// Scanners tilt by up to 30. Default 0.
    #[schemars(range(min = -45.0, max = 45.0))]
    pub tilt_deg: f64,
}

impl Default for GantrySection {
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

/// Type of the robot mount.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MountKind {
    /// A floor column under an upright base.
    #[default]
    Column,
    /// A floor column with a wedge, for a base tilted by up to 90 deg.
    Wedge,
    /// A post clamped to the side rail of the table; requires a `[table]`.
    TableRail,
    /// A wall bracket; the z axis of the base points away from the wall.
    Wall,
    /// A ceiling column; the base hangs upside down.
    Ceiling,
}

/// Mount of the robot: a plate under its foot, and a column, post or bracket.
///
/// The plate's face is the plane z = 0 of `base_link`, so robot and mount touch. A wedge is added where the base is not
/// perpendicular to its support. Lengths across the column are along x and y of `base_link`, projected along the
/// column.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MountSection {
    /// Type of mount: `column`, `wedge`, `table_rail`, `wall` or `ceiling`. Default: `column`.
    pub kind: MountKind,
    /// Size of the column, post or bracket along `base_link` x, mm. Default 120 (assumed).
    #[schemars(range(min = 20.0, max = 3000.0))]
    pub width_mm: f64,
    /// Size of the column, post or bracket along `base_link` y, mm. Default 120 (assumed).
    #[schemars(range(min = 20.0, max = 3000.0))]
    pub depth_mm: f64,
    /// Edge of the square base plate, mm. Default 160 (assumed; the foot of the base is 128 wide).
    #[schemars(range(min = 20.0, max = 3000.0))]
    pub plate_width_mm: f64,
    /// Thickness of the base plate, mm. Default 15 (assumed).
    #[schemars(range(min = 1.0, max = 200.0))]
    pub plate_thickness_mm: f64,
    /// Offset of the column from the base along `base_link` x and y, mm; a horizontal arm connects both. Default: none,
    /// the column is centred on the base. Not for `table_rail` and `wall`.
    #[schemars(inner(range(min = -3000.0, max = 3000.0)))]
    pub column_offset_mm: [f64; 2],
    /// Thickness of the horizontal arm from the column, or from the post of a rail, mm. Default 60 (assumed).
    #[schemars(range(min = 5.0, max = 500.0))]
    pub arm_thickness_mm: f64,
    /// Distance from the centre of the plate's back to the end of the wedge, if any, mm. Default 150 (assumed).
    #[schemars(range(min = 5.0, max = 2000.0))]
    pub wedge_height_mm: f64,
    /// Length of the bracket between wall and plate (or wedge), mm. Default 0: bolted to the wall.
    #[schemars(range(min = 0.0, max = 3000.0))]
    pub bracket_mm: f64,
    /// Height of the ceiling above the floor, mm. Default 2800 (assumed).
    #[schemars(range(min = 1000.0, max = 10_000.0))]
    pub ceiling_height_mm: f64,
    /// Edge of the square of wall or ceiling around the robot that is modelled, mm. Default 3000: more than
    /// twice the reach of the longest shipped arm with a tool.
    #[schemars(range(min = 100.0, max = 10_000.0))]
    pub surface_mm: f64,
    /// Length of the table rail, centred on the post, mm. Default 500 (assumed).
    #[schemars(range(min = 50.0, max = 5000.0))]
    pub rail_length_mm: f64,
}

impl Default for MountSection {
    fn default() -> Self {
        Self {
            kind: MountKind::Column,
            width_mm: 120.0,
            depth_mm: 120.0,
            plate_width_mm: 160.0,
            plate_thickness_mm: 15.0,
            column_offset_mm: [0.0; 2],
            arm_thickness_mm: 60.0,
            wedge_height_mm: 150.0,
            bracket_mm: 0.0,
            ceiling_height_mm: 2800.0,
            surface_mm: 3000.0,
            rail_length_mm: 500.0,
        }
    }
}
