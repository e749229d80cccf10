//! Files of a replay.

use std::io::Write;
use std::time::Duration;

use needlebench_bench::replay::{ArmFiles, Course, Replay};
use needlebench_kinematics::JOINT_COUNT;
use needlebench_show::layout;

use super::error::FilesError;
use super::folder::Folder;
use crate::chart::replay::replay_chart;
use crate::junit::replay_junit;
use crate::page::replay_page;
use crate::table::replay::text;

/// Name of the calibration beside the arm's data.
pub const CALIBRATION_FILE: &str = "calibration.yaml";

/// Writes report, tables, JUnit, courses, the arm's data, the chart and the page. `elapsed` is what it took.
pub fn write_replay(
    replay: &Replay,
    arm: Option<&ArmFiles>,
    folder: Folder<'_>,
    [pictures, page]: [bool; 2],
    elapsed: Duration,
) -> Result<(), FilesError> {
    folder.write_json("replay.json", &replay.report)?;
    folder.write(
        "replay.txt",
        layout::for_file(|| text(&replay.report)) + "\n",
    )?;
    folder.write("junit.xml", replay_junit(&replay.report, elapsed)?)?;
    for (engine, course) in &replay.courses {
        let name = format!("course.{engine}.csv");
        folder.stream(&name, &mut |out| write_course(out, replay, course))?;
    }
    for (name, content) in [
        ("arm.toml", arm.map(|arm| &arm.arm)),
        (
            CALIBRATION_FILE,
            arm.and_then(|arm| arm.calibration.as_ref()),
        ),
    ] {
        match content {
            Some(content) => folder.write(name, content)?,
            None => folder.remove(name)?,
        }
    }
    let chart = (!replay.courses.is_empty()).then(|| replay_chart(replay));
    match &chart {
        Some(chart) if pictures => {
            folder.write_chart("replay", chart)?;
        }
        _ => folder.remove_chart("replay")?,
    }
    if page {
        folder.write("replay.html", replay_page(&replay.report, chart.as_ref()))?;
    } else {
        folder.remove("replay.html")?;
    }
    Ok(())
}

/// Errors from the set-points (rad), torques at the links and of the motors (N m), a line per row of the log; empty
/// where nothing was compared.
fn write_course(out: &mut dyn Write, replay: &Replay, course: &Course) -> std::io::Result<()> {
    write!(out, "time_s")?;
    for name in ["error_rad", "link_nm", "motor_nm"] {
        for joint in 0..JOINT_COUNT {
            write!(out, ",{name}_{joint}")?;
        }
    }
    writeln!(out)?;
    for (row, time_s) in replay.run.time_s.iter().enumerate() {
        write!(out, "{time_s}")?;
        for values in [
            &course.error[row],
            &course.link_nm[row],
            &course.motor_nm[row],
        ] {
            for value in values {
                if value.is_finite() {
                    write!(out, ",{value:.9}")?;
                } else {
                    write!(out, ",")?;
                }
            }
        }
        writeln!(out)?;
    }
    Ok(())
}
