//! The back end for pixels.

use needlebench_render::{Image, signed};

use super::drawing::{Chart, Mark, Text};
use super::paint::{Paint, Rgb, Stroke};

impl Chart {
    /// The chart in pixels.
    pub fn to_image(&self) -> Image {
        let [width, height] = self.size.map(whole);
        let mut canvas = Canvas(Image::filled(width, height, Paint::Page.rgb()));
        for (mark, _) in &self.marks {
            canvas.draw(mark);
        }
        canvas.0
    }
}

/// A picture that is drawn mark by mark. What is outside it or not finite is left out.
struct Canvas(Image);

impl Canvas {
    fn draw(&mut self, mark: &Mark) {
        match mark {
            Mark::Rectangle { corner, size, fill } => self.fill(*corner, *size, fill.rgb()),
            Mark::Frame {
                corner,
                size,
                paint,
            } => self.frame(*corner, *size, paint.rgb()),
            Mark::Line { points, stroke } => self.line(points, stroke),
            Mark::Polygon { points, fill } => self.polygon(points, fill.rgb()),
            Mark::Disc {
                centre,
                radius,
                fill,
            } => self.shade(*centre, *centre, *radius, fill.rgb(), |distance| {
                radius - distance
            }),
            Mark::Circle {
                centre,
                radius,
                stroke,
            } => self.circle(*centre, *radius, stroke),
            Mark::Text(text) => self.write(text),
        }
    }

    /// Edges are at whole pixels, so that neighbours leave no gap.
    fn fill(&mut self, corner: [f64; 2], size: [f64; 2], color: Rgb) {
        let [[left, right], [top, bottom]] =
            [0, 1].map(|k| [corner[k], corner[k] + size[k].max(0.0)].map(pixel));
        self.0
            .fill([left, top], [right - left, bottom - top], color);
    }

    fn frame(&mut self, [left, top]: [f64; 2], [width, height]: [f64; 2], color: Rgb) {
        self.fill([left, top], [width, 1.0], color);
        self.fill([left, top + height - 1.0], [width, 1.0], color);
        self.fill([left, top], [1.0, height], color);
        self.fill([left + width - 1.0, top], [1.0, height], color);
    }

    fn line(&mut self, points: &[[f64; 2]], stroke: &Stroke) {
        let mut gone = 0.0;
        for pair in points.windows(2) {
            let [from, to] = [pair[0], pair[1]];
            let along = [to[0] - from[0], to[1] - from[1]];
            let length = libm::hypot(along[0], along[1]);
            if !length.is_finite() {
                continue;
            }
            let at = |way: f64| {
                let share = if length > 0.0 { way / length } else { 0.0 };
                [from[0] + share * along[0], from[1] + share * along[1]]
            };
            match stroke.dash {
                Some([drawn, left_out]) if drawn > 0.0 && left_out > 0.0 => {
                    let period = drawn + left_out;
                    let mut start = -(gone % period);
                    while start < length {
                        let (begin, end) = (start.max(0.0), (start + drawn).min(length));
                        if begin < end {
                            self.segment(at(begin), at(end), stroke);
                        }
                        start += period;
                    }
                }
                _ => self.segment(from, to, stroke),
            }
            gone += length;
        }
    }

    fn segment(&mut self, from: [f64; 2], to: [f64; 2], stroke: &Stroke) {
        let (half, color) = (0.5 * stroke.width, stroke.paint.rgb());
        self.shade(from, to, half, color, |distance| half - distance);
    }

    fn circle(&mut self, centre: [f64; 2], radius: f64, stroke: &Stroke) {
        let half = 0.5 * stroke.width;
        self.shade(
            centre,
            centre,
            radius + half,
            stroke.paint.rgb(),
            |distance| half - (distance - radius).abs(),
        );
    }

    /// Covers each pixel near a segment by how deep it lies inside, a function of its distance from
    /// the segment, in pixels.
    fn shade(
        &mut self,
        from: [f64; 2],
        to: [f64; 2],
        reach: f64,
        color: Rgb,
        depth: impl Fn(f64) -> f64,
    ) {
        let along = [to[0] - from[0], to[1] - from[1]];
        let length_squared = along[0] * along[0] + along[1] * along[1];
        self.each_pixel([from, to], reach, color, |[x, y]| {
            let offset = [x - from[0], y - from[1]];
            let share = if length_squared > 0.0 {
                let dot = offset[0] * along[0] + offset[1] * along[1];
                (dot / length_squared).clamp(0.0, 1.0)
            } else {
                0.0
            };
            depth(libm::hypot(
                offset[0] - share * along[0],
                offset[1] - share * along[1],
            ))
        });
    }

    fn polygon(&mut self, points: &[[f64; 2]], color: Rgb) {
        let area: f64 = edges(points).map(|[a, b]| a[0] * b[1] - b[0] * a[1]).sum();
        let bounds = [f64::min, f64::max].map(|pick: fn(f64, f64) -> f64| {
            [0, 1].map(|k| points.iter().map(|point| point[k]).fold(f64::NAN, pick))
        });
        self.each_pixel(bounds, 0.0, color, |[x, y]| {
            edges(points)
                .map(|[a, b]| {
                    let along = [b[0] - a[0], b[1] - a[1]];
                    let turn = along[0] * (y - a[1]) - along[1] * (x - a[0]);
                    area.signum() * turn / libm::hypot(along[0], along[1])
                })
                .fold(f64::INFINITY, f64::min)
        });
    }

    /// Covers the pixels of a rectangle, grown by `reach`, by how deep they lie inside a shape.
    fn each_pixel(
        &mut self,
        [from, to]: [[f64; 2]; 2],
        reach: f64,
        color: Rgb,
        depth: impl Fn([f64; 2]) -> f64,
    ) {
        let sides = [self.0.width_px(), self.0.height_px()];
        let [columns, rows] = [0, 1].map(|k| {
            let low = from[k].min(to[k]) - reach - 1.0;
            let high = from[k].max(to[k]) + reach + 1.0;
            whole(low)..whole(high + 1.0).min(sides[k])
        });
        for y in rows {
            for x in columns.clone() {
                let inside = depth([x as f64 + 0.5, y as f64 + 0.5]);
                let opacity = whole(255.0 * (inside + 0.5).clamp(0.0, 1.0));
                let opacity = u8::try_from(opacity).unwrap_or(u8::MAX);
                self.0.blend(signed(x), signed(y), color, opacity);
            }
        }
    }

    fn write(&mut self, text: &Text) {
        let (size, color) = (text.size.font(), Paint::Ink.rgb());
        let [corner, [_, bottom]] = text.corners();
        let [left, top] = corner.map(nearest);
        let (image, foot) = (&mut self.0, nearest(bottom) - 1);
        size.each_pixel(&text.text, |x, y, opacity| {
            let [x, y] = if text.upwards {
                [left + y, foot - x]
            } else {
                [left + x, top + y]
            };
            image.blend(x, y, color, opacity);
        });
    }
}

/// Sides of a polygon.
fn edges(points: &[[f64; 2]]) -> impl Iterator<Item = [[f64; 2]; 2]> + '_ {
    (0..points.len()).map(|index| [points[index], points[(index + 1) % points.len()]])
}

/// The pixel nearest to a place, in the picture or not; 0 for NaN.
#[expect(
    clippy::cast_possible_truncation,
    reason = "saturates, and NaN becomes 0"
)]
fn nearest(place: f64) -> i64 {
    place.round() as i64
}

/// The pixel nearest to a place in the picture; 0 for negative ones and NaN.
fn pixel(place: f64) -> usize {
    whole(place.round())
}

/// The next lower whole number; 0 for negative ones and NaN.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "saturates, and NaN becomes 0"
)]
fn whole(value: f64) -> usize {
    value as usize
}
