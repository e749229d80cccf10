//! Text in Noto Sans Mono, from pictures of its glyphs.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

use crate::image::Image;

/// Text colour.
const INK: [u8; 3] = [25, 30, 38];

/// Height of a line of text.
#[derive(Debug, Clone, Copy)]
pub struct TextSize(RasterHeight);

impl TextSize {
    /// For axes and legends.
    pub const SMALL: Self = Self(RasterHeight::Size16);
    /// For titles.
    pub const LARGE: Self = Self(RasterHeight::Size24);

    /// The size for a picture of the given height: about 45 lines, as far as the font allows.
    pub(crate) fn for_picture(height_px: usize) -> Self {
        Self(match height_px {
            0..700 => RasterHeight::Size16,
            700..1000 => RasterHeight::Size20,
            1000..1400 => RasterHeight::Size24,
            _ => RasterHeight::Size32,
        })
    }

    /// Height of a line, px.
    pub fn line_px(self) -> usize {
        self.0.val()
    }

    /// Width and height of a text.
    pub fn extent_px(self, text: &str) -> [usize; 2] {
        let columns = text
            .lines()
            .map(|line| line.chars().count())
            .max()
            .unwrap_or(0);
        let width_px = columns * get_raster_width(FontWeight::Regular, self.0);
        [width_px, text.lines().count() * self.line_px()]
    }

    /// Writes a text with its top left corner at the given pixel.
    pub fn write(self, image: &mut Image, [left, top]: [i64; 2], text: &str) {
        self.each_pixel(text, |x, y, opacity| {
            image.blend(left + x, top + y, INK, opacity);
        });
    }

    /// Column, row and opacity of every pixel of a text, from its top left corner.
    pub fn each_pixel(self, text: &str, mut cover: impl FnMut(i64, i64, u8)) {
        let advance = get_raster_width(FontWeight::Regular, self.0);
        for (row, line) in text.lines().enumerate() {
            for (column, character) in line.chars().enumerate() {
                let Some(glyph) = get_raster(shown(character), FontWeight::Regular, self.0)
                    .or_else(|| get_raster('?', FontWeight::Regular, self.0))
                else {
                    continue;
                };
                for (dy, pixels) in glyph.rows().enumerate() {
                    for (dx, &opacity) in pixels.iter().enumerate() {
                        let x = signed(column * advance + dx);
                        cover(x, signed(row * self.line_px() + dy), opacity);
                    }
                }
            }
        }
    }
}

/// Characters that the font lacks but whose look-alike it has.
fn shown(character: char) -> char {
    match character {
        '\u{3bc}' => '\u{b5}', // mu
        '\u{2212}' | '\u{2010}' | '\u{2011}' | '\u{2013}' | '\u{2014}' => '-',
        '\u{2018}' | '\u{2019}' => '\'',
        '\u{201c}' | '\u{201d}' => '"',
        other => other,
    }
}

/// Pixel counts as coordinates; pictures have no more than an `i64` holds.
pub fn signed(pixels: usize) -> i64 {
    i64::try_from(pixels).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(text: &str) -> Image {
        let size = TextSize::for_picture(900);
        let [width_px, height_px] = size.extent_px(text);
        let mut image = Image::filled(width_px, height_px, [255; 3]);
        size.write(&mut image, [0, 0], text);
        image
    }

    #[test]
    fn characters_of_reports_have_glyphs() {
        for character in ('!'..='~').chain("µ°±²³×·Øμ−–’".chars()) {
            let image = written(&character.to_string());
            let blank = Image::filled(image.width_px(), image.height_px(), [255; 3]);
            assert!(image != blank, "{character} is blank");
            assert!(
                character == '?' || image != written("?"),
                "{character} is missing"
            );
        }
        assert!(written("漢") == written("?"));
    }

    #[test]
    fn extent_is_that_of_the_longest_line_and_all_lines() {
        let size = TextSize::for_picture(900);
        let [width_px, height_px] = size.extent_px("M");
        assert_eq!(size.extent_px("MM\nM\nMMM"), [3 * width_px, 3 * height_px]);
        assert_eq!(size.extent_px(""), [0, 0]);
    }
}
