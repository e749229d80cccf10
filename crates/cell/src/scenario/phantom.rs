//! The phantom: `[phantom]`, and `[[phantom.parts]]` from the user's mesh files.

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Serialize};

use super::models::reference_schema;
use crate::schema::{LONGEST_NAME, NAME};

/// Value of `model` for a phantom of the user's parts alone.
pub(crate) const NO_MODEL: &str = "none";

/// How the phantom lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Posture {
    /// On the back.
    Supine,
    /// On the belly.
    Prone,
    /// On the left side.
    LeftLateral,
    /// On the right side.
    RightLateral,
}

/// Where the patient's arms are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Arms {
    /// Left out: nothing keeps the robot from where they would be.
    #[default]
    None,
    /// At the sides, along the body.
    Beside,
    /// Raised above the head, as for a CT of the chest.
    Overhead,
}

/// What the markers on the skin are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MarkerKind {
    /// A plastic disc, for cameras and touching: CT does not tell it from skin.
    #[default]
    Disc,
    /// The same disc on a carrier of foam that holds a dense sphere against the skin, for CT as well.
    CtSphere,
}

/// The phantom and where it lies.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PhantomSection {
    /// `male-p50-supine` or another shipped size (`male` or `female`, `p5`, `p50` or `p95`, measured in
    /// people on their backs, or without `-supine` in people upright), the path of a parameter file
    /// relative to this file, or `none` for a phantom of `parts` alone.
    #[schemars(schema_with = "models")]
    pub model: String,
    /// Breadth of the chest, mm; the model's own if left out.
    #[schemars(range(min = ChestSize::BREADTH_MM[0], max = ChestSize::BREADTH_MM[1]))]
    pub breadth_mm: Option<f64>,
    /// Depth of the chest, mm; the model's own if left out.
    #[schemars(range(min = ChestSize::DEPTH_MM[0], max = ChestSize::DEPTH_MM[1]))]
    pub depth_mm: Option<f64>,
    /// Length of the phantom, mm; the model's own if left out.
    #[schemars(range(min = ChestSize::LENGTH_MM[0], max = ChestSize::LENGTH_MM[1]))]
    pub length_mm: Option<f64>,
    /// What the markers on the skin are: `disc`, or `ct_sphere` for markers that CT sees too; the model's own if left out.
    pub markers: Option<MarkerKind>,
    /// How it lies.
    pub posture: Posture,
    /// Direction from feet to head in the world's horizontal plane: 0 is world x, 90 world y, deg.
    #[schemars(range(min = -720.0, max = 720.0))]
    pub head_yaw_deg: f64,
    /// Turn about the long axis away from the posture, deg.
    #[schemars(range(min = -720.0, max = 720.0))]
    pub body_roll_deg: f64,
    /// Lift of the head over the feet, about the horizontal axis across the patient, deg.
    #[schemars(range(min = -60.0, max = 60.0))]
    pub head_up_deg: f64,
    /// Position of the phantom's origin (mid-chest) in the world, mm. With `rest_on_table` the
    /// third number is the height of a cushion over the table.
    #[schemars(inner(range(min = -5000.0, max = 5000.0)))]
    pub position_mm: [f64; 3],
    /// Lays the lowest point of the skin on the table.
    pub rest_on_table: bool,
    /// Where the patient's arms are: `none` leaves them out, `beside` has them along the body, `overhead`
    /// above the head. They have the model's sizes and lie no lower than the chest.
    pub arms: Arms,
    /// Whether the patient has a head.
    pub head: bool,
    /// Parts from mesh files, besides the model's or in their place.
    pub parts: Vec<PartSection>,
}

impl Default for PhantomSection {
    fn default() -> Self {
        Self {
            model: "male-p50-supine".to_owned(),
            breadth_mm: None,
            depth_mm: None,
            length_mm: None,
            markers: None,
            posture: Posture::Supine,
            head_yaw_deg: 0.0,
            body_roll_deg: 0.0,
            head_up_deg: 0.0,
            position_mm: [0.0; 3],
            rest_on_table: true,
            arms: Arms::None,
            head: false,
            parts: Vec::new(),
        }
    }
}

fn models(_: &mut SchemaGenerator) -> Schema {
    reference_schema("chest_phantom", "toml", &[NO_MODEL])
}

/// Sizes that a chest can have, least and greatest: beyond the smallest and largest adults on record,
/// with room for children's and obese phantoms; they are there to catch mistakes of the unit.
pub(crate) struct ChestSize;

impl ChestSize {
    pub(crate) const BREADTH_MM: [f64; 2] = [150.0, 600.0];
    pub(crate) const DEPTH_MM: [f64; 2] = [120.0, 600.0];
    pub(crate) const LENGTH_MM: [f64; 2] = [200.0, 700.0];
}

/// Unit of a file's coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum LengthUnit {
    /// Millimetres.
    #[default]
    Mm,
    /// Centimetres.
    Cm,
    /// Metres.
    M,
    /// Inches.
    In,
}

impl LengthUnit {
    /// Metres per unit.
    pub(crate) fn metres(self) -> f64 {
        match self {
            Self::Mm => 1e-3,
            Self::Cm => 1e-2,
            Self::M => 1.0,
            Self::In => 25.4e-3,
        }
    }

    /// As in a scenario.
    pub(crate) fn key(self) -> &'static str {
        match self {
            Self::Mm => "mm",
            Self::Cm => "cm",
            Self::M => "m",
            Self::In => "in",
        }
    }
}

/// What a part from a file is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum PartTissue {
    /// The outer surface, which the arm must not touch; there is one.
    Skin,
    /// Bone: the needle keeps away from it.
    Bone,
    /// Artery or vein: the needle keeps away from it.
    Vessel,
    /// Organ: the needle keeps away from it, unless its target is inside.
    Organ,
    /// Lung: as any organ.
    Lung,
    /// A target, which goals name.
    Lesion,
}

/// A part of the phantom from a mesh file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PartSection {
    /// Name in reports, and of a lesion in goals: letters, digits, `-` and `_`.
    #[schemars(regex(pattern = NAME), length(max = LONGEST_NAME))]
    pub name: String,
    /// STL, OBJ or COLLADA (`.dae`) file, relative to this file: a closed surface, its triangles
    /// counter-clockwise seen from outside.
    pub file: String,
    /// What it is made of.
    pub tissue: PartTissue,
    /// Unit of the file's coordinates: `mm`, `cm`, `m` or `in`. Default mm; COLLADA states its own.
    /// A size that such a part cannot have is refused.
    #[serde(default)]
    pub unit: LengthUnit,
    /// Where the file's origin is in the phantom frame (left, posterior, superior), mm.
    #[serde(default)]
    #[schemars(inner(range(min = -10_000.0, max = 10_000.0)))]
    pub position_mm: [f64; 3],
    /// Roll, pitch and yaw of the file's axes in the phantom frame, deg. A file in the axes
    /// right, anterior, superior needs [0, 0, 180].
    #[serde(default)]
    #[schemars(inner(range(min = -720.0, max = 720.0)))]
    pub rpy_deg: [f64; 3],
    /// Turns a surface that is inside out round.
    #[serde(default)]
    pub flip: bool,
    /// Parts of the model that it stands for: their names, their structures (`rib_left_4`,
    /// `spine`), or whole tissues (`skin`, `bone`, `vessel`, `organ`, `lesion`, `marker`).
    #[serde(default)]
    pub replaces: Vec<String>,
}
