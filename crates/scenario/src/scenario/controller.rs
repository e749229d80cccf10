//! The joint servo: `[controller]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The joint servo, the same for every engine.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ControllerSection {
    /// Position gain per joint, N m/rad. Default: the arm's.
    #[schemars(inner(range(min = 0.0, max = 1e6)))]
    pub stiffness_nm_rad: Option<[f64; 6]>,
    /// Velocity gain per joint, N m s/rad. Default: the arm's.
    #[schemars(inner(range(min = 0.0, max = 1e5)))]
    pub damping_nms_rad: Option<[f64; 6]>,
    /// Reflected rotor inertia per joint, kg m^2. Default: the arm's.
    #[schemars(inner(range(min = 0.0, max = 10.0)))]
    pub armature_kgm2: Option<[f64; 6]>,
    /// Gravity in the controller's feed-forward for arm and tool, m/s^2. Default: `engines.gravity_m_s2`; a UR
    /// controller uses 9.82. A difference to the world's gravity deflects the arm by the torque difference divided by
    /// the position gain.
    #[schemars(range(min = 0.0, max = 20.0), extend("x-hint" = "it is the magnitude, in m/s^2: 9.82"))]
    pub gravity_m_s2: Option<f64>,
}
