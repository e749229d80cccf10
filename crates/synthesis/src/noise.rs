//! Noise with the spectrum of a kernel, that neighbouring slices share as far as they overlap.

use needlebench_numerics::random::SplitMix64;

use super::blur::{blur_pixels, centred_gaussian};
use super::scanner::Noise;

/// Share of the twice as wide Gaussian that is taken off: little is left of the lowest frequencies, as by the ramp of
/// filtered back projection. The peak is at 0.14 over the grain's sigma, 6.5 times the density at frequency 0.
const WIDE_SHARE: f32 = 0.8;

/// Draws the noise of slices, in HU, before its dependence on the place.
#[derive(Debug)]
pub(super) struct NoiseSource {
    seed: u64,
    columns: usize,
    rows: usize,
    /// Weights of the independent layers that a slice is the mean of, scaled to the wanted standard deviation.
    layers: Vec<f32>,
    narrow: Vec<f32>,
    /// From the narrow to the wide Gaussian.
    widening: Vec<f32>,
    /// Pixels that are drawn beyond each border, so that the noise is as strong there.
    margin: usize,
}

/// Images that a thread works in.
#[derive(Debug, Default)]
pub(super) struct NoiseBuffers {
    white: Vec<f32>,
    narrow: Vec<f32>,
    wide: Vec<f32>,
}

impl NoiseSource {
    /// `slices_m`: thickness of a slice, and distance to the next one.
    pub fn new(
        noise: &Noise,
        size: [usize; 2],
        pixel_m: f64,
        slices_m: [f64; 2],
        seed: u64,
    ) -> Self {
        let sigma = noise.grain_sigma_m / pixel_m;
        let narrow = centred_gaussian(sigma);
        let widening = centred_gaussian(3.0_f64.sqrt() * sigma);
        let margin = narrow.len() / 2 + widening.len() / 2;
        let unit = noise.in_middle_hu(slices_m[0]) / deviation(&narrow, &widening);
        let layers = layers(slices_m[0] / slices_m[1]);
        let norm = layers
            .iter()
            .map(|weight| weight * weight)
            .sum::<f64>()
            .sqrt();
        Self {
            seed,
            columns: size[0] + 2 * margin,
            rows: size[1] + 2 * margin,
            layers: layers
                .iter()
                .map(|weight| (weight / norm * unit) as f32)
                .collect(),
            narrow,
            widening,
            margin,
        }
    }

    /// The noise of a slice, row by row.
    pub fn rows<'b>(
        &self,
        slice: usize,
        buffers: &'b mut NoiseBuffers,
    ) -> impl Iterator<Item = &'b [f32]> {
        let count = self.columns * self.rows;
        for image in [&mut buffers.white, &mut buffers.narrow, &mut buffers.wide] {
            image.resize(count, 0.0);
        }
        buffers.white.fill(0.0);
        for (layer, weight) in self.layers.iter().enumerate() {
            self.add_white((slice + layer) as u64, *weight, &mut buffers.white);
        }
        blur_pixels(
            &buffers.white,
            self.columns,
            &self.narrow,
            &mut buffers.narrow,
        );
        blur_pixels(
            &buffers.narrow,
            self.columns,
            &self.widening,
            &mut buffers.wide,
        );
        for (narrow, wide) in buffers.narrow.iter_mut().zip(&buffers.wide) {
            *narrow -= WIDE_SHARE * wide;
        }
        let (margin, columns) = (self.margin, self.columns);
        buffers
            .narrow
            .chunks_exact(columns)
            .skip(margin)
            .map(move |row| &row[margin..columns - margin])
    }

    /// Adds independent numbers of unit variance, times a weight.
    ///
    /// Each is the sum of four uniform ones: of a mean of as many as a kernel has taps, no test tells it from normal ones.
    fn add_white(&self, layer: u64, weight: f32, image: &mut [f32]) {
        /// Of the sum of four uniform numbers in 0..65536: their mean and standard deviation.
        const MEAN: f32 = 2.0 * 65535.0;
        const SD: f32 = 37837.227;
        let start = SplitMix64::new(self.seed).next_u64() ^ SplitMix64::new(!layer).next_u64();
        let mut random = SplitMix64::new(start);
        let scale = weight / SD;
        for value in image {
            let bits = random.next_u64();
            let sum =
                (bits & 0xFFFF) + (bits >> 16 & 0xFFFF) + (bits >> 32 & 0xFFFF) + (bits >> 48);
            *value += scale * (sum as u32 as f32 - MEAN);
        }
    }
}

/// Weights of the layers, each as thick as slices are apart, that a slice of this thickness reaches over.
fn layers(thickness: f64) -> Vec<f64> {
    /// Less than this of a layer is rounding.
    const NOTHING: f64 = 1e-6;
    let whole = (thickness + NOTHING).floor();
    let part = thickness - whole;
    let mut weights = vec![1.0; whole as usize];
    if part > NOTHING || weights.is_empty() {
        weights.push(part.max(NOTHING));
    }
    weights
}

/// Standard deviation of white noise of unit variance after both Gaussians.
fn deviation(narrow: &[f32], widening: &[f32]) -> f64 {
    let mut wide = vec![0.0; narrow.len() + widening.len() - 1];
    for (i, a) in narrow.iter().enumerate() {
        for (j, b) in widening.iter().enumerate() {
            wide[i + j] += f64::from(*a) * f64::from(*b);
        }
    }
    let mut padded = vec![0.0; wide.len()];
    let offset = widening.len() / 2;
    for (i, a) in narrow.iter().enumerate() {
        padded[offset + i] = f64::from(*a);
    }
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>().powi(2);
    let share = f64::from(WIDE_SHARE);
    (product(&padded, &padded) - 2.0 * share * product(&padded, &wide)
        + share * share * product(&wide, &wide))
    .sqrt()
}
