//! Families of postures where wrist 3 is free.
//!
//! At `q5 = 0` or pi the axes of wrist 1 and wrist 3 are parallel, and a pose determines only
//! `q2 + q3 + q4 -+ q6`. As `q6` turns, wrist 1 runs on a circle of radius `d5` about the wrist
//! centre, so that its distance from the shoulder is a cosine and the values of `q6` that leave the
//! elbow reachable are two intervals, mirror images of one another.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::super::{Elbow, Shoulder, wrap_angle};
use crate::{JOINT_COUNT, JointLimits, Joints, UrGeometry};

/// All postures of one shoulder at a pose that leaves wrist 3 free.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FreeWrist {
    /// Side of the shoulder.
    pub shoulder: Shoulder,
    /// Shoulder pan, the same in all members, rad.
    pub q1_rad: f64,
    /// Wrist 2: 0 or pi.
    pub q5_rad: f64,
    /// +1 or -1: `q2 + q3 + q4 = sum_at_zero_rad + turn * q6`.
    pub turn: f64,
    /// `q2 + q3 + q4` for `q6 = 0`, rad.
    pub sum_at_zero_rad: f64,
    geometry: UrGeometry,
    /// Wrist centre ahead of and above the shoulder, m.
    centre_m: (f64, f64),
    /// Least and greatest angle at the wrist centre between the shoulder's opposite direction and
    /// wrist 1 for which the elbow closes, rad; `None` if it never does.
    opening: Option<(f64, f64)>,
}

impl FreeWrist {
    /// `ahead` and `up` components of the wrist centre, and of the rotation's columns `n` and `o`.
    pub(super) fn new(
        geometry: &UrGeometry,
        shoulder: Shoulder,
        q1_rad: f64,
        q5_rad: f64,
        centre_m: (f64, f64),
        n: (f64, f64),
        o: (f64, f64),
    ) -> Self {
        let distance = libm::hypot(centre_m.0, centre_m.1);
        let d5 = geometry.d5.abs();
        // Cosine of the opening at which wrist 1 is `length` from the shoulder.
        let cosine =
            |length: f64| (length.powi(2) - distance.powi(2) - d5.powi(2)) / (2.0 * distance * d5);
        let angle_of = |cosine: f64| {
            let cosine = cosine.clamp(-1.0, 1.0);
            libm::atan2(((1.0 - cosine) * (1.0 + cosine)).sqrt(), cosine)
        };
        let (longest, shortest) = (
            (geometry.a2 + geometry.a3).abs(),
            (geometry.a2 - geometry.a3).abs(),
        );
        let opening = if distance * d5 < f64::EPSILON {
            (shortest..=longest)
                .contains(&distance.max(d5))
                .then_some((0.0, PI))
        } else if cosine(longest) < -1.0 - 1e-13 || cosine(shortest) > 1.0 + 1e-13 {
            None
        } else {
            Some((angle_of(cosine(longest)), angle_of(cosine(shortest))))
        };
        Self {
            shoulder,
            q1_rad,
            q5_rad,
            turn: (o.0 * n.1 - o.1 * n.0).signum(),
            // Wrist 1 lies from the wrist centre along o cos q6 + n sin q6, which stands a quarter
            // turn on from q2 + q3 + q4.
            sum_at_zero_rad: wrap_angle(libm::atan2(o.1, o.0) - FRAC_PI_2),
            geometry: *geometry,
            centre_m,
            opening,
        }
    }

    /// `q2 + q3 + q4` at which wrist 1 lies straight beyond the wrist centre, rad.
    fn sum_straight_rad(&self) -> f64 {
        let beyond = libm::atan2(self.centre_m.1, self.centre_m.0);
        let flipped = if self.geometry.d5 < 0.0 { PI } else { 0.0 };
        beyond - FRAC_PI_2 + flipped
    }

    fn opening_at(&self, q6_rad: f64) -> f64 {
        wrap_angle(self.sum_at_zero_rad + self.turn * q6_rad - self.sum_straight_rad())
    }

    /// Values of `q6` that leave the elbow reachable: none, one or two intervals `(from, to)`,
    /// rad, modulo a whole turn. A full circle is `(-pi, pi)`.
    pub fn intervals_rad(&self) -> impl Iterator<Item = (f64, f64)> {
        let intervals = match self.opening {
            None => [None, None],
            Some((least, most)) if least <= 0.0 && most >= PI => [Some((-PI, PI)), None],
            Some((least, most)) if least <= 0.0 => [Some(self.interval(-most, most)), None],
            Some((least, most)) if most >= PI => [Some(self.interval(least, TAU - least)), None],
            Some((least, most)) => [
                Some(self.interval(least, most)),
                Some(self.interval(-most, -least)),
            ],
        };
        intervals.into_iter().flatten()
    }

    fn interval(&self, from: f64, to: f64) -> (f64, f64) {
        let q6_of =
            |opening: f64| self.turn * (opening + self.sum_straight_rad() - self.sum_at_zero_rad);
        let (a, b) = (q6_of(from), q6_of(to));
        let low = a.min(b);
        let wrapped = wrap_angle(low);
        (wrapped, wrapped + (b - a).abs())
    }

    /// The value of `q6` nearest to `wanted_rad`, turned either way, that leaves the elbow
    /// reachable; the ends of an interval, where the elbow is singular, included.
    pub fn nearest_q6(&self, wanted_rad: f64) -> Option<f64> {
        let (least, most) = self.opening?;
        let opening = self.opening_at(wanted_rad);
        let reachable = opening.abs().clamp(least, most).copysign(opening);
        Some(wrap_angle(wanted_rad + self.turn * (reachable - opening)))
    }

    /// The member with a given `q6`, rad; an elbow that does not close is clamped.
    pub fn member(&self, elbow: Elbow, q6_rad: f64) -> Joints {
        let sum = self.sum_at_zero_rad + self.turn * q6_rad;
        let (s, c) = libm::sincos(sum);
        let ahead = self.centre_m.0 - self.geometry.d5 * s;
        let up = self.centre_m.1 + self.geometry.d5 * c;
        let sign = elbow.sign(self.shoulder);
        let (q2, q3) = self.geometry.elbow(ahead, up, sign);
        Joints::from_column_slice(
            &[self.q1_rad, q2, q3, sum - q2 - q3, self.q5_rad, q6_rad].map(wrap_angle),
        )
    }

    /// The value of `q6` nearest to `wanted_rad` whose member, or a 2π equivalent of it, is inside the joint limits.
    /// Found on a grid of one degree, then bisected.
    pub fn nearest_q6_within(
        &self,
        elbow: Elbow,
        wanted_rad: f64,
        limits: &JointLimits,
    ) -> Option<f64> {
        let start = self.nearest_q6(wanted_rad)?;
        let inside = |q6: f64| {
            self.nearest_q6(q6)
                .is_some_and(|reachable| wrap_angle(reachable - q6).abs() < 1e-9)
                && within_some_turn(limits, &self.member(elbow, q6))
        };
        if inside(start) {
            return Some(start);
        }
        let step = 1.0_f64.to_radians();
        for count in 1..=180 {
            for way in [1.0, -1.0] {
                let q6 = start + way * step * f64::from(count);
                if inside(q6) {
                    // The end of the forbidden stretch lies within the last step.
                    let (mut outside, mut within) = (q6 - way * step, q6);
                    for _ in 0..40 {
                        let middle = 0.5 * (outside + within);
                        if inside(middle) {
                            within = middle;
                        } else {
                            outside = middle;
                        }
                    }
                    return Some(wrap_angle(within));
                }
            }
        }
        None
    }
}

/// Every joint has a whole-turn equivalent inside its limits.
fn within_some_turn(limits: &JointLimits, q: &Joints) -> bool {
    (0..JOINT_COUNT).all(|i| {
        let limit = &limits.0[i];
        let lowest = q[i] + TAU * ((limit.lower_rad - q[i]) / TAU).ceil();
        limit.lower_rad == f64::NEG_INFINITY || lowest <= limit.upper_rad
    })
}
