//! Joint trajectories: joint-space lines, straight tool lines, holds.
//!
//! Every planned segment starts and ends at rest and follows a seven-phase (double-S) profile, so
//! position, velocity and acceleration are continuous and the jerk is bounded. What was recorded
//! elsewhere goes through its set-points.

mod line;
mod path;
mod piece;
mod profile;
mod sampled;
mod slowing;
mod through;
mod travel;

pub use line::LineError;
pub use path::{JointPath, PathPoint};
pub use piece::{Piece, PieceCourse};
pub use profile::{DoubleS, ProfileLimits};
pub use sampled::{Between, NotSampled};

use slowing::Slowing;

use crate::{JOINT_COUNT, Joints};

/// Reference of all joints at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointState {
    /// Positions, rad.
    pub position: Joints,
    /// Velocities, rad/s.
    pub velocity: Joints,
    /// Accelerations, rad/s^2.
    pub acceleration: Joints,
}

impl JointState {
    /// At rest.
    pub fn at_rest(position: Joints) -> Self {
        Self {
            position,
            velocity: Joints::zeros(),
            acceleration: Joints::zeros(),
        }
    }
}

/// Bounds that a motion keeps, per joint and for the tool on a straight line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionLimits {
    /// Joint speeds, rad/s.
    pub velocity: Joints,
    /// Joint accelerations, rad/s^2.
    pub acceleration: Joints,
    /// Joint jerks, rad/s^3.
    pub jerk: Joints,
    /// Speed, acceleration and jerk of the guide along a straight line: m/s, m/s^2, m/s^3.
    pub line: ProfileLimits,
}

/// Part of a motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Phase {
    /// From the start posture to the pre-entry pose.
    Transfer,
    /// Straight along the needle axis to the guide's final place.
    Approach,
    /// Standing still at the final place.
    Hold,
    /// Straight back along the needle axis.
    Retract,
    /// From there back to the start posture.
    Return,
    /// Into a prescribed contact.
    Press,
    /// Back out of it.
    Release,
    /// From the moment of a stop on.
    Stop,
    /// Along the set-points of a recorded run.
    Replay,
    /// Along the set-points of a motion that is judged, to a hold or away from it.
    Travel,
}

impl Phase {
    /// Name as reports print it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Transfer => "transfer",
            Self::Approach => "approach",
            Self::Hold => "hold",
            Self::Retract => "retract",
            Self::Return => "return",
            Self::Press => "press",
            Self::Release => "release",
            Self::Stop => "stop",
            Self::Replay => "replay",
            Self::Travel => "travel",
        }
    }
}

#[derive(Debug, Clone, PartialEq)]
enum Course {
    /// `from + fraction * delta`.
    Straight {
        from: Joints,
        delta: Joints,
        profile: DoubleS,
    },
    /// Along a path; the profile runs in its parameter, slowed down by `time_scale >= 1`.
    Path {
        path: JointPath,
        profile: DoubleS,
        time_scale: f64,
    },
    /// At rest.
    Hold { position: Joints },
    /// Along another trajectory, slower and slower until it stands.
    Slowing(Slowing),
    /// Through set-points: a path whose parameter is the time, s.
    Sampled(JointPath),
}

#[derive(Debug, Clone, PartialEq)]
struct Segment {
    phase: Phase,
    start_s: f64,
    duration_s: f64,
    course: Course,
}

/// A motion of all joints, from rest to rest.
#[derive(Debug, Clone, PartialEq)]
pub struct JointTrajectory {
    segments: Vec<Segment>,
    end: Joints,
}

impl JointTrajectory {
    /// A trajectory of no duration at `start`; segments are then appended.
    pub fn starting_at(start: Joints) -> Self {
        Self {
            segments: Vec::new(),
            end: start,
        }
    }

    /// Appends the joint-space line to `to`, all joints synchronised.
    #[must_use]
    pub fn then_straight_to(mut self, phase: Phase, to: Joints, limits: &MotionLimits) -> Self {
        let from = self.end;
        let delta = to - from;
        // Every joint moves as `fraction * delta_i`: the slowest joint sets the fraction's limits.
        let slowest = |limit: &Joints| {
            (0..JOINT_COUNT)
                .filter(|&i| delta[i] != 0.0)
                .map(|i| limit[i] / delta[i].abs())
                .fold(f64::INFINITY, f64::min)
        };
        if delta == Joints::zeros() {
            return self;
        }
        let profile = DoubleS::new(
            1.0,
            &ProfileLimits {
                velocity: slowest(&limits.velocity),
                acceleration: slowest(&limits.acceleration),
                jerk: slowest(&limits.jerk),
            },
        );
        let duration_s = profile.duration_s();
        self.push(
            phase,
            duration_s,
            Course::Straight {
                from,
                delta,
                profile,
            },
        );
        self.end = to;
        self
    }

    /// Appends a straight line of the tool, which has to start where this trajectory ends.
    ///
    /// The profile keeps the line's limits; where a joint would exceed its own, the whole line is
    /// slowed down uniformly until none does.
    #[must_use]
    pub fn then_along(mut self, phase: Phase, path: JointPath, limits: &MotionLimits) -> Self {
        debug_assert!(
            (path.start() - self.end).amax() < 1e-9,
            "line starts elsewhere"
        );
        if path.length() <= 0.0 {
            return self;
        }
        let profile = DoubleS::new(path.length(), &limits.line);
        self.push_path(phase, path, profile, limits);
        self
    }

    /// Appends a path through waypoints ([`JointPath::through`]), which has to start where this
    /// trajectory ends: without a stop, all joints within their limits.
    ///
    /// Limits are compared at 64 places of each of its pieces.
    #[must_use]
    pub fn then_through(mut self, phase: Phase, path: JointPath, limits: &MotionLimits) -> Self {
        debug_assert!(
            (path.start() - self.end).amax() < 1e-9,
            "path starts elsewhere"
        );
        // What straight pieces allow; corners then slow the whole path down.
        let (mut acceleration, mut jerk) = (f64::INFINITY, f64::INFINITY);
        for index in 0..path.intervals() {
            let direction = path.sample(path.interval(index).0).first;
            for i in (0..JOINT_COUNT).filter(|&i| direction[i] != 0.0) {
                acceleration = acceleration.min(limits.acceleration[i] / direction[i].abs());
                jerk = jerk.min(limits.jerk[i] / direction[i].abs());
            }
        }
        let profile = DoubleS::new(
            path.length(),
            &ProfileLimits {
                velocity: 1.0,
                acceleration,
                jerk,
            },
        );
        self.push_path(phase, path, profile, limits);
        self
    }

    fn push_path(
        &mut self,
        phase: Phase,
        path: JointPath,
        profile: DoubleS,
        limits: &MotionLimits,
    ) {
        let time_scale = path_time_scale(&path, &profile, limits);
        self.end = path.end();
        let duration_s = profile.duration_s() * time_scale;
        self.push(
            phase,
            duration_s,
            Course::Path {
                path,
                profile,
                time_scale,
            },
        );
    }

    /// Appends a rest.
    #[must_use]
    pub fn then_hold(mut self, phase: Phase, duration_s: f64) -> Self {
        let position = self.end;
        self.push(phase, duration_s, Course::Hold { position });
        self
    }

    /// Appends another motion, which has to start where this one ends.
    #[must_use]
    pub fn followed_by(mut self, other: Self) -> Self {
        for segment in other.segments {
            self.push(segment.phase, segment.duration_s, segment.course);
        }
        self.end = other.end;
        self
    }

    fn push(&mut self, phase: Phase, duration_s: f64, course: Course) {
        let start_s = self.duration_s();
        self.segments.push(Segment {
            phase,
            start_s,
            duration_s,
            course,
        });
    }

    /// Time of the last segment's end, s.
    pub fn duration_s(&self) -> f64 {
        self.segments
            .last()
            .map_or(0.0, |segment| segment.start_s + segment.duration_s)
    }

    /// Last position, rad.
    pub fn end(&self) -> Joints {
        self.end
    }

    /// Phases with their start and end times, s; segments in a row that belong to one are one.
    pub fn phases(&self) -> Vec<(Phase, f64, f64)> {
        let mut phases: Vec<(Phase, f64, f64)> = Vec::new();
        for segment in &self.segments {
            let end_s = segment.start_s + segment.duration_s;
            match phases.last_mut() {
                Some((phase, _, until_s)) if *phase == segment.phase => *until_s = end_s,
                _ => phases.push((segment.phase, segment.start_s, end_s)),
            }
        }
        phases
    }

    /// Phase at a time; the last one after the end.
    pub fn phase_at(&self, time_s: f64) -> Phase {
        self.segment_at(time_s)
            .map_or(Phase::Hold, |segment| segment.phase)
    }

    /// Reference at a time; at rest before the start and after the end.
    pub fn sample(&self, time_s: f64) -> JointState {
        let Some(segment) = self.segment_at(time_s) else {
            return JointState::at_rest(self.end);
        };
        let local_s = (time_s - segment.start_s).clamp(0.0, segment.duration_s);
        match &segment.course {
            Course::Straight {
                from,
                delta,
                profile,
            } => {
                let fraction = profile.sample(local_s);
                JointState {
                    position: from + delta * fraction.position,
                    velocity: delta * fraction.velocity,
                    acceleration: delta * fraction.acceleration,
                }
            }
            Course::Path {
                path,
                profile,
                time_scale,
            } => {
                let along = profile.sample(local_s / time_scale);
                let (velocity, acceleration) = (
                    along.velocity / time_scale,
                    along.acceleration / time_scale.powi(2),
                );
                let point = path.sample(along.position);
                JointState {
                    position: point.position,
                    velocity: point.first * velocity,
                    acceleration: point.second * velocity.powi(2) + point.first * acceleration,
                }
            }
            Course::Hold { position } => JointState::at_rest(*position),
            Course::Slowing(slowing) => slowing.sample(local_s),
            Course::Sampled(path) => {
                let point = path.sample(local_s);
                JointState {
                    position: point.position,
                    velocity: point.first,
                    acceleration: point.second,
                }
            }
        }
    }

    fn segment_at(&self, time_s: f64) -> Option<&Segment> {
        let next = self
            .segments
            .partition_point(|segment| segment.start_s <= time_s);
        self.segments.get(next.saturating_sub(1))
    }
}

/// Samples per path, at least, at which joint speeds are compared with the limits.
const PATH_SAMPLES: usize = 512;
/// Samples per piece of a path through waypoints.
const PIECE_SAMPLES: usize = 64;

fn path_time_scale(path: &JointPath, profile: &DoubleS, limits: &MotionLimits) -> f64 {
    let samples = PATH_SAMPLES.max(PIECE_SAMPLES * path.intervals());
    // Roots of the largest ratios are the largest roots: both rise, and are rounded correctly.
    let (mut of_velocity, mut of_acceleration, mut of_jerk) = (1.0_f64, 1.0_f64, 1.0_f64);
    for k in 0..=samples {
        let t = profile.duration_s() * k as f64 / samples as f64;
        let along = profile.sample(t);
        let point = path.sample(along.position);
        let (v, a, j) = (along.velocity, along.acceleration, along.jerk);
        let velocity = point.first * v;
        let acceleration = point.second * v.powi(2) + point.first * a;
        let jerk = point.third * v.powi(3) + point.second * (3.0 * v * a) + point.first * j;
        for i in 0..JOINT_COUNT {
            of_velocity = of_velocity.max(velocity[i].abs() / limits.velocity[i]);
            of_acceleration = of_acceleration.max(acceleration[i].abs() / limits.acceleration[i]);
            of_jerk = of_jerk.max(jerk[i].abs() / limits.jerk[i]);
        }
    }
    of_velocity
        .max(of_acceleration.sqrt())
        .max(libm::cbrt(of_jerk))
}

#[cfg(test)]
mod tests;
