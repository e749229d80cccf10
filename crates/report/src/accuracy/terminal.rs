//! The accuracy table for a terminal of 80 columns: groups side by side, as many as fit.

use needlebench_evaluation::accuracy::{AccuracyRow, AccuracyTable, QUANTITIES};
use needlebench_scenario::published::Anchor;
use needlebench_show::plain_table;

use super::{
    APART, BEFORE, before_in_words, caption, figure, footnotes, hits, is_tested, mean_and_sd,
    measured, p_value, published, range,
};

/// Columns of a terminal.
const WIDTH: usize = 80;
/// Longest line of a group's label.
const LABEL: usize = 14;

/// Caption, tables, notes and published figures.
pub fn accuracy_text(table: &AccuracyTable) -> String {
    let mut text = wrapped(&caption(table).join(" "), "");
    let mut rows: Vec<&AccuracyRow> = table.groups.iter().collect();
    rows.push(&table.all);
    let mut from = 0;
    while from < rows.len() {
        let mut part = String::new();
        let mut to = rows.len();
        while to > from {
            part = side_by_side(table, &rows[from..to], to == rows.len());
            if to == from + 1 || part.lines().all(|line| line.chars().count() <= WIDTH) {
                break;
            }
            to -= 1;
        }
        text.push_str(&part);
        text.push('\n');
        from = to;
    }
    for note in footnotes(table) {
        text.push_str(&wrapped(&note, "  "));
    }
    let (before, apart) = published();
    text.push_str(&wrapped(
        &format!("{BEFORE}. {}", before_in_words(table)),
        "",
    ));
    text.extend(before.into_iter().map(line));
    let count = apart.len();
    let more = format!("{APART}: {count} values with DOIs in accuracy.md.");
    text.push_str(&wrapped(&more, ""));
    text
}

fn line(anchor: &Anchor) -> String {
    let text = format!(
        "- {}: {}, {}: {} ({}; {}; n: {}); doi {}",
        anchor.label(),
        figure(anchor, "\u{b1}"),
        anchor.stage.words(),
        anchor.measured,
        anchor.system,
        anchor.subject,
        anchor.count(),
        anchor.doi
    );
    wrapped(&text, "  ")
}

fn side_by_side(table: &AccuracyTable, rows: &[&AccuracyRow], with_p: bool) -> String {
    let with_p = with_p && is_tested(table);
    let labels: Vec<String> = rows.iter().map(|row| broken(&row.label)).collect();
    let mut header = vec!["mean \u{b1} SD\nrange"];
    header.extend(labels.iter().map(String::as_str));
    header.extend(with_p.then_some("p"));
    let mut shown = plain_table(&header);
    let mut add = |heading: String, cells: Vec<String>, p: String| {
        let mut line = vec![heading];
        line.extend(cells);
        line.extend(with_p.then_some(p));
        shown.add_row(line);
    };
    let counts = rows.iter().map(|row| row.n.to_string()).collect();
    add("n".to_owned(), counts, String::new());
    for at in measured(table) {
        let quantity = QUANTITIES[at];
        let cells = rows.iter().map(|row| {
            let Some(spread) = &row.spreads[at] else {
                return "-".to_owned();
            };
            let mut lines = vec![mean_and_sd(spread, "\u{b1}")];
            lines.extend(range(spread));
            if spread.count < row.n {
                lines.push(format!("n = {}", spread.count));
            }
            lines.join("\n")
        });
        let heading = format!("{} ({})", quantity.heading, quantity.unit().symbol);
        add(broken(&heading), cells.collect(), p_value(&table.tests[at]));
    }
    let cells = rows.iter().map(|row| hits(row)).collect();
    add("hits".to_owned(), cells, String::new());
    shown.to_string()
}

/// A label in lines of at most [`LABEL`] characters.
fn broken(text: &str) -> String {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_inclusive([' ', '-', '_']) {
        let mut word = word;
        loop {
            let length = word.chars().count();
            let room = lines
                .last()
                .map_or(0, |line| LABEL.saturating_sub(line.chars().count()));
            if length <= room + usize::from(word.ends_with(' ')) {
                lines
                    .last_mut()
                    .expect("there is room in it")
                    .push_str(word);
                break;
            }
            if length <= LABEL {
                lines.push(word.to_owned());
                break;
            }
            let cut = word
                .char_indices()
                .nth(LABEL)
                .map_or(word.len(), |(at, _)| at);
            lines.push(word[..cut].to_owned());
            word = &word[cut..];
        }
    }
    let lines: Vec<&str> = lines.iter().map(|line| line.trim_end()).collect();
    lines.join("\n")
}

/// A text in lines of at most [`WIDTH`] characters; those after the first begin with `indent`.
fn wrapped(text: &str, indent: &str) -> String {
    let mut out = String::new();
    let mut line = String::new();
    for word in text.split_whitespace() {
        let is_full = line.chars().count() + 1 + word.chars().count() > WIDTH;
        if is_full && !line.trim().is_empty() {
            out.push_str(&line);
            out.push('\n');
            indent.clone_into(&mut line);
        } else if !line.trim().is_empty() {
            line.push(' ');
        }
        line.push_str(word);
    }
    out.push_str(&line);
    out.push('\n');
    out
}
