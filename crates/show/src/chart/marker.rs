//! Marks whose shapes tell series apart without colour.

use super::drawing::{Chart, Mark};
use super::paint::Paint;

/// Half the size of a mark, px.
const RADIUS_PX: f64 = 4.0;

/// A shape.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Marker {
    /// A disc.
    Disc,
    /// A square.
    Square,
    /// A square on its corner.
    Diamond,
    /// A triangle on its side.
    Triangle,
}

impl Marker {
    /// The shape of the series with an index, again from the first after the fourth.
    pub fn of(series: usize) -> Self {
        [Self::Disc, Self::Square, Self::Diamond, Self::Triangle][series % 4]
    }

    /// Draws it; a pointer over it is told `tip`.
    pub fn draw(self, chart: &mut Chart, [x, y]: [f64; 2], fill: Paint, tip: Option<&str>) {
        let r = RADIUS_PX;
        let corners: &[[f64; 2]] = match self {
            Self::Disc => &[],
            Self::Square => &[[-r, -r], [r, -r], [r, r], [-r, r]],
            Self::Diamond => &[
                [0.0, -1.3 * r],
                [1.3 * r, 0.0],
                [0.0, 1.3 * r],
                [-1.3 * r, 0.0],
            ],
            Self::Triangle => &[[0.0, -1.2 * r], [1.2 * r, r], [-1.2 * r, r]],
        };
        let mark = if corners.is_empty() {
            Mark::Disc {
                centre: [x, y],
                radius: r,
                fill,
            }
        } else {
            let points = corners.iter().map(|[dx, dy]| [x + dx, y + dy]).collect();
            Mark::Polygon { points, fill }
        };
        match tip {
            Some(tip) => chart.add_with_tip(mark, tip),
            None => chart.add(mark),
        }
    }
}
