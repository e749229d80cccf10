//! The look of all tables, and how they keep to the width.

use std::collections::HashSet;
use std::fmt;
use std::ops::{Deref, DerefMut};

use comfy_table::{
    Cell, ColumnConstraint, ContentArrangement, ContentLineStyle, LineStyle, TableStyle, Width,
};

use crate::layout;

/// Spaces between columns.
const GAP: u16 = 2;
/// A column of words may be broken at spaces, but not into less than this.
const WORDS: usize = 20;
/// Heading over a line, two spaces between columns.
const LOOK: TableStyle = TableStyle::new()
    .header_lines(ContentLineStyle::none())
    .header_separator(LineStyle::none().fill('─'))
    .content_lines(ContentLineStyle::none());

/// A table that keeps to the width of [`crate::layout`] when it is shown.
///
/// First columns of words are broken at spaces. Where that is not enough the table is divided between columns,
/// with the columns that tell its rows apart in each part; numbers are never broken.
#[derive(Debug, Clone)]
pub struct Table(comfy_table::Table);

/// A table with these headings. A heading that begins with a line end goes on with that of the column before
/// it, from which it is not divided.
pub fn plain_table(header: &[&str]) -> Table {
    let mut table = comfy_table::Table::new();
    table.load_style(LOOK);
    table.set_header(header.iter().map(Cell::new));
    Table(table)
}

impl Table {
    /// The text of this table, no wider than `width` as far as its numbers and words allow.
    pub fn fitted(&self, width: usize) -> String {
        let columns = columns(&self.0);
        let parts: Vec<String> = parts(&columns, keys(&self.0, &columns, width), width)
            .into_iter()
            .map(|part| shown(&self.0, &columns, &part, width))
            .collect();
        parts.join("\n\n")
    }
}

impl Deref for Table {
    type Target = comfy_table::Table;

    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

impl DerefMut for Table {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.0
    }
}

impl fmt::Display for Table {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(&self.fitted(layout::width()))
    }
}

/// How wide a column is.
struct Shape {
    /// Its longest line.
    natural: usize,
    /// The narrowest that breaks no word; its natural width for numbers.
    least: usize,
    /// Its heading goes on with that of the column before it.
    goes_on: bool,
}

fn columns(table: &comfy_table::Table) -> Vec<Shape> {
    let header = table.header();
    let widths = table.column_max_content_widths();
    widths
        .into_iter()
        .enumerate()
        .map(|(at, natural)| {
            let natural = usize::from(natural);
            let heading = header.and_then(|row| Some(row.cell_iter().nth(at)?.content()));
            let heading = heading.unwrap_or_default();
            let cells = || table.column_cells_iter(at).flatten().map(Cell::content);
            let is_words = cells().any(|text| {
                text.lines()
                    .any(|line| line.len() > WORDS && line.contains(' '))
            });
            let least = if is_words {
                let words = cells().filter_map(|text| longest(&text, char::is_whitespace));
                let lines = longest(&heading, |letter| letter == '\n');
                words
                    .chain(lines)
                    .max()
                    .unwrap_or(0)
                    .max(WORDS.min(natural))
            } else {
                natural
            };
            Shape {
                natural,
                least,
                goes_on: heading.starts_with('\n'),
            }
        })
        .collect()
}

/// Length of the longest piece of a text.
fn longest(text: &str, ends: impl Fn(char) -> bool) -> Option<usize> {
    text.split(ends).map(|piece| piece.chars().count()).max()
}

/// How many of the first columns tell the rows apart; one where no few of them do, or where they would leave
/// no room for others.
fn keys(table: &comfy_table::Table, columns: &[Shape], width: usize) -> usize {
    const MOST: usize = 3;
    let tell_apart = |count: usize| {
        let mut seen = HashSet::new();
        table.row_iter().all(|row| {
            let key: Vec<String> = row.cell_iter().take(count).map(Cell::content).collect();
            seen.insert(key)
        })
    };
    let has_room = |count: &usize| {
        let taken: usize = columns[..*count]
            .iter()
            .map(|each| each.least + usize::from(GAP))
            .sum();
        *count < columns.len() && (*count == 1 || 2 * taken <= width)
    };
    (1..=MOST)
        .take_while(has_room)
        .find(|count| tell_apart(*count))
        .unwrap_or(1)
}

/// The columns of each table that a table is divided into, the first `keys` in each.
fn parts(columns: &[Shape], keys: usize, width: usize) -> Vec<Vec<usize>> {
    let taken = |at: usize| columns[at].least + usize::from(GAP);
    let mut parts: Vec<Vec<usize>> = Vec::new();
    let mut room = 0_usize;
    for at in 0..columns.len() {
        let further = columns[at + 1..]
            .iter()
            .take_while(|next| next.goes_on)
            .count();
        let wanted: usize = (at..=at + further).map(taken).sum();
        let is_full = parts.last().is_some_and(|part| part.len() > keys) && !columns[at].goes_on;
        // The last column needs no gap behind it.
        if parts.is_empty() || (is_full && wanted > room.saturating_add(usize::from(GAP))) {
            let first: Vec<usize> = if at < keys {
                vec![]
            } else {
                (0..keys).collect()
            };
            room = width.saturating_sub(first.iter().copied().map(taken).sum());
            parts.push(first);
        }
        parts.last_mut().expect("there is one").push(at);
        room = room.saturating_sub(taken(at));
    }
    parts
}

/// Some columns of a table; those of words take what the others leave.
fn shown(table: &comfy_table::Table, columns: &[Shape], part: &[usize], width: usize) -> String {
    let mut table = table.clone();
    let gap = usize::from(GAP);
    let least: usize = part.iter().map(|&at| columns[at].least + gap).sum();
    let mut left = (width.saturating_add(gap)).saturating_sub(least);
    for (at, shape) in columns.iter().enumerate() {
        let Some(column) = table.column_mut(at) else {
            continue;
        };
        column.set_padding((0, GAP));
        if !part.contains(&at) {
            column.set_constraint(ColumnConstraint::Hidden);
            continue;
        }
        let more = (shape.natural - shape.least).min(left);
        left -= more;
        let wanted = u16::try_from(shape.least + more + gap).unwrap_or(u16::MAX);
        column.set_constraint(ColumnConstraint::Absolute(Width::Fixed(wanted)));
    }
    table.set_content_arrangement(ContentArrangement::Dynamic);
    table.set_width(u16::MAX);
    let text = table.trim_fmt();
    // The line under the headings ends with the last column, not with the gap behind it.
    let longest = text
        .lines()
        .filter(|line| !line.starts_with('─'))
        .map(layout::visible)
        .max();
    let line = "─".repeat(longest.unwrap_or(0));
    let lines = text.lines().map(|each| {
        if each.starts_with('─') {
            line.as_str()
        } else {
            each
        }
    });
    lines.collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wide() -> (Table, Vec<String>) {
        let header: Vec<String> = std::iter::once("configuration".to_owned())
            .chain((0..12).map(|at| format!("metric {at}\n(mm) 5 %")))
            .collect();
        let header: Vec<&str> = header.iter().map(String::as_str).collect();
        let mut table = plain_table(&header);
        let row: Vec<String> = std::iter::once("Right-Down-Unfold".to_owned())
            .chain((0..12).map(|at| format!("99.7 (94.{at} .. 100.0)")))
            .collect();
        table.add_row(row.clone());
        (table, row)
    }

    #[test]
    fn wide_tables_are_divided_between_columns_and_break_no_number() {
        let (table, row) = wide();
        for width in [60, 80, 100, 120, 200] {
            let text = table.fitted(width);
            assert!(
                text.lines().all(|line| line.chars().count() <= width),
                "{text}"
            );
            for whole in &row {
                assert!(text.contains(whole.as_str()), "{whole} in\n{text}");
            }
        }
        assert_eq!(table.fitted(usize::MAX).lines().count(), 4);
    }

    #[test]
    fn parts_of_a_table_have_the_columns_that_tell_its_rows_apart() {
        let mut table = plain_table(&[
            "joint",
            "engine",
            "rise (ms)",
            "overshoot (%)",
            "settled (ms)",
        ]);
        for joint in ["elbow", "wrist_1"] {
            for engine in ["rapier", "mujoco"] {
                table.add_row([joint, engine, "12.345", "0.125", "345.678"]);
            }
        }
        let text = table.fitted(44);
        assert_eq!(text.matches("engine").count(), 2, "{text}");
        assert_eq!(text.matches("wrist_1  mujoco").count(), 2, "{text}");
    }

    #[test]
    fn words_are_broken_at_spaces_before_a_table_is_divided() {
        let mut table = plain_table(&["what", "mm", "why"]);
        table.add_row(["tip", "1.25", &"because of this and that ".repeat(6)]);
        let text = table.fitted(60);
        assert!(
            text.lines().all(|line| line.chars().count() <= 60),
            "{text}"
        );
        assert_eq!(text.matches("what").count(), 1, "{text}");
        assert_eq!(text.matches("because").count(), 6, "{text}");
    }

    #[test]
    fn a_heading_that_goes_on_is_not_divided_from_its_beginning() {
        let mut table = plain_table(&["configuration", "sight", "left of it\nfirst", "\nsecond"]);
        table.add_row(["Right-Down-Unfold", "100 %", "12345.678901", "12345.678901"]);
        let text = table.fitted(45);
        let line = text.lines().find(|line| line.contains("second"));
        assert!(line.is_some_and(|line| line.contains("first")), "{text}");
    }
}
