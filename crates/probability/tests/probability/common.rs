//! Laws of entry and tip, bends and failed holds.

use nalgebra::{Matrix6, Vector2, Vector3, Vector6};
use needlebench_numerics::random::SplitMix64;
use needlebench_probability::{Bend, BendDirection, Hold, Law, Part};

/// Covariance of entry and tip from their standard deviations in m and the correlation of the same axes.
pub fn correlated(entry_sd_m: [f64; 3], tip_sd_m: [f64; 3], correlation: f64) -> Matrix6<f64> {
    let sds: [f64; 6] = std::array::from_fn(|k| {
        if k < 3 {
            entry_sd_m[k]
        } else {
            tip_sd_m[k - 3]
        }
    });
    Matrix6::from_fn(|row, column| {
        let share = if row == column {
            1.0
        } else if row % 3 == column % 3 {
            correlation
        } else {
            0.0
        };
        share * sds[row] * sds[column]
    })
}

pub fn part(name: &str, covariance_m2: &Matrix6<f64>) -> Part {
    Part {
        name: name.to_owned(),
        covariance_m2: *covariance_m2,
    }
}

pub fn linear(mean_m: Vector6<f64>, covariance_m2: &Matrix6<f64>) -> Law {
    Law::new(mean_m, vec![part("arm", covariance_m2)], None, Vec::new()).unwrap()
}

/// Bends that grow with the square of the depth, sizes at the tip lognormal about a median, m, towards y.
pub fn bends(median_m: f64, count: u32) -> Vec<Vec<Vector2<f64>>> {
    let mut random = SplitMix64::new(5);
    (0..count)
        .map(|_| {
            let size_m = median_m * libm::exp(0.4 * random.standard_normal());
            let curve = (0..=10).map(|k| Vector2::new(size_m * f64::from(k * k) / 100.0, 0.0));
            curve.collect()
        })
        .collect()
}

pub fn tenths() -> Vec<f64> {
    (0..=10).map(|k| f64::from(k) / 10.0).collect()
}

pub fn quadratic(median_m: f64, direction: BendDirection) -> Bend {
    Bend::new(tenths(), bends(median_m, 512), direction).unwrap()
}

/// 5 % of holds fail, with this displacement of both bodies at a full breath.
pub fn failing(level_sd_m: Vector3<f64>, full_m: Vector3<f64>) -> Vec<Hold> {
    let held = Hold {
        weight: 0.95,
        level_sd_m: [level_sd_m; 2],
        ..Hold::still(0.0)
    };
    let failed = Hold {
        weight: 0.05,
        failed_m: Some([full_m; 2]),
        ..held.clone()
    };
    vec![held, failed]
}
