//! Files of a test by ISO 9283.

use needlebench_bench::ProtocolRun;
use needlebench_evaluation::iso9283::Iso9283Report;
use needlebench_iso9283::{Attained, ProtocolStatistics, write_commanded, write_log};

use super::error::FilesError;
use super::folder::Folder;
use crate::chart::iso9283::{attained_chart, stabilisation_chart};

/// Writes commanded poses, each engine's log in the shape of a laser tracker's, and charts; gives
/// the names of the files.
pub(crate) fn write_test(
    scenario: &str,
    report: &Iso9283Report,
    run: &ProtocolRun,
    folder: Folder<'_>,
    pictures: bool,
) -> Result<Vec<String>, FilesError> {
    let what =
        "of the measured point in the robot's base frame; orientation: quaternion base_from_guide";
    let title = format!("needlebench: commanded poses of {scenario}\nPositions (mm) {what}");
    let name = "commanded.csv".to_owned();
    folder.write(&name, write_commanded(&title, &run.commanded))?;
    let mut files = vec![name];
    for (engine, attained, _) in &run.engines {
        let title = format!(
            "needlebench: attained poses of {scenario}, simulated by {engine}\nPositions (mm) {what}\n\
             direction: base-frame axis along which the pose was approached; empty in the plain \
             sequence P5 P4 P3 P2 P1"
        );
        let name = format!("attained.{engine}.csv");
        folder.write(&name, write_log(&title, attained))?;
        files.push(name);
    }
    for (engine, attained, arrivals) in &run.engines {
        let stems = ["attained", "stabilisation"].map(|stem| format!("{stem}.{engine}"));
        let measured = report.engines.get(*engine).filter(|_| pictures);
        let Some(measured) = measured else {
            stems
                .iter()
                .try_for_each(|stem| folder.remove_chart(stem))?;
            continue;
        };
        let heading = format!("{scenario}, {engine}");
        let charts = [
            attained_chart(&heading, &measured.statistics, attained),
            stabilisation_chart(&heading, arrivals, run.limit_band_m),
        ];
        for (stem, chart) in stems.iter().zip(&charts) {
            files.extend(folder.write_chart(stem, chart)?);
        }
    }
    Ok(files)
}

/// Writes the measurements of a tracker's log in the base frame, and a chart of them.
pub fn write_measured(
    log: &str,
    statistics: &ProtocolStatistics,
    attained: &[Attained],
    folder: Folder<'_>,
    pictures: bool,
) -> Result<(), FilesError> {
    let title =
        format!("needlebench: attained poses of {log}\nPositions (mm) in the robot's base frame");
    folder.write("attained.csv", write_log(&title, attained))?;
    if pictures {
        let name = std::path::Path::new(log).file_name().unwrap_or_default();
        let chart = attained_chart(&name.to_string_lossy(), statistics, attained);
        folder.write_chart("attained", &chart)?;
    } else {
        folder.remove_chart("attained")?;
    }
    Ok(())
}
