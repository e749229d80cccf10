//! The fit of a marker's appearance to the voxels around it.

use nalgebra::{Matrix3, Point3, Rotation3, SMatrix, Vector3};
use needlebench_volume::{Remark, Volume};

use super::model::{AIR, Appearance, Posed, UNKNOWNS, Unknowns, unknown};
use super::noise::{Noise, REACH, SLICES};
use super::sphere::BlurredSphere;
use super::{DENSE_SHARE, DensePart, DetectedMarker, MarkerModel, Options};

type Information = SMatrix<f64, UNKNOWNS, UNKNOWNS>;

/// How far around the marker voxels count, mm: what it and the skin's edge are blurred over, short of ribs.
const AROUND_MM: f64 = 3.0;

/// Rounds of Levenberg-Marquardt; ten are usual.
const MOST_ROUNDS: usize = 40;

/// Steps of the centre below which it has settled, mm: a hundredth of the best accuracy.
const SETTLED_MM: f64 = 1e-4;

/// Farthest that the fit may end from the candidate, mm, beyond the marker's own radius.
const FARTHEST_MM: f64 = 4.0;

/// Least noise that voxels are weighted with, HU: what the model's own shape is good for.
const LEAST_NOISE_HU: f64 = 5.0;

/// Largest value of 12-bit scanners: what is denser is shown as this.
const CLIP_HU: i16 = 3071;

/// Least value that scanners store.
const LEAST_HU: i16 = -1024;

/// Noise where it cannot be measured.
const NOISE_HU: f64 = 20.0;

/// Standard deviations of what is known of the unknowns beforehand: wide, but for what hardly shows.
const HEIGHT_MM: f64 = 1.5;
const TILT: f64 = 0.3;
const CURVATURE_PER_MM: f64 = 0.012;
const TISSUE: f64 = 0.3;
const LAYER: f64 = 0.3;
const RADIUS_MM: f64 = 0.05;
/// Of the blur's assumed standard deviation.
const BLUR_SHARE: f64 = 0.25;

/// Curvature of skin along any direction beforehand, 1/mm: between that of a barrel of 130 mm and none.
const BODY_PER_MM: f64 = 0.004;

/// Standard deviation of the dense part's HU beforehand, thousands, and least of the centre's, mm: none.
const DENSE: f64 = 20.0;
const CENTER_MM: f64 = 20.0;

/// Error along each axis that shapes, which are never quite the model's, leave in every fit, mm.
const SHAPE_MM: f64 = 0.002;

/// Residuals this much above the noise, in variance, and this share of the contrast are said to be.
const ODD_CHI_SQUARE: f64 = 4.0;
const ODD_MISFIT: f64 = 0.03;

/// Standard deviation along the slices above which a place is said not to be a point, mm.
const OPEN_MM: f64 = 0.25;

/// Thicknesses that slices can have, mm.
const POSSIBLE_MM: std::ops::RangeInclusive<f64> = 0.05..=20.0;

/// A sphere this much larger than a slice's thickness shows in more than one slice, wherever it is, mm.
const RECOVERED_MM: f64 = 0.5;

/// A volume, seen along its slices.
#[derive(Debug)]
pub struct Scan<'a> {
    volume: &'a Volume,
    /// Columns: along rows, across them in the slice, the slice's normal.
    ct_from_slice: Rotation3<f64>,
    index_from_mm: Matrix3<f64>,
    thickness_mm: f64,
    increment_mm: f64,
    blur_mm: f64,
}

impl<'a> Scan<'a> {
    /// With the standard deviation of its blur across slices.
    pub fn new(volume: &'a Volume, blur_sigma_m: f64, remarks: &mut Vec<Remark>) -> Self {
        let steps = volume.grid.steps_m();
        let row = steps.column(0).normalize();
        let mut normal = steps.column(0).cross(&steps.column(1)).normalize();
        if normal.dot(&steps.column(2)) < 0.0 {
            normal = -normal;
        }
        let across = normal.cross(&row);
        let ct_from_slice =
            Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[row, across, normal]));
        let increment_mm = normal.dot(&steps.column(2)) * 1e3;
        let stated_mm = volume.slice_thickness_m.map(|t| t * 1e3);
        let possible_mm = stated_mm.filter(|t| POSSIBLE_MM.contains(t));
        let thickness_mm = possible_mm.unwrap_or_else(|| {
            remarks.push(Remark::new(format!(
                "no plausible slice thickness is stated; the slice spacing, {increment_mm:.2} mm, \
                 is used"
            )));
            increment_mm.clamp(*POSSIBLE_MM.start(), *POSSIBLE_MM.end())
        });
        Self {
            volume,
            ct_from_slice,
            index_from_mm: (steps * 1e3).try_inverse().unwrap_or_else(Matrix3::zeros),
            thickness_mm,
            increment_mm,
            blur_mm: blur_sigma_m * 1e3,
        }
    }

    /// The dense part's balls under this scan's blur.
    pub fn sphere(&self, model: &MarkerModel) -> BlurredSphere {
        BlurredSphere::new(model.ball_radius_m() * 1e3, self.blur_mm, self.thickness_mm)
    }
}

/// A voxel near a marker.
#[derive(Debug, Clone, Copy)]
struct Sample {
    /// Its place from the candidate's, mm, along the slice's axes.
    at: Vector3<f64>,
    index: [usize; 3],
    /// Thousands of HU.
    density: f64,
    clipped: bool,
}

/// What is fitted to.
struct Task<'a> {
    of: &'a Appearance<'a>,
    outward: Vector3<f64>,
    samples: Vec<Sample>,
    /// What one value of the samples is worth, over its variance, (thousands of HU)^-2.
    weight: f64,
    before: Unknowns,
    known: Unknowns,
}

/// Sums of a linearisation.
struct Normal {
    information: Information,
    gradient: Unknowns,
    squares: f64,
    cost: f64,
}

/// Fits a candidate; why it is no marker where it is none.
pub(crate) fn localise(
    scan: &Scan<'_>,
    model: &MarkerModel,
    sphere: &BlurredSphere,
    seed: &Point3<f64>,
    options: &Options,
    noise: Option<&Noise>,
) -> Result<DetectedMarker, String> {
    let of = Appearance {
        marker: model,
        sphere,
        blur_mm: scan.blur_mm,
        thickness_mm: scan.thickness_mm,
    };
    let reach_mm = model.reach_m() * 1e3;
    let outward = outward(scan, seed, model)?;
    let sd = noise
        .map_or(NOISE_HU, |noise| noise.sd_hu)
        .max(LEAST_NOISE_HU)
        / 1e3;
    let per_value = noise.map_or(4.0, Noise::voxels_per_value);
    let weight = 1.0 / (sd * sd * per_value);
    let start = before(&of);
    let task = Task::new(&of, scan, seed, &outward, &start, weight);
    let mut best: Option<(f64, Unknowns)> = None;
    let span = 0.5 * reach_mm.min(4.0);
    for step in [0.0, -1.0, 1.0] {
        let mut values = start;
        let offset = outward * (step * span);
        values.fixed_rows_mut::<3>(0).copy_from(&offset);
        let cost = task.settle(&mut values, MOST_ROUNDS);
        if best.as_ref().is_none_or(|(least, _)| cost < *least) {
            best = Some((cost, values));
        }
        let misfit = task.misfit(&values);
        if misfit < 0.5 * options.largest_misfit {
            break;
        }
    }
    let (_, mut values) = best.ok_or("no voxel around it")?;
    // Around where it is, not around where it seemed to be.
    let center = values.fixed_rows::<3>(0).into_owned();
    if center.norm() > reach_mm + FARTHEST_MM {
        return Err(format!("the fit converges {:.1} mm away", center.norm()));
    }
    let seed = seed + scan.ct_from_slice * center * 1e-3;
    values.fixed_rows_mut::<3>(0).fill(0.0);
    let outward = Posed::new(&of, &outward, &values).normal();
    values[unknown::TILT] = 0.0;
    values[unknown::TILT + 1] = 0.0;
    let task = Task::new(&of, scan, &seed, &outward, &start, weight);
    task.settle(&mut values, MOST_ROUNDS);
    task.verdict(scan, &seed, &values, options, noise)
}

/// From soft tissue around a candidate to the candidate: the way out.
fn outward(
    scan: &Scan<'_>,
    seed: &Point3<f64>,
    model: &MarkerModel,
) -> Result<Vector3<f64>, String> {
    let radius = model.reach_m() * 1e3 + 8.0;
    let mut sum = Vector3::zeros();
    for_each_voxel(
        scan,
        seed,
        [radius, radius + 0.5 * scan.thickness_mm],
        |_, at, hu| {
            if hu > -480 {
                sum += at;
            }
        },
    );
    let length = sum.norm();
    if length <= 0.0 {
        return Err("there is no skin next to it".to_owned());
    }
    let outward = -sum / length;
    Ok(match model.dense {
        DensePart::Sphere { .. } => outward,
        DensePart::Ring { .. } => axis(scan, seed, model, &outward),
    })
}

/// Across the plane that a ring's voxels lie in: a ring that leans too much from the start is not found by the fit.
fn axis(
    scan: &Scan<'_>,
    seed: &Point3<f64>,
    model: &MarkerModel,
    outward: &Vector3<f64>,
) -> Vector3<f64> {
    let reach_mm = model.reach_m() * 1e3 + 1.0;
    let mut dense = Vec::new();
    for_each_voxel(scan, seed, [reach_mm, reach_mm], |_, at, hu| {
        if f64::from(hu) > DENSE_SHARE * model.hu {
            dense.push((at, f64::from(hu)));
        }
    });
    let mass: f64 = dense.iter().map(|(_, hu)| hu).sum();
    let middle = dense.iter().map(|(at, hu)| at * *hu).sum::<Vector3<f64>>() / mass.max(1.0);
    let scatter: Matrix3<f64> = dense
        .iter()
        .map(|(at, hu)| (at - middle) * (at - middle).transpose() * *hu)
        .sum();
    let eigen = scatter.symmetric_eigen();
    let axis = eigen
        .eigenvectors
        .column(eigen.eigenvalues.imin())
        .into_owned();
    if dense.len() < 8 {
        *outward
    } else {
        axis * axis.dot(outward).signum()
    }
}

/// Voxels within a distance across the slice and along its normal, mm.
fn for_each_voxel(
    scan: &Scan<'_>,
    center: &Point3<f64>,
    [across_mm, along_mm]: [f64; 2],
    mut each: impl FnMut([usize; 3], Vector3<f64>, i16),
) {
    let grid = &scan.volume.grid;
    let size = grid.size();
    let middle = grid.index_from_ct(center);
    let radius = libm::hypot(across_mm, along_mm);
    let range = |axis: usize| {
        let reach = radius * scan.index_from_mm.row(axis).norm();
        let low = (middle[axis] - reach).ceil().max(0.0);
        let high = (middle[axis] + reach).floor().min(size[axis] as f64 - 1.0);
        if low <= high {
            low as usize..high as usize + 1
        } else {
            0..0
        }
    };
    let slice_from_ct = scan.ct_from_slice.inverse();
    let to_slice = slice_from_ct * grid.steps_m() * 1e3;
    for k in range(2) {
        for j in range(1) {
            for i in range(0) {
                let offset = Vector3::new(i as f64, j as f64, k as f64) - middle.coords;
                let at = to_slice * offset;
                if libm::hypot(at.x, at.y) <= across_mm && at.z.abs() <= along_mm {
                    each([i, j, k], at, scan.volume.hu[grid.offset([i, j, k])]);
                }
            }
        }
    }
}

/// What is known beforehand.
fn before(of: &Appearance<'_>) -> Unknowns {
    let mut values = Unknowns::zeros();
    values[unknown::HEIGHT] = of.marker.height_m * 1e3;
    values[unknown::TISSUE] = 0.03;
    values[unknown::DENSE] = of.marker.hu / 1e3;
    values[unknown::CURVATURE] = BODY_PER_MM;
    values[unknown::CURVATURE + 2] = BODY_PER_MM;
    for (index, layer) in of.marker.layers.iter().enumerate() {
        values[unknown::LAYER + index] = layer.hu / 1e3;
    }
    for index in of.marker.layers.len()..2 {
        values[unknown::LAYER + index] = AIR;
    }
    values
}

/// One over the variance of what is known beforehand.
fn known(of: &Appearance<'_>) -> Unknowns {
    let mut sd = Unknowns::zeros();
    sd.fixed_rows_mut::<3>(0).fill(CENTER_MM);
    sd[unknown::HEIGHT] = HEIGHT_MM;
    sd.fixed_rows_mut::<2>(unknown::TILT).fill(TILT);
    sd.fixed_rows_mut::<3>(unknown::CURVATURE)
        .fill(CURVATURE_PER_MM);
    sd[unknown::TISSUE] = TISSUE;
    sd[unknown::DENSE] = DENSE;
    sd.fixed_rows_mut::<2>(unknown::LAYER).fill(LAYER);
    sd[unknown::RADIUS] = RADIUS_MM;
    sd[unknown::BLUR] = BLUR_SHARE * of.blur_mm;
    sd.map(|sd| 1.0 / (sd * sd))
}

impl<'a> Task<'a> {
    fn new(
        of: &'a Appearance<'a>,
        scan: &Scan<'_>,
        seed: &Point3<f64>,
        outward: &Vector3<f64>,
        before: &Unknowns,
        weight: f64,
    ) -> Self {
        let reach = of.marker.reach_m() * 1e3 + AROUND_MM;
        let along = reach + 0.5 * of.thickness_mm;
        let deepest =
            of.marker.height_m * 1e3 + AROUND_MM + 0.5 * of.thickness_mm * outward.z.abs();
        let mut samples = Vec::new();
        let mut extended = false;
        for_each_voxel(scan, seed, [reach, along], |index, at, hu| {
            if -outward.dot(&at) <= deepest {
                extended |= hu > CLIP_HU;
                samples.push(Sample {
                    at,
                    index,
                    density: f64::from(hu) / 1e3,
                    clipped: hu == CLIP_HU,
                });
            }
        });
        if extended {
            for sample in &mut samples {
                sample.clipped = false;
            }
        }
        Self {
            of,
            outward: *outward,
            samples,
            weight,
            before: *before,
            known: known(of),
        }
    }

    /// Measured less expected; 0 where both are beyond what the scanner shows.
    fn residual(sample: &Sample, density: f64) -> f64 {
        let clip = f64::from(CLIP_HU) / 1e3;
        if sample.clipped && density >= clip {
            0.0
        } else {
            sample.density - density
        }
    }

    fn linearised(&self, values: &Unknowns) -> Normal {
        let posed = Posed::new(self.of, &self.outward, values);
        let mut normal = Normal {
            information: Information::zeros(),
            gradient: Unknowns::zeros(),
            squares: 0.0,
            cost: 0.0,
        };
        let mut by = Unknowns::zeros();
        for sample in &self.samples {
            let residual = Self::residual(sample, posed.density(&sample.at, &mut by));
            if residual != 0.0 {
                normal.squares += residual * residual;
                normal.information.ger(1.0, &by, &by, 1.0);
                normal.gradient.axpy(residual, &by, 1.0);
            }
        }
        normal.information *= self.weight;
        normal.gradient *= self.weight;
        let off = self.before - values;
        for index in 0..UNKNOWNS {
            normal.information[(index, index)] += self.known[index];
            normal.gradient[index] += self.known[index] * off[index];
        }
        let prior: f64 = off.component_mul(&off).dot(&self.known);
        normal.cost = self.weight * normal.squares + prior;
        normal
    }

    /// Levenberg-Marquardt; the cost at its end.
    fn settle(&self, values: &mut Unknowns, rounds: usize) -> f64 {
        self.settle_without(values, rounds, None)
    }

    /// With one unknown held where it is.
    fn settle_without(&self, values: &mut Unknowns, rounds: usize, held: Option<usize>) -> f64 {
        let mut damping = 1e-3;
        let mut at = self.linearised(values);
        for _ in 0..rounds {
            let mut damped = at.information;
            for index in 0..UNKNOWNS {
                damped[(index, index)] *= 1.0 + damping;
            }
            let mut gradient = at.gradient;
            if let Some(held) = held {
                damped.row_mut(held).fill(0.0);
                damped.column_mut(held).fill(0.0);
                damped[(held, held)] = 1.0;
                gradient[held] = 0.0;
            }
            let Some(root) = damped.cholesky() else { break };
            let step = root.solve(&gradient);
            let mut tried = *values + step;
            hold_to_sense(&mut tried, self.of);
            let next = self.linearised(&tried);
            if next.cost < at.cost {
                let gain = at.cost - next.cost;
                *values = tried;
                at = next;
                damping = (0.2 * damping).max(1e-9);
                let moved = step.fixed_rows::<3>(0).amax();
                if moved < SETTLED_MM && gain < 1e-4 * at.cost.max(1.0) {
                    break;
                }
            } else {
                damping *= 8.0;
                if damping > 1e9 {
                    break;
                }
            }
        }
        at.cost
    }

    /// Contrast of the dense part with what it stands in.
    fn contrast(values: &Unknowns) -> f64 {
        (values[unknown::DENSE] - AIR).min(f64::from(CLIP_HU) / 1e3 - AIR)
    }

    /// Residual, rms over the contrast.
    fn misfit(&self, values: &Unknowns) -> f64 {
        let at = self.linearised(values);
        let rms = (at.squares / self.samples.len().max(1) as f64).sqrt();
        rms / Self::contrast(values).max(1e-3)
    }
}

/// Values that mean something: otherwise a step too far never comes back.
fn hold_to_sense(values: &mut Unknowns, of: &Appearance<'_>) {
    values[unknown::DENSE] = values[unknown::DENSE].clamp(-0.9, 40.0);
    values[unknown::BLUR] = values[unknown::BLUR].clamp(-0.6 * of.blur_mm, 1.5 * of.blur_mm);
    values[unknown::RADIUS] = values[unknown::RADIUS].clamp(-0.3, 0.3);
    for index in [unknown::TILT, unknown::TILT + 1] {
        values[index] = values[index].clamp(-2.0, 2.0);
    }
}

impl Task<'_> {
    /// Whether it is a marker, and what is known of it.
    fn verdict(
        &self,
        scan: &Scan<'_>,
        seed: &Point3<f64>,
        values: &Unknowns,
        options: &Options,
        noise: Option<&Noise>,
    ) -> Result<DetectedMarker, String> {
        let misfit = self.misfit(values);
        let center = values.fixed_rows::<3>(0).into_owned();
        let reach_mm = self.of.marker.reach_m() * 1e3;
        let hu = values[unknown::DENSE] * 1e3;
        let tissue_hu = values[unknown::TISSUE] * 1e3;
        if center.norm() > reach_mm {
            return Err(format!("the fit moves {:.1} mm away", center.norm()));
        }
        let largest = options.largest_misfit + 2.0 * Self::noise_share(values, noise);
        if misfit.is_nan() || misfit > largest {
            return Err(format!(
                "a marker explains it to {:.0} % of its contrast, {:.0} % at best",
                misfit * 100.0,
                largest * 100.0
            ));
        }
        // Least density that tells it from the skin it may be a fold of.
        let least = (0.4 * self.of.marker.hu).max(150.0);
        if hu < least {
            return Err(format!(
                "its dense part has {hu:.0} HU, at least {least:.0} required"
            ));
        }
        if !(0.3 * self.of.marker.height_m * 1e3 - 2.0..=self.of.marker.height_m * 1e3 + 3.0)
            .contains(&values[unknown::HEIGHT])
        {
            return Err(format!(
                "it is {:.1} mm above the skin",
                values[unknown::HEIGHT]
            ));
        }
        let (chi_square, covariance) = self.covariance(values, noise);
        let mut remarks = Vec::new();
        let (center, covariance) =
            self.along_slices(scan, values, center, covariance, &mut remarks);
        if let Some(chi_square) = chi_square
            && misfit > ODD_MISFIT
            && chi_square > ODD_CHI_SQUARE
        {
            remarks.push(Remark::new(format!(
                "the residuals are {:.1} times the noise: metal streaks, an object in contact with \
                 it, or a shape other than the model's",
                chi_square.sqrt()
            )));
        }
        if self.samples.iter().any(|sample| sample.clipped) {
            remarks.push(Remark::new(format!(
                "clipped at {CLIP_HU} HU: its density is a lower bound"
            )));
        }
        let turn = scan.ct_from_slice.matrix();
        let normal = Posed::new(self.of, &self.outward, values).normal();
        Ok(DetectedMarker {
            center_m: seed + turn * center * 1e-3,
            covariance_m2: turn * covariance * turn.transpose() * 1e-6,
            normal: turn * normal,
            diameter_m: self.of.marker.diameter_m(values[unknown::RADIUS] * 1e-3),
            hu,
            tissue_hu,
            chi_square,
            misfit,
            remarks,
        })
    }

    fn noise_share(values: &Unknowns, noise: Option<&Noise>) -> f64 {
        noise.map_or(0.0, |noise| noise.sd_hu / 1e3) / Self::contrast(values).max(0.1)
    }

    /// Mean square of the residuals over the noise's variance, and covariance of the centre, mm^2, under noise as it is
    /// in place, with its correlation.
    fn covariance(&self, values: &Unknowns, noise: Option<&Noise>) -> (Option<f64>, Matrix3<f64>) {
        let at = self.linearised(values);
        let Some(inverse) = at.information.try_inverse() else {
            return (None, Matrix3::identity() * CENTER_MM * CENTER_MM);
        };
        let per_value = noise.map_or(4.0, Noise::voxels_per_value);
        let (squares, count) = self.unclipped_squares(values, noise);
        // What the fit took of the residuals, in voxels: the priors' share of the unknowns took nothing.
        let prior: f64 = (0..UNKNOWNS).map(|k| inverse[(k, k)] * self.known[k]).sum();
        let share = count / self.samples.len().max(1) as f64;
        let taken = (UNKNOWNS as f64 - prior) * per_value * share;
        let variance = squares / (count - taken).max(0.2 * count);
        let chi_square = noise.map(|noise| variance * 1e6 / (noise.sd_hu * noise.sd_hu));

        let rows = inverse.fixed_rows::<3>(0).into_owned();
        let influence = self.influence(values, &rows);
        let correlated = noise.map_or_else(
            || {
                influence
                    .iter()
                    .map(|(_, p)| p * p.transpose())
                    .sum::<Matrix3<f64>>()
                    * per_value
            },
            |noise| correlated(&influence, noise),
        );
        let known = rows * SMatrix::from_diagonal(&self.known) * rows.transpose();
        let shape = Matrix3::from_diagonal_element(SHAPE_MM * SHAPE_MM);
        (chi_square, correlated * variance + known + shape)
    }

    /// Squares of the residuals and their number, of voxels in which all of the noise shows: that of air is cut off at the
    /// least value that scanners store.
    fn unclipped_squares(&self, values: &Unknowns, noise: Option<&Noise>) -> (f64, f64) {
        let reach_hu = 2.0 * noise.map_or(NOISE_HU, |noise| noise.sd_hu);
        let least = (f64::from(LEAST_HU) + reach_hu) / 1e3;
        let posed = Posed::new(self.of, &self.outward, values);
        let mut by = Unknowns::zeros();
        let (mut squares, mut count) = (0.0, 0.0);
        for sample in &self.samples {
            let density = posed.density(&sample.at, &mut by);
            if density >= least {
                squares += Self::residual(sample, density).powi(2);
                count += 1.0;
            }
        }
        (squares, count)
    }

    /// By how much each voxel moves the centre, mm per thousand of HU.
    fn influence(
        &self,
        values: &Unknowns,
        rows: &SMatrix<f64, 3, UNKNOWNS>,
    ) -> Vec<([usize; 3], Vector3<f64>)> {
        let posed = Posed::new(self.of, &self.outward, values);
        let mut by = Unknowns::zeros();
        self.samples
            .iter()
            .map(|sample| {
                let residual = Self::residual(sample, posed.density(&sample.at, &mut by));
                let counts = if residual == 0.0 { 0.0 } else { self.weight };
                (sample.index, rows * by * counts)
            })
            .collect()
    }

    /// Along the slices a thick slice may leave the place open, and then a line through the best fit is no measure of
    /// how open: all places are tried, and their mean and spread taken.
    fn along_slices(
        &self,
        scan: &Scan<'_>,
        values: &Unknowns,
        center: Vector3<f64>,
        covariance: Matrix3<f64>,
        remarks: &mut Vec<Remark>,
    ) -> (Vector3<f64>, Matrix3<f64>) {
        let size_mm = 2.0 * self.of.marker.reach_m() * 1e3;
        let overlaps = scan.increment_mm < 0.75 * scan.thickness_mm;
        let open = !overlaps && size_mm < scan.thickness_mm + RECOVERED_MM;
        let (mut center, mut covariance) = (center, covariance);
        if open {
            let (mean, variance) = self.spread_along(scan, values);
            center.z = mean;
            covariance[(2, 2)] = covariance[(2, 2)].max(variance);
        }
        let sd_mm = covariance[(2, 2)].sqrt();
        if sd_mm > OPEN_MM {
            remarks.push(Remark::new(format!(
                "its position across the slices is too uncertain: {sd_mm:.1} mm (standard \
                 deviation); marker of {size_mm:.1} mm, slices {:.1} mm thick, spacing {:.1} mm",
                scan.thickness_mm, scan.increment_mm
            )));
        }
        (center, covariance)
    }

    /// Mean and variance of the place along the slices, mm and mm^2, over all places by how well the rest fits then.
    fn spread_along(&self, scan: &Scan<'_>, values: &Unknowns) -> (f64, f64) {
        const STEPS: i32 = 12;
        let step = scan.thickness_mm / f64::from(STEPS);
        let misfit = (ODD_MISFIT * Self::contrast(values)).powi(2);
        let scale = 1.0 / (1.0 + misfit * self.weight);
        let places: Vec<(f64, f64)> = (-STEPS..=STEPS)
            .map(|n| {
                let mut tried = *values;
                tried[2] += f64::from(n) * step;
                let cost = self.settle_without(&mut tried, 6, Some(2));
                (tried[2], cost * scale)
            })
            .collect();
        let least = places
            .iter()
            .map(|place| place.1)
            .fold(f64::INFINITY, f64::min);
        let (mut sum, mut mean, mut square) = (0.0, 0.0, 0.0);
        for (z, cost) in places {
            let weight = libm::exp(-0.5 * (cost - least));
            sum += weight;
            mean += weight * z;
            square += weight * z * z;
        }
        let mean = mean / sum;
        (
            mean,
            (square / sum - mean * mean).max(0.0) + step * step / 12.0,
        )
    }
}

/// Sum over pairs of voxels of their influences and their noise's correlation.
fn correlated(influence: &[([usize; 3], Vector3<f64>)], noise: &Noise) -> Matrix3<f64> {
    let mut low = [usize::MAX; 3];
    let mut high = [0; 3];
    for (index, _) in influence {
        for axis in 0..3 {
            low[axis] = low[axis].min(index[axis]);
            high[axis] = high[axis].max(index[axis]);
        }
    }
    if influence.is_empty() {
        return Matrix3::zeros();
    }
    // With a margin all around, so that no lag leaves the box.
    let margin = [REACH, REACH, SLICES];
    let size: [usize; 3] =
        std::array::from_fn(|axis| high[axis] - low[axis] + 1 + 2 * margin[axis]);
    let offset = |index: &[usize; 3]| {
        let at: [usize; 3] = std::array::from_fn(|axis| index[axis] - low[axis] + margin[axis]);
        (at[2] * size[1] + at[1]) * size[0] + at[0]
    };
    let mut field = vec![Vector3::zeros(); size.iter().product()];
    for (index, value) in influence {
        field[offset(index)] = *value;
    }
    let (reach, slices) = (REACH as isize, SLICES as isize);
    let mut lags = Vec::new();
    for dk in -slices..=slices {
        for dj in -reach..=reach {
            for di in -reach..=reach {
                let correlation = noise.between([di, dj, dk]);
                let lag = (dk * size[1] as isize + dj) * size[0] as isize + di;
                lags.push((lag, correlation));
            }
        }
    }
    let mut sum = Matrix3::zeros();
    for (index, value) in influence {
        let at = offset(index);
        let mut around = Vector3::zeros();
        for &(lag, correlation) in &lags {
            around += field[at.wrapping_add_signed(lag)] * correlation;
        }
        sum += value * around.transpose();
    }
    at_least(
        0.5 * (sum + sum.transpose()),
        influence.iter().map(|(_, p)| p * p.transpose()).sum(),
    )
}

/// A covariance under correlated noise, held above a share of that under `white` noise in every direction: estimates of a
/// correlation may leave a direction less than nothing.
fn at_least(covariance: Matrix3<f64>, white: Matrix3<f64>) -> Matrix3<f64> {
    /// Kernels leave little noise in the lowest frequencies, but that of all is the same: a half is below what is seen.
    const OF_WHITE: f64 = 0.5;
    let Some(root) = white.cholesky().map(|factor| factor.l()) else {
        return white;
    };
    let Some(inverse) = root.try_inverse() else {
        return white;
    };
    let ratio = inverse * covariance * inverse.transpose();
    let mut eigen = (0.5 * (ratio + ratio.transpose())).symmetric_eigen();
    eigen
        .eigenvalues
        .apply(|value| *value = value.max(OF_WHITE));
    root * eigen.recompose() * root.transpose()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_direction_is_known_better_than_noise_allows() {
        let white = Matrix3::new(2.0, 0.3, 0.0, 0.3, 1.0, 0.1, 0.0, 0.1, 0.5);
        // Along the third axis less than nothing.
        let estimated = Matrix3::new(6.0, 0.0, 0.1, 0.0, 4.0, 0.0, 0.1, 0.0, -0.4);
        let held = at_least(estimated, white);
        assert!((held - held.transpose()).amax() < 1e-12);
        let above = (held - white * 0.5).symmetric_eigenvalues();
        assert!(above.min() > -1e-12, "{above}");
        // What was above it is left alone.
        let fine = white * 3.0;
        assert!((at_least(fine, white) - fine).amax() < 1e-12);
    }
}
