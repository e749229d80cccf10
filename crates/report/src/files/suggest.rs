//! Files of proposals.

use needlebench_bench::suggest::{EntrySearch, PlaceSearch};
use needlebench_scenario::ResolvedScenario;

use super::error::FilesError;
use super::folder::Folder;
use crate::chart::suggest::{entries_chart, places_chart};

/// Writes a map of each target's skin, and one of the room.
pub fn write_suggestions(
    resolved: &ResolvedScenario,
    entries: &[EntrySearch],
    places: Option<&PlaceSearch>,
    folder: Folder<'_>,
) -> Result<(), FilesError> {
    for found in entries {
        let chart = entries_chart(&resolved.scenario.name, found);
        folder.write_chart(&format!("{}.entries", found.goal), &chart)?;
    }
    if let Some(found) = places {
        folder.write_chart("places", &places_chart(resolved, found))?;
    }
    Ok(())
}
