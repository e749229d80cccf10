//! Parameters of the chest phantom, their ranges and the shipped presets.

use std::collections::BTreeSet;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::PhantomError;

/// Size and contents of a chest phantom.
///
/// Positions are in the `phantom` frame: anatomical LPS (x to the patient's left, y posterior, z
/// towards the head), origin in the mid-sagittal plane at half depth and half length.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PhantomParameters {
    /// Breadth of the chest over the skin at its widest level, left to right, without arms, mm.
    pub breadth_mm: f64,
    /// Depth of the chest over the skin at its widest level, front to back, mm.
    pub depth_mm: f64,
    /// Length of the phantom along the body, mm. The suprasternal notch lies 60 mm (of 408) below
    /// its upper end and the lowest point of the tenth rib 30 mm above its lower end.
    pub length_mm: f64,
    /// Skin to pleura in the second intercostal space on the mid-clavicular line, along the
    /// front-to-back direction, mm.
    #[serde(default = "default_chest_wall_mm")]
    pub chest_wall_mm: f64,
    /// Skin to pleura at the side, mm.
    #[serde(default = "default_lateral_wall_mm")]
    pub lateral_wall_mm: f64,
    /// Skin to pleura at the back, beside the spine, mm.
    #[serde(default = "default_posterior_wall_mm")]
    pub posterior_wall_mm: f64,
    /// Diameter of a rib (a chain of capsules), mm.
    #[serde(default = "default_rib_diameter_mm")]
    pub rib_diameter_mm: f64,
    /// Width of the body of the sternum, mm.
    #[serde(default = "default_sternum_width_mm")]
    pub sternum_width_mm: f64,
    /// Thickness of the sternum, mm.
    #[serde(default = "default_sternum_thickness_mm")]
    pub sternum_thickness_mm: f64,
    /// Diameter of a thoracic vertebral body, mm.
    #[serde(default = "default_vertebra_diameter_mm")]
    pub vertebra_diameter_mm: f64,
    /// Diameter of a marker disc, mm.
    #[serde(default = "default_marker_diameter_mm")]
    pub marker_diameter_mm: f64,
    /// Thickness of a marker disc, mm.
    #[serde(default = "default_marker_thickness_mm")]
    pub marker_thickness_mm: f64,
    /// Lesions; none when the key is left out.
    #[serde(default)]
    pub lesions: Vec<LesionParameters>,
    /// Skin markers; none when the key is left out.
    #[serde(default)]
    pub markers: Vec<MarkerParameters>,
}

/// A spherical lesion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LesionParameters {
    /// Name, unique among lesions: letters, digits, `_` and `-`.
    pub name: String,
    /// Centre in the phantom frame (left, posterior, superior), mm.
    pub center_mm: [f64; 3],
    /// Diameter, mm.
    pub diameter_mm: f64,
}

/// A black-and-white disc on the skin, placed by a horizontal ray from the phantom's z axis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MarkerParameters {
    /// Name, unique among markers: letters, digits, `_` and `-`.
    pub name: String,
    /// Direction about z: 0 is anterior, 90 the patient's left, -90 the patient's right, deg.
    pub azimuth_deg: f64,
    /// Height in the phantom frame (z), mm.
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
fn default_rib_diameter_mm() -> f64 {
    9.0
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

macro_rules! preset {
    ($name:literal) => {
        (
            $name,
            include_str!(concat!(
                env!("CARGO_MANIFEST_DIR"),
                "/../../models/chest_phantom/",
                $name,
                ".toml"
            )),
        )
    };
}

/// Name and text of each shipped parameter file.
pub(super) const PRESETS: [(&str, &str); 6] = [
    preset!("male-p5"),
    preset!("male-p50"),
    preset!("male-p95"),
    preset!("female-p5"),
    preset!("female-p50"),
    preset!("female-p95"),
];

/// Largest angle about z that a marker may be given, deg.
const AZIMUTH_LIMIT_DEG: f64 = 180.0;
/// Largest coordinate that a lesion centre may be given, mm; finer checks need the skin.
const COORDINATE_LIMIT_MM: f64 = 500.0;

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
        // Bounds: beyond the smallest and largest adults on record, with room for children's and
        // obese phantoms; they are there to catch unit mistakes.
        for (key, value, lower, upper) in [
            ("breadth_mm", self.breadth_mm, 150.0, 600.0),
            ("depth_mm", self.depth_mm, 120.0, 600.0),
            ("length_mm", self.length_mm, 200.0, 700.0),
            ("chest_wall_mm", self.chest_wall_mm, 15.0, 150.0),
            ("lateral_wall_mm", self.lateral_wall_mm, 15.0, 150.0),
            ("posterior_wall_mm", self.posterior_wall_mm, 15.0, 150.0),
            ("rib_diameter_mm", self.rib_diameter_mm, 3.0, 16.0),
            ("sternum_width_mm", self.sternum_width_mm, 15.0, 70.0),
            ("sternum_thickness_mm", self.sternum_thickness_mm, 4.0, 20.0),
            (
                "vertebra_diameter_mm",
                self.vertebra_diameter_mm,
                15.0,
                50.0,
            ),
            ("marker_diameter_mm", self.marker_diameter_mm, 5.0, 40.0),
            ("marker_thickness_mm", self.marker_thickness_mm, 0.2, 5.0),
        ] {
            in_range(key, value, lower, upper)?;
        }
        for lesion in &self.lesions {
            let key = |field: &str| format!("lesions.{}.{field}", lesion.name);
            good_name("lesion", &lesion.name)?;
            in_range(key("diameter_mm"), lesion.diameter_mm, 1.0, 150.0)?;
            for coordinate in lesion.center_mm {
                in_range(
                    key("center_mm"),
                    coordinate,
                    -COORDINATE_LIMIT_MM,
                    COORDINATE_LIMIT_MM,
                )?;
            }
        }
        for marker in &self.markers {
            let key = |field: &str| format!("markers.{}.{field}", marker.name);
            good_name("marker", &marker.name)?;
            in_range(
                key("azimuth_deg"),
                marker.azimuth_deg,
                -AZIMUTH_LIMIT_DEG,
                AZIMUTH_LIMIT_DEG,
            )?;
            in_range(
                key("height_mm"),
                marker.height_mm,
                -COORDINATE_LIMIT_MM,
                COORDINATE_LIMIT_MM,
            )?;
        }
        unique("lesion", self.lesions.iter().map(|lesion| &lesion.name))?;
        unique("marker", self.markers.iter().map(|marker| &marker.name))
    }
}

impl Default for PhantomParameters {
    /// The 50th-percentile man, `male-p50`.
    fn default() -> Self {
        Self::preset("male-p50").expect("the shipped preset is parsed by a test")
    }
}

fn in_range(
    key: impl Into<String>,
    value: f64,
    lower: f64,
    upper: f64,
) -> Result<(), PhantomError> {
    let key = key.into();
    if !value.is_finite() {
        return Err(PhantomError::NotFinite { key, value });
    }
    if (lower..=upper).contains(&value) {
        return Ok(());
    }
    let fits = |factor: f64| value > 0.0 && (lower..=upper).contains(&(value * factor));
    let hint = if !key.ends_with("_mm") {
        ""
    } else if fits(10.0) {
        ": did you give centimetres?"
    } else if fits(1000.0) {
        ": did you give metres?"
    } else {
        ""
    };
    Err(PhantomError::OutOfRange {
        key,
        value,
        lower,
        upper,
        hint,
    })
}

fn good_name(kind: &'static str, name: &str) -> Result<(), PhantomError> {
    let good = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if name.is_empty() || !name.chars().all(good) {
        return Err(PhantomError::BadName {
            kind,
            name: name.to_owned(),
        });
    }
    Ok(())
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

    #[test]
    fn non_finite_and_negative_values_are_refused() {
        let parameters = PhantomParameters {
            depth_mm: f64::NAN,
            ..PhantomParameters::default()
        };
        assert!(matches!(
            parameters.validate(),
            Err(PhantomError::NotFinite { key, .. }) if key == "depth_mm"
        ));
        let mut parameters = PhantomParameters::default();
        parameters.lesions[0].diameter_mm = -5.0;
        assert!(matches!(
            parameters.validate(),
            Err(PhantomError::OutOfRange { hint: "", .. })
        ));
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
        assert!(matches!(
            parameters.validate(),
            Err(PhantomError::BadName { kind: "lesion", .. })
        ));
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
