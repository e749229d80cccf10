//! Rest-to-rest profile with bounded velocity, acceleration and jerk.

/// Bounds of a profile; any consistent unit of length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProfileLimits {
    /// Highest speed, 1/s.
    pub velocity: f64,
    /// Highest acceleration, 1/s^2.
    pub acceleration: f64,
    /// Highest jerk, 1/s^3.
    pub jerk: f64,
}

/// State of a profile at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProfileState {
    /// Distance covered.
    pub position: f64,
    /// Speed.
    pub velocity: f64,
    /// Acceleration.
    pub acceleration: f64,
    /// Jerk (of the phase that begins here, at a phase's edge).
    pub jerk: f64,
}

/// Time-optimal rest-to-rest motion under [`ProfileLimits`]: the seven-phase double-S profile.
///
/// Biagiotti and Melchiorri, *Trajectory Planning for Automatic Machines and Robots*, section 3.4,
/// for zero speeds at both ends, where it is symmetric and closed-form.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DoubleS {
    length: f64,
    jerk: f64,
    /// Duration of each constant-jerk phase, s.
    jerk_phase_s: f64,
    /// Duration of the whole acceleration, s.
    acceleration_s: f64,
    /// Duration at constant speed, s.
    cruise_s: f64,
}

impl DoubleS {
    /// Profile that covers `length >= 0`.
    pub fn new(length: f64, limits: &ProfileLimits) -> Self {
        let ProfileLimits {
            velocity,
            acceleration,
            jerk,
        } = *limits;
        let (mut jerk_phase_s, mut acceleration_s) = if velocity * jerk < acceleration.powi(2) {
            let t = (velocity / jerk).sqrt();
            (t, 2.0 * t)
        } else {
            (
                acceleration / jerk,
                acceleration / jerk + velocity / acceleration,
            )
        };
        let mut cruise_s = length / velocity - acceleration_s;
        if cruise_s < 0.0 {
            // The top speed is not reached.
            cruise_s = 0.0;
            let full_jerk_s = acceleration / jerk;
            if length >= 2.0 * acceleration * full_jerk_s.powi(2) {
                jerk_phase_s = full_jerk_s;
                let half = 0.5 * full_jerk_s;
                acceleration_s = half + (half.powi(2) + length / acceleration).sqrt();
            } else {
                jerk_phase_s = libm::cbrt(length / (2.0 * jerk));
                acceleration_s = 2.0 * jerk_phase_s;
            }
        }
        Self {
            length,
            jerk,
            jerk_phase_s,
            acceleration_s,
            cruise_s,
        }
    }

    /// Time from rest to rest, s.
    pub fn duration_s(&self) -> f64 {
        2.0 * self.acceleration_s + self.cruise_s
    }

    /// Highest speed and highest acceleration.
    pub fn peaks(&self) -> (f64, f64) {
        let middle = self.sample(0.5 * self.duration_s());
        (middle.velocity, self.jerk * self.jerk_phase_s)
    }

    /// State at a time; at rest outside the profile.
    pub fn sample(&self, time_s: f64) -> ProfileState {
        let duration_s = self.duration_s();
        if time_s <= 0.5 * duration_s {
            self.first_half(time_s.max(0.0))
        } else {
            // The profile is symmetric in time.
            let mirrored = self.first_half((duration_s - time_s).max(0.0));
            ProfileState {
                position: self.length - mirrored.position,
                velocity: mirrored.velocity,
                acceleration: -mirrored.acceleration,
                jerk: mirrored.jerk,
            }
        }
    }

    fn first_half(&self, t: f64) -> ProfileState {
        let Self {
            jerk: j,
            jerk_phase_s: tj,
            acceleration_s: ta,
            ..
        } = *self;
        let peak_acceleration = j * tj;
        let top_speed = peak_acceleration * (ta - tj);
        if t < tj {
            ProfileState {
                position: j * t.powi(3) / 6.0,
                velocity: 0.5 * j * t.powi(2),
                acceleration: j * t,
                jerk: j,
            }
        } else if t < ta - tj {
            ProfileState {
                position: peak_acceleration * (3.0 * t * (t - tj) + tj.powi(2)) / 6.0,
                velocity: peak_acceleration * (t - 0.5 * tj),
                acceleration: peak_acceleration,
                jerk: 0.0,
            }
        } else if t < ta {
            let left = ta - t;
            ProfileState {
                position: 0.5 * top_speed * ta - top_speed * left + j * left.powi(3) / 6.0,
                velocity: top_speed - 0.5 * j * left.powi(2),
                acceleration: j * left,
                jerk: -j,
            }
        } else {
            ProfileState {
                position: top_speed * (t - 0.5 * ta),
                velocity: top_speed,
                acceleration: 0.0,
                jerk: 0.0,
            }
        }
    }
}
