//! Events in addition to the planned motion: prescribed contacts, emergency stops, the retreat.

use needlebench_cell::ClearanceClass;
use needlebench_input::{Finding, TomlText};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Scenario;

/// Events that are simulated in addition to the planned motion, for every feasible configuration.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct EventsSection {
    /// Simulates the retreat too: linearly along the needle axis, then to the start posture.
    #[serde(alias = "retract")]
    #[schemars(extend("x-former" = "retract"))]
    pub retreat: bool,
    /// Maximum distance of the guide from the needle axis while the needle is inserted, mm. Default: not evaluated.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub max_retraction_deviation_mm: Option<f64>,
    /// Emergency stop during the approach. Default: none.
    pub stop: Option<StopSection>,
    /// Prescribed contacts.
    pub press: Vec<PressSection>,
}

/// The two bodies in contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PressClass {
    /// Guide tube and skin.
    GuideStandoff,
    /// Tool, without its guide tube, and skin.
    ToolPhantom,
    /// Arm and skin.
    RobotPhantom,
    /// Arm or tool and table.
    RobotTable,
    /// Arm or tool and gantry.
    RobotGantry,
    /// Arm or tool and mount.
    RobotMount,
    /// Arm or tool and an obstacle.
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

/// A prescribed contact.
///
/// After planning, the obstacle is moved in front of the arm in its final posture, at a gap. The arm is then driven
/// into it by a depth, holds, and is driven back. The controller has no knowledge of the contact.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PressSection {
    /// The two bodies in contact.
    pub class: PressClass,
    /// Depth of the commanded posture inside the obstacle, mm. Default 1, assumed: 10 to 50 N. All bodies are rigid:
    /// the settled force is the servo stiffness times this depth, not a force on a patient.
    #[serde(default = "default_depth_mm")]
    #[schemars(range(min = 0.01, max = 20.0))]
    pub depth_mm: f64,
    /// Gap at the start, mm. Default 3, assumed: enough to reach the speed.
    #[serde(default = "default_gap_mm")]
    #[schemars(range(min = 0.1, max = 50.0))]
    pub gap_mm: f64,
    /// Speed of the contact point, mm/s. Default 20, assumed: a guide near a patient.
    #[serde(default = "default_speed_mm_s")]
    #[schemars(range(min = 0.1, max = 500.0))]
    pub speed_mm_s: f64,
    /// Duration of the contact at full depth, s. Default 0.6, assumed: contacts settle in 0.2 s.
    #[serde(default = "default_press_hold_s")]
    #[schemars(range(min = 0.2, max = 60.0))]
    pub hold_s: f64,
    /// Coulomb friction coefficient of this contact. Default: that of `[engines]`.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 5.0))]
    pub friction: Option<f64>,
    /// Maximum difference between the engines' settled forces, as a share of the larger. Default: not evaluated.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub max_force_difference: Option<f64>,
    /// Maximum deviation of either engine's settled force from static equilibrium of the joint torques, as a share of
    /// it. Default: not evaluated.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub max_balance_difference: Option<f64>,
    /// Maximum difference between the engines' settled tip positions, mm. Default: not evaluated.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 100.0))]
    pub max_tip_difference_mm: Option<f64>,
    /// Maximum time from the end of the contact until the tip follows its reference within `settling_band_mm`, s.
    /// Default: not evaluated.
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

/// An emergency stop, by the categories of IEC 60204-1.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StopSection {
    /// Stop category. 0: drives off, brakes on. 1: the arm decelerates on its path, then the brakes engage. 2: as 1,
    /// but the servo keeps holding the arm.
    #[schemars(range(min = 0, max = 2))]
    pub category: u8,
    /// Trigger time from the start of the motion, s. Default, if `at_progress` is not given either: the moment with the
    /// largest tip travel by the arm's dynamics.
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub at_s: Option<f64>,
    /// Trigger time as a share of the time until the guide is in place, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub at_progress: Option<f64>,
    /// Deceleration time from full speed to standstill in categories 1 and 2, ms. Default 300, assumed.
    #[schemars(range(min = 10.0, max = 5000.0))]
    pub deceleration_ms: f64,
    /// Simulated time after the trigger, s.
    #[schemars(range(min = 0.1, max = 60.0))]
    pub observe_s: f64,
    /// Maximum tip travel, mm. Default: not evaluated.
    #[schemars(range(min = 0.0, max = 5000.0))]
    pub max_tip_distance_mm: Option<f64>,
    /// Maximum stopping time of all joints, s. Default: not evaluated.
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
            let hint = "keep one; without both the stop is triggered at its worst moment";
            findings.push(toml.finding("events.stop.at_progress", text).hint(hint));
        }
        if stop.category > 0 && stop.observe_s * 1e3 < stop.deceleration_ms {
            let text = format!(
                "`events.stop.observe_s` is {} s, less than `deceleration_ms` = {} ms",
                stop.observe_s, stop.deceleration_ms
            );
            let hint = "the arm would still be moving at the end";
            findings.push(toml.finding("events.stop.observe_s", text).hint(hint));
        }
    }
    for (i, press) in events.press.iter().enumerate() {
        let class = press.class.class();
        if let Some((section, false)) = scenario.section_of(class) {
            let name = class.name();
            let text = format!("`{name}` has no contact partner: there is no `{section}`");
            let hint = format!("add a section `{section}`, or choose another class");
            let key = format!("events.press[{i}].class");
            findings.push(toml.finding(&key, text).hint(hint));
        }
    }
    if scenario.imperfections.is_some() {
        findings.push(
            toml.finding(
                "events",
                "`[events]` are simulated with the nominal robot only",
            )
            .hint("remove `[imperfections]`, or put the events into a scenario of their own"),
        );
    }
    findings
}
