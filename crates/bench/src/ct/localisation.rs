//! How well the centroid of a lesion is known.

use nalgebra::{Matrix3, Vector3};
use needlebench_imaging::{Lesion, LesionSize, Volume};

/// Standard deviation of a centroid along an axis, as a share of what a slice or pixel sees along it.
const SHARE_OF_VOXEL: f64 = 0.05;

/// Covariance of a lesion's centroid in `ct`, m^2.
pub(super) fn target_covariance_m2(
    volume: &Volume,
    lesion: &Lesion,
    size: &LesionSize,
) -> Matrix3<f64> {
    let mut extent_m = volume.grid.spacing_m();
    extent_m[2] = extent_m[2].max(volume.slice_thickness_m.unwrap_or(0.0));
    let sigma_m = Vector3::from(extent_m) * SHARE_OF_VOXEL;
    let _ = (lesion, size);
    Matrix3::from_diagonal(&sigma_m.component_mul(&sigma_m))
}
