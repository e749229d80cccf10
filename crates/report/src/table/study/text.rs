//! A study's statistics for a terminal.

use comfy_table::{Cell, CellAlignment, ContentArrangement};

use super::document::Block;
use crate::table::plain_table;

/// Columns that tables fit into.
const WIDTH: u16 = 100;

/// A summary as text, 100 columns wide.
pub fn summary_text(blocks: &[Block]) -> String {
    let mut text = String::new();
    for part in blocks {
        match part {
            Block::Heading(heading) => {
                text.push('\n');
                text.push_str(heading);
            }
            Block::Lines(lines) => {
                let lines: Vec<String> = lines.iter().map(|line| wrapped(line)).collect();
                text.push_str(&lines.join("\n"));
            }
            Block::Table { header, rows } => {
                let tables: Vec<String> = columns_that_fit(header, rows)
                    .iter()
                    .map(|columns| table_of(header, rows, columns))
                    .collect();
                text.push_str(&tables.join("\n"));
            }
        }
        text.push('\n');
    }
    text
}

/// Least width of a column of words, which may be broken at spaces.
const WORDS: usize = 24;

/// Columns of each table that a block becomes: one, or several with the first column in each where numbers
/// or names would be broken.
fn columns_that_fit(header: &[String], rows: &[Vec<String>]) -> Vec<Vec<usize>> {
    let width_of = |at: usize| {
        let name = header[at].trim_start_matches('<').lines();
        let texts = rows.iter().filter_map(|row| row.get(at));
        let natural = name
            .chain(texts.flat_map(|text| text.lines()))
            .map(|line| line.chars().count())
            .max()
            .unwrap_or(0);
        // The border and a space on either side.
        3 + if header[at].starts_with('<') {
            natural.min(WORDS)
        } else {
            natural
        }
    };
    let mut tables = vec![vec![0]];
    let mut taken = width_of(0) + 1;
    // A heading without a first line goes on with that of the column before it.
    let goes_on = |at: usize| header.get(at).is_some_and(|name| name.starts_with('\n'));
    for at in 1..header.len() {
        let width = width_of(at);
        let with_its_kind: usize = (at + 1..header.len())
            .take_while(|&next| goes_on(next))
            .map(width_of)
            .sum();
        let last = tables.last_mut().expect("there is one");
        if last.len() > 1 && !goes_on(at) && taken + width + with_its_kind > usize::from(WIDTH) {
            tables.push(vec![0, at]);
            taken = width_of(0) + 1 + width;
        } else {
            last.push(at);
            taken += width;
        }
    }
    tables
}

fn table_of(header: &[String], rows: &[Vec<String>], columns: &[usize]) -> String {
    let names: Vec<&str> = columns
        .iter()
        .map(|&at| header[at].trim_start_matches('<'))
        .collect();
    let mut table = plain_table(&names);
    table.set_content_arrangement(ContentArrangement::Dynamic);
    table.set_width(WIDTH);
    for row in rows {
        table.add_row(columns.iter().filter_map(|&at| {
            let alignment = if at == 0 || header[at].starts_with('<') {
                CellAlignment::Left
            } else {
                CellAlignment::Right
            };
            Some(Cell::new(row.get(at)?).set_alignment(alignment))
        }));
    }
    table.to_string()
}

/// A line broken at spaces, its further lines indented.
fn wrapped(line: &str) -> String {
    let mut text = String::new();
    let mut column = 0;
    for word in line.split_inclusive(' ') {
        let length = word.trim_end().chars().count();
        if column > 0 && column + length > usize::from(WIDTH) {
            text.truncate(text.trim_end().len());
            text.push_str("\n    ");
            column = 4;
        }
        text.push_str(word);
        column += word.chars().count();
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wide_tables_are_divided_between_columns_and_break_no_number() {
        let header: Vec<String> = std::iter::once("configuration".to_owned())
            .chain((0..12).map(|at| format!("metric {at}\n(mm) 5 %")))
            .collect();
        let row: Vec<String> = std::iter::once("Right-Down-Unfold".to_owned())
            .chain((0..12).map(|at| format!("99.7 (94.{at} .. 100.0)")))
            .collect();
        let text = summary_text(&[Block::Table {
            header: header.clone(),
            rows: vec![row.clone()],
        }]);
        assert!(
            text.lines()
                .all(|line| line.chars().count() <= usize::from(WIDTH))
        );
        for whole in &row {
            assert!(text.contains(whole.as_str()), "{whole} in\n{text}");
        }
    }

    #[test]
    fn long_lines_are_broken_at_spaces() {
        let line = "word ".repeat(50);
        let text = wrapped(line.trim_end());
        assert!(text.lines().all(|line| line.len() <= usize::from(WIDTH)));
        assert_eq!(text.split_whitespace().count(), 50);
        assert_eq!(wrapped("  short"), "  short");
    }
}
