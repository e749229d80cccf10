//! Paths through waypoints: straight pieces with rounded corners.

use super::path::{JointPath, Knot};
use crate::{JOINT_COUNT, Joints};

/// Largest part of a straight piece that the rounding of one of its corners takes up.
const LARGEST_SHARE: f64 = 0.45;

/// Without any rounding a corner would need a stop.
const LEAST_ROUNDING: f64 = 0.01;

impl JointPath {
    /// Path from the first waypoint to the last, straight but for rounded corners.
    ///
    /// The parameter is the time that the slowest joint needs at full speed, so on straight pieces
    /// `|d q_i / d s| <= speed_i`. A corner is a quintic with the straight pieces' directions and no
    /// curvature at its ends. It takes up `rounding` (0.01 to 1) of what is possible, 45 % of the shorter
    /// of its two pieces on either side, and is nearer to the waypoint than to the pieces' ends: its
    /// middle is `3/16` of that length times the change of direction away from it.
    ///
    /// `None` if there are fewer than two different waypoints, or a number that is not finite.
    pub fn through(waypoints: &[Joints], speed: &Joints, rounding: f64) -> Option<Self> {
        let mut corners: Vec<Joints> = Vec::with_capacity(waypoints.len());
        for waypoint in waypoints {
            if !waypoint.iter().all(|position| position.is_finite()) {
                return None;
            }
            if corners.last() != Some(waypoint) {
                corners.push(*waypoint);
            }
        }
        let pieces: Vec<(Joints, f64)> = corners
            .windows(2)
            .map(|pair| {
                let way = pair[1] - pair[0];
                let length = duration(&way, speed);
                (way / length, length)
            })
            .collect();
        let ((first, _), (last, _)) = (pieces.first()?, pieces.last()?);
        let straight = |s, position, first| Knot {
            s,
            position,
            first,
            second: Joints::zeros(),
        };
        let mut knots = vec![straight(0.0, corners[0], *first)];
        // What of the piece that ends at the corner is not yet passed.
        let mut left = pieces[0].1;
        for (corner, pair) in corners[1..].iter().zip(pieces.windows(2)) {
            let [(before, length_before), (after, length_after)] = [pair[0], pair[1]];
            let reach = LARGEST_SHARE
                * rounding.clamp(LEAST_ROUNDING, 1.0)
                * length_before.min(length_after);
            let s = knots[knots.len() - 1].s + left - reach;
            knots.push(straight(s, corner - before * reach, before));
            knots.push(straight(s + 2.0 * reach, corner + after * reach, after));
            left = length_after - reach;
        }
        let s = knots[knots.len() - 1].s + left;
        knots.push(straight(s, corners[corners.len() - 1], *last));
        Some(Self::from_knots(knots))
    }
}

/// Time that the slowest joint needs at full speed, s.
fn duration(way: &Joints, speed: &Joints) -> f64 {
    (0..JOINT_COUNT)
        .map(|i| way[i].abs() / speed[i])
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::super::{JointTrajectory, MotionLimits, Phase, ProfileLimits};
    use super::*;
    use needlebench_numerics::random::SplitMix64;

    /// Between two of the samples at which limits are compared a joint may exceed its own by this
    /// much, relatively.
    const BETWEEN_SAMPLES: f64 = 0.01;

    fn limits() -> MotionLimits {
        MotionLimits {
            velocity: Joints::new(1.0, 1.0, 1.2, 2.0, 2.0, 2.0),
            acceleration: Joints::repeat(1.4),
            jerk: Joints::repeat(10.0),
            line: ProfileLimits {
                velocity: 0.05,
                acceleration: 0.2,
                jerk: 1.0,
            },
        }
    }

    fn random_waypoints(random: &mut SplitMix64, count: usize) -> Vec<Joints> {
        (0..count)
            .map(|_| Joints::from_fn(|_, _| random.uniform(-2.0, 2.0)))
            .collect()
    }

    #[test]
    fn a_trajectory_through_waypoints_is_smooth_keeps_its_limits_and_rests_at_both_ends() {
        let limits = limits();
        let mut random = SplitMix64::new(5);
        for count in 2..8 {
            let waypoints = random_waypoints(&mut random, count);
            let path = JointPath::through(&waypoints, &limits.velocity, 1.0).unwrap();
            let trajectory = JointTrajectory::starting_at(waypoints[0]).then_through(
                Phase::Transfer,
                path,
                &limits,
            );
            let end_s = trajectory.duration_s();
            for (time_s, waypoint) in [(0.0, waypoints[0]), (end_s, waypoints[count - 1])] {
                let state = trajectory.sample(time_s);
                assert!((state.position - waypoint).amax() < 1e-12);
                assert!(state.velocity.amax() < 1e-9 && state.acceleration.amax() < 1e-9);
            }
            let step_s = 1e-3;
            let mut time_s = 0.0;
            let mut last = trajectory.sample(0.0);
            while time_s < end_s {
                time_s += step_s;
                let here = trajectory.sample(time_s);
                for joint in 0..JOINT_COUNT {
                    let most = |limit: f64| limit * (1.0 + BETWEEN_SAMPLES);
                    assert!(here.velocity[joint].abs() <= most(limits.velocity[joint]));
                    assert!(here.acceleration[joint].abs() <= most(limits.acceleration[joint]));
                    let jerk = (here.acceleration[joint] - last.acceleration[joint]) / step_s;
                    // A difference quotient across a knot, where the jerk jumps.
                    assert!(jerk.abs() <= most(limits.jerk[joint]));
                    let moved = here.position[joint] - last.position[joint];
                    assert!(moved.abs() <= most(limits.velocity[joint]) * step_s);
                }
                last = here;
            }
        }
    }

    #[test]
    fn with_little_rounding_the_path_is_the_polygon() {
        let mut random = SplitMix64::new(9);
        let waypoints = random_waypoints(&mut random, 4);
        let path = JointPath::through(&waypoints, &limits().velocity, 0.0).unwrap();
        for pair in waypoints.windows(2) {
            let middle = (pair[0] + pair[1]) * 0.5;
            let nearest = (0..=4000)
                .map(|k| path.sample(path.length() * f64::from(k) / 4000.0).position)
                .map(|position| (position - middle).amax())
                .fold(f64::INFINITY, f64::min);
            // Half the way between two of the samples.
            assert!(nearest < 4e-3);
        }
    }

    #[test]
    fn one_place_is_no_path() {
        let here = Joints::repeat(0.3);
        assert!(JointPath::through(&[here, here], &Joints::repeat(1.0), 1.0).is_none());
        assert!(JointPath::through(&[], &Joints::repeat(1.0), 1.0).is_none());
        let nowhere = Joints::repeat(f64::NAN);
        assert!(JointPath::through(&[here, nowhere], &Joints::repeat(1.0), 1.0).is_none());
    }

    #[test]
    fn backwards_is_the_same_way() {
        let mut random = SplitMix64::new(13);
        let waypoints = random_waypoints(&mut random, 5);
        let path = JointPath::through(&waypoints, &limits().velocity, 0.7).unwrap();
        let back = path.reversed();
        for k in 0..=100 {
            let s = path.length() * f64::from(k) / 100.0;
            let (there, here) = (path.sample(s), back.sample(path.length() - s));
            assert!((there.position - here.position).amax() < 1e-12);
            assert!((there.first + here.first).amax() < 1e-9);
        }
    }
}
