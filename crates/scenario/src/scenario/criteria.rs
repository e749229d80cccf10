//! Criteria for every feasible configuration: `[criteria]`.
//!
//! A criterion is switched off by its name, `max_settling_time_s = "off"`, and by nothing else. The ranges exclude
//! limits that cannot be met, such as a negative error, and limits that cannot fail, such as a clearance below 0 or of
//! many metres.

use needlebench_cell::ClearanceClass;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::switch;

/// Minimum clearances, mm. A class without a limit, or `"off"`, is not evaluated.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ClearanceCriteria {
    /// Arm to skin.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 500.0), extend("x-off" = true, "x-unit" = "mm"))]
    pub robot_phantom: Option<f64>,
    /// Arm and tool to table.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 500.0), extend("x-off" = true, "x-unit" = "mm"))]
    pub robot_table: Option<f64>,
    /// Arm and tool to gantry.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 1000.0), extend("x-off" = true, "x-unit" = "mm"))]
    pub robot_gantry: Option<f64>,
    /// Arm and tool to mount.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 500.0), extend("x-off" = true, "x-unit" = "mm"))]
    pub robot_mount: Option<f64>,
    /// Arm and tool to the obstacles of `[[obstacles]]`.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 1000.0), extend("x-off" = true, "x-unit" = "mm"))]
    pub robot_obstacle: Option<f64>,
    /// Arm and tool to the people of `[[people.persons]]`, who stand still.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 1000.0), extend("x-off" = true, "x-unit" = "mm"))]
    pub robot_person: Option<f64>,
    /// Self-clearance of arm and tool.
    #[serde(rename = "self", with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 100.0), extend("x-off" = true, "x-unit" = "mm"))]
    pub self_collision: Option<f64>,
    /// Tool, without its guide tube, to skin.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 200.0), extend("x-off" = true, "x-unit" = "mm"))]
    pub tool_phantom: Option<f64>,
    /// Guide tube to skin (stand-off).
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 200.0), extend("x-off" = true, "x-unit" = "mm"))]
    pub guide_standoff: Option<f64>,
    /// Access zone behind the guide to everything else.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 300.0), extend("x-off" = true, "x-unit" = "mm"))]
    pub needle_corridor: Option<f64>,
    /// Planned needle to bone, vessels and organs.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 100.0), extend("x-off" = true, "x-unit" = "mm"))]
    pub needle_route: Option<f64>,
}

/// Maximum probability that the needle's surface comes closer than 1 mm to a structure, 0 to 1. A tissue without a limit,
/// or `"off"`, is not evaluated.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StructureCriteria {
    /// To a bone.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 1.0), extend("x-off" = true))]
    pub bone: Option<f64>,
    /// To a vessel.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 1.0), extend("x-off" = true))]
    pub vessel: Option<f64>,
    /// To an organ that does not contain the target.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 1.0), extend("x-off" = true))]
    pub organ: Option<f64>,
}

impl ClearanceCriteria {
    /// Minimum clearance of a class, mm; `None` if it is not evaluated.
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

/// Criteria for every feasible configuration, in each engine. A criterion that is `"off"` is not evaluated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CriteriaSection {
    /// Maximum settled tip error: distance of the needle tip from the target, mm.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 1e-12, max = 100.0), extend("x-off" = true))]
    pub max_tip_position_error_mm: Option<f64>,
    /// Maximum settled distance of the needle tip from the goal's `true_target_mm`, mm. Goals without one are not
    /// evaluated.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 1e-12, max = 100.0), extend("x-off" = true))]
    pub max_true_target_error_mm: Option<f64>,
    /// Maximum settled lateral distance of the goal's `true_target_mm` from the needle axis, mm.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 1e-12, max = 100.0), extend("x-off" = true))]
    pub max_true_target_lateral_mm: Option<f64>,
    /// Maximum RMS tip error over the arm and patient population (of `[imperfections]`, else of `[expected]`), mm.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 1e-12, max = 100.0), extend("x-off" = true))]
    pub max_tip_rms_mm: Option<f64>,
    /// Maximum RMS lateral tip error over the same population, mm.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 1e-12, max = 100.0), extend("x-off" = true))]
    pub max_tip_lateral_rms_mm: Option<f64>,
    /// Minimum probability that the needle's tip is in the lesion, over the same population, 0 to 1. With a
    /// target in no lesion it cannot be evaluated, and the verdict is `incomplete`.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 1.0), extend("x-off" = true))]
    pub min_lesion_probability: Option<f64>,
    /// Maximum probability that the needle comes closer than 1 mm to any single structure, over the same population.
    pub max_structure_probability: StructureCriteria,
    /// Maximum settled angle between planned and actual needle axis, deg.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 1e-12, max = 90.0), extend("x-off" = true))]
    pub max_needle_angle_error_deg: Option<f64>,
    /// Maximum settled position error of the guide's exit, mm.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 1e-12, max = 100.0), extend("x-off" = true))]
    pub max_guide_position_error_mm: Option<f64>,
    /// Maximum settling time: from the end of the motion until the tip stays within `settling_band_mm`, s.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 60.0), extend("x-off" = true))]
    pub max_settling_time_s: Option<f64>,
    /// Maximum joint torque as a share of the joint's torque limit. The drives saturate at 1.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.001, max = 1.0), extend("x-off" = true))]
    pub max_peak_torque_ratio: Option<f64>,
    /// Maximum difference of the tip position between the engines during the motion, mm.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 1e-12, max = 100.0), extend("x-off" = true))]
    pub max_engine_difference_peak_mm: Option<f64>,
    /// Maximum difference of the settled tip position between the engines, mm.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 1e-12, max = 100.0), extend("x-off" = true))]
    pub max_engine_difference_settled_mm: Option<f64>,
    /// Whether arm and tool may be in contact with anything.
    pub allow_contact: bool,
    /// Minimum clearances over the recorded motion, mm.
    pub min_clearance_mm: ClearanceCriteria,
    /// Minimum number of feasible configurations for each goal.
    #[schemars(range(min = 0, max = 8))]
    pub min_working_configurations: u32,
    /// Half-width of the settling band of the tip, mm.
    #[schemars(range(min = 1e-6, max = 100.0))]
    pub settling_band_mm: f64,
    /// Minimum free space: share of the space around the entry point that is free of arm and tool, 0 to 1.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 1.0), extend("x-off" = true))]
    pub min_free_fraction: Option<f64>,
    /// Minimum line of sight: share of the lines of sight, of those free without the robot, that arm and tool leave
    /// unobstructed, 0 to 1.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 1.0), extend("x-off" = true))]
    pub min_sight_fraction: Option<f64>,
    /// Minimum half-angle of the free hand cone behind the guide, deg.
    #[serde(with = "switch")]
    #[schemars(with = "Option<f64>", range(min = 0.0, max = 90.0), extend("x-off" = true))]
    pub min_hand_cone_deg: Option<f64>,
}

impl CriteriaSection {
    /// Whether there is a limit on a probability.
    pub fn has_probability(&self) -> bool {
        let StructureCriteria {
            bone,
            vessel,
            organ,
        } = self.max_structure_probability;
        let all = [self.min_lesion_probability, bone, vessel, organ];
        all.iter().any(Option::is_some)
    }
}

impl Default for CriteriaSection {
    fn default() -> Self {
        Self {
            max_tip_position_error_mm: Some(0.1),
            max_true_target_error_mm: None,
            max_true_target_lateral_mm: None,
            max_tip_rms_mm: None,
            max_tip_lateral_rms_mm: None,
            min_lesion_probability: None,
            max_structure_probability: StructureCriteria::default(),
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
