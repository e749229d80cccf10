//! The study file: a base scenario, and the factors that vary it.
//!
//! Units are the scenario's: those of the varied keys.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::LazyLock;

use needlebench_input::schema::{COLUMN, FileSchema, LONGEST_NAME, NAME};
use needlebench_input::{FileKind, Finding, ModelSource, TomlText, or_wrong_kind, read_text};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Overrides;
use crate::family::{Change, KeyPath, ScenarioFamily, Setting};
use crate::requirements::Requirements;
use crate::scenario::EngineName;
use criteria::StudyCriteria;
use requirements::study_requirements;
use search::SearchSection;

pub mod criteria;
mod requirements;
mod resolve;
pub mod search;

/// What a study file may hold.
pub(crate) static FILE: LazyLock<FileSchema> = LazyLock::new(FileSchema::of::<StudyFile>);

/// One study: a scenario, the factors that vary it, and the criteria for the results.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StudyFile {
    /// Name in reports and of the results folder: letters, digits, `-` and `_`.
    #[schemars(regex(pattern = NAME), length(max = LONGEST_NAME), extend("x-hint" = "names become file names"))]
    pub name: String,
    /// The question that the study answers, in a sentence or two.
    #[serde(default)]
    pub description: String,
    /// Base scenario: path relative to this file.
    pub scenario: String,
    /// Seed of the sampling. Draws of imperfections follow the scenario's own `seed`, which a factor may vary.
    #[serde(default)]
    pub seed: u64,
    /// Evaluation of a case: `static`, `planned` or `dynamic`; a level of a factor may override it. Default: `planned`
    /// for up to 512 cases (some minutes), `static` (postures only) for more.
    #[serde(default)]
    pub mode: Option<StudyMode>,
    /// Number of static cases, sampled by the `seed`, that are planned too, to estimate the optimistic bias of a study
    /// of postures only; 0 for none. In a study with control factors they are cases of the best candidate.
    #[serde(default = "replanned_cases")]
    #[schemars(range(max = 10_000))]
    pub replanned_cases: u32,
    /// Adds columns of how likely the needle's tip is in the lesion, and its surface closer than 1 mm to bone, vessels and
    /// organs, over the arm and patient population, which the scenario must define. Slower.
    #[serde(default)]
    pub probabilities: bool,
    /// Engines of dynamic cases. Default: the scenario's.
    #[serde(default)]
    pub engines: Option<Vec<EngineName>>,
    /// Goals of the scenario to study. Default: all.
    #[serde(default)]
    pub goals: Option<Vec<String>>,
    /// Sampling of the factors that are not crossed.
    #[serde(default)]
    pub sampling: SamplingSection,
    /// Factors that vary the scenario.
    #[schemars(length(min = 1), extend("x-hint" = "a [[factors]] with `name`, `key` and, say, `range = [-30, 30]`"))]
    pub factors: Vec<FactorSection>,
    /// Criteria for the results.
    #[serde(default)]
    pub criteria: StudyCriteria,
    /// Requirements that criteria verify: the id or text of a requirement by the key of its criterion, such as
    /// `min_layouts_working = "SRS-1: works in 95 % of patients"`. Reports show them with a trace matrix.
    #[serde(default)]
    #[schemars(schema_with = "study_requirements")]
    pub requirements: Requirements,
    /// Minimum shift and tilt of the phantom that make a configuration infeasible. Default: not computed.
    #[serde(default)]
    pub robustness: Option<RobustnessSection>,
    /// Optimisation of the control factors by `needlebench search`.
    #[serde(default)]
    pub search: Option<SearchSection>,
}

fn replanned_cases() -> u32 {
    32
}

/// Maximum number of cases that are planned by default: each takes about a second of one thread, 0.4 to 1 s for the
/// shipped ones, some minutes for all.
const MOST_PLANNED_BY_DEFAULT: u64 = 512;

/// Evaluation of a case.
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
    /// Final postures: inverse kinematics, clearances, margins, predicted tip position.
    #[default]
    Static,
    /// Motions too, with certified clearances; no simulation.
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

/// Sampling design of the sampled factors.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SamplingMethod {
    /// Sobol sequence with Owen scrambling: the most uniform. Powers of two are the best sample sizes.
    #[default]
    Sobol,
    /// Latin hypercube: uniform in every single factor.
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

/// Sampling of the factors that are not crossed.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SamplingSection {
    /// Sampling design: `sobol`, `latin-hypercube` or `random`.
    pub method: SamplingMethod,
    /// Number of points in every combination of the crossed factors, the same points in each. Required if a factor is
    /// sampled.
    #[schemars(range(min = 1, max = 1_u64 << 32))]
    pub samples: Option<u64>,
}

/// Role of a factor in the design.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// A control factor, such as base placement or tool: the study finds its best level.
    #[serde(alias = "choice")]
    #[schemars(extend("x-former" = "choice"))]
    Control,
    /// A noise factor, such as patient position or a draw: a candidate must be feasible over its values.
    #[default]
    #[serde(alias = "circumstance")]
    #[schemars(extend("x-former" = "circumstance"))]
    Noise,
}

/// One factor: exactly one of `values`, `grid`, `range`, `normal` and `levels`.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FactorSection {
    /// Column name in the results: letters, digits and `_`.
    #[schemars(regex(pattern = COLUMN), length(max = LONGEST_NAME), extend("x-hint" = "it is a column name"))]
    pub name: String,
    /// Scenario key that the factor sets, such as `phantom.position_mm[0]`, `tool.urdf`, `seed` or `goal.roll_deg`,
    /// where `goal` is the goal of the case. Not used with `levels`.
    #[serde(default)]
    pub key: Option<String>,
    /// `control` for a control factor, `noise` for a noise factor.
    #[serde(default)]
    pub role: Role,
    /// Adds to the scenario's value instead of replacing it.
    #[serde(default)]
    pub relative: bool,
    /// Samples from `values`, `grid` or `levels` with equal probability, instead of crossing them with the other
    /// factors.
    #[serde(default)]
    pub sampled: bool,
    /// Values, crossed with those of the other factors.
    #[serde(default)]
    pub values: Option<Vec<Setting>>,
    /// Evenly spaced numbers, ends included, crossed with the values of the other factors.
    #[serde(default)]
    pub grid: Option<GridSection>,
    /// Bounds of a range that is sampled uniformly.
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
    /// First value.
    #[schemars(range(min = -1e12, max = 1e12))]
    pub from: f64,
    /// Last value.
    #[schemars(range(min = -1e12, max = 1e12))]
    pub to: f64,
    /// Number of values, both ends included, at least 2.
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
    #[schemars(range(max = 1e12), extend("exclusiveMinimum" = 0.0, "x-hint" = "it must be positive; a fixed value belongs in the scenario"))]
    pub sd: f64,
    /// Bounds of a truncated normal distribution. Default: none.
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
    /// Scenario keys and their values.
    #[serde(default)]
    pub set: BTreeMap<String, Setting>,
    /// Evaluation of cases with this level. Default: the study's `mode`.
    #[serde(default)]
    pub mode: Option<StudyMode>,
    /// Engines of dynamic cases with this level. Default: the study's.
    #[serde(default)]
    pub engines: Option<Vec<EngineName>>,
}

/// Search for the minimum motion of the phantom that makes a configuration infeasible.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RobustnessSection {
    /// Maximum shift searched, mm.
    #[schemars(range(max = 1000.0), extend("exclusiveMinimum" = 0.0))]
    pub max_shift_mm: f64,
    /// Maximum tilt searched, deg.
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

/// Effect of a factor on a scenario.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyFactor {
    /// Name of its column.
    pub name: String,
    /// Unit, from the key; empty if it has none.
    pub unit: String,
    /// Whether it is a control or a noise factor.
    pub role: Role,
    /// Sampled instead of crossed.
    pub sampled: bool,
    /// Its values.
    pub values: FactorValues,
}

/// Values of a factor.
#[derive(Debug, Clone, PartialEq)]
pub enum FactorValues {
    /// Discrete levels.
    Levels(Vec<StudyLevel>),
    /// A continuum that a key is set to.
    Continuum {
        /// The key.
        key: KeyPath,
        /// Adds to the scenario's number.
        relative: bool,
        /// What its numbers are sampled from.
        distribution: Distribution,
    },
}

/// One discrete level.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyLevel {
    /// Label in tables.
    pub label: String,
    /// Its value, if it is a number.
    pub number: Option<f64>,
    /// Its changes to the scenario.
    pub changes: Vec<(KeyPath, Change)>,
    /// Evaluation of its cases, if not the study's.
    pub mode: Option<StudyMode>,
    /// Engines of its dynamic cases, if not the study's.
    pub engines: Option<Vec<EngineName>>,
}

/// Distribution of a sampled factor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Distribution {
    /// Uniform.
    Uniform {
        /// Lower end.
        low: f64,
        /// Upper end.
        high: f64,
    },
    /// Normal, truncated where bounds are given.
    Normal(NormalSection),
}

/// A study, with all files that it names read and checked.
#[derive(Debug)]
pub struct ResolvedStudy {
    /// The study file as read.
    pub file: StudyFile,
    /// The file.
    pub source: ModelSource,
    /// The scenario and its variations.
    pub family: ScenarioFamily,
    /// Names of the goals that are studied.
    pub goals: Vec<String>,
    /// The factors.
    pub factors: Vec<StudyFactor>,
    /// Evaluation of a case, unless a level overrides it.
    pub mode: StudyMode,
    /// Notes on the study file, for standard error.
    pub notes: Vec<String>,
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

/// A study's text as its sections, each value in its range. The scenario and the effect of the factors on it are
/// checked by [`load_study`].
///
/// # Errors
/// Every [`Finding`] about the text, or about its keys and values.
pub fn parse_study(file: &str, text: &str) -> Result<StudyFile, Vec<Finding>> {
    let toml = TomlText::parse(file, text).map_err(|finding| vec![finding])?;
    toml.read(&FILE)
}
