//! Planning rules that reject a configuration before simulation: `[planning]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Objective of the roll angle of the guide about the needle axis, where it is free.
#[derive(
    Debug,
    Clone,
    Copy,
    Default,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Hash,
    Serialize,
    Deserialize,
    JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum RollAim {
    /// Clearance of the final posture: a soft minimum over all classes, `-s ln sum exp(-d / s)` with `s` = 20 mm, so
    /// that a class that the roll does not change does not dominate.
    Clearance,
    /// Margin to the joint limits.
    JointMargin,
    /// Distance from singularities: the minimum of `|sin q5|`, `|sin q3|` and the distance from the shoulder
    /// singularity divided by 100 mm.
    Singularity,
    /// Minimum sensitivity of the needle tip to joint errors.
    TipAccuracy,
    /// The weighted mean of the `[ranking]` utilities of all these, as far as the final posture decides them. The
    /// default.
    #[default]
    Balanced,
}

impl RollAim {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::Clearance,
        Self::JointMargin,
        Self::Singularity,
        Self::TipAccuracy,
        Self::Balanced,
    ];

    /// Name in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Clearance => "clearance",
            Self::JointMargin => "joint_margin",
            Self::Singularity => "singularity",
            Self::TipAccuracy => "tip_accuracy",
            Self::Balanced => "balanced",
        }
    }
}

/// Required distances of the planned needle from structures at risk, from the skin to the target.
///
/// The default of all margins is 2.7 mm: the mean maximum placement error that radiologists accept (153 asked, de Jong
/// et al., Medical Devices 11, 2018, 259-265). With errors up to that, the needle does not reach the structures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct NeedleRouteSection {
    /// Minimum distance of the needle's surface from bone, mm.
    #[schemars(range(min = 0.0, max = 50.0))]
    pub bone_mm: f64,
    /// Minimum distance of the needle's surface from vessels, mm.
    #[schemars(range(min = 0.0, max = 50.0))]
    pub vessel_mm: f64,
    /// Minimum distance of the needle's surface from organs that do not contain the target, mm.
    #[schemars(range(min = 0.0, max = 50.0))]
    pub organ_mm: f64,
    /// Structures that the needle may cross or approach, by name: `bone`, `vessel` or `organ` for a whole tissue, a
    /// structure such as `rib_right_5`, a part, or the `mediastinum` (in `ct routes`, all tissue between the lungs of a
    /// scan). Reports list them.
    pub off: Vec<String>,
}

impl NeedleRouteSection {
    /// Name of the soft tissue between the lungs of a scan.
    pub const MEDIASTINUM: &str = "mediastinum";
}

impl Default for NeedleRouteSection {
    fn default() -> Self {
        const ALLOWED_ERROR_MM: f64 = 2.7;
        Self {
            bone_mm: ALLOWED_ERROR_MM,
            vessel_mm: ALLOWED_ERROR_MM,
            organ_mm: ALLOWED_ERROR_MM,
            off: Vec::new(),
        }
    }
}

/// Planning rules that reject a configuration before simulation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PlanningSection {
    /// Minimum clearance of arm and tool from their surroundings, mm; less rejects a posture or motion. It applies to
    /// all classes of arm and tool against their surroundings except the guide's stand-off from the skin. Larger clearances of `[criteria]` are planned for, but
    /// failing them does not reject a configuration.
    #[schemars(range(min = 0.0, max = 200.0))]
    pub min_clearance_mm: f64,
    /// Minimum self-clearance of arm and tool, mm; less rejects a posture or motion. Forearm and wrist 2 are about 10
    /// mm apart in most postures.
    #[schemars(range(min = 0.0, max = 200.0))]
    pub min_self_clearance_mm: f64,
    /// Minimum clearance of arm and tool from the people of `[[people.persons]]`, mm, if `min_clearance_mm` is not
    /// larger; less rejects a posture or motion. Assumed: the sway of a person standing still.
    #[schemars(range(min = 0.0, max = 500.0))]
    pub min_person_clearance_mm: f64,
    /// Margin that postures and motions are planned with, where possible, beyond the clearances required by
    /// `[criteria]` and these rules, mm. Criteria are evaluated by certified bounds of simulated motions, which differ
    /// from the planned ones by the certificate tolerance (0.1) and the servo's tracking error (assumed below 0.9).
    #[schemars(range(min = 0.0, max = 50.0))]
    pub clearance_reserve_mm: f64,
    /// Minimum `|sin q5|` and `|sin q3|` of the final posture; less rejects it as singular.
    #[schemars(range(min = 0.0, max = 0.9))]
    pub min_singularity_sine: f64,
    /// Minimum distance of wrist 2 from the singular cylinder about the shoulder axis in the final posture, mm:
    /// `sqrt(rho^2 - d4^2)`. Less rejects it as singular.
    #[schemars(range(min = 0.0, max = 300.0))]
    pub min_shoulder_distance_mm: f64,
    /// Rejects a final posture in which a body is in the access zone behind the guide, which needle and hand need.
    pub require_needle_corridor: bool,
    /// Required distances of the planned needle path; a path that violates them is rejected for all configurations.
    pub needle_route: NeedleRouteSection,
    /// Also simulates configurations rejected for a collision, a blocked access zone or the needle path. They stay
    /// rejected.
    pub simulate_rejected: bool,
    /// Number of roll angles about the needle axis that are tried where roll is free. Between them, the limits of the
    /// feasible ranges and the best roll are searched for.
    #[schemars(range(min = 1, max = 3600))]
    pub roll_samples: u32,
    /// Objective of the roll angle: `clearance`, `joint_margin`, `singularity`, `tip_accuracy` or `balanced`.
    pub roll_aim: RollAim,
    /// Maximum displacement of any point of the arm between two collision checks of a motion, mm.
    #[schemars(range(min = 0.1, max = 100.0))]
    pub sample_spacing_mm: f64,
    /// Maximum number of postures that motion planning checks per configuration, where the joint-space line is blocked
    /// or has less clearance than its end postures; 0 for joint-space lines only. A count, not a time: results are the
    /// same on every machine. A posture takes about 10 us.
    pub motion_checks: u32,
    /// Target difference between the minimum clearance found along a motion and its certified lower bound, mm.
    #[schemars(range(min = 0.001, max = 100.0))]
    pub certificate_tolerance_mm: f64,
}

impl Default for PlanningSection {
    fn default() -> Self {
        Self {
            min_clearance_mm: 0.0,
            min_self_clearance_mm: 0.0,
            min_person_clearance_mm: 50.0,
            clearance_reserve_mm: 1.0,
            min_singularity_sine: 0.01,
            min_shoulder_distance_mm: 5.0,
            require_needle_corridor: true,
            needle_route: NeedleRouteSection::default(),
            simulate_rejected: false,
            roll_samples: 36,
            roll_aim: RollAim::default(),
            sample_spacing_mm: 5.0,
            motion_checks: 60_000,
            certificate_tolerance_mm: 0.1,
        }
    }
}
