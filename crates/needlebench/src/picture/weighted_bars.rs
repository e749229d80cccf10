//! Bars whose widths are weights: the filled area of a row is its weighted mean.

use super::flat::pixel;
use super::image::Image;
use super::text::{TextSize, signed};

/// Rows of cells; a cell is as wide as its column's weight and filled to its share.
#[derive(Debug, Clone, PartialEq)]
pub struct WeightedBars {
    /// Above everything.
    pub title: String,
    /// Name and weight of each column; columns without weight are left out.
    pub columns: Vec<(String, f64)>,
    /// The rows, from the top.
    pub rows: Vec<WeightedRow>,
}

/// One row.
#[derive(Debug, Clone, PartialEq)]
pub struct WeightedRow {
    /// Left of the row.
    pub label: String,
    /// Right of the row.
    pub note: String,
    /// Share from 0 to 1 and text of each column, as many as there are columns.
    pub cells: Vec<(f64, String)>,
}

const PAGE: [u8; 3] = [255, 255, 255];
const EMPTY: [u8; 3] = [236, 238, 241];
/// Fills, in turn: light enough for text on them, and told apart by people who see few colours.
const FILLS: [[u8; 3]; 4] = [
    [154, 200, 235],
    [245, 205, 130],
    [160, 215, 180],
    [226, 180, 208],
];
const MARGIN_PX: usize = 14;
const GAP_PX: usize = 3;
/// Width of all cells of a row.
const CELLS_PX: usize = 1300;
/// Space above and below the text of a row.
const PADDING_PX: usize = 5;

/// Draws the bars, with a numbered list of the columns below them.
pub fn weighted_bars(bars: &WeightedBars) -> Image {
    let size = TextSize::for_picture(0);
    let columns = placed(&bars.columns);
    let text_px = |text: &str| size.extent_px(text)[0];
    let widest = |texts: &mut dyn Iterator<Item = &str>| texts.map(text_px).max().unwrap_or(0);
    let label_px = widest(&mut bars.rows.iter().map(|row| row.label.as_str()));
    let note_px = widest(&mut bars.rows.iter().map(|row| row.note.as_str()));
    let cells_left = MARGIN_PX + label_px + MARGIN_PX;
    let width_px = cells_left + CELLS_PX + MARGIN_PX + note_px + MARGIN_PX;
    let legend = legend(&bars.columns, width_px / text_px("x").max(1) - 4);
    let row_px = size.line_px() + 2 * PADDING_PX;
    let heads_top = MARGIN_PX + size.line_px() + PADDING_PX;
    let rows_top = heads_top + size.line_px() + GAP_PX;
    let legend_top = rows_top + bars.rows.len() * (row_px + GAP_PX) + PADDING_PX;
    let height_px = legend_top + legend.len() * size.line_px() + MARGIN_PX;

    let mut page = Image::filled(width_px, height_px, PAGE);
    let write = |page: &mut Image, left: usize, top: usize, text: &str| {
        size.write(page, [signed(left), signed(top)], text);
    };
    write(&mut page, MARGIN_PX, MARGIN_PX, &bars.title);
    for column in &columns {
        let left = cells_left + column.left;
        write(&mut page, left, heads_top, &(column.index + 1).to_string());
    }
    for (position, row) in bars.rows.iter().enumerate() {
        let top = rows_top + position * (row_px + GAP_PX);
        write(&mut page, MARGIN_PX, top + PADDING_PX, &row.label);
        let note_left = cells_left + CELLS_PX + MARGIN_PX;
        write(&mut page, note_left, top + PADDING_PX, &row.note);
        for column in &columns {
            let Some((share, text)) = row.cells.get(column.index) else {
                continue;
            };
            let left = cells_left + column.left;
            let filled = pixel(share.clamp(0.0, 1.0) * column.width as f64);
            page.fill([left, top], [column.width, row_px], EMPTY);
            let fill = FILLS[column.index % FILLS.len()];
            page.fill([left, top], [filled, row_px], fill);
            if text_px(text) + 4 <= column.width {
                write(&mut page, left + 2, top + PADDING_PX, text);
            }
        }
    }
    for (line, text) in legend.iter().enumerate() {
        write(
            &mut page,
            MARGIN_PX,
            legend_top + line * size.line_px(),
            text,
        );
    }
    page
}

/// A column in its place, px from the first one's left.
struct Placed {
    index: usize,
    left: usize,
    width: usize,
}

fn placed(columns: &[(String, f64)]) -> Vec<Placed> {
    let total: f64 = columns.iter().map(|(_, weight)| weight.max(0.0)).sum();
    let mut before = 0.0;
    let mut placed = Vec::new();
    for (index, (_, weight)) in columns.iter().enumerate() {
        let at = |weight: f64| pixel(weight / total * CELLS_PX as f64);
        let left = at(before);
        before += weight.max(0.0);
        let width = at(before).saturating_sub(left + GAP_PX);
        if *weight > 0.0 && width > 0 {
            placed.push(Placed { index, left, width });
        }
    }
    placed
}

/// The numbered columns, in lines of at most so many characters.
fn legend(columns: &[(String, f64)], most: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for (index, (name, weight)) in columns.iter().enumerate() {
        let entry = format!("{} {name} x {weight}", index + 1);
        let last = lines.last_mut().expect("starts with one line");
        if last.is_empty() {
            *last = entry;
        } else if last.chars().count() + 4 + entry.chars().count() > most {
            lines.push(entry);
        } else {
            last.push_str("    ");
            last.push_str(&entry);
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bars(shares: [f64; 2]) -> WeightedBars {
        WeightedBars {
            title: String::new(),
            columns: vec![("a".into(), 3.0), ("b".into(), 1.0)],
            rows: vec![WeightedRow {
                label: "row".into(),
                note: String::new(),
                cells: shares.map(|share| (share, String::new())).into(),
            }],
        }
    }

    /// Pixels of a colour in the middle line of the only row.
    fn count(bars: &WeightedBars, color: [u8; 3]) -> usize {
        let image = weighted_bars(bars);
        let filled = |x: usize, y: usize| image.pixel(x, y) == Some(color);
        (0..image.height_px())
            .map(|y| (0..image.width_px()).filter(|&x| filled(x, y)).count())
            .max()
            .unwrap()
    }

    #[test]
    fn filled_width_is_weight_times_share() {
        for (shares, expected) in [([1.0, 1.0], [975, 325]), ([0.5, 0.0], [487, 0])] {
            for (fill, expected) in FILLS.iter().zip(expected) {
                let found = count(&bars(shares), *fill);
                assert!(found.abs_diff(expected) <= GAP_PX, "{shares:?}: {found}");
            }
        }
    }

    #[test]
    fn shares_that_are_none_fill_nothing_and_none_overflows() {
        assert_eq!(count(&bars([f64::NAN, 0.0]), FILLS[0]), 0);
        assert_eq!(
            count(&bars([7.0, 0.0]), FILLS[0]),
            count(&bars([1.0, 0.0]), FILLS[0])
        );
    }
}
