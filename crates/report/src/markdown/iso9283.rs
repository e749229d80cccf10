//! A test by ISO 9283 as Markdown.

use std::fmt::Write;

use needlebench_evaluation::iso9283::Iso9283Report;
use needlebench_show::number::{small_length, small_length_or_zero};

/// What a run found, a row for each engine and pose.
pub(crate) fn report_markdown(report: &Iso9283Report) -> String {
    let protocol = &report.protocol;
    let mut text = format!(
        "ISO 9283 in {}: load {} kg, {:.0} % of the rated speed, {} cycles\n\n\
         | Engine | Pose | AP | RP | Stabilisation (s) | Overshoot |\n|---|---|--:|--:|--:|--:|\n",
        protocol.configuration,
        protocol.load_kg,
        100.0 * protocol.speed_share,
        protocol.cycles
    );
    for (engine, measured) in &report.engines {
        for each in &measured.statistics.poses {
            let settled = measured
                .stabilisation
                .iter()
                .find(|found| found.pose == each.pose);
            let _ = writeln!(
                text,
                "| {engine} | P{} | {} | {} | {} | {} |",
                each.pose,
                small_length_or_zero(each.ap_m),
                small_length_or_zero(each.rp_m),
                settled
                    .and_then(|found| found.time_s)
                    .map_or("-".to_owned(), |value| format!("{value:.3}")),
                settled
                    .and_then(|found| found.overshoot_m)
                    .map_or("-".to_owned(), small_length),
            );
        }
    }
    text.push('\n');
    for (engine, measured) in &report.engines {
        if let Some(vap_m) = measured.statistics.vap_m {
            let _ = writeln!(text, "- {engine}: vAP {}", small_length_or_zero(vap_m));
        }
        if let Some(remark) = &measured.remark {
            let _ = writeln!(text, "- {engine}: {remark}");
        }
    }
    text.push('\n');
    text
}
