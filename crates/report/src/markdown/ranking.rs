//! The ranking of a goal.

use needlebench_evaluation::report::GoalReport;

use crate::table::ranking::{counted, pareto_text, rows, value_and_contribution, words};

/// The ranking as a table; empty if fewer than two configurations were ranked.
pub(super) fn ranking_markdown(goal: &GoalReport) -> String {
    let rows = rows(goal);
    let Some(ranking) = goal.ranking.as_ref().filter(|_| rows.len() > 1) else {
        return String::new();
    };
    let metrics = counted(ranking);
    let mut header = vec!["Rank | Configuration | Score | Pareto set".to_owned()];
    header.extend(
        metrics
            .iter()
            .map(|metric| format!("{}, weight {}", words(metric.name), metric.weight)),
    );
    let mut lines = vec![
        header.join(" | "),
        format!("--:|---|--:|---{}", "|--:".repeat(metrics.len())),
    ];
    for row in &rows {
        let mut cells = vec![
            row.ranking.rank.to_string(),
            row.configuration.label.to_owned(),
            format!("{:.1}", row.ranking.score * 100.0),
            pareto_text(row.configuration),
        ];
        cells.extend(metrics.iter().map(|metric| {
            let (value, contribution) = value_and_contribution(row, metric.name);
            format!("{value} ({contribution})")
        }));
        lines.push(cells.join(" | "));
    }
    let rows: Vec<String> = lines.iter().map(|line| format!("| {line} |")).collect();
    format!(
        "{}\n\nScores of 100; in brackets: contribution of each metric.\n",
        rows.join("\n")
    )
}
