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
                let names: Vec<&str> = header
                    .iter()
                    .map(|name| name.trim_start_matches('<'))
                    .collect();
                let mut table = plain_table(&names);
                table.set_content_arrangement(ContentArrangement::Dynamic);
                table.set_width(WIDTH);
                for row in rows {
                    table.add_row(
                        row.iter()
                            .zip(header)
                            .enumerate()
                            .map(|(at, (text, name))| {
                                let alignment = if at == 0 || name.starts_with('<') {
                                    CellAlignment::Left
                                } else {
                                    CellAlignment::Right
                                };
                                Cell::new(text).set_alignment(alignment)
                            }),
                    );
                }
                text.push_str(&table.to_string());
            }
        }
        text.push('\n');
    }
    text
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
    fn long_lines_are_broken_at_spaces() {
        let line = "word ".repeat(50);
        let text = wrapped(line.trim_end());
        assert!(text.lines().all(|line| line.len() <= usize::from(WIDTH)));
        assert_eq!(text.split_whitespace().count(), 50);
        assert_eq!(wrapped("  short"), "  short");
    }
}
