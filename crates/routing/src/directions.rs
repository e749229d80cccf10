//! Directions about a target.

use std::f64::consts::{PI, TAU};

use nalgebra::{Rotation3, UnitVector3, Vector3};

/// Directions evenly over the sphere: a spiral of the golden angle.
pub fn evenly(count: usize) -> impl Iterator<Item = UnitVector3<f64>> {
    let golden = PI * (3.0 - 5.0_f64.sqrt());
    (0..count).map(move |index| {
        let z = 1.0 - (2 * index + 1) as f64 / count as f64;
        let across = (1.0 - z * z).max(0.0).sqrt();
        let (sin, cos) = libm::sincos(golden * index as f64 % TAU);
        UnitVector3::new_normalize(Vector3::new(across * sin, across * cos, z))
    })
}

/// Azimuth (0 to the front, positive to the patient's left) and elevation (to the head) of a direction, rad: as
/// `entry_direction_deg` has them.
pub fn angles_rad(outwards: &UnitVector3<f64>) -> [f64; 2] {
    [
        libm::atan2(outwards.x, -outwards.y),
        libm::atan2(outwards.z, libm::hypot(outwards.x, outwards.y)),
    ]
}

/// The direction of an azimuth and an elevation, rad.
pub fn outwards([azimuth, elevation]: [f64; 2]) -> UnitVector3<f64> {
    needlebench_scenario::direction(azimuth, elevation)
}

/// Directions on a ring about one, so far from it, rad.
pub fn around(
    centre: &UnitVector3<f64>,
    angle_rad: f64,
    count: usize,
) -> impl Iterator<Item = UnitVector3<f64>> {
    let centre = *centre;
    let aside = if centre.z.abs() < 0.9 {
        Vector3::z()
    } else {
        Vector3::x()
    };
    let across = UnitVector3::new_normalize(centre.cross(&aside));
    let tilted = Rotation3::from_axis_angle(&across, angle_rad) * centre;
    (0..count).map(move |index| {
        let turn = TAU * index as f64 / count as f64;
        Rotation3::from_axis_angle(&centre, turn) * tilted
    })
}

/// Picks items, the first ones before all others, so that any two picked are at least an angle apart; at most so many.
/// The angle starts at `least_rad` and grows by a quarter until that many are enough.
pub fn apart<T>(
    items: &[T],
    direction: impl Fn(&T) -> UnitVector3<f64>,
    least_rad: f64,
    most: usize,
) -> Vec<usize> {
    let mut angle_rad = least_rad;
    loop {
        let cosine = libm::cos(angle_rad);
        let mut picked: Vec<(usize, UnitVector3<f64>)> = Vec::new();
        for (index, item) in items.iter().enumerate() {
            let here = direction(item);
            if picked.iter().all(|(_, other)| other.dot(&here) <= cosine) {
                picked.push((index, here));
                if picked.len() > most {
                    break;
                }
            }
        }
        if picked.len() <= most {
            return picked.into_iter().map(|(index, _)| index).collect();
        }
        angle_rad *= 1.25;
    }
}
