//! Images.

/// Errors of images.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// The picture has no pixels, or more than PNG allows.
    #[error("cannot encode an image of {width_px} x {height_px} pixels: {source}")]
    Encode {
        /// Width of the picture.
        width_px: usize,
        /// Height of the picture.
        height_px: usize,
        /// Error of the encoder.
        source: png::EncodingError,
    },
}

/// An opaque picture, sRGB.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Image {
    width_px: usize,
    height_px: usize,
    /// Row by row from the top left.
    pixels: Vec<[u8; 3]>,
}

impl Image {
    /// A picture of one colour.
    pub fn filled(width_px: usize, height_px: usize, color: [u8; 3]) -> Self {
        Self {
            width_px,
            height_px,
            pixels: vec![color; width_px * height_px],
        }
    }

    /// The picture of `pixels`, row by row from the top left, of which there are `width_px` each.
    pub(crate) fn from_pixels(width_px: usize, pixels: Vec<[u8; 3]>) -> Self {
        let height_px = pixels.len().checked_div(width_px).unwrap_or(0);
        Self {
            width_px,
            height_px,
            pixels,
        }
    }

    /// Width in pixels.
    pub fn width_px(&self) -> usize {
        self.width_px
    }

    /// Height in pixels.
    pub fn height_px(&self) -> usize {
        self.height_px
    }

    /// Red, green and blue at a column from the left and a row from the top; `None` outside.
    pub fn pixel(&self, x: usize, y: usize) -> Option<[u8; 3]> {
        if x < self.width_px {
            self.pixels.get(y * self.width_px + x).copied()
        } else {
            None
        }
    }

    /// Covers the pixel with `color` to the extent of `opacity` (0 to 255); nothing outside.
    pub fn blend(&mut self, x: i64, y: i64, color: [u8; 3], opacity: u8) {
        let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) else {
            return;
        };
        if x >= self.width_px || y >= self.height_px {
            return;
        }
        for (under, over) in self.pixels[y * self.width_px + x].iter_mut().zip(color) {
            let sum =
                u16::from(*under) * u16::from(255 - opacity) + u16::from(over) * u16::from(opacity);
            // At most 255: a weighted mean of two bytes.
            *under = u8::try_from((sum + 127) / 255).unwrap_or(u8::MAX);
        }
    }

    /// Fills a rectangle, clipped to this picture.
    pub fn fill(&mut self, [left, top]: [usize; 2], [width, height]: [usize; 2], color: [u8; 3]) {
        let right = (left + width).min(self.width_px);
        for y in top..(top + height).min(self.height_px) {
            let row = y * self.width_px;
            if left < right {
                self.pixels[row + left..row + right].fill(color);
            }
        }
    }

    /// Copies `other` with its top left corner at the given pixel, clipped to this picture.
    pub(crate) fn paste(&mut self, other: &Self, left: usize, top: usize) {
        let width = other.width_px.min(self.width_px.saturating_sub(left));
        let height = other.height_px.min(self.height_px.saturating_sub(top));
        for y in 0..height {
            let from = y * other.width_px;
            let to = (top + y) * self.width_px + left;
            self.pixels[to..to + width].copy_from_slice(&other.pixels[from..from + width]);
        }
    }

    /// The picture as the bytes of a PNG file.
    pub fn to_png(&self) -> Result<Vec<u8>, PictureError> {
        let encode = || {
            // A side beyond 32 bits is rejected by the encoder as a side of zero is.
            let side = |pixels: usize| u32::try_from(pixels).unwrap_or(0);
            let mut bytes = Vec::new();
            let mut encoder =
                png::Encoder::new(&mut bytes, side(self.width_px), side(self.height_px));
            encoder.set_color(png::ColorType::Rgb);
            encoder.set_depth(png::BitDepth::Eight);
            // A tenth of the default's time, for files larger by a third.
            encoder.set_compression(png::Compression::Fast);
            encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
            let mut writer = encoder.write_header()?;
            writer.write_image_data(self.pixels.as_flattened())?;
            writer.finish()?;
            Ok(bytes)
        };
        encode().map_err(|source| PictureError::Encode {
            width_px: self.width_px,
            height_px: self.height_px,
            source,
        })
    }
}
