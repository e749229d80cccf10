//! Pose accuracy AP, pose repeatability RP and multi-directional variation vAP.

use nalgebra::{Point3, Vector3};
use needlebench_kinematics::rotation_vector;
use serde::Serialize;

use super::{AXES, Attained, Commanded};

/// Why there are no statistics.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum StatisticsError {
    /// A pose that was measured but never commanded.
    #[error("P{pose} was measured, but is not among the commanded poses")]
    NotCommanded {
        /// Its number.
        pose: u32,
    },
    /// Too few measurements for a spread.
    #[error("P{pose} was measured {count} times{direction}; repeatability requires at least two")]
    TooFew {
        /// Number of the pose.
        pose: u32,
        /// How often.
        count: usize,
        /// Along which axis, in words.
        direction: String,
    },
    /// No measurement of the plain sequence at all.
    #[error("there is no measurement without an approach direction")]
    NoPlainSequence,
}

/// Accuracy and repeatability of the orientation at a pose.
///
/// `AP_a = |mean of the rotation about x from commanded to attained|`, likewise b and c about y and
/// z of the base frame; `RP_a = 3 S_a`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AngleStatistics {
    /// Accuracy about x, y and z, with its sign: attained minus commanded, rad.
    pub ap_rad: [f64; 3],
    /// Repeatability about x, y and z, rad.
    pub rp_rad: [f64; 3],
}

/// Accuracy and repeatability at a pose.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PoseStatistics {
    /// Number of the pose, from 1.
    pub pose: u32,
    /// Number of measurements `n`.
    pub count: usize,
    /// Commanded position, m.
    pub commanded_m: [f64; 3],
    /// Mean of the attained positions (the standard's barycentre), m.
    pub mean_m: [f64; 3],
    /// `AP = |mean - commanded|`, m.
    pub ap_m: f64,
    /// Its components, mean minus commanded, m.
    pub ap_xyz_m: [f64; 3],
    /// Mean distance of the attained positions from their mean, m.
    pub mean_distance_m: f64,
    /// Standard deviation of these distances, by `n - 1`, m.
    pub distance_deviation_m: f64,
    /// `RP = mean distance + 3 standard deviations`, m.
    pub rp_m: f64,
    /// Of the orientation, where all measurements and the command have one.
    pub angles: Option<AngleStatistics>,
    /// All measurements are equal, bit for bit: nothing random acted.
    pub identical: bool,
}

/// Variation of the accuracy over three perpendicular approaches at a pose.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DirectionalVariation {
    /// Number of the pose, from 1.
    pub pose: u32,
    /// Number of measurements per direction.
    pub count: [usize; 3],
    /// Mean of the attained positions per direction, m.
    pub mean_m: [[f64; 3]; 3],
    /// `vAP`: largest distance between two of the means, m.
    pub vap_m: f64,
    /// The two directions it is between.
    pub between: [&'static str; 2],
    /// Largest difference of the mean rotations about x, y and z, rad, where they are known.
    pub vap_rad: Option<[f64; 3]>,
}

/// All statistics of a set of measurements.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProtocolStatistics {
    /// By pose, in ascending order.
    pub poses: Vec<PoseStatistics>,
    /// By pose, for those that were approached along all three axes.
    pub directional: Vec<DirectionalVariation>,
    /// Largest AP, m.
    pub ap_m: f64,
    /// Largest RP, m.
    pub rp_m: f64,
    /// Largest vAP, m; none if it was not measured.
    pub vap_m: Option<f64>,
    /// All measurements of each pose are equal, bit for bit: RP is 0 because nothing random acted.
    pub nothing_random: bool,
}

/// Evaluates measurements against commanded poses.
///
/// Measurements with an approach axis count for vAP alone, those without for AP and RP alone.
///
/// # Errors
/// A pose that was never commanded; fewer than two measurements of a pose.
pub fn evaluate(
    commanded: &[Commanded],
    attained: &[Attained],
) -> Result<ProtocolStatistics, StatisticsError> {
    let mut numbers: Vec<u32> = attained.iter().map(|each| each.pose).collect();
    numbers.sort_unstable();
    numbers.dedup();
    let (mut poses, mut directional) = (Vec::new(), Vec::new());
    for pose in numbers {
        let command = commanded
            .iter()
            .find(|each| each.pose == pose)
            .ok_or(StatisticsError::NotCommanded { pose })?;
        let along = |axis: Option<usize>| {
            let here = attained.iter();
            let here = here.filter(move |each| each.pose == pose && each.axis == axis);
            here.collect::<Vec<&Attained>>()
        };
        let enough = |found: &[&Attained], direction: String| match found.len() {
            count @ 0..2 => Err(StatisticsError::TooFew {
                pose,
                count,
                direction,
            }),
            _ => Ok(()),
        };
        let plain = along(None);
        if !plain.is_empty() {
            enough(&plain, String::new())?;
            poses.push(pose_statistics(command, &plain));
        }
        let by_axis = [0, 1, 2].map(|axis| along(Some(axis)));
        if by_axis.iter().any(|found| !found.is_empty()) {
            for (found, axis) in by_axis.iter().zip(AXES) {
                enough(found, format!(" along {axis}"))?;
            }
            directional.push(directional_variation(command, &by_axis));
        }
    }
    if poses.is_empty() {
        return Err(StatisticsError::NoPlainSequence);
    }
    let largest = |value: fn(&PoseStatistics) -> f64| poses.iter().map(value).fold(0.0, f64::max);
    Ok(ProtocolStatistics {
        ap_m: largest(|each| each.ap_m),
        rp_m: largest(|each| each.rp_m),
        vap_m: directional.iter().map(|each| each.vap_m).reduce(f64::max),
        nothing_random: poses.iter().all(|each| each.identical),
        poses,
        directional,
    })
}

pub(super) fn pose_statistics(command: &Commanded, attained: &[&Attained]) -> PoseStatistics {
    let n = attained.len() as f64;
    let mean = mean_position(attained);
    let ap = mean - command.position_m;
    let distances: Vec<f64> = attained
        .iter()
        .map(|each| (each.position_m - mean).norm())
        .collect();
    let mean_distance_m = distances.iter().sum::<f64>() / n;
    let squares = distances
        .iter()
        .map(|distance| (distance - mean_distance_m).powi(2));
    let distance_deviation_m = (squares.sum::<f64>() / (n - 1.0)).sqrt();
    let angles = rotations(command, attained).map(|rotations| {
        let mean = mean_vector(&rotations);
        let squares = rotations
            .iter()
            .map(|each| (each - mean).component_mul(&(each - mean)));
        let deviation = (squares.sum::<Vector3<f64>>() / (n - 1.0)).map(f64::sqrt);
        AngleStatistics {
            ap_rad: mean.into(),
            rp_rad: (deviation * 3.0).into(),
        }
    });
    PoseStatistics {
        pose: command.pose,
        count: attained.len(),
        commanded_m: command.position_m.coords.into(),
        mean_m: mean.coords.into(),
        ap_m: ap.norm(),
        ap_xyz_m: ap.into(),
        mean_distance_m,
        distance_deviation_m,
        rp_m: mean_distance_m + 3.0 * distance_deviation_m,
        angles,
        identical: attained.iter().all(|each| {
            each.position_m == attained[0].position_m && each.orientation == attained[0].orientation
        }),
    }
}

fn directional_variation(
    command: &Commanded,
    by_axis: &[Vec<&Attained>; 3],
) -> DirectionalVariation {
    let means = [0, 1, 2].map(|axis| mean_position(&by_axis[axis]));
    let mut between = [AXES[0], AXES[1]];
    let mut vap_m = 0.0;
    for (h, k) in [(0, 1), (0, 2), (1, 2)] {
        let distance_m = (means[h] - means[k]).norm();
        if distance_m > vap_m {
            vap_m = distance_m;
            between = [AXES[h], AXES[k]];
        }
    }
    let mean_rotations: Option<Vec<Vector3<f64>>> = by_axis
        .iter()
        .map(|attained| rotations(command, attained).map(|each| mean_vector(&each)))
        .collect();
    let vap_rad = mean_rotations.map(|means| {
        [0, 1, 2].map(|angle| {
            let values = means.iter().map(|mean| mean[angle]);
            let (low, high) = (
                values.clone().fold(f64::INFINITY, f64::min),
                values.fold(f64::NEG_INFINITY, f64::max),
            );
            high - low
        })
    });
    DirectionalVariation {
        pose: command.pose,
        count: [0, 1, 2].map(|axis| by_axis[axis].len()),
        mean_m: means.map(|mean| mean.coords.into()),
        vap_m,
        between,
        vap_rad,
    }
}

/// Small rotations from the commanded to the attained orientations, base frame, rad.
fn rotations(command: &Commanded, attained: &[&Attained]) -> Option<Vec<Vector3<f64>>> {
    let from_commanded = command.orientation?.inverse();
    attained
        .iter()
        .map(|each| Some(rotation_vector(&(each.orientation? * from_commanded))))
        .collect()
}

fn mean_position(attained: &[&Attained]) -> Point3<f64> {
    let first = attained[0].position_m;
    let offsets: Vec<Vector3<f64>> = attained
        .iter()
        .map(|each| each.position_m - first)
        .collect();
    first + mean_vector(&offsets)
}

/// Mean of vectors, at least one, relative to the first, so that the mean of equal vectors is that vector exactly.
pub fn mean_vector(vectors: &[Vector3<f64>]) -> Vector3<f64> {
    let first = vectors[0];
    let sum: Vector3<f64> = vectors.iter().map(|each| each - first).sum();
    first + sum / vectors.len() as f64
}
