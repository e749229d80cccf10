//! From a study to a search.

use needlebench_input::{Finding, sha256_hex};
use needlebench_scenario::study::search::{ObjectiveName, SearchSection};
use needlebench_scenario::study::{ResolvedStudy, StudyMode};
use needlebench_study::search::{
    Candidate, Generation, GenerationDesign, Objective, SearchError, SearchPlan, SearchSpace,
    SpaceError, Stream,
};
use needlebench_study::{Factor, FactorKind, FactorValue, Level, Manifest, Role, Shard};
use serde_json::json;

use crate::probability::lesion_at;
use crate::provenance::{SOURCE_SHA256, arithmetic};
use crate::study::{Identity, Likely, StudyColumns, has_imperfections, has_spread, sets};

/// Layouts that candidates may be compared on; fewer give no significant differences.
const SAMPLES_RANGE: std::ops::RangeInclusive<u64> = 16..=1_000_000;
/// Default number of layouts of the finalists.
const SAMPLES: u64 = 128;
/// Default budget of a search of ranges, cases.
const RANGES_BUDGET: u64 = 6144;
/// Default budget, as the divisor of an exhaustive grid of candidates and layouts.
const GRID_SHARE: u64 = 3;
/// Cases of a block of a generation, which are written together.
const BLOCK_CASES: u32 = 4;

/// A study ready to be searched.
#[derive(Debug)]
pub struct PreparedSearch {
    /// The study as it was read.
    pub study: ResolvedStudy,
    /// The `[search]` section, or its defaults.
    pub section: SearchSection,
    /// Its candidates and circumstances.
    pub space: SearchSpace,
    /// Objective and cost.
    pub plan: SearchPlan,
    /// What decides its results.
    pub identity: Identity,
    /// Columns of the tables of generations.
    pub columns: StudyColumns,
}

impl PreparedSearch {
    /// Makes candidates and circumstances of a study.
    ///
    /// # Errors
    /// A study without control or noise factors, or with a budget that is too small.
    pub fn new(study: ResolvedStudy) -> Result<Self, Vec<Finding>> {
        let section = study.file.search.clone().unwrap_or_default();
        let samples = section
            .samples
            .or(study.file.sampling.samples)
            .unwrap_or(SAMPLES);
        if !SAMPLES_RANGE.contains(&samples) {
            let message = format!(
                "samples is {samples} layouts; a search compares candidates on {} to {}",
                SAMPLES_RANGE.start(),
                SAMPLES_RANGE.end()
            );
            return Err(vec![
                Finding::new(&study.source.file, message)
                    .key("sampling.samples")
                    .hint(
                        "fewer give no significant differences; `samples` under [search] applies to searches only",
                    ),
            ]);
        }
        check_objectives(&study, &section)?;
        let space = SearchSpace::new(&study, samples)
            .map_err(|error| vec![space_finding(&study, &error)])?;
        let named = |name| Objective::named(name, section.quantile, section.failure_penalty_mm);
        let mut plan = SearchPlan {
            objective: named(section.objective),
            second: section.second_objective.map(named),
            samples,
            fresh: section.held_out_layouts,
            budget: 0,
            seed: study.file.seed,
        };
        plan.budget = section.budget.unwrap_or_else(|| {
            let usual = match grid_cases(&space, samples) {
                Some(grid) => grid / GRID_SHARE,
                None => RANGES_BUDGET,
            };
            // A small choice costs what it costs.
            match plan.check(space.choices()) {
                Err(SearchError::<()>::Budget { least, .. }) => usual.max(least),
                _ => usual,
            }
        });
        plan.check(space.choices())
            .map_err(|error: SearchError<()>| vec![plan_finding(&study, &error)])?;
        let identity = Identity::new(&study)?;
        let columns = StudyColumns::new(&[StudyMode::Static], &[]).with_margin();
        let columns = if expects(&section, ObjectiveName::LesionProbability) {
            columns.with_lesion_probability_alone()
        } else {
            columns.without_probabilities()
        };
        Ok(Self {
            study,
            section,
            space,
            plan,
            identity,
            columns,
        })
    }

    /// Whether this is an objective.
    pub(crate) fn expects(&self, objective: ObjectiveName) -> bool {
        expects(&self.section, objective)
    }

    /// Which probabilities cases have.
    pub(crate) fn likely(&self) -> Likely {
        if self.expects(ObjectiveName::LesionProbability) {
            Likely::Lesion
        } else {
            Likely::AsJudged
        }
    }

    /// Cases of an exhaustive grid of candidates and layouts; none with ranges.
    pub fn grid_cases(&self) -> Option<u64> {
        grid_cases(&self.space, self.plan.samples)
    }

    /// The control factors.
    pub fn choices(&self) -> impl Iterator<Item = &Factor> {
        let factors = self.space.factors().iter();
        factors.filter(|factor| factor.role == Role::Control)
    }

    /// The candidate of a description in the log; none where it is of no factor's values.
    pub(crate) fn candidate_of(&self, choice: &[(String, serde_json::Value)]) -> Option<Candidate> {
        self.choices()
            .zip(choice)
            .map(|(factor, (_, value))| match &factor.kind {
                FactorKind::Levels(levels) => {
                    let is_it = |level: &Level| match level.number {
                        Some(number) => value.as_f64() == Some(number),
                        None => value.as_str() == Some(&level.label),
                    };
                    levels.iter().position(is_it).map(FactorValue::Level)
                }
                FactorKind::Continuous { .. } => value.as_f64().map(FactorValue::Number),
            })
            .collect()
    }

    /// What the folder of a generation has results of.
    pub fn manifest(&self, generation: &Generation, shard: Option<Shard>) -> Manifest {
        let design = GenerationDesign {
            space: &self.space,
            generation,
        };
        let candidates: Vec<_> = generation
            .candidates
            .iter()
            .map(|candidate| json!(self.space.describe(candidate)))
            .collect();
        let file = &self.study.file;
        let of_generation = json!({
            "generation": generation.number,
            "stream": generation.stream,
            "circumstances": [generation.first, generation.first + generation.count],
            "candidates": candidates,
            "ids": generation.ids,
        });
        let text = format!("{} {of_generation}", self.identity.id);
        let mut manifest = Manifest::new(
            sha256_hex(text.as_bytes()),
            format!("{}_gen_{:03}", file.name, generation.number),
            &design,
            self.columns.described(),
            BLOCK_CASES,
            json!({
                "program": "needlebench",
                "version": env!("CARGO_PKG_VERSION"),
                "source_sha256": SOURCE_SHA256,
                "arithmetic": arithmetic(),
                "inputs": self.identity.inputs,
                "seed": file.seed,
                "sampling": {
                    "method": match generation.stream {
                        Stream::Common => file.sampling.method.name(),
                        Stream::Fresh => "random",
                    },
                    "samples": generation.count,
                },
                "mode": StudyMode::Static.name(),
                "goals": self.study.goals,
                "description": file.description,
                "search": of_generation,
            }),
        );
        manifest.shard = shard;
        manifest.inputs.clone_from(&self.identity.inputs);
        manifest
    }

    /// What keeps a search from going on, as a finding about the study.
    pub fn finding<S>(&self, error: &SearchError<S>) -> Finding {
        plan_finding(&self.study, error)
    }
}

fn expects(section: &SearchSection, objective: ObjectiveName) -> bool {
    section.objective == objective || section.second_objective == Some(objective)
}

/// What keeps a scenario from having the objectives.
fn check_objectives(study: &ResolvedStudy, section: &SearchSection) -> Result<(), Vec<Finding>> {
    let named = |objective: ObjectiveName| {
        if section.objective == objective {
            "search.objective"
        } else {
            "search.second_objective"
        }
    };
    let finding = |objective: ObjectiveName, message: String| {
        Finding::new(&study.source.file, message).key(named(objective))
    };
    let of_population = [
        (ObjectiveName::TipError, "an RMS", has_imperfections(study)),
        (
            ObjectiveName::LesionProbability,
            "a probability",
            has_spread(study),
        ),
    ];
    for (objective, what, is_defined) in of_population {
        if expects(section, objective) && !is_defined {
            let message = format!(
                "`{}` is {what} over arms and patients, which this scenario does not define",
                objective.name()
            );
            return Err(vec![finding(objective, message).hint(
                "define them in [imperfections] of the scenario, or search by `margin` or `rate`",
            )]);
        }
    }
    let objective = ObjectiveName::LesionProbability;
    if expects(section, objective)
        && let Some(goal) = goal_without_lesion(study)
    {
        let message = format!(
            "`lesion_probability` needs targets in lesions; goal `{goal}` has its target in none"
        );
        return Err(vec![finding(objective, message).hint(
            "name a `lesion` of the phantom in the goal, select other `goals`, or search by another objective",
        )]);
    }
    Ok(())
}

/// The first goal of a study whose target is in no lesion of the base scenario; none where a factor sets phantoms or targets,
/// or a scan has them.
fn goal_without_lesion(study: &ResolvedStudy) -> Option<&str> {
    let base = study.family.base();
    let is_varied = ["phantom.model", "goal.", "goals", "ct"]
        .iter()
        .any(|start| sets(study, start));
    if base.scenario.ct.is_some() || is_varied {
        return None;
    }
    let is_in_none = |name: &&String| {
        let goal = base.goals.iter().find(|goal| goal.name == **name);
        let lesion = goal
            .zip(base.phantom.as_ref())
            .and_then(|(goal, placed)| lesion_at(placed, goal));
        lesion.is_none()
    };
    study.goals.iter().find(is_in_none).map(String::as_str)
}

fn grid_cases(space: &SearchSpace, samples: u64) -> Option<u64> {
    if space.choices().dimensions() > 0 {
        return None;
    }
    let combinations = space.choices().combinations()? as u64;
    combinations.checked_mul(samples)
}

fn space_finding(study: &ResolvedStudy, error: &SpaceError) -> Finding {
    let finding = Finding::new(&study.source.file, error.to_string()).key("factors");
    match error {
        SpaceError::NoChoice => finding.hint(
            "give `role = \"control\"` to factors that you control, such as the base placement",
        ),
        SpaceError::NoCircumstance => finding.hint(
            "add a factor that you do not control, such as `key = \"phantom.position_mm[0]\"`, \
             `range = [-30, 30]`, `relative = true`",
        ),
        SpaceError::Drawn { .. } => finding.hint(
            "use `range = [from, to]` for all values between two ends, `grid` for some of them",
        ),
        SpaceError::TooManyRanges { .. } => {
            finding.hint("use `values` for the least important ones")
        }
        SpaceError::TooManyDimensions { .. } => finding
            .key("sampling.method")
            .hint("`method = \"latin-hypercube\"` has no limit"),
    }
}

fn plan_finding<S>(study: &ResolvedStudy, error: &SearchError<S>) -> Finding {
    let message = match error {
        SearchError::Stopped(_) => "the search was stopped".to_owned(),
        SearchError::Budget {
            budget,
            least,
            what,
        } => format!("a budget of {budget} cases is too small: {what} require at least {least}"),
        SearchError::Combinations { combinations, most } => {
            format!("{combinations} combinations of control factors; the limit is {most}")
        }
    };
    let finding = Finding::new(&study.source.file, message);
    match error {
        SearchError::Budget { least, .. } => finding.key("search.budget").hint(format!(
            "set `budget = {least}`, or use fewer `samples` or `held_out_layouts` under [search]"
        )),
        _ => finding
            .key("factors")
            .hint("use fewer levels, or `range` instead of `grid` (several are allowed)"),
    }
}
