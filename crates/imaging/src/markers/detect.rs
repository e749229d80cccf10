//! Places that may hold a marker: bumps of the silhouette with about a marker's mass.

use std::sync::atomic::AtomicBool;

use nalgebra::Point3;
use needlebench_volume::{Volume, VolumeError, in_slices};

use super::bits::{Bits, Groups, Run, disc};
use super::{DENSE_SHARE, DensePart, MarkerModel, Rejected};

/// Air is below: halfway between it and water.
const SURFACE_HU: i16 = -500;

/// Finest pixel that silhouettes need: coarser than most scans' own, several to a marker.
const PIXEL_M: f64 = 1.4e-3;

/// Radius of the disc that a silhouette without bumps is made of, more than the marker's own.
const SMOOTHER_M: f64 = 4e-3;

/// Depth under the surface in which flat dense markers are looked for.
const SHELL_M: f64 = 6e-3;

/// Least and most mass, over what is expected; with the least, a marker halved by thick slices is still found.
const MASS_SHARES: [f64; 2] = [0.1, 6.0];

/// How much larger than the marker what holds it may look: blur, noise, folds of skin.
const SPARE_M: f64 = 15e-3;

/// Fewer samples than this are noise.
const FEWEST_SAMPLES: usize = 2;

/// Candidates in the order of how well their mass fits, and what nearly was one.
pub struct Candidates {
    /// Where, in `ct`.
    pub seeds: Vec<Point3<f64>>,
    /// With at least half of the least mass.
    pub rejected: Vec<Rejected>,
}

/// What was seen of a run of samples, or of a whole component.
#[derive(Debug, Clone, Copy)]
struct Seen {
    samples: usize,
    /// HU above the surface's, summed.
    mass: f64,
    /// Index times that, summed.
    moment: [f64; 3],
    low: [usize; 3],
    high: [usize; 3],
}

impl Seen {
    fn add(&mut self, other: &Self) {
        self.samples += other.samples;
        self.mass += other.mass;
        for axis in 0..3 {
            self.moment[axis] += other.moment[axis];
            self.low[axis] = self.low[axis].min(other.low[axis]);
            self.high[axis] = self.high[axis].max(other.high[axis]);
        }
    }
}

struct SeenRun {
    row: usize,
    run: Run,
    seen: Seen,
}

/// How a volume is looked through.
struct Scan<'a> {
    volume: &'a Volume,
    /// Distance between samples in voxels, along a row and across rows.
    stride: [usize; 2],
    smoother: Vec<usize>,
    shell: Vec<usize>,
    /// Least HU of a flat dense marker; nothing for markers that stand out.
    dense_hu: Option<i16>,
}

/// Looks for bumps of the silhouette, or for dense places under the surface if the marker is flat.
pub fn candidates(
    volume: &Volume,
    model: &MarkerModel,
    threads: usize,
    cancel: &AtomicBool,
) -> Result<Candidates, VolumeError> {
    let slices = Scan::new(volume, model).slices(threads, cancel)?;
    Ok(judged(volume, model, &components(&slices)))
}

impl<'a> Scan<'a> {
    fn new(volume: &'a Volume, model: &MarkerModel) -> Self {
        let [dx, dy, _] = volume.grid.spacing_m();
        let stride = [dx, dy].map(|spacing| ((PIXEL_M / spacing).round() as usize).max(1));
        let pixel = [dx * stride[0] as f64, dy * stride[1] as f64];
        let of_radius = |radius_m: f64| disc(radius_m / pixel[1], radius_m / pixel[0]);
        let dense_hu = match model.dense {
            DensePart::Sphere { .. } => None,
            DensePart::Ring { .. } => Some((model.hu * DENSE_SHARE).clamp(150.0, 3000.0) as i16),
        };
        Self {
            volume,
            stride,
            smoother: of_radius(model.reach_m() + SMOOTHER_M),
            shell: of_radius(SHELL_M),
            dense_hu,
        }
    }

    fn slices(
        &self,
        threads: usize,
        cancel: &AtomicBool,
    ) -> Result<Vec<Vec<SeenRun>>, VolumeError> {
        let mut slices: Vec<Vec<SeenRun>> = Vec::new();
        slices.resize_with(self.volume.grid.size()[2], Vec::new);
        let look = |(): &mut (), k: usize, runs: &mut [Vec<SeenRun>]| runs[0] = self.slice(k);
        in_slices(&mut slices, 1, threads, cancel, || (), look)?;
        Ok(slices)
    }

    /// Runs of samples of a slice that may belong to markers.
    fn slice(&self, k: usize) -> Vec<SeenRun> {
        let [nx, ny, _] = self.volume.grid.size();
        let (width, height) = (nx.div_ceil(self.stride[0]), ny.div_ceil(self.stride[1]));
        let above = |level: i16| {
            let mut bits = Bits::new(width, height);
            for y in 0..height {
                for (x, hu) in self.row(k, y).enumerate() {
                    if hu > level {
                        bits.set(x, y);
                    }
                }
            }
            bits
        };
        let silhouette = above(SURFACE_HU).filled();
        let found = match self.dense_hu {
            None => silhouette.without(&silhouette.eroded(&self.smoother).dilated(&self.smoother)),
            Some(level) => above(level).without(&silhouette.eroded(&self.shell)),
        };
        let mut runs = Vec::new();
        for row in 0..height {
            for run in found.runs(row) {
                runs.push(SeenRun {
                    row,
                    run,
                    seen: self.seen(k, row, run),
                });
            }
        }
        runs
    }

    fn row(&self, k: usize, row: usize) -> impl Iterator<Item = i16> {
        let nx = self.volume.grid.size()[0];
        let start = self.volume.grid.offset([0, row * self.stride[1], k]);
        self.volume.hu[start..start + nx]
            .iter()
            .copied()
            .step_by(self.stride[0])
    }

    fn seen(&self, k: usize, row: usize, run: Run) -> Seen {
        let j = row * self.stride[1];
        let mut seen = Seen {
            samples: run.to - run.from,
            mass: 0.0,
            moment: [0.0; 3],
            low: [run.from * self.stride[0], j, k],
            high: [(run.to - 1) * self.stride[0], j, k],
        };
        for (x, hu) in self.row(k, row).enumerate().take(run.to).skip(run.from) {
            let mass = f64::from((i32::from(hu) - i32::from(SURFACE_HU)).max(0));
            seen.mass += mass;
            for (axis, index) in [x * self.stride[0], j, k].into_iter().enumerate() {
                seen.moment[axis] += mass * index as f64;
            }
        }
        // What one sample stands for.
        let share = (self.stride[0] * self.stride[1]) as f64;
        seen.mass *= share;
        seen.moment = seen.moment.map(|moment| moment * share);
        seen
    }
}

/// Runs that touch, in a slice or from one to the next.
fn components(slices: &[Vec<SeenRun>]) -> Vec<Seen> {
    let mut groups = Groups::default();
    let mut numbers: Vec<Vec<usize>> = Vec::with_capacity(slices.len());
    for (k, runs) in slices.iter().enumerate() {
        let mut own: Vec<usize> = Vec::with_capacity(runs.len());
        for run in runs {
            let number = groups.push();
            join_row(runs, &own, run, run.row.checked_sub(1), number, &mut groups);
            if k > 0 {
                join_row(
                    &slices[k - 1],
                    &numbers[k - 1],
                    run,
                    Some(run.row),
                    number,
                    &mut groups,
                );
            }
            own.push(number);
        }
        numbers.push(own);
    }
    let mut found = std::collections::BTreeMap::<usize, Seen>::new();
    for (runs, numbers) in slices.iter().zip(&numbers) {
        for (run, &number) in runs.iter().zip(numbers) {
            found
                .entry(groups.root(number))
                .and_modify(|seen| seen.add(&run.seen))
                .or_insert(run.seen);
        }
    }
    found.into_values().collect()
}

/// Joins a run with those of a row that it touches; rows are in order, and only the first of them have numbers.
fn join_row(
    runs: &[SeenRun],
    numbers: &[usize],
    run: &SeenRun,
    row: Option<usize>,
    number: usize,
    groups: &mut Groups,
) {
    let Some(row) = row else { return };
    let first = runs[..numbers.len()].partition_point(|other| other.row < row);
    for (other, &of) in runs[first..].iter().zip(&numbers[first..]) {
        if other.row != row {
            break;
        }
        if other.run.touches(&run.run) {
            groups.join(number, of);
        }
    }
}

fn judged(volume: &Volume, model: &MarkerModel, components: &[Seen]) -> Candidates {
    let steps = volume.grid.steps_m();
    let voxel_m3 = steps.determinant().abs();
    let surface = f64::from(SURFACE_HU);
    let layers: f64 = model
        .layers
        .iter()
        .map(|layer| {
            let area_m2 = std::f64::consts::PI * layer.radius_m * layer.radius_m;
            (layer.hu - surface).max(0.0) * area_m2 * (layer.top_m - layer.bottom_m)
        })
        .sum();
    let dense = model.volume_m3() * (model.hu - surface).max(100.0);
    let radius_m = model
        .layers
        .iter()
        .map(|layer| layer.radius_m)
        .fold(model.reach_m(), f64::max);
    let thickness_m = volume.slice_thickness_m.unwrap_or(0.0);
    let widest_m = 2.0 * radius_m + SPARE_M + 2.0 * thickness_m;
    let mut found: Vec<(f64, Point3<f64>)> = Vec::new();
    let mut rejected = Vec::new();
    for seen in components {
        if seen.samples < FEWEST_SAMPLES || seen.mass <= 0.0 {
            continue;
        }
        let mass = seen.mass * voxel_m3;
        let index = seen.moment.map(|moment| moment / seen.mass);
        let at_m = volume.grid.ct_from_index(&Point3::from(index));
        let share = mass / dense;
        let size_m = (0..3)
            .map(|axis| steps.column(axis).norm() * (seen.high[axis] - seen.low[axis] + 1) as f64)
            .fold(0.0, f64::max);
        if share < MASS_SHARES[0] || mass > MASS_SHARES[1] * (dense + layers) {
            if share > 0.5 * MASS_SHARES[0] {
                rejected.push(Rejected {
                    at_m,
                    reason: format!("its mass is {share:.2} times the marker's"),
                });
            }
        } else if size_m > widest_m {
            rejected.push(Rejected {
                at_m,
                reason: format!("it is {:.0} mm long", size_m * 1e3),
            });
        } else {
            found.push((libm::log(mass / (dense + layers)).abs(), at_m));
        }
    }
    let key = |p: &Point3<f64>| [p.z, p.y, p.x];
    found.sort_by(|a, b| {
        a.0.total_cmp(&b.0).then(
            key(&a.1)
                .partial_cmp(&key(&b.1))
                .unwrap_or(std::cmp::Ordering::Equal),
        )
    });
    Candidates {
        seeds: found.into_iter().map(|(_, at_m)| at_m).collect(),
        rejected,
    }
}
