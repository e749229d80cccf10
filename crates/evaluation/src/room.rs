//! Room that a configuration leaves to the people around it.

use serde::Serialize;

/// The people around the robot, for one configuration.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RoomReport {
    /// Free share of the space around the entry point.
    pub free_fraction: f64,
    /// Unobstructed share of the lines of sight to the entry point.
    pub sight_fraction: f64,
    /// Half-angle of the free cone behind the guide.
    pub hand_cone_half_angle_rad: f64,
    /// Free share of the region on the side that the scenario prefers.
    pub preferred_side_free_fraction: Option<f64>,
    /// Whether the elbow is where the scenario prefers it.
    pub elbow_as_preferred: Option<bool>,
}
