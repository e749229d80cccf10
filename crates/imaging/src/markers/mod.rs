//! Markers on the skin: found by their shape, localised by a fit of what a scan shows of them.
//!
//! Of a marker between the skin and the air, a threshold finds too much or nothing, and a centroid is off by what the
//! skin adds to it. Here a bump of the silhouette is a candidate, and a sphere (or a ring), the holder's layers and
//! curved skin under the scan's blur are fitted to the voxels themselves. The fit's covariance holds for noise that is
//! correlated between voxels; where a slice is too thick to tell where in it a sphere lies, it is wide, and says so.

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "indices of voxels within a volume, and counts of some"
)]
mod bits;
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "indices of voxels within a volume, and counts of some"
)]
mod detect;
mod edge;
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_possible_wrap,
    reason = "indices of voxels within a volume, and counts of some"
)]
mod fit;
mod model;
#[expect(
    clippy::cast_sign_loss,
    clippy::cast_possible_wrap,
    reason = "indices of voxels within a volume, and counts of some"
)]
mod noise;
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "indices of voxels within a volume, and counts of some"
)]
mod sphere;

use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::{Matrix3, Point3, Vector3};
use needlebench_kinematics::registration::Localised;
use needlebench_volume::{Remark, Volume, VolumeError};
use serde::{Deserialize, Serialize};

pub use noise::Noise;
pub(crate) use noise::measure_noise;

/// What is dense in a marker.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "shape")]
pub enum DensePart {
    /// A ball.
    Sphere {
        /// Its diameter.
        diameter_m: f64,
    },
    /// A ring in a flat disc.
    Ring {
        /// Diameter of its middle line.
        diameter_m: f64,
        /// Diameter of a wire of its cross-section.
        wire_m: f64,
    },
}

/// A cylinder of the holder, coaxial with the marker.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HolderLayer {
    /// Where it begins, outwards from the marker's centre: negative below it.
    pub bottom_m: f64,
    /// Where it ends.
    pub top_m: f64,
    /// Its radius.
    pub radius_m: f64,
    /// What it is about, in HU; the fit settles it.
    pub hu: f64,
}

/// A marker as it is made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MarkerModel {
    /// What is dense in it. Its centre is the marker's.
    pub dense: DensePart,
    /// What that is in HU, roughly: for the test of a candidate's mass.
    pub hu: f64,
    /// Height of the centre over the skin.
    pub height_m: f64,
    /// At most two layers of its holder, each wholly around the dense part or wholly beside it.
    pub layers: Vec<HolderLayer>,
}

/// Share of a ring's density above which a voxel is dense, where a slice holds little of it.
const DENSE_SHARE: f64 = 0.25;

/// Radius of balls in a row that spread as far across it as a wire of radius 1: sqrt(5/4).
const BALL_FOR_WIRE: f64 = 1.118_033_988_749_895;

/// Balls that a ring is made of in the fit, per wire diameter of its length: half overlapping.
const BALLS_PER_WIRE: f64 = 2.0;

impl MarkerModel {
    /// A bare ball of this diameter that touches the skin.
    pub fn bare_sphere(diameter_m: f64) -> Self {
        Self {
            dense: DensePart::Sphere { diameter_m },
            hu: 1200.0,
            height_m: 0.5 * diameter_m,
            layers: Vec::new(),
        }
    }

    /// The phantom's: a ball in a foam carrier on the skin, a plastic disc of 18 x 1 mm on it.
    pub fn phantom_sphere(diameter_m: f64) -> Self {
        let radius_m = 0.5 * diameter_m;
        let layer = |bottom_m, top_m, hu| HolderLayer {
            bottom_m,
            top_m,
            radius_m: 9e-3,
            hu,
        };
        Self {
            layers: vec![
                layer(-radius_m, radius_m, -950.0),
                layer(radius_m, radius_m + 1e-3, 100.0),
            ],
            ..Self::bare_sphere(diameter_m)
        }
    }

    /// A flat disc on the skin with a dense ring in its middle: diameter of the ring, of its wire, thickness of the disc.
    pub fn ring_disc(diameter_m: f64, wire_m: f64, thickness_m: f64) -> Self {
        Self {
            dense: DensePart::Ring { diameter_m, wire_m },
            hu: 2500.0,
            height_m: 0.5 * thickness_m,
            layers: vec![HolderLayer {
                bottom_m: -0.5 * thickness_m,
                top_m: 0.5 * thickness_m,
                radius_m: 0.5 * diameter_m + wire_m,
                hu: 100.0,
            }],
        }
    }

    fn check(&self) -> Result<(), VolumeError> {
        let lengths = match self.dense {
            DensePart::Sphere { diameter_m } => vec![("diameter", diameter_m, 0.5e-3, 30e-3)],
            DensePart::Ring { diameter_m, wire_m } => vec![
                ("diameter", diameter_m, 3e-3, 60e-3),
                ("wire", wire_m, 0.3e-3, 5e-3),
            ],
        };
        for (what, value, least, most) in lengths {
            if !(least..=most).contains(&value) {
                return Err(VolumeError::refused(format!(
                    "a marker's {what} of {:.3} mm is outside {:.1} to {:.0} mm",
                    value * 1e3,
                    least * 1e3,
                    most * 1e3
                )));
            }
        }
        if !(-500.0..=30_000.0).contains(&self.hu) || !(0.0..=50e-3).contains(&self.height_m) {
            return Err(VolumeError::refused(format!(
                "a marker of {} HU with its centre {:.1} mm above the skin is outside -500 to \
                 30000 HU and 0 to 50 mm",
                self.hu,
                self.height_m * 1e3
            )));
        }
        let bad = |layer: &HolderLayer| {
            layer.bottom_m >= layer.top_m
                || layer.radius_m <= 0.0
                || ![layer.bottom_m, layer.top_m, layer.radius_m, layer.hu]
                    .iter()
                    .all(|v| v.is_finite())
        };
        if self.layers.len() > 2 || self.layers.iter().any(bad) {
            return Err(VolumeError::refused(
                "a marker's holder has at most two layers, each with its bottom below its top and a radius above 0",
            ));
        }
        Ok(())
    }

    /// Radius of the balls that make the dense part.
    fn ball_radius_m(&self) -> f64 {
        match self.dense {
            DensePart::Sphere { diameter_m } => 0.5 * diameter_m,
            DensePart::Ring { wire_m, .. } => 0.5 * wire_m * BALL_FOR_WIRE,
        }
    }

    /// Diameter of ball or wire where the balls' radius is so much larger than the model's.
    fn diameter_m(&self, wider_m: f64) -> f64 {
        let radius_m = self.ball_radius_m() + wider_m;
        match self.dense {
            DensePart::Sphere { .. } => 2.0 * radius_m,
            DensePart::Ring { .. } => 2.0 * radius_m / BALL_FOR_WIRE,
        }
    }

    fn ball_count(&self) -> usize {
        match self.dense {
            DensePart::Sphere { .. } => 1,
            DensePart::Ring { diameter_m, wire_m } => {
                let count = (std::f64::consts::PI * diameter_m / wire_m * BALLS_PER_WIRE).ceil();
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "some dozens: the ring is checked"
                )]
                let count = count as usize;
                count
            }
        }
    }

    /// Places of the balls along two directions of the skin, mm.
    fn balls_mm(&self) -> Vec<[f64; 2]> {
        match self.dense {
            DensePart::Sphere { .. } => vec![[0.0; 2]],
            DensePart::Ring { diameter_m, .. } => {
                let count = self.ball_count();
                (0..count)
                    .map(|ball| {
                        let angle = std::f64::consts::TAU * ball as f64 / count as f64;
                        [libm::cos(angle), libm::sin(angle)].map(|share| 500.0 * diameter_m * share)
                    })
                    .collect()
            }
        }
    }

    /// Share of a ball's mass that it stands for.
    fn ball_weight(&self) -> f64 {
        self.volume_m3() / (self.ball_count() as f64 * ball_m3(self.ball_radius_m()))
    }

    /// The layer that the dense part is in.
    fn layer_around(&self) -> Option<usize> {
        let radius_m = self.ball_radius_m() - 1e-6;
        let around = |layer: &HolderLayer| layer.bottom_m <= -radius_m && layer.top_m >= radius_m;
        self.layers.iter().position(around)
    }

    /// Volume of the dense part.
    fn volume_m3(&self) -> f64 {
        match self.dense {
            DensePart::Sphere { diameter_m } => ball_m3(0.5 * diameter_m),
            DensePart::Ring { diameter_m, wire_m } => {
                let section_m2 = 0.25 * std::f64::consts::PI * wire_m * wire_m;
                section_m2 * std::f64::consts::PI * diameter_m
            }
        }
    }

    /// From the centre to the farthest dense place.
    fn reach_m(&self) -> f64 {
        match self.dense {
            DensePart::Sphere { diameter_m } => 0.5 * diameter_m,
            DensePart::Ring { diameter_m, wire_m } => 0.5 * (diameter_m + wire_m),
        }
    }
}

fn ball_m3(radius_m: f64) -> f64 {
    4.0 / 3.0 * std::f64::consts::PI * radius_m.powi(3)
}

/// How markers are looked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Standard deviation of the scan's blur across a slice; the fit settles it to some tens of a percent.
    pub blur_sigma_m: f64,
    /// Largest residual, rms over the marker's contrast, of what is taken for a marker.
    pub largest_misfit: f64,
    /// Most candidates that are fitted, the likeliest by mass first.
    pub most_candidates: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            blur_sigma_m: 0.55e-3,
            largest_misfit: 0.08,
            most_candidates: 200,
        }
    }
}

/// A marker in a scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DetectedMarker {
    /// Centre of what is dense in it, in `ct`.
    #[serde(with = "crate::serial::point")]
    pub center_m: Point3<f64>,
    /// Covariance of that place's error, m^2.
    #[serde(with = "crate::serial::symmetric3")]
    pub covariance_m2: Matrix3<f64>,
    /// Outward normal of the skin under it.
    #[serde(with = "crate::serial::vector")]
    pub normal: nalgebra::Vector3<f64>,
    /// Diameter of the ball, or of the ring's wire, as the fit settles it near the model's.
    pub diameter_m: f64,
    /// What is dense in it, HU; no more than a lower bound where the scan is clipped.
    pub hu: f64,
    /// Tissue under it, HU.
    pub tissue_hu: f64,
    /// Mean square of the fit's residuals over the variance of the scan's noise: 1 if the model explains everything.
    /// Nothing where the scan shows no homogeneous tissue to measure its noise in.
    pub chi_square: Option<f64>,
    /// Residual, rms over the contrast of the marker.
    pub misfit: f64,
    /// What is worth knowing of it.
    pub remarks: Vec<Remark>,
}

impl DetectedMarker {
    /// Its place and covariance.
    pub fn localised(&self) -> Localised {
        Localised {
            at_m: self.center_m,
            covariance_m2: self.covariance_m2,
        }
    }
}

/// What might have been a marker and is not.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rejected {
    /// Where.
    #[serde(with = "crate::serial::point")]
    pub at_m: Point3<f64>,
    /// Why not.
    pub reason: String,
}

/// What was found in a scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Found {
    /// Markers, from the feet up, then right to left.
    pub markers: Vec<DetectedMarker>,
    /// Bumps with a marker's mass, or nearly, that are none.
    pub rejected: Vec<Rejected>,
    /// Noise that the scan shows in homogeneous tissue, if it has any.
    pub noise: Option<Noise>,
    /// What is worth knowing of the scan.
    pub remarks: Vec<Remark>,
}

/// What interpolation between voxels adds to a marker's place, as a share of their distance: it smooths along the slices'
/// lean, which the fit takes for the scan's own blur. 0.05 mm in slices every 2.5 mm at a tilt of 15 deg.
const INTERPOLATED_SHARE: f64 = 0.03;

impl Found {
    /// Of a volume that was interpolated to the patient's axes: markers are known less well than their fit says.
    #[must_use]
    pub fn of_interpolated(mut self, volume: &Volume) -> Self {
        let sigma_m = Vector3::from(volume.grid.spacing_m()) * INTERPOLATED_SHARE;
        let added = Matrix3::from_diagonal(&sigma_m.component_mul(&sigma_m));
        for marker in &mut self.markers {
            marker.covariance_m2 += added;
        }
        self
    }
}

/// Finds the markers of a scan and says where they are and how well that is known.
///
/// # Errors
/// An impossible model or option; interrupted.
pub fn find_markers(
    volume: &Volume,
    model: &MarkerModel,
    options: &Options,
    threads: usize,
    cancel: &AtomicBool,
) -> Result<Found, VolumeError> {
    model.check()?;
    check_options(options)?;
    let mut remarks = Vec::new();
    let scan = fit::Scan::new(volume, options.blur_sigma_m, &mut remarks);
    let candidates = detect::candidates(volume, model, threads, cancel)?;
    let mut rejected: Vec<Rejected> = candidates.rejected;
    let noise = measure_noise(volume);
    let sphere = scan.sphere(model);
    let mut fitted = Vec::new();
    for (rank, seed) in candidates.seeds.iter().enumerate() {
        if cancel.load(Ordering::Relaxed) {
            return Err(VolumeError::Interrupted);
        }
        if rank >= options.most_candidates {
            remarks.push(Remark::new(format!(
                "{} candidates beyond the {} most likely were not evaluated",
                candidates.seeds.len() - rank,
                options.most_candidates
            )));
            break;
        }
        match fit::localise(&scan, model, &sphere, seed, options, noise.as_ref()) {
            Ok(marker) => fitted.push(marker),
            Err(reason) => rejected.push(Rejected {
                at_m: *seed,
                reason,
            }),
        }
    }
    let markers = distinct(fitted, model, &mut rejected);
    Ok(Found {
        markers,
        rejected,
        noise,
        remarks,
    })
}

fn check_options(options: &Options) -> Result<(), VolumeError> {
    if !(0.1e-3..=3e-3).contains(&options.blur_sigma_m)
        || options.largest_misfit.is_nan()
        || options.largest_misfit <= 0.0
    {
        return Err(VolumeError::refused(format!(
            "a blur of {:.3} mm or a maximum misfit of {} is outside 0.1 to 3 mm, or not above 0",
            options.blur_sigma_m * 1e3,
            options.largest_misfit
        )));
    }
    Ok(())
}

/// Each marker once, the better fit of two, in an order that does not depend on the candidates'.
fn distinct(
    mut fitted: Vec<DetectedMarker>,
    model: &MarkerModel,
    rejected: &mut Vec<Rejected>,
) -> Vec<DetectedMarker> {
    fitted.sort_by(|a, b| a.misfit.total_cmp(&b.misfit));
    let mut markers: Vec<DetectedMarker> = Vec::new();
    for marker in fitted {
        let apart =
            |other: &DetectedMarker| (other.center_m - marker.center_m).norm() > model.reach_m();
        if markers.iter().all(apart) {
            markers.push(marker);
        } else {
            rejected.push(Rejected {
                at_m: marker.center_m,
                reason: "the same marker as another candidate".to_owned(),
            });
        }
    }
    let key = |marker: &DetectedMarker| [marker.center_m.z, marker.center_m.x, marker.center_m.y];
    markers.sort_by(|a, b| {
        key(a)
            .partial_cmp(&key(b))
            .unwrap_or(std::cmp::Ordering::Equal)
    });
    markers
}

#[cfg(test)]
mod tests;
