//! Which arm a log is of.

use nalgebra::Vector3;
use needlebench_kinematics::{UrGeometry, UrModel};
use serde::Serialize;

use crate::RecordedRun;

/// Rows that are looked at; more say no more about six lengths.
const ROWS: usize = 500;

/// How well an arm's nominal lengths explain the logged poses of the tool's point.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ArmFit {
    /// The manufacturer's name.
    pub arm: &'static str,
    /// Root mean square distance of the logged points from those of the arm with the tool's point that
    /// fits best, m.
    pub rms_m: f64,
    /// Largest such distance, m.
    pub largest_m: f64,
}

/// All known arms, the best fit first; none where the log has no poses.
///
/// The tool's point is fitted: the mean of where each row has it in the flange frame.
pub fn arm_fits(run: &RecordedRun) -> Vec<ArmFit> {
    if run.tcp.is_none() {
        return Vec::new();
    }
    let mut fits: Vec<ArmFit> = UrModel::ALL
        .into_iter()
        .filter_map(|model| {
            let (rms_m, largest_m) = distances(run, &model.geometry())?;
            Some(ArmFit {
                arm: model.name(),
                rms_m,
                largest_m,
            })
        })
        .collect();
    fits.sort_by(|a, b| a.rms_m.total_cmp(&b.rms_m));
    fits
}

/// Root mean square and largest distance of the logged points from those of an arm, m.
pub(crate) fn distances(run: &RecordedRun, geometry: &UrGeometry) -> Option<(f64, f64)> {
    let rows: Vec<(needlebench_kinematics::Pose, Vector3<f64>)> = spread(run.len(), ROWS)
        .filter_map(|row| {
            let flange = geometry.base_from_flange(&run.actual_q[row]);
            Some((flange, run.base_from_tcp(row)?.translation.vector))
        })
        .collect();
    let count = rows.len() as f64;
    let point: Vector3<f64> = rows
        .iter()
        .map(|(flange, at)| flange.inverse_transform_point(&(*at).into()).coords / count)
        .sum();
    let off = rows
        .iter()
        .map(|(flange, at)| (flange * nalgebra::Point3::from(point) - at).coords.norm());
    let (square, largest) = off.fold((0.0, 0.0_f64), |(square, largest), off| {
        (square + off * off, largest.max(off))
    });
    (count > 0.0).then(|| ((square / count).sqrt(), largest))
}

/// Up to `most` rows of `count`, evenly spread.
pub(crate) fn spread(count: usize, most: usize) -> impl Iterator<Item = usize> {
    let used = count.min(most);
    (0..used).map(move |k| k * count / used)
}
