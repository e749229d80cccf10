//! Position stabilisation time and overshoot.

use serde::Serialize;

/// How the measured point came to rest at a pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Arrival {
    /// Number of the pose, from 1.
    pub pose: u32,
    /// Number of the cycle, from 1.
    pub cycle: u32,
    /// Time from the end of the planned motion, s; negative before it.
    pub time_s: Vec<f64>,
    /// Distance of the measured point from the attained position, m, at these times.
    pub distance_m: Vec<f64>,
}

/// Stabilisation of one arrival.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Stabilisation {
    /// From the first entry into the limit band until the point stays in it, s; the standard's
    /// position stabilisation time. To the next sample.
    pub time_s: f64,
    /// From the end of the planned motion until the point stays in the band, s; negative if it did
    /// before.
    pub after_motion_s: f64,
    /// Largest distance from the attained position after the first entry into the band, m; 0 if
    /// the point never leaves it again, as the standard has it.
    pub overshoot_m: f64,
}

/// Stabilisation time and overshoot of an arrival for a band of half-width `limit_band_m`.
///
/// None if the last sample is not in the band: the stand was too short, or the attained position
/// is not where the point came to rest.
pub fn stabilisation(arrival: &Arrival, limit_band_m: f64) -> Option<Stabilisation> {
    let inside = |distance_m: &f64| *distance_m <= limit_band_m;
    let first = arrival.distance_m.iter().position(inside)?;
    let last_outside = arrival.distance_m.iter().rposition(|each| !inside(each));
    let settled = last_outside.map_or(0, |index| index + 1);
    let settled_s = arrival.time_s.get(settled)?;
    let largest_m = arrival.distance_m[first..]
        .iter()
        .copied()
        .fold(0.0, f64::max);
    Some(Stabilisation {
        time_s: settled_s - arrival.time_s[first],
        after_motion_s: *settled_s,
        overshoot_m: if largest_m > limit_band_m {
            largest_m
        } else {
            0.0
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arrival(distance_m: &[f64]) -> Arrival {
        Arrival {
            pose: 1,
            cycle: 1,
            time_s: (0..distance_m.len())
                .map(|k| 0.1 * k as f64 - 0.2)
                .collect(),
            distance_m: distance_m.to_vec(),
        }
    }

    #[test]
    fn a_point_that_stays_in_the_band_has_neither_time_nor_overshoot() {
        let found = stabilisation(&arrival(&[9.0, 4.0, 0.9, 0.3, 0.0]), 1.0).unwrap();
        assert_eq!((found.time_s, found.overshoot_m), (0.0, 0.0));
        assert!(found.after_motion_s.abs() < 1e-15);
    }

    #[test]
    fn a_point_that_swings_through_the_band_is_timed_from_its_first_entry() {
        let found = stabilisation(&arrival(&[9.0, 0.8, 2.5, 0.9, 1.4, 0.2, 0.0]), 1.0).unwrap();
        assert!((found.time_s - 0.4).abs() < 1e-15);
        assert!((found.after_motion_s - 0.3).abs() < 1e-15);
        assert_eq!(found.overshoot_m, 2.5);
    }

    #[test]
    fn a_point_that_is_outside_at_the_end_has_not_settled() {
        assert_eq!(stabilisation(&arrival(&[9.0, 0.8, 2.5]), 1.0), None);
        assert_eq!(stabilisation(&arrival(&[]), 1.0), None);
    }
}
