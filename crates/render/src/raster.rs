//! Triangles to samples: exact coverage in fixed point.
//!
//! Triangles that share an edge cover each sample along it exactly once (top-left rule), so
//! translucent surfaces show no seams.

use crate::camera::Projected;

/// Samples per pixel along each side.
pub(crate) const SAMPLES_PER_PIXEL: usize = 2;

/// Fixed-point units per sample.
const UNITS: i64 = 256;

/// Fixed-point units per pixel. Coordinates stay below 2^24 (8192 px, a guard band of four
/// pictures, 512 units per pixel), so their products fit 64 bits with some to spare.
const UNITS_PER_PIXEL: f64 = 512.0;

/// A rectangle of samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Grid {
    pub columns: usize,
    pub rows: usize,
}

/// Which side of a triangle is seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Facing {
    /// Both sides.
    Both,
    /// Only counter-clockwise triangles, as the viewer sees them.
    Front,
}

/// A directed edge, `value = step_x x + step_y y + offset >= 0` on the inner side.
#[derive(Debug, Clone, Copy)]
struct Edge {
    step_x: i64,
    step_y: i64,
    offset: i64,
}

impl Edge {
    /// `a` to `b`, with the inside on the right as the rows run downwards.
    fn new([ax, ay]: [i64; 2], [bx, by]: [i64; 2]) -> Self {
        let (step_x, step_y) = (ay - by, bx - ax);
        // A sample exactly on the edge belongs to the triangle of which it is a left or top edge.
        let owns_edge = step_x > 0 || (step_x == 0 && step_y > 0);
        let offset = -(step_x * ax + step_y * ay) - i64::from(!owns_edge);
        Self {
            step_x,
            step_y,
            offset,
        }
    }

    /// Narrows the columns `first..=last` of the row at `y` to the samples inside.
    fn narrow(&self, y: i64, first: &mut i64, last: &mut i64) {
        let at_zero = self.step_x * (UNITS / 2) + self.step_y * y + self.offset;
        let step = self.step_x * UNITS;
        if step > 0 {
            *first = (*first).max(-at_zero.div_euclid(step));
        } else if step < 0 {
            *last = (*last).min(at_zero.div_euclid(-step));
        } else if at_zero < 0 {
            *last = -1;
        }
    }
}

fn fixed(corner: &Projected) -> Option<[i64; 2]> {
    let units = |value_px: f64| {
        let units = (value_px * UNITS_PER_PIXEL).round();
        #[expect(clippy::cast_possible_truncation, reason = "checked to be small")]
        let fixed = (units.abs() < 2f64.powi(30)).then_some(units as i64);
        fixed
    };
    Some([units(corner.x_px)?, units(corner.y_px)?])
}

/// Calls `emit` with the index (row by row) and the nearness of every sample inside the triangle.
///
/// Triangles without area, with corners that are not finite, or outside the grid emit nothing.
pub(crate) fn rasterise(
    mut corners: [Projected; 3],
    facing: Facing,
    grid: Grid,
    mut emit: impl FnMut(usize, f32),
) {
    let (Some(a), Some(mut b), Some(mut c)) =
        (fixed(&corners[0]), fixed(&corners[1]), fixed(&corners[2]))
    else {
        return;
    };
    let mut area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    // Rows run downwards, so what the viewer sees counter-clockwise has a negative area.
    if area < 0 {
        std::mem::swap(&mut b, &mut c);
        corners.swap(1, 2);
        area = -area;
    } else if area == 0 || facing == Facing::Front {
        return;
    }
    let edges = [Edge::new(a, b), Edge::new(b, c), Edge::new(c, a)];

    // Sample i has its place at (i + 1/2) UNITS.
    let range = |axis: usize, count: usize| {
        let low = a[axis].min(b[axis]).min(c[axis]);
        let high = a[axis].max(b[axis]).max(c[axis]);
        let first = (low + UNITS / 2 - 1).div_euclid(UNITS).max(0);
        let last = (high - UNITS / 2).div_euclid(UNITS);
        (
            first,
            last.min(i64::try_from(count).unwrap_or(i64::MAX) - 1),
        )
    };
    let (first_column, last_column) = range(0, grid.columns);
    let (first_row, last_row) = range(1, grid.rows);
    if first_column > last_column {
        return;
    }

    let slope = plane(&corners, [a, b, c], area);
    let nearness = corners.map(|corner| corner.nearness);
    let low = nearness.iter().copied().fold(f64::INFINITY, f64::min);
    let high = nearness.iter().copied().fold(f64::NEG_INFINITY, f64::max);

    for row in first_row..=last_row {
        let y = row * UNITS + UNITS / 2;
        let (mut first, mut last) = (first_column, last_column);
        for edge in &edges {
            edge.narrow(y, &mut first, &mut last);
        }
        if first > last {
            continue;
        }
        let x = first * UNITS + UNITS / 2;
        let mut value =
            corners[0].nearness + slope[0] * (x - a[0]) as f64 + slope[1] * (y - a[1]) as f64;
        let step = slope[0] * UNITS as f64;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "within grid"
        )]
        let indices = {
            let row_start = row as usize * grid.columns;
            row_start + first as usize..=row_start + last as usize
        };
        for index in indices {
            // Slivers have steep planes; between its corners the triangle is never beyond them.
            #[expect(clippy::cast_possible_truncation, reason = "depths are stored as f32")]
            emit(index, value.clamp(low, high) as f32);
            value += step;
        }
    }
}

/// Change of the nearness per unit along x and y.
fn plane(corners: &[Projected; 3], [a, b, c]: [[i64; 2]; 3], area: i64) -> [f64; 2] {
    let to_b = corners[1].nearness - corners[0].nearness;
    let to_c = corners[2].nearness - corners[0].nearness;
    let across = |axis: usize| {
        (
            (b[axis] - a[axis]) as f64,
            (c[axis] - a[axis]) as f64,
            area as f64,
        )
    };
    let (bx, cx, area) = across(0);
    let (by, cy, _) = across(1);
    [
        (to_b * cy - to_c * by) / area,
        (to_c * bx - to_b * cx) / area,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Grid = Grid {
        columns: 64,
        rows: 48,
    };

    fn corner(x_px: f64, y_px: f64, nearness: f64) -> Projected {
        Projected {
            x_px,
            y_px,
            nearness,
        }
    }

    fn covered(corners: [Projected; 3], facing: Facing) -> Vec<(usize, f32)> {
        let mut samples = Vec::new();
        rasterise(corners, facing, GRID, |index, nearness| {
            samples.push((index, nearness));
        });
        samples
    }

    #[test]
    fn a_fan_covers_each_sample_of_a_rectangle_exactly_once() {
        let rim = [
            [3.0, 2.0],
            [20.5, 2.0],
            [28.0, 2.0],
            [28.0, 11.3],
            [28.0, 20.0],
            [3.0, 20.0],
        ];
        for center in [[10.25, 9.75], [12.0, 11.0], [3.1, 19.9]] {
            let mut counts = vec![0; GRID.columns * GRID.rows];
            for side in 0..rim.len() {
                let [a, b, c] = [center, rim[side], rim[(side + 1) % rim.len()]];
                let corners = [a, b, c].map(|[x, y]| corner(x, y, 1.0));
                for (index, _) in covered(corners, Facing::Both) {
                    counts[index] += 1;
                }
            }
            for (index, count) in counts.into_iter().enumerate() {
                let (x, y) = (index % GRID.columns, index / GRID.columns);
                // Pixels 3 to 28 and 2 to 20 are samples 6 to 55 and 4 to 39.
                let expected = i32::from((6..56).contains(&x) && (4..40).contains(&y));
                assert_eq!(count, expected, "sample {x}, {y}, fan from {center:?}");
            }
        }
    }

    #[test]
    fn nearness_is_linear_across_the_triangle() {
        let plane = |x_px: f64, y_px: f64| 2.0 + 0.03 * x_px - 0.02 * y_px;
        let corners =
            [[1.0, 1.0], [2.5, 21.0], [30.0, 17.0]].map(|[x, y]| corner(x, y, plane(x, y)));
        let samples = covered(corners, Facing::Both);
        assert!(samples.len() > 500);
        for (index, nearness) in samples {
            let (x, y) = (index % GRID.columns, index / GRID.columns);
            let expected = plane(0.5 * x as f64 + 0.25, 0.5 * y as f64 + 0.25);
            // Single precision of a value of about 3.
            assert!((f64::from(nearness) - expected).abs() < 1e-6, "{x}, {y}");
        }
    }

    #[test]
    fn only_counter_clockwise_triangles_face_the_front() {
        let [a, b, c] = [
            corner(2.0, 20.0, 1.0),
            corner(20.0, 20.0, 1.0),
            corner(11.0, 2.0, 1.0),
        ];
        let both = covered([a, b, c], Facing::Both);
        assert!(!both.is_empty());
        assert_eq!(covered([a, b, c], Facing::Front), both);
        assert_eq!(covered([a, c, b], Facing::Both), both);
        assert!(covered([a, c, b], Facing::Front).is_empty());
    }

    #[test]
    fn triangles_outside_without_area_or_not_finite_cover_nothing() {
        let away = [[-50.0, 3.0], [-2.0, 3.0], [-20.0, 30.0]].map(|[x, y]| corner(x, y, 1.0));
        let flat = [[1.0, 1.0], [5.0, 5.0], [20.0, 20.0]].map(|[x, y]| corner(x, y, 1.0));
        let nan = [[1.0, 1.0], [f64::NAN, 5.0], [20.0, 0.0]].map(|[x, y]| corner(x, y, 1.0));
        let huge = [[1.0, 1.0], [1e300, 5.0], [20.0, 0.0]].map(|[x, y]| corner(x, y, 1.0));
        for corners in [away, flat, nan, huge] {
            assert!(covered(corners, Facing::Both).is_empty(), "{corners:?}");
        }
    }
}
