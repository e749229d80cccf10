//! Parameters of the chest phantom, their ranges and the shipped presets.

use std::collections::BTreeSet;
use std::sync::LazyLock;

use needlebench_input::schema::{FileSchema, LONGEST_NAME, NAME};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::PhantomError;

/// What a parameter file may hold.
pub static PARAMETERS: LazyLock<FileSchema> = LazyLock::new(FileSchema::of::<PhantomParameters>);

/// Position of the people on whom a phantom's breadth and depth were measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Measured {
    /// Upright, as in surveys of body sizes.
    Standing,
    /// Supine, as in CT.
    Supine,
}

/// Position of the patient's arms.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Arms {
    /// Not modelled: the robot may pass through the space of the arms.
    #[default]
    None,
    /// At the sides, along the body.
    Beside,
    /// Raised above the head, as for a chest CT.
    Overhead,
}

/// Type of the skin markers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MarkerKind {
    /// A plastic disc, for cameras and digitising; isodense with skin in CT.
    #[default]
    Disc,
    /// The same disc on a foam carrier with a dense sphere on the skin, also visible in CT.
    CtSphere,
}

/// Minimum and maximum chest sizes: beyond the smallest and largest adults on record, with margin for children's and
/// obese phantoms; they catch wrong units.
pub struct ChestSize;

impl ChestSize {
    /// Breadth, mm.
    pub const BREADTH_MM: [f64; 2] = [150.0, 600.0];
    /// Depth, mm.
    pub const DEPTH_MM: [f64; 2] = [120.0, 600.0];
    /// Length, mm.
    pub const LENGTH_MM: [f64; 2] = [200.0, 700.0];
}

/// Size and contents of a chest phantom.
///
/// Positions are in the `phantom` frame: anatomical LPS (x to the patient's left, y posterior, z
/// towards the head), origin in the mid-sagittal plane at half depth and half length.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PhantomParameters {
    /// Position of the people on whom breadth and depth were measured. Default: not stated.
    #[serde(default)]
    pub measured: Option<Measured>,
    /// Breadth of the chest over the skin at its widest level, left to right, without arms, mm.
    #[schemars(range(min = ChestSize::BREADTH_MM[0], max = ChestSize::BREADTH_MM[1]))]
    pub breadth_mm: f64,
    /// Depth of the chest over the skin at its widest level, front to back, mm.
    #[schemars(range(min = ChestSize::DEPTH_MM[0], max = ChestSize::DEPTH_MM[1]))]
    pub depth_mm: f64,
    /// Length of the phantom along the body, mm. The suprasternal notch lies 60 mm (of 408) below
    /// its upper end and the lowest point of the tenth rib 30 mm above its lower end.
    #[schemars(range(min = ChestSize::LENGTH_MM[0], max = ChestSize::LENGTH_MM[1]))]
    pub length_mm: f64,
    /// Skin to pleura in the second intercostal space on the mid-clavicular line, along the
    /// front-to-back direction, mm.
    #[serde(default = "default_chest_wall_mm")]
    #[schemars(range(min = 15.0, max = 150.0))]
    pub chest_wall_mm: f64,
    /// Skin to pleura at the side, mm.
    #[serde(default = "default_lateral_wall_mm")]
    #[schemars(range(min = 15.0, max = 150.0))]
    pub lateral_wall_mm: f64,
    /// Skin to pleura at the back, beside the spine, mm.
    #[serde(default = "default_posterior_wall_mm")]
    #[schemars(range(min = 15.0, max = 150.0))]
    pub posterior_wall_mm: f64,
    /// Height of a rib, and of a costal cartilage, along the chest wall, mm.
    #[serde(default = "default_rib_height_mm")]
    #[schemars(range(min = 4.0, max = 25.0))]
    pub rib_height_mm: f64,
    /// Thickness of a rib, and of a costal cartilage, across the chest wall, mm.
    #[serde(default = "default_rib_thickness_mm")]
    #[schemars(range(min = 2.0, max = 16.0))]
    pub rib_thickness_mm: f64,
    /// Width of the body of the sternum, mm.
    #[serde(default = "default_sternum_width_mm")]
    #[schemars(range(min = 15.0, max = 70.0))]
    pub sternum_width_mm: f64,
    /// Thickness of the sternum, mm.
    #[serde(default = "default_sternum_thickness_mm")]
    #[schemars(range(min = 4.0, max = 20.0))]
    pub sternum_thickness_mm: f64,
    /// Diameter of a thoracic vertebral body, mm.
    #[serde(default = "default_vertebra_diameter_mm")]
    #[schemars(range(min = 15.0, max = 50.0))]
    pub vertebra_diameter_mm: f64,
    /// Diameter of a marker disc, mm.
    #[serde(default = "default_marker_diameter_mm")]
    #[schemars(range(min = 5.0, max = 40.0))]
    pub marker_diameter_mm: f64,
    /// Thickness of a marker disc, mm.
    #[serde(default = "default_marker_thickness_mm")]
    #[schemars(range(min = 0.2, max = 5.0))]
    pub marker_thickness_mm: f64,
    /// `disc`, or `ct_sphere` for markers that are also visible in CT.
    #[serde(default)]
    pub marker_kind: MarkerKind,
    /// Diameter of the sphere of `ct_sphere` markers, mm; their discs lie so much higher above the skin.
    #[serde(default = "default_marker_sphere_mm")]
    #[schemars(range(min = 3.0, max = 15.0))]
    pub marker_sphere_mm: f64,
    /// Head and arms, for scenarios that have them.
    #[serde(default)]
    pub limbs: LimbSizes,
    /// Lesions. Default: none.
    #[serde(default)]
    pub lesions: Vec<LesionParameters>,
    /// Skin markers. Default: none.
    #[serde(default)]
    pub markers: Vec<MarkerParameters>,
}

/// Sizes of head and arms. Default: those of the median man (ANSUR II).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LimbSizes {
    /// Greatest breadth of the head above the ears, mm.
    #[schemars(range(min = 100.0, max = 220.0))]
    pub head_breadth_mm: f64,
    /// Greatest length of the head, forehead to occiput, mm.
    #[schemars(range(min = 120.0, max = 280.0))]
    pub head_length_mm: f64,
    /// From the suprasternal notch to the top of the head along the body, mm.
    #[schemars(range(min = 180.0, max = 450.0))]
    pub notch_to_vertex_mm: f64,
    /// Circumference of the neck, mm.
    #[schemars(range(min = 200.0, max = 700.0))]
    pub neck_circumference_mm: f64,
    /// Breadth over the deltoid muscles, arms down, mm.
    #[schemars(range(min = 250.0, max = 800.0))]
    pub shoulder_breadth_mm: f64,
    /// Top of the shoulder to elbow, mm.
    #[schemars(range(min = 180.0, max = 480.0))]
    pub upper_arm_length_mm: f64,
    /// Elbow to wrist, mm.
    #[schemars(range(min = 140.0, max = 400.0))]
    pub forearm_length_mm: f64,
    /// Wrist to the tip of the middle finger, mm.
    #[schemars(range(min = 100.0, max = 280.0))]
    pub hand_length_mm: f64,
    /// Greatest circumference of the upper arm, mm.
    #[schemars(range(min = 150.0, max = 700.0))]
    pub upper_arm_circumference_mm: f64,
    /// Greatest circumference of the forearm, mm.
    #[schemars(range(min = 130.0, max = 600.0))]
    pub forearm_circumference_mm: f64,
}

impl Default for LimbSizes {
    fn default() -> Self {
        Self {
            head_breadth_mm: 154.0,
            head_length_mm: 200.0,
            notch_to_vertex_mm: 318.0,
            neck_circumference_mm: 395.0,
            shoulder_breadth_mm: 509.0,
            upper_arm_length_mm: 335.0,
            forearm_length_mm: 267.0,
            hand_length_mm: 193.0,
            upper_arm_circumference_mm: 357.0,
            forearm_circumference_mm: 310.0,
        }
    }
}

/// A spherical lesion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LesionParameters {
    /// Name, unique among lesions: letters, digits, `_` and `-`.
    #[schemars(regex(pattern = NAME), length(max = LONGEST_NAME))]
    pub name: String,
    /// Centre in the phantom frame (left, posterior, superior), mm.
    #[schemars(inner(range(min = -500.0, max = 500.0)))]
    pub center_mm: [f64; 3],
    /// Diameter, mm.
    #[schemars(range(min = 1.0, max = 150.0))]
    pub diameter_mm: f64,
}

/// A black-and-white disc on the skin, placed by a horizontal ray from the phantom's z axis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MarkerParameters {
    /// Name, unique among markers: letters, digits, `_` and `-`.
    #[schemars(regex(pattern = NAME), length(max = LONGEST_NAME))]
    pub name: String,
    /// Direction about z: 0 is anterior, 90 the patient's left, -90 the patient's right, deg.
    #[schemars(range(min = -180.0, max = 180.0))]
    pub azimuth_deg: f64,
    /// Height in the phantom frame (z), mm.
    #[schemars(range(min = -500.0, max = 500.0))]
    pub height_mm: f64,
}

// Defaults of the keys that a parameter file may leave out. Sources: models/chest_phantom.

fn default_chest_wall_mm() -> f64 {
    42.4
}
fn default_lateral_wall_mm() -> f64 {
    30.0
}
fn default_posterior_wall_mm() -> f64 {
    35.0
}
fn default_rib_height_mm() -> f64 {
    13.5
}
fn default_rib_thickness_mm() -> f64 {
    7.0
}
fn default_sternum_width_mm() -> f64 {
    38.0
}
fn default_sternum_thickness_mm() -> f64 {
    11.0
}
fn default_vertebra_diameter_mm() -> f64 {
    32.0
}
fn default_marker_diameter_mm() -> f64 {
    18.0
}
fn default_marker_thickness_mm() -> f64 {
    1.0
}

fn default_marker_sphere_mm() -> f64 {
    8.0
}

macro_rules! preset {
    ($name:literal) => {
        (
            $name,
            include_str!(concat!(
                env!("CARGO_MANIFEST_DIR"),
                "/chest_phantom/",
                $name,
                ".toml"
            )),
        )
    };
}

/// Name and text of each shipped parameter file.
pub(super) const PRESETS: [(&str, &str); 12] = [
    preset!("male-p5"),
    preset!("male-p50"),
    preset!("male-p95"),
    preset!("female-p5"),
    preset!("female-p50"),
    preset!("female-p95"),
    preset!("male-p5-supine"),
    preset!("male-p50-supine"),
    preset!("male-p95-supine"),
    preset!("female-p5-supine"),
    preset!("female-p50-supine"),
    preset!("female-p95-supine"),
];

impl PhantomParameters {
    /// Parses a parameter file. Ranges are checked by [`super::Phantom::build`].
    pub fn from_toml(text: &str) -> Result<Self, PhantomError> {
        toml::from_str(text).map_err(|error| PhantomError::Parse {
            message: error.to_string().trim_end().to_owned(),
        })
    }

    pub(super) fn preset(name: &str) -> Result<Self, PhantomError> {
        let (_, text) = PRESETS
            .iter()
            .find(|(known, _)| *known == name)
            .ok_or_else(|| PhantomError::UnknownPreset {
                name: name.to_owned(),
                known: PRESETS.iter().map(|(known, _)| *known).collect(),
            })?;
        Self::from_toml(text)
    }

    /// Checks every value that can be judged without the geometry.
    pub(super) fn validate(&self) -> Result<(), PhantomError> {
        let values = toml::Table::try_from(self).map_err(|error| PhantomError::Parse {
            message: error.to_string(),
        })?;
        if let Some(misfit) = PARAMETERS.check(&values).into_iter().next() {
            return Err(misfit.into());
        }
        unique("lesion", self.lesions.iter().map(|lesion| &lesion.name))?;
        unique("marker", self.markers.iter().map(|marker| &marker.name))
    }
}

impl Default for PhantomParameters {
    /// The 50th-percentile man, standing: `male-p50`, for whom the layout is tabulated.
    fn default() -> Self {
        Self::preset("male-p50").expect("the shipped preset is parsed by a test")
    }
}

fn unique<'a>(
    kind: &'static str,
    names: impl Iterator<Item = &'a String>,
) -> Result<(), PhantomError> {
    let mut seen = BTreeSet::new();
    for name in names {
        if !seen.insert(name) {
            return Err(PhantomError::DuplicateName {
                kind,
                name: name.clone(),
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_preset_file_parses_and_is_in_range() {
        for (name, _) in PRESETS {
            PhantomParameters::preset(name).unwrap().validate().unwrap();
        }
    }

    #[test]
    fn centimetres_and_metres_are_recognised() {
        for (breadth_mm, hint) in [(28.9, "centimetres"), (0.289, "metres")] {
            let parameters = PhantomParameters {
                breadth_mm,
                ..PhantomParameters::default()
            };
            let message = parameters.validate().unwrap_err().to_string();
            assert!(message.contains("breadth_mm"), "{message}");
            assert!(message.contains(hint), "{message}");
        }
    }

    /// Key of the value that is refused.
    fn refused(parameters: &PhantomParameters) -> String {
        match parameters.validate() {
            Err(PhantomError::Value { key, .. }) => key,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn non_finite_and_negative_values_are_refused() {
        let parameters = PhantomParameters {
            depth_mm: f64::NAN,
            ..PhantomParameters::default()
        };
        assert_eq!(refused(&parameters), "depth_mm");
        let mut parameters = PhantomParameters::default();
        parameters.lesions[0].diameter_mm = -5.0;
        assert_eq!(refused(&parameters), "lesions[0].diameter_mm");
    }

    #[test]
    fn lesion_names_must_be_unique_and_plain() {
        let mut parameters = PhantomParameters::default();
        parameters.lesions[1].name = parameters.lesions[0].name.clone();
        assert!(matches!(
            parameters.validate(),
            Err(PhantomError::DuplicateName { kind: "lesion", .. })
        ));
        parameters.lesions[1].name = "upper lobe".to_owned();
        assert_eq!(refused(&parameters), "lesions[1].name");
    }

    #[test]
    fn unknown_key_and_unknown_preset_are_named() {
        let error = PhantomParameters::from_toml("bredth_mm = 289").unwrap_err();
        assert!(error.to_string().contains("bredth_mm"));
        let error = PhantomParameters::preset("male-p51").unwrap_err();
        assert!(error.to_string().contains("male-p51"));
        assert!(error.to_string().contains("female-p95"));
    }

    #[test]
    fn only_the_three_sizes_are_required() {
        let text = "breadth_mm = 289\ndepth_mm = 253\nlength_mm = 408";
        let parameters = PhantomParameters::from_toml(text).unwrap();
        assert!(parameters.lesions.is_empty());
        parameters.validate().unwrap();
    }
}
