//! Joints whose torque saturated, for the report's text.

use std::fmt::Write;

use needlebench_evaluation::report::GoalReport;

/// One line per configuration, engine and joint; empty if no torque was saturated.
pub(crate) fn saturation_text(goal: &GoalReport) -> String {
    let mut out = String::new();
    for configuration in &goal.configurations {
        for (engine, report) in &configuration.engines {
            for cut in &report.motion.saturated_joints {
                // Writing to a String cannot fail.
                let _ = write!(
                    out,
                    "torque saturation: {} in {engine}, {} for {} steps ({:.1} % of the time)",
                    configuration.label,
                    cut.joint,
                    cut.steps,
                    100.0 * cut.share
                );
                let _ = match cut.first_time_s {
                    Some(time_s) => writeln!(out, ", first at {time_s:.3} s"),
                    None => writeln!(out),
                };
            }
        }
    }
    out
}
