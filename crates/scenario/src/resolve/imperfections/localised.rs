//! How well markers and target are localised: as assumed, or as measured.

use nalgebra::{Matrix3, Point3, Vector3};

use crate::scenario::{ImagingBlock, RegistrationBlock, covariance_m2};

/// Markers by which the phantom is registered.
#[derive(Debug, Clone, PartialEq)]
pub struct Markers {
    /// Where they are, phantom frame.
    pub places_m: Vec<Point3<f64>>,
    /// How well they are seen there.
    pub localisation: Localisation,
}

/// How well markers are localised.
#[derive(Debug, Clone, PartialEq)]
pub enum Localisation {
    /// Assumed: the same for all of them and along all axes, and all count alike in the fit.
    Assumed {
        /// Root mean square distance from where a marker is (fiducial localisation error), m.
        rms_m: f64,
    },
    /// Measured, each by itself, and each counts in the fit by the inverse of its covariance.
    Measured {
        /// Covariance of each marker's place, phantom frame, m^2; positive definite.
        covariances_m2: Vec<Matrix3<f64>>,
    },
}

impl Markers {
    pub(super) fn new(block: &RegistrationBlock) -> Self {
        let places = block.markers_mm.iter();
        let measured = block.covariance_mm2.as_ref();
        Self {
            places_m: places
                .map(|mm| Point3::from(Vector3::from(*mm) * 1e-3))
                .collect(),
            localisation: measured.map_or(
                Localisation::Assumed {
                    rms_m: block.localisation_error_mm * 1e-3,
                },
                |covariances| Localisation::Measured {
                    covariances_m2: covariances.iter().copied().map(covariance_m2).collect(),
                },
            ),
        }
    }

    /// Whether the localisation was measured.
    pub fn are_measured(&self) -> bool {
        matches!(self.localisation, Localisation::Measured { .. })
    }
}

/// How well the target is localised in the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TargetLocalisation {
    /// A root of the covariance of its place, phantom frame, m: the covariance is this times its transpose.
    pub root_m: Matrix3<f64>,
    /// Whether it was measured, and not assumed.
    pub is_measured: bool,
    /// Voxel of the image, along the axes of the phantom frame, m.
    pub voxel_m: Vector3<f64>,
}

impl TargetLocalisation {
    pub(super) fn new(block: &ImagingBlock) -> Self {
        let measured = block.covariance_mm2.map(covariance_m2);
        Self {
            root_m: measured.map_or_else(|| assumed_root_m(block), root),
            is_measured: measured.is_some(),
            voxel_m: Vector3::from(block.voxel_mm) * 1e-3,
        }
    }
}

/// Of a target that is uniform within a voxel, and chosen by a reader.
fn assumed_root_m(block: &ImagingBlock) -> Matrix3<f64> {
    let reader = block.reader_mm * block.reader_mm;
    let spread_m =
        Vector3::from(block.voxel_mm).map(|voxel| (voxel * voxel / 12.0 + reader).sqrt() * 1e-3);
    Matrix3::from_diagonal(&spread_m)
}

/// The symmetric root: there is one of every covariance, whatever its rounding.
fn root(covariance: Matrix3<f64>) -> Matrix3<f64> {
    let eigen = covariance.symmetric_eigen();
    let deviations = eigen.eigenvalues.map(|variance| variance.max(0.0).sqrt());
    eigen.eigenvectors * Matrix3::from_diagonal(&deviations) * eigen.eigenvectors.transpose()
}
