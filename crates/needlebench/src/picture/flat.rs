//! Flat pictures: rectangles and text.

use super::image::Image;
use super::text::{TextSize, signed};

/// Red, green, blue (sRGB).
pub(crate) type Rgb = [u8; 3];

/// A picture that is drawn piece by piece.
#[derive(Debug)]
pub(crate) struct Canvas {
    image: Image,
    small: TextSize,
    large: TextSize,
}

impl Canvas {
    pub fn new(width_px: usize, height_px: usize, color: Rgb) -> Self {
        Self {
            image: Image::filled(width_px, height_px, color),
            small: TextSize::SMALL,
            large: TextSize::LARGE,
        }
    }

    /// Fills a rectangle; what lies outside the picture is left out.
    pub fn fill(&mut self, [left, top]: [usize; 2], [width, height]: [usize; 2], color: Rgb) {
        for y in top..top + height {
            for x in left..left + width {
                self.image.blend(signed(x), signed(y), color, u8::MAX);
            }
        }
    }

    /// Draws the edge of a rectangle, one pixel wide.
    pub fn frame(&mut self, [left, top]: [usize; 2], [width, height]: [usize; 2], color: Rgb) {
        self.fill([left, top], [width, 1], color);
        self.fill([left, top + height - 1], [width, 1], color);
        self.fill([left, top], [1, height], color);
        self.fill([left + width - 1, top], [1, height], color);
    }

    /// Writes text with its top left corner at a pixel.
    pub fn write(&mut self, at: [usize; 2], text: &str) {
        self.small.write(&mut self.image, at.map(signed), text);
    }

    /// The same in a larger size.
    pub fn write_large(&mut self, at: [usize; 2], text: &str) {
        self.large.write(&mut self.image, at.map(signed), text);
    }

    /// Writes text with the middle of its upper edge at a pixel.
    pub fn write_centred(&mut self, [x, top]: [usize; 2], text: &str) {
        let left = signed(x) - signed(self.width_of(text) / 2);
        self.small.write(&mut self.image, [left, signed(top)], text);
    }

    /// Width of a text, px.
    pub fn width_of(&self, text: &str) -> usize {
        self.small.extent_px(text)[0]
    }

    /// Fills a disc; centre and radius in pixels.
    pub fn disc(&mut self, centre: [f64; 2], radius: f64, color: Rgb) {
        self.shade(centre, centre, radius, color, |distance| radius - distance);
    }

    /// Draws a circle.
    pub fn circle(&mut self, centre: [f64; 2], radius: f64, width: f64, color: Rgb) {
        self.shade(centre, centre, radius + width, color, |distance| {
            0.5 * width - (distance - radius).abs()
        });
    }

    /// Draws a straight line with round ends.
    pub fn stroke(&mut self, from: [f64; 2], to: [f64; 2], width: f64, color: Rgb) {
        self.shade(from, to, width, color, |distance| 0.5 * width - distance);
    }

    /// Covers each pixel near a segment by how deep it lies inside, a function of its distance from
    /// the segment, in pixels. What is not finite or outside the picture is left out.
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
        let sides = [self.image.width_px(), self.image.height_px()];
        let [columns, rows] = [0, 1].map(|k| {
            let low = from[k].min(to[k]) - reach - 1.0;
            let high = from[k].max(to[k]) + reach + 1.0;
            whole(low)..whole(high + 1.0).min(sides[k])
        });
        for y in rows {
            for x in columns.clone() {
                let offset = [x as f64 + 0.5 - from[0], y as f64 + 0.5 - from[1]];
                let share = if length_squared > 0.0 {
                    let dot = offset[0] * along[0] + offset[1] * along[1];
                    (dot / length_squared).clamp(0.0, 1.0)
                } else {
                    0.0
                };
                let distance = (offset[0] - share * along[0]).hypot(offset[1] - share * along[1]);
                let opacity = whole(255.0 * (depth(distance) + 0.5).clamp(0.0, 1.0));
                let opacity = u8::try_from(opacity).unwrap_or(u8::MAX);
                self.image.blend(signed(x), signed(y), color, opacity);
            }
        }
    }

    pub fn into_image(self) -> Image {
        self.image
    }
}

/// The pixel nearest to a place in the picture; 0 for negative ones and NaN.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "saturates, and NaN becomes 0"
)]
pub(crate) fn pixel(place: f64) -> usize {
    place.round() as usize
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
