//! Streaks about dense parts, as filtered back projection of what a polychromatic beam misses of them.
//!
//! A ray through dense parts loses its soft photons first, so what it measures of their attenuation `p` is less than `p`, by
//! a share of `p` times `p`. That difference, which is large where a ray passes through several dense parts, is projected back: dark bands
//! between dense parts and along their long axes, bright ones beside them.

use std::f64::consts::PI;

use super::scanner::Streaks;

/// Directions over half a turn.
const DIRECTIONS: usize = 360;
/// Attenuation of water at the energies of chest scans, 1/m.
const WATER_PER_M: f64 = 20.0;
/// Hounsfield units per attenuation of water.
const HU_PER_WATER: f64 = 1000.0;

/// Adds the streaks to an image of square pixels, row by row.
pub(super) fn add_streaks(image: &mut [f32], columns: usize, pixel_m: f64, streaks: &Streaks) {
    let rows = image.len() / columns;
    let middle = [0.5 * (columns - 1) as f64, 0.5 * (rows - 1) as f64];
    let dense: Vec<([f64; 2], f64)> = image
        .iter()
        .enumerate()
        .filter(|(_, hu)| f64::from(**hu) > streaks.above_hu)
        .map(|(offset, hu)| {
            let place = [
                (offset % columns) as f64 - middle[0],
                (offset / columns) as f64 - middle[1],
            ];
            (place, f64::from(*hu) / HU_PER_WATER * WATER_PER_M * pixel_m)
        })
        .collect();
    if dense.is_empty() {
        return;
    }
    // So many rays that every pixel is between two of them.
    let half = (libm::hypot(middle[0], middle[1]).ceil() as usize) + 2;
    let count = 2 * half + 1;
    let to_hu = HU_PER_WATER / (WATER_PER_M * pixel_m) * PI / DIRECTIONS as f64;
    let mut rays = vec![0.0; count];
    for direction in 0..DIRECTIONS {
        let (sine, cosine) = libm::sincos(PI * direction as f64 / DIRECTIONS as f64);
        rays.fill(0.0);
        for ([x, y], attenuation) in &dense {
            let at = x * cosine + y * sine + half as f64;
            let below = at.floor();
            let above = at - below;
            rays[below as usize] += attenuation * (1.0 - above);
            rays[below as usize + 1] += attenuation * above;
        }
        let missed: Vec<(usize, f64)> = rays
            .iter()
            .enumerate()
            .filter(|(_, ray)| **ray > 0.0)
            .map(|(at, ray)| (at, -streaks.share * ray * ray))
            .collect();
        let filtered: Vec<f32> = (0..count)
            .map(|at| {
                let sum: f64 = missed
                    .iter()
                    .map(|(from, value)| ramp(at.abs_diff(*from)) * value)
                    .sum();
                (to_hu * sum) as f32
            })
            .collect();
        for (row, pixels) in image.chunks_exact_mut(columns).enumerate() {
            let start = half as f64 - middle[0] * cosine + (row as f64 - middle[1]) * sine;
            for (column, pixel) in pixels.iter_mut().enumerate() {
                let at = (start + column as f64 * cosine) as f32;
                let below = at as usize;
                let above = at - below as f32;
                *pixel += filtered[below] * (1.0 - above) + filtered[below + 1] * above;
            }
        }
    }
}

/// The ramp filter of Ramachandran and Lakshminarayanan (PNAS 68:2236, 1971) between rays one pixel apart.
fn ramp(between: usize) -> f64 {
    match between {
        0 => 0.25,
        odd if odd % 2 == 1 => -1.0 / (PI * odd as f64).powi(2),
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: usize = 96;

    fn with_discs(places: &[[f64; 2]]) -> Vec<f32> {
        let mut image = vec![0.0; SIZE * SIZE];
        for (offset, pixel) in image.iter_mut().enumerate() {
            let [x, y] = [(offset % SIZE) as f64, (offset / SIZE) as f64];
            if places.iter().any(|[i, j]| libm::hypot(x - i, y - j) < 4.0) {
                *pixel = 8000.0;
            }
        }
        image
    }

    #[test]
    fn back_projection_gives_the_dense_part_back_where_the_beam_misses_a_share_of_it() {
        // Were the loss proportional to the ray, the dense part itself would be lost: the filter's scale.
        let mut image = with_discs(&[[48.0, 48.0]]);
        add_streaks(
            &mut image,
            SIZE,
            0.7e-3,
            &Streaks {
                above_hu: 2500.0,
                share: 0.1,
            },
        );
        let middle = image[48 * SIZE + 48];
        // The chord is 8 pixels of 0.7 mm at 8 times water: p = 0.9. The loss grows with the chord: it is hollow
        // by less than 0.1 p in the middle, and of the order of it.
        let lost = f64::from(8000.0 - middle) / 8000.0;
        assert!((0.08..0.2).contains(&lost), "{lost}");
    }

    #[test]
    fn it_is_darker_between_two_dense_parts_than_beside_them() {
        let mut image = with_discs(&[[30.0, 48.0], [66.0, 48.0]]);
        add_streaks(
            &mut image,
            SIZE,
            0.7e-3,
            &Streaks {
                above_hu: 2500.0,
                share: 0.1,
            },
        );
        let between = image[48 * SIZE + 48];
        let beside = image[70 * SIZE + 48];
        assert!(
            between < -50.0 && between < beside - 50.0,
            "{between} {beside}"
        );
        let plain = vec![0.0; SIZE * SIZE];
        let mut untouched = plain.clone();
        add_streaks(&mut untouched, SIZE, 0.7e-3, &Streaks::USUAL);
        assert_eq!(untouched, plain);
    }
}
