//! The circle that a scanner reconstructs within a square image.

/// The circle that touches the image's nearer borders.
#[derive(Debug, Clone, Copy)]
pub struct ImageCircle {
    middle: [f64; 2],
    radius: f64,
}

impl ImageCircle {
    /// That of an image of so many columns and rows.
    pub fn new([columns, rows]: [usize; 2]) -> Self {
        Self {
            middle: [0.5 * (columns - 1) as f64, 0.5 * (rows - 1) as f64],
            radius: 0.5 * columns.min(rows) as f64,
        }
    }

    /// Square of the distance of a pixel, by column and row, from the middle, divided by that of the rim: above 1
    /// outside.
    #[inline]
    pub fn share(&self, i: usize, j: usize) -> f64 {
        let [x, y] = [i as f64 - self.middle[0], j as f64 - self.middle[1]];
        (x * x + y * y) / (self.radius * self.radius)
    }
}
