//! Motions that can be certified.

use needlebench_kinematics::Joints;
use needlebench_kinematics::trajectory::{JointTrajectory, Phase};

/// Part of a motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span {
    /// What the arm does in it.
    pub phase: Phase,
    /// Its start, s.
    pub start_s: f64,
    /// Its end, s.
    pub end_s: f64,
}

/// A continuous motion of the joints whose course between two times can be bounded.
pub trait Motion {
    /// Joint positions at a time, rad.
    fn position(&self, time_s: f64) -> Joints;

    /// Proven bound of each joint's distance from the chord between two times of one span, rad.
    ///
    /// For every time between there is a fraction in `[0, 1]`, the same for all joints, so that
    /// each joint is no farther than this from `from + fraction * (to - from)`.
    fn chord_deviation(&self, from_s: f64, to_s: f64) -> Joints;

    /// The parts of the motion, in the order of time; together all of it.
    fn spans(&self) -> Vec<Span>;
}

impl Motion for JointTrajectory {
    fn position(&self, time_s: f64) -> Joints {
        self.sample(time_s).position
    }

    fn chord_deviation(&self, from_s: f64, to_s: f64) -> Joints {
        self.chord_deviation(from_s, to_s)
    }

    fn spans(&self) -> Vec<Span> {
        self.phases()
            .into_iter()
            .map(|(phase, start_s, end_s)| Span {
                phase,
                start_s,
                end_s,
            })
            .collect()
    }
}

/// A motion that was recorded step by step, joint positions linear in time between the steps.
///
/// That is what an engine computes: it has no states between its steps, and its integrator
/// (semi-implicit Euler) moves the joints over a step at one velocity.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedMotion {
    time_s: Vec<f64>,
    position: Vec<Joints>,
    spans: Vec<Span>,
}

impl RecordedMotion {
    /// A recording with the phases of the trajectory that it followed.
    ///
    /// `time_s` rises and is as long as `position`; none of the two is empty. Phases are cut to
    /// the recorded time, and the last one lasts as long as the recording.
    ///
    /// # Panics
    /// If lengths differ or there is no state: a recording always has its initial one.
    pub fn new(time_s: Vec<f64>, position: Vec<Joints>, trajectory: &JointTrajectory) -> Self {
        assert_eq!(time_s.len(), position.len(), "a position for every time");
        let first_s = time_s[0];
        let last_s = time_s[time_s.len() - 1];
        let mut spans: Vec<Span> = Motion::spans(trajectory)
            .into_iter()
            .map(|span| Span {
                start_s: span.start_s.clamp(first_s, last_s),
                end_s: span.end_s.clamp(first_s, last_s),
                ..span
            })
            // A phase that was over before the recording began.
            .filter(|span| span.end_s > span.start_s)
            .collect();
        match spans.last_mut() {
            Some(last) => last.end_s = last_s,
            None => spans.push(Span {
                phase: Phase::Hold,
                start_s: first_s,
                end_s: last_s,
            }),
        }
        Self {
            time_s,
            position,
            spans,
        }
    }
}

impl Motion for RecordedMotion {
    fn position(&self, time_s: f64) -> Joints {
        let next = self.time_s.partition_point(|&each| each <= time_s);
        if next == 0 {
            return self.position[0];
        }
        let Some(&next_s) = self.time_s.get(next) else {
            return self.position[self.position.len() - 1];
        };
        let before_s = self.time_s[next - 1];
        let fraction = (time_s - before_s) / (next_s - before_s);
        self.position[next - 1] + (self.position[next] - self.position[next - 1]) * fraction
    }

    /// The largest distance of a recorded state from its foot on the chord.
    ///
    /// Between two states both the position and, by choice, the fraction are linear in time, so
    /// the distance of each joint is largest at a state.
    fn chord_deviation(&self, from_s: f64, to_s: f64) -> Joints {
        let (from, to) = (self.position(from_s), self.position(to_s));
        let chord = to - from;
        let length_squared = chord.norm_squared();
        let first = self.time_s.partition_point(|&each| each <= from_s);
        let end = self.time_s.partition_point(|&each| each < to_s);
        let mut most = Joints::zeros();
        for position in &self.position[first..end.max(first)] {
            let offset = position - from;
            let fraction = if length_squared > 0.0 {
                (offset.dot(&chord) / length_squared).clamp(0.0, 1.0)
            } else {
                0.0
            };
            most = most.sup(&(offset - chord * fraction).abs());
        }
        most
    }

    fn spans(&self) -> Vec<Span> {
        self.spans.clone()
    }
}
