//! The people in the room, and what the doctor prefers: `[people]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Finding;
use crate::toml_text::TomlText;

/// A side of the patient, in the level plane. A patient on the side has front and back there
/// instead of left and right.
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

/// What a person does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Inserts the needle.
    #[default]
    Doctor,
    /// Helps.
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

/// The hand that does the fine work.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Handedness {
    /// The left one.
    Left,
    /// The right one.
    #[default]
    Right,
}

/// Where an elbow is preferred.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ElbowPreference {
    /// Above the line from shoulder to wrist, away from the patient.
    Up,
    /// Below that line, away from heads and lamps.
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

/// The people around the robot, and what they prefer.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PeopleSection {
    /// Who stands where. Each is a body that arm and tool keep away from (`robot_person`): it stands still, upright,
    /// 300 mm deep and 500 mm wide, facing the entry point, as tall as its tallest stature; where the place follows from the
    /// goal, at its places for all goals. Left out: one doctor across the patient from the robot, in three statures, of
    /// whom only the sight is measured.
    pub persons: Vec<PersonSection>,
    /// Side of the patient on which the doctor likes to have room.
    pub prefer_side: Option<Side>,
    /// Where the doctor likes the robot's elbow: `up` or `down`.
    pub prefer_elbow: Option<ElbowPreference>,
}

/// One person.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PersonSection {
    /// `doctor` or `assistant`.
    pub role: Role,
    /// Side of the patient: `head`, `feet`, `left`, `right`, and for a patient on the side `front`
    /// and `back` instead of the last two. Left out: across the patient from the robot.
    pub side: Option<Side>,
    /// Level distance from the entry point to the middle of the body, mm. Left out: as near as a
    /// body of 300 mm depth gets to what stands there, with the needle 250 mm ahead of it.
    #[schemars(range(min = 50.0, max = 3000.0))]
    pub distance_mm: Option<f64>,
    /// Place in the world, mm, instead of `side` and `distance_mm`.
    #[schemars(inner(range(min = -5000.0, max = 5000.0)))]
    pub position_mm: Option<[f64; 2]>,
    /// Height of what the person stands on over the floor, mm.
    #[schemars(range(min = 0.0, max = 600.0))]
    pub step_height_mm: f64,
    /// Statures without shoes, mm; sight is measured for each. Left out, and no `stature` either:
    /// 1600, 1750 and 1900.
    #[schemars(inner(range(min = 1300.0, max = 2300.0)))]
    pub statures_mm: Vec<f64>,
    /// Stature by sex and percentile instead: `female-p5` to `male-p95`.
    pub stature: Option<StaturePercentile>,
    /// How far the eyes may move from where an upright person has them, in any direction, mm.
    #[schemars(range(min = 0.0, max = 400.0))]
    pub head_movement_mm: f64,
    /// The hand that holds the needle.
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

/// Keys of a person that contradict each other.
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
                .hint("leave one of them out"),
            );
        }
        if person.position_mm.is_some() && (person.side.is_some() || person.distance_mm.is_some()) {
            findings.push(
                toml.finding(
                    &key("position_mm"),
                    "`position_mm` is given together with `side` or `distance_mm`",
                )
                .hint("a place in the world needs neither; leave one of them out"),
            );
        }
    }
    findings
}
