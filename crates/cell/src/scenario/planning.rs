//! What makes a configuration unfit before anything is simulated: `[planning]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What the guide's angle about the needle is chosen for, where it is free.
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
    /// Clearance of the final posture: a soft least over all classes, `-s ln sum exp(-d / s)` with
    /// `s` = 20 mm, so that a class that no roll changes does not decide.
    Clearance,
    /// Margin to the joint limits.
    JointMargin,
    /// Distance from singularities: the least of `|sin q5|`, `|sin q3|` and the distance from the
    /// shoulder's singularity over 100 mm.
    Singularity,
    /// Least motion of the needle's tip under errors of the joints.
    TipAccuracy,
    /// The weighted mean of the `[ranking]` utilities of all these: what configurations are ranked by,
    /// as far as the final posture decides it. The default.
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

/// How far the planned needle has to stay away from what it must not meet, from the skin to the target.
///
/// The default of all margins is 2.7 mm: the mean largest error of a needle's placement that radiologists
/// allow (153 asked, de Jong et al., Medical Devices 11, 2018, 259-265). A needle that is off by no more
/// than that does not meet what a margin keeps it from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct NeedleRouteSection {
    /// Least distance of the needle's surface from bone, mm.
    #[schemars(range(min = 0.0, max = 50.0))]
    pub bone_mm: f64,
    /// From vessels, mm.
    #[schemars(range(min = 0.0, max = 50.0))]
    pub vessel_mm: f64,
    /// From organs that do not contain the target, mm.
    #[schemars(range(min = 0.0, max = 50.0))]
    pub organ_mm: f64,
    /// What the needle may pass through or near all the same, by name: `bone`, `vessel` or `organ` for
    /// all of a tissue, a structure such as `rib_right_5`, a part, or the `mediastinum`, which `ct routes` takes in a
    /// scan for whatever is between the lungs. Reports say what was switched off.
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

/// What makes a configuration unfit before anything is simulated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PlanningSection {
    /// Clearance of arm and tool from their surroundings below which a posture or motion is
    /// rejected, mm: the floor of all classes but the guide's intended stand-off from the skin. What
    /// `[criteria]` wants of a class beyond it is planned for, and missing that fails a configuration but
    /// does not reject it.
    #[schemars(range(min = 0.0, max = 200.0))]
    pub min_clearance_mm: f64,
    /// Clearance of arm and tool from themselves below which a posture or motion is rejected, mm.
    /// Forearm and wrist 2 are about 10 mm apart in most postures.
    #[schemars(range(min = 0.0, max = 200.0))]
    pub min_self_clearance_mm: f64,
    /// Clearance of arm and tool from the people of `[[people.persons]]` below which a posture or motion is rejected, mm,
    /// if `min_clearance_mm` is not larger. The default is assumed: what somebody who stands still sways and shifts.
    #[schemars(range(min = 0.0, max = 500.0))]
    pub min_person_clearance_mm: f64,
    /// What postures and motions are planned to keep beyond what `[criteria]` or the floors want of
    /// each class, where they can, mm: criteria are judged by proven bounds of simulated motions, which
    /// are off the planned ones by the certificate's tolerance (0.1) and by the servo's tracking (assumed
    /// below 0.9).
    #[schemars(range(min = 0.0, max = 50.0))]
    pub clearance_reserve_mm: f64,
    /// `|sin q5|` and `|sin q3|` below which the final posture is rejected as singular.
    #[schemars(range(min = 0.0, max = 0.9))]
    pub min_singularity_sine: f64,
    /// Distance of wrist 2 from the cylinder about the shoulder axis below which the final posture
    /// is rejected as singular, mm: `sqrt(rho^2 - d4^2)`.
    #[schemars(range(min = 0.0, max = 300.0))]
    pub min_shoulder_distance_mm: f64,
    /// Rejects a final posture in which something stands in the volume behind the guide that
    /// needle and hand need.
    pub require_needle_corridor: bool,
    /// What the planned needle keeps away from; a route that does not is no goal for any configuration.
    pub needle_route: NeedleRouteSection,
    /// Simulates configurations too that are rejected for collisions, a blocked corridor or the needle's
    /// route, to see what would happen. They stay rejected.
    pub simulate_rejected: bool,
    /// Directions about the needle that are tried where roll is free; between them the edges of the
    /// ranges that work and the best roll are searched for.
    #[schemars(range(min = 1, max = 3600))]
    pub roll_samples: u32,
    /// What the direction about the needle is chosen for.
    pub roll_aim: RollAim,
    /// Largest step of any point of the arm between two collision checks of a motion, mm.
    #[schemars(range(min = 0.1, max = 100.0))]
    pub sample_spacing_mm: f64,
    /// Postures that the search for a motion may look at per configuration, where the straight joint
    /// motion is blocked or comes nearer to anything than the postures that it joins; 0 for straight
    /// motions only. A count, not a time: results are the same on every machine. A posture takes about
    /// 10 us.
    pub motion_checks: u32,
    /// Distance between the least clearance found along a motion and its proven lower bound that
    /// is aimed at, mm.
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
