//! Rules that a needle path must satisfy.

use needlebench_cell::Tool;
use needlebench_scenario::scenario::{NeedleRouteSection, OddsSection, RouteSection};

use crate::Obstacle;
use crate::bent::RouteNeedle;

/// Why a direction is not an admissible needle path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum RouteRule {
    /// The target is not in the body, or no skin is found.
    NoSkin,
    /// The scan or the phantom ends before the skin.
    End,
    /// The needle does not reach from the guide to the target.
    NeedleTooShort,
    /// An arm, a fold, a marker or the couch is in the way of guide and needle.
    Outside,
    /// Too close to bone.
    Bone,
    /// Too close to a vessel.
    Vessel,
    /// Too close to an organ.
    Organ,
    /// Too many pleural crossings.
    Pleura,
    /// Crosses a fissure.
    Fissure,
    /// Crosses a bulla.
    Bulla,
    /// Behind the target, within the needle's throw, it is too close to an obstacle or leaves the lung.
    Throw,
    /// Too oblique to the skin.
    Oblique,
    /// Bent by tissue, the needle comes too close to bone, a vessel or an organ.
    Bent,
    /// Guide or entry would be in the table or in another object.
    Blocked,
    /// No configuration of the robot is feasible.
    Robot,
}

impl RouteRule {
    /// All of them, in the order of evaluation.
    pub const ALL: [Self; 15] = [
        Self::NoSkin,
        Self::End,
        Self::NeedleTooShort,
        Self::Outside,
        Self::Bone,
        Self::Vessel,
        Self::Organ,
        Self::Pleura,
        Self::Fissure,
        Self::Bulla,
        Self::Throw,
        Self::Oblique,
        Self::Bent,
        Self::Blocked,
        Self::Robot,
    ];

    /// Name in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::NoSkin => "no_skin",
            Self::End => "end_of_body",
            Self::NeedleTooShort => "needle_too_short",
            Self::Outside => "outside",
            Self::Oblique => "oblique",
            Self::Bone => "bone",
            Self::Vessel => "vessel",
            Self::Organ => "organ",
            Self::Pleura => "pleura",
            Self::Fissure => "fissure",
            Self::Bulla => "bulla",
            Self::Throw => "throw",
            Self::Bent => "bent",
            Self::Blocked => "blocked",
            Self::Robot => "robot",
        }
    }

    /// For people.
    pub fn in_words(self) -> &'static str {
        match self {
            Self::NoSkin => "no skin found",
            Self::End => "scan or model ends before the skin",
            Self::NeedleTooShort => "needle too short",
            Self::Outside => "arm, couch, fold or marker in the way",
            Self::Oblique => "too oblique to the skin",
            Self::Bone => "too close to bone",
            Self::Vessel => "too close to a vessel",
            Self::Organ => "too close to an organ",
            Self::Pleura => "too many pleural crossings",
            Self::Fissure => "crosses a fissure",
            Self::Bulla => "crosses a bulla",
            Self::Throw => "needle throw not free",
            Self::Bent => "bent needle too close to bone, vessel or organ",
            Self::Blocked => "guide in table or other object",
            Self::Robot => "no feasible robot configuration",
        }
    }

    /// Unit of its values in JSON.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Oblique => "rad",
            Self::Pleura | Self::Fissure | Self::Bulla | Self::Robot => "1",
            _ => "m",
        }
    }

    /// Whether its limit is a minimum; otherwise it is a maximum.
    pub fn is_least(self) -> bool {
        matches!(
            self,
            Self::Bone | Self::Vessel | Self::Organ | Self::Throw | Self::Bent
        )
    }

    /// The rule about an obstacle.
    pub fn of(obstacle: Obstacle) -> Self {
        match obstacle {
            Obstacle::Bone => Self::Bone,
            Obstacle::Vessel => Self::Vessel,
            Obstacle::Organ => Self::Organ,
        }
    }
}

/// A rule that rejects a direction, with value and limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Refusal {
    /// Which one.
    pub rule: RouteRule,
    /// Its value, in the rule's unit.
    pub value: f64,
    /// The limit: a minimum or a maximum.
    pub limit: f64,
}

/// The rules of a needle path, in SI units.
#[derive(Debug, Clone, PartialEq)]
pub struct RouteRules {
    /// Least distance of the needle's surface from each obstacle without the robot's own error, m, in the order of
    /// [`Obstacle::ALL`].
    pub margins_m: [f64; 3],
    /// The constant part of a margin, to which the expected error is added, m.
    pub constant_m: f64,
    /// Standard deviations that are added to it.
    pub sigmas: f64,
    /// Clearance from each obstacle that the scenario requires in any case, m.
    pub floors_m: [f64; 3],
    /// Half the needle's thickness, m.
    pub needle_radius_m: f64,
    /// Deepest target that the needle reaches, m.
    pub longest_m: f64,
    /// From the skin to the far end of the guide, m.
    pub outside_m: f64,
    /// Largest angle to the skin's normal, rad.
    pub max_skin_angle_rad: f64,
    /// Most pleural crossings allowed.
    pub max_pleural_crossings: u32,
    /// Whether fissures may be crossed.
    pub cross_fissures: bool,
    /// Whether bullae may be crossed.
    pub cross_bullae: bool,
    /// Free distance required behind the target, m.
    pub throw_m: f64,
    /// Odds ratios.
    pub odds: OddsSection,
    /// The needle that bends in tissue, which keeps the same margins bent; none where no needle is known.
    pub needle: Option<RouteNeedle>,
}

/// The default standard deviation of the tip without a robot, m (assumed; see `tip_sd_mm`).
const USUAL_TIP_SD_M: f64 = 1e-3;

impl RouteRules {
    /// From a scenario's sections and its tool; `standoff_m` is from the skin to the guide. Without a robot, its error
    /// is assumed.
    pub fn new(
        section: &RouteSection,
        run: &NeedleRouteSection,
        tool: &Tool,
        standoff_m: f64,
        asks_robot: bool,
    ) -> Self {
        let floors_m = [run.bone_mm, run.vessel_mm, run.organ_mm].map(|mm| mm * 1e-3);
        let usual_m = if asks_robot { 0.0 } else { USUAL_TIP_SD_M };
        let tip_sd_m = section.tip_sd_mm.map_or(usual_m, |mm| mm * 1e-3);
        let constant_m = section.margin_mm * 1e-3;
        let outside_m = standoff_m + tool.guide_length_m();
        let mut rules = Self {
            margins_m: floors_m,
            constant_m,
            sigmas: section.sigmas,
            floors_m,
            needle_radius_m: 0.5 * tool.needle.outer_diameter_m,
            longest_m: tool.needle.length_m - outside_m,
            outside_m,
            max_skin_angle_rad: section.max_skin_angle_deg.to_radians(),
            max_pleural_crossings: section.max_pleural_crossings,
            cross_fissures: section.cross_fissures,
            cross_bullae: section.cross_bullae,
            throw_m: section.throw_mm * 1e-3,
            odds: section.odds.clone(),
            needle: None,
        };
        rules.margins_m = Obstacle::ALL.map(|obstacle| rules.margin_m(obstacle, 0.0, tip_sd_m));
        rules
    }

    /// Least distance from an obstacle, m, of a needle with this lateral bias and standard deviation, m.
    pub fn margin_m(&self, obstacle: Obstacle, bias_m: f64, tip_sd_m: f64) -> f64 {
        let wanted_m = self.constant_m + bias_m + self.sigmas * tip_sd_m;
        wanted_m.max(self.floors_m[obstacle as usize])
    }
}
