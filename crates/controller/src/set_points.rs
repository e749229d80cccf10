//! The record of a controller's set-points.

use needlebench_kinematics::trajectory::JointState;

/// Set-points of every cycle: a course that grows, and can be sampled up to its last set-point.
///
/// Between two set-points it is the quintic with the positions, velocities and accelerations of both, with the bits of
/// `JointTrajectory::sampled` at the times `cycle * period`. What was sampled once is the same later on.
#[derive(Debug, Clone, PartialEq)]
pub struct SetPoints {
    period_s: f64,
    states: Vec<JointState>,
}

impl SetPoints {
    /// The first set-point, at 0 s. The period has to be positive.
    pub fn new(period_s: f64, first: JointState) -> Self {
        Self {
            period_s,
            states: vec![first],
        }
    }

    /// Adds the set-point of the end of the next cycle.
    pub fn push(&mut self, set_point: JointState) {
        self.states.push(set_point);
    }

    /// Time between two set-points, s.
    pub fn period_s(&self) -> f64 {
        self.period_s
    }

    /// Time of the last set-point, s.
    pub fn end_s(&self) -> f64 {
        self.time_s(self.states.len() - 1)
    }

    /// All set-points so far, the first of 0 s.
    pub fn states(&self) -> &[JointState] {
        &self.states
    }

    fn time_s(&self, index: usize) -> f64 {
        index as f64 * self.period_s
    }

    /// Reference at a time, s; the first set-point before, and the last one after the record.
    pub fn sample(&self, time_s: f64) -> JointState {
        let last = self.states.len() - 1;
        // NaN gives the first set-point.
        if last == 0 || time_s.is_nan() || time_s <= 0.0 {
            return self.states[0];
        }
        if time_s >= self.end_s() {
            return self.states[last];
        }
        // The quotient may be rounded up to the next cycle, or down to the one before.
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "positive, and less than the number of set-points"
        )]
        let mut index = ((time_s / self.period_s) as usize).min(last - 1);
        if self.time_s(index) > time_s {
            index -= 1;
        } else if self.time_s(index + 1) <= time_s {
            index += 1;
        }
        let (start_s, end_s) = (self.time_s(index), self.time_s(index + 1));
        let h = end_s - start_s;
        quintic(
            h,
            [&self.states[index], &self.states[index + 1]],
            (time_s - start_s) / h,
        )
    }
}

/// The quintic between two states that are `h` apart (s), at a share of the time between.
fn quintic(h: f64, [a, b]: [&JointState; 2], u: f64) -> JointState {
    let (v0, v1) = (a.velocity * h, b.velocity * h);
    let (w0, w1) = (a.acceleration * (h * h), b.acceleration * (h * h));
    let d = b.position - a.position;
    let [c0, c1, c2, c3, c4, c5] = [
        a.position,
        v0,
        w0 * 0.5,
        d * 10.0 - v0 * 6.0 - v1 * 4.0 - w0 * 1.5 + w1 * 0.5,
        d * -15.0 + v0 * 8.0 + v1 * 7.0 + w0 * 1.5 - w1,
        d * 6.0 - v0 * 3.0 - v1 * 3.0 - w0 * 0.5 + w1 * 0.5,
    ];
    JointState {
        position: c0 + (c1 + (c2 + (c3 + (c4 + c5 * u) * u) * u) * u) * u,
        velocity: (c1 + (c2 * 2.0 + (c3 * 3.0 + (c4 * 4.0 + c5 * (5.0 * u)) * u) * u) * u) / h,
        acceleration: (c2 * 2.0 + (c3 * 6.0 + (c4 * 12.0 + c5 * (20.0 * u)) * u) * u) / (h * h),
    }
}

#[cfg(test)]
mod tests {
    use needlebench_kinematics::Joints;
    use needlebench_kinematics::trajectory::{Between, JointTrajectory, Phase};
    use needlebench_numerics::random::SplitMix64;

    use super::*;

    /// From set-point 2001 on, times over the period may be rounded to less than the index.
    const COUNT: u32 = 2100;

    #[test]
    fn the_record_has_the_bits_of_the_trajectory_through_its_set_points() {
        let mut random = SplitMix64::new(11);
        let mut draw = |most: f64| Joints::from_fn(|_, _| random.uniform(-most, most));
        for period_s in [0.002, 0.008] {
            let mut made = || JointState {
                position: draw(1.0),
                velocity: draw(0.5),
                acceleration: draw(3.0),
            };
            let mut record = SetPoints::new(period_s, made());
            let mut early = Vec::new();
            for _ in 0..COUNT {
                record.push(made());
                early.push(record.sample(record.end_s() - 0.3 * period_s));
            }
            let times_s: Vec<f64> = (0..=COUNT).map(|k| f64::from(k) * period_s).collect();
            let whole = JointTrajectory::sampled(
                Phase::Replay,
                Between::Quintics,
                &times_s,
                record.states(),
            )
            .unwrap();
            let even = (0..20_000).map(|k| record.end_s() * f64::from(k) / 20_000.0);
            // Set-points, and one bit to either side.
            let on_them = times_s[1..2100]
                .iter()
                .flat_map(|s| [s.next_down(), *s, s.next_up()]);
            for time_s in even.chain(on_them) {
                assert_eq!(record.sample(time_s), whole.sample(time_s), "{time_s}");
            }
            for (k, early) in early.iter().enumerate() {
                assert_eq!(record.sample(times_s[k + 1] - 0.3 * period_s), *early);
            }
        }
    }

    #[test]
    fn set_points_are_met_and_outside_the_ends_count() {
        let at = |value: f64| JointState::at_rest(Joints::repeat(value));
        let mut record = SetPoints::new(0.002, at(1.0));
        assert_eq!(record.sample(5.0), at(1.0));
        record.push(at(2.0));
        for (time_s, expected) in [(-1.0, 1.0), (0.0, 1.0), (0.002, 2.0), (9.0, 2.0)] {
            assert_eq!(record.sample(time_s).position, at(expected).position);
        }
        assert_eq!(record.sample(f64::NAN), at(1.0));
        assert!((record.sample(0.001).position[0] - 1.5).abs() < 1e-15);
    }
}
