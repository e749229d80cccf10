//! Contact sheets: several pictures on one page.

use crate::image::Image;
use crate::text::{TextSize, signed};

/// Space around the pictures, px.
const GAP_PX: usize = 12;

/// Page colour.
const PAGE: [u8; 3] = [255, 255, 255];

/// One page with all pictures, in rows of at most `columns` (at least one), each with its caption
/// below.
///
/// All places are as large as the largest picture; captions are cut at their place's width. No
/// pictures make an empty page.
pub fn tile(images: &[(Image, String)], columns: usize) -> Image {
    let columns = columns.clamp(1, images.len().max(1));
    let rows = images.len().div_ceil(columns);
    let largest = |side: fn(&Image) -> usize| {
        images
            .iter()
            .map(|(image, _)| side(image))
            .max()
            .unwrap_or(0)
    };
    let (width_px, height_px) = (largest(Image::width_px), largest(Image::height_px));
    let size = TextSize::for_picture(height_px + height_px / 2);
    let lines = images
        .iter()
        .map(|(_, caption)| caption.lines().count())
        .max()
        .unwrap_or(0);
    let caption_px = lines * size.line_px() + GAP_PX / 2;

    let step = [width_px + GAP_PX, height_px + caption_px + GAP_PX];
    let mut page = Image::filled(columns * step[0] + GAP_PX, rows * step[1] + GAP_PX, PAGE);
    for (position, (image, caption)) in images.iter().enumerate() {
        let left = GAP_PX + position % columns * step[0];
        let top = GAP_PX + position / columns * step[1];
        page.paste(image, left, top);
        let letters = width_px / size.extent_px("x")[0].max(1);
        let cut: Vec<String> = caption
            .lines()
            .map(|line| line.chars().take(letters).collect())
            .collect();
        let below = top + height_px + GAP_PX / 4;
        size.write(&mut page, [signed(left), signed(below)], &cut.join("\n"));
    }
    page
}
