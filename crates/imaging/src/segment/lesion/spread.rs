//! How far the centroid of a lesion moves from one way to bound it to another.

use nalgebra::{Matrix3, Point3, Vector3};
use needlebench_volume::VolumeError;

use crate::mask::Mask;

use super::grower::{Bounding, Grower, Grown, USUAL};
use super::local::Local;

/// Levels of density and shares of a vessel beside the usual ones.
const LEVELS: [f64; 2] = [0.35, 0.65];
const VESSELS: [f64; 2] = [0.45, 0.75];

/// Mean square of how far the centroid of the voxels moves along each pair of axes of `ct`, m^2: over levels, over what
/// counts as a vessel, and over where the wall of the lung runs; each of these adds the mean of its own.
pub(super) fn of(
    grower: &Grower<'_>,
    local: &Local,
    usual: &Grown,
    hull: Option<&Mask>,
    wider: Option<&Mask>,
) -> Result<Matrix3<f64>, VolumeError> {
    let Some(from) = centroid_m(local, &usual.mask) else {
        return Ok(Matrix3::zeros());
    };
    let moved = |hull: Option<&Mask>, bounding: Bounding| -> Result<Matrix3<f64>, VolumeError> {
        let other = grower.grow(hull, bounding)?;
        let away = centroid_m(local, &other.mask).map_or(Vector3::zeros(), |to| to - from);
        Ok(away * away.transpose())
    };
    let mut sum = Matrix3::zeros();
    for level in LEVELS {
        sum += 0.5 * moved(hull, Bounding { level, ..USUAL })?;
    }
    for vessel in VESSELS {
        sum += 0.5 * moved(hull, Bounding { vessel, ..USUAL })?;
    }
    if wider.is_some() {
        sum += moved(wider, USUAL)?;
    }
    Ok(sum)
}

/// Centroid of voxels in `ct`, m; none without voxels.
fn centroid_m(local: &Local, mask: &Mask) -> Option<Point3<f64>> {
    let (mut sum, mut count) = (Vector3::zeros(), 0.0);
    for voxel in mask.voxels() {
        sum += Vector3::from(voxel.map(|index| index as f64));
        count += 1.0;
    }
    (count > 0.0).then(|| local.volume.grid.ct_from_index(&Point3::from(sum / count)))
}
