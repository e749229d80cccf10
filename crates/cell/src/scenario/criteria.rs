//! What every working configuration has to reach: `[criteria]`.
//!
//! A criterion is switched off by its name, `max_settling_time_s = "off"`, and by nothing else: the ranges
//! leave out what nothing could reach, such as a negative error, and what nothing could miss, such as a
//! clearance below 0 or of many metres.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::switch;
use crate::ClearanceClass;

/// Least clearances, mm; a class that is left out or `"off"` is not judged.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ClearanceCriteria {
    /// Arm against the skin.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 500.0), extend("x-off" = true, "x-unit" = "mm"))]
    pub robot_phantom: Option<f64>,
    /// Arm and tool against the table.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 500.0), extend("x-off" = true, "x-unit" = "mm"))]
    pub robot_table: Option<f64>,
    /// Arm and tool against the gantry.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 1000.0), extend("x-off" = true, "x-unit" = "mm"))]
    pub robot_gantry: Option<f64>,
    /// Arm and tool against the mount.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 500.0), extend("x-off" = true, "x-unit" = "mm"))]
    pub robot_mount: Option<f64>,
    /// Arm and tool against the obstacles of `[[obstacles]]`.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 1000.0), extend("x-off" = true, "x-unit" = "mm"))]
    pub robot_obstacle: Option<f64>,
    /// Arm and tool against the people of `[[people.persons]]`, who stand still.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 1000.0), extend("x-off" = true, "x-unit" = "mm"))]
    pub robot_person: Option<f64>,
    /// Arm and tool against themselves.
    #[serde(rename = "self", with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 100.0), extend("x-off" = true, "x-unit" = "mm"))]
    pub self_collision: Option<f64>,
    /// Tool, without its guide tube, against the skin.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 200.0), extend("x-off" = true, "x-unit" = "mm"))]
    pub tool_phantom: Option<f64>,
    /// Guide tube against the skin.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 200.0), extend("x-off" = true, "x-unit" = "mm"))]
    pub guide_standoff: Option<f64>,
    /// Volume behind the guide against everything else.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 300.0), extend("x-off" = true, "x-unit" = "mm"))]
    pub needle_corridor: Option<f64>,
    /// Planned needle against bone, vessel and organ.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 100.0), extend("x-off" = true, "x-unit" = "mm"))]
    pub needle_route: Option<f64>,
}

impl ClearanceCriteria {
    /// Least clearance of a class, mm; `None` if it is not judged.
    pub fn least_mm(&self, class: ClearanceClass) -> Option<f64> {
        match class {
            ClearanceClass::RobotPhantom => self.robot_phantom,
            ClearanceClass::RobotTable => self.robot_table,
            ClearanceClass::RobotGantry => self.robot_gantry,
            ClearanceClass::RobotMount => self.robot_mount,
            ClearanceClass::RobotObstacle => self.robot_obstacle,
            ClearanceClass::RobotPerson => self.robot_person,
            ClearanceClass::SelfCollision => self.self_collision,
            ClearanceClass::ToolPhantom => self.tool_phantom,
            ClearanceClass::GuideStandoff => self.guide_standoff,
            ClearanceClass::NeedleCorridor => self.needle_corridor,
            ClearanceClass::NeedleRoute => self.needle_route,
        }
    }
}

/// What every working configuration has to reach, in each engine; what is `"off"` is not judged.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CriteriaSection {
    /// Largest settled distance of the needle tip from the target, mm.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 1e-12, max = 100.0), extend("x-off" = true))]
    pub max_tip_position_error_mm: Option<f64>,
    /// Largest settled distance of the needle's tip from the goal's `true_target_mm`, mm; says nothing of goals
    /// without one.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 1e-12, max = 100.0), extend("x-off" = true))]
    pub max_true_target_error_mm: Option<f64>,
    /// Largest settled distance of the goal's `true_target_mm` from the needle's axis, across the needle, mm.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 1e-12, max = 100.0), extend("x-off" = true))]
    pub max_true_target_lateral_mm: Option<f64>,
    /// Largest root mean square distance of the needle's tip from the target over all arms and
    /// patients of `[imperfections]`, mm.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 1e-12, max = 100.0), extend("x-off" = true))]
    pub max_tip_rms_mm: Option<f64>,
    /// The same across the needle, mm.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 1e-12, max = 100.0), extend("x-off" = true))]
    pub max_tip_lateral_rms_mm: Option<f64>,
    /// Largest settled angle between planned and actual needle, deg.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 1e-12, max = 90.0), extend("x-off" = true))]
    pub max_needle_angle_error_deg: Option<f64>,
    /// Largest settled distance of the guide's exit from its planned place, mm.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 1e-12, max = 100.0), extend("x-off" = true))]
    pub max_guide_position_error_mm: Option<f64>,
    /// Largest time from the end of the motion until the tip stays within its band, s.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 60.0), extend("x-off" = true))]
    pub max_settling_time_s: Option<f64>,
    /// Largest share of a joint's torque limit that is used; the drives give no more than all of it.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.001, max = 1.0), extend("x-off" = true))]
    pub max_peak_torque_ratio: Option<f64>,
    /// Largest difference of the engines' tips while moving, mm.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 1e-12, max = 100.0), extend("x-off" = true))]
    pub max_engine_difference_peak_mm: Option<f64>,
    /// Largest difference of the engines' tips when settled, mm.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 1e-12, max = 100.0), extend("x-off" = true))]
    pub max_engine_difference_settled_mm: Option<f64>,
    /// Whether arm or tool may touch anything.
    pub allow_contact: bool,
    /// Least clearances over the recorded motion, mm.
    pub min_clearance_mm: ClearanceCriteria,
    /// Configurations that have to work for each goal.
    #[schemars(range(min = 0, max = 8))]
    pub min_working_configurations: u32,
    /// Half-width of the tip's settling band, mm.
    #[schemars(range(min = 1e-6, max = 100.0))]
    pub settling_band_mm: f64,
    /// Least share of the room about the entry point that is free of arm and tool, 0 to 1.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 1.0), extend("x-off" = true))]
    pub min_free_fraction: Option<f64>,
    /// Least share of the lines of sight that arm and tool leave, of those that are free without them, 0 to 1.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 1.0), extend("x-off" = true))]
    pub min_sight_fraction: Option<f64>,
    /// Least half-angle of the free cone behind the guide, deg.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 90.0), extend("x-off" = true))]
    pub min_hand_cone_deg: Option<f64>,
}

impl Default for CriteriaSection {
    fn default() -> Self {
        Self {
            max_tip_position_error_mm: Some(0.1),
            max_true_target_error_mm: None,
            max_true_target_lateral_mm: None,
            max_tip_rms_mm: None,
            max_tip_lateral_rms_mm: None,
            max_needle_angle_error_deg: Some(0.05),
            max_guide_position_error_mm: None,
            max_settling_time_s: None,
            max_peak_torque_ratio: Some(1.0),
            max_engine_difference_peak_mm: None,
            max_engine_difference_settled_mm: None,
            allow_contact: false,
            min_clearance_mm: ClearanceCriteria::default(),
            min_working_configurations: 1,
            settling_band_mm: 0.01,
            min_free_fraction: None,
            min_sight_fraction: None,
            min_hand_cone_deg: None,
        }
    }
}
