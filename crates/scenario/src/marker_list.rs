//! Markers on a patient as the robot, or a drawing, has them: the list that a scan is registered by.
//!
//! ```toml
//! frame = "base_link"   # or "base", as the controller shows it, or "drawing"
//! sphere_mm = 8
//! sd_mm = 0.3
//!
//! [[markers]]
//! name = "upper_right"
//! position_mm = [412.3, -180.2, 260.7]
//! ```

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use needlebench_input::schema::{FileSchema, LONGEST_NAME, NAME};
use needlebench_input::{Finding, TomlText, read_text};

/// Frame of the marker positions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MarkerFrame {
    /// The robot's `base_link`, as URDFs and ROS have it.
    BaseLink,
    /// The robot's `base`, as the controller shows it: `base_link` rotated by 180 deg about z.
    Base,
    /// The frame of a drawing of the marker carrier, unrelated to the robot.
    Drawing,
}

/// A list of markers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MarkerList {
    /// Frame of the marker positions: `base_link`, `base` or `drawing`.
    pub frame: MarkerFrame,
    /// Diameter of the dense sphere in each marker, mm.
    #[schemars(range(min = 2.0, max = 20.0))]
    pub sphere_mm: f64,
    /// Whether the spheres are held by a foam carrier with a plastic disc of 18 x 1 mm on top, as the phantom's are;
    /// bare spheres if not.
    #[serde(default = "yes")]
    pub carrier: bool,
    /// Standard deviation of each position per axis, mm.
    #[schemars(range(min = 0.001, max = 20.0))]
    pub sd_mm: f64,
    /// Standard deviation of the placement of each marker, mm, where the list is a drawing: for the matching, not for
    /// the registration. Default: 0.5 mm.
    #[serde(default)]
    #[schemars(range(min = 0.01, max = 20.0))]
    pub placement_mm: Option<f64>,
    /// The markers, in any order; some may be missing in the scan.
    #[schemars(length(min = 3), extend("x-hint" = "a rigid registration needs three that are not collinear"))]
    pub markers: Vec<ListedMarker>,
}

/// A marker.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ListedMarker {
    /// Its name.
    #[schemars(regex(pattern = NAME), length(max = LONGEST_NAME))]
    pub name: String,
    /// Centre of its sphere, mm.
    #[schemars(inner(range(min = -5000.0, max = 5000.0)))]
    pub position_mm: [f64; 3],
    /// Standard deviation of this marker's position per axis, mm, instead of the list's.
    #[serde(default)]
    #[schemars(range(min = 0.001, max = 20.0))]
    pub sd_mm: Option<f64>,
}

/// The JSON schema (draft-07) of such lists, for editors.
pub fn marker_list_schema() -> serde_json::Value {
    FileSchema::of::<MarkerList>().published()
}

fn yes() -> bool {
    true
}

impl MarkerList {
    /// Reads a file.
    ///
    /// # Errors
    /// All that is wrong with it.
    pub fn load(path: &Path) -> Result<Self, Vec<Finding>> {
        let file = path.display().to_string();
        let text = read_text(path).map_err(|error| {
            let hint = error.hint("a TOML file with the marker positions");
            vec![Finding::new(&file, format!("cannot read the markers: {error}")).hint(hint)]
        })?;
        Self::parse(&file, &text)
    }

    /// Reads a text; `file` is its name in messages.
    ///
    /// # Errors
    /// All that is wrong with it.
    pub fn parse(file: &str, text: &str) -> Result<Self, Vec<Finding>> {
        let toml = TomlText::parse(file, text).map_err(|finding| vec![finding])?;
        let list: Self = toml.read(&FileSchema::of::<Self>())?;
        for (index, marker) in list.markers.iter().enumerate() {
            let earlier = &list.markers[..index];
            if earlier.iter().any(|each| each.name == marker.name) {
                let key = format!("markers[{index}].name");
                let finding = toml.finding(&key, format!("duplicate marker `{}`", marker.name));
                return Err(vec![finding.hint("give each marker its own name")]);
            }
        }
        Ok(list)
    }

    /// The text of a list.
    ///
    /// # Errors
    /// A value that TOML does not have.
    pub fn text(&self) -> Result<String, String> {
        toml::to_string(self).map_err(|error| error.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIST: &str = "frame = \"base_link\"\nsphere_mm = 8\nsd_mm = 0.3\n\n[[markers]]\nname = \"a\"\nposition_mm = \
                        [1, 2, 3]\n\n[[markers]]\nname = \"b\"\nposition_mm = [4, 5, 6]\nsd_mm = 1\n\n[[markers]]\nname = \
                        \"c\"\nposition_mm = [7, 8, 10]\n";

    #[test]
    fn a_list_is_read_and_written() {
        let list = MarkerList::parse("m.toml", LIST).unwrap();
        assert_eq!(list.frame, MarkerFrame::BaseLink);
        assert!(list.carrier);
        assert_eq!(list.markers[1].sd_mm, Some(1.0));
        let again = MarkerList::parse("m.toml", &list.text().unwrap()).unwrap();
        assert_eq!(again, list);
    }

    #[test]
    fn mistakes_are_named_with_their_lines() {
        for (from, to, line, words) in [
            ("\"base_link\"", "\"tool\"", 1, "base"),
            ("sphere_mm = 8", "sphere_mm = 800", 2, "sphere_mm"),
            ("\"b\"", "\"a\"", 10, "duplicate"),
            ("[4, 5, 6]", "[4, 5]", 11, "position_mm"),
        ] {
            let findings = MarkerList::parse("m.toml", &LIST.replace(from, to)).unwrap_err();
            assert_eq!(findings[0].line, Some(line), "{findings:?}");
            assert!(findings[0].to_string().contains(words), "{findings:?}");
        }
        let two = LIST.split("\n[[markers]]\nname = \"c\"").next().unwrap();
        assert!(MarkerList::parse("m.toml", two).is_err());
    }
}
