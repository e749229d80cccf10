//! The phantom: `[phantom]`, and `[[phantom.parts]]` from the user's mesh files.

use needlebench_input::schema::{LONGEST_NAME, NAME};
use needlebench_phantom::{Arms, ChestSize, MarkerKind};
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Serialize};

use super::models::reference_schema;

/// Value of `model` for a phantom that consists of the user's parts only.
pub(crate) const NO_MODEL: &str = "none";

/// Patient position.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Posture {
    /// Supine: on the back.
    Supine,
    /// Prone: face down.
    Prone,
    /// Left lateral decubitus: on the left side.
    LeftLateral,
    /// Right lateral decubitus: on the right side.
    RightLateral,
}

/// The phantom and its pose.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PhantomSection {
    /// A shipped size such as `male-p50-supine` (`male` or `female`; `p5`, `p50` or `p95`; measured on people lying
    /// supine, or without `-supine` on people upright), the path of a parameter file relative to this file, or `none`
    /// for a phantom of `parts` only.
    #[schemars(schema_with = "models")]
    pub model: String,
    /// Chest breadth, mm. Default: the model's.
    #[schemars(range(min = ChestSize::BREADTH_MM[0], max = ChestSize::BREADTH_MM[1]))]
    pub breadth_mm: Option<f64>,
    /// Chest depth, mm. Default: the model's.
    #[schemars(range(min = ChestSize::DEPTH_MM[0], max = ChestSize::DEPTH_MM[1]))]
    pub depth_mm: Option<f64>,
    /// Length of the phantom, mm. Default: the model's.
    #[schemars(range(min = ChestSize::LENGTH_MM[0], max = ChestSize::LENGTH_MM[1]))]
    pub length_mm: Option<f64>,
    /// Type of the skin markers: `disc`, or `ct_sphere` for markers also visible in CT. Default: the model's.
    pub markers: Option<MarkerKind>,
    /// Patient position: `supine`, `prone`, `left-lateral` or `right-lateral`.
    pub posture: Posture,
    /// Direction from feet to head in the world's horizontal plane, deg: 0 is world x, 90 world y.
    #[schemars(range(min = -720.0, max = 720.0))]
    pub head_yaw_deg: f64,
    /// Rotation about the long axis, relative to the patient position, deg.
    #[schemars(range(min = -720.0, max = 720.0))]
    pub body_roll_deg: f64,
    /// Tilt about the horizontal transverse axis, deg; positive raises the head.
    #[schemars(range(min = -60.0, max = 60.0))]
    pub head_up_deg: f64,
    /// Position of the phantom's origin (mid-chest) in the world, mm. With `rest_on_table` the third number is the
    /// height of a cushion on the table.
    #[schemars(inner(range(min = -5000.0, max = 5000.0)))]
    pub position_mm: [f64; 3],
    /// Places the lowest point of the skin on the table.
    pub rest_on_table: bool,
    /// Position of the patient's arms: `none` (not modelled), `beside` the body, or `overhead`. They have the model's
    /// sizes and are never lower than the chest.
    pub arms: Arms,
    /// Whether the head is modelled.
    pub head: bool,
    /// Parts from mesh files, in addition to the model's or replacing them.
    pub parts: Vec<PartSection>,
    /// Planes at which the scan ends that the parts are from.
    pub cuts: Vec<CutSection>,
    /// The build that the patient is of; none where the parts are not from `ct build`.
    pub build: Option<BuildSection>,
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
            cuts: Vec::new(),
            build: None,
        }
    }
}

/// The build that a patient is of. What was made of one build, such as a plan, is rejected once the folder has another.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BuildSection {
    /// The folder's `report.json`, relative to this file.
    pub report: String,
    /// SHA-256 of that report, lower-case hexadecimal.
    #[schemars(length(max = 64))]
    pub sha256: String,
}

/// A plane at which a scan ends. The surface beyond it is the cut through the body and no skin: nothing enters there, and
/// a clearance is not evaluated where the unseen body may be nearer, which is assumed to go straight on behind the cut.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CutSection {
    /// Direction away from what was scanned, phantom frame (left, posterior, superior); of any length but 0.
    #[schemars(inner(range(min = -1.0, max = 1.0)))]
    pub normal: [f64; 3],
    /// Distance of the plane from the phantom's origin along the normal, mm.
    #[schemars(range(min = -10_000.0, max = 10_000.0))]
    pub offset_mm: f64,
    /// How far behind the plane parts with `tissue = "assumed"` stand for the body, mm: clearances are evaluated
    /// against these there, and the body may go straight on from where they end. Default: nothing is assumed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1.0, max = 2000.0))]
    pub assumed_mm: Option<f64>,
}

fn models(_: &mut SchemaGenerator) -> Schema {
    reference_schema("chest_phantom", "toml", &[NO_MODEL])
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

    /// Its key in a scenario.
    pub(crate) fn key(self) -> &'static str {
        match self {
            Self::Mm => "mm",
            Self::Cm => "cm",
            Self::M => "m",
            Self::In => "in",
        }
    }
}

/// Tissue of a part from a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum PartTissue {
    /// The outer surface, an obstacle for the arm; exactly one.
    Skin,
    /// Bone: avoided by the needle.
    Bone,
    /// Artery or vein: avoided by the needle.
    Vessel,
    /// Organ: avoided by the needle, unless the target is inside.
    Organ,
    /// Lung: as an organ.
    Lung,
    /// A target that goals refer to.
    Lesion,
    /// Beside the patient in the scan: an arm, the couch, a cushion. It moves with the patient and counts as the
    /// patient in clearances; no needle passes through it.
    Beside,
    /// Body that no scan shows and that is assumed behind one of its `cuts`. It moves with the patient and counts as
    /// the patient in clearances; no needle passes through it.
    Assumed,
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
    /// Tissue: `skin`, `bone`, `vessel`, `organ`, `lung`, `lesion`, `beside` or `assumed`.
    pub tissue: PartTissue,
    /// Unit of the file's coordinates: `mm`, `cm`, `m` or `in`. Default mm; COLLADA files state their own unit. An
    /// implausible size is rejected.
    #[serde(default)]
    pub unit: LengthUnit,
    /// Position of the file's origin in the phantom frame (left, posterior, superior), mm.
    #[serde(default)]
    #[schemars(inner(range(min = -10_000.0, max = 10_000.0)))]
    pub position_mm: [f64; 3],
    /// Roll, pitch and yaw of the file's axes in the phantom frame, deg. A file with axes right, anterior, superior
    /// needs [0, 0, 180].
    #[serde(default)]
    #[schemars(inner(range(min = -720.0, max = 720.0)))]
    pub rpy_deg: [f64; 3],
    /// Reverses the orientation of an inside-out surface.
    #[serde(default)]
    pub flip: bool,
    /// Parts of the model that it replaces: their names, their structures (`rib_left_4`, `spine`), or whole tissues
    /// (`skin`, `bone`, `vessel`, `organ`, `lesion`, `marker`).
    #[serde(default)]
    pub replaces: Vec<String>,
}
