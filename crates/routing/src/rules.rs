//! What a route has to keep.

use needlebench_cell::Tool;
use needlebench_cell::scenario::{NeedleRouteSection, OddsSection, RouteSection};

use crate::Obstacle;

/// Why a direction is no route.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum RouteRule {
    /// The target is not in the body, or no skin is found.
    NoSkin,
    /// It leaves the body where the scan or the phantom ends.
    End,
    /// The needle does not reach from the guide to the target.
    NeedleTooShort,
    /// An arm, a fold or a marker is where guide and needle are.
    Outside,
    /// Too near to bone.
    Bone,
    /// Too near to a vessel.
    Vessel,
    /// Too near to an organ.
    Organ,
    /// Enters lungs too often.
    Pleura,
    /// Crosses a fissure.
    Fissure,
    /// Crosses a bulla.
    Bulla,
    /// Behind the target, where the needle's mechanism throws it, it is too near to something or leaves the lung.
    Throw,
    /// Too oblique to the skin.
    Oblique,
    /// Guide or entry would be in the table or in other things.
    Blocked,
    /// No configuration of the robot works there.
    Robot,
}

impl RouteRule {
    /// All of them, in the order in which they are asked.
    pub const ALL: [Self; 14] = [
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
        Self::Blocked,
        Self::Robot,
    ];

    /// As JSON has it.
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
            Self::Blocked => "blocked",
            Self::Robot => "robot",
        }
    }

    /// For people.
    pub fn in_words(self) -> &'static str {
        match self {
            Self::NoSkin => "no skin found",
            Self::End => "skin is not known there",
            Self::NeedleTooShort => "needle too short",
            Self::Outside => "arm, fold or marker on the skin",
            Self::Oblique => "too oblique to the skin",
            Self::Bone => "bone in the way",
            Self::Vessel => "vessel in the way",
            Self::Organ => "organ in the way",
            Self::Pleura => "enters lungs too often",
            Self::Fissure => "crosses a fissure",
            Self::Bulla => "crosses a bulla",
            Self::Throw => "throw of the needle not free",
            Self::Blocked => "guide in table or other things",
            Self::Robot => "no configuration of the robot works",
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

    /// Whether its limit is the least that there has to be; else it is the most that there may be.
    pub fn is_least(self) -> bool {
        matches!(self, Self::Bone | Self::Vessel | Self::Organ | Self::Throw)
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

/// A rule that a direction breaks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Refusal {
    /// Which one.
    pub rule: RouteRule,
    /// What it has, in the rule's unit.
    pub value: f64,
    /// What it may have at most, or has to have at least.
    pub limit: f64,
}

/// The rules of a route, in SI.
#[derive(Debug, Clone, PartialEq)]
pub struct RouteRules {
    /// Least distance of the needle's surface from each obstacle without the robot's own error, m, in the order of
    /// [`Obstacle::ALL`].
    pub margins_m: [f64; 3],
    /// The constant part of a margin, to which the expected error is added, m.
    pub constant_m: f64,
    /// Standard deviations that are added to it.
    pub sigmas: f64,
    /// What the scenario keeps from each obstacle in any case, m.
    pub floors_m: [f64; 3],
    /// Half the needle's thickness, m.
    pub needle_radius_m: f64,
    /// Deepest target that the needle reaches, m.
    pub longest_m: f64,
    /// From the skin to the far end of the guide, m.
    pub outside_m: f64,
    /// Largest angle to the skin's normal, rad.
    pub max_skin_angle_rad: f64,
    /// How often lungs may be entered.
    pub max_pleural_crossings: u32,
    /// Whether fissures may be crossed.
    pub cross_fissures: bool,
    /// Whether bullae may be crossed.
    pub cross_bullae: bool,
    /// What is needed free behind the target, m.
    pub throw_m: f64,
    /// Odds ratios.
    pub odds: OddsSection,
}

/// The usual standard deviation of the tip where no robot tells its own, m (assumed; see `tip_sd_mm`).
const USUAL_TIP_SD_M: f64 = 1e-3;

impl RouteRules {
    /// Of a scenario's sections and its tool; `standoff_m` is from the skin to the guide. Where no robot is asked its
    /// error is assumed.
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
        };
        rules.margins_m = Obstacle::ALL.map(|obstacle| rules.margin_m(obstacle, 0.0, tip_sd_m));
        rules
    }

    /// Least distance from an obstacle, m, of a needle with an expected mean error and standard deviation across it, m.
    pub fn margin_m(&self, obstacle: Obstacle, bias_m: f64, tip_sd_m: f64) -> f64 {
        let wanted_m = self.constant_m + bias_m + self.sigmas * tip_sd_m;
        wanted_m.max(self.floors_m[obstacle as usize])
    }
}
