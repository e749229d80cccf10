//! From the number of a case to the values of its factors.

pub use needlebench_scenario::study::Role;
use needlebench_scenario::study::{
    Distribution, FactorValues, ResolvedStudy, SamplingMethod, StudyFactor,
};
use serde::{Deserialize, Serialize};

use crate::distribution::{ends, quantile};
use crate::sampling::{Dimension, most_dimensions};

/// What a case varies.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Factor {
    /// Name of the column: letters, digits and `_`.
    pub name: String,
    /// Unit, from the key (`mm`, `deg`); empty if it has none.
    pub unit: String,
    /// Control or noise factor.
    pub role: Role,
    /// Whether its values are a sample: sampled points, or seeds of draws. A continuum always is.
    pub sampled: bool,
    /// Its values.
    pub kind: FactorKind,
}

impl Factor {
    /// Whether its values are a sample.
    pub fn is_sampled(&self) -> bool {
        self.sampled || matches!(self.kind, FactorKind::Continuous { .. })
    }
}

/// Values of a factor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FactorKind {
    /// Some.
    Levels(Vec<Level>),
    /// A continuum, with its ends.
    Continuous {
        /// 0.1 % quantile, or the lower end of a bounded range.
        low: f64,
        /// 99.9 % quantile, or the upper end of a bounded range.
        high: f64,
    },
}

/// One of some values.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Level {
    /// In tables.
    pub label: String,
    /// If it is a number.
    pub number: Option<f64>,
}

/// Value of a factor in a case.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FactorValue {
    /// Index of a level.
    Level(usize),
    /// A number of a continuum.
    Number(f64),
}

/// Why there is no design.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum DesignError {
    /// More cases than can be counted.
    #[error("the design has more than 2^53 cases")]
    TooMany,
    /// More factors are sampled than the method has dimensions.
    #[error("{sampled} factors are sampled, but {method} has {most} dimensions")]
    TooManyDimensions {
        /// Number of sampled factors.
        sampled: usize,
        /// Name of the method.
        method: &'static str,
        /// Its dimensions.
        most: usize,
    },
}

/// Most cases: numbers of cases stay exact in every table.
const MOST_CASES: u64 = 1 << 53;

/// All cases of a study. `goal` is always the first factor: the goal's name.
///
/// The number of a case counts the samples fastest, then the levels of the last crossed factor, and
/// so on; the goal slowest. Sampled factors have the same points in every combination of the others,
/// so that levels can be compared in pairs.
#[derive(Debug, Clone, PartialEq)]
pub struct Design {
    factors: Vec<Factor>,
    sources: Vec<Source>,
    cases: u64,
    samples: u64,
}

/// Where the value of a factor comes from.
#[derive(Debug, Clone, PartialEq)]
enum Source {
    /// Level `case / stride % levels`.
    Crossed {
        stride: u64,
        levels: u64,
    },
    SampledLevel {
        dimension: Dimension,
        levels: usize,
    },
    Sampled {
        dimension: Dimension,
        distribution: Distribution,
    },
}

impl Design {
    /// The design of a study.
    ///
    /// # Errors
    /// [`DesignError`].
    pub fn new(study: &ResolvedStudy) -> Result<Self, DesignError> {
        let sampling = &study.file.sampling;
        Self::of(
            &study.goals,
            &study.factors,
            sampling.method,
            sampling.samples,
            study.file.seed,
        )
    }

    /// The design of goals and factors.
    ///
    /// # Errors
    /// [`DesignError`].
    pub fn of(
        goals: &[String],
        factors: &[StudyFactor],
        method: SamplingMethod,
        samples: Option<u64>,
        seed: u64,
    ) -> Result<Self, DesignError> {
        let sampled = factors.iter().filter(|factor| factor.sampled).count();
        let most = most_dimensions(method);
        if sampled > most {
            return Err(DesignError::TooManyDimensions {
                sampled,
                method: method.name(),
                most,
            });
        }
        let samples = samples.filter(|_| sampled > 0).unwrap_or(1);
        let goal = goal_factor(goals);
        let described = factors.iter().map(|factor| described(factor, sampled > 0));
        let descriptions: Vec<Factor> = std::iter::once(goal).chain(described).collect();
        let mut next_dimension = 0;
        let mut sources: Vec<Source> = Vec::with_capacity(descriptions.len());
        for (index, factor) in descriptions.iter().enumerate() {
            let study_factor = index.checked_sub(1).map(|index| &factors[index]);
            let levels = match &factor.kind {
                FactorKind::Levels(levels) => levels.len(),
                FactorKind::Continuous { .. } => 0,
            };
            let Some(study_factor) = study_factor.filter(|each| each.sampled) else {
                sources.push(Source::Crossed {
                    stride: 0,
                    levels: levels as u64,
                });
                continue;
            };
            let dimension = Dimension::new(method, next_dimension, samples, seed);
            next_dimension += 1;
            sources.push(match &study_factor.values {
                FactorValues::Continuum { distribution, .. } => Source::Sampled {
                    dimension,
                    distribution: *distribution,
                },
                FactorValues::Levels(_) => Source::SampledLevel { dimension, levels },
            });
        }
        let mut cases = samples;
        for source in sources.iter_mut().rev() {
            if let Source::Crossed { stride, levels } = source {
                *stride = cases;
                cases = cases
                    .checked_mul(*levels)
                    .filter(|&cases| cases <= MOST_CASES)
                    .ok_or(DesignError::TooMany)?;
            }
        }
        Ok(Self {
            factors: descriptions,
            sources,
            cases,
            samples,
        })
    }

    /// The factors, in the order of their columns.
    pub fn factors(&self) -> &[Factor] {
        &self.factors
    }

    /// Number of cases.
    pub fn cases(&self) -> u64 {
        self.cases
    }

    /// Number of samples in every combination of the crossed factors: cases whose numbers differ by a
    /// multiple of it have the same sampled values.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Values of all factors in a case, in the order of [`Design::factors`]. Depends on the design
    /// and the number alone.
    ///
    /// # Panics
    /// Beyond [`Design::cases`].
    pub fn values(&self, case: u64) -> Vec<FactorValue> {
        assert!(case < self.cases, "case {case} of {}", self.cases);
        let sample = case % self.samples;
        self.sources
            .iter()
            .map(|source| match source {
                Source::Crossed { stride, levels } => {
                    FactorValue::Level(index(case / stride % levels))
                }
                Source::SampledLevel { dimension, levels } => {
                    #[expect(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "between 0 and the number of levels"
                    )]
                    let level = (dimension.coordinate(sample) * *levels as f64) as usize;
                    FactorValue::Level(level.min(levels - 1))
                }
                Source::Sampled {
                    dimension,
                    distribution,
                } => FactorValue::Number(quantile(distribution, dimension.coordinate(sample))),
            })
            .collect()
    }
}

fn index(number: u64) -> usize {
    usize::try_from(number).expect("a level's index")
}

/// Key of the scenario's seed.
const SEED: &str = "seed";

/// The first factor of all studies.
pub(crate) fn goal_factor(goals: &[String]) -> Factor {
    let level = |name: &String| Level {
        label: name.clone(),
        number: None,
    };
    Factor {
        name: "goal".to_owned(),
        unit: String::new(),
        role: Role::Noise,
        sampled: false,
        kind: FactorKind::Levels(goals.iter().map(level).collect()),
    }
}

pub(crate) fn described(factor: &StudyFactor, any_sampled: bool) -> Factor {
    // Crossed seeds are draws too. Beside a sampling they are crossed with its points: those count.
    let sets_seed = match &factor.values {
        FactorValues::Levels(levels) => levels
            .iter()
            .flat_map(|level| &level.changes)
            .any(|(key, _)| key.to_string() == SEED),
        FactorValues::Continuum { .. } => false,
    };
    Factor {
        name: factor.name.clone(),
        unit: factor.unit.clone(),
        role: factor.role,
        sampled: factor.sampled || sets_seed && !any_sampled,
        kind: match &factor.values {
            FactorValues::Levels(levels) => FactorKind::Levels(
                levels
                    .iter()
                    .map(|level| Level {
                        label: level.label.clone(),
                        number: level.number,
                    })
                    .collect(),
            ),
            FactorValues::Continuum { distribution, .. } => {
                let [low, high] = ends(distribution);
                FactorKind::Continuous { low, high }
            }
        },
    }
}
