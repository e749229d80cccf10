//! The test of the robot to ISO 9283: `[iso9283]`.

use nalgebra::Vector3;
use needlebench_input::{Finding, TomlText};
use needlebench_iso9283::STANDARD_CYCLES;
use needlebench_kinematics::ik::Configuration;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

use super::Scenario;

/// Edge lengths of the standard's cube, mm.
pub(crate) const STANDARD_EDGES_MM: [f64; 4] = [250.0, 400.0, 630.0, 1000.0];

/// Test of the robot's accuracy and repeatability to ISO 9283, instead of goals: five poses in a cube, visited
/// repeatedly.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Iso9283Section {
    /// Arm configuration at every pose, by its label, such as `Right-Up-Fold`.
    #[schemars(schema_with = "configurations")]
    pub configuration: String,
    /// Centre of the test cube in the controller's `base` frame, mm. Default: the arm's.
    #[schemars(inner(range(min = -5000.0, max = 5000.0)))]
    pub cube_centre_mm: Option<[f64; 3]>,
    /// Edge of the test cube, mm. The standard has 250, 400, 630 and 1000 and requires the largest that fits in the
    /// workspace. Default: the arm's.
    #[schemars(range(min = 10.0, max = 2000.0))]
    pub cube_edge_mm: Option<f64>,
    /// Horizontal direction in which the test plane rises: `+x`, `-x`, `+y` or `-y` of `base`. These are the standard's
    /// planes C1-C2-C7-C8, C2-C3-C8-C5, C3-C4-C5-C6 and C4-C1-C6-C7.
    pub plane_rises_towards: Horizontal,
    /// Direction of the guide axis at every pose, `base` frame, of any length.
    #[schemars(inner(range(min = -1e6, max = 1e6)))]
    pub guide_axis: [f64; 3],
    /// Roll angle of the guide about its axis, deg; at 0 the guide's x axis is as close to the `base` frame's x as
    /// possible.
    #[schemars(range(min = -360.0, max = 360.0))]
    pub roll_deg: f64,
    /// Distance of the measured point beyond the guide's exit along the needle axis, mm.
    #[schemars(range(min = 0.0, max = 500.0))]
    pub beyond_guide_mm: f64,
    /// Number of cycles, and of visits of each pose from each direction. Default: the standard's 30.
    #[schemars(range(min = 2, max = 1000), extend("x-hint" = "the standard requires 30; a repeatability needs at least 2"))]
    pub cycles: u32,
    /// Share of the robot's rated joint speeds, and of its typical tool speed on linear approaches. The standard tests
    /// 1, 0.5 and 0.1. Accelerations are those of `[motion]`.
    #[schemars(range(min = 0.01, max = 1.0))]
    pub speed_share: f64,
    /// Typical tool speed, mm/s. Default: that of the arm's data sheet.
    #[schemars(range(min = 1.0, max = 20_000.0))]
    pub tool_speed_mm_s: Option<f64>,
    /// Mass at the flange, tool included, kg. Default: 100 % of the arm's rated load, as the standard requires.
    #[schemars(range(min = 0.0, max = 50.0))]
    pub load_kg: Option<f64>,
    /// Centre of mass of the steel cube added to the tool to reach `load_kg`, flange frame, mm. Assumed.
    #[schemars(inner(range(min = -500.0, max = 500.0)))]
    pub load_centre_mm: [f64; 3],
    /// Dwell time at each pose, s. Assumed.
    #[schemars(range(min = 0.05, max = 60.0))]
    pub dwell_s: f64,
    /// Averaging time of a measurement, at the end of the dwell, s. Assumed: the usual window of a laser tracker.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub measuring_s: f64,
    /// Length of the linear approach from each of three directions for the multi-directional accuracy, mm; 0 omits that
    /// test. Assumed.
    #[schemars(range(min = 0.0, max = 500.0))]
    pub approach_mm: f64,
    /// Half-width of the limit band of the stabilisation time, mm. Default: the repeatability of the arm's data sheet.
    #[schemars(range(min = 1e-6, max = 100.0))]
    pub limit_band_mm: Option<f64>,
    /// Standard deviation of the tracker noise per axis, um, which is included in every repeatability measured on a
    /// real robot. Default: an ideal tracker.
    #[schemars(range(min = 0.0, max = 1e4))]
    pub tracker_noise_um: f64,
    /// Limits for the robot.
    pub criteria: Iso9283Criteria,
}

impl Default for Iso9283Section {
    fn default() -> Self {
        Self {
            configuration: "Right-Up-Fold".to_owned(),
            cube_centre_mm: None,
            cube_edge_mm: None,
            plane_rises_towards: Horizontal::PlusY,
            guide_axis: [0.0, 0.0, -1.0],
            roll_deg: 0.0,
            beyond_guide_mm: 0.0,
            cycles: STANDARD_CYCLES,
            speed_share: 1.0,
            tool_speed_mm_s: None,
            load_kg: None,
            load_centre_mm: [0.0, 0.0, 50.0],
            dwell_s: 0.5,
            measuring_s: 0.1,
            approach_mm: 50.0,
            limit_band_mm: None,
            tracker_noise_um: 0.0,
            criteria: Iso9283Criteria::default(),
        }
    }
}

/// Limits of the standard's characteristics, at every pose and in each engine. A limit that is not given is not
/// evaluated.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Iso9283Criteria {
    /// Maximum pose accuracy AP, mm.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub max_accuracy_mm: Option<f64>,
    /// Maximum pose repeatability RP, mm.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub max_repeatability_mm: Option<f64>,
    /// Maximum multi-directional pose accuracy variation vAP, mm.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub max_directional_variation_mm: Option<f64>,
    /// Maximum pose stabilisation time, s.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub max_stabilisation_time_s: Option<f64>,
    /// Maximum pose overshoot, mm.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub max_overshoot_mm: Option<f64>,
}

/// A horizontal direction of the `base` frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Horizontal {
    /// Along x.
    #[serde(rename = "+x")]
    PlusX,
    /// Against x.
    #[serde(rename = "-x")]
    MinusX,
    /// Along y.
    #[serde(rename = "+y")]
    PlusY,
    /// Against y.
    #[serde(rename = "-y")]
    MinusY,
}

fn configurations(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "string", "enum": Configuration::ALL.map(Configuration::label) })
}

/// Checks the section, and its combination with other sections.
pub(super) fn check(toml: &TomlText<'_>, scenario: &Scenario) -> Vec<Finding> {
    let Some(section) = &scenario.iso9283 else {
        return Vec::new();
    };
    let mut findings = Vec::new();
    let Iso9283Section {
        measuring_s,
        dwell_s,
        ..
    } = section;
    if measuring_s > dwell_s {
        findings.push(
            toml.finding(
                "iso9283.measuring_s",
                format!("`iso9283.measuring_s` is {measuring_s} s, outside 0 to {dwell_s}"),
            )
            .hint("the measurement is averaged during the dwell: at most `dwell_s`"),
        );
    }
    if Vector3::from(section.guide_axis).norm() < 1e-6 {
        findings.push(
            toml.finding("iso9283.guide_axis", "the direction has no length")
                .hint("such as [0, 0, -1] for downwards"),
        );
    }
    if !scenario.goals.is_empty() {
        findings.push(
            toml.finding("iso9283", "a scenario has either goals or [iso9283]")
                .hint("put the ISO 9283 test into a scenario of its own"),
        );
    }
    findings
}
