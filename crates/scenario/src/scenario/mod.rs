//! The scenario file: plain structs with a default, a description and a range for every key.
//!
//! A section is one file. Lengths are in mm and angles in degrees here and only here; keys state their unit. The range
//! of a value is a schemars attribute of its field: [`scenario_schema`] shows it, and the reader checks it.
//! Combinations of keys are checked by the `check` beside their section.

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

use needlebench_cell::ClearanceClass;
use needlebench_input::schema::{FileSchema, LONGEST_NAME, NAME};
use needlebench_input::{Finding, TomlText};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use crate::engine_name::EngineName;
use crate::requirements::Requirements;
use requirements::scenario_requirements;

pub use controller::ControllerSection;
pub use criteria::{ClearanceCriteria, CriteriaSection};
pub use ct::{CtSection, ScanKernel, ScanSlices};
pub use engines::{EnginesSection, MujocoSection, RapierSection};
pub use envelope::EnvelopeSection;
pub use events::{EventsSection, PressClass, PressSection, StopSection};
pub use excitation::{ExcitationSection, PayloadSection, SweepSection};
pub use fixtures::{GantrySection, MountKind, MountSection, TableSection};
pub(crate) use goals::EVERY_CONFIGURATION;
pub use goals::{FlangePose, GoalSection, Target};
pub use imperfections::{
    ArmClass, BreathState, BreathingBlock, CalibrationBlock, ControlBlock, CovarianceMm2,
    ElasticityBlock, EncoderBlock, ExpectedSection, ForcesBlock, FrictionBlock, GuideBlock,
    HandEyeBlock, ImagingBlock, ImperfectionsSection, IndentationBlock, MeasuredForce, NeedleBlock,
    NeedleModel, NeedleTip, PayloadBlock, RegistrationBlock, SkinMarkersBlock, StiffnessBlock,
    TorqueLimitsBlock, TurnAt,
};
pub(crate) use imperfections::{
    BevelFace, IN_EXPECTED, IN_IMPERFECTIONS, POPULATION, SIDE_FORCE_N, covariance_m2,
};
pub(crate) use iso9283::STANDARD_EDGES_MM;
pub use iso9283::{Horizontal, Iso9283Criteria, Iso9283Section};
pub use models::shipped_tools;
pub use motion::{MotionSection, StartSection};
pub use needlebench_phantom::{Arms, MarkerKind};
pub use obstacles::{
    AttachedTo, BoxShape, FileShape, ObstacleClass, ObstacleSection, ObstacleShape, RoundShape,
    SphereShape,
};
pub use people::{
    ElbowPreference, Handedness, PeopleSection, PersonSection, Role, Side, StaturePercentile,
};
pub(crate) use phantom::NO_MODEL;
pub use phantom::{
    BuildSection, CutSection, LengthUnit, PartSection, PartTissue, PhantomSection, Posture,
};
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

/// One scenario: a cell, its goals, and the criteria for every configuration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Name in reports and of the results folder: letters, digits, `-` and `_`. Default: the file's name.
    #[serde(default)]
    #[schemars(regex(pattern = NAME), length(max = LONGEST_NAME), extend("x-hint" = "names become file names"))]
    pub name: String,
    /// Purpose of the scenario, in a sentence or two.
    #[serde(default)]
    pub description: String,
    /// Seed of all random numbers: motion planning and sampled imperfections.
    #[serde(default)]
    pub seed: u64,
    /// The arm and its base placement.
    #[serde(default)]
    pub robot: RobotSection,
    /// Mount of the robot. Default: none.
    #[serde(default)]
    pub mount: Option<MountSection>,
    /// The needle guide.
    #[serde(default)]
    pub tool: ToolSection,
    /// The chest phantom. Default: none.
    #[serde(default)]
    pub phantom: Option<PhantomSection>,
    /// Synthetic CT from which the run reconstructs the patient. Default: the run uses the phantom itself.
    #[serde(default)]
    pub ct: Option<CtSection>,
    /// CT table. Default: none.
    #[serde(default)]
    pub table: Option<TableSection>,
    /// CT gantry. Default: none.
    #[serde(default)]
    pub gantry: Option<GantrySection>,
    /// Further obstacles: equipment in the room, on the table, the gantry or the robot.
    #[serde(default)]
    pub obstacles: Vec<ObstacleSection>,
    /// Needle goals. Required unless there is an `[iso9283]` or an `[excitation]`.
    #[serde(default)]
    pub goals: Vec<GoalSection>,
    /// Test of the robot to ISO 9283, instead of goals.
    #[serde(default)]
    pub iso9283: Option<Iso9283Section>,
    /// Excitation run for calibration and dynamic identification, instead of goals.
    #[serde(default)]
    pub excitation: Option<ExcitationSection>,
    /// Start posture of every motion.
    #[serde(default)]
    pub start: StartSection,
    /// Speed limits of the motion.
    #[serde(default)]
    pub motion: MotionSection,
    /// Planning rules that reject a configuration before simulation.
    #[serde(default)]
    pub planning: PlanningSection,
    /// The joint servo.
    #[serde(default)]
    pub controller: ControllerSection,
    /// The physics engines.
    #[serde(default)]
    pub engines: EnginesSection,
    /// Criteria for every feasible configuration.
    #[serde(default)]
    pub criteria: CriteriaSection,
    /// Requirements that criteria verify: the id or text of a requirement by the key of its criterion, such as
    /// `max_tip_position_error_mm = "SRS-12: tip within 0.1 mm"`; keys with a dot need quotes. Reports show them with a
    /// trace matrix.
    #[serde(default)]
    #[schemars(schema_with = "scenario_requirements")]
    pub requirements: Requirements,
    /// Ranking of the feasible configurations.
    #[serde(default)]
    pub ranking: RankingSection,
    /// Files written for each simulated motion.
    #[serde(default)]
    pub recording: RecordingSection,
    /// People in the room and the physician's preferences.
    #[serde(default)]
    pub people: PeopleSection,
    /// Arm and patient population of the tip error where there are no `[imperfections]`.
    #[serde(default)]
    pub expected: ExpectedSection,
    /// Deviations of the simulated arm and patient from the controller's model. Default: none. If given, the RMS tip
    /// error is that of these deviations.
    #[serde(default)]
    pub imperfections: Option<ImperfectionsSection>,
    /// Prescribed contacts, emergency stops and the retreat, simulated in addition to the planned motion. Default:
    /// none.
    #[serde(default)]
    pub events: Option<EventsSection>,
    /// Limits for the comparison with a recorded run of a real arm.
    #[serde(default)]
    pub replay: ReplaySection,
}

impl Scenario {
    /// The block of a needle that bends in tissue, with its key; none where it bends in air or not at all. It is the usual one
    /// where the scenario says nothing of its needle.
    pub(crate) fn needle_in_tissue(&self) -> Option<(&'static str, &NeedleBlock)> {
        static USUAL: LazyLock<NeedleBlock> = LazyLock::new(NeedleBlock::default);
        let (place, block) = match &self.imperfections {
            Some(section) => (IN_IMPERFECTIONS, section.needle.as_ref()?),
            None => (IN_EXPECTED, self.expected.needle.as_ref().unwrap_or(&USUAL)),
        };
        let is_in_patient = self.phantom.is_some() || block.asks_for_tissue();
        (is_in_patient && block.model() == NeedleModel::Tissue).then_some((place, block))
    }

    /// The section that defines what a class is measured against, and whether the scenario has it, or an obstacle that
    /// counts as it; none for a class of the arm and its tool alone.
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

/// A scenario's text as its sections, each value in its range. Combinations of keys, and the files that they name, are
/// checked by [`crate::resolve_scenario`].
///
/// # Errors
/// Every [`Finding`] about the text, or about its keys and values.
pub fn parse_scenario(file: &str, text: &str) -> Result<Scenario, Vec<Finding>> {
    let toml = TomlText::parse(file, text).map_err(|finding| vec![finding])?;
    toml.read(&FILE)
}

/// Checks combinations of keys.
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
