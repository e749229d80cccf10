//! A course that was sampled elsewhere: a recorded run's set-points.

use super::{Course, JointState, JointTrajectory, Phase};
use crate::Joints;

/// Set-points at increasing times, joined by quintics that have the position, velocity and
/// acceleration of both ends: acceleration is continuous.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Sampled {
    /// From 0, s.
    time_s: Vec<f64>,
    states: Vec<JointState>,
}

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

impl Sampled {
    fn interval(&self, local_s: f64) -> usize {
        let next = self.time_s.partition_point(|time_s| *time_s <= local_s);
        next.clamp(1, self.time_s.len() - 1) - 1
    }

    /// Bernstein coefficients of the quintic of an interval, rad.
    fn coefficients(&self, index: usize) -> ([Joints; 6], f64) {
        let h = self.time_s[index + 1] - self.time_s[index];
        let [a, b] = [&self.states[index], &self.states[index + 1]];
        let (first, second) = (h / 5.0, h * h / 20.0);
        let b1 = a.position + a.velocity * first;
        let b4 = b.position - b.velocity * first;
        let coefficients = [
            a.position,
            b1,
            a.acceleration * second + b1 * 2.0 - a.position,
            b.acceleration * second + b4 * 2.0 - b.position,
            b4,
            b.position,
        ];
        (coefficients, h)
    }

    pub(super) fn sample(&self, local_s: f64) -> JointState {
        let index = self.interval(local_s);
        let (b, h) = self.coefficients(index);
        let u = ((local_s - self.time_s[index]) / h).clamp(0.0, 1.0);
        let lerp = |points: &[Joints]| -> Vec<Joints> {
            points
                .windows(2)
                .map(|pair| pair[0] + (pair[1] - pair[0]) * u)
                .collect()
        };
        // De Casteljau: three points are left for the second derivative, two for the first.
        let three = lerp(&lerp(&lerp(&b)));
        let two = lerp(&three);
        JointState {
            position: two[0] + (two[1] - two[0]) * u,
            velocity: (two[1] - two[0]) * (5.0 / h),
            acceleration: (three[2] - three[1] * 2.0 + three[0]) * (20.0 / (h * h)),
        }
    }

    /// Of all intervals that are touched, whole: the sum of the steps of their coefficients.
    pub(super) fn travel(&self, from_s: f64, to_s: f64) -> Joints {
        (self.interval(from_s)..=self.interval(to_s))
            .map(|index| {
                let (b, _) = self.coefficients(index);
                b.windows(2)
                    .map(|pair| (pair[1] - pair[0]).abs())
                    .sum::<Joints>()
            })
            .sum()
    }
}

impl JointTrajectory {
    /// The course through set-points at increasing times (s), from the first one's time on. It may
    /// start and end in motion.
    ///
    /// Between two set-points runs the quintic with their positions, velocities and accelerations, so
    /// that of a smooth course it is off by `h^6 / 46080` of its sixth derivative in position.
    ///
    /// # Errors
    /// [`NotSampled`].
    pub fn sampled(
        phase: Phase,
        times_s: &[f64],
        states: Vec<JointState>,
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
        let end = last.position;
        let duration_s = times_s[times_s.len() - 1] - first_s;
        let course = Sampled {
            time_s: times_s.iter().map(|time_s| time_s - first_s).collect(),
            states,
        };
        let mut trajectory = Self::starting_at(end);
        trajectory.push(phase, duration_s, Course::Sampled(course));
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
        let states = times_s.iter().map(|t| quintic(*t)).collect();
        JointTrajectory::sampled(Phase::Replay, times_s, states).unwrap()
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
            JointTrajectory::sampled(Phase::Replay, times_s, states).unwrap_err()
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
