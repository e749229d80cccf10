//! What a recorded run of a real arm has to agree with: `[replay]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How near a recorded run and its replay in the engines have to be; what is left out is not judged.
///
/// Used by `needlebench replay LOG --scenario THIS`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ReplaySection {
    /// Largest root mean square, over the run, of what the identified arm leaves of a joint's
    /// `target_moment`, on rows that the identification has not seen, N m.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub max_moment_rms_nm: Option<f64>,
    /// Largest distance at any time of the simulated tip from the real one, both by the joint angles, in
    /// each engine, mm. The tip is 200 mm beyond the flange.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub max_tracking_mm: Option<f64>,
    /// Largest root mean square, over the rows in which a joint moves, of the difference of its simulated
    /// and measured currents, in each engine, A.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub max_current_rms_a: Option<f64>,
    /// Largest root mean square error of the calibration on rows that it has not seen, mm.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub max_calibration_mm: Option<f64>,
}
