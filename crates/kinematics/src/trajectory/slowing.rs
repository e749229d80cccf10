//! A controlled stop: the trajectory's own path, at a rate that falls to zero.

use super::{Course, JointState, JointTrajectory, Phase, Segment};
use crate::Joints;

/// The course of `original` from `from_s` on, as its time runs slower and slower.
///
/// With `x = t / T` the rate is `1 - 3 x^2 + 2 x^3`, which is level at both ends: accelerations are
/// continuous. Half of `T` passes in the original's time.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Slowing {
    original: Box<JointTrajectory>,
    from_s: f64,
    duration_s: f64,
}

impl Slowing {
    /// Time in the original, its rate, and the rate's change (1/s).
    fn clock(&self, local_s: f64) -> (f64, f64, f64) {
        let x = (local_s / self.duration_s).clamp(0.0, 1.0);
        let passed_s = self.duration_s * (x - x.powi(3) + 0.5 * x.powi(4));
        let rate = 1.0 - 3.0 * x * x + 2.0 * x.powi(3);
        let change_per_s = 6.0 * x * (x - 1.0) / self.duration_s;
        (self.from_s + passed_s, rate, change_per_s)
    }

    pub(super) fn sample(&self, local_s: f64) -> JointState {
        let (time_s, rate, change_per_s) = self.clock(local_s);
        let state = self.original.sample(time_s);
        JointState {
            position: state.position,
            velocity: state.velocity * rate,
            acceleration: state.acceleration * rate.powi(2) + state.velocity * change_per_s,
        }
    }

    pub(super) fn travel(&self, from_s: f64, to_s: f64) -> Joints {
        self.original
            .travel(self.clock(from_s).0, self.clock(to_s).0)
    }

    pub(super) fn chord_deviation(&self, from_s: f64, to_s: f64) -> Joints {
        self.original
            .chord_deviation(self.clock(from_s).0, self.clock(to_s).0)
    }
}

impl JointTrajectory {
    /// The trajectory until `at_s`, then along the same path to a stand within `over_s`
    /// ([`Phase::Stop`]).
    ///
    /// Time runs at a rate that falls smoothly from one to zero, so that `over_s` of slowing covers
    /// what takes half of it at full speed, and joints meet accelerations of up to `1.5 v / over_s`
    /// beside those of the path. With `over_s` = 0 the reference stands at once.
    #[must_use]
    pub fn stopped(&self, at_s: f64, over_s: f64) -> Self {
        let at_s = at_s.clamp(0.0, self.duration_s());
        let segments = self
            .segments
            .iter()
            .filter(|segment| segment.start_s < at_s)
            .map(|segment| Segment {
                duration_s: segment.duration_s.min(at_s - segment.start_s),
                ..segment.clone()
            })
            .collect();
        let mut stopped = Self {
            segments,
            end: self.sample(at_s).position,
        };
        if over_s > 0.0 {
            let slowing = Slowing {
                original: Box::new(self.clone()),
                from_s: at_s,
                duration_s: over_s,
            };
            stopped.end = slowing.sample(over_s).position;
            stopped.push(Phase::Stop, over_s, Course::Slowing(slowing));
            return stopped;
        }
        // The cut course would go on at its last speed.
        stopped.then_hold(Phase::Stop, 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::{MotionLimits, ProfileLimits};

    fn moving() -> JointTrajectory {
        let limits = MotionLimits {
            velocity: Joints::repeat(1.0),
            acceleration: Joints::repeat(3.0),
            jerk: Joints::repeat(30.0),
            line: ProfileLimits {
                velocity: 0.1,
                acceleration: 0.5,
                jerk: 5.0,
            },
        };
        JointTrajectory::starting_at(Joints::zeros()).then_straight_to(
            Phase::Transfer,
            Joints::new(1.0, -2.0, 0.5, 0.1, 0.0, -0.3),
            &limits,
        )
    }

    #[test]
    fn a_stop_keeps_to_the_path_and_takes_half_its_time_of_it() {
        let whole = moving();
        let (at_s, over_s) = (0.4 * whole.duration_s(), 0.3);
        let stopped = whole.stopped(at_s, over_s);
        assert!((stopped.duration_s() - at_s - over_s).abs() < 1e-12);
        let expected = whole.sample(at_s + 0.5 * over_s).position;
        assert!((stopped.end() - expected).amax() < 1e-12);
        assert_eq!(stopped.phase_at(at_s + 0.1), Phase::Stop);
        assert_eq!(stopped.sample(0.5 * at_s), whole.sample(0.5 * at_s));
    }

    #[test]
    fn speeds_and_accelerations_of_a_stop_are_the_derivatives_of_its_positions() {
        const STEP_S: f64 = 1e-5;
        let whole = moving();
        let at_s = 0.4 * whole.duration_s();
        let stopped = whole.stopped(at_s, 0.3);
        for k in 0..=30 {
            let t = at_s + 0.01 * f64::from(k) * 0.998 + 2.0 * STEP_S;
            let [before, here, after] =
                [t - STEP_S, t, t + STEP_S].map(|time_s| stopped.sample(time_s));
            let slope = (after.position - before.position) / (2.0 * STEP_S);
            assert!((slope - here.velocity).amax() < 1e-7, "{t}: {slope}");
            let bend = (after.velocity - before.velocity) / (2.0 * STEP_S);
            assert!((bend - here.acceleration).amax() < 1e-4, "{t}: {bend}");
        }
    }

    #[test]
    fn travel_of_a_stop_is_that_of_the_path() {
        let whole = moving();
        let at_s = 0.4 * whole.duration_s();
        let stopped = whole.stopped(at_s, 0.3);
        let travel = stopped.travel(at_s, at_s + 0.3);
        let way = (stopped.end() - whole.sample(at_s).position).abs();
        assert!((travel - way).amax() < 1e-10, "{travel} {way}");
        assert_eq!(stopped.chord_deviation(at_s, at_s + 0.3), Joints::zeros());
    }

    #[test]
    fn a_stop_in_no_time_cuts_the_motion_off() {
        let whole = moving();
        let stopped = whole.stopped(0.5, 0.0);
        assert!((stopped.duration_s() - 0.5).abs() < 1e-12);
        assert_eq!(
            stopped.sample(1.0),
            JointState::at_rest(whole.sample(0.5).position)
        );
    }
}
