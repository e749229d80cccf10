//! Gaussian blur in the slice, from cells to pixels.

/// Cells across a standard deviation of the blur, at least. An edge's profile runs in straight pieces from cell to cell: it is
/// within 0.02 (cell / sigma)^2 of the Gaussian's, 0.5 % of the edge's height, and right in the mean.
const CELLS_PER_SIGMA: f64 = 2.0;
/// Cells along a pixel's edge at most.
const MOST_CELLS: usize = 8;
/// Where the Gaussian is cut off, in standard deviations: 6e-5 of it is beyond.
const REACH_SIGMA: f64 = 4.0;

/// Along one axis: how a pixel is divided, and how the cells about its centre count.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Blur {
    /// Cells along a pixel's edge.
    pub cells: usize,
    /// Edge of a cell, m.
    pub cell_m: f64,
    /// Weights of the cells about the pixel's centre; their sum is 1.
    taps: Vec<f32>,
}

impl Blur {
    /// Of this standard deviation in all: the mean over a cell, which is part of it, and a sum over cells.
    pub fn new(sigma_m: f64, pixel_m: f64) -> Self {
        if sigma_m <= 0.0 {
            return Self {
                cells: 1,
                cell_m: pixel_m,
                taps: vec![1.0],
            };
        }
        let cells = (CELLS_PER_SIGMA * pixel_m / sigma_m).ceil() as usize;
        let cells = cells.clamp(1, MOST_CELLS);
        let cell_m = pixel_m / cells as f64;
        let sigma = (sigma_m * sigma_m - cell_m * cell_m / 12.0).max(0.0).sqrt() / cell_m;
        let half = (REACH_SIGMA * sigma).ceil().max(1.0) as usize;
        Self {
            cells,
            cell_m,
            taps: gaussian(sigma, 2 * half + cells % 2),
        }
    }

    /// Cells that a row of pixels needs.
    pub(crate) fn cells_for(&self, pixels: usize) -> usize {
        (pixels - 1) * self.cells + self.taps.len()
    }

    /// Centre of the first of these cells, from the centre of the first pixel, m.
    pub fn first_m(&self) -> f64 {
        -0.5 * (self.taps.len() - 1) as f64 * self.cell_m
    }
}

/// Gaussian weights about the middle of so many cells, of sum 1; `sigma` in cells.
pub(super) fn gaussian(sigma: f64, count: usize) -> Vec<f32> {
    /// Below it, all of the weight is at the nearest cells.
    const LEAST: f64 = 0.05;
    let sigma = sigma.max(LEAST);
    let middle = 0.5 * (count - 1) as f64;
    let weights: Vec<f64> = (0..count)
        .map(|index| libm::exp(-0.5 * ((index as f64 - middle) / sigma).powi(2)))
        .collect();
    let sum: f64 = weights.iter().sum();
    weights.iter().map(|weight| (weight / sum) as f32).collect()
}

/// Gaussian weights that reach as far as they matter, an odd number of them; `sigma` in cells.
pub(super) fn centred_gaussian(sigma: f64) -> Vec<f32> {
    gaussian(
        sigma,
        2 * (REACH_SIGMA * sigma).ceil().max(1.0) as usize + 1,
    )
}

/// From cells to pixels along both axes.
#[derive(Debug)]
pub(super) struct InPlane {
    along: [Blur; 2],
    pixels: [usize; 2],
    /// Pixels along rows, cells along columns.
    half_done: Vec<f32>,
    /// Every n-th cell of a row, from the first, the second ... on.
    phases: Vec<Vec<f32>>,
}

impl InPlane {
    pub fn new(along: &[Blur; 2], pixels: [usize; 2]) -> Self {
        let columns = along[0].cells_for(pixels[0]);
        let phase = vec![0.0; columns.div_ceil(along[0].cells)];
        Self {
            pixels,
            half_done: vec![0.0; columns],
            phases: vec![phase; along[0].cells],
            along: along.clone(),
        }
    }

    /// Blurs an image of cells into one of pixels.
    pub fn apply(&mut self, cells: &[f32], pixels: &mut [f32]) {
        let columns = self.half_done.len();
        for (row, pixels) in pixels.chunks_exact_mut(self.pixels[0]).enumerate() {
            let first = row * self.along[1].cells * columns;
            weighted_sum(&mut self.half_done, &self.along[1].taps, |tap| {
                &cells[first + tap * columns..]
            });
            self.blur_row(pixels);
        }
    }

    fn blur_row(&mut self, pixels: &mut [f32]) {
        let Blur { cells, taps, .. } = &self.along[0];
        for (first, phase) in self.phases.iter_mut().enumerate() {
            let every = self.half_done[first..].iter().step_by(*cells);
            for (value, cell) in phase.iter_mut().zip(every) {
                *value = *cell;
            }
        }
        weighted_sum(pixels, taps, |tap| &self.phases[tap % cells][tap / cells..]);
    }
}

/// The sum of rows by the weights of taps, in their order; of so many columns at a time as registers hold.
#[inline]
fn weighted_sum<'r>(sums: &mut [f32], taps: &[f32], row: impl Fn(usize) -> &'r [f32]) {
    /// Four at a time, in half of the sixteen registers that every x86-64 has.
    const COLUMNS: usize = 32;
    let (whole, rest) = sums.as_chunks_mut::<COLUMNS>();
    for (chunk, sums) in whole.iter_mut().enumerate() {
        let mut held = [0.0; COLUMNS];
        for (tap, weight) in taps.iter().enumerate() {
            let values = &row(tap)[chunk * COLUMNS..][..COLUMNS];
            add(&mut held, *weight, values);
        }
        *sums = held;
    }
    let first = whole.len() * COLUMNS;
    rest.fill(0.0);
    for (tap, weight) in taps.iter().enumerate() {
        add(rest, *weight, &row(tap)[first..]);
    }
}

#[inline]
fn add(sums: &mut [f32], weight: f32, values: &[f32]) {
    for (sum, value) in sums.iter_mut().zip(values) {
        *sum += weight * value;
    }
}

/// Blurs an image of pixels by odd numbers of taps; what is outside is as at the border.
pub(super) fn blur_pixels(image: &[f32], columns: usize, taps: &[f32], blurred: &mut [f32]) {
    let rows = image.len() / columns;
    let half = taps.len() / 2;
    let mut padded = vec![0.0; columns + 2 * half];
    let mut row_sum = vec![0.0; columns];
    for row in 0..rows {
        weighted_sum(&mut row_sum, taps, |tap| {
            let from = (row + tap).saturating_sub(half).min(rows - 1);
            &image[from * columns..]
        });
        padded[..half].fill(row_sum[0]);
        padded[half..half + columns].copy_from_slice(&row_sum);
        padded[half + columns..].fill(row_sum[columns - 1]);
        let blurred = &mut blurred[row * columns..(row + 1) * columns];
        weighted_sum(blurred, taps, |tap| &padded[tap..]);
    }
}
