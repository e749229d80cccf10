//! Changes of velocity in the least time under bounds of acceleration and jerk.

use nalgebra::SVector;

/// One component: from a velocity and an acceleration to a velocity without acceleration.
///
/// Biagiotti and Melchiorri, *Trajectory Planning for Automatic Machines and Robots*, section 3.4: the velocity is a
/// double integral of a jerk that is `+J`, 0 or `-J`. An acceleration beyond the bound at the start only falls.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Ramp {
    from: RampState,
    /// Duration and jerk of each phase.
    phases: [(f64, f64); 3],
    to: f64,
}

/// Way done, velocity, acceleration.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct RampState {
    pub way: f64,
    pub velocity: f64,
    pub acceleration: f64,
}

impl RampState {
    fn after(self, time_s: f64, jerk: f64) -> Self {
        let Self {
            way,
            velocity,
            acceleration,
        } = self;
        Self {
            way: way + (velocity + (0.5 * acceleration + jerk * time_s / 6.0) * time_s) * time_s,
            velocity: velocity + (acceleration + 0.5 * jerk * time_s) * time_s,
            acceleration: acceleration + jerk * time_s,
        }
    }
}

impl Ramp {
    /// At a constant velocity.
    pub fn steady(velocity: f64) -> Self {
        let from = RampState {
            velocity,
            ..RampState::default()
        };
        Self {
            from,
            phases: [(0.0, 0.0); 3],
            to: velocity,
        }
    }

    /// Bounds have to be positive.
    pub fn new(
        [velocity, acceleration]: [f64; 2],
        to: f64,
        most_acceleration: f64,
        most_jerk: f64,
    ) -> Self {
        let jerk = most_jerk;
        // Velocity if the acceleration goes to zero at once: the change that is left decides the direction.
        let coasting = velocity + 0.5 * acceleration * acceleration.abs() / jerk;
        let sign = if to >= coasting { 1.0 } else { -1.0 };
        let begin = sign * acceleration;
        let change = sign * (to - velocity);
        let phases = if begin > most_acceleration {
            let down_s = (begin - most_acceleration) / jerk;
            let steady_s = (change - 0.5 * begin * begin / jerk) / most_acceleration;
            [
                (down_s, -jerk),
                (steady_s.max(0.0), 0.0),
                (most_acceleration / jerk, -jerk),
            ]
        } else {
            let peak = (jerk * change + 0.5 * begin * begin).max(0.0).sqrt();
            let peak = peak.max(begin);
            if peak <= most_acceleration {
                [
                    ((peak - begin) / jerk, jerk),
                    (0.0, 0.0),
                    (peak / jerk, -jerk),
                ]
            } else {
                let ramps = (most_acceleration * most_acceleration - 0.5 * begin * begin) / jerk;
                [
                    ((most_acceleration - begin) / jerk, jerk),
                    (((change - ramps) / most_acceleration).max(0.0), 0.0),
                    (most_acceleration / jerk, -jerk),
                ]
            }
        };
        Self {
            from: RampState {
                way: 0.0,
                velocity,
                acceleration,
            },
            phases: phases.map(|(time_s, jerk)| (time_s, sign * jerk)),
            to,
        }
    }

    pub fn duration_s(&self) -> f64 {
        self.phases.iter().map(|phase| phase.0).sum()
    }

    /// State at a time, s; at the final velocity behind the end.
    pub fn sample(&self, time_s: f64) -> RampState {
        let mut state = self.from;
        let mut left_s = time_s;
        for (duration_s, jerk) in self.phases {
            if left_s < duration_s {
                return state.after(left_s, jerk);
            }
            state = state.after(duration_s, jerk);
            left_s -= duration_s;
        }
        RampState {
            way: state.way + self.to * left_s,
            velocity: self.to,
            acceleration: 0.0,
        }
    }

    /// The fastest of its velocities.
    pub fn fastest(&self) -> f64 {
        let mut state = self.from;
        let mut fastest = state.velocity.abs();
        for (duration_s, jerk) in self.phases {
            // Velocity is extreme where acceleration changes its sign.
            let zero_s = -state.acceleration / jerk;
            if zero_s > 0.0 && zero_s < duration_s {
                fastest = fastest.max(state.after(zero_s, jerk).velocity.abs());
            }
            state = state.after(duration_s, jerk);
            fastest = fastest.max(state.velocity.abs());
        }
        fastest
    }

    /// Least and largest way at the edges of its phases.
    pub fn ways(&self) -> [f64; 2] {
        let mut state = self.from;
        let mut ways = [0.0_f64; 2];
        for (duration_s, jerk) in self.phases {
            state = state.after(duration_s, jerk);
            ways = [ways[0].min(state.way), ways[1].max(state.way)];
        }
        ways
    }
}

/// Several components, which change together where their accelerations at the start are as their changes are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Ramps<const N: usize>(pub [Ramp; N]);

impl<const N: usize> Ramps<N> {
    /// The change whose magnitude is `lead(change)` has the acceleration `most_acceleration`, which is reached in
    /// `ramp_s`; the others have theirs in proportion.
    pub fn new(
        velocity: &SVector<f64, N>,
        acceleration: &SVector<f64, N>,
        to: &SVector<f64, N>,
        (most_acceleration, ramp_s): (f64, f64),
        lead: impl Fn(&SVector<f64, N>) -> f64,
    ) -> Self {
        let change = to - velocity;
        let leading = lead(&change);
        Self(std::array::from_fn(|i| {
            let share = if leading > 0.0 {
                (change[i] / leading).abs()
            } else {
                0.0
            };
            let share = share.max(acceleration[i].abs() / most_acceleration);
            if share < LEAST_SHARE {
                return Ramp::steady(to[i]);
            }
            let bound = share * most_acceleration;
            Ramp::new([velocity[i], acceleration[i]], to[i], bound, bound / ramp_s)
        }))
    }

    pub fn duration_s(&self) -> f64 {
        self.0.iter().map(Ramp::duration_s).fold(0.0, f64::max)
    }

    /// Ways, velocities and accelerations.
    pub fn sample(&self, time_s: f64) -> [SVector<f64, N>; 3] {
        let states = self.0.map(|ramp| ramp.sample(time_s));
        [
            SVector::from_fn(|i, _| states[i].way),
            SVector::from_fn(|i, _| states[i].velocity),
            SVector::from_fn(|i, _| states[i].acceleration),
        ]
    }
}

/// Components whose change is less than this share of the leading one do not change: rounding.
const LEAST_SHARE: f64 = 1e-12;

#[cfg(test)]
mod tests {
    use needlebench_numerics::random::SplitMix64;

    use super::*;

    /// Rounding of values up to 100.
    const ROUNDING: f64 = 1e-10;

    /// Braking from a steady velocity: `v^2 / 2a + v r / 2` in `v / a + r` (the closed form of a ramped trapezoid).
    #[test]
    fn a_stop_takes_the_way_and_the_time_of_the_closed_form() {
        for (v, a, r) in [(1.0, 2.0, 0.14), (3.1, 20.0, 0.02), (-0.7, 1.4, 0.14)] {
            let ramp = Ramp::new([v, 0.0], 0.0, a, a / r);
            let speed = f64::abs(v);
            assert!((ramp.duration_s() - (speed / a + r)).abs() < ROUNDING);
            let way = ramp.sample(ramp.duration_s()).way;
            assert!((way.abs() - (0.5 * speed * speed / a + 0.5 * speed * r)).abs() < ROUNDING);
        }
        // Below the full acceleration: two jerk phases of sqrt(v / j), a way of v sqrt(v / j).
        let ramp = Ramp::new([0.1, 0.0], 0.0, 2.0, 2.0 / 0.14);
        let half_s = f64::sqrt(0.1 * 0.14 / 2.0);
        assert!((ramp.duration_s() - 2.0 * half_s).abs() < ROUNDING);
        assert!((ramp.sample(2.0 * half_s).way - 0.1 * half_s).abs() < ROUNDING);
    }

    #[test]
    fn ramps_end_where_they_are_to_within_their_bounds_and_integrate_their_jerk() {
        let mut random = SplitMix64::new(3);
        for _ in 0..2000 {
            let [v, a] = [2.0, 5.0].map(|most| random.uniform(-most, most));
            let to = random.uniform(-2.0, 2.0);
            let most = random.uniform(0.5, 6.0);
            let jerk = random.uniform(1.0, 80.0);
            let ramp = Ramp::new([v, a], to, most, jerk);
            let end_s = ramp.duration_s();
            let (mut fastest, steps) = (0.0_f64, 400);
            let mut way = 0.0;
            for step in 0..steps {
                let [from, to] =
                    [step, step + 1].map(|k| ramp.sample(end_s * f64::from(k) / f64::from(steps)));
                fastest = fastest.max(from.velocity.abs());
                assert!(from.acceleration.abs() <= f64::max(most, a.abs()) + ROUNDING);
                let step_s = end_s / f64::from(steps);
                assert!((to.acceleration - from.acceleration).abs() <= jerk * step_s + ROUNDING);
                way += 0.5 * step_s * (from.velocity + to.velocity);
            }
            let end = ramp.sample(end_s);
            // The end is reached by integration, not set: one bit before it.
            let before = ramp.sample(end_s * (1.0 - 1e-12));
            assert!(
                (before.velocity - to).abs() < 1e-8,
                "{v} {a} {to}: {before:?}"
            );
            assert!(before.acceleration.abs() < 1e-8);
            // The trapezoidal rule is off by T h^2 j / 12.
            assert!((end.way - way).abs() <= end_s.powi(3) * jerk / 1.9e6 + ROUNDING);
            assert!(ramp.fastest() >= fastest - ROUNDING && ramp.fastest() < fastest + 0.05);
        }
    }
}
