//! A study's statistics for a terminal.

use comfy_table::{Cell, CellAlignment, ContentArrangement};

use super::tables::Part;
use crate::output::plain_table;

/// Columns that tables fit into.
const WIDTH: u16 = 100;

/// A summary as text, 100 columns wide.
pub(crate) fn summary_text(parts: &[Part]) -> String {
    let mut text = String::new();
    for part in parts {
        match part {
            Part::Heading(heading) => {
                text.push('\n');
                text.push_str(heading);
            }
            Part::Lines(lines) => text.push_str(&lines.join("\n")),
            Part::Table { header, rows } => {
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
