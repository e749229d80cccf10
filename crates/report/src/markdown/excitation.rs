//! An excitation run as Markdown.

use std::fmt::Write;

use needlebench_evaluation::excitation::{ExcitationReport, proven_m};

/// Results of a run, a row for each engine and payload.
pub(crate) fn report_markdown(report: &ExcitationReport) -> String {
    let millimetres =
        |value: Option<f64>| value.map_or("-".to_owned(), |metres| format!("{:.1}", metres * 1e3));
    let [others, itself] = proven_m(&report.planned).map(millimetres);
    let mut text = format!(
        "Excitation: {} postures, {:.0} s with each payload; certified clearance of the plan \
         {others} mm, self-clearance {itself} mm\n\n| Engine | Payload (kg) | Clearance (mm) | \
         Self-clearance (mm) | Peak torque ratio |\n|---|--:|--:|--:|--:|\n",
        report.postures_rad.len(),
        report.duration_s
    );
    for (engine, measured) in &report.engines {
        for each in measured {
            let [others, itself] = proven_m(&each.clearance).map(millimetres);
            // Writing to a String cannot fail.
            let _ = writeln!(
                text,
                "| {engine} | {} | {others} | {itself} | {:.0} % |",
                report.loads[each.load - 1].added_kg,
                each.effort.peak_torque_ratio * 100.0
            );
        }
    }
    text.push('\n');
    text
}
