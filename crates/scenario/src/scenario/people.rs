//! The people in the room, and the physician's preferences: `[people]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use needlebench_input::{Finding, TomlText};

/// A side of the patient, in the horizontal plane. A patient lying on the side has front and back there instead of left
/// and right.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// Beyond the head.
    Head,
    /// Beyond the feet.
    Feet,
    /// The patient's left.
    Left,
    /// The patient's right.
    Right,
    /// The patient's front.
    Front,
    /// The patient's back.
    Back,
}

impl Side {
    /// Word in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Head => "head",
            Self::Feet => "feet",
            Self::Left => "left",
            Self::Right => "right",
            Self::Front => "front",
            Self::Back => "back",
        }
    }
}

/// Role of a person.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Inserts the needle.
    #[default]
    Doctor,
    /// Assists.
    Assistant,
}

impl Role {
    /// Word in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Doctor => "doctor",
            Self::Assistant => "assistant",
        }
    }
}

/// The dominant hand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Handedness {
    /// The left one.
    Left,
    /// The right one.
    #[default]
    Right,
}

/// Preferred elbow position.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ElbowPreference {
    /// Above the line from shoulder to wrist, away from the patient.
    Up,
    /// Below that line, away from heads and lights.
    Down,
}

/// Statures of adults by sex and percentile.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum StaturePercentile {
    /// 1505 mm.
    FemaleP5,
    /// 1610 mm.
    FemaleP50,
    /// 1710 mm.
    FemaleP95,
    /// 1625 mm.
    MaleP5,
    /// 1740 mm.
    MaleP50,
    /// 1855 mm.
    MaleP95,
}

impl StaturePercentile {
    /// Stature without shoes, m: British adults of 19 to 65 years, Pheasant, Bodyspace (1996).
    pub fn stature_m(self) -> f64 {
        match self {
            Self::FemaleP5 => 1.505,
            Self::FemaleP50 => 1.610,
            Self::FemaleP95 => 1.710,
            Self::MaleP5 => 1.625,
            Self::MaleP50 => 1.740,
            Self::MaleP95 => 1.855,
        }
    }
}

/// The people in the room, and the physician's preferences.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PeopleSection {
    /// People in the room. Each is an obstacle for arm and tool (`robot_person`): upright and still, 300 mm deep and
    /// 500 mm wide, facing the entry point, at the height of its tallest stature; where the position depends on the
    /// goal, at the positions for all goals. Default: one physician across the patient from the robot, in three
    /// statures, evaluated for line of sight only.
    pub persons: Vec<PersonSection>,
    /// Side of the patient on which the physician prefers free space.
    pub prefer_side: Option<Side>,
    /// Position of the robot's elbow that the physician prefers: `up` or `down`.
    pub prefer_elbow: Option<ElbowPreference>,
}

/// One person.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PersonSection {
    /// `doctor` (the physician) or `assistant`.
    pub role: Role,
    /// Side of the patient: `head`, `feet`, `left`, `right`; for a patient lying on the side `front` and `back` instead
    /// of the last two. Default: across the patient from the robot.
    pub side: Option<Side>,
    /// Horizontal distance from the entry point to the middle of the body, mm. Default: as close as a body of 300 mm
    /// depth can stand, with the needle 250 mm in front of it.
    #[schemars(range(min = 50.0, max = 3000.0))]
    pub distance_mm: Option<f64>,
    /// Position in the world (x, y), mm, instead of `side` and `distance_mm`.
    #[schemars(inner(range(min = -5000.0, max = 5000.0)))]
    pub position_mm: Option<[f64; 2]>,
    /// Height of the step that the person stands on, above the floor, mm.
    #[schemars(range(min = 0.0, max = 600.0))]
    pub step_height_mm: f64,
    /// Statures without shoes, mm; the line of sight is evaluated for each. Default without `stature`: 1600, 1750 and
    /// 1900.
    #[schemars(inner(range(min = 1300.0, max = 2300.0)))]
    pub statures_mm: Vec<f64>,
    /// Stature by sex and percentile, instead of `statures_mm`: `female-p5` to `male-p95`.
    pub stature: Option<StaturePercentile>,
    /// Head movement: maximum distance of the eyes from their position in upright stance, in any direction, mm.
    #[schemars(range(min = 0.0, max = 400.0))]
    pub head_movement_mm: f64,
    /// The hand that holds the needle: `left` or `right`.
    pub handedness: Handedness,
}

impl Default for PersonSection {
    fn default() -> Self {
        Self {
            role: Role::default(),
            side: None,
            distance_mm: None,
            position_mm: None,
            step_height_mm: 0.0,
            statures_mm: Vec::new(),
            stature: None,
            head_movement_mm: 100.0,
            handedness: Handedness::default(),
        }
    }
}

/// Checks for contradicting keys of a person.
pub(super) fn check(toml: &TomlText<'_>, people: &PeopleSection) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (index, person) in people.persons.iter().enumerate() {
        let key = |name: &str| format!("people.persons[{index}].{name}");
        if person.stature.is_some() && !person.statures_mm.is_empty() {
            findings.push(
                toml.finding(
                    &key("stature"),
                    "`stature` and `statures_mm` are both given",
                )
                .hint("remove one of them"),
            );
        }
        if person.position_mm.is_some() && (person.side.is_some() || person.distance_mm.is_some()) {
            findings.push(
                toml.finding(
                    &key("position_mm"),
                    "`position_mm` is given together with `side` or `distance_mm`",
                )
                .hint("a position in the world needs neither; remove one of them"),
            );
        }
    }
    findings
}
