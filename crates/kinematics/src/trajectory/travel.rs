//! Bounds on what the joints do between two moments of a trajectory.
//!
//! Proven, not sampled. A straight course follows a monotone profile, so its joints travel what
//! lies between the ends. A line's joints are quintics of the distance, those between set-points of
//! the time; in Bernstein form on the part of a quintic that is passed, `q(v) = sum b_i B_i(v)`, two
//! facts bound them:
//!
//! - `q' = 5 sum (b_{i+1} - b_i) B_i`, each basis polynomial of degree four is not negative and
//!   has the integral 1/5, so the path is no longer than `sum |b_{i+1} - b_i|`;
//! - a linear function has evenly spaced coefficients and the basis sums to one, so `q` is no
//!   farther from it than the largest difference of the coefficients.
//!
//! Both are exact in the limit of short parts: for a joint that does not turn back the first is
//! the difference of the ends.

use super::{Course, JointPath, JointTrajectory, Segment};
use crate::Joints;

/// Added to a bound that is not zero, rad: a hundred times the rounding of positions of ten turns,
/// which is what sampling the ends of an interval and summing coefficients leaves.
const ROUNDING_RAD: f64 = 1e-12;

/// Time by which an interval may reach over the ends of a segment and still count as inside, s:
/// rounding of sums of durations.
const TIME_SLACK_S: f64 = 1e-9;

impl JointTrajectory {
    /// Upper bound of the way that each joint travels between two times, rad: its path length,
    /// turning back included. Zero for a joint that rests.
    ///
    /// The order of the times does not matter; there is no travel before the start and after the
    /// end. Exact but for 1e-12 rad on straight courses and on the parts of a line where a joint
    /// does not turn back.
    pub fn travel(&self, from_s: f64, to_s: f64) -> Joints {
        let (from_s, to_s) = (from_s.min(to_s), from_s.max(to_s));
        self.segments
            .iter()
            .filter(|segment| segment.start_s < to_s && from_s < segment.end_s())
            .map(|segment| segment.travel(from_s, to_s))
            .sum()
    }

    /// Upper bound of the distance of each joint from the chord between two times, rad.
    ///
    /// For every time between there is a fraction in `[0, 1]`, the same for all joints, so that
    /// each joint is no farther than this from `from + fraction * (to - from)`. Zero for straight
    /// courses, of second order in the interval along lines, and half the travel for intervals
    /// that are not within one segment.
    pub fn chord_deviation(&self, from_s: f64, to_s: f64) -> Joints {
        let (from_s, to_s) = (from_s.min(to_s), from_s.max(to_s));
        let inside = self.segment_at(0.5 * (from_s + to_s)).filter(|segment| {
            segment.start_s - TIME_SLACK_S <= from_s && to_s <= segment.end_s() + TIME_SLACK_S
        });
        match inside {
            Some(segment) => segment.chord_deviation(from_s, to_s),
            // Both ends together are no farther from any point of the way than its length.
            None => self.travel(from_s, to_s) * 0.5,
        }
    }
}

impl Segment {
    fn end_s(&self) -> f64 {
        self.start_s + self.duration_s
    }

    fn local_s(&self, time_s: f64) -> f64 {
        (time_s - self.start_s).clamp(0.0, self.duration_s)
    }

    fn travel(&self, from_s: f64, to_s: f64) -> Joints {
        let (from_s, to_s) = (self.local_s(from_s), self.local_s(to_s));
        match &self.course {
            Course::Straight { delta, profile, .. } => {
                let fraction = profile.sample(to_s).position - profile.sample(from_s).position;
                padded(&(delta.abs() * fraction.max(0.0)))
            }
            Course::Path {
                path,
                profile,
                time_scale,
            } => {
                let s_m = |time_s: f64| profile.sample(time_s / time_scale).position;
                padded(&path.travel(s_m(from_s), s_m(to_s)))
            }
            Course::Hold { .. } => Joints::zeros(),
            Course::Slowing(slowing) => slowing.travel(from_s, to_s),
            Course::Sampled(path) => padded(&path.travel(from_s, to_s)),
        }
    }

    fn chord_deviation(&self, from_s: f64, to_s: f64) -> Joints {
        let (from_s, to_s) = (self.local_s(from_s), self.local_s(to_s));
        match &self.course {
            // `from + fraction * delta` with a monotone fraction is the chord itself.
            Course::Straight { .. } | Course::Hold { .. } => Joints::zeros(),
            Course::Path {
                path,
                profile,
                time_scale,
            } => {
                let s_m = |time_s: f64| profile.sample(time_s / time_scale).position;
                padded(&path.chord_deviation(s_m(from_s), s_m(to_s)))
            }
            Course::Slowing(slowing) => slowing.chord_deviation(from_s, to_s),
            Course::Sampled(path) => padded(&path.chord_deviation(from_s, to_s)),
        }
    }
}

/// A bound with its rounding; joints that rest stay at zero.
fn padded(bound: &Joints) -> Joints {
    bound.map(|each| if each > 0.0 { each + ROUNDING_RAD } else { 0.0 })
}

impl JointPath {
    /// Upper bound of each joint's path length between two distances, rad.
    fn travel(&self, from_m: f64, to_m: f64) -> Joints {
        self.parts(from_m, to_m)
            .map(|part| {
                part.bernstein
                    .windows(2)
                    .map(|pair| (pair[1] - pair[0]).abs())
                    .sum::<Joints>()
            })
            .sum()
    }

    /// Upper bound of each joint's distance from the chord between two distances, rad; the
    /// fraction is that of the distance.
    fn chord_deviation(&self, from_m: f64, to_m: f64) -> Joints {
        let (from, to) = (self.sample(from_m).position, self.sample(to_m).position);
        let length_m = to_m - from_m;
        let mut most = Joints::zeros();
        if length_m <= 0.0 {
            return most;
        }
        for part in self.parts(from_m, to_m) {
            let first = (part.from_m - from_m) / length_m;
            let step = (part.to_m - part.from_m) / (5.0 * length_m);
            for (i, coefficient) in part.bernstein.iter().enumerate() {
                let fraction = first + step * i as f64;
                let chord = from + (to - from) * fraction;
                most = most.sup(&(coefficient - chord).abs());
            }
        }
        most
    }

    /// The path between two distances, cut at the knots.
    fn parts(&self, from_m: f64, to_m: f64) -> impl Iterator<Item = Part> + '_ {
        let (first, last) = (self.interval_at(from_m), self.interval_at(to_m));
        (first..=last).filter_map(move |index| {
            let (start_m, end_m) = self.interval(index);
            let h = end_m - start_m;
            // The ends of the line belong to the outer quintics, whatever rounding says.
            let u0 = ((from_m - start_m) / h).clamp(0.0, 1.0);
            let u1 = ((to_m - start_m) / h).clamp(0.0, 1.0);
            (u1 > u0).then(|| Part {
                from_m: start_m + u0 * h,
                to_m: start_m + u1 * h,
                bernstein: bernstein(&self.coefficients(index), u0, u1),
            })
        })
    }
}

/// Part of one quintic of a line.
struct Part {
    from_m: f64,
    to_m: f64,
    bernstein: [Joints; 6],
}

/// Bernstein coefficients on `[u0, u1]` of a quintic that is given by rising powers of `u`.
fn bernstein(powers: &[Joints; 6], u0: f64, u1: f64) -> [Joints; 6] {
    // Powers of `v` with `u = u0 + (u1 - u0) v`, by repeated synthetic division.
    let mut shifted = *powers;
    for first in 0..5 {
        for k in (first..5).rev() {
            let higher = shifted[k + 1];
            shifted[k] += higher * u0;
        }
    }
    let mut scale = 1.0;
    for coefficient in &mut shifted {
        *coefficient *= scale;
        scale *= u1 - u0;
    }
    // `v^k = sum_i C(i, k) / C(5, k) B_i(v)`.
    std::array::from_fn(|i| {
        (0..=i)
            .map(|k| shifted[k] * (BINOMIAL[i][k] / BINOMIAL[5][k]))
            .sum()
    })
}

/// `BINOMIAL[n][k]`, n over k.
const BINOMIAL: [[f64; 6]; 6] = [
    [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [1.0, 1.0, 0.0, 0.0, 0.0, 0.0],
    [1.0, 2.0, 1.0, 0.0, 0.0, 0.0],
    [1.0, 3.0, 3.0, 1.0, 0.0, 0.0],
    [1.0, 4.0, 6.0, 4.0, 1.0, 0.0],
    [1.0, 5.0, 10.0, 10.0, 5.0, 1.0],
];

#[cfg(test)]
mod tests {
    use nalgebra::{UnitVector3, Vector3};

    use super::super::{Between, JointState, MotionLimits, Phase, ProfileLimits};
    use super::*;
    use crate::{JOINT_COUNT, UrGeometry};
    use needlebench_numerics::random::SplitMix64;

    /// A bound may be this much longer than the way, relatively: what is left of the coefficients'
    /// polygon around a turning point.
    const LOOSE: f64 = 0.03;

    /// Slack of that comparison where a joint hardly moves, rad.
    const LOOSE_RAD: f64 = 1e-5;

    fn motions() -> Vec<JointTrajectory> {
        let limits = MotionLimits {
            velocity: Joints::repeat(1.0),
            acceleration: Joints::repeat(1.4),
            jerk: Joints::repeat(10.0),
            line: ProfileLimits {
                velocity: 0.05,
                acceleration: 0.2,
                jerk: 1.0,
            },
        };
        let chain = UrGeometry::UR3.chain();
        let mut random = SplitMix64::new(31);
        let planned: Vec<JointTrajectory> = (0..6)
            .map(|_| {
                let posture = Joints::from_column_slice(&[-0.7, -2.2, -1.9, 0.1, 1.3, 0.1])
                    + Joints::from_fn(|_, _| random.uniform(-0.2, 0.2));
                let direction = Vector3::from_fn(|_, _| random.uniform(-1.0, 1.0));
                let direction = UnitVector3::new_normalize(direction);
                let line = JointPath::line_ending_at(&chain, &posture, &direction, 0.12)
                    .expect("the line is in the workspace");
                let start = Joints::from_fn(|_, _| random.uniform(-2.0, 2.0));
                JointTrajectory::starting_at(start)
                    .then_straight_to(Phase::Transfer, line.start(), &limits)
                    .then_along(Phase::Approach, line, &limits)
                    .then_hold(Phase::Hold, 0.5)
            })
            .collect();
        let joined = [Between::Quintics, Between::Cubics, Between::Quintics];
        let set_points = joined.into_iter().zip(&planned);
        let set_points = set_points.map(|(between, motion)| of_set_points(motion, between));
        let mut all: Vec<JointTrajectory> = set_points.collect();
        all.extend(planned);
        all
    }

    /// The same motion by its set-points every 20 ms.
    fn of_set_points(motion: &JointTrajectory, between: Between) -> JointTrajectory {
        let start = JointTrajectory::starting_at(motion.sample(0.0).position);
        let parts = motion.phases().into_iter();
        parts.fold(start, |whole, (phase, start_s, end_s)| {
            let count = ((end_s - start_s) / 0.02).ceil();
            let times_s: Vec<f64> = (0..10_000)
                .map(f64::from)
                .take_while(|k| *k <= count)
                .map(|k| start_s + (end_s - start_s) * k / count)
                .collect();
            let states: Vec<JointState> = times_s.iter().map(|t| motion.sample(*t)).collect();
            let part = JointTrajectory::sampled(phase, between, &times_s, &states);
            whole.followed_by(part.expect("times increase"))
        })
    }

    fn intervals(trajectory: &JointTrajectory) -> Vec<(f64, f64)> {
        let mut random = SplitMix64::new(5);
        let duration_s = trajectory.duration_s();
        let mut intervals: Vec<_> = (0..60)
            .map(|k| {
                let from_s = random.uniform(-0.1, duration_s);
                let length_s = duration_s * 0.5_f64.powi(k % 12);
                (from_s, from_s + length_s)
            })
            .collect();
        let phases = trajectory.phases();
        intervals.extend(phases.iter().map(|&(_, start_s, end_s)| (start_s, end_s)));
        intervals
    }

    /// Sums of distances of so many samples are within 1e-5 of a smooth path's length.
    const SAMPLES: u32 = 1500;

    fn samples(trajectory: &JointTrajectory, from_s: f64, to_s: f64) -> Vec<Joints> {
        (0..=SAMPLES)
            .map(|k| from_s + (to_s - from_s) * f64::from(k) / f64::from(SAMPLES))
            .map(|time_s| trajectory.sample(time_s).position)
            .collect()
    }

    #[test]
    fn no_joint_travels_farther_than_its_bound_nor_much_less() {
        for trajectory in motions() {
            for (from_s, to_s) in intervals(&trajectory) {
                let bound = trajectory.travel(from_s, to_s);
                let travelled: Joints = samples(&trajectory, from_s, to_s)
                    .windows(2)
                    .map(|pair| (pair[1] - pair[0]).abs())
                    .sum();
                for i in 0..JOINT_COUNT {
                    // A thousand differences, each rounded.
                    assert!(
                        travelled[i] <= bound[i] + 1e-12,
                        "joint {i} {from_s} {to_s}"
                    );
                    assert!(
                        bound[i] <= travelled[i] * (1.0 + LOOSE) + LOOSE_RAD,
                        "joint {i} from {from_s} to {to_s}: {} for {}",
                        bound[i],
                        travelled[i]
                    );
                }
                assert_eq!(bound, trajectory.travel(to_s, from_s));
            }
        }
    }

    /// Least distance, over the chord's fractions, of the joint that is farthest from it in units
    /// of its bound; at most 1 if the bound holds.
    fn off_chord(q: &Joints, from: &Joints, to: &Joints, bound: &Joints) -> f64 {
        let chord = to - from;
        (0..=2000)
            .map(|k| f64::from(k) / 2000.0)
            .map(|fraction| {
                let off = (q - (from + chord * fraction)).abs();
                // Half a step of the fraction, and rounding.
                (off - chord.abs() * 2.6e-4 - Joints::repeat(1e-12))
                    .zip_map(
                        bound,
                        |off, bound| if off <= 0.0 { 0.0 } else { off / bound },
                    )
                    .max()
            })
            .fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn no_posture_is_farther_from_the_chord_than_its_bound() {
        let mut bent = 0;
        for trajectory in motions() {
            for (from_s, to_s) in intervals(&trajectory).into_iter().step_by(5) {
                let bound = trajectory.chord_deviation(from_s, to_s);
                let on_way = samples(&trajectory, from_s, to_s);
                let (from, to) = (on_way[0], on_way[on_way.len() - 1]);
                for q in on_way.iter().step_by(150) {
                    let off = off_chord(q, &from, &to, &bound);
                    assert!(off <= 1.0, "{off} from {from_s} to {to_s}");
                    bent += usize::from(off > 0.1);
                }
            }
        }
        // The bound is near enough to what happens to be refuted if it were ten times smaller.
        assert!(bent > 100, "{bent}");
    }

    #[test]
    fn the_deviation_from_the_chord_is_of_second_order() {
        for trajectory in motions() {
            let (_, start_s, end_s) = trajectory.phases()[1];
            let middle_s = 0.5 * (start_s + end_s);
            let bound = |half_s: f64| {
                let bound = trajectory.chord_deviation(middle_s - half_s, middle_s + half_s);
                bound.amax()
            };
            assert!(bound(0.1) < 0.3 * bound(0.2));
            assert!(bound(0.01) < 0.015 * bound(0.1));
        }
    }

    #[test]
    fn straight_courses_and_rests_do_not_leave_their_chord_and_rests_do_not_travel() {
        let trajectory = &motions()[8];
        let phases = trajectory.phases();
        let (_, from_s, to_s) = phases[0];
        assert_eq!(trajectory.chord_deviation(from_s, to_s), Joints::zeros());
        let (_, from_s, to_s) = phases[2];
        assert_eq!(trajectory.chord_deviation(from_s, to_s), Joints::zeros());
        assert_eq!(trajectory.travel(from_s, to_s), Joints::zeros());
        assert_eq!(trajectory.travel(to_s, to_s + 5.0), Joints::zeros());
    }
}
