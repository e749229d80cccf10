//! Markdown summary, for pull requests and CI pages.

use std::fmt::Write;

use needlebench_evaluation::report::{Report, Status, Verdict};
use needlebench_evaluation::room::RoomReport;

use super::format::{millimetres, small_length};
use super::ranking::comparison_markdown;

/// The report as Markdown.
pub(crate) fn markdown(report: &Report) -> String {
    let mut text = String::new();
    // Writing to a String cannot fail.
    let _ = write_report(&mut text, report);
    text
}

fn write_report(out: &mut String, report: &Report) -> std::fmt::Result {
    let verdict = match report.verdict {
        Verdict::Pass => "pass",
        Verdict::Fail => "**fail**",
    };
    writeln!(out, "# {}: {verdict}\n", report.scenario.name)?;
    if !report.scenario.description.is_empty() {
        writeln!(out, "{}\n", report.scenario.description)?;
    }
    for goal in &report.goals {
        writeln!(out, "## {}\n", goal.name)?;
        writeln!(
            out,
            "| Configuration | Status | Tip error rapier | Tip error MuJoCo | Engines differ, settled | Least clearance (mm) | Between | Behind the guide (mm) | Free room | Sight | Hand cone (deg) |"
        )?;
        writeln!(out, "|---|---|--:|--:|--:|--:|---|--:|--:|--:|--:|")?;
        for each in &goal.configurations {
            let status = match (each.status, each.rejections.first()) {
                (Status::Rejected, Some(first)) => format!("rejected: {}", first.rule),
                (status, _) => status.name().to_owned(),
            };
            let tip = |engine: &str| {
                each.engines.get(engine).map_or("-".to_owned(), |r| {
                    small_length(r.needle.tip_position_error_m)
                })
            };
            let difference = each.engine_difference.map_or("-".to_owned(), |difference| {
                small_length(difference.settled_tip_m)
            });
            let least = each.clearance.least();
            let (clearance, pair) = least.map_or(("-".to_owned(), "-".to_owned()), |found| {
                (millimetres(found.minimum_m), found.pair.join(", "))
            });
            let corridor = each
                .clearance
                .classes
                .get("needle_corridor")
                .map_or("-".to_owned(), |found| millimetres(found.minimum_m));
            let of_room =
                |value: fn(&RoomReport) -> String| each.room.as_ref().map_or("-".to_owned(), value);
            let free = of_room(|room| format!("{:.0} %", 100.0 * room.free_fraction));
            let sight = of_room(|room| format!("{:.0} %", 100.0 * room.sight_fraction));
            let cone = of_room(|room| format!("{:.1}", room.hand_cone_half_angle_rad.to_degrees()));
            let mark = match &goal.recommended {
                Some(found) if found.label == each.label => "**",
                _ => "",
            };
            writeln!(
                out,
                "| {mark}{}{mark} | {status} | {} | {} | {difference} | {clearance} | {pair} | {corridor} | {free} | {sight} | {cone} |",
                each.label,
                tip("rapier"),
                tip("mujoco"),
            )?;
        }
        writeln!(out)?;
        let comparison = comparison_markdown(goal);
        if !comparison.is_empty() {
            writeln!(out, "{comparison}")?;
        }
        for each in &goal.configurations {
            if let Some(first) = each.rejections.first() {
                writeln!(out, "- {}: {}: {}", each.label, first.rule, first.detail)?;
            }
        }
        if goal
            .configurations
            .iter()
            .any(|each| !each.rejections.is_empty())
        {
            writeln!(out)?;
        }
        match &goal.recommended {
            Some(found) => writeln!(out, "Recommended: **{}** - {}\n", found.label, found.reason)?,
            None => writeln!(out, "No configuration works.\n")?,
        }
    }
    if let Some(iso9283) = &report.iso9283 {
        out.push_str(&crate::iso9283::report_markdown(iso9283));
    }
    let failed: Vec<_> = report
        .criteria
        .iter()
        .filter(|result| !result.pass)
        .collect();
    writeln!(
        out,
        "{} of {} criteria met.",
        report.criteria.len() - failed.len(),
        report.criteria.len()
    )?;
    for result in failed {
        writeln!(
            out,
            "- {} {} {}: {} {}",
            result.goal,
            result.label.as_deref().unwrap_or(""),
            result.engine.as_deref().unwrap_or(""),
            result.criterion,
            result.detail
        )?;
    }
    for failure in &report.engine_failures {
        writeln!(
            out,
            "- engine {} failed: {}",
            failure.engine, failure.message
        )?;
    }
    if !report.enclosure.is_empty() {
        writeln!(
            out,
            "\n| Link | Enclosing primitives off the mesh, mean (mm) | Worst (mm) | Mesh out of the primitives (mm) |\n|---|--:|--:|--:|"
        )?;
        for each in &report.enclosure {
            writeln!(
                out,
                "| {} | {:.2} | {:.2} | {:.2} |",
                each.link,
                each.mean_overhang_m * 1e3,
                each.worst_overhang_m * 1e3,
                each.worst_protrusion_m * 1e3
            )?;
        }
        writeln!(out)?;
    }
    for note in &report.notes {
        writeln!(out, "- note: {note}")?;
    }
    let provenance = &report.provenance;
    writeln!(
        out,
        "\nneedlebench {} ({}), {}; {}.",
        provenance.version,
        provenance.git_revision,
        provenance
            .engines
            .iter()
            .map(|engine| format!("{} {}", engine.name, engine.version))
            .collect::<Vec<_>>()
            .join(", "),
        provenance.truth
    )
}
