//! The study file: which scenario is varied, and how.
//!
//! Units are the scenario's: those that the varied keys say.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::LazyLock;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::family::{Change, KeyPath, ScenarioFamily, Setting};
use crate::file_kind::{FileKind, or_wrong_kind};
use crate::input::read_text;
use crate::requirements::Requirements;
use crate::scenario::EngineName;
use crate::schema::{COLUMN, FileSchema, LONGEST_NAME, NAME};
use crate::toml_text::TomlText;
use crate::{Finding, ModelSource, Overrides};
use criteria::StudyCriteria;
use requirements::study_requirements;
use search::SearchSection;

pub mod criteria;
mod requirements;
mod resolve;
pub mod search;

/// What a study file may hold.
pub(crate) static FILE: LazyLock<FileSchema> = LazyLock::new(FileSchema::of::<StudyFile>);

/// One study: a scenario, factors that vary it, and what is asked of the results.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StudyFile {
    /// Name in reports and of the results folder: letters, digits, `-` and `_`.
    #[schemars(regex(pattern = NAME), length(max = LONGEST_NAME), extend("x-hint" = "names become file names"))]
    pub name: String,
    /// The question that the study answers, in a sentence or two.
    #[serde(default)]
    pub description: String,
    /// The scenario that is varied: path relative to this file.
    pub scenario: String,
    /// Seed of the samples. Draws of imperfections follow the scenario's own `seed`, which a factor
    /// may vary.
    #[serde(default)]
    pub seed: u64,
    /// What is computed of a case: `static`, `planned` or `dynamic`. A level of a factor may say
    /// otherwise. If left out: `planned` for up to 512 cases, which is a matter of minutes, and `static`,
    /// postures only, for more.
    #[serde(default)]
    pub mode: Option<StudyMode>,
    /// Static cases that are planned too, drawn at random by the `seed`, to say how much a study of
    /// postures alone overstates; 0 for none. Of a study with factors to choose, cases of the best choice.
    #[serde(default = "replanned_cases")]
    #[schemars(range(max = 10_000))]
    pub replanned_cases: u32,
    /// Engines of dynamic cases; the scenario's if left out.
    #[serde(default)]
    pub engines: Option<Vec<EngineName>>,
    /// Goals of the scenario that are studied; all if left out.
    #[serde(default)]
    pub goals: Option<Vec<String>>,
    /// How the factors that are not crossed are sampled.
    #[serde(default)]
    pub sampling: SamplingSection,
    /// What is varied.
    #[schemars(length(min = 1), extend("x-hint" = "a [[factors]] with `name`, `key` and, say, `range = [-30, 30]`"))]
    pub factors: Vec<FactorSection>,
    /// What is asked of the results.
    #[serde(default)]
    pub criteria: StudyCriteria,
    /// What criteria stand for: the id or text of a requirement by the key of its criterion, such as
    /// `min_layouts_working = "SRS-1: works in 95 % of patients"`. Carried to reports, with a trace matrix.
    #[serde(default)]
    #[schemars(schema_with = "study_requirements")]
    pub requirements: Requirements,
    /// The smallest shift and tilt of the phantom that break a configuration; not computed if left
    /// out.
    #[serde(default)]
    pub robustness: Option<RobustnessSection>,
    /// What `needlebench search` looks for among the factors to choose.
    #[serde(default)]
    pub search: Option<SearchSection>,
}

fn replanned_cases() -> u32 {
    32
}

/// Most cases of a study that are planned where it does not say what is computed: each takes a second or
/// so of one thread, 0.4 to 1 s for the shipped ones, so that all take some minutes.
const MOST_PLANNED_BY_DEFAULT: u64 = 512;

/// What is computed of a case.
#[derive(
    Debug,
    Clone,
    Copy,
    Default,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Hash,
    Serialize,
    Deserialize,
    JsonSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum StudyMode {
    /// Final postures: inverse kinematics, clearances, margins, the predicted place of the tip.
    #[default]
    Static,
    /// Motions too, with proven clearances; nothing is simulated.
    Planned,
    /// Motions are simulated and measured.
    Dynamic,
}

impl StudyMode {
    /// Name in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Static => "static",
            Self::Planned => "planned",
            Self::Dynamic => "dynamic",
        }
    }
}

/// How points are spread over the factors that are sampled.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SamplingMethod {
    /// Sobol's sequence with Owen's scrambling: evenest. Numbers of samples that are powers of two
    /// are best.
    #[default]
    Sobol,
    /// Latin hypercube: even in every factor by itself.
    LatinHypercube,
    /// Independent points.
    Random,
}

impl SamplingMethod {
    /// Name in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sobol => "sobol",
            Self::LatinHypercube => "latin-hypercube",
            Self::Random => "random",
        }
    }
}

/// How the factors that are not crossed are sampled.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SamplingSection {
    /// `sobol`, `latin-hypercube` or `random`.
    pub method: SamplingMethod,
    /// Points in every combination of the crossed factors, the same ones in each. Needed where a
    /// factor is sampled.
    #[schemars(range(min = 1, max = 1_u64 << 32))]
    pub samples: Option<u64>,
}

/// Whether a factor is ours to choose.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Where the robot stands, which tool it has: what a study is to find the best level of.
    Choice,
    /// How the patient lies, what was drawn: what a choice is to hold for.
    #[default]
    Circumstance,
}

/// One factor: exactly one of `values`, `grid`, `range`, `normal` and `levels`.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FactorSection {
    /// Name of its column in the results: letters, digits and `_`.
    #[schemars(regex(pattern = COLUMN), length(max = LONGEST_NAME), extend("x-hint" = "it is the name of a column"))]
    pub name: String,
    /// Key of the scenario that it sets, such as `phantom.position_mm[0]`, `tool.urdf`, `seed` or
    /// `goal.roll_deg`, where `goal` is whichever goal a case has. Not used with `levels`.
    #[serde(default)]
    pub key: Option<String>,
    /// `choice` for what is ours to choose, `circumstance` for what the choice has to hold for.
    #[serde(default)]
    pub role: Role,
    /// Adds to the scenario's number instead of replacing it.
    #[serde(default)]
    pub relative: bool,
    /// Draws from `values`, `grid` or `levels`, all equally likely, instead of crossing them with the
    /// other factors.
    #[serde(default)]
    pub sampled: bool,
    /// Values, crossed with those of other factors.
    #[serde(default)]
    pub values: Option<Vec<Setting>>,
    /// Evenly spaced numbers, ends included, crossed with the values of other factors.
    #[serde(default)]
    pub grid: Option<GridSection>,
    /// Lower and upper end of a range that is sampled uniformly.
    #[serde(default)]
    #[schemars(inner(range(min = -1e12, max = 1e12)))]
    pub range: Option<[f64; 2]>,
    /// A normal distribution that is sampled.
    #[serde(default)]
    pub normal: Option<NormalSection>,
    /// Named levels that set several keys at once.
    #[serde(default)]
    pub levels: Option<Vec<LevelSection>>,
}

/// Evenly spaced numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GridSection {
    /// The first.
    #[schemars(range(min = -1e12, max = 1e12))]
    pub from: f64,
    /// The last.
    #[schemars(range(min = -1e12, max = 1e12))]
    pub to: f64,
    /// How many, both ends included: at least 2.
    #[schemars(range(min = 2, max = 100_000), extend("x-hint" = "both ends are included"))]
    pub steps: u32,
}

/// A normal distribution.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NormalSection {
    /// Mean.
    #[schemars(range(min = -1e12, max = 1e12))]
    pub mean: f64,
    /// Standard deviation.
    #[schemars(range(max = 1e12), extend("exclusiveMinimum" = 0.0, "x-hint" = "it has to be positive; a fixed value goes into the scenario"))]
    pub sd: f64,
    /// Ends beyond which nothing is drawn (a truncated normal distribution); none if left out.
    #[serde(default)]
    #[schemars(inner(range(min = -1e12, max = 1e12)))]
    pub within: Option<[f64; 2]>,
}

/// A named level.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LevelSection {
    /// Name in the results.
    pub name: String,
    /// Keys of the scenario and their values.
    #[serde(default)]
    pub set: BTreeMap<String, Setting>,
    /// What is computed of cases with this level; the study's `mode` if left out.
    #[serde(default)]
    pub mode: Option<StudyMode>,
    /// Engines of dynamic cases with this level; the study's if left out.
    #[serde(default)]
    pub engines: Option<Vec<EngineName>>,
}

/// How far the phantom may move before a configuration breaks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RobustnessSection {
    /// Largest shift that is looked at, mm.
    #[schemars(range(max = 1000.0), extend("exclusiveMinimum" = 0.0))]
    pub max_shift_mm: f64,
    /// Largest tilt that is looked at, deg.
    #[schemars(range(max = 180.0), extend("exclusiveMinimum" = 0.0))]
    pub max_tilt_deg: f64,
}

impl Default for RobustnessSection {
    fn default() -> Self {
        Self {
            max_shift_mm: 100.0,
            max_tilt_deg: 30.0,
        }
    }
}

/// What a factor does to a scenario.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyFactor {
    /// Name of its column.
    pub name: String,
    /// Unit, from the key; empty if it has none.
    pub unit: String,
    /// Whether it is ours to choose.
    pub role: Role,
    /// Drawn by the sampling instead of crossed.
    pub sampled: bool,
    /// Its values.
    pub values: FactorValues,
}

/// Values of a factor.
#[derive(Debug, Clone, PartialEq)]
pub enum FactorValues {
    /// Some.
    Levels(Vec<StudyLevel>),
    /// A continuum that a key is set to.
    Continuum {
        /// The key.
        key: KeyPath,
        /// Adds to the scenario's number.
        relative: bool,
        /// What numbers are drawn from.
        distribution: Distribution,
    },
}

/// One of some values.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyLevel {
    /// In tables.
    pub label: String,
    /// If it is a number.
    pub number: Option<f64>,
    /// What it does to the scenario.
    pub changes: Vec<(KeyPath, Change)>,
    /// What is computed of its cases, if not the study's.
    pub mode: Option<StudyMode>,
    /// Engines of its dynamic cases, if not the study's.
    pub engines: Option<Vec<EngineName>>,
}

/// What numbers are drawn from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Distribution {
    /// Uniform.
    Uniform {
        /// Lower end.
        low: f64,
        /// Upper end.
        high: f64,
    },
    /// Normal, truncated where ends are given.
    Normal(NormalSection),
}

/// A study with everything that it names read and checked.
#[derive(Debug)]
pub struct ResolvedStudy {
    /// The file as it was read.
    pub file: StudyFile,
    /// The file.
    pub source: ModelSource,
    /// The scenario and its variations.
    pub family: ScenarioFamily,
    /// Names of the goals that are studied.
    pub goals: Vec<String>,
    /// The factors.
    pub factors: Vec<StudyFactor>,
    /// What is computed of a case, unless a level says otherwise.
    pub mode: StudyMode,
}

/// Reads and checks a study file and the scenario that it varies.
///
/// # Errors
/// Every [`Finding`] of the first stage that has any: text, scenario, factors.
pub fn load_study(path: &Path, overrides: &Overrides) -> Result<ResolvedStudy, Vec<Finding>> {
    let file = path.display().to_string();
    let text = read_text(path).map_err(|error| {
        let hint = error.hint("studies are TOML files, such as scenarios/studies/layouts.toml");
        let finding = Finding::new(&file, format!("cannot read the study: {error}")).hint(hint);
        or_wrong_kind(path, FileKind::Study, vec![finding])
    })?;
    let base = path.parent().unwrap_or(Path::new(""));
    resolve::resolve(&file, &text, base, overrides)
        .map_err(|findings| or_wrong_kind(path, FileKind::Study, findings))
}

/// The JSON schema (draft-07) of study files, for editors.
pub fn study_schema() -> serde_json::Value {
    FILE.published()
}

/// A study's text as its sections, each value in its range. The scenario and what the factors do to it
/// are not looked at: [`load_study`] does.
///
/// # Errors
/// Every [`Finding`] about the text, or about its keys and values.
pub fn parse_study(file: &str, text: &str) -> Result<StudyFile, Vec<Finding>> {
    let toml = TomlText::parse(file, text).map_err(|finding| vec![finding])?;
    toml.read(&FILE)
}
