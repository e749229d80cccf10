//! The scenario file: plain structs with a default, a description and a range for every key.
//!
//! A section is one file. Lengths are in mm and angles in degrees here and only here; keys say their
//! unit. The range of a value stands at its field as a schemars attribute: [`scenario_schema`] shows
//! it, and the reader checks it. What two keys say together is checked by the `check` beside their
//! section.

mod controller;
mod criteria;
mod ct;
mod engines;
pub mod envelope;
mod events;
mod excitation;
mod fixtures;
mod goals;
mod imperfections;
mod iso9283;
mod models;
mod motion;
mod obstacles;
mod people;
mod phantom;
mod planning;
pub mod ranking;
mod recording;
mod replay;
mod requirements;
mod robot;
mod route;
mod switch;
mod tool;

use std::sync::LazyLock;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use crate::engine_name::EngineName;
use crate::requirements::Requirements;
use crate::schema::{FileSchema, LONGEST_NAME, NAME};
use crate::toml_text::TomlText;
use crate::{ClearanceClass, Finding};
use requirements::scenario_requirements;

pub use controller::ControllerSection;
pub use criteria::{ClearanceCriteria, CriteriaSection};
pub use ct::{CtSection, ScanKernel, ScanSlices};
pub use engines::{EnginesSection, MujocoSection, RapierSection, STANDARD_GRAVITY_M_S2};
pub use envelope::EnvelopeSection;
pub use events::{EventsSection, PressClass, PressSection, StopSection};
pub use excitation::{ExcitationSection, PayloadSection, SweepSection};
pub use fixtures::{GantrySection, MountKind, MountSection, TableSection};
pub(crate) use goals::EVERY_CONFIGURATION;
#[cfg(test)]
pub(crate) use goals::REJECTION_RULES;
pub use goals::{FlangePose, GoalSection, Target};
pub use imperfections::{
    ArmClass, BreathState, BreathingBlock, CalibrationBlock, ControlBlock, CovarianceMm2,
    ElasticityBlock, EncoderBlock, ExpectedSection, FrictionBlock, GuideBlock, HandEyeBlock,
    ImagingBlock, ImperfectionsSection, IndentationBlock, NeedleBlock, PayloadBlock,
    RegistrationBlock, SkinMarkersBlock, TorqueLimitsBlock,
};
pub(crate) use imperfections::{POPULATION, covariance_m2};
pub(crate) use iso9283::STANDARD_EDGES_MM;
pub use iso9283::{Horizontal, Iso9283Criteria, Iso9283Section, STANDARD_CYCLES};
pub use models::shipped_tools;
pub use motion::{MotionSection, StartSection};
pub use obstacles::{
    AttachedTo, BoxShape, FileShape, ObstacleClass, ObstacleSection, ObstacleShape, RoundShape,
    SphereShape,
};
pub use people::{
    ElbowPreference, Handedness, PeopleSection, PersonSection, Role, Side, StaturePercentile,
};
pub use phantom::{Arms, LengthUnit, MarkerKind, PartSection, PartTissue, PhantomSection, Posture};
pub(crate) use phantom::{ChestSize, NO_MODEL};
pub use planning::{NeedleRouteSection, PlanningSection, RollAim};
pub use ranking::RankingSection;
pub use recording::RecordingSection;
pub use replay::ReplaySection;
pub use robot::RobotSection;
pub use route::{OddsSection, RouteSection};
pub use tool::ToolSection;
pub(crate) use tool::{NEEDLE_OUTER_DIAMETER_MM, PARAMETRIC_TOOL};

/// What a scenario file may hold.
pub(crate) static FILE: LazyLock<FileSchema> = LazyLock::new(FileSchema::of::<Scenario>);

/// One scenario: a cell, goals, and what is asked of every configuration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Name in reports and of the results folder: letters, digits, `-` and `_`. Left out: that of the file.
    #[serde(default)]
    #[schemars(regex(pattern = NAME), length(max = LONGEST_NAME), extend("x-hint" = "names become file names"))]
    pub name: String,
    /// What the scenario is for, in a sentence or two.
    #[serde(default)]
    pub description: String,
    /// Seed of everything random: searches for motions, and draws of imperfections.
    #[serde(default)]
    pub seed: u64,
    /// The arm and where it stands.
    #[serde(default)]
    pub robot: RobotSection,
    /// What carries the robot; none if left out.
    #[serde(default)]
    pub mount: Option<MountSection>,
    /// The needle guide.
    #[serde(default)]
    pub tool: ToolSection,
    /// The chest phantom; none if left out.
    #[serde(default)]
    pub phantom: Option<PhantomSection>,
    /// The synthetic CT that a run begins from; without it, a run knows the phantom as it is.
    #[serde(default)]
    pub ct: Option<CtSection>,
    /// CT table; none if left out.
    #[serde(default)]
    pub table: Option<TableSection>,
    /// CT gantry; none if left out.
    #[serde(default)]
    pub gantry: Option<GantrySection>,
    /// What else the arm may hit: equipment in the room, on the table, the gantry or the robot.
    #[serde(default)]
    pub obstacles: Vec<ObstacleSection>,
    /// Where needles are to go. Needed unless there is an `[iso9283]` or an `[excitation]`.
    #[serde(default)]
    pub goals: Vec<GoalSection>,
    /// The test of the robot by ISO 9283, instead of goals.
    #[serde(default)]
    pub iso9283: Option<Iso9283Section>,
    /// A run that excites every joint, for what is identified from its log, instead of goals.
    #[serde(default)]
    pub excitation: Option<ExcitationSection>,
    /// Where every motion starts.
    #[serde(default)]
    pub start: StartSection,
    /// Speed limits of the motion.
    #[serde(default)]
    pub motion: MotionSection,
    /// What makes a configuration unfit before anything is simulated.
    #[serde(default)]
    pub planning: PlanningSection,
    /// The joint servo.
    #[serde(default)]
    pub controller: ControllerSection,
    /// The physics engines.
    #[serde(default)]
    pub engines: EnginesSection,
    /// What every working configuration has to reach.
    #[serde(default)]
    pub criteria: CriteriaSection,
    /// What criteria stand for: the id or text of a requirement by the key of its criterion, such as
    /// `max_tip_position_error_mm = "SRS-12: tip within 0.1 mm"`; keys with a dot stand in quotes. Carried to
    /// reports, with a trace matrix.
    #[serde(default)]
    #[schemars(schema_with = "scenario_requirements")]
    pub requirements: Requirements,
    /// How the configurations that work are ranked.
    #[serde(default)]
    pub ranking: RankingSection,
    /// What is written of each simulated motion.
    #[serde(default)]
    pub recording: RecordingSection,
    /// The people in the room, and what they prefer.
    #[serde(default)]
    pub people: PeopleSection,
    /// Of which arm and patient the expected tip error is.
    #[serde(default)]
    pub expected: ExpectedSection,
    /// How the real arm and the real phantom that are simulated differ from what the controller believes;
    /// not at all if left out. The expected tip error is of these, then.
    #[serde(default)]
    pub imperfections: Option<ImperfectionsSection>,
    /// Contacts, stops and the way back, simulated besides the planned motion; none if left out.
    #[serde(default)]
    pub events: Option<EventsSection>,
    /// What a recorded run of a real arm is held against.
    #[serde(default)]
    pub replay: ReplaySection,
}

impl Scenario {
    /// The section that what a class is measured against comes from, and whether the scenario has it, or
    /// an obstacle that counts as it; none for a class of the arm and its tool alone.
    pub(crate) fn section_of(&self, class: ClearanceClass) -> Option<(&'static str, bool)> {
        let (section, is_there) = match class {
            ClearanceClass::RobotPhantom
            | ClearanceClass::ToolPhantom
            | ClearanceClass::GuideStandoff
            | ClearanceClass::NeedleRoute => ("[phantom]", self.phantom.is_some()),
            ClearanceClass::RobotTable => ("[table]", self.table.is_some()),
            ClearanceClass::RobotGantry => ("[gantry]", self.gantry.is_some()),
            ClearanceClass::RobotMount => ("[mount]", self.mount.is_some()),
            ClearanceClass::RobotObstacle => ("[[obstacles]]", false),
            ClearanceClass::RobotPerson => ("[[people.persons]]", !self.people.persons.is_empty()),
            ClearanceClass::SelfCollision | ClearanceClass::NeedleCorridor => return None,
        };
        let counts = |each: &ObstacleSection| each.present && each.class.class() == class;
        Some((section, is_there || self.obstacles.iter().any(counts)))
    }
}

/// The JSON schema (draft-07) of scenario files, for editors.
pub fn scenario_schema() -> serde_json::Value {
    FILE.published()
}

/// A scenario's text as its sections, each value in its range. What its keys say together, and what
/// they name, is not looked at: [`crate::resolve_scenario`] does.
///
/// # Errors
/// Every [`Finding`] about the text, or about its keys and values.
pub fn parse_scenario(file: &str, text: &str) -> Result<Scenario, Vec<Finding>> {
    let toml = TomlText::parse(file, text).map_err(|finding| vec![finding])?;
    toml.read(&FILE)
}

/// What several keys say together.
pub(crate) fn check_together(
    toml: &TomlText<'_>,
    scenario: &Scenario,
    with_goals: bool,
) -> Vec<Finding> {
    let engines = &scenario.engines;
    let mut findings = recording::check(toml, &scenario.recording, engines);
    findings.extend(obstacles::check(toml, &scenario.obstacles));
    findings.extend(people::check(toml, &scenario.people));
    findings.extend(goals::check(
        toml,
        &scenario.goals,
        with_goals && scenario.iso9283.is_none() && scenario.excitation.is_none(),
    ));
    // A synthetic scan brings true targets along.
    findings.extend(goals::check_true_targets(
        toml,
        &scenario.goals,
        &scenario.criteria,
        !with_goals || scenario.ct.is_some(),
    ));
    findings.extend(ranking::check(toml, &scenario.ranking));
    findings.extend(events::check(toml, scenario));
    if let Some(section) = &scenario.imperfections {
        findings.extend(imperfections::check(toml, section));
    }
    findings.extend(ct::check(toml, scenario));
    findings.extend(imperfections::check_expected(toml, scenario));
    findings.extend(iso9283::check(toml, scenario));
    findings.extend(excitation::check(toml, scenario));
    findings
}
