//! The accuracy table as Markdown.

use needlebench_evaluation::accuracy::{AccuracyRow, AccuracyTable, QUANTITIES};
use needlebench_scenario::published::Anchor;
use needlebench_show::markdown::inline;

use super::{
    APART, BEFORE, before_in_words, caption, cell, figure, footnotes, hits, is_tested, measured,
    own_figures, p_value, published,
};

const PLUS_MINUS: &str = "\u{b1}";

/// Caption, table, notes, and published values.
pub(crate) fn accuracy_markdown(table: &AccuracyTable) -> String {
    let mut lines = vec![
        format!("# Accuracy: {}", inline(&table.name)),
        String::new(),
    ];
    lines.push(inline(&caption(table).join(" ")));
    lines.push(String::new());
    let mut header = vec![inline(&table.by.join(", ")), "n".to_owned()];
    for at in measured(table) {
        let quantity = QUANTITIES[at];
        header.push(format!("{} ({})", quantity.heading, quantity.unit().symbol));
    }
    header.push("hits".to_owned());
    lines.push(row_of(&header));
    lines.push(format!("|---|{}", "--:|".repeat(header.len() - 1)));
    for row in &table.groups {
        lines.push(row_of(&cells(table, row)));
    }
    lines.push(row_of(&cells(table, &table.all)));
    if is_tested(table) {
        let mut row = vec!["p".to_owned(), String::new()];
        row.extend(measured(table).map(|at| p_value(&table.tests[at])));
        row.push(String::new());
        lines.push(row_of(&row));
    }
    lines.push(String::new());
    for note in footnotes(table) {
        lines.push(format!("- {}", inline(&note)));
    }
    let (before, apart) = published();
    lines.extend([String::new(), format!("## {BEFORE}"), String::new()]);
    lines.extend([before_in_words(table).to_owned(), String::new()]);
    lines.push("| Source | Error | Measured | System; subject | n | DOI |".to_owned());
    lines.push("|---|--:|---|---|---|---|".to_owned());
    for (heading, text) in own_figures(table, PLUS_MINUS) {
        let name = inline(&table.name);
        let n = table.all.n;
        lines.push(format!(
            "| **{name}** | {text} | {heading} | simulation | {n} | |"
        ));
    }
    lines.extend(before.iter().map(|anchor| published_row(anchor, None)));
    lines.extend([String::new(), format!("## {APART}"), String::new()]);
    lines.push("| Source | Error | Stage | Measured | System; subject | n | DOI |".to_owned());
    lines.push("|---|--:|---|---|---|---|---|".to_owned());
    for anchor in &apart {
        lines.push(published_row(anchor, Some(anchor.stage.words())));
    }
    lines.push(String::new());
    lines.join("\n")
}

fn published_row(anchor: &Anchor, stage: Option<&str>) -> String {
    let mut row = vec![anchor.label(), figure(anchor, PLUS_MINUS)];
    row.extend(stage.map(str::to_owned));
    row.extend([
        anchor.measured.clone(),
        format!("{}; {}", anchor.system, anchor.subject),
        anchor.count(),
    ]);
    let mut row: Vec<String> = row.iter().map(|text| inline(text)).collect();
    row.push(format!("[{0}](https://doi.org/{0})", anchor.doi));
    row_of(&row)
}

fn cells(table: &AccuracyTable, row: &AccuracyRow) -> Vec<String> {
    let mut cells = vec![inline(&row.label), row.n.to_string()];
    cells.extend(measured(table).map(|at| cell(row, at, PLUS_MINUS)));
    cells.push(hits(row));
    cells
}

fn row_of(cells: &[String]) -> String {
    format!("| {} |", cells.join(" | "))
}
