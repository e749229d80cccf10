//! The tool of a scenario, before it is mounted.

use std::path::Path;

use super::names::with_model_names;
use super::overrides::Overrides;
use crate::Finding;
use crate::files::Location;
use crate::model::Tool;
use crate::robot::{ToolOverrides, read_tool};
use crate::scenario::{NEEDLE_OUTER_DIAMETER_MM, Scenario};
use crate::toml_text::TomlText;

/// A tool before it is mounted, and what was assumed.
#[derive(Debug)]
pub(crate) struct UnmountedTool {
    pub tool: Tool,
    pub notes: Vec<String>,
}

pub(super) fn scenario_tool(
    toml: &TomlText<'_>,
    scenario: &Scenario,
    wanted: &ToolOverrides,
    base: &Path,
    overrides: &Overrides,
) -> Result<UnmountedTool, Finding> {
    let location = Location::of_model(&scenario.tool.urdf, "needle_guide", "urdf", base);
    let mut notes = Vec::new();
    let tool =
        read_tool(&location, &overrides.packages, wanted, &mut notes).map_err(|finding| {
            // A bore or a gauge of the scenario may not fit the tool's other half.
            let given = [
                ("tool.bore_mm", scenario.tool.bore_mm.is_some()),
                ("tool.needle_gauge", scenario.tool.needle_gauge.is_some()),
            ]
            .into_iter()
            .find(|(_, is_given)| *is_given);
            match given {
                Some((key, _)) if finding.key.as_deref() == Some("bore_mm") => Finding {
                    hint: finding.hint,
                    ..toml.finding(key, finding.message)
                },
                _ => {
                    let names = Location::builtin_names("needle_guide", "urdf");
                    with_model_names(toml, finding, &location, "tool.urdf", &names)
                }
            }
        })?;
    Ok(UnmountedTool { tool, notes })
}

/// What the scenario says of its tool.
pub(super) fn tool_overrides(
    toml: &TomlText<'_>,
    scenario: &Scenario,
) -> Result<ToolOverrides, Finding> {
    let tool = &scenario.tool;
    let needle_outer_diameter_m = match tool.needle_gauge {
        None => None,
        Some(gauge) => {
            let known = NEEDLE_OUTER_DIAMETER_MM
                .iter()
                .find(|(each, _)| *each == gauge);
            let Some((_, diameter_mm)) = known else {
                return Err(toml
                    .finding(
                        "tool.needle_gauge",
                        format!("there is no {gauge} gauge needle here"),
                    )
                    .hint("14 to 23, and 25"));
            };
            Some(diameter_mm * 1e-3)
        }
    };
    Ok(ToolOverrides {
        mount_rotation_rad: tool.mount_rotation_deg.to_radians(),
        bore_m: tool.bore_mm.map(|mm| mm * 1e-3),
        needle_gauge: tool.needle_gauge,
        needle_outer_diameter_m,
        needle_length_m: tool.needle_length_mm.map(|mm| mm * 1e-3),
    })
}
