//! A study's statistics for a terminal.

use comfy_table::{Cell, CellAlignment};

use super::block::Block;
use crate::layout;
use crate::table::plain_table;

/// A summary as text, as wide as [`layout`] says.
pub fn summary_text(blocks: &[Block]) -> String {
    let mut text = String::new();
    for part in blocks {
        match part {
            Block::Heading(heading) => {
                text.push('\n');
                text.push_str(heading);
            }
            Block::Answer(sentence) => {
                text.push_str(&layout::wrapped(&format!("ANSWER: {sentence}")));
            }
            Block::Lines(lines) => {
                text.push_str(&layout::wrapped(&lines.join("\n")));
            }
            Block::Table { header, rows } => {
                text.push_str(&table_of(header, rows));
            }
        }
        text.push('\n');
    }
    text
}

/// A heading that begins with `<` is that of a column of words.
fn table_of(header: &[String], rows: &[Vec<String>]) -> String {
    let names: Vec<&str> = header
        .iter()
        .map(|name| name.trim_start_matches('<'))
        .collect();
    let mut table = plain_table(&names);
    for row in rows {
        table.add_row(row.iter().enumerate().map(|(at, text)| {
            let is_words = at == 0 || header.get(at).is_none_or(|name| name.starts_with('<'));
            let alignment = if is_words {
                CellAlignment::Left
            } else {
                CellAlignment::Right
            };
            Cell::new(text).set_alignment(alignment)
        }));
    }
    table.to_string()
}
