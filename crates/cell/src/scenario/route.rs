//! How a needle's route is planned: `[goals.route]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a planned route has to keep, and what it is chosen by.
///
/// With this section a goal has no entry: the route planner chooses it, among those that the robot reaches. Besides what
/// stands here a route keeps the margins of `[planning.needle_route]`, the needle is long enough, and its line
/// passes the skin once.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RouteSection {
    /// What a needle keeps from bone, vessels and organs beyond its own expected error, mm (assumed). The distance has to
    /// be at least this, plus the expected mean error across the needle, plus `sigmas` standard deviations of
    /// it, and at least what `[planning.needle_route]` asks for.
    #[schemars(range(min = 0.0, max = 50.0))]
    pub margin_mm: f64,
    /// Standard deviations of the tip across the needle that are added to `margin_mm`: 2 hold 95 % in one direction.
    #[schemars(range(min = 0.0, max = 6.0))]
    pub sigmas: f64,
    /// Standard deviation of the tip across the needle, mm, that routes are planned with before the robot is asked, and
    /// where no robot can be asked. Left out: 0 where a robot is asked, since its own error budget then decides in each
    /// configuration; else 1 mm (assumed; guides in CT have mean errors across the needle of 0.7 to 1.4 mm,
    /// PMC9474375, jcm11133746).
    #[schemars(range(min = 0.0, max = 20.0))]
    pub tip_sd_mm: Option<f64>,
    /// Largest angle between the needle and the skin's normal, deg: beyond it a needle slips along the skin (assumed).
    #[schemars(range(min = 1.0, max = 89.0))]
    pub max_skin_angle_deg: f64,
    /// How often the needle may enter a lung; more than once raises the odds of a pneumothorax 2.43 times (PMC7362905).
    #[schemars(range(min = 0, max = 9))]
    pub max_pleural_crossings: u32,
    /// Whether it may cross a fissure between lobes, where fissures are known: 3.75 times the odds (PMC7362905).
    pub cross_fissures: bool,
    /// Whether it may cross a bulla, where bullae are known: 6.13 times the odds (PMC7362905).
    pub cross_bullae: bool,
    /// What the needle's own mechanism advances beyond the target, mm: it has to be clear there, too. Side-cutting
    /// biopsy needles throw 10 or 20 mm (makers' data; 10 assumed).
    #[schemars(range(min = 0.0, max = 50.0))]
    pub throw_mm: f64,
    /// Vessels within a lung that are at least this thick are kept away from, mm; thinner ones cannot be avoided
    /// (assumed). For routes in a CT.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub lung_vessel_mm: f64,
    /// What below each bone of the chest wall is taken for intercostal vessels, mm: plain CT does not show them
    /// (assumed; they run along the rib's lower edge). For routes in a CT; modelled phantoms have them.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub below_rib_mm: f64,
    /// Odds ratios by which routes are compared.
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
            odds: OddsSection::default(),
        }
    }
}

/// Odds ratios of a pneumothorax, as published for CT-guided lung biopsy (meta-analysis of 23 104 patients, PMC7362905)
/// unless said otherwise. The sum of their logarithms orders routes. It is no probability: the ratios come from
/// different studies and are not independent.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OddsSection {
    /// Crosses a fissure.
    #[schemars(range(min = 0.01, max = 100.0))]
    pub fissure: f64,
    /// Crosses a bulla.
    #[schemars(range(min = 0.01, max = 100.0))]
    pub bulla: f64,
    /// Enters a lung more than once.
    #[schemars(range(min = 0.01, max = 100.0))]
    pub second_puncture: f64,
    /// More than `deep_mm` of lung on the way.
    #[schemars(range(min = 0.01, max = 100.0))]
    pub deep: f64,
    /// What counts as deep, mm.
    #[schemars(range(min = 0.0, max = 300.0))]
    pub deep_mm: f64,
    /// The lesion does not touch the pleura: the same for all routes to it.
    #[schemars(range(min = 0.01, max = 100.0))]
    pub no_pleural_contact: f64,
    /// The needle is of 18 G (1.27 mm) or thicker: the same for all routes.
    #[schemars(range(min = 0.01, max = 100.0))]
    pub thick_needle: f64,
    /// Along the pleura instead of square to it, in proportion to the angle (assumed: one study of 215 patients found an
    /// effect, PMC6479149, another of 689 did not, ijr-96221).
    #[schemars(range(min = 0.01, max = 100.0))]
    pub along_pleura: f64,
    /// Along the body instead of in an axial plane, in proportion to the angle beyond `gantry_tilt_deg` (assumed: what is
    /// in one slice is easier to follow).
    #[schemars(range(min = 0.01, max = 100.0))]
    pub out_of_plane: f64,
    /// How far the gantry can be tilted to have the needle in one slice, deg.
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
