//! The tool of a scenario, before it is mounted.

use std::path::Path;

use super::names::with_model_names;
use super::overrides::Overrides;
use crate::scenario::{NEEDLE_OUTER_DIAMETER_MM, PARAMETRIC_TOOL, Scenario, ToolSection};
use needlebench_input::{Finding, Location, TomlText};
use needlebench_robot::{GuidePlace, LoadedTool, ToolOverrides, WITHOUT_SHAPE, read_tool};

/// A tool before it is mounted, and what was assumed.
#[derive(Debug)]
pub(crate) struct UnmountedTool {
    pub tool: LoadedTool,
    pub notes: Vec<String>,
}

pub(super) fn scenario_tool(
    toml: &TomlText<'_>,
    scenario: &Scenario,
    wanted: &ToolOverrides,
    base: &Path,
    overrides: &Overrides,
) -> Result<UnmountedTool, Finding> {
    let urdf = &scenario.tool.urdf;
    let location = if urdf == PARAMETRIC_TOOL {
        Location::Builtin(format!("needle_guide/{PARAMETRIC_TOOL}").into())
    } else {
        Location::of_model(urdf, "needle_guide", "urdf", base)
    };
    let mut notes = Vec::new();
    let mut tool =
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
                    let mut names = Location::builtin_names("needle_guide", "urdf");
                    names.push(PARAMETRIC_TOOL.to_owned());
                    with_model_names(toml, finding, &location, "tool.urdf", &names)
                }
            }
        })?;
    let stated = &scenario.tool.shape;
    if let Some(unknown) = stated
        .keys()
        .find(|name| !tool.tool.unseen.iter().any(|part| part.name == **name))
    {
        let message = format!("the tool has no link `{unknown}` without collision shape");
        return Err(toml.finding("tool.shape", message));
    }
    tool.tool
        .unseen
        .retain(|part| !stated.contains_key(&part.name));
    if !stated.is_empty() {
        let names: Vec<&str> = stated.keys().map(String::as_str).collect();
        notes.push(format!("{WITHOUT_SHAPE}{}", names.join(", ")));
    }
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
                        format!("no data for a {gauge} gauge needle"),
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
        guide: guide_place(toml, tool)?,
    })
}

/// Where the guide of the tool `parametric` is.
fn guide_place(toml: &TomlText<'_>, tool: &ToolSection) -> Result<Option<GuidePlace>, Finding> {
    if tool.urdf != PARAMETRIC_TOOL {
        let given = [
            ("tool.guide_ahead_mm", tool.guide_ahead_mm),
            ("tool.guide_beside_mm", tool.guide_beside_mm),
            ("tool.guide_tilt_deg", tool.guide_tilt_deg),
        ];
        return match given.into_iter().find(|(_, value)| value.is_some()) {
            None => Ok(None),
            Some((key, _)) => Err(toml
                .finding(
                    key,
                    format!("the guide position of the tool `{}` is fixed", tool.urdf),
                )
                .hint("these keys require `urdf = \"parametric\"`")),
        };
    }
    let offset = GuidePlace::OFFSET;
    let metres = |mm: Option<f64>, default: f64| mm.map_or(default, |mm| mm * 1e-3);
    let place = GuidePlace {
        ahead_m: metres(tool.guide_ahead_mm, offset.ahead_m),
        beside_m: metres(tool.guide_beside_mm, offset.beside_m),
        tilt_rad: tool.guide_tilt_deg.unwrap_or(0.0).to_radians(),
    };
    let least_m = place.least_ahead_m();
    if place.ahead_m < least_m {
        return Err(toml
            .finding(
                "tool.guide_ahead_mm",
                format!(
                    "at {:.1} mm from the flange the guide would overlap the plate",
                    place.ahead_m * 1e3
                ),
            )
            .hint(format!(
                "at least {:.1} mm at a tilt of {:.1} deg",
                least_m * 1e3,
                place.tilt_rad.to_degrees()
            )));
    }
    Ok(Some(place))
}
