//! Start posture and speed limits: `[start]` and `[motion]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Start posture of every motion.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StartSection {
    /// Joint positions, shoulder pan to wrist 3, deg. Default: the arm's.
    #[schemars(inner(range(min = -720.0, max = 720.0)))]
    pub joints_deg: Option<[f64; 6]>,
}

/// Speed limits of the motion, in addition to the joint speed limits of the URDF.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MotionSection {
    /// Joint speed, deg/s. Default: URScript `movej`'s 1.05 rad/s.
    #[schemars(range(min = 0.1, max = 360.0))]
    pub joint_velocity_deg_s: f64,
    /// Joint acceleration, deg/s^2. Default: URScript `movej`'s 1.4 rad/s^2.
    #[schemars(range(min = 1.0, max = 3000.0))]
    pub joint_acceleration_deg_s2: f64,
    /// Joint jerk, deg/s^3. Assumed: full acceleration after 0.14 s.
    #[schemars(range(min = 10.0, max = 1e6))]
    pub joint_jerk_deg_s3: f64,
    /// Speed along the needle axis (linear approach and retreat), mm/s. Assumed: slow near a patient.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub line_velocity_mm_s: f64,
    /// Acceleration along the needle axis (linear approach and retreat), mm/s^2.
    #[schemars(range(min = 1.0, max = 1e4))]
    pub line_acceleration_mm_s2: f64,
    /// Jerk along the needle axis (linear approach and retreat), mm/s^3.
    #[schemars(range(min = 10.0, max = 1e6))]
    pub line_jerk_mm_s3: f64,
    /// Hold time in the final posture, s.
    #[schemars(range(min = 0.1, max = 60.0))]
    pub hold_s: f64,
}

impl Default for MotionSection {
    fn default() -> Self {
        Self {
            joint_velocity_deg_s: 60.0,
            joint_acceleration_deg_s2: 80.0,
            joint_jerk_deg_s3: 570.0,
            line_velocity_mm_s: 50.0,
            line_acceleration_mm_s2: 200.0,
            line_jerk_mm_s3: 1000.0,
            hold_s: 1.0,
        }
    }
}
