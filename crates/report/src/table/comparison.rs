//! Two results side by side.

use comfy_table::{Cell, CellAlignment, Color};
use needlebench_evaluation::compare::{
    Change, Comparison, ConfigurationComparison, GoalComparison, MetricComparison, Side,
};

use super::plain_table;

fn change_text(change: Change) -> &'static str {
    match change {
        Change::Better => "better",
        Change::Worse => "worse",
        Change::Changed => "changed",
        Change::Same => "same",
        Change::Lost => "lost",
        Change::New => "new",
    }
}

pub(crate) fn side_text(name: &str, side: &Side) -> String {
    let or_unknown = |text: &Option<String>| text.clone().unwrap_or_else(|| "unknown".to_owned());
    format!(
        "{name}: {}: {}, verdict {}, needlebench {} ({})",
        side.source,
        or_unknown(&side.scenario),
        or_unknown(&side.verdict),
        or_unknown(&side.version),
        or_unknown(&side.git_revision)
    )
}

pub(crate) fn goal_title(goal: &GoalComparison) -> String {
    match (&goal.a, &goal.b) {
        (Some(a), Some(b)) if a == b => format!("goal {a}"),
        (Some(a), Some(b)) => format!("goal {a}, in B {b}"),
        (Some(a), None) => format!("goal {a}: only in A"),
        (_, b) => format!("goal {}: only in B", b.as_deref().unwrap_or_default()),
    }
}

fn status_text(status: Option<&String>, rejection: Option<&String>) -> String {
    match (status, rejection) {
        (None, _) => "missing".to_owned(),
        (Some(status), None) => status.clone(),
        (Some(status), Some(rejection)) => format!("{status} ({rejection})"),
    }
}

/// Changes of status, then of the recommendation.
pub(crate) fn remarks(goal: &GoalComparison) -> Vec<String> {
    let mut lines = Vec::new();
    if goal.a.is_none() || goal.b.is_none() {
        return lines;
    }
    for each in &goal.configurations {
        let a = status_text(each.status_a.as_ref(), each.rejection_a.as_ref());
        let b = status_text(each.status_b.as_ref(), each.rejection_b.as_ref());
        let rule = |text: &Option<String>| {
            let rule = text.as_deref().and_then(|text| text.split(':').next());
            rule.map(str::to_owned)
        };
        // The same rule with other numbers is no change of status.
        let other_rule = rule(&each.rejection_a) != rule(&each.rejection_b);
        if each.status != Change::Same || other_rule {
            let way = match each.status {
                Change::Same => String::new(),
                change => format!("{}: ", change_text(change)),
            };
            lines.push(format!("{}: {way}{a} -> {b}", each.label));
        }
    }
    if goal.recommended_a != goal.recommended_b {
        let text = |label: &Option<String>| label.clone().unwrap_or_else(|| "none".to_owned());
        lines.push(format!(
            "recommended: {} -> {}",
            text(&goal.recommended_a),
            text(&goal.recommended_b)
        ));
    }
    lines
}

/// A metric as people read it: words, both values, change with its share.
pub(crate) fn metric_texts(found: &MetricComparison) -> [String; 5] {
    let text = |value: f64| found.key.metric().quantity.text(value);
    let or_missing = |value: Option<f64>| value.map_or("-".to_owned(), text);
    let change = match (found.change, found.relative) {
        (None, _) => "-".to_owned(),
        (Some(change), relative) => {
            let sign = if change > 0.0 && found.outcome != Change::Same {
                "+"
            } else {
                ""
            };
            // From nearly nothing to something is no percentage.
            let share = relative
                .filter(|share| found.outcome != Change::Same && share.abs() < 10.0)
                .map_or(String::new(), |share| format!(" ({:+.0} %)", share * 100.0));
            format!("{sign}{}{share}", text(change))
        }
    };
    [
        found.key.words(),
        or_missing(found.a),
        or_missing(found.b),
        change,
        change_text(found.outcome).to_owned(),
    ]
}

/// Metrics worth a row: of configurations that work in either result, those that changed and say most
/// of what they are about, or all.
pub(crate) fn rows(
    goal: &GoalComparison,
    all: bool,
) -> Vec<(&ConfigurationComparison, &MetricComparison)> {
    goal.configurations
        .iter()
        .filter(|each| each.works_in_either())
        .filter(|each| each.status_a.is_some() && each.status_b.is_some())
        .flat_map(|each| {
            let telling: Vec<&MetricComparison> = if all {
                each.metrics.iter().collect()
            } else {
                let telling = each.telling_metrics();
                telling
                    .filter(|found| found.outcome != Change::Same)
                    .collect()
            };
            telling.into_iter().map(move |found| (each, found))
        })
        .collect()
}

pub(crate) fn unchanged(goal: &GoalComparison) -> usize {
    let same = |(_, found): &(_, &MetricComparison)| found.outcome == Change::Same;
    rows(goal, true).iter().filter(|row| same(row)).count()
}

/// The comparison as text; `all` lists metrics that did not change too.
pub fn comparison_text(comparison: &Comparison, all: bool) -> String {
    let mut lines = vec![side_text("A", &comparison.a), side_text("B", &comparison.b)];
    for difference in &comparison.provenance_differences {
        let text = |side: &Option<String>| side.clone().unwrap_or_else(|| "none".to_owned());
        lines.push(format!(
            "  {}: {} -> {}",
            difference.what,
            text(&difference.a),
            text(&difference.b)
        ));
    }
    lines.extend(comparison.notes.iter().map(|note| format!("note: {note}")));
    for goal in &comparison.goals {
        lines.push(String::new());
        lines.push(goal_title(goal));
        lines.extend(remarks(goal));
        let rows = rows(goal, all);
        if !rows.is_empty() {
            let mut table = plain_table(&["configuration", "metric", "A", "B", "change", ""]);
            let mut last = "";
            for (configuration, found) in rows {
                let [words, a, b, change, outcome] = metric_texts(found);
                let right = |text: String| Cell::new(text).set_alignment(CellAlignment::Right);
                let outcome = match found.outcome {
                    Change::Worse | Change::Lost => Cell::new(outcome).fg(Color::Red),
                    Change::Better | Change::New => Cell::new(outcome).fg(Color::Green),
                    Change::Same | Change::Changed => Cell::new(outcome),
                };
                // The name once, over all its metrics.
                let name = if configuration.label == last {
                    ""
                } else {
                    &configuration.label
                };
                last = &configuration.label;
                table.add_row(vec![
                    Cell::new(name),
                    Cell::new(words),
                    right(a),
                    right(b),
                    right(change),
                    outcome,
                ]);
            }
            lines.push(table.to_string());
        }
        if !all && goal.a.is_some() && goal.b.is_some() {
            lines.push(format!("{} values are the same", unchanged(goal)));
        }
    }
    lines.push(String::new());
    for failure in &comparison.failures {
        lines.push(format!("FAILED {}", failure_text(failure)));
    }
    lines.push(verdict(comparison));
    lines.join("\n")
}

fn verdict(comparison: &Comparison) -> String {
    let incomplete = comparison.incomplete.join("; ");
    match (comparison.failures.len(), comparison.incomplete.is_empty()) {
        (0, true) => "PASS: nothing was lost beyond what is allowed".to_owned(),
        (0, false) => format!("INCOMPLETE: nothing is known to be lost, but {incomplete}"),
        (count, complete) => {
            let losses = if count == 1 { "loss" } else { "losses" };
            let more = if complete {
                String::new()
            } else {
                format!("; {incomplete}")
            };
            format!("FAIL: {count} {losses}{more}")
        }
    }
}

pub(crate) fn failure_text(failure: &needlebench_evaluation::compare::ComparisonFailure) -> String {
    let place: Vec<&str> = [failure.goal.as_deref(), failure.label.as_deref()]
        .into_iter()
        .flatten()
        .collect();
    if place.is_empty() {
        failure.detail.clone()
    } else {
        format!("{}: {}", place.join(" "), failure.detail)
    }
}
