//! What happens besides the planned motion: contacts that are asked for, stops, the way back out.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Scenario;
use crate::toml_text::TomlText;
use crate::{ClearanceClass, Finding};

/// Events that are simulated besides the planned motion, for every configuration that works.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct EventsSection {
    /// Simulates the way back too: straight out along the needle, then to the start posture.
    pub retract: bool,
    /// Largest distance of the guide from the needle's axis while the needle is still in, mm; not
    /// judged if left out.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub max_retraction_deviation_mm: Option<f64>,
    /// An emergency stop on the way in; none if left out.
    pub stop: Option<StopSection>,
    /// Contacts that are asked for.
    pub press: Vec<PressSection>,
}

/// What touches what.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PressClass {
    /// The guide tube against the skin.
    GuideStandoff,
    /// The tool, without its guide tube, against the skin.
    ToolPhantom,
    /// The arm against the skin.
    RobotPhantom,
    /// Arm or tool against the table.
    RobotTable,
    /// Arm or tool against the gantry.
    RobotGantry,
    /// Arm or tool against the mount.
    RobotMount,
    /// Arm or tool against an obstacle.
    RobotObstacle,
}

impl PressClass {
    /// The class of clearance.
    pub fn class(self) -> ClearanceClass {
        match self {
            Self::GuideStandoff => ClearanceClass::GuideStandoff,
            Self::ToolPhantom => ClearanceClass::ToolPhantom,
            Self::RobotPhantom => ClearanceClass::RobotPhantom,
            Self::RobotTable => ClearanceClass::RobotTable,
            Self::RobotGantry => ClearanceClass::RobotGantry,
            Self::RobotMount => ClearanceClass::RobotMount,
            Self::RobotObstacle => ClearanceClass::RobotObstacle,
        }
    }
}

/// A contact that is asked for.
///
/// After planning, what is to be touched is moved so that it stands before the arm in its final
/// posture, at a gap. From there the arm is driven towards it until the planned posture lies in it by
/// a depth, holds, and is driven back. The controller knows of nothing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PressSection {
    /// What touches what.
    pub class: PressClass,
    /// How far the planned posture lies in the obstacle, mm. Default 1, assumed: 10 to 50 N.
    /// Everything is rigid: the settled force is the servo's stiffness times this depth, and no force on
    /// a patient.
    #[serde(default = "default_depth_mm")]
    #[schemars(range(min = 0.01, max = 20.0))]
    pub depth_mm: f64,
    /// Gap at the start, mm. Default 3, assumed: room to get up to speed.
    #[serde(default = "default_gap_mm")]
    #[schemars(range(min = 0.1, max = 50.0))]
    pub gap_mm: f64,
    /// Speed of the point that will touch, mm/s. Default 20, assumed: a guide beside a patient.
    #[serde(default = "default_speed_mm_s")]
    #[schemars(range(min = 0.1, max = 500.0))]
    pub speed_mm_s: f64,
    /// Time that the arm presses, s. Default 0.6, assumed: contacts settle in 0.2 s.
    #[serde(default = "default_press_hold_s")]
    #[schemars(range(min = 0.2, max = 60.0))]
    pub hold_s: f64,
    /// Coulomb friction in this contact; that of `[engines]` if left out.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 5.0))]
    pub friction: Option<f64>,
    /// Largest difference of the engines' settled forces, as a share of the larger one; not judged if
    /// left out.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub max_force_difference: Option<f64>,
    /// Largest difference of either engine's settled force from the balance of the joints' torques, as
    /// a share of it; not judged if left out.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub max_balance_difference: Option<f64>,
    /// Largest difference of the engines' settled tips, mm; not judged if left out.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 100.0))]
    pub max_tip_difference_mm: Option<f64>,
    /// Largest time from the end of the contact until the tip follows its reference within
    /// `settling_band_mm`, s; not judged if left out.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 60.0))]
    pub max_recovery_s: Option<f64>,
}

fn default_depth_mm() -> f64 {
    1.0
}
fn default_gap_mm() -> f64 {
    3.0
}
fn default_speed_mm_s() -> f64 {
    20.0
}
fn default_press_hold_s() -> f64 {
    0.6
}

/// An emergency stop, with the categories of IEC 60204-1.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StopSection {
    /// 0: drives off, brakes on. 1: the arm is brought to a stand on its path, then braked. 2: the
    /// same, but the servo goes on to hold it.
    #[schemars(range(min = 0, max = 2))]
    pub category: u8,
    /// Time at which it is triggered, s from the start of the motion. Without this and
    /// `at_progress`: the moment from which the tip would go farthest, by the arm's dynamics.
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub at_s: Option<f64>,
    /// The same as a share of the time until the guide is in place, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub at_progress: Option<f64>,
    /// Time from full speed to a stand in categories 1 and 2, ms. Default 300, assumed.
    #[schemars(range(min = 10.0, max = 5000.0))]
    pub deceleration_ms: f64,
    /// Time that is simulated after the trigger, s.
    #[schemars(range(min = 0.1, max = 60.0))]
    pub observe_s: f64,
    /// Largest distance that the tip may go, mm; not judged if left out.
    #[schemars(range(min = 0.0, max = 5000.0))]
    pub max_tip_distance_mm: Option<f64>,
    /// Longest time until all joints stand, s; not judged if left out.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub max_stopping_time_s: Option<f64>,
}

impl Default for StopSection {
    fn default() -> Self {
        Self {
            category: 0,
            at_s: None,
            at_progress: None,
            deceleration_ms: 300.0,
            observe_s: 0.6,
            max_tip_distance_mm: None,
            max_stopping_time_s: None,
        }
    }
}

/// Events that contradict themselves, or have nothing to happen with.
pub(super) fn check(toml: &TomlText<'_>, scenario: &Scenario) -> Vec<Finding> {
    let Some(events) = &scenario.events else {
        return Vec::new();
    };
    let mut findings = Vec::new();
    if let Some(stop) = &events.stop {
        if stop.at_s.is_some() && stop.at_progress.is_some() {
            let text = "`events.stop` has both `at_s` and `at_progress`";
            let hint = "keep one; without both the stop comes at its worst moment";
            findings.push(toml.finding("events.stop.at_progress", text).hint(hint));
        }
        if stop.category > 0 && stop.observe_s * 1e3 < stop.deceleration_ms {
            let text = format!(
                "`events.stop.observe_s` is {} s, less than `deceleration_ms` = {} ms",
                stop.observe_s, stop.deceleration_ms
            );
            let hint = "the arm would still move at the end";
            findings.push(toml.finding("events.stop.observe_s", text).hint(hint));
        }
    }
    for (i, press) in events.press.iter().enumerate() {
        let class = press.class.class();
        if let Some((section, false)) = scenario.section_of(class) {
            let name = class.name();
            let text = format!("`{name}` has nothing to press against: there is no `{section}`");
            let hint = format!("add a section `{section}`, or press against something else");
            let key = format!("events.press[{i}].class");
            findings.push(toml.finding(&key, text).hint(hint));
        }
    }
    if scenario.imperfections.is_some() {
        findings.push(
            toml.finding(
                "events",
                "`[events]` are staged and measured on the nominal robot",
            )
            .hint("leave out `[imperfections]`, or put the events into a scenario of their own"),
        );
    }
    findings
}
