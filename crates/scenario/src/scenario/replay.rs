//! Limits for the comparison with a recorded run of a real arm: `[replay]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Maximum differences between a recorded run of a real arm and its replay in the engines. A limit that is not given is
/// not evaluated.
///
/// Used by `needlebench replay LOG --scenario THIS`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ReplaySection {
    /// Maximum RMS residual of a joint's `target_moment` after identification, on held-out rows, N m.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub max_moment_rms_nm: Option<f64>,
    /// Maximum distance between simulated and real tip at any time, in each engine, mm. Both follow from the joint
    /// angles; the tip is 200 mm beyond the flange.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub max_tracking_mm: Option<f64>,
    /// Maximum RMS difference between simulated and measured current of a joint, over the rows in which it moves, in
    /// each engine, A.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub max_current_rms_a: Option<f64>,
    /// Maximum RMS error of the calibration on held-out rows, mm.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub max_calibration_mm: Option<f64>,
}
