//! The table that a run prints.

use std::collections::BTreeSet;
use std::fmt::Write;

use comfy_table::{Cell, CellAlignment, Color, Table};
use needlebench_engine::Engine;
use needlebench_evaluation::iso9283::SUBJECT;
use needlebench_evaluation::report::{GoalReport, Report, Status};

use super::budget::budget_text;
use super::engine_headings::{EngineHeading, engine_headings};
use super::events::events_text;
use super::plain_table;
use super::ranking::comparison_text;
use super::shown::{Shown, shown_metrics};
use super::verdict::{capitals, counts, status};
use crate::number::value_and_limit;

/// The whole report as text; `engines` are those that there are, with their titles.
pub fn report_text(report: &Report, engines: &[&'static dyn Engine]) -> String {
    let mut text = String::new();
    // Writing to a String cannot fail.
    let _ = write_report(&mut text, report, engines);
    text
}

fn write_report(
    out: &mut String,
    report: &Report,
    engines: &[&'static dyn Engine],
) -> std::fmt::Result {
    let headings = engine_headings(report, engines);
    for goal in &report.goals {
        writeln!(out, "{}", goal_heading(goal))?;
        writeln!(out, "{}", goal_table(report, goal, &headings))?;
        writeln!(out, "* worst of those that work, < recommended")?;
        if let Some(comparison) = comparison_text(goal) {
            writeln!(out, "{comparison}")?;
        }
        if goal.configurations.iter().any(|each| each.room.is_some()) {
            writeln!(out, "room for people, in the final posture")?;
            writeln!(out, "{}", room_table(goal))?;
        }
        if let Some(events) = events_text(goal) {
            write!(out, "{events}")?;
        }
        if let Some(budget) = budget_text(goal) {
            write!(out, "{budget}")?;
        }
        if let Some(table) = super::referee::referee_table(goal) {
            writeln!(
                out,
                "each engine beside the referee: distance of the needle's tips"
            )?;
            writeln!(out, "{table}")?;
        }
        out.push_str(&super::saturation::saturation_text(goal));
        write_remarks(out, report, goal)?;
    }
    if let Some(iso9283) = &report.iso9283 {
        out.push_str(&super::iso9283::report_text(iso9283));
        write_missed(out, report, SUBJECT)?;
    }
    for failure in &report.engine_failures {
        let during = failure
            .during
            .as_ref()
            .map_or(String::new(), |during| format!(" in {during}"));
        writeln!(
            out,
            "engine {} failed{during}: {}",
            failure.engine, failure.message
        )?;
    }
    for each in &report.enclosure {
        writeln!(
            out,
            "enclosing primitives of {}: {:.2} mm off its mesh on average, {:.2} mm at most; the \
             mesh reaches {:.2} mm out of them",
            each.link,
            each.mean_overhang_m * 1e3,
            each.worst_overhang_m * 1e3,
            each.worst_protrusion_m * 1e3
        )?;
    }
    for note in &report.notes {
        writeln!(out, "note: {note}")?;
    }
    writeln!(out, "{}: {}", capitals(report.verdict), counts(report))
}

fn goal_heading(goal: &GoalReport) -> String {
    let lesion = goal
        .lesion
        .as_ref()
        .map_or(String::new(), |name| format!(", lesion {name}"));
    let standoff = goal.standoff_m.map_or(String::new(), |standoff_m| {
        format!(", guide {:.1} mm off the skin", standoff_m * 1e3)
    });
    format!(
        "\ngoal {}{lesion}: needle {:.1} mm beyond the guide{standoff}",
        goal.name,
        goal.insertion_length_m * 1e3
    )
}

/// One column of the table: a metric, of one engine where each has its own.
struct Column {
    heading: String,
    metric: Shown,
}

/// The columns of a goal's table, in their order.
fn columns(engines: &[EngineHeading]) -> Vec<Column> {
    shown_metrics(engines, |heading| heading.table)
        .map(|(heading, metric)| Column { heading, metric })
        .collect()
}

/// The eight rows of a goal; the worst number of each column is marked with `*` and in colour.
fn goal_table(report: &Report, goal: &GoalReport, headings: &[EngineHeading]) -> Table {
    let columns = columns(headings);
    let mut header = vec!["configuration", "status"];
    header.extend(columns.iter().map(|column| column.heading.as_str()));
    let mut table = plain_table(&header);
    let worst: Vec<Option<f64>> = columns
        .iter()
        .map(|column| worst_of(goal, column))
        .collect();
    let recommended = goal.recommended.as_ref().map(|found| found.label.as_str());
    for configuration in &goal.configurations {
        let chosen = recommended == Some(configuration.label);
        let name = if chosen {
            format!("{} <", configuration.label)
        } else {
            configuration.label.to_owned()
        };
        let status = match (configuration.status, configuration.rejections.first()) {
            (Status::Rejected, Some(first)) => Cell::new(first.rule).fg(Color::Yellow),
            _ => match status(report, &goal.name, configuration) {
                failed @ "failed" => Cell::new(failed).fg(Color::Red),
                incomplete @ "incomplete" => Cell::new(incomplete).fg(Color::Yellow),
                other => Cell::new(other),
            },
        };
        let mut row = vec![
            if chosen {
                Cell::new(name).fg(Color::Green)
            } else {
                Cell::new(name)
            },
            status,
        ];
        for (column, worst) in columns.iter().zip(&worst) {
            let cell = match column.metric.value(configuration) {
                None => Cell::new("-"),
                Some((value, text))
                    if Some(value) == *worst && configuration.status != Status::Rejected =>
                {
                    Cell::new(format!("{text}*")).fg(Color::Red)
                }
                Some((_, text)) => Cell::new(text),
            };
            row.push(cell.set_alignment(CellAlignment::Right));
        }
        table.add_row(row);
    }
    table
}

/// What each configuration leaves to people; `-` without a posture.
fn room_table(goal: &GoalReport) -> Table {
    let rooms = || {
        goal.configurations
            .iter()
            .filter_map(|each| each.room.as_ref())
    };
    let regions: BTreeSet<&'static str> = rooms()
        .flat_map(|room| room.regions.keys().copied())
        .collect();
    // The same people for all: those of the first that has any.
    let people: Vec<(String, f64)> = rooms().next().map_or(Vec::new(), |room| {
        let named = room
            .sight
            .iter()
            .map(|each| (each.person.clone(), each.stature_m));
        named.collect()
    });
    let mut header = vec!["configuration".to_owned(), "free\n(%)".to_owned()];
    header.extend(regions.iter().map(|region| format!("\n{region}")));
    header.push("sight\n(%)".to_owned());
    header.extend(
        people
            .iter()
            .map(|(name, stature_m)| format!("{name}\n{stature_m:.2} m")),
    );
    header.extend(
        [
            "hand cone\n(deg)",
            "blocked\nby",
            "elbow",
            "over entry\n(mm)",
        ]
        .map(str::to_owned),
    );
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    let mut table = plain_table(&header);
    for configuration in &goal.configurations {
        let mut row = vec![configuration.label.to_owned()];
        if let Some(room) = &configuration.room {
            row.push(percent(room.free_fraction));
            for region in &regions {
                row.push(
                    room.regions
                        .get(region)
                        .map_or("-".to_owned(), |free| percent(*free)),
                );
            }
            row.push(percent(room.sight_fraction));
            row.extend(room.sight.iter().map(|seen| percent(seen.fraction)));
            row.push(format!("{:.1}", room.hand_cone_half_angle_rad.to_degrees()));
            row.push(room.hand_cone_blocker.clone().unwrap_or("-".to_owned()));
            row.push(if room.elbow_up { "up" } else { "down" }.to_owned());
            row.push(format!("{:.0}", 1e3 * room.elbow_over_entry_m));
        } else {
            row.resize(header.len(), "-".to_owned());
        }
        let cells = row.into_iter().enumerate().map(|(at, text)| {
            let is_text = at == 0 || header[at].starts_with("blocked") || header[at] == "elbow";
            let cell = Cell::new(text);
            if is_text {
                cell
            } else {
                cell.set_alignment(CellAlignment::Right)
            }
        });
        table.add_row(cells);
    }
    table
}

fn percent(fraction: f64) -> String {
    format!("{:.0}", 100.0 * fraction)
}

/// The worst value of a column, if the configurations that work differ in it at all.
fn worst_of(goal: &GoalReport, column: &Column) -> Option<f64> {
    /// Relative spread below which no value is worse than another.
    const SPREAD: f64 = 0.01;
    let values: Vec<(f64, String)> = goal
        .configurations
        .iter()
        .filter(|each| each.status != Status::Rejected)
        .filter_map(|each| column.metric.value(each))
        .collect();
    let least = values.iter().map(|(value, _)| *value).reduce(f64::min)?;
    let most = values.iter().map(|(value, _)| *value).reduce(f64::max)?;
    let all_read_the_same = values.iter().all(|(_, text)| *text == values[0].1);
    if all_read_the_same || most - least <= SPREAD * most.abs() {
        return None;
    }
    Some(if column.metric.more_is_better() {
        least
    } else {
        most
    })
}

/// Criteria on a goal, or on what stands in its place, that were not met.
fn write_missed(out: &mut String, report: &Report, goal: &str) -> std::fmt::Result {
    for result in report
        .criteria
        .iter()
        .filter(|result| result.goal == goal && !result.pass)
    {
        let measured = result.value.zip(result.limit).map(|(value, limit)| {
            let (value, limit) = value_and_limit(value, limit, result.unit);
            format!("{value}, limit {limit}")
        });
        let parts = [
            result.label.clone(),
            result.engine.clone(),
            Some(format!("{}:", result.criterion)),
            measured,
            Some(result.detail.clone()),
        ];
        let parts: Vec<String> = parts
            .into_iter()
            .flatten()
            .filter(|p| !p.is_empty())
            .collect();
        writeln!(out, "FAILED {}", parts.join(" "))?;
    }
    Ok(())
}

fn write_remarks(out: &mut String, report: &Report, goal: &GoalReport) -> std::fmt::Result {
    if let Some(route) = goal
        .configurations
        .first()
        .and_then(|each| each.clearance.classes.get("needle_route"))
    {
        writeln!(
            out,
            "needle route: {:.1} mm from {}",
            route.minimum_m * 1e3,
            route.pair[1]
        )?;
    }
    for configuration in &goal.configurations {
        if let Some(rejection) = configuration.rejections.first() {
            let (value, limit) = value_and_limit(rejection.value, rejection.limit, rejection.unit);
            writeln!(
                out,
                "{}: {}: {value} (limit {limit}): {}",
                configuration.label, rejection.rule, rejection.detail
            )?;
        }
    }
    write_missed(out, report, &goal.name)?;
    match &goal.recommended {
        Some(found) => writeln!(out, "recommended: {} - {}", found.label, found.reason),
        None => writeln!(out, "recommended: none, no configuration works"),
    }
}
