//! Noise of a scan, and how it is correlated between voxels.

use std::collections::BTreeSet;

use nalgebra::{DMatrix, DVector, Matrix3, Vector2, Vector3};
use needlebench_volume::Volume;
use serde::{Deserialize, Serialize};

/// Side of a patch in voxels.
const PATCH: usize = 16;

/// Farthest lag across the slice, in voxels: what kernels blur.
pub const REACH: usize = 3;

/// Farthest lag between slices: overlapping ones share their noise.
pub const SLICES: usize = 2;

/// What may be soft tissue, HU; metal, bone, fat against lung are not homogeneous.
const SOFT_HU: std::ops::RangeInclusive<i16> = -250..=350;

/// Patches are taken on a lattice of at most so many along each direction.
const LATTICE: [usize; 3] = [24, 24, 16];

/// Most patches whose correlation is taken: hundreds of thousands of voxels.
const MOST: usize = 160;

/// Correlations between slices below so many of their standard deviations are chance: most slices share no noise.
const SIGNIFICANT: f64 = 3.0;

/// Fewest patches that say something.
const FEWEST: usize = 6;

const WIDTH: usize = 2 * REACH + 1;

/// Standard deviation and correlation of a scan's noise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Noise {
    /// Median over patches of soft tissue.
    pub sd_hu: f64,
    /// Correlation between voxels: `[dk][dj + 3][di + 3]` for `dk` from 0; the other half is the same, mirrored.
    pub correlation: Vec<[[f64; WIDTH]; WIDTH]>,
}

impl Noise {
    /// Correlation between voxels that are so far apart.
    pub fn between(&self, [di, dj, dk]: [isize; 3]) -> f64 {
        let (di, dj, dk) = if dk < 0 {
            (-di, -dj, -dk)
        } else {
            (di, dj, dk)
        };
        let lag = |d: isize| usize::try_from(d + REACH as isize).ok();
        let (Some(i), Some(j), Ok(k)) = (lag(di), lag(dj), usize::try_from(dk)) else {
            return 0.0;
        };
        let row = self.correlation.get(k).and_then(|plane| plane.get(j));
        row.and_then(|row| row.get(i)).copied().unwrap_or(0.0)
    }

    /// Voxels that tell as much as one without correlation.
    pub(crate) fn voxels_per_value(&self) -> f64 {
        let all = |plane: &[[f64; WIDTH]; WIDTH]| plane.iter().flatten().sum::<f64>();
        let others: f64 = self.correlation.iter().skip(1).map(all).sum();
        (self.correlation.first().map_or(1.0, all) + 2.0 * others).max(1.0)
    }
}

/// Noise as homogeneous patches of soft tissue show it; nothing where there are none, or no noise.
///
/// Planes are taken out of the patches, so that slow changes of tissue do not count, and their products are put right for
/// it. Patches with structure have a larger variance: the correlation is that of the half with the smaller one. It is
/// the slice below that chooses: chosen by its own variance, noise would seem weaker and less correlated than it is.
pub(crate) fn measure_noise(volume: &Volume) -> Option<Noise> {
    let size = volume.grid.size();
    if size[0] < PATCH || size[1] < PATCH {
        return None;
    }
    let places = |axis: usize, reach: usize| -> Vec<usize> {
        let room = size[axis] - reach;
        let count = LATTICE[axis].min(room / 4 + 1);
        (0..count)
            .map(|n| room * (2 * n + 1) / (2 * count))
            .collect()
    };
    let mut variances = Vec::new();
    let mut patches = Vec::new();
    for &k in &places(2, 1) {
        for &j in &places(1, PATCH) {
            for &i in &places(0, PATCH) {
                let Some(values) = flat(volume, [i, j, k]) else {
                    continue;
                };
                let own = variance(&values);
                variances.push(own);
                let below = k.checked_sub(1).map(|below| flat(volume, [i, j, below]));
                match below {
                    Some(Some(values)) => patches.push((variance(&values), [i, j, k])),
                    Some(None) => {}
                    None => patches.push((own, [i, j, k])),
                }
            }
        }
    }
    if patches.len() < FEWEST {
        return None;
    }
    variances.sort_by(f64::total_cmp);
    let median = variances[variances.len() / 2];
    patches.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = patches.len().div_ceil(2);
    let mut sums = [([[0.0; WIDTH]; WIDTH], 0); SLICES + 1];
    // Of a small volume patches overlap: cells of the lattice without overlap that they are in are what they are worth.
    let mut cells = BTreeSet::new();
    for (_, place) in patches[..half].iter().step_by(half.div_ceil(MOST)) {
        add_products(volume, *place, &mut sums);
        cells.insert([place[0] / PATCH, place[1] / PATCH, place[2]]);
    }
    let mut correlation: Vec<_> = sums
        .iter()
        .map(|(sums, added)| sums.map(|row| row.map(|sum| sum / (*added).max(1) as f64)))
        .collect();
    without_planes(&mut correlation)?;
    let whole = correlation[0][REACH][REACH];
    if whole <= 0.0 || median <= 0.0 {
        return None;
    }
    for value in correlation.iter_mut().flatten().flatten() {
        *value /= whole;
    }
    let squares: f64 = correlation[0].iter().flatten().map(|rho| rho * rho).sum();
    // Variance of a correlation that is none (Bartlett 1946).
    let variance = squares / (cells.len() * PATCH * PATCH) as f64;
    for rho in correlation[1..].iter_mut().flatten().flatten() {
        if *rho * *rho < SIGNIFICANT * SIGNIFICANT * variance {
            *rho = 0.0;
        }
    }
    let mut noise = Noise {
        sd_hu: median.sqrt(),
        correlation,
    };
    // A plane takes three values of those that a patch is worth.
    let plane = &noise.correlation[0];
    let per_value = plane.iter().flatten().sum::<f64>().max(1.0);
    let worth = (PATCH * PATCH) as f64 / per_value;
    noise.sd_hu *= (worth / (worth - 3.0).max(1.0)).sqrt();
    Some(noise)
}

/// Products by lag as they were before planes were taken out of the patches.
///
/// Of noise with covariance `C` the residuals from planes have `(1 - P) C (1 - P)`, with `P` onto the planes: means over
/// the pairs of a lag are linear in the covariances by lag, and solved for these.
fn without_planes(products: &mut [[[f64; WIDTH]; WIDTH]]) -> Option<()> {
    let lags = lags();
    let mut taken = DMatrix::zeros(lags.len(), lags.len());
    for (column, by) in lags.iter().enumerate() {
        let mut both = Matrix3::zeros();
        for (at, _) in pairs(*by) {
            both += on_planes(at) * on_planes(at + by).transpose();
        }
        let moved = |at: Vector2<isize>| {
            let is_inside = at.iter().all(|value| (0..PATCH as isize).contains(value));
            if is_inside {
                on_planes(at)
            } else {
                Vector3::zeros()
            }
        };
        for (row, lag) in lags.iter().enumerate() {
            let mut sum = 0.0;
            let mut count = 0.0;
            for (at, other) in pairs(*lag) {
                let (first, second) = (on_planes(at), on_planes(other));
                sum += first.dot(&(both * second))
                    - first.dot(&moved(other - by))
                    - moved(at + by).dot(&second);
                count += 1.0;
            }
            taken[(row, column)] = sum / count + f64::from(u8::from(row == column));
        }
    }
    let taken = taken.lu();
    for plane in products {
        let means = DVector::from_iterator(lags.len(), plane.iter().flatten().copied());
        let before = taken.solve(&means)?;
        for (value, before) in plane.iter_mut().flatten().zip(&before) {
            *value = *before;
        }
    }
    Some(())
}

/// All lags in a slice, in the order of a plane of sums.
fn lags() -> Vec<Vector2<isize>> {
    let reach = REACH as isize;
    (-reach..=reach)
        .flat_map(|dj| (-reach..=reach).map(move |di| Vector2::new(di, dj)))
        .collect()
}

/// Places in a patch, and those that are so far from them.
fn pairs(lag: Vector2<isize>) -> impl Iterator<Item = (Vector2<isize>, Vector2<isize>)> {
    let side = PATCH as isize;
    let range = move |by: isize| 0.max(-by)..side.min(side - by);
    range(lag.y).flat_map(move |y| {
        range(lag.x).map(move |x| (Vector2::new(x, y), Vector2::new(x, y) + lag))
    })
}

/// What a place has of each of three planes over a patch, at right angles to each other and of unit length.
fn on_planes(at: Vector2<isize>) -> Vector3<f64> {
    let side = PATCH as f64;
    let middle = (side - 1.0) / 2.0;
    // Squares of whole steps from the middle, summed over a patch.
    let slope = (side * side * (side * side - 1.0) / 12.0).sqrt();
    Vector3::new(
        1.0 / side,
        (at.x as f64 - middle) / slope,
        (at.y as f64 - middle) / slope,
    )
}

fn variance(values: &[f64]) -> f64 {
    values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64
}

/// Mean products by lag in the slice, of slices that are so far apart; none where nothing was multiplied.
type Products = [([[f64; WIDTH]; WIDTH], usize)];

/// Adds a patch's mean products by lag.
fn add_products(volume: &Volume, [i, j, k]: [usize; 3], sums: &mut Products) {
    let planes: Vec<Vec<f64>> = (k..(k + SLICES + 1).min(volume.grid.size()[2]))
        .map_while(|k| flat(volume, [i, j, k]))
        .collect();
    let Some(first) = planes.first() else { return };
    let at = |place: Vector2<isize>| (place.y * PATCH as isize + place.x) as usize;
    for (plane, (sums, added)) in planes.iter().zip(sums) {
        for (value, lag) in sums.iter_mut().flatten().zip(lags()) {
            let mut sum = 0.0;
            let mut count = 0.0;
            for (place, other) in pairs(lag) {
                sum += first[at(place)] * plane[at(other)];
                count += 1.0;
            }
            *value += sum / count;
        }
        *added += 1;
    }
}

/// Soft tissue less its plane; nothing if something else is there.
fn flat(volume: &Volume, [i, j, k]: [usize; 3]) -> Option<Vec<f64>> {
    let mut values = Vec::with_capacity(PATCH * PATCH);
    for y in 0..PATCH {
        let start = volume.grid.offset([i, j + y, k]);
        let row = &volume.hu[start..start + PATCH];
        if !row.iter().all(|hu| SOFT_HU.contains(hu)) {
            return None;
        }
        values.extend(row.iter().map(|&hu| f64::from(hu)));
    }
    let middle = (PATCH as f64 - 1.0) / 2.0;
    let count = (PATCH * PATCH) as f64;
    let (mut mean, mut by_x, mut by_y, mut square) = (0.0, 0.0, 0.0, 0.0);
    for (index, value) in values.iter().enumerate() {
        let (x, y) = (
            (index % PATCH) as f64 - middle,
            (index / PATCH) as f64 - middle,
        );
        mean += value / count;
        by_x += value * x;
        by_y += value * y;
        square += x * x;
    }
    for (index, value) in values.iter_mut().enumerate() {
        let (x, y) = (
            (index % PATCH) as f64 - middle,
            (index / PATCH) as f64 - middle,
        );
        *value -= mean + (by_x * x + by_y * y) / square;
    }
    Some(values)
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;
    use needlebench_numerics::random::NormalPairs;

    use super::*;
    use needlebench_volume::VoxelGrid;

    #[test]
    fn filtered_noise_is_measured_with_its_correlation() {
        let size = [96, 96, 12];
        let grid = VoxelGrid::aligned(size, [7e-4, 7e-4, 1e-3], Point3::origin()).unwrap();
        let mut random = NormalPairs::new(5);
        // Mean of two neighbours along x: correlation a half at lag 1, none at 2; a slope that is no noise.
        let mut hu = Vec::new();
        for _ in 0..size[1] * size[2] {
            let row: Vec<f64> = (0..=size[0]).map(|_| 30.0 * random.next_normal()).collect();
            #[expect(clippy::cast_possible_truncation, reason = "some hundred HU")]
            hu.extend(
                (0..size[0]).map(|x| (0.5 * (row[x] + row[x + 1]) + 0.5 * x as f64).round() as i16),
            );
        }
        let noise = measure_noise(&Volume {
            grid,
            hu,
            slice_thickness_m: None,
        })
        .unwrap();
        let sd = 30.0 / 2.0_f64.sqrt();
        assert!((noise.sd_hu / sd - 1.0).abs() < 0.05, "{}", noise.sd_hu);
        assert!((noise.between([1, 0, 0]) - 0.5).abs() < 0.03);
        assert!(noise.between([2, 0, 0]).abs() < 0.06 && noise.between([0, 1, 0]).abs() < 0.06);
        assert!(noise.between([0, 0, 1]).abs() < 0.06);
        // Hardly any of the lags that have none seems to have some.
        let none = noise.correlation[1..].iter().flatten().flatten();
        let chance = none.filter(|rho| **rho != 0.0).count();
        assert!(chance <= 2, "{chance}");
        assert_eq!(noise.between([-1, 2, -1]), noise.between([1, -2, 1]));
        assert_eq!(noise.between([9, 0, 0]), 0.0);
    }
}
