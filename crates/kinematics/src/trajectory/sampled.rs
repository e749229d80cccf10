//! A course that was sampled elsewhere: set-points of a recorded run, or of a motion that is judged.

use super::path::Knot;
use super::{Course, JointPath, JointState, JointTrajectory, Phase};
use crate::Joints;

/// Why set-points are not a trajectory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NotSampled {
    /// Fewer than two set-points.
    #[error("a trajectory needs two set-points")]
    TooFew,
    /// A different number of times and set-points.
    #[error("the numbers of times and set-points differ")]
    Uneven,
    /// Times that do not increase.
    #[error("the time of set-point {index} is not after that of the one before it")]
    NotIncreasing {
        /// Index of the later one.
        index: usize,
    },
    /// A set-point that is not finite.
    #[error("set-point {index} is not finite")]
    NotFinite {
        /// Index of the set-point.
        index: usize,
    },
}

/// What joins set-points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Between {
    /// Quintics with the position, velocity and acceleration of both ends: acceleration is continuous.
    Quintics,
    /// Cubics with the position and velocity of both ends: velocity is continuous.
    Cubics,
    /// Straight lines at constant velocity, with corners at the set-points.
    Lines,
}

impl Between {
    /// Knots of an interval with the derivatives that the joining curve has on its inside.
    fn ends(self, h: f64, [a, b]: [&JointState; 2]) -> [[Joints; 2]; 2] {
        let step = (b.position - a.position) / h;
        match self {
            Self::Quintics => [[a.velocity, a.acceleration], [b.velocity, b.acceleration]],
            Self::Cubics => {
                let (v0, v1) = (a.velocity, b.velocity);
                let from = (step * 6.0 - v0 * 4.0 - v1 * 2.0) / h;
                let to = (v0 * 2.0 + v1 * 4.0 - step * 6.0) / h;
                [[v0, from], [v1, to]]
            }
            Self::Lines => [[step, Joints::zeros()]; 2],
        }
    }
}

impl JointTrajectory {
    /// The course through set-points at increasing times (s), from the first one's time on. It may
    /// start and end in motion.
    ///
    /// The quintic between two set-points has their positions, velocities and accelerations, so that of a smooth
    /// course it is off by `h^6 / 46080` of its sixth derivative in position. Cubics do not look at accelerations, lines
    /// not at velocities either; at a set-point where velocity or acceleration jumps, those of the later side count.
    ///
    /// # Errors
    /// [`NotSampled`].
    pub fn sampled(
        phase: Phase,
        between: Between,
        times_s: &[f64],
        states: &[JointState],
    ) -> Result<Self, NotSampled> {
        let Some((first_s, last)) = times_s.first().zip(states.last()) else {
            return Err(NotSampled::TooFew);
        };
        if times_s.len() != states.len() {
            return Err(NotSampled::Uneven);
        }
        if states.len() < 2 {
            return Err(NotSampled::TooFew);
        }
        let finite = |state: &JointState| {
            let JointState {
                position,
                velocity,
                acceleration,
            } = state;
            (position.sum() + velocity.sum() + acceleration.sum()).is_finite()
        };
        if let Some(index) = states.iter().position(|state| !finite(state)) {
            return Err(NotSampled::NotFinite { index });
        }
        let not_after =
            |pair: &[f64]| pair[1].partial_cmp(&pair[0]) != Some(std::cmp::Ordering::Greater);
        if let Some(index) = times_s.windows(2).position(not_after) {
            return Err(NotSampled::NotIncreasing { index: index + 1 });
        }
        let mut knots: Vec<Knot> = Vec::with_capacity(states.len());
        for (states, times_s) in states.windows(2).zip(times_s.windows(2)) {
            let ends = between.ends(times_s[1] - times_s[0], [&states[0], &states[1]]);
            for (state, (time_s, [first, second])) in states.iter().zip(times_s.iter().zip(ends)) {
                let knot = Knot {
                    s: time_s - first_s,
                    position: state.position,
                    first,
                    second,
                };
                // Where nothing jumps, both sides have one knot.
                if knots.last() != Some(&knot) {
                    knots.push(knot);
                }
            }
        }
        let path = JointPath::from_knots(knots);
        let mut trajectory = Self::starting_at(last.position);
        trajectory.push(phase, path.length(), Course::Sampled(path));
        Ok(trajectory)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A polynomial of degree five per joint is met exactly; rounding of sums of terms up to 10.
    const ROUNDING: f64 = 1e-11;

    fn quintic(t: f64) -> JointState {
        let of = |k: f64| Joints::from_fn(|i, _| k * (1.0 + 0.1 * i as f64));
        let (a, b, c) = (0.3, -0.7, 0.2);
        JointState {
            position: of(1.0 + a * t + b * t.powi(3) + c * t.powi(5)),
            velocity: of(a + 3.0 * b * t.powi(2) + 5.0 * c * t.powi(4)),
            acceleration: of(6.0 * b * t + 20.0 * c * t.powi(3)),
        }
    }

    fn of_quintic(times_s: &[f64]) -> JointTrajectory {
        let states: Vec<JointState> = times_s.iter().map(|t| quintic(*t)).collect();
        JointTrajectory::sampled(Phase::Replay, Between::Quintics, times_s, &states).unwrap()
    }

    #[test]
    fn quintics_are_met_between_uneven_set_points() {
        let times_s = [0.5, 0.6, 1.0, 1.05, 1.9];
        let trajectory = of_quintic(&times_s);
        assert!((trajectory.duration_s() - 1.4).abs() < ROUNDING);
        for k in 0..=100 {
            let t = 1.4 * f64::from(k) / 100.0;
            let (found, wanted) = (trajectory.sample(t), quintic(0.5 + t));
            assert!((found.position - wanted.position).amax() < ROUNDING);
            assert!((found.velocity - wanted.velocity).amax() < ROUNDING);
            assert!((found.acceleration - wanted.acceleration).amax() < 1e-9);
        }
    }

    /// A cubic is met by cubics whatever accelerations are written, and polygons by lines, on whose corners the later
    /// velocity counts.
    #[test]
    fn cubics_and_lines_are_met() {
        let times_s = [0.5, 0.6, 1.0, 1.9];
        let at = |t: f64| JointState {
            position: Joints::repeat(0.2 + t.powi(3) - t),
            velocity: Joints::repeat(3.0 * t * t - 1.0),
            acceleration: Joints::repeat(7.0),
        };
        let states = times_s.map(at);
        let made =
            |between| JointTrajectory::sampled(Phase::Travel, between, &times_s, &states).unwrap();
        let (cubics, lines) = (made(Between::Cubics), made(Between::Lines));
        for k in 0..100 {
            let t = 0.5 + 1.4 * f64::from(k) / 100.0;
            let (found, wanted) = (cubics.sample(t - 0.5), at(t));
            assert!((found.position - wanted.position).amax() < ROUNDING);
            assert!((found.velocity - wanted.velocity).amax() < ROUNDING);
            assert!((found.acceleration[0] - 6.0 * t).abs() < 1e-9);
            let later = times_s.iter().position(|each| *each > t).unwrap();
            let (a, b) = (&states[later - 1].position, &states[later].position);
            let span_s = times_s[later] - times_s[later - 1];
            let wanted = a + (b - a) * ((t - times_s[later - 1]) / span_s);
            let found = lines.sample(t - 0.5);
            assert!((found.position - wanted).amax() < ROUNDING);
            assert!((found.velocity - (b - a) / span_s).amax() < ROUNDING);
            assert!(found.acceleration.amax() < 1e-9);
        }
    }

    #[test]
    fn travel_is_no_less_than_the_way() {
        let trajectory = of_quintic(&[0.0, 0.3, 0.9, 1.4, 2.0]);
        let mut way = Joints::zeros();
        for k in 0..2000 {
            let at = |k: u32| trajectory.sample(2.0 * f64::from(k) / 2000.0).position;
            way += (at(k + 1) - at(k)).abs();
        }
        let bound = trajectory.travel(0.0, 2.0);
        assert!((0..6).all(|i| way[i] <= bound[i] && bound[i] < 1.5 * way[i]));
    }

    #[test]
    fn what_is_no_course_is_refused() {
        let state = quintic(0.0);
        let refused = |times_s: &[f64], states: Vec<JointState>| {
            JointTrajectory::sampled(Phase::Replay, Between::Quintics, times_s, &states)
                .unwrap_err()
        };
        assert_eq!(refused(&[], vec![]), NotSampled::TooFew);
        assert_eq!(refused(&[0.0], vec![state]), NotSampled::TooFew);
        assert_eq!(refused(&[0.0], vec![state; 2]), NotSampled::Uneven);
        let index = 2;
        assert_eq!(
            refused(&[0.0, 1.0, 1.0], vec![state; 3]),
            NotSampled::NotIncreasing { index }
        );
        let broken = JointState {
            velocity: Joints::repeat(f64::NAN),
            ..state
        };
        assert_eq!(
            refused(&[0.0, 1.0], vec![state, broken]),
            NotSampled::NotFinite { index: 1 }
        );
    }
}
