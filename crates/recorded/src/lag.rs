//! How an arm follows its set-points.

use nalgebra::{Point3, Vector3};
use needlebench_kinematics::{Chain, JOINT_COUNT, Joints};
use serde::Serialize;

use crate::regression::{BLOCKS, Estimate, jackknife, spans};

/// Speed above which a joint moves, rad/s.
const MOVING_RAD_S: f64 = 0.05;

/// A lag that is known no better is not known, s.
const COARSEST_S: f64 = 1e-3;

/// How one course follows another, per joint and at a tip.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Tracking {
    /// Root mean square of the difference of each joint, rad.
    pub rms_rad: [f64; JOINT_COUNT],
    /// Largest difference of each joint, rad.
    pub largest_rad: [f64; JOINT_COUNT],
    /// Time by which each joint is behind, s.
    pub lag_s: [Estimate; JOINT_COUNT],
    /// The same of all joints together, s.
    pub lag_of_all_s: Estimate,
    /// Root mean square of the difference of each joint while all set-points stand, rad; none where
    /// they never do.
    pub standing_rms_rad: Option<[f64; JOINT_COUNT]>,
    /// Rows in which all set-points stand.
    pub standing_rows: usize,
    /// Root mean square and largest distance of the tip from where the set-points would have it, m.
    pub tip_rms_m: f64,
    /// Largest such distance, m.
    pub tip_largest_m: f64,
    /// The two while all set-points stand, m.
    pub standing_tip_rms_m: Option<f64>,
    /// Largest such distance, m.
    pub standing_tip_largest_m: Option<f64>,
}

/// How `actual` follows set-points `target` that move at `speed`; the tip is a point of the flange's
/// frame of an arm `chain`, m.
///
/// The lag of a joint is the slope of its error over its speed, with an intercept of its own; rows with
/// the joint below 0.05 rad/s do not count. Intervals are of 95 %, by leaving out a twentieth of the
/// run at a time.
///
/// # Panics
/// If the lists differ in length.
pub fn tracking(
    chain: &Chain,
    tip_in_flange_m: &Vector3<f64>,
    target: &[Joints],
    speed: &[Joints],
    actual: &[Joints],
) -> Tracking {
    assert!(target.len() == actual.len() && speed.len() == actual.len());
    let count = actual.len();
    let mut square = Joints::zeros();
    let mut largest = Joints::zeros();
    let mut standing = (Joints::zeros(), 0_usize, 0.0, 0.0_f64);
    let (mut tip_square, mut tip_largest) = (0.0, 0.0_f64);
    // Sums of speed, error, speed squared, their product, and the number, by block and joint.
    let mut sums = [[[0.0; 5]; JOINT_COUNT]; BLOCKS];
    let tip = |q: &Joints| chain.base_link_from_flange(q) * Point3::from(*tip_in_flange_m);
    for (block, rows) in spans(count).into_iter().enumerate() {
        for row in rows {
            let off = actual[row] - target[row];
            square += off.component_mul(&off);
            largest = largest.sup(&off.abs());
            let off_tip_m = (tip(&actual[row]) - tip(&target[row])).norm();
            tip_square += off_tip_m * off_tip_m;
            tip_largest = tip_largest.max(off_tip_m);
            if speed[row] == Joints::zeros() {
                standing.0 += off.component_mul(&off);
                standing.1 += 1;
                standing.2 += off_tip_m * off_tip_m;
                standing.3 = standing.3.max(off_tip_m);
            }
            for joint in 0..JOINT_COUNT {
                let v = speed[row][joint];
                if v.abs() > MOVING_RAD_S {
                    let sums = &mut sums[block][joint];
                    let e = off[joint];
                    for (sum, value) in sums.iter_mut().zip([v, e, v * v, v * e, 1.0]) {
                        *sum += value;
                    }
                }
            }
        }
    }
    let slope_parts = |joint: usize, without: Option<usize>| -> [f64; 2] {
        let mut total = [0.0; 5];
        for (block, sums) in sums.iter().enumerate() {
            if Some(block) != without {
                for (sum, value) in total.iter_mut().zip(sums[joint]) {
                    *sum += value;
                }
            }
        }
        let [v, e, vv, ve, n] = total;
        if n < 2.0 {
            return [0.0; 2];
        }
        [-(ve - v * e / n), vv - v * v / n]
    };
    let lag = |joints: &[usize]| {
        let of = |without| {
            let parts = joints.iter().map(|joint| slope_parts(*joint, without));
            let [up, down] = parts.fold([0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
            (down > 0.0).then(|| up / down)
        };
        jackknife(&of).within(COARSEST_S, 0.0)
    };
    let mean = |square: f64, count: usize| (square / count.max(1) as f64).sqrt();
    let (standing_square, standing_rows, standing_tip, standing_tip_largest) = standing;
    let stands = standing_rows > 0;
    Tracking {
        rms_rad: square.map(|each| mean(each, count)).into(),
        largest_rad: largest.into(),
        lag_s: std::array::from_fn(|joint| lag(&[joint])),
        lag_of_all_s: lag(&[0, 1, 2, 3, 4, 5]),
        standing_rms_rad: stands
            .then(|| standing_square.map(|each| mean(each, standing_rows)).into()),
        standing_rows,
        tip_rms_m: mean(tip_square, count),
        tip_largest_m: tip_largest,
        standing_tip_rms_m: stands.then(|| mean(standing_tip, standing_rows)),
        standing_tip_largest_m: stands.then_some(standing_tip_largest),
    }
}
