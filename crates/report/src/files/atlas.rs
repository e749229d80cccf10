//! Files of a roll map.

use needlebench_bench::GoalAtlas;
use needlebench_bench::atlas::AtlasReport;
use needlebench_scenario::{Goal, ResolvedScenario};

use super::error::FilesError;
use super::folder::Folder;
use crate::chart::atlas::atlas_chart;
use crate::page::atlas_page;

/// Writes the report, the page if requested, and a chart of each goal if requested.
pub fn write_atlas(
    resolved: &ResolvedScenario,
    atlases: &[(&Goal, GoalAtlas)],
    report: &AtlasReport,
    folder: Folder<'_>,
    [pictures, page]: [bool; 2],
) -> Result<(), FilesError> {
    // In one line: it is long.
    let mut json = serde_json::to_vec(report)?;
    json.push(b'\n');
    folder.write("atlas.json", json)?;
    if page {
        folder.write("atlas.html", atlas_page(resolved, atlases, report))?;
    } else {
        folder.remove("atlas.html")?;
    }
    for (goal, atlas) in atlases {
        let stem = format!("{}.atlas", goal.name);
        if pictures {
            let chart = atlas_chart(&resolved.scenario.name, goal, atlas);
            folder.write_chart(&stem, &chart)?;
        } else {
            folder.remove_chart(&stem)?;
        }
    }
    Ok(())
}
