//! Planning of the needle path: `[goals.route]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Constraints and objectives of a planned needle path.
///
/// With this section a goal has no entry: the path planner chooses it among those that are feasible for the robot. In
/// addition, a path satisfies the margins of `[planning.needle_route]`, the needle is long enough, and its axis crosses
/// the skin once.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RouteSection {
    /// Required distance of the needle from bone, vessels and organs beyond its own error, mm (assumed). The required
    /// distance is this plus the mean lateral error plus `sigmas` standard deviations of it, and at least that of
    /// `[planning.needle_route]`.
    #[schemars(range(min = 0.0, max = 50.0))]
    pub margin_mm: f64,
    /// Number of standard deviations of the lateral tip error added to `margin_mm`: 2 cover 95 % in one direction.
    #[schemars(range(min = 0.0, max = 6.0))]
    pub sigmas: f64,
    /// Standard deviation of the lateral tip error, mm, used before the robot is checked, and where no robot can be
    /// checked. Default: 0 with a robot, since its own error budget then decides in each configuration; else 1 mm
    /// (assumed; guides in CT have mean lateral errors of 0.7 to 1.4 mm, PMC9474375, jcm11133746).
    #[schemars(range(min = 0.0, max = 20.0))]
    pub tip_sd_mm: Option<f64>,
    /// Maximum angle between the needle and the skin's normal, deg: beyond it the needle slips along the skin
    /// (assumed).
    #[schemars(range(min = 1.0, max = 89.0))]
    pub max_skin_angle_deg: f64,
    /// Maximum number of times that the needle enters a lung; more than one raises the odds of a pneumothorax by a
    /// factor of 2.43 (PMC7362905).
    #[schemars(range(min = 0, max = 9))]
    pub max_pleural_crossings: u32,
    /// Whether the needle may cross a fissure between lobes, where fissures are known: pneumothorax odds ratio 3.75
    /// (PMC7362905).
    pub cross_fissures: bool,
    /// Whether the needle may cross a bulla, where bullae are known: pneumothorax odds ratio 6.13 (PMC7362905).
    pub cross_bullae: bool,
    /// Throw of the needle beyond the target, mm, which must be clear as well. Side-cutting biopsy needles have 10 or
    /// 20 mm (manufacturers' data; 10 assumed).
    #[schemars(range(min = 0.0, max = 50.0))]
    pub throw_mm: f64,
    /// Minimum diameter of the vessels within a lung that are avoided, mm; thinner ones cannot be avoided (assumed).
    /// For needle paths in a CT.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub lung_vessel_mm: f64,
    /// Thickness of the zone below each bone of the chest wall that is treated as intercostal vessels, mm: plain CT
    /// does not show them (assumed; they run along the lower edge of the rib). For needle paths in a CT; modelled
    /// phantoms have the vessels.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub below_rib_mm: f64,
    /// How far beside the edges of the sternum internal mammary vessels are modelled, mm, behind the cartilages: plain
    /// CT does not show them (assumed; Glassberg et al. ask to plan around them, AJR 155:397, 1990). For needle paths in
    /// a CT.
    #[schemars(range(min = 0.0, max = 40.0))]
    pub beside_sternum_mm: f64,
    /// Odds ratios by which needle paths are ranked.
    pub odds: OddsSection,
}

impl Default for RouteSection {
    fn default() -> Self {
        Self {
            margin_mm: 1.0,
            sigmas: 2.0,
            tip_sd_mm: None,
            max_skin_angle_deg: 60.0,
            max_pleural_crossings: 1,
            cross_fissures: false,
            cross_bullae: false,
            throw_mm: 10.0,
            lung_vessel_mm: 3.0,
            below_rib_mm: 3.0,
            beside_sternum_mm: 20.0,
            odds: OddsSection::default(),
        }
    }
}

/// Odds ratios of a pneumothorax, as published for CT-guided lung biopsy (meta-analysis of 23 104 patients, PMC7362905)
/// unless stated otherwise. Needle paths are ranked by the sum of their logarithms. It is not a probability: the ratios
/// come from different studies and are not independent.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OddsSection {
    /// Crossing a fissure.
    #[schemars(range(min = 0.01, max = 100.0))]
    pub fissure: f64,
    /// Crossing a bulla.
    #[schemars(range(min = 0.01, max = 100.0))]
    pub bulla: f64,
    /// Entering a lung more than once.
    #[schemars(range(min = 0.01, max = 100.0))]
    pub second_puncture: f64,
    /// More than `deep_mm` of lung along the path.
    #[schemars(range(min = 0.01, max = 100.0))]
    pub deep: f64,
    /// Length of lung along the path above which `deep` applies, mm.
    #[schemars(range(min = 0.0, max = 300.0))]
    pub deep_mm: f64,
    /// The lesion does not touch the pleura: equal for all paths to it.
    #[schemars(range(min = 0.01, max = 100.0))]
    pub no_pleural_contact: f64,
    /// The needle is 18 G (1.27 mm) or thicker: equal for all paths.
    #[schemars(range(min = 0.01, max = 100.0))]
    pub thick_needle: f64,
    /// Needle tangential instead of perpendicular to the pleura, in proportion to the angle (assumed: one study of 215
    /// patients found an effect, PMC6479149, another of 689 did not, ijr-96221).
    #[schemars(range(min = 0.01, max = 100.0))]
    pub along_pleura: f64,
    /// Needle along the body axis instead of in an axial plane, in proportion to the angle beyond `gantry_tilt_deg`
    /// (assumed: a needle within one slice is easier to follow).
    #[schemars(range(min = 0.01, max = 100.0))]
    pub out_of_plane: f64,
    /// Maximum gantry tilt available to align the slice with the needle, deg.
    #[schemars(range(min = 0.0, max = 45.0))]
    pub gantry_tilt_deg: f64,
}

impl Default for OddsSection {
    fn default() -> Self {
        Self {
            fissure: 3.75,
            bulla: 6.13,
            second_puncture: 2.43,
            deep: 2.38,
            deep_mm: 30.0,
            no_pleural_contact: 1.73,
            thick_needle: 1.55,
            along_pleura: 1.2,
            out_of_plane: 1.1,
            gantry_tilt_deg: 30.0,
        }
    }
}
