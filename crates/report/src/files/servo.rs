//! Files of a servo's data sheet.

use needlebench_bench::servo::experiment::{Course, JointResponse};
use needlebench_bench::servo::{JointReport, ServoReport};

use super::error::FilesError;
use super::folder::Folder;
use crate::chart::servo::servo_chart;
use crate::csv::servo::{course_csv, frequency_csv};

/// Writes the report, courses and frequency responses, and a chart of each joint.
pub fn write_servo(
    report: &ServoReport,
    folder: Folder<'_>,
    pictures: bool,
) -> Result<(), FilesError> {
    folder.write_json("servo.json", report)?;
    folder.write("frequency.csv", frequency_csv(report))?;
    for joint in &report.joints {
        if joint.responses.is_empty() || !pictures {
            folder.remove_chart(joint.joint)?;
        }
        if joint.responses.is_empty() {
            continue;
        }
        write_courses(report, joint, folder)?;
        if pictures {
            folder.write_chart(joint.joint, &servo_chart(report, joint))?;
        }
    }
    Ok(())
}

/// One of an engine's courses.
type CourseOf = fn(&JointResponse) -> &Course;

fn write_courses(
    report: &ServoReport,
    joint: &JointReport,
    folder: Folder<'_>,
) -> Result<(), FilesError> {
    let courses: [(&str, CourseOf); 4] = [
        ("small_step", |each| &each.small),
        ("large_step", |each| &each.large),
        ("sine", |each| &each.sine),
        ("tracked_sine", |each| &each.tracked),
    ];
    for (name, course) in courses {
        let csv = course_csv(joint, report.timestep_s, course);
        folder.write(&format!("{}.{name}.csv", joint.joint), csv)?;
    }
    Ok(())
}
