//! Documents as headings, tables and lines, and how a terminal shows them.

use comfy_table::{Cell, CellAlignment};

use crate::layout;
use crate::table::plain_table;

/// One part of a document.
#[derive(Debug, Clone, PartialEq)]
pub enum Block {
    /// The answer, in a sentence.
    Answer(String),
    /// A heading.
    Heading(String),
    /// A table: its first column is text, the others are numbers unless their heading starts with `<`, for
    /// words, or with `$`, for words with formulas, which pages raise and lower: `_x`, `^x`, `_{..}`, `^{..}`.
    Table {
        /// Headings.
        header: Vec<String>,
        /// Cells.
        rows: Vec<Vec<String>>,
    },
    /// Lines of text.
    Lines(Vec<String>),
}

impl Block {
    /// A table with these headings.
    pub fn table<const N: usize>(header: [&str; N], rows: Vec<Vec<String>>) -> Self {
        Self::Table {
            header: header.map(str::to_owned).to_vec(),
            rows,
        }
    }
}

/// What a heading says of its column's cells.
const KINDS: [char; 2] = ['<', '$'];

/// The heading of a column, without what it says of its cells.
pub fn heading(header: &str) -> &str {
    header.trim_start_matches(KINDS)
}

/// Whether a column has words, which begin at its left.
pub fn has_words(at: usize, header: &str) -> bool {
    at == 0 || header.starts_with(KINDS)
}

/// A document as text, as wide as [`layout`] says.
pub fn blocks_text<'a>(blocks: impl IntoIterator<Item = &'a Block>) -> String {
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

fn table_of(header: &[String], rows: &[Vec<String>]) -> String {
    let names: Vec<&str> = header.iter().map(|name| heading(name)).collect();
    let mut table = plain_table(&names);
    for row in rows {
        table.add_row(row.iter().enumerate().map(|(at, text)| {
            let alignment = if header.get(at).is_none_or(|name| has_words(at, name)) {
                CellAlignment::Left
            } else {
                CellAlignment::Right
            };
            Cell::new(text).set_alignment(alignment)
        }));
    }
    table.to_string()
}
