//! A study ready to be computed.

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use needlebench_engine::ENGINES;
use needlebench_input::Finding;
use needlebench_scenario::study::{FactorValues, ResolvedStudy, StudyLevel, StudyMode};
use needlebench_study::{
    CaseError, CaseEvaluator, Design, DesignError, FactorKind, Manifest, SCHEMA_VERSION, Shard,
    Status,
};
use serde_json::json;

use super::identity::Identity;
use super::likely;
use super::rows::StudyColumns;
use crate::provenance::{SOURCE_SHA256, arithmetic};

/// A study, its cases, and what decides its results.
#[derive(Debug)]
pub struct PreparedStudy {
    /// The study as it was read.
    pub study: ResolvedStudy,
    /// Its cases.
    pub design: Design,
    /// What decides its results.
    pub identity: Identity,
    /// Columns of its table.
    pub columns: StudyColumns,
}

/// Most cases of a block: a moment of work that a kill may lose.
const MOST_BLOCK_CASES: u64 = 64;
/// Least number of blocks of a study, if it has as many cases: enough for shards.
const LEAST_BLOCKS: u64 = 256;

impl PreparedStudy {
    /// Makes the design and reads all that levels name.
    ///
    /// # Errors
    /// A design that is too large, or a level that cannot be used.
    pub fn new(study: ResolvedStudy) -> Result<Self, Vec<Finding>> {
        likely::check(&study)?;
        let design = Design::new(&study).map_err(|error| vec![design_finding(&study, &error)])?;
        let identity = Identity::new(&study)?;
        let columns = columns(&study);
        Ok(Self {
            study,
            design,
            identity,
            columns,
        })
    }

    /// Everything that is computed of any case.
    pub fn most_costly_mode(&self) -> StudyMode {
        let of_levels = levels(&self.study).filter_map(|level| level.mode);
        of_levels.fold(self.study.mode, StudyMode::max)
    }

    /// What is computed of some case.
    pub fn modes(&self) -> BTreeSet<StudyMode> {
        modes(&self.study)
    }

    /// What the folder's results are results of.
    pub fn manifest(&self, shard: Option<Shard>) -> Manifest {
        let block_cases = match self.most_costly_mode() {
            StudyMode::Static => (self.design.cases() / LEAST_BLOCKS).clamp(1, MOST_BLOCK_CASES),
            StudyMode::Planned | StudyMode::Dynamic => 1,
        };
        let file = &self.study.file;
        Manifest {
            schema_version: SCHEMA_VERSION,
            study_id: self.identity.id.clone(),
            name: file.name.clone(),
            cases: self.design.cases(),
            block_cases: u32::try_from(block_cases).expect("at most 64"),
            shard,
            status: Status::Running,
            factors: self.design.factors().to_vec(),
            columns: self.columns.described(),
            inputs: self.identity.inputs.clone(),
            provenance: json!({
                "program": "needlebench",
                "version": env!("CARGO_PKG_VERSION"),
                "source_sha256": SOURCE_SHA256,
                "arithmetic": self.arithmetic(),
                "inputs": self.identity.inputs,
                "seed": file.seed,
                "sampling": { "method": file.sampling.method.name(), "samples": self.design.samples() },
                "mode": self.study.mode.name(),
                "goals": self.study.goals,
                "description": file.description,
            }),
        }
    }

    /// How numbers are rounded in its cases. MuJoCo takes its elementary functions from the C library and from NumPy,
    /// which pick them by the CPU: what they look at is said, so that shards of unlike machines are told apart.
    /// Whether MuJoCo runs any case.
    pub fn needs_mujoco(&self) -> bool {
        self.modes().contains(&StudyMode::Dynamic) && engines(&self.study).contains(&MUJOCO)
    }

    fn arithmetic(&self) -> String {
        let common = arithmetic();
        if self.needs_mujoco() {
            format!("{common}; MuJoCo on {}", cpu())
        } else {
            common
        }
    }

    /// Number of cases by factors, for people: `4 goal x 6 size x 256 samples`.
    pub fn product(&self) -> String {
        product(
            &self.study,
            self.design
                .factors()
                .iter()
                .map(|factor| match &factor.kind {
                    FactorKind::Levels(levels) => levels.len(),
                    FactorKind::Continuous { .. } => 0,
                }),
            self.design.samples(),
        )
    }
}

/// Name of the engine whose arithmetic is not ours.
const MUJOCO: &str = "mujoco";

/// What variants of elementary functions are picked by.
fn cpu() -> String {
    #[cfg(target_arch = "x86_64")]
    {
        let has = [
            ("avx2", std::arch::is_x86_feature_detected!("avx2")),
            ("fma", std::arch::is_x86_feature_detected!("fma")),
            ("avx512f", std::arch::is_x86_feature_detected!("avx512f")),
        ];
        let named = has.iter().filter(|(_, has)| *has);
        let named: Vec<&str> = named.map(|(name, _)| *name).collect();
        if named.is_empty() {
            "sse2".to_owned()
        } else {
            named.join("+")
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        std::env::consts::ARCH.to_owned()
    }
}

/// All levels of all factors.
fn levels(study: &ResolvedStudy) -> impl Iterator<Item = &StudyLevel> {
    study
        .factors
        .iter()
        .flat_map(|factor| match &factor.values {
            FactorValues::Levels(levels) => levels.as_slice(),
            FactorValues::Continuum { .. } => &[],
        })
}

/// What is computed of some case. The study's own mode is of cases of which no level says another.
fn modes(study: &ResolvedStudy) -> BTreeSet<StudyMode> {
    let mut modes: BTreeSet<StudyMode> = levels(study).filter_map(|level| level.mode).collect();
    let always_said = study.factors.iter().any(|factor| match &factor.values {
        FactorValues::Levels(levels) => levels.iter().all(|level| level.mode.is_some()),
        FactorValues::Continuum { .. } => false,
    });
    if !always_said {
        modes.insert(study.mode);
    }
    modes
}

/// The engines that may run some case, in their own order.
fn engines(study: &ResolvedStudy) -> Vec<&str> {
    let file = &study.file;
    let of_scenario = study.family.base().scenario.engines.run.as_ref();
    let named = file.engines.as_ref().or(of_scenario);
    let of_levels = levels(study).filter_map(|level| level.engines.as_ref());
    let mut engines: Vec<&str> = of_levels
        .chain(named)
        .flatten()
        .map(AsRef::<str>::as_ref)
        .collect();
    let is_varied = levels(study)
        .flat_map(|level| &level.changes)
        .any(|(key, _)| key.to_string().starts_with("engines.run"));
    let others = ENGINES.iter();
    let others = others.filter(|engine| is_varied || named.is_none() && engine.runs_by_default());
    engines.extend(others.map(|engine| engine.name()));
    let mut seen = BTreeSet::new();
    engines.retain(|engine| seen.insert(*engine));
    let place = |name: &str| ENGINES.iter().position(|engine| engine.name() == name);
    engines.sort_by_key(|name| place(name).unwrap_or(ENGINES.len()));
    engines
}

/// The columns of all that may be computed of any case.
fn columns(study: &ResolvedStudy) -> StudyColumns {
    let engines = engines(study);
    let modes = modes(study);
    let modes: Vec<StudyMode> = modes.into_iter().collect();
    let mut columns = StudyColumns::new(&modes, &engines);
    if !study.file.probabilities {
        columns = columns.without_probabilities();
    }
    if study.file.search.is_some() && modes.contains(&StudyMode::Static) {
        columns = columns.with_margin();
    }
    if has_true_targets(study) {
        columns
    } else {
        columns.without_true_targets()
    }
}

/// Whether any case may have a goal with a true target.
fn has_true_targets(study: &ResolvedStudy) -> bool {
    let goals = &study.family.base().scenario.goals;
    let is_varied = levels(study)
        .flat_map(|level| &level.changes)
        .any(|(key, _)| key.to_string().starts_with("goal.true_target_mm"));
    study.family.base().scenario.ct.is_some()
        || is_varied
        || goals.iter().any(|goal| goal.true_target_mm.is_some())
}

fn product(study: &ResolvedStudy, levels: impl Iterator<Item = usize>, samples: u64) -> String {
    let names =
        std::iter::once("goals").chain(study.factors.iter().map(|factor| factor.name.as_str()));
    let is_sampled =
        std::iter::once(false).chain(study.factors.iter().map(|factor| factor.sampled));
    let mut parts: Vec<String> = names
        .zip(levels)
        .zip(is_sampled)
        .filter(|(_, sampled)| !sampled)
        .map(|((name, count), _)| format!("{count} {name}"))
        .collect();
    if samples > 1 {
        parts.push(format!("{samples} samples"));
    }
    parts.join(" x ")
}

fn design_finding(study: &ResolvedStudy, error: &DesignError) -> Finding {
    let finding = Finding::new(&study.source.file, error.to_string());
    match error {
        DesignError::TooMany => {
            let levels =
                std::iter::once(study.goals.len()).chain(study.factors.iter().map(|factor| {
                    match &factor.values {
                        FactorValues::Levels(levels) => levels.len(),
                        FactorValues::Continuum { .. } => 0,
                    }
                }));
            let samples = study.file.sampling.samples.unwrap_or(1);
            finding.key("factors").hint(format!(
                "{}: sample factors with `range` or `sampled = true` instead of crossing them",
                product(study, levels, samples)
            ))
        }
        DesignError::TooManyDimensions { .. } => finding
            .key("sampling.method")
            .hint("`method = \"latin-hypercube\"` has no limit"),
    }
}

/// Time that a measurement of the cost of cases may take.
const ESTIMATE: Duration = Duration::from_secs(2);
/// Most cases that are computed for it.
const ESTIMATE_CASES: u64 = 16;

/// Time of a case on one thread, from a few cases that are spread over the study.
///
/// # Errors
/// What keeps cases from being computed at all.
pub fn time_per_case(evaluator: &dyn CaseEvaluator, cases: u64) -> Result<Duration, CaseError> {
    let mut worker = evaluator.worker();
    let count = ESTIMATE_CASES.min(cases);
    // The first one also pays for what is made once.
    worker.evaluate(0)?;
    let started = Instant::now();
    let mut done = 0;
    for k in 0..count {
        let case = u128::from(cases) * u128::from(k) / u128::from(count);
        worker.evaluate(u64::try_from(case).expect("a case"))?;
        done += 1;
        if started.elapsed() > ESTIMATE {
            break;
        }
    }
    Ok(started.elapsed() / done.max(1))
}

/// A duration as people say it.
pub fn in_words(time: Duration) -> String {
    let seconds = time.as_secs();
    match seconds {
        0..60 => format!("{} s", seconds.max(1)),
        60..3600 => format!("{} min", seconds.div_ceil(60)),
        3600..172_800 => format!("{:.1} h", time.as_secs_f64() / 3600.0),
        _ => format!("{:.0} days", time.as_secs_f64() / 86_400.0),
    }
}
