//! How well the centroid of a lesion is known.

use nalgebra::{Matrix3, Vector3};
use needlebench_volume::Volume;

use super::Lesion;

/// Standard deviation that the spread of the centroid over ways to bound a lesion stands for, over that spread.
///
/// Measured, as are all numbers here, on 560 simulated nodules of 6 to 30 mm and -600 to +60 HU in slices of 1, 2.5 and
/// 5 mm, with up to 3 vessels of 2 to 5 mm and a wall at 30 % of them (`tests/imaging/nodules`, seeds from 2000 and from
/// 7000; 300 more, from 11000, for ground glass). The ways differ less from each other than from the ground truth, above
/// all at a wall, where each of them loses a part of the cap.
const OF_SPREAD: f64 = 1.7;

/// Share of the spread, as the mean of the three axes, that is in any direction: a few ways do not span space.
const ALL_ROUND: f64 = 0.4;

/// Standard deviation along columns and rows, as a share of a pixel: noise and partial volume of an isolated ball.
const OF_PIXEL: f64 = 0.012;

/// The same across slices, as a share of the sum of slice spacing and slice thickness.
const OF_SLICE: f64 = 0.008;

/// Standard deviation along any axis where something was cut off, as a share of a pixel; so many times as large as the lesion
/// is fainter than the vessel, of which as much more is left at its edge.
const WHERE_CUT: f64 = 0.03;

/// Contrast of a vessel to the lung, HU.
const OF_VESSEL_HU: f64 = 890.0;

/// Of a lesion that could not be bounded, as a share of the radius of the largest ball in it.
const WHERE_LEAKED: f64 = 1.0;

/// Standard deviation of the centroid of an outline from a label map along each axis, as a share of what a voxel sees: its
/// two ends are anywhere within half a voxel, 1 / sqrt(24). An assumption: how far a reader or a network is off is not in
/// the map.
const OF_OUTLINE: f64 = 0.204;

/// Covariance of a lesion's centroid in `ct`, m^2: of the centroid of the solid on the lung's side of its wall, without its
/// vessels.
pub(crate) fn centre_covariance_m2(volume: &Volume, lesion: &Lesion) -> Matrix3<f64> {
    let steps = volume.grid.steps_m();
    let [column, row, slice] = volume.grid.spacing_m();
    let thickness_m = volume.slice_thickness_m.unwrap_or(slice).max(slice);
    let own = if lesion.level_hu.is_some() {
        Vector3::new(
            OF_PIXEL * column,
            OF_PIXEL * row,
            OF_SLICE * (slice + thickness_m),
        )
    } else {
        Vector3::new(column, row, thickness_m) * OF_OUTLINE
    };
    let axes = Matrix3::from_columns(&[0, 1, 2].map(|axis| steps.column(axis).normalize()));
    let mut variance = axes * Matrix3::from_diagonal(&own.component_mul(&own)) * axes.transpose();
    let mut all_round = ALL_ROUND.powi(2) * OF_SPREAD.powi(2) * lesion.spread_m2.trace() / 3.0;
    if lesion.cut_at_wall || lesion.cut_at_vessels {
        let level_hu = lesion.level_hu.filter(|_| lesion.in_lung);
        let contrast = level_hu.map(|level_hu| 2.0 * (f64::from(lesion.median_hu) - level_hu));
        let fainter = contrast.map_or(1.0, |contrast| (OF_VESSEL_HU / contrast).max(1.0));
        all_round += (WHERE_CUT * fainter * column.max(row)).powi(2);
    }
    if lesion.leaked {
        all_round += (WHERE_LEAKED * lesion.inscribed_radius_m).powi(2);
    }
    variance += OF_SPREAD.powi(2) * lesion.spread_m2;
    variance += Matrix3::from_diagonal_element(all_round);
    0.5 * (variance + variance.transpose())
}
