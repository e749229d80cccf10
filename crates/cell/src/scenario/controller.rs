//! The joint servo: `[controller]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The joint servo, the same for every engine.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ControllerSection {
    /// Position gain per joint, N m/rad; the arm's own if left out.
    #[schemars(inner(range(min = 0.0, max = 1e6)))]
    pub stiffness_nm_rad: Option<[f64; 6]>,
    /// Velocity gain per joint, N m s/rad; the arm's own if left out.
    #[schemars(inner(range(min = 0.0, max = 1e5)))]
    pub damping_nms_rad: Option<[f64; 6]>,
    /// Reflected rotor inertia per joint, kg m^2; the arm's own if left out.
    #[schemars(inner(range(min = 0.0, max = 10.0)))]
    pub armature_kgm2: Option<[f64; 6]>,
    /// Acceleration of gravity that the controller believes in, m/s^2: of its feed-forward, for arm and tool
    /// alike. The world's (`engines.gravity_m_s2`) if left out. A UR's own controller has 9.82: give that to
    /// compare with one. An arm under another gravity than its controller's stands off by the difference
    /// of the torques over the position gain.
    #[schemars(range(min = 0.0, max = 20.0), extend("x-hint" = "it is the magnitude, in m/s^2: 9.82"))]
    pub gravity_m_s2: Option<f64>,
}
