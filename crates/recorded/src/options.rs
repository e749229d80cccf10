//! What a user says of a log that the log does not.

use needlebench_scenario::LogColumns;

/// What a user says of a log.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ReadOptions {
    /// Unit of the clock.
    pub time: Option<TimeUnit>,
    /// Unit of the joints' angles.
    pub angle: Option<AngleUnit>,
    /// What `effort` of joint states means.
    pub effort: Option<EffortMeaning>,
    /// Rows per second, in place of the log's clock.
    pub rate_hz: Option<f64>,
    /// Name of the column that is the clock.
    pub time_column: Option<String>,
    /// Topic of the joint states.
    pub topic: Option<String>,
    /// Which column is what.
    pub columns: Option<LogColumns>,
}

/// Unit of a clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TimeUnit {
    /// Seconds.
    Seconds,
    /// Milliseconds.
    Milliseconds,
    /// Microseconds.
    Microseconds,
    /// Nanoseconds.
    Nanoseconds,
}

impl TimeUnit {
    /// Factor to seconds.
    pub fn to_s(self) -> f64 {
        match self {
            Self::Seconds => 1.0,
            Self::Milliseconds => 1e-3,
            Self::Microseconds => 1e-6,
            Self::Nanoseconds => 1e-9,
        }
    }
}

/// Unit of the joints' angles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AngleUnit {
    /// Radians.
    Radians,
    /// Degrees.
    Degrees,
}

impl AngleUnit {
    /// Factor to radians.
    pub fn to_rad(self) -> f64 {
        match self {
            Self::Radians => 1.0,
            Self::Degrees => 1_f64.to_radians(),
        }
    }
}

/// The three meanings that `effort` of ROS's joint states has had in drivers of UR arms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EffortMeaning {
    /// Motor currents, A.
    Current,
    /// Torques at the joints, N m.
    Torque,
    /// Torques without the share that holds arm and load against gravity, N m.
    Compensated,
}
