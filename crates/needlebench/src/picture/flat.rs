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

    pub fn into_image(self) -> Image {
        self.image
    }
}
