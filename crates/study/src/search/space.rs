//! The candidates and circumstances of a study.

use needlebench_numerics::sobol::DIMENSIONS;
use needlebench_scenario::study::{
    Distribution, FactorValues, ResolvedStudy, Role, SamplingMethod, StudyFactor,
};

use super::{Candidate, ChoiceAxis, Choices, Generation, Stream};
use crate::design::{described, goal_factor};
use crate::distribution::quantile;
use crate::sampling::{Dimension, most_dimensions};
use crate::store::CaseDesign;
use crate::{Factor, FactorKind, FactorValue};

/// Makes the held-out points different from those that candidates are compared by.
const FRESH: u64 = 0x2545_f491_4f6c_dd1d;

/// Why a study cannot be searched.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SpaceError {
    /// No control factor.
    #[error("no control factor: no factor has `role = \"control\"`")]
    NoChoice,
    /// No noise factor.
    #[error("no noise factor: all factors are control factors, and there is one goal")]
    NoCircumstance,
    /// A control factor with a distribution.
    #[error("the control factor `{factor}` has `normal`, but control factors are not sampled")]
    Drawn {
        /// Its name.
        factor: String,
    },
    /// More noise factors than the sampling has dimensions.
    #[error("{circumstances} noise factors are sampled, but {method} has {most} dimensions")]
    TooManyDimensions {
        /// How many vary, goals included.
        circumstances: usize,
        /// Name of the method.
        method: &'static str,
        /// Its dimensions.
        most: usize,
    },
    /// More ranges than points can be spread over.
    #[error("{ranges} control factors have ranges; the limit is {most}")]
    TooManyRanges {
        /// How many have one.
        ranges: usize,
        /// Dimensions of Sobol's sequence.
        most: usize,
    },
}

#[derive(Debug, Clone, PartialEq)]
enum Part {
    Choice,
    /// One value alone.
    Fixed,
    Level {
        common: Dimension,
        fresh: Dimension,
        levels: usize,
    },
    Number {
        common: Dimension,
        fresh: Dimension,
        distribution: Distribution,
    },
}

/// Candidates and circumstances of a study. Circumstances are points of the cube of all noise factors, goals and
/// crossed levels included, all levels equally likely: so a few of them are a sample of all.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchSpace {
    factors: Vec<Factor>,
    parts: Vec<Part>,
    choices: Choices,
}

impl SearchSpace {
    /// Of a study, with so many circumstances.
    ///
    /// # Errors
    /// [`SpaceError`].
    pub fn new(study: &ResolvedStudy, samples: u64) -> Result<Self, SpaceError> {
        let method = study.file.sampling.method;
        Self::of(
            &study.goals,
            &study.factors,
            method,
            samples,
            study.file.seed,
        )
    }

    /// Of goals and factors.
    ///
    /// # Errors
    /// [`SpaceError`].
    pub fn of(
        goals: &[String],
        factors: &[StudyFactor],
        method: SamplingMethod,
        samples: u64,
        seed: u64,
    ) -> Result<Self, SpaceError> {
        let goal = goal_factor(goals);
        let mut all = vec![Factor {
            sampled: goals.len() > 1,
            ..goal
        }];
        all.extend(factors.iter().map(|factor| Factor {
            sampled: factor.role == Role::Noise,
            ..described(factor, true)
        }));
        let mut next = 0;
        let mut dimensions = || {
            let common = Dimension::new(method, next, samples, seed);
            // Independent ones: intervals are of them.
            let fresh = Dimension::new(SamplingMethod::Random, next, samples, seed ^ FRESH);
            next += 1;
            (common, fresh)
        };
        let varies = |factor: &Factor| match &factor.kind {
            FactorKind::Levels(levels) => levels.len() > 1,
            FactorKind::Continuous { .. } => true,
        };
        let circumstances = all
            .iter()
            .filter(|factor| factor.role == Role::Noise && varies(factor))
            .count();
        let most = most_dimensions(method);
        if circumstances > most {
            return Err(SpaceError::TooManyDimensions {
                circumstances,
                method: method.name(),
                most,
            });
        }
        let mut axes = Vec::new();
        let mut parts = Vec::new();
        for (index, factor) in all.iter().enumerate() {
            let study_factor = index.checked_sub(1).map(|index| &factors[index]);
            let distribution = study_factor.and_then(|factor| match factor.values {
                FactorValues::Continuum { distribution, .. } => Some(distribution),
                FactorValues::Levels(_) => None,
            });
            if factor.role == Role::Control {
                axes.push(match (&factor.kind, distribution) {
                    (_, Some(Distribution::Uniform { low, high })) => {
                        ChoiceAxis::Range { low, high }
                    }
                    (FactorKind::Levels(levels), None) => ChoiceAxis::Levels(levels.len()),
                    _ => {
                        let factor = factor.name.clone();
                        return Err(SpaceError::Drawn { factor });
                    }
                });
                parts.push(Part::Choice);
                continue;
            }
            parts.push(match (&factor.kind, distribution) {
                (_, Some(distribution)) => {
                    let (common, fresh) = dimensions();
                    Part::Number {
                        common,
                        fresh,
                        distribution,
                    }
                }
                (FactorKind::Levels(levels), None) if levels.len() > 1 => {
                    let (common, fresh) = dimensions();
                    Part::Level {
                        common,
                        fresh,
                        levels: levels.len(),
                    }
                }
                _ => Part::Fixed,
            });
        }
        if axes.is_empty() {
            return Err(SpaceError::NoChoice);
        }
        if circumstances == 0 {
            return Err(SpaceError::NoCircumstance);
        }
        let choices = Choices(axes);
        let ranges = choices.dimensions();
        if ranges > DIMENSIONS {
            return Err(SpaceError::TooManyRanges {
                ranges,
                most: DIMENSIONS,
            });
        }
        Ok(Self {
            factors: all,
            parts,
            choices,
        })
    }

    /// The factors to choose.
    pub fn choices(&self) -> &Choices {
        &self.choices
    }

    /// All factors, the goal first, in the order of their columns.
    pub fn factors(&self) -> &[Factor] {
        &self.factors
    }

    /// Values of all factors of a candidate under a circumstance.
    pub fn values(
        &self,
        candidate: &[FactorValue],
        stream: Stream,
        circumstance: u64,
    ) -> Vec<FactorValue> {
        let mut chosen = candidate.iter();
        let at = |common: &Dimension, fresh: &Dimension| {
            match stream {
                Stream::Common => common,
                Stream::Fresh => fresh,
            }
            .coordinate(circumstance)
        };
        self.parts
            .iter()
            .map(|part| match part {
                Part::Choice => *chosen.next().expect("a value of each choice"),
                Part::Fixed => FactorValue::Level(0),
                Part::Level {
                    common,
                    fresh,
                    levels,
                } => {
                    #[expect(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "between 0 and the number of levels"
                    )]
                    let level = (at(common, fresh) * *levels as f64) as usize;
                    FactorValue::Level(level.min(levels - 1))
                }
                Part::Number {
                    common,
                    fresh,
                    distribution,
                } => FactorValue::Number(quantile(distribution, at(common, fresh))),
            })
            .collect()
    }

    /// Values of the control factors by name: labels of levels, numbers.
    pub fn describe(&self, candidate: &[FactorValue]) -> Vec<(String, serde_json::Value)> {
        let chosen = self
            .factors
            .iter()
            .filter(|each| each.role == Role::Control);
        chosen
            .zip(candidate)
            .map(|(factor, value)| {
                let value = match (value, &factor.kind) {
                    (FactorValue::Level(index), FactorKind::Levels(levels)) => {
                        let level = &levels[*index];
                        level
                            .number
                            .map_or_else(|| level.label.clone().into(), Into::into)
                    }
                    (FactorValue::Level(index), FactorKind::Continuous { .. }) => (*index).into(),
                    (FactorValue::Number(number), _) => (*number).into(),
                };
                (factor.name.clone(), value)
            })
            .collect()
    }
}

/// The cases of a generation: candidates in their order, circumstances fastest.
#[derive(Debug, Clone, PartialEq)]
pub struct GenerationDesign<'a> {
    /// Candidates and circumstances of the study.
    pub space: &'a SearchSpace,
    /// Which of them.
    pub generation: &'a Generation,
}

impl GenerationDesign<'_> {
    /// The candidate of a case, by its place in the generation, and the number of its circumstance.
    pub fn place(&self, case: u64) -> (usize, u64) {
        let candidate = usize::try_from(case / self.generation.count).expect("a candidate");
        (
            candidate,
            self.generation.first + case % self.generation.count,
        )
    }

    /// The candidate of a case.
    pub fn candidate(&self, case: u64) -> &Candidate {
        &self.generation.candidates[self.place(case).0]
    }
}

impl CaseDesign for GenerationDesign<'_> {
    fn factors(&self) -> &[Factor] {
        &self.space.factors
    }

    fn cases(&self) -> u64 {
        self.generation.cases()
    }

    fn values(&self, case: u64) -> Vec<FactorValue> {
        let (candidate, circumstance) = self.place(case);
        let candidate = &self.generation.candidates[candidate];
        self.space
            .values(candidate, self.generation.stream, circumstance)
    }
}
