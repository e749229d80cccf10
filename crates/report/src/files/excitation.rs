//! Files of an excitation run, and of its plan.

use needlebench_bench::record_plan::PlanReport;
use needlebench_bench::{ExcitationRun, RtdeLog};
use needlebench_show::layout;

use super::error::FilesError;
use super::folder::Folder;
use crate::csv::rtde_csv;
use crate::table::excitation::clearances_text;

/// Writes the log of each engine and payload; gives the names of the files.
pub(super) fn write_logs(
    run: &ExcitationRun,
    folder: Folder<'_>,
) -> Result<Vec<String>, FilesError> {
    let write = |(engine, load, log): &(&'static str, usize, RtdeLog)| {
        let name = format!("payload_{}.{engine}.rtde.csv", load + 1);
        folder.write(&name, rtde_csv(log))?;
        Ok(name)
    };
    run.logs.iter().map(write).collect()
}

/// Writes scenario, program and clearances of a plan, and their names into its report.
///
/// # Errors
/// What cannot be written.
pub fn write_plan(
    report: &mut PlanReport,
    scenario: &str,
    script: &str,
    folder: Folder<'_>,
) -> Result<(), FilesError> {
    folder.write("excitation.toml", scenario)?;
    folder.write("excitation.script", script)?;
    folder.write(
        "clearances.txt",
        layout::for_file(|| clearances_text(report)),
    )?;
    report.files = [
        "excitation.toml",
        "excitation.script",
        "clearances.txt",
        "plan.json",
    ]
    .map(str::to_owned)
    .to_vec();
    folder.write_json("plan.json", report)
}
