//! The scan that a run begins with: `[ct]`.

use needlebench_input::{Finding, TomlText};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::phantom::NO_MODEL;
use super::{MarkerKind, Scenario};

/// Slice thickness and spacing of a scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ScanSlices {
    /// 1 mm.
    #[default]
    Thin,
    /// 2.5 mm, as in CT-guided interventions.
    Biopsy,
    /// 5 mm.
    Thick,
    /// 5 mm thick, spacing 2.5 mm.
    ThickOverlap,
}

/// Reconstruction kernel. Sharper kernels are noisier.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ScanKernel {
    /// Soft tissue: blur 0.55 mm, noise 20 HU at 1 mm slices.
    #[default]
    Smooth,
    /// Lung and bone: blur 0.3 mm, noise 50 HU at 1 mm slices.
    Sharp,
}

/// Synthetic CT of the phantom, rendered at the start of a run. The run then uses the scan alone: surfaces, lesions and
/// markers are reconstructed from it, the robot is registered by the markers, and needles are planned for the lesions
/// found. The results are compared with the phantom's own lesions (ground truth).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CtSection {
    /// Slice thickness and spacing: `thin` (1 mm), `biopsy` (2.5 mm), `thick` (5 mm) or `thick_overlap` (5 mm thick,
    /// spacing 2.5 mm).
    pub slices: ScanSlices,
    /// Reconstruction kernel: `smooth` or `sharp`.
    pub kernel: ScanKernel,
    /// Number of columns and rows of a slice.
    #[schemars(range(min = 64, max = 1024))]
    pub pixels: u16,
    /// Standard deviation of the noise at the centre, for 1 mm slices and dose 1, HU; 0 for none. Default: the
    /// kernel's.
    #[schemars(range(min = 0.0, max = 500.0))]
    pub noise_hu: Option<f64>,
    /// Relative dose; noise scales with 1/sqrt(dose x slice thickness).
    #[schemars(range(min = 0.01, max = 100.0))]
    pub dose: f64,
    /// Adds streak artefacts of dense parts.
    pub streaks: bool,
    /// Gantry tilt, deg.
    #[schemars(range(min = -30.0, max = 30.0))]
    pub tilt_deg: f64,
    /// CT number of vessels, HU; 150 to 300 with contrast medium.
    #[schemars(range(min = -100.0, max = 1000.0))]
    pub vessels_hu: f64,
    /// Names of the markers to use. Default: all markers of the phantom.
    pub markers: Option<Vec<String>>,
    /// Standard deviation per axis of the marker positions digitised with the robot, mm. Assumed: the marker's centre
    /// is digitised with the needle tip.
    #[serde(alias = "touch_mm")]
    #[schemars(range(min = 0.001, max = 10.0), extend("x-former" = "touch_mm"))]
    pub fle_sd_mm: f64,
    /// Standard deviation per axis of the seed point that a reader sets in a lesion for segmentation, mm. Assumed.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub click_mm: f64,
    /// Position of the phantom's origin in the scan, mm. The offset within a voxel is sampled in addition.
    #[schemars(inner(range(min = -10.0, max = 10.0)))]
    pub shift_mm: [f64; 3],
}

impl Default for CtSection {
    fn default() -> Self {
        Self {
            slices: ScanSlices::default(),
            kernel: ScanKernel::default(),
            pixels: 512,
            noise_hu: None,
            dose: 1.0,
            streaks: false,
            tilt_deg: 0.0,
            vessels_hu: 45.0,
            markers: None,
            fle_sd_mm: 0.3,
            click_mm: 1.0,
            shift_mm: [0.0; 3],
        }
    }
}

/// Checks that a scenario can begin with a scan.
pub(super) fn check(toml: &TomlText<'_>, scenario: &Scenario) -> Vec<Finding> {
    if scenario.ct.is_none() {
        return Vec::new();
    }
    let mut findings = Vec::new();
    match &scenario.phantom {
        None => findings.push(
            toml.finding("ct", "[ct] requires a [phantom]")
                .hint("add a [phantom] with `markers = \"ct_sphere\"`"),
        ),
        Some(phantom) if phantom.model == NO_MODEL || !phantom.parts.is_empty() => findings.push(
            toml.finding(
                "ct",
                "[ct] scans modelled phantoms only, not parts from files",
            )
            .hint("omit `parts`; use `needlebench ct build` for a real scan"),
        ),
        Some(phantom) if phantom.markers == Some(MarkerKind::Disc) => findings.push(
            toml.finding(
                "phantom.markers",
                "discs are isodense with skin in CT: the robot could not be registered",
            )
            .hint("`markers = \"ct_sphere\"`"),
        ),
        Some(_) => {}
    }
    for (index, goal) in scenario.goals.iter().enumerate() {
        let key = format!("goals[{index}]");
        if goal.lesion.is_none() {
            findings.push(
                toml.finding(
                    &key,
                    "with [ct] a goal must name a lesion, which is then found in the scan",
                )
                .hint("`lesion = \"...\"` instead of `target_mm` or `flange_pose`"),
            );
        }
        if goal.true_target_mm.is_some() || goal.target_offset_mm.is_some() {
            findings.push(
                toml.finding(
                    &key,
                    "with [ct] the true target is the phantom's lesion itself",
                )
                .hint("omit `true_target_mm` and `target_offset_mm`"),
            );
        }
    }
    if scenario.goals.is_empty() {
        findings.push(
            toml.finding("ct", "[ct] requires goals, but there are none")
                .hint("add [[goals]], or omit [ct]"),
        );
    }
    if let Some(names) = scenario.ct.as_ref().and_then(|ct| ct.markers.as_ref())
        && names.len() < 3
    {
        findings.push(
            toml.finding("ct.markers", format!("{} markers", names.len()))
                .hint("a rigid registration needs three that are not collinear"),
        );
    }
    findings
}
