//! `servoj`: a filter that follows streamed targets.

use std::collections::VecDeque;

use needlebench_kinematics::trajectory::JointState;
use needlebench_kinematics::{JOINT_COUNT, Joints};

/// Follows the last target: `qdd = gain (target - (q + lookahead qd))`.
///
/// Assumed, after the names of the two parameters: the gain (1/s^2) acts on how far the target is from where the joint
/// will be after the look-ahead time. A target that moves steadily is followed later by just that time, whatever the
/// gain, and by the delay of the arm data. Natural frequency `sqrt(gain)`, damping ratio `lookahead sqrt(gain) / 2`.
///
/// Over a cycle the acceleration is linear in time, which solves the filter at each cycle's end (Newmark, *A method of
/// computation for structural dynamics*, 1959, with beta = 1/6): stable below `gain period^2` = 12, here 0.13 at most.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Servo {
    target: Joints,
    delayed: VecDeque<Joints>,
    /// What is followed now.
    followed: Joints,
    delay_cycles: usize,
    gain: f64,
    lookahead_s: f64,
}

impl Servo {
    pub fn new(from: Joints, delay_cycles: usize) -> Self {
        Self {
            target: from,
            delayed: VecDeque::with_capacity(delay_cycles + 1),
            followed: from,
            delay_cycles,
            gain: 0.0,
            lookahead_s: 0.0,
        }
    }

    pub fn aim(&mut self, target: Joints, gain: f64, lookahead_s: f64) {
        self.target = target;
        self.gain = gain;
        self.lookahead_s = lookahead_s;
    }

    /// State one period later, no joint accelerated beyond a bound.
    pub fn advance(&mut self, from: &JointState, period_s: f64, most: &Joints) -> JointState {
        self.delayed.push_back(self.target);
        if self.delayed.len() > self.delay_cycles
            && let Some(next) = self.delayed.pop_front()
        {
            self.followed = next;
        }
        let (t, l) = (period_s, self.lookahead_s);
        let mut to = *from;
        for i in 0..JOINT_COUNT {
            let (q, v, a) = (from.position[i], from.velocity[i], from.acceleration[i]);
            let ahead = q + t * v + t * t * a / 3.0 + l * (v + 0.5 * t * a);
            let wanted = self.gain * (self.followed[i] - ahead)
                / (1.0 + self.gain * (t * t / 6.0 + 0.5 * l * t));
            let end = wanted.clamp(-most[i], most[i]);
            to.position[i] = q + (v + (2.0 * a + end) * t / 6.0) * t;
            to.velocity[i] = v + 0.5 * (a + end) * t;
            to.acceleration[i] = end;
        }
        to
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMIT: f64 = 40.0;

    /// Largest difference of a step's response from the closed form of the filter, over 0.6 s.
    fn off(gain: f64, lookahead_s: f64, period_s: f64) -> f64 {
        let step = 0.01;
        let mut servo = Servo::new(Joints::zeros(), 0);
        servo.aim(Joints::repeat(step), gain, lookahead_s);
        // The acceleration jumps at the start: the closed form's own.
        let mut state = JointState::at_rest(Joints::zeros());
        state.acceleration = Joints::repeat(gain * step);
        let (omega, damping) = (gain.sqrt(), 0.5 * lookahead_s * gain.sqrt());
        let mut worst = 0.0_f64;
        let mut time_s = 0.0;
        while time_s < 0.6 {
            state = servo.advance(&state, period_s, &Joints::repeat(LIMIT));
            time_s += period_s;
            let decay = libm::exp(-damping * omega * time_s);
            let response = if damping < 1.0 {
                let root = (1.0 - damping * damping).sqrt();
                let (sin, cos) = libm::sincos(omega * root * time_s);
                1.0 - decay * (cos + damping / root * sin)
            } else {
                let root = (damping * damping - 1.0).sqrt();
                let x = omega * root * time_s;
                1.0 - decay * (libm::cosh(x) + damping / root * libm::sinh(x))
            };
            worst = worst.max((state.position[0] / step - response).abs());
        }
        worst
    }

    #[test]
    fn a_step_is_answered_by_the_closed_form_of_a_second_order_filter() {
        for (gain, lookahead_s) in [(300.0, 0.1), (2000.0, 0.03), (2000.0, 0.1), (100.0, 0.03)] {
            let [coarse, fine] = [0.002, 0.001].map(|t| off(gain, lookahead_s, t));
            // (omega T)^2 / 12 of a period, and as much again of the damping: quadratic in the period.
            assert!(coarse < 3e-3, "{gain} {lookahead_s}: {coarse}");
            assert!(
                coarse / fine > 3.0 && coarse / fine < 5.0,
                "{coarse} {fine}"
            );
        }
    }

    #[test]
    fn a_steady_target_is_followed_later_by_look_ahead_and_delay() {
        let (period_s, speed, delay_cycles) = (0.002, 0.4, 2);
        for (gain, lookahead_s) in [(2000.0, 0.03), (300.0, 0.1)] {
            let mut servo = Servo::new(Joints::zeros(), delay_cycles);
            let mut state = JointState::at_rest(Joints::zeros());
            let mut target = 0.0;
            for cycle in 1..=2000 {
                target = speed * period_s * f64::from(cycle);
                servo.aim(Joints::repeat(target), gain, lookahead_s);
                state = servo.advance(&state, period_s, &Joints::repeat(LIMIT));
            }
            let lag_s = (target - state.position[3]) / speed;
            let expected_s = lookahead_s + 2.0 * period_s;
            assert!((lag_s - expected_s).abs() < 1e-9, "{lag_s} {expected_s}");
        }
    }
}
