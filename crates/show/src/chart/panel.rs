//! A rectangle with two axes, and what is drawn in it.

use super::axis::Axis;
use super::drawing::{Anchor, Chart, Mark, Size};
use super::paint::{Paint, Stroke};

/// Space between ticks, px: along, where it is wide, and upwards.
const TICKS_PX: [f64; 2] = [90.0, 45.0];
/// Ticks along that even a narrow one has, if their texts have as much space as those beside it.
const FEWEST_TICKS: f64 = 4.0;
/// From the frame to the middle of the texts of ticks, clear of those beside it, and of an axis below it, px.
const TICK_BELOW_PX: f64 = 16.0;
const LABEL_BELOW_PX: f64 = 34.0;
/// From the frame to the end of the texts of ticks beside it, and on to the middle of the label, px.
const TICK_BESIDE_PX: f64 = 7.0;
const LABEL_BESIDE_PX: f64 = 14.0;
/// From the frame up to the middle of the title, px.
const TITLE_ABOVE_PX: f64 = 13.0;

/// A rectangle with two axes.
#[derive(Debug, Clone)]
pub struct Panel {
    /// Upper left corner, px.
    pub corner: [f64; 2],
    /// Width and height, px.
    pub size: [f64; 2],
    /// Above it; empty for none.
    pub title: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
}

impl Panel {
    /// Paper, grid and frame, with the texts of axes and title.
    pub fn draw(&self, chart: &mut Chart) {
        self.draw_paper(chart);
        self.draw_axes(chart);
    }

    /// What lies below everything; bands are drawn between this and the axes.
    pub fn draw_paper(&self, chart: &mut Chart) {
        chart.fill(self.corner, self.size, Paint::Paper);
    }

    /// Grid, frame and texts.
    pub fn draw_axes(&self, chart: &mut Chart) {
        self.draw_horizontal(chart);
        self.draw_vertical(chart);
        chart.frame(self.corner, self.size, Paint::Soft);
        if !self.title.is_empty() {
            let [left, top] = self.corner;
            chart.write(Anchor::Start, [left, top - TITLE_ABOVE_PX], &*self.title);
        }
    }

    /// Grid and texts of the horizontal axis.
    pub fn draw_horizontal(&self, chart: &mut Chart) {
        let ([left, top], [width, height]) = (self.corner, self.size);
        let foot = top + height;
        let mut free = f64::NEG_INFINITY;
        let [wide, narrow] = TICKS_PX.map(|space| width / space);
        for (value, text) in self.x.ticks(wide.max(narrow.min(FEWEST_TICKS))) {
            let x = left + self.x.share(value) * width;
            chart.line([x, top], [x, foot], Stroke::full(Paint::Grid, 1.0));
            // A text that would touch the one before it is left out.
            let half = 0.5 * Size::Small.width(&text);
            if x - half >= free {
                free = x + half + Size::Small.width(" ");
                chart.write(Anchor::Middle, [x, foot + TICK_BELOW_PX], text);
            }
        }
        if !self.x.label.is_empty() {
            let at = [left + 0.5 * width, foot + LABEL_BELOW_PX];
            chart.write(Anchor::Middle, at, &*self.x.label);
        }
    }

    /// Grid and texts of the vertical axis.
    pub fn draw_vertical(&self, chart: &mut Chart) {
        let ([left, top], [width, height]) = (self.corner, self.size);
        let mut widest: f64 = 0.0;
        for (value, text) in self.y.ticks(height / TICKS_PX[1]) {
            let y = top + (1.0 - self.y.share(value)) * height;
            chart.line([left, y], [left + width, y], Stroke::full(Paint::Grid, 1.0));
            widest = widest.max(Size::Small.width(&text));
            chart.write(Anchor::End, [left - TICK_BESIDE_PX, y], text);
        }
        if !self.y.label.is_empty() {
            let x = left - TICK_BESIDE_PX - widest - LABEL_BESIDE_PX;
            chart.write_upwards([x, top + 0.5 * height], &*self.y.label);
        }
    }

    /// Where a point is, px; at the rim if it is beyond.
    pub fn at(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [
            self.corner[0] + self.x.share(x) * self.size[0],
            self.corner[1] + (1.0 - self.y.share(y)) * self.size[1],
        ]
    }

    /// Draws a curve through points; it is broken where one is not finite.
    pub fn curve(
        &self,
        chart: &mut Chart,
        points: impl IntoIterator<Item = [f64; 2]>,
        stroke: Stroke,
    ) {
        let mut run: Vec<[f64; 2]> = Vec::new();
        // The point before, if it was too near to the last one that is drawn.
        let mut near: Option<[f64; 2]> = None;
        for point in points {
            if !point.iter().all(|value| value.is_finite()) {
                run.extend(near.take());
                add(chart, std::mem::take(&mut run), stroke);
                continue;
            }
            let place = self.at(point);
            let far = run.last().is_none_or(|last| {
                let gap = libm::hypot(place[0] - last[0], place[1] - last[1]);
                // Less is not seen.
                gap >= 0.7
            });
            if far {
                run.push(place);
                near = None;
            } else {
                near = Some(place);
            }
        }
        run.extend(near);
        add(chart, run, stroke);
    }

    /// Draws a level line through the whole panel.
    pub fn level(&self, chart: &mut Chart, value: f64, stroke: Stroke) {
        self.curve(chart, [[self.x.low, value], [self.x.high, value]], stroke);
    }

    /// Draws an upright line through the whole panel.
    pub fn upright(&self, chart: &mut Chart, value: f64, stroke: Stroke) {
        self.curve(chart, [[value, self.y.low], [value, self.y.high]], stroke);
    }

    /// Fills the panel from one value of the horizontal axis to another.
    pub fn band(&self, chart: &mut Chart, [from, to]: [f64; 2], fill: Paint) {
        let [left, right] = [from, to].map(|value| self.at([value, self.y.low])[0]);
        let top = self.corner[1];
        chart.fill([left, top], [right - left, self.size[1]], fill);
    }

    /// Marks points with discs.
    pub fn points(
        &self,
        chart: &mut Chart,
        points: impl IntoIterator<Item = [f64; 2]>,
        radius: f64,
        fill: Paint,
    ) {
        for point in points {
            if point.iter().all(|value| value.is_finite()) {
                chart.disc(self.at(point), radius, fill);
            }
        }
    }
}

fn add(chart: &mut Chart, points: Vec<[f64; 2]>, stroke: Stroke) {
    if points.len() > 1 {
        chart.add(Mark::Line { points, stroke });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn panel(x: Axis, y: Axis) -> Panel {
        Panel {
            corner: [60.0, 30.0],
            size: [200.0, 100.0],
            title: "title".to_owned(),
            x,
            y,
        }
    }

    fn lines(chart: &Chart) -> Vec<&[[f64; 2]]> {
        chart
            .marks
            .iter()
            .filter_map(|(mark, _)| match mark {
                Mark::Line { points, .. } => Some(&points[..]),
                _ => None,
            })
            .collect()
    }

    #[test]
    fn curves_are_broken_where_nothing_is_known_and_keep_their_ends() {
        let panel = panel(Axis::linear("", 0.0, 200.0), Axis::linear("", 0.0, 100.0));
        let mut chart = Chart::new([300.0, 200.0], "");
        let points = [
            [0.0, 0.0],
            [0.1, 0.0],
            [10.0, 0.0],
            [10.1, 0.0],
            [f64::NAN, 0.0],
            [20.0, 500.0],
            [30.0, 100.0],
        ];
        panel.curve(&mut chart, points, Stroke::full(Paint::Ink, 1.0));
        assert_eq!(
            lines(&chart),
            [
                &[[60.0, 130.0], [70.0, 130.0], [70.1, 130.0]][..],
                &[[80.0, 30.0], [90.0, 30.0]]
            ]
        );
    }

    #[test]
    fn senseless_axes_draw_nothing_that_is_not_finite() {
        for axis in [
            Axis::around("", [f64::NAN]),
            Axis::around("", []),
            Axis::linear("", 1.0, 1.0),
            Axis::linear("", f64::NAN, 1.0),
        ] {
            let mut chart = Chart::new([300.0, 200.0], "");
            let panel = panel(axis.clone(), axis);
            panel.draw(&mut chart);
            panel.curve(
                &mut chart,
                [[0.0, 0.0], [1.0, f64::NAN]],
                Stroke::full(Paint::Ink, 1.0),
            );
            assert!(!chart.to_svg().contains("NaN"));
            assert_eq!(chart.to_image().width_px(), 300);
        }
    }

    #[test]
    fn texts_of_ticks_that_would_touch_are_left_out() {
        let ticks = (0..100)
            .map(|k| (f64::from(k), "12345".to_owned()))
            .collect();
        let panel = panel(
            Axis::linear("", 0.0, 100.0).with_ticks(ticks),
            Axis::linear("", 0.0, 1.0),
        );
        let mut chart = Chart::new([320.0, 200.0], "");
        panel.draw(&mut chart);
        assert_eq!(chart.illegible(), None);
    }
}
