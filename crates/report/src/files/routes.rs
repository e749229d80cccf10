//! Files of planned needle paths.

use needlebench_patient::routes::RoutePlan;

use super::error::FilesError;
use super::folder::Folder;
use crate::chart::routes::routes_chart;

/// Writes the entry map of each plan.
///
/// # Errors
/// What cannot be written.
pub fn write_route_maps(
    scenario: &str,
    plans: &[RoutePlan],
    folder: Folder<'_>,
) -> Result<(), FilesError> {
    for plan in plans {
        if let Some(chart) = routes_chart(scenario, plan) {
            folder.write_chart(&format!("{}.routes", plan.goal), &chart)?;
        }
    }
    Ok(())
}
