//! Plots as inline SVG: axes, curves and bars, coloured by the page's style sheet.

use std::fmt::Write;

/// Text that is safe in HTML and SVG.
pub(super) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

/// How values are placed along an axis.
#[derive(Debug, Clone, Copy)]
pub(super) enum Scale {
    Linear,
    /// Values at or below `low` stand at `low`.
    Log,
}

/// One axis: values from `low` to `high`, pixels from `start` to `end`.
#[derive(Debug, Clone)]
pub(super) struct Axis {
    pub label: String,
    pub scale: Scale,
    pub low: f64,
    pub high: f64,
    pub start: f64,
    pub end: f64,
    /// Value and text of each tick.
    pub ticks: Vec<(f64, String)>,
}

impl Axis {
    pub(super) fn at(&self, value: f64) -> f64 {
        let share = match self.scale {
            Scale::Linear => (value - self.low) / (self.high - self.low),
            Scale::Log => (value.max(self.low) / self.low).ln() / (self.high / self.low).ln(),
        };
        self.start + share.clamp(0.0, 1.0) * (self.end - self.start)
    }

    /// A logarithmic axis over whole decades, with a tick every `every`.
    pub(super) fn decades(label: &str, low: i32, high: i32, every: usize) -> Self {
        Self {
            label: label.to_owned(),
            scale: Scale::Log,
            low: 10_f64.powi(low),
            high: 10_f64.powi(high),
            start: 0.0,
            end: 1.0,
            ticks: (low..=high)
                .step_by(every)
                .map(|power| (10_f64.powi(power), power_of_ten(power)))
                .collect(),
        }
    }

    /// Per cent from 0 to 100 of shares from 0 to 1.
    pub(super) fn percent(label: &str) -> Self {
        Self {
            label: label.to_owned(),
            scale: Scale::Linear,
            low: 0.0,
            high: 1.0,
            start: 0.0,
            end: 1.0,
            ticks: [0, 20, 40, 60, 80, 100]
                .map(|each| (f64::from(each) / 100.0, each.to_string()))
                .into(),
        }
    }

    pub(super) fn over(mut self, start: f64, end: f64) -> Self {
        (self.start, self.end) = (start, end);
        self
    }
}

/// `10` with the power as superscript characters.
fn power_of_ten(power: i32) -> String {
    let digits = power.to_string();
    let raised: String = digits
        .chars()
        .map(|digit| match digit {
            '-' => '⁻',
            '0' => '⁰',
            '1' => '¹',
            '2' => '²',
            '3' => '³',
            other => {
                char::from_u32(u32::from(other) - u32::from('4') + u32::from('⁴')).unwrap_or(other)
            }
        })
        .collect();
    format!("10{raised}")
}

/// A drawing under construction.
pub(super) struct Svg {
    width: f64,
    height: f64,
    title: String,
    body: String,
}

impl Svg {
    pub(super) fn new(width: f64, height: f64, title: &str) -> Self {
        Self {
            width,
            height,
            title: title.to_owned(),
            body: String::new(),
        }
    }

    pub(super) fn line(&mut self, class: &str, from: [f64; 2], to: [f64; 2]) {
        let _ = write!(
            self.body,
            "<line class=\"{class}\" x1=\"{:.1}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\"/>",
            from[0], from[1], to[0], to[1]
        );
    }

    pub(super) fn rect(&mut self, class: &str, corner: [f64; 2], size: [f64; 2], tip: &str) {
        let _ = write!(
            self.body,
            "<rect class=\"{class}\" x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\">{}</rect>",
            corner[0],
            corner[1],
            size[0].max(0.0),
            size[1].max(0.0),
            title(tip)
        );
    }

    /// A mark whose shape tells series apart without colour: 0 a disc, 1 a square, 2 a diamond, 3
    /// a triangle.
    pub(super) fn mark(&mut self, class: &str, shape: usize, [x, y]: [f64; 2], tip: &str) {
        let r = 4.0;
        let points = match shape % 4 {
            0 => {
                let tip = title(tip);
                let _ = write!(
                    self.body,
                    "<circle class=\"{class}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{r}\">{tip}</circle>"
                );
                return;
            }
            1 => vec![[-r, -r], [r, -r], [r, r], [-r, r]],
            2 => vec![
                [0.0, -1.3 * r],
                [1.3 * r, 0.0],
                [0.0, 1.3 * r],
                [-1.3 * r, 0.0],
            ],
            _ => vec![[0.0, -1.2 * r], [1.2 * r, r], [-1.2 * r, r]],
        };
        let corners: Vec<String> = points
            .iter()
            .map(|[dx, dy]| format!("{:.1},{:.1}", x + dx, y + dy))
            .collect();
        let _ = write!(
            self.body,
            "<polygon class=\"{class}\" points=\"{}\">{}</polygon>",
            corners.join(" "),
            title(tip)
        );
    }

    pub(super) fn polyline(&mut self, class: &str, points: &[[f64; 2]]) {
        let text: Vec<String> = points
            .iter()
            .map(|[x, y]| format!("{x:.1},{y:.1}"))
            .collect();
        let _ = write!(
            self.body,
            "<polyline class=\"{class}\" points=\"{}\"/>",
            text.join(" ")
        );
    }

    /// `anchor` is `start`, `middle` or `end`.
    pub(super) fn text(&mut self, anchor: &str, [x, y]: [f64; 2], text: &str) {
        let _ = write!(
            self.body,
            "<text text-anchor=\"{anchor}\" x=\"{x:.1}\" y=\"{y:.1}\">{}</text>",
            escaped(text)
        );
    }

    /// Ticks, grid and label of a horizontal axis along the bottom of `top..bottom`.
    pub(super) fn horizontal(&mut self, axis: &Axis, top: f64, bottom: f64) {
        for (value, text) in &axis.ticks {
            let x = axis.at(*value);
            self.line("grid", [x, top], [x, bottom]);
            self.text("middle", [x, bottom + 17.0], text);
        }
        self.line("axis", [axis.start, bottom], [axis.end, bottom]);
        let middle = 0.5 * (axis.start + axis.end);
        self.text("middle", [middle, bottom + 38.0], &axis.label);
    }

    /// Ticks, grid and label of a vertical axis along the left of `left..right`.
    pub(super) fn vertical(&mut self, axis: &Axis, left: f64, right: f64) {
        for (value, text) in &axis.ticks {
            let y = axis.at(*value);
            self.line("grid", [left, y], [right, y]);
            self.text("end", [left - 8.0, y + 4.0], text);
        }
        self.line("axis", [left, axis.start], [left, axis.end]);
        let middle = 0.5 * (axis.start + axis.end);
        let _ = write!(
            self.body,
            "<text text-anchor=\"middle\" transform=\"translate({:.1} {middle:.1}) rotate(-90)\">{}</text>",
            left - 46.0,
            escaped(&axis.label)
        );
    }

    /// A legend in a row; each entry is a class, a shape and a text.
    pub(super) fn legend(&mut self, [x, y]: [f64; 2], entries: &[(String, usize, &str)]) {
        let mut left = x;
        for (class, shape, text) in entries {
            self.mark(class, *shape, [left, y - 4.0], "");
            self.text("start", [left + 10.0, y], text);
            left += 34.0 + 6.7 * text.chars().count() as f64;
        }
    }

    pub(super) fn finish(self) -> String {
        format!(
            "<svg viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\" style=\"max-width:{}px\">{}</svg>",
            self.width,
            self.height,
            escaped(&self.title),
            self.width,
            self.body
        )
    }
}

fn title(tip: &str) -> String {
    if tip.is_empty() {
        String::new()
    } else {
        format!("<title>{}</title>", escaped(tip))
    }
}

/// One row of a plot of horizontal marks or bars.
pub(super) struct DotRow {
    pub label: String,
    /// Class, shape, value (or a range) and a tip.
    pub marks: Vec<DotMark>,
}

pub(super) struct DotMark {
    pub class: String,
    pub shape: usize,
    pub value: f64,
    /// Other end of a range.
    pub up_to: Option<f64>,
    pub tip: String,
}

const ROW_PX: f64 = 21.0;
const WIDTH_PX: f64 = 860.0;

/// Marks on a common logarithmic axis, a row each; a thin line joins the marks of a row.
pub(super) fn dot_plot(
    title: &str,
    rows: &[DotRow],
    axis: Axis,
    label_px: f64,
    legend: &[(String, usize, &str)],
) -> String {
    let top = if legend.is_empty() { 10.0 } else { 34.0 };
    let bottom = top + ROW_PX * rows.len() as f64;
    let mut svg = Svg::new(WIDTH_PX, bottom + 48.0, title);
    let axis = axis.over(label_px, WIDTH_PX - 16.0);
    svg.legend([label_px, 16.0], legend);
    svg.horizontal(&axis, top, bottom);
    for (index, row) in rows.iter().enumerate() {
        let y = top + (index as f64 + 0.5) * ROW_PX;
        svg.text("end", [label_px - 10.0, y + 4.0], &row.label);
        let at: Vec<f64> = row
            .marks
            .iter()
            .flat_map(|mark| [Some(mark.value), mark.up_to])
            .flatten()
            .filter(|value| value.is_finite())
            .map(|value| axis.at(value))
            .collect();
        let left = at.iter().copied().fold(f64::INFINITY, f64::min);
        let right = at.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if left < right {
            svg.line("join", [left, y], [right, y]);
        }
        for mark in row.marks.iter().filter(|mark| mark.value.is_finite()) {
            svg.mark(&mark.class, mark.shape, [axis.at(mark.value), y], &mark.tip);
            if let Some(up_to) = mark.up_to {
                svg.mark(&mark.class, mark.shape, [axis.at(up_to), y], &mark.tip);
            }
        }
    }
    svg.finish()
}

/// A curve with marks.
pub(super) struct Series<'a> {
    pub class: String,
    pub shape: usize,
    pub dashed: bool,
    pub points: Vec<[f64; 2]>,
    pub name: &'a str,
}

/// Curves over common axes.
pub(super) fn line_plot(
    title: &str,
    series: &[Series<'_>],
    horizontal: Axis,
    vertical: Axis,
    legend: &[(String, usize, &str)],
) -> String {
    let (width, height) = (620.0, 350.0);
    let (left, right, top, bottom) = (66.0, width - 16.0, 44.0, height - 52.0);
    let mut svg = Svg::new(width, height, title);
    let horizontal = horizontal.over(left, right);
    let vertical = vertical.over(bottom, top);
    svg.horizontal(&horizontal, top, bottom);
    svg.vertical(&vertical, left, right);
    let half = legend.len().div_ceil(2).max(1);
    for (row, entries) in legend.chunks(half).enumerate() {
        svg.legend([left + 4.0, 14.0 + 17.0 * row as f64], entries);
    }
    for each in series {
        let finite: Vec<[f64; 2]> = each
            .points
            .iter()
            .copied()
            .filter(|[x, y]| x.is_finite() && y.is_finite())
            .collect();
        let placed: Vec<[f64; 2]> = finite
            .iter()
            .map(|[x, y]| [horizontal.at(*x), vertical.at(*y)])
            .collect();
        let dashed = if each.dashed { " dashed" } else { "" };
        svg.polyline(&format!("curve {}{dashed}", each.class), &placed);
        for (at, [x, y]) in placed.iter().zip(&finite) {
            svg.mark(
                &each.class,
                each.shape,
                *at,
                &format!("{}: {x} → {y:.3}", each.name),
            );
        }
    }
    svg.finish()
}

/// Groups of upright bars, one bar per series.
pub(super) fn bar_plot(
    title: &str,
    groups: &[(String, Vec<f64>)],
    series: &[(String, usize, &str)],
    horizontal_label: &str,
    vertical: Axis,
) -> String {
    let (width, height) = (620.0, 330.0);
    let (left, right, bottom) = (66.0, width - 16.0, height - 58.0);
    let top = if series.len() > 1 { 36.0 } else { 14.0 };
    let mut svg = Svg::new(width, height, title);
    let vertical = vertical.over(bottom, top);
    svg.vertical(&vertical, left, right);
    if series.len() > 1 {
        svg.legend([left + 4.0, 16.0], series);
    }
    let group_px = (right - left) / groups.len().max(1) as f64;
    let bar_px = 0.78 * group_px / series.len().max(1) as f64;
    for (index, (label, values)) in groups.iter().enumerate() {
        let start = left + (index as f64 + 0.11) * group_px;
        for (place, (value, (class, _, name))) in values.iter().zip(series).enumerate() {
            let y = vertical.at(*value);
            let corner = [start + place as f64 * bar_px + 0.5, y];
            let tip = format!("{label}, {name}: {value:.3}");
            svg.rect(class, corner, [bar_px - 1.0, bottom - y], &tip);
        }
        let middle = left + (index as f64 + 0.5) * group_px;
        for (line, part) in label.split('\n').enumerate() {
            svg.text("middle", [middle, bottom + 16.0 + 14.0 * line as f64], part);
        }
    }
    svg.line("axis", [left, bottom], [right, bottom]);
    svg.text(
        "middle",
        [0.5 * (left + right), height - 8.0],
        horizontal_label,
    );
    svg.finish()
}
