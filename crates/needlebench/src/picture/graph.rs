//! Curves over axes.

use super::flat::{Canvas, Rgb, pixel};

/// Colours of grid, frame and what a graph is drawn on.
const GRID: Rgb = [224, 227, 231];
const FRAME: Rgb = [120, 126, 134];
const PAPER: Rgb = [255, 255, 255];

/// One axis.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Axis {
    pub low: f64,
    pub high: f64,
    /// Decades instead of equal steps; both ends have to be positive.
    pub logarithmic: bool,
}

impl Axis {
    /// From `low` to `high`.
    pub(crate) fn linear(low: f64, high: f64) -> Self {
        Self {
            low,
            high,
            logarithmic: false,
        }
    }

    /// Around all values with a margin; unit length around a single one.
    pub(crate) fn around(values: impl IntoIterator<Item = f64>) -> Self {
        let (low, high) = values
            .into_iter()
            .filter(|value| value.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
                (low.min(value), high.max(value))
            });
        if low > high {
            return Self::linear(0.0, 1.0);
        }
        let margin = if high > low { 0.06 * (high - low) } else { 0.5 };
        Self::linear(low - margin, high + margin)
    }

    /// Share of the way from the low to the high end; beyond 0 to 1 outside.
    fn share(&self, value: f64) -> f64 {
        if self.logarithmic {
            (value / self.low).ln() / (self.high / self.low).ln()
        } else {
            (value - self.low) / (self.high - self.low)
        }
    }

    /// Round values along the axis, about `wanted` of them.
    fn ticks(&self, wanted: f64) -> Vec<f64> {
        if self.logarithmic {
            let decades = (-12..=12).map(|power| 10_f64.powi(power));
            let within = |value: &f64| {
                *value >= self.low * (1.0 - 1e-9) && *value <= self.high * (1.0 + 1e-9)
            };
            return decades
                .flat_map(|decade| [decade, 2.0 * decade, 5.0 * decade])
                .filter(within)
                .collect();
        }
        let raw = (self.high - self.low) / wanted;
        let decade = 10_f64.powf(raw.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0]
            .map(|factor| factor * decade)
            .into_iter()
            .find(|step| *step >= raw)
            .unwrap_or(raw);
        if !(step > 0.0 && step.is_finite()) {
            return Vec::new();
        }
        let first = (self.low / step).ceil();
        (0..50)
            .map(|k| (first + f64::from(k)) * step)
            .take_while(|value| *value <= self.high)
            // Zero, not its rounding.
            .map(|value| {
                if value.abs() < 1e-9 * step {
                    0.0
                } else {
                    value
                }
            })
            .collect()
    }
}

/// A rectangle with two axes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Graph {
    pub corner: [usize; 2],
    pub size: [usize; 2],
    pub x: Axis,
    pub y: Axis,
}

impl Graph {
    /// Draws frame, grid, tick values and the title above.
    pub(crate) fn draw(&self, canvas: &mut Canvas, title: &str) {
        let ([left, top], [width, height]) = (self.corner, self.size);
        canvas.fill(self.corner, self.size, PAPER);
        for value in self.x.ticks(width as f64 / 90.0) {
            let [x, _] = self.at(value, self.y.low);
            let (foot, head) = ((top + height) as f64, top as f64);
            canvas.stroke([x, head], [x, foot], 1.0, GRID);
            canvas.write_centred([pixel(x), top + height + 4], &label(value));
        }
        for value in self.y.ticks(height as f64 / 45.0) {
            let [_, y] = self.at(self.x.low, value);
            canvas.stroke([left as f64, y], [(left + width) as f64, y], 1.0, GRID);
            let text = label(value);
            let start = left.saturating_sub(canvas.width_of(&text) + 6);
            canvas.write([start, pixel(y).saturating_sub(8)], &text);
        }
        canvas.frame(self.corner, self.size, FRAME);
        canvas.write([left, top.saturating_sub(20)], title);
    }

    /// Pixel of a point.
    pub(crate) fn at(&self, x: f64, y: f64) -> [f64; 2] {
        let across = self.x.share(x).clamp(0.0, 1.0);
        let up = self.y.share(y).clamp(0.0, 1.0);
        [
            self.corner[0] as f64 + across * self.size[0] as f64,
            self.corner[1] as f64 + (1.0 - up) * self.size[1] as f64,
        ]
    }

    /// Draws a curve through points; `dash` pixels drawn and left out in turn, 0 for a full line.
    pub(crate) fn curve(
        &self,
        canvas: &mut Canvas,
        points: impl IntoIterator<Item = [f64; 2]>,
        [width, dash]: [f64; 2],
        color: Rgb,
    ) {
        let mut last: Option<[f64; 2]> = None;
        let mut gone = 0.0;
        for [x, y] in points {
            let point = self.at(x, y);
            if let Some(from) = last {
                let length = (point[0] - from[0]).hypot(point[1] - from[1]);
                // Points closer than a pixel are gathered.
                if length < 1.0 {
                    continue;
                }
                let drawn = dash <= 0.0 || (gone / dash).rem_euclid(2.0) < 1.0;
                if drawn {
                    canvas.stroke(from, point, width, color);
                }
                gone += length;
            }
            last = Some(point);
        }
    }

    /// Marks points with discs.
    pub(crate) fn marks(
        &self,
        canvas: &mut Canvas,
        points: impl IntoIterator<Item = [f64; 2]>,
        radius: f64,
        color: Rgb,
    ) {
        for [x, y] in points {
            canvas.disc(self.at(x, y), radius, color);
        }
    }
}

/// A tick's value without trailing zeros.
fn label(value: f64) -> String {
    let text = format!("{value:.4}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0" } else { text }.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        let axis = Axis::linear(-0.13, 1.07);
        assert_eq!(
            axis.ticks(7.0),
            [0.0, 0.2, 0.4, 0.6000000000000001, 0.8, 1.0]
        );
        let decades = Axis {
            low: 1.0,
            high: 100.0,
            logarithmic: true,
        };
        assert_eq!(decades.ticks(3.0), [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0]);
    }

    #[test]
    fn senseless_axes_draw_nothing_and_do_not_fail() {
        for axis in [
            Axis::around([f64::NAN]),
            Axis::around([]),
            Axis::around([3.0]),
            Axis::linear(1.0, 1.0),
            Axis::linear(f64::NAN, 1.0),
        ] {
            let graph = Graph {
                corner: [60, 30],
                size: [100, 50],
                x: axis,
                y: axis,
            };
            let mut canvas = Canvas::new(200, 100, PAPER);
            graph.draw(&mut canvas, "title");
            graph.curve(
                &mut canvas,
                [[0.0, 0.0], [1.0, f64::NAN]],
                [1.0, 0.0],
                FRAME,
            );
        }
    }
}
