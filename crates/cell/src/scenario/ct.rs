//! The scan that a run begins from: `[ct]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::phantom::NO_MODEL;
use super::{MarkerKind, Scenario};
use crate::Finding;
use crate::toml_text::TomlText;

/// Slices of a scan: their thickness and the distance between them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ScanSlices {
    /// 1 mm.
    #[default]
    Thin,
    /// 2.5 mm, as while needles are placed.
    Biopsy,
    /// 5 mm.
    Thick,
    /// 5 mm every 2.5 mm.
    ThickOverlap,
}

/// Reconstruction kernel: sharper ones are noisier.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ScanKernel {
    /// For soft tissue: a blur of 0.55 mm, noise of 20 HU at 1 mm slices.
    #[default]
    Smooth,
    /// For lung and bone: a blur of 0.3 mm, noise of 50 HU.
    Sharp,
}

/// A synthetic CT of the phantom, made at the start of a run. The run then knows what is seen in it and nothing
/// else: surfaces, lesions and markers are reconstructed from the scan, the robot is registered by the markers, needles
/// are planned for the lesions that are found there, and measured against those that the phantom has.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CtSection {
    /// `thin` (1 mm), `biopsy` (2.5 mm), `thick` (5 mm) or `thick_overlap` (5 mm every 2.5 mm).
    pub slices: ScanSlices,
    /// `smooth` or `sharp`.
    pub kernel: ScanKernel,
    /// Columns and rows of a slice.
    #[schemars(range(min = 64, max = 1024))]
    pub pixels: u16,
    /// Standard deviation of the noise in the middle at 1 mm slices and dose 1, HU; the kernel's if left out, 0 for none.
    #[schemars(range(min = 0.0, max = 500.0))]
    pub noise_hu: Option<f64>,
    /// Dose, of the usual one: noise falls with its root, and with that of the thickness.
    #[schemars(range(min = 0.01, max = 100.0))]
    pub dose: f64,
    /// Dense parts leave streaks.
    pub streaks: bool,
    /// Tilt of the gantry, deg.
    #[schemars(range(min = -30.0, max = 30.0))]
    pub tilt_deg: f64,
    /// Hounsfield units of vessels: 150 to 300 with contrast medium.
    #[schemars(range(min = -100.0, max = 1000.0))]
    pub vessels_hu: f64,
    /// Markers that are used, by their names; all that the phantom has if left out.
    pub markers: Option<Vec<String>>,
    /// Standard deviation along each axis of the places of markers as the robot has them, mm. Assumed: the centre of a
    /// marker touched with the needle's tip.
    #[schemars(range(min = 0.001, max = 10.0))]
    pub touch_mm: f64,
    /// Standard deviation along each axis of where a person points to in a lesion, from which it is grown, mm. Assumed.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub click_mm: f64,
    /// Place of the phantom's origin in the scan, mm. Where it lies between voxels is drawn besides.
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
            touch_mm: 0.3,
            click_mm: 1.0,
            shift_mm: [0.0; 3],
        }
    }
}

/// What keeps a scenario from beginning with a scan.
pub(super) fn check(toml: &TomlText<'_>, scenario: &Scenario) -> Vec<Finding> {
    if scenario.ct.is_none() {
        return Vec::new();
    }
    let mut findings = Vec::new();
    match &scenario.phantom {
        None => findings.push(
            toml.finding("ct", "there is nobody to scan")
                .hint("add a [phantom] with `markers = \"ct_sphere\"`"),
        ),
        Some(phantom) if phantom.model == NO_MODEL || !phantom.parts.is_empty() => findings.push(
            toml.finding(
                "ct",
                "only the model's own phantoms are scanned, not parts from files",
            )
            .hint("leave `parts` out; a real scan is built with `needlebench ct build`"),
        ),
        Some(phantom) if phantom.markers == Some(MarkerKind::Disc) => findings.push(
            toml.finding(
                "phantom.markers",
                "CT does not tell discs from skin: the robot could not be registered",
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
                    "with [ct] a goal names the lesion that is found in the scan",
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
                .hint("leave `true_target_mm` and `target_offset_mm` out"),
            );
        }
    }
    if scenario.goals.is_empty() {
        findings.push(
            toml.finding("ct", "a scan is of use for goals alone, and there are none")
                .hint("add [[goals]], or leave [ct] out"),
        );
    }
    if let Some(names) = scenario.ct.as_ref().and_then(|ct| ct.markers.as_ref())
        && names.len() < 3
    {
        findings.push(
            toml.finding("ct.markers", format!("{} markers", names.len()))
                .hint("a rigid registration needs three that are not on one line"),
        );
    }
    findings
}
