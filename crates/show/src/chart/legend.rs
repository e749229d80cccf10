//! Which line, mark or colour is what.

use super::drawing::{Anchor, Chart, Size};
use super::marker::Marker;
use super::paint::{Paint, Stroke};

/// How an entry's sample looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sample {
    /// A line.
    Line(Stroke),
    /// A rectangle of a colour.
    Area(Paint),
    /// A mark.
    Marker(Marker, Paint),
    /// A disc of a radius in px.
    Disc(f64, Paint),
    /// A circle of a radius in px.
    Circle(f64, Stroke),
}

/// Distance of rows, px.
pub const LEGEND_ROW_PX: f64 = 22.0;
/// Length of a sample, and space after it and after the text, px.
const SAMPLE_PX: f64 = 26.0;
const GAPS_PX: [f64; 2] = [7.0, 22.0];

/// Writes entries in rows that are at most `width` px wide, from the left end of the first row's
/// middle; gives the number of rows.
pub fn legend<'a>(
    chart: &mut Chart,
    [left, middle]: [f64; 2],
    width: f64,
    entries: impl IntoIterator<Item = (Sample, &'a str)>,
) -> usize {
    let (mut x, mut y, mut rows) = (left, middle, 1);
    for (sample, text) in entries {
        let length = SAMPLE_PX + GAPS_PX[0] + Size::Small.width(text);
        if x > left && x + length > left + width {
            (x, y, rows) = (left, y + LEGEND_ROW_PX, rows + 1);
        }
        draw(chart, sample, [x, y]);
        chart.write(Anchor::Start, [x + SAMPLE_PX + GAPS_PX[0], y], text);
        x += length + GAPS_PX[1];
    }
    rows
}

/// The same in a column, without a limit of width.
pub fn legend_column<'a>(
    chart: &mut Chart,
    [left, middle]: [f64; 2],
    entries: impl IntoIterator<Item = (Sample, &'a str)>,
) {
    for (row, entry) in entries.into_iter().enumerate() {
        legend(
            chart,
            [left, middle + LEGEND_ROW_PX * row as f64],
            f64::INFINITY,
            [entry],
        );
    }
}

fn draw(chart: &mut Chart, sample: Sample, [x, y]: [f64; 2]) {
    let centre = [x + 0.5 * SAMPLE_PX, y];
    match sample {
        Sample::Line(stroke) => chart.line([x, y], [x + SAMPLE_PX, y], stroke),
        Sample::Area(paint) => chart.fill([x, y - 6.0], [SAMPLE_PX, 12.0], paint),
        Sample::Marker(marker, paint) => marker.draw(chart, centre, paint, None),
        Sample::Disc(radius, paint) => chart.disc(centre, radius, paint),
        Sample::Circle(radius, stroke) => chart.circle(centre, radius, stroke),
    }
}
