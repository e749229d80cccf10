//! Files of a test's results folder.

use std::path::Path;

use anyhow::Result;
use needlebench_evaluation::iso9283::{Iso9283Report, write_commanded, write_log};

use super::{ProtocolRun, attained_picture, stabilisation_picture};
use crate::atomic::write_atomically;

/// Writes commanded poses, each engine's log in the shape of a laser tracker's, and pictures; gives
/// the names of the files.
pub(crate) fn write_results(
    scenario: &str,
    report: &Iso9283Report,
    run: &ProtocolRun,
    folder: &Path,
    pictures: bool,
) -> Result<Vec<String>> {
    let mut files = Vec::new();
    let mut write = |name: String, text: &str| -> Result<()> {
        write_atomically(&folder.join(&name), text.as_bytes())?;
        files.push(name);
        Ok(())
    };
    let what = "of the measured point in the robot's base frame; quaternion base_from_guide";
    let title = format!("needlebench: commanded poses of {scenario}\nPositions (mm) {what}");
    write(
        "commanded.csv".to_owned(),
        &write_commanded(&title, &run.commanded),
    )?;
    for (engine, attained, _) in &run.engines {
        let name = engine.name();
        let title = format!(
            "needlebench: attained poses of {scenario}, simulated by {name}\nPositions (mm) {what}\n\
             direction: axis of the base frame along which the pose was approached; empty in the \
             plain sequence P5 P4 P3 P2 P1"
        );
        write(format!("attained.{name}.csv"), &write_log(&title, attained))?;
    }
    if pictures {
        for (engine, attained, arrivals) in &run.engines {
            let name = engine.name();
            let Some(measured) = report.engines.get(name) else {
                continue;
            };
            let heading = format!("{scenario}, {name}");
            let file = format!("attained.{name}.png");
            attained_picture(&heading, &measured.statistics, attained)
                .write_png(&folder.join(&file))?;
            files.push(file);
            let file = format!("stabilisation.{name}.png");
            stabilisation_picture(&heading, arrivals, run.limit_band_m)
                .write_png(&folder.join(&file))?;
            files.push(file);
        }
    }
    Ok(files)
}
