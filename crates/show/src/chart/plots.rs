//! Charts of one panel: curves, bars in groups, and marks in rows.

use super::axis::Axis;
use super::drawing::{Anchor, Chart, Mark, Size};
use super::legend::{LEGEND_ROW_PX, Sample, legend};
use super::marker::Marker;
use super::paint::{Paint, Stroke};
use super::panel::Panel;

/// Width and height of curves and of bars, px.
const SIZE_PX: [f64; 2] = [620.0, 350.0];
/// Space left and right of a panel, px.
const SIDES_PX: [f64; 2] = [74.0, 16.0];
/// Space below a panel whose horizontal axis has a label, px.
const BELOW_PX: f64 = 52.0;

/// Entry of a legend: paint, shape, text.
pub type Entry<'a> = (Paint, Marker, &'a str);

/// Legend at the top; gives the upper end of what is left.
fn head(chart: &mut Chart, left: f64, entries: &[Entry<'_>]) -> f64 {
    if entries.is_empty() {
        return 12.0;
    }
    let width = chart.size[0] - left;
    let entries = entries
        .iter()
        .map(|(paint, marker, text)| (Sample::Marker(*marker, *paint), *text));
    let rows = legend(chart, [left, 14.0], width, entries);
    14.0 + LEGEND_ROW_PX * rows as f64
}

/// A curve with marks.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve<'a> {
    /// Its name, for a pointer over it.
    pub name: &'a str,
    /// Its colour.
    pub paint: Paint,
    /// Its marks.
    pub marker: Marker,
    /// Broken instead of full.
    pub dashed: bool,
    /// Its points.
    pub points: Vec<[f64; 2]>,
}

/// Curves over common axes.
pub fn curve_plot(
    title: &str,
    curves: &[Curve<'_>],
    horizontal: Axis,
    vertical: Axis,
    entries: &[Entry<'_>],
) -> Chart {
    let mut chart = Chart::new(SIZE_PX, title);
    let [left, right] = SIDES_PX;
    let top = head(&mut chart, left, entries);
    let panel = Panel {
        corner: [left, top],
        size: [SIZE_PX[0] - left - right, SIZE_PX[1] - top - BELOW_PX],
        title: String::new(),
        x: horizontal,
        y: vertical,
    };
    panel.draw(&mut chart);
    for curve in curves {
        let points = || {
            let finite = |point: &&[f64; 2]| point.iter().all(|value| value.is_finite());
            curve.points.iter().filter(finite)
        };
        let stroke = if curve.dashed {
            Stroke::dashed(curve.paint, 2.0)
        } else {
            Stroke::full(curve.paint, 2.0)
        };
        panel.curve(&mut chart, points().copied(), stroke);
        for point in points() {
            let tip = format!("{}: {} → {:.3}", curve.name, point[0], point[1]);
            let at = panel.at(*point);
            curve.marker.draw(&mut chart, at, curve.paint, Some(&tip));
        }
    }
    chart
}

/// Groups of upright bars, a bar for each entry; a group's name may have several lines.
pub fn bar_plot(
    title: &str,
    groups: &[(String, Vec<f64>)],
    entries: &[Entry<'_>],
    horizontal_label: &str,
    vertical: Axis,
) -> Chart {
    let mut chart = Chart::new(SIZE_PX, title);
    let [left, right] = SIDES_PX;
    let shown = if entries.len() > 1 { entries } else { &[] };
    let top = head(&mut chart, left, shown);
    let lines = groups
        .iter()
        .map(|(name, _)| name.split('\n').count())
        .max()
        .unwrap_or(1);
    let label_px = if horizontal_label.is_empty() {
        0.0
    } else {
        20.0
    };
    let below = 8.0 + Size::Small.line() * lines as f64 + label_px;
    let bottom = SIZE_PX[1] - below;
    let panel = Panel {
        corner: [left, top],
        size: [SIZE_PX[0] - left - right, bottom - top],
        title: String::new(),
        x: Axis::linear("", 0.0, groups.len().max(1) as f64),
        y: vertical,
    };
    panel.draw_vertical(&mut chart);
    let series = entries.len().max(1) as f64;
    for (index, (name, values)) in groups.iter().enumerate() {
        for (place, (value, (paint, _, entry))) in values.iter().zip(entries).enumerate() {
            let from = index as f64 + 0.11 + 0.78 * place as f64 / series;
            let [x, y] = panel.at([from, *value]);
            let width = panel.size[0] / panel.x.high * 0.78 / series;
            let bar = Mark::Rectangle {
                corner: [x + 0.5, y],
                size: [width - 1.0, bottom - y],
                fill: *paint,
            };
            let name = name.replace('\n', " ");
            chart.add_with_tip(bar, format!("{name}, {entry}: {value:.3}"));
        }
        let [middle, _] = panel.at([index as f64 + 0.5, panel.y.low]);
        for (line, part) in name.split('\n').enumerate() {
            let y = bottom + 6.0 + (line as f64 + 0.5) * Size::Small.line();
            chart.write(Anchor::Middle, [middle, y], part);
        }
    }
    let foot = [[left, bottom], [left + panel.size[0], bottom]];
    chart.line(foot[0], foot[1], Stroke::full(Paint::Soft, 1.2));
    if !horizontal_label.is_empty() {
        let at = [left + 0.5 * panel.size[0], SIZE_PX[1] - 10.0];
        chart.write(Anchor::Middle, at, horizontal_label);
    }
    chart
}

/// One row of marks.
#[derive(Debug, Clone, PartialEq)]
pub struct DotRow {
    /// Left of the row.
    pub label: String,
    /// The marks.
    pub marks: Vec<DotMark>,
}

/// One mark of a row.
#[derive(Debug, Clone, PartialEq)]
pub struct DotMark {
    /// Its colour.
    pub paint: Paint,
    /// Its shape.
    pub marker: Marker,
    /// Its value.
    pub value: f64,
    /// Other end of a range, with a mark of its own.
    pub up_to: Option<f64>,
    /// What a pointer over it is told.
    pub tip: String,
}

/// Marks on a common axis, a row each; a thin line joins the marks of a row.
pub fn dot_plot(title: &str, rows: &[DotRow], axis: Axis, entries: &[Entry<'_>]) -> Chart {
    const WIDTH_PX: f64 = 860.0;
    const ROW_PX: f64 = 21.0;
    let label_px = rows
        .iter()
        .map(|row| Size::Small.width(&row.label))
        .fold(0.0, f64::max);
    let left = label_px + 14.0;
    let mut chart = Chart::new([WIDTH_PX, 0.0], title);
    let top = head(&mut chart, left, entries);
    let panel = Panel {
        corner: [left, top],
        size: [WIDTH_PX - left - SIDES_PX[1], ROW_PX * rows.len() as f64],
        title: String::new(),
        x: axis,
        y: Axis::linear("", rows.len() as f64, 0.0),
    };
    chart.size[1] = top + panel.size[1] + BELOW_PX;
    panel.draw_horizontal(&mut chart);
    for (index, row) in rows.iter().enumerate() {
        let middle = index as f64 + 0.5;
        let at = |value: f64| panel.at([value, middle]);
        let y = at(panel.x.low)[1];
        chart.write(Anchor::End, [left - 10.0, y], &*row.label);
        let marks = || row.marks.iter().filter(|mark| mark.value.is_finite());
        let ends = |mark: &DotMark| [Some(mark.value), mark.up_to].into_iter().flatten();
        let places = || marks().flat_map(ends).map(|value| at(value)[0]);
        let [first, last] = [
            places().fold(f64::INFINITY, f64::min),
            places().fold(f64::NEG_INFINITY, f64::max),
        ];
        if first < last {
            chart.line([first, y], [last, y], Stroke::full(Paint::Soft, 1.0));
        }
        for mark in marks() {
            for value in ends(mark) {
                mark.marker
                    .draw(&mut chart, at(value), mark.paint, Some(&mark.tip));
            }
        }
    }
    let foot = top + panel.size[1];
    let end = left + panel.size[0];
    chart.line([left, foot], [end, foot], Stroke::full(Paint::Soft, 1.2));
    chart
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::number::power_of_ten;

    const NAMES: [Entry<'static>; 4] = [
        (
            Paint::Series(0),
            Marker::Disc,
            "first of them, with a long name",
        ),
        (
            Paint::Series(1),
            Marker::Square,
            "second of them, with a long name",
        ),
        (
            Paint::Series(2),
            Marker::Diamond,
            "third of them, with a long name",
        ),
        (Paint::Series(3), Marker::Triangle, "fourth"),
    ];

    #[test]
    fn texts_of_all_plots_are_legible() {
        let decades = || Axis::decades("error (rad)", [-16, 0], 2, power_of_ten);
        let curve = Curve {
            name: "a <curve>",
            paint: Paint::Series(0),
            marker: Marker::Disc,
            dashed: true,
            points: vec![[0.0, 1e-3], [1.0, f64::NAN], [2.0, 1e-9]],
        };
        let steps = Axis::linear("steps", 0.0, 4.0);
        let chart = curve_plot("title", &[curve], steps, decades(), &NAMES);
        assert_eq!(chart.illegible(), None);
        assert!(
            chart
                .to_inline_svg()
                .contains("<title>a &lt;curve&gt;: 0 → 0.001</title>")
        );

        let groups: Vec<(String, Vec<f64>)> = (0..9)
            .map(|k| {
                (
                    "Right\nDown\nUnfold".to_owned(),
                    vec![0.1 * f64::from(k); 4],
                )
            })
            .collect();
        let chart = bar_plot(
            "title",
            &groups,
            &NAMES,
            "",
            Axis::percent("share (%)", 1.0),
        );
        assert_eq!(chart.illegible(), None);

        let rows: Vec<DotRow> = ["short", "quite a long name of a row"]
            .map(|label| DotRow {
                label: label.to_owned(),
                marks: vec![DotMark {
                    paint: Paint::Series(0),
                    marker: Marker::Square,
                    value: 1e-3,
                    up_to: Some(1.0),
                    tip: String::new(),
                }],
            })
            .into();
        assert_eq!(
            dot_plot("title", &rows, decades(), &NAMES).illegible(),
            None
        );
    }
}
