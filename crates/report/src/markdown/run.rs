//! Markdown summary, for pull requests and CI pages.

use std::fmt::Write;

use needlebench_cell::rule_in_words;
use needlebench_engine::Engine;
use needlebench_evaluation::report::{GoalReport, Report, Status, TraceOutcome, Verdict};
use needlebench_show::markdown::{inline, paragraph};

use super::ranking::ranking_markdown;
use crate::table::engine_headings::{EngineHeading, engine_headings};
use crate::table::judged::judged_blocks;
use crate::table::needle::needle_blocks;
use crate::table::probability::probability_blocks;
use crate::table::shown::{Shown, shown_metrics};
use crate::table::true_target::true_target_in_words;
use crate::table::verdict::{counts, qualifies, qualifying, status};
use crate::table::{fissures_in_words, route_in_words, route_wanted_m};

/// The report as Markdown; `engines` are those that there are, with their titles.
pub fn markdown(report: &Report, engines: &[&'static dyn Engine]) -> String {
    let mut text = String::new();
    // Writing to a String cannot fail.
    let _ = write_report(&mut text, report, &engine_headings(report, engines));
    text
}

fn write_report(out: &mut String, report: &Report, engines: &[EngineHeading]) -> std::fmt::Result {
    let verdict = match report.verdict {
        Verdict::Pass => "pass",
        Verdict::Fail => "**fail**",
        Verdict::Incomplete => "**incomplete**",
    };
    writeln!(out, "# {}: {verdict}\n", inline(&report.scenario.name))?;
    if !report.scenario.description.is_empty() {
        writeln!(out, "{}\n", paragraph(&report.scenario.description))?;
    }
    write_judged(out, report)?;
    let mut is_qualified = false;
    for note in qualifying(report) {
        writeln!(out, "- note: {}", inline(note))?;
        is_qualified = true;
    }
    if is_qualified {
        writeln!(out)?;
    }
    if let Some(judged) = &report.judged {
        super::study::write_blocks(out, &judged_blocks(judged))?;
    }
    for goal in &report.goals {
        writeln!(out, "## {}\n", inline(&goal.name))?;
        write_configurations(out, report, goal, engines)?;
        writeln!(out)?;
        let comparison = ranking_markdown(goal);
        if !comparison.is_empty() {
            writeln!(out, "{comparison}")?;
        }
        if let Some(route) = &goal.needle_route {
            let words = route_in_words(route, route_wanted_m(report, goal));
            writeln!(
                out,
                "{}\n",
                if route.kept {
                    words
                } else {
                    format!("**{words}**")
                }
            )?;
        }
        if let Some(words) = fissures_in_words(&goal.fissures_crossed) {
            writeln!(out, "{words}\n")?;
        }
        if let Some(needle) = &goal.needle {
            writeln!(out, "{}\n", inline(&needle.summary))?;
            super::study::write_blocks(out, &needle_blocks(needle))?;
        }
        super::study::write_blocks(out, &probability_blocks(goal))?;
        if let Some(words) = true_target_in_words(goal) {
            writeln!(out, "{words}\n")?;
        }
        for each in &goal.configurations {
            if let Some(first) = each.rejections.first() {
                let detail = inline(&first.detail);
                writeln!(
                    out,
                    "- {}: {}: {detail}",
                    each.label,
                    rule_in_words(first.rule)
                )?;
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
            Some(found) => {
                let reason = inline(&found.reason);
                let summary = inline(&found.summary);
                writeln!(out, "Recommended: **{}** - {summary}\n", found.label)?;
                writeln!(out, "Details: {reason}\n")?;
            }
            None => writeln!(
                out,
                "No configuration is feasible and meets the criteria.\n"
            )?,
        }
    }
    if let Some(iso9283) = &report.iso9283 {
        out.push_str(&super::iso9283::report_markdown(iso9283));
    }
    if let Some(excitation) = &report.excitation {
        out.push_str(&super::excitation::report_markdown(excitation));
    }
    if !report.trace.is_empty() {
        writeln!(out, "\n## Requirements\n")?;
        writeln!(
            out,
            "| Requirement | Criterion | Outcome | Met | Failed | Not evaluated \
             |\n|---|---|---|--:|--:|--:|"
        )?;
        for row in &report.trace {
            let outcome = match row.outcome {
                TraceOutcome::Met => "met",
                TraceOutcome::Missed => "**failed**",
                TraceOutcome::NotJudged => "**not evaluated**",
            };
            writeln!(
                out,
                "| {} | {} | {outcome} | {} | {} | {} |",
                inline(&row.requirement),
                inline(&row.criterion),
                row.met,
                row.missed,
                row.not_judged
            )?;
        }
        writeln!(out)?;
    }
    for failure in &report.engine_failures {
        writeln!(
            out,
            "- engine {} failed: {}",
            failure.engine,
            inline(&failure.message)
        )?;
    }
    if !report.enclosure.is_empty() {
        writeln!(
            out,
            "\n| Link | Primitives to mesh, mean (mm) | Maximum (mm) | Mesh protrusion, maximum \
             (mm) |\n|---|--:|--:|--:|"
        )?;
        for each in &report.enclosure {
            writeln!(
                out,
                "| {} | {:.2} | {:.2} | {:.2} |",
                inline(&each.link),
                each.mean_overhang_m * 1e3,
                each.worst_overhang_m * 1e3,
                each.worst_protrusion_m * 1e3
            )?;
        }
        writeln!(out)?;
    }
    for note in report.notes.iter().filter(|note| !qualifies(note)) {
        writeln!(out, "- note: {}", inline(note))?;
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

/// Criteria met, failed and not evaluated.
fn write_judged(out: &mut String, report: &Report) -> std::fmt::Result {
    let failed: Vec<_> = report
        .criteria
        .iter()
        .filter(|result| !result.pass)
        .collect();
    writeln!(out, "{}.\n", paragraph(&counts(report)))?;
    let is_list = !failed.is_empty() || !report.not_judged.is_empty();
    for result in failed {
        writeln!(
            out,
            "- {} {} {}: {} {}",
            inline(&result.goal),
            result.label.as_deref().unwrap_or(""),
            result.engine.as_deref().unwrap_or(""),
            result.criterion,
            inline(&result.detail)
        )?;
    }
    for (label, reason, criteria) in not_judged(report) {
        writeln!(
            out,
            "- not evaluated: {}: {criteria} ({})",
            inline(&label),
            inline(reason)
        )?;
    }
    if is_list {
        writeln!(out)?;
    }
    Ok(())
}

/// What was not evaluated: goal and configuration, why, and which criteria, those of one reason together.
fn not_judged(report: &Report) -> Vec<(String, &str, String)> {
    let mut found: Vec<(String, &str, String)> = Vec::new();
    for each in &report.not_judged {
        let label = each.label.as_deref().unwrap_or_default();
        let subject = format!("{} {label}", each.goal).trim_end().to_owned();
        match found.last_mut() {
            Some((of, reason, criteria)) if *of == subject && *reason == each.reason => {
                criteria.push_str(", ");
                criteria.push_str(&each.criterion);
            }
            _ => found.push((subject, &each.reason, each.criterion.clone())),
        }
    }
    found
}

/// The configurations of a goal, with the metrics that the table of metrics gives a heading.
fn write_configurations(
    out: &mut String,
    report: &Report,
    goal: &GoalReport,
    engines: &[EngineHeading],
) -> std::fmt::Result {
    let columns: Vec<(String, Shown)> = shown_metrics(engines, |heading| heading.summary)
        .filter(|(_, shown)| shown.says_something(goal))
        .collect();
    write!(out, "| Configuration | Status |")?;
    for (heading, _) in &columns {
        write!(out, " {heading} |")?;
    }
    write!(out, "\n|---|---|")?;
    writeln!(out, "{}", "--:|".repeat(columns.len()))?;
    for each in &goal.configurations {
        let status = match (each.status, each.rejections.first()) {
            (Status::Rejected, Some(first)) => format!("rejected: {}", rule_in_words(first.rule)),
            _ => status(report, &goal.name, each).to_owned(),
        };
        let mark = match &goal.recommended {
            Some(found) if found.label == each.label => "**",
            _ => "",
        };
        write!(out, "| {mark}{}{mark} | {status} |", each.label)?;
        for (_, shown) in &columns {
            write!(out, " {} |", shown.text(each))?;
        }
        writeln!(out)?;
    }
    Ok(())
}
