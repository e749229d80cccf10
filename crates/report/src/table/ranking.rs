//! The comparison table of a goal: rank, score, Pareto set and contributions to the score.

use needlebench_evaluation::metric::Metric;
use needlebench_evaluation::ranking::{GoalRanking, RankedMetric, RankingReport};
use needlebench_evaluation::report::{ConfigurationReport, GoalReport};
use needlebench_show::{Cell, CellAlignment, Color, Table, layout, plain_table};

/// A row of the table: configurations that were ranked, first choice first.
pub(crate) struct Row<'a> {
    pub configuration: &'a ConfigurationReport,
    pub ranking: &'a RankingReport,
}

/// The ranked configurations, first choice first.
pub(crate) fn rows(goal: &GoalReport) -> Vec<Row<'_>> {
    let mut rows: Vec<Row<'_>> = goal
        .configurations
        .iter()
        .filter_map(|configuration| {
            let ranking = configuration.ranking.as_ref()?;
            Some(Row {
                configuration,
                ranking,
            })
        })
        .collect();
    rows.sort_by_key(|row| row.ranking.rank);
    rows
}

/// Columns of metrics in the table: more would make it wider than the one above it.
const MOST_COLUMNS: usize = 6;

/// Metrics that count, split into those that decide most, in the order of the report, and others.
fn split<'a>(
    ranking: &'a GoalRanking,
    rows: &[Row<'_>],
) -> (Vec<&'a RankedMetric>, Vec<&'a RankedMetric>) {
    let spread = |metric: &RankedMetric| {
        let contributions = || {
            rows.iter().filter_map(|row| {
                let mut terms = row.ranking.terms.iter();
                let term = terms.find(|term| term.metric == metric.name)?;
                Some(term.contribution)
            })
        };
        let most = contributions().fold(f64::NEG_INFINITY, f64::max);
        most - contributions().fold(f64::INFINITY, f64::min)
    };
    let counted = counted(ranking);
    let mut by_spread: Vec<usize> = (0..counted.len()).collect();
    by_spread.sort_by(|&a, &b| spread(counted[b]).total_cmp(&spread(counted[a])));
    by_spread.retain(|&index| spread(counted[index]) > 0.0);
    by_spread.truncate(MOST_COLUMNS);
    let (mut shown, mut others) = (Vec::new(), Vec::new());
    for (index, metric) in counted.into_iter().enumerate() {
        if by_spread.contains(&index) {
            shown.push(metric);
        } else {
            others.push(metric);
        }
    }
    (shown, others)
}

/// Metrics that count: weighted, and measured for all.
pub(crate) fn counted(ranking: &GoalRanking) -> Vec<&RankedMetric> {
    ranking
        .metrics
        .iter()
        .filter(|metric| metric.weight > 0.0 && metric.not_measured_for.is_empty())
        .collect()
}

/// Value of a metric as people read it, and what it contributes in per cent of the whole score.
pub(crate) fn value_and_contribution(row: &Row<'_>, name: &str) -> (String, String) {
    let Some(term) = row.ranking.terms.iter().find(|term| term.metric == name) else {
        return ("-".to_owned(), "-".to_owned());
    };
    let value = Metric::of_key(name).map_or(term.value.to_string(), |metric| {
        metric.quantity.text(term.value)
    });
    (value, format!("{:.1}", term.contribution * 100.0))
}

pub(crate) fn pareto_text(configuration: &ConfigurationReport) -> String {
    match &configuration.dominated_by {
        None => "yes".to_owned(),
        Some(dominance) => format!("below {}", dominance.label),
    }
}

/// Name of a metric in words.
pub(crate) fn words(metric: &'static str) -> &'static str {
    Metric::of_key(metric).map_or(metric, |known| known.words)
}

/// Heading of a metric in two or three short lines: words and weight.
fn heading(metric: &RankedMetric) -> String {
    format!(
        "{}\nx {}",
        layout::in_lines(words(metric.name), 14),
        metric.weight
    )
}

/// The comparison table and what there is to say of it; none if fewer than two configurations
/// were ranked.
pub(crate) fn comparison_text(goal: &GoalReport) -> Option<String> {
    let rows = rows(goal);
    let ranking = goal.ranking.as_ref().filter(|_| rows.len() > 1)?;
    let (metrics, others) = split(ranking, &rows);
    let mut lines = vec![
        table(&rows, &metrics).to_string(),
        "score of 100; in brackets: weighted contribution of each metric".to_owned(),
    ];
    if !others.is_empty() {
        let words: Vec<String> = others
            .iter()
            .map(|metric| format!("{} x {}", words(metric.name), metric.weight))
            .collect();
        lines.push(format!(
            "also counted, with smaller or no differences: {}",
            words.join(", ")
        ));
    }
    Some(lines.join("\n"))
}

fn table(rows: &[Row<'_>], metrics: &[&RankedMetric]) -> Table {
    let mut header = vec![
        String::new(),
        "configuration".to_owned(),
        "score".to_owned(),
    ];
    header.extend(metrics.iter().map(|metric| heading(metric)));
    header.push("Pareto set".to_owned());
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    let mut table = plain_table(&header);
    for row in rows {
        let right = |text: String| Cell::new(text).set_alignment(CellAlignment::Right);
        let label = Cell::new(row.configuration.label);
        let mut cells = vec![
            right(row.ranking.rank.to_string()),
            if row.ranking.rank == 1 {
                label.fg(Color::Green)
            } else {
                label
            },
            right(format!("{:.1}", row.ranking.score * 100.0)),
        ];
        for metric in metrics {
            let (value, contribution) = value_and_contribution(row, metric.name);
            cells.push(right(format!("{value} ({contribution})")));
        }
        cells.push(Cell::new(pareto_text(row.configuration)));
        table.add_row(cells);
    }
    table
}
