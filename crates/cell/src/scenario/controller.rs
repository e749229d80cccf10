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
}
