//! Labels: texts on translucent boxes, out of each other's way.

use crate::camera::View;
use crate::image::Image;
use crate::scene::{Anchor, Label};
use crate::text::{TextSize, signed};

/// Colour and opacity of a box.
const BOX: ([u8; 3], u8) = ([255, 255, 255], 205);

/// Colour and opacity of a box's rim and of leader lines.
const RIM: ([u8; 3], u8) = ([70, 80, 95], 190);

/// Distance of a box from the rim of the picture and from other boxes, px.
const MARGIN_PX: i64 = 10;

/// Distance of a text from its box's rim, px.
const PADDING_PX: [i64; 2] = [8, 4];

/// Distance of a box from the point of the world that it describes, px.
const LEADER_PX: [i64; 2] = [26, 22];

/// A rectangle of pixels.
#[derive(Debug, Clone, Copy)]
struct Rectangle {
    left: i64,
    top: i64,
    width: i64,
    height: i64,
}

impl Rectangle {
    fn overlaps(&self, other: &Self) -> bool {
        let apart = |low: i64, size: i64, other_low: i64, other_size: i64| {
            low + size + MARGIN_PX / 2 <= other_low || other_low + other_size + MARGIN_PX / 2 <= low
        };
        !apart(self.left, self.width, other.left, other.width)
            && !apart(self.top, self.height, other.top, other.height)
    }
}

/// Draws the labels in their order.
pub(crate) fn draw(image: &mut Image, labels: &[Label], view: &View) {
    let size = TextSize::for_picture(image.height_px());
    let mut taken: Vec<Rectangle> = Vec::new();
    // Corners first: they have nowhere else to go.
    let (corners, points): (Vec<_>, Vec<_>) = labels
        .iter()
        .partition(|label| !matches!(label.anchor, Anchor::World(_)));
    for label in corners.into_iter().chain(points) {
        let Some((mut place, point)) = wanted(label, size, image, view) else {
            continue;
        };
        let upwards = matches!(label.anchor, Anchor::BottomLeft | Anchor::BottomRight);
        while let Some(blocking) = taken.iter().find(|other| other.overlaps(&place)) {
            place.top = if upwards {
                blocking.top - place.height - MARGIN_PX
            } else {
                blocking.top + blocking.height + MARGIN_PX
            };
        }
        if let Some([x, y]) = point {
            // To the nearest place of the box's rim.
            let end_x = x.clamp(place.left, place.left + place.width - 1);
            let end_y = y.clamp(place.top, place.top + place.height - 1);
            leader(image, [x, y], [end_x, end_y]);
        }
        fill(image, &place);
        let text_at = [place.left + PADDING_PX[0], place.top + PADDING_PX[1]];
        size.write(image, text_at, &label.text);
        taken.push(place);
    }
}

/// Position of a label without others, with the pixel that it points to.
fn wanted(
    label: &Label,
    size: TextSize,
    image: &Image,
    view: &View,
) -> Option<(Rectangle, Option<[i64; 2]>)> {
    let extent = size.extent_px(&label.text);
    if extent.contains(&0) {
        return None;
    }
    let width = signed(extent[0]) + 2 * PADDING_PX[0];
    let height = signed(extent[1]) + 2 * PADDING_PX[1];
    let (image_width, image_height) = (signed(image.width_px()), signed(image.height_px()));
    let (right, bottom) = (
        image_width - width - MARGIN_PX,
        image_height - height - MARGIN_PX,
    );
    let (left, top, point) = match label.anchor {
        Anchor::TopLeft => (MARGIN_PX, MARGIN_PX, None),
        Anchor::TopRight => (right, MARGIN_PX, None),
        Anchor::BottomLeft => (MARGIN_PX, bottom, None),
        Anchor::BottomRight => (right, bottom, None),
        Anchor::World(point_m) => {
            let eye_point = view.eye_point(&point_m);
            let [near, ..] = view.guards();
            let at = view.project(&eye_point);
            let inside = at.x_px >= 0.0
                && at.y_px >= 0.0
                && at.x_px < view.width_px as f64
                && at.y_px < view.height_px as f64;
            if near.depth(&eye_point) < 0.0 || !inside {
                return None;
            }
            #[expect(clippy::cast_possible_truncation, reason = "inside the picture")]
            let (x, y) = (at.x_px as i64, at.y_px as i64);
            // Up and to the right; to the left where the right has no space.
            let left = if x + LEADER_PX[0] <= right {
                x + LEADER_PX[0]
            } else {
                (x - LEADER_PX[0] - width).max(MARGIN_PX)
            };
            (
                left,
                (y - LEADER_PX[1] - height).max(MARGIN_PX),
                Some([x, y]),
            )
        }
    };
    Some((
        Rectangle {
            left,
            top,
            width,
            height,
        },
        point,
    ))
}

/// A box with rounded corners.
fn fill(image: &mut Image, place: &Rectangle) {
    let Rectangle {
        left,
        top,
        width,
        height,
    } = *place;
    for dy in 0..height {
        for dx in 0..width {
            let (from_side, from_top) = (dx.min(width - 1 - dx), dy.min(height - 1 - dy));
            if from_side + from_top < 2 {
                continue;
            }
            let rim = from_side == 0 || from_top == 0 || from_side + from_top == 2;
            let (color, opacity) = if rim { RIM } else { BOX };
            image.blend(left + dx, top + dy, color, opacity);
        }
    }
}

/// A dot at `from` and a line to `to`, both inside the picture.
fn leader(image: &mut Image, from: [i64; 2], to: [i64; 2]) {
    for dy in -3..=3_i64 {
        for dx in -3..=3_i64 {
            if dx * dx + dy * dy <= 10 {
                image.blend(from[0] + dx, from[1] + dy, RIM.0, RIM.1);
            }
        }
    }
    let steps = (to[0] - from[0]).abs().max((to[1] - from[1]).abs());
    for step in 4..steps {
        let at =
            |axis: usize| from[axis] + (2 * step * (to[axis] - from[axis]) + steps) / (2 * steps);
        image.blend(at(0), at(1), RIM.0, RIM.1);
    }
}
