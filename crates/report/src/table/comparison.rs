//! Two results side by side.

use needlebench_evaluation::compare::{
    Change, Comparison, ComparisonFailure, ConfigurationComparison, GoalComparison,
    MetricComparison, Side,
};
use needlebench_show::{Cell, CellAlignment, Color, Table, plain_table};

use super::verdict::capitals;

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
    let source = side
        .source_sha256
        .as_ref()
        .map(|hash| format!("source {}", hash.get(..12).unwrap_or(hash)));
    format!(
        "{name}: {}: {}, verdict {}, needlebench {} ({})",
        side.source,
        or_unknown(&side.scenario),
        or_unknown(&side.verdict),
        or_unknown(&side.version),
        or_unknown(&side.git_revision.clone().or(source))
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

/// Metrics worth a row: of feasible configurations in either result, those that changed and say most of what they are
/// about, or all.
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

/// Regressions that one screen lists, and metrics; of more, the number is printed.
const MOST_LISTED: usize = 8;
const MOST_METRICS: usize = 12;

/// The comparison in one screen: verdict, regressions, the outcome of each goal, and of each metric how many
/// configurations are better or worse by it.
pub fn comparison_screen(comparison: &Comparison) -> String {
    let mut lines = vec![verdict(comparison)];
    let failures = &comparison.failures;
    let listed = failures.iter().take(MOST_LISTED);
    lines.extend(listed.map(|failure| format!("  FAILED {}", failure_line(failure))));
    if failures.len() > MOST_LISTED {
        lines.push(format!("  and {} more", failures.len() - MOST_LISTED));
    }
    lines.extend(sides(comparison));
    let goals: Vec<&GoalComparison> = comparison.goals.iter().collect();
    if goals.iter().any(|goal| has_news(goal)) {
        lines.push(String::new());
        lines.push(goals_table(&goals).to_string());
    }
    let metrics = metric_changes(&goals);
    let (judged, others): (Vec<_>, Vec<_>) = metrics.into_iter().partition(|each| each.is_judged);
    if !judged.is_empty() {
        lines.push(String::new());
        lines.push(
            "configurations with a motion in A and B; metrics used by criteria or ranking"
                .to_owned(),
        );
        lines.push(metrics_table(&judged).to_string());
    }
    let more = others.len() + judged.len().saturating_sub(MOST_METRICS);
    if more > 0 {
        lines.push(format!(
            "{more} more metrics changed; --wide prints each configuration separately"
        ));
    } else if judged.is_empty() {
        lines.push("no value changed beyond its resolution".to_owned());
    }
    lines.join("\n")
}

/// A regression in one screen, without its hint.
fn failure_line(failure: &ComparisonFailure) -> String {
    let text = failure_text(failure);
    match text.split_once("; ") {
        Some((first, _)) if first.contains('(') && !first.contains(')') => format!("{first})"),
        Some((first, _)) => first.to_owned(),
        None => text,
    }
}

/// Metrics that changed of configurations with a motion in both results, whether or not they meet the criteria.
fn changed_rows(goal: &GoalComparison) -> Vec<(&ConfigurationComparison, &MetricComparison)> {
    let moved = |status: &Option<String>| status.as_deref().is_some_and(|it| it != "rejected");
    let mut changed = rows(goal, false);
    changed.retain(|(each, _)| moved(&each.status_a) && moved(&each.status_b));
    changed
}

/// Whether criteria or the ranking use a metric.
fn is_judged(found: &MetricComparison) -> bool {
    let metric = found.key.metric();
    !found.key.is_of_engine() && (metric.ranking_key.is_some() || metric.criterion.is_some())
}

/// Whether something of a goal changed that is not a metric, or metrics did.
fn has_news(goal: &GoalComparison) -> bool {
    goal.a.is_none()
        || goal.b.is_none()
        || !remarks(goal).is_empty()
        || !rows(goal, false).is_empty()
}

/// How many configurations are feasible, which is recommended, and how many values changed.
fn goals_table(goals: &[&GoalComparison]) -> Table {
    let mut table = plain_table(&[
        "goal",
        "feasible\nA to B",
        "recommended\nA to B",
        "values\nbetter",
        "\nworse",
    ]);
    for goal in goals {
        let work = |status: fn(&ConfigurationComparison) -> &Option<String>| {
            let all = goal.configurations.iter();
            all.filter(|each| status(each).as_deref() == Some("ok"))
                .count()
        };
        let works = [work(|each| &each.status_a), work(|each| &each.status_b)];
        let [a, b] = [&goal.recommended_a, &goal.recommended_b]
            .map(|label| label.as_deref().unwrap_or("none"));
        let recommended = if a == b {
            a.to_owned()
        } else {
            format!("{a} to {b}")
        };
        let changed = changed_rows(goal);
        let count = |way: Change| {
            changed
                .iter()
                .filter(|(_, found)| found.outcome == way)
                .count()
        };
        let worse = count(Change::Worse) + count(Change::Lost);
        let name = match (&goal.a, &goal.b) {
            (Some(_), None) => format!("{}, not in B", goal.name()),
            (None, Some(_)) => format!("{}, not in A", goal.name()),
            _ => goal.name().to_owned(),
        };
        let works = if works[1] < works[0] {
            Cell::new(format!("{} to {}", works[0], works[1])).fg(Color::Red)
        } else {
            Cell::new(format!("{} to {}", works[0], works[1]))
        };
        let right = |count: usize| Cell::new(count).set_alignment(CellAlignment::Right);
        let better = count(Change::Better) + count(Change::New);
        table.add_row(vec![
            Cell::new(name),
            works,
            Cell::new(recommended),
            right(better),
            right(worse),
        ]);
    }
    table
}

/// A metric that changed, over all goals and configurations.
struct MetricChanges<'a> {
    words: String,
    is_judged: bool,
    better: usize,
    worse: usize,
    /// The largest change for the worse, or where there is none the largest, and of what.
    largest: Option<(
        &'a GoalComparison,
        &'a ConfigurationComparison,
        &'a MetricComparison,
    )>,
}

fn metric_changes<'a>(goals: &[&'a GoalComparison]) -> Vec<MetricChanges<'a>> {
    let mut all: Vec<MetricChanges<'a>> = Vec::new();
    for goal in goals {
        for (configuration, found) in changed_rows(goal) {
            let words = found.key.words();
            let at = all
                .iter()
                .position(|each| each.words == words)
                .unwrap_or_else(|| {
                    let (better, worse) = (0, 0);
                    all.push(MetricChanges {
                        words,
                        is_judged: is_judged(found),
                        better,
                        worse,
                        largest: None,
                    });
                    all.len() - 1
                });
            let changes = &mut all[at];
            match found.outcome {
                Change::Better => changes.better += 1,
                Change::Worse | Change::Lost => changes.worse += 1,
                // What was not measured before is neither.
                Change::New | Change::Changed | Change::Same => {}
            }
            let size = |found: &MetricComparison| {
                let is_loss = matches!(found.outcome, Change::Worse | Change::Lost);
                (is_loss, found.change.map_or(f64::INFINITY, f64::abs))
            };
            let is_larger = changes.largest.is_none_or(|(_, _, known)| {
                let (new, old) = (size(found), size(known));
                new.0.cmp(&old.0).then(new.1.total_cmp(&old.1)).is_gt()
            });
            if is_larger {
                changes.largest = Some((goal, configuration, found));
            }
        }
    }
    // The metric that is worse most often comes first; the order of the table of metrics breaks ties.
    all.sort_by_key(|each| std::cmp::Reverse((each.worse, each.better)));
    all
}

fn metrics_table(metrics: &[MetricChanges<'_>]) -> Table {
    let mut table = plain_table(&["metric", "better", "worse", "largest change", "where"]);
    for each in metrics.iter().take(MOST_METRICS) {
        let right = |count: usize| Cell::new(count).set_alignment(CellAlignment::Right);
        let (largest, place) = each
            .largest
            .map_or_else(Default::default, |(goal, of, found)| {
                let [_, a, b, change, _] = metric_texts(found);
                // Below the digits that both are shown with.
                let from_to = if a == b {
                    format!("{a}, change {change}")
                } else {
                    format!("{a} to {b}")
                };
                (from_to, format!("{} {}", goal.name(), of.label))
            });
        let worse = if each.worse > 0 {
            right(each.worse).fg(Color::Red)
        } else {
            right(each.worse)
        };
        table.add_row(vec![
            Cell::new(&each.words),
            right(each.better),
            worse,
            Cell::new(largest),
            Cell::new(place),
        ]);
    }
    table
}

/// The two results, other differences between them, and notes.
fn sides(comparison: &Comparison) -> Vec<String> {
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
    lines
}

/// The comparison with a row for each configuration and metric; `all` lists metrics that did not change too.
pub fn comparison_text(comparison: &Comparison, all: bool) -> String {
    let mut lines = vec![verdict(comparison)];
    lines.extend(sides(comparison));
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
            lines.push(format!("{} values are unchanged", unchanged(goal)));
        }
    }
    lines.push(String::new());
    for failure in &comparison.failures {
        lines.push(format!("FAILED {}", failure_text(failure)));
    }
    lines.push(verdict(comparison));
    lines.join("\n")
}

/// The verdict in a line: what was compared, regressions, changes.
pub(crate) fn verdict(comparison: &Comparison) -> String {
    let count = |way: &[Change]| {
        let rows = comparison.goals.iter().flat_map(changed_rows);
        rows.filter(|(_, found)| way.contains(&found.outcome))
            .count()
    };
    let goals = comparison.goals.len();
    let configurations: usize = comparison
        .goals
        .iter()
        .map(|goal| goal.configurations.len())
        .sum();
    let losses = match comparison.failures.len() {
        0 => "no regression beyond the thresholds".to_owned(),
        1 => "1 regression".to_owned(),
        count => format!("{count} regressions"),
    };
    let mut text = format!(
        "{}: {losses} ({goals} {}, {configurations} configurations; with a motion in A and B: {} \
         values better, {} worse)",
        capitals(comparison.verdict),
        if goals == 1 { "goal" } else { "goals" },
        count(&[Change::Better, Change::New]),
        count(&[Change::Worse, Change::Lost])
    );
    for reason in &comparison.incomplete {
        text.push_str("; ");
        text.push_str(reason);
    }
    text
}

pub(crate) fn failure_text(failure: &ComparisonFailure) -> String {
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
