//! The arm and patient that were drawn.

use serde::Serialize;

/// One draw of the scenario's imperfections: real minus what the controller assumes, world axes unless said.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TruthReport {
    /// The scenario's seed, which decides the draw.
    pub seed: u64,
    /// Place of the flange in the start posture.
    pub flange_offset_m: [f64; 3],
    /// Mass of the tool.
    pub tool_mass_error_kg: f64,
    /// Centre of mass of the tool, flange frame.
    pub tool_com_error_m: [f64; 3],
    /// Zeros of the encoders: reading minus angle.
    pub encoder_offset_rad: Option<[f64; 6]>,
    /// Compliance of the gears.
    pub compliance_rad_per_nm: [f64; 6],
    /// Friction over what the controller assumes.
    pub friction_true_over_nominal: Option<[f64; 6]>,
    /// Registration error of the phantom at the world's origin: translation.
    pub phantom_shift_m: [f64; 3],
    /// Registration error of the phantom: rotation vector.
    pub phantom_turn_rad: [f64; 3],
    /// Displacement of the skin by breathing.
    pub breath_skin_m: [f64; 3],
    /// Displacement of the target by breathing.
    pub breath_target_m: [f64; 3],
    /// Place of the needle's axis at entry and exit of the guide, x and y of the guide's frame.
    pub needle_in_guide_m: [[f64; 2]; 2],
}
