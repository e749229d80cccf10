//! Bars whose widths are weights: the filled area of a row is its weighted mean.

use super::drawing::{Anchor, Chart, Size};
use super::paint::{Paint, Rgb};

/// Rows of cells; a cell is as wide as its column's weight and filled to its share.
#[derive(Debug, Clone, PartialEq)]
pub struct WeightedBars {
    /// Above everything.
    pub title: String,
    /// How to read it, below the title.
    pub remark: String,
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

const EMPTY: Paint = Paint::Fixed([236, 238, 241]);
/// Fills, in turn: light enough for text on them, and told apart by people who see few colours.
const FILLS: [Rgb; 4] = [
    [154, 200, 235],
    [245, 205, 130],
    [160, 215, 180],
    [226, 180, 208],
];
const MARGIN_PX: f64 = 16.0;
const GAP_PX: f64 = 3.0;
/// Width of all cells of a row.
const CELLS_PX: f64 = 1300.0;
const ROW_PX: f64 = 26.0;
/// Of the title, of what is below it, of the columns' numbers.
const HEADS_PX: [f64; 3] = [24.0, 50.0, 78.0];
const LINE_PX: f64 = 20.0;

/// Draws the bars, with a numbered list of the columns below them.
pub fn weighted_bars(bars: &WeightedBars) -> Chart {
    let columns = placed(&bars.columns);
    let width = |text: &str| Size::Small.width(text);
    let widest = |texts: &mut dyn Iterator<Item = &str>| texts.map(width).fold(0.0, f64::max);
    let label_px = widest(&mut bars.rows.iter().map(|row| row.label.as_str()));
    let note_px = widest(&mut bars.rows.iter().map(|row| row.note.as_str()));
    let cells_left = MARGIN_PX + label_px + MARGIN_PX;
    let width_px = cells_left + CELLS_PX + MARGIN_PX + note_px + MARGIN_PX;
    let legend = legend(&bars.columns, width_px - 2.0 * MARGIN_PX);
    let rows_top = HEADS_PX[2] + 12.0;
    let rows_px = bars.rows.len() as f64 * (ROW_PX + GAP_PX);
    let legend_top = rows_top + rows_px + 0.5 * LINE_PX;
    let height_px = legend_top + legend.len() as f64 * LINE_PX + MARGIN_PX;

    let mut chart = Chart::new([width_px, height_px], &*bars.title);
    chart.write_large([MARGIN_PX, HEADS_PX[0]], &*bars.title);
    chart.write(Anchor::Start, [MARGIN_PX, HEADS_PX[1]], &*bars.remark);
    for column in &columns {
        let left = cells_left + column.left;
        let number = (column.index + 1).to_string();
        if width(&number) <= column.width {
            chart.write(Anchor::Start, [left, HEADS_PX[2]], number);
        }
    }
    for (position, row) in bars.rows.iter().enumerate() {
        let top = rows_top + position as f64 * (ROW_PX + GAP_PX);
        let middle = top + 0.5 * ROW_PX;
        chart.write(Anchor::Start, [MARGIN_PX, middle], &*row.label);
        let note_left = cells_left + CELLS_PX + MARGIN_PX;
        chart.write(Anchor::Start, [note_left, middle], &*row.note);
        for column in &columns {
            let Some((share, text)) = row.cells.get(column.index) else {
                continue;
            };
            let left = cells_left + column.left;
            let share = if share.is_nan() { 0.0 } else { *share };
            let filled = (share.clamp(0.0, 1.0) * column.width).round();
            chart.fill([left, top], [column.width, ROW_PX], EMPTY);
            let fill = Paint::Fixed(FILLS[column.index % FILLS.len()]);
            chart.fill([left, top], [filled, ROW_PX], fill);
            if width(text) + 4.0 <= column.width {
                chart.write(Anchor::Start, [left + 2.0, middle], &**text);
            }
        }
    }
    for (line, text) in legend.into_iter().enumerate() {
        let middle = legend_top + (line as f64 + 0.5) * LINE_PX;
        chart.write(Anchor::Start, [MARGIN_PX, middle], text);
    }
    chart
}

/// A column in its place, px from the first one's left.
struct Placed {
    index: usize,
    left: f64,
    width: f64,
}

fn placed(columns: &[(String, f64)]) -> Vec<Placed> {
    let total: f64 = columns.iter().map(|(_, weight)| weight.max(0.0)).sum();
    let mut before = 0.0;
    let mut placed = Vec::new();
    for (index, (_, weight)) in columns.iter().enumerate() {
        let at = |weight: f64| (weight / total * CELLS_PX).round();
        let left = at(before);
        before += weight.max(0.0);
        let width = at(before) - left - GAP_PX;
        if *weight > 0.0 && width > 0.0 {
            placed.push(Placed { index, left, width });
        }
    }
    placed
}

/// The numbered columns, in lines of at most so many px.
fn legend(columns: &[(String, f64)], most: f64) -> Vec<String> {
    let mut lines = vec![String::new()];
    for (index, (name, weight)) in columns.iter().enumerate() {
        let entry = format!("{} {name} x {weight}", index + 1);
        let last = lines.last_mut().expect("starts with one line");
        if last.is_empty() {
            *last = entry;
            continue;
        }
        let longer = format!("{last}    {entry}");
        if Size::Small.width(&longer) > most {
            lines.push(entry);
        } else {
            *last = longer;
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bars(shares: [f64; 2]) -> WeightedBars {
        WeightedBars {
            title: "title".to_owned(),
            remark: "remark".to_owned(),
            columns: vec![("a".into(), 3.0), ("b".into(), 1.0)],
            rows: vec![WeightedRow {
                label: "row".into(),
                note: "note".to_owned(),
                cells: shares.map(|share| (share, "12 mm".to_owned())).into(),
            }],
        }
    }

    /// Pixels of a colour in the line of the only row that has most of them.
    fn count(bars: &WeightedBars, color: Rgb) -> usize {
        let image = weighted_bars(bars).to_image();
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
                assert!(found.abs_diff(expected) <= 3, "{shares:?}: {found}");
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

    #[test]
    fn many_columns_stay_legible() {
        let mut many = bars([0.5, 0.5]);
        many.columns = (0..30)
            .map(|k| (format!("metric number {k}"), 1.0 + f64::from(k % 3)))
            .collect();
        many.rows[0].cells = vec![(0.5, "123.4 mm/mrad".to_owned()); 30];
        assert_eq!(weighted_bars(&many).illegible(), None);
    }
}
