//! From the number of a case to its layout.

use needlebench_input::Finding;
use needlebench_scenario::scenario::EngineName;
use needlebench_scenario::study::{FactorValues, ResolvedStudy, StudyMode};
use needlebench_scenario::{Change, KeyPath, ResolvedScenario, Setting};
use needlebench_study::{Design, FactorKind, FactorValue};

/// One case: what is changed in the scenario, and what is computed.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyCase {
    /// Its number.
    pub number: u64,
    /// Its goal.
    pub goal: String,
    /// Values of the factors, in the order of the design's.
    pub values: Vec<FactorValue>,
    /// Changes of the scenario, in the order in which they are made: what is set first, then what is
    /// added.
    pub changes: Vec<(KeyPath, Change)>,
    /// What is computed.
    pub mode: StudyMode,
    /// Engines of a dynamic case; the scenario's if `None`.
    pub engines: Option<Vec<EngineName>>,
}

impl StudyCase {
    /// The case of a number below the design's count.
    pub fn new(study: &ResolvedStudy, design: &Design, number: u64) -> Self {
        Self::of_values(study, number, design.values(number))
    }

    /// The case of a number with such values, in the order of the study's factors, the goal first.
    pub fn of_values(study: &ResolvedStudy, number: u64, values: Vec<FactorValue>) -> Self {
        let FactorValue::Level(goal) = values[0] else {
            unreachable!("the goal is one of some");
        };
        let mut changes = Vec::with_capacity(study.factors.len());
        let mut mode: Option<StudyMode> = None;
        let mut engines = study.file.engines.clone();
        for (factor, value) in study.factors.iter().zip(&values[1..]) {
            match (&factor.values, *value) {
                (FactorValues::Levels(levels), FactorValue::Level(index)) => {
                    let level = &levels[index];
                    changes.extend(level.changes.iter().cloned());
                    // Where several levels say a mode, all that they ask for is computed.
                    mode = mode.max(level.mode);
                    if let Some(own) = &level.engines {
                        engines = Some(own.clone());
                    }
                }
                (FactorValues::Continuum { key, relative, .. }, FactorValue::Number(number)) => {
                    let change = if *relative {
                        Change::Add(number)
                    } else {
                        Change::Set(Setting::from(number))
                    };
                    changes.push((key.clone(), change));
                }
                _ => unreachable!("the design has the study's factors"),
            }
        }
        // What is added comes on top of what another factor sets. The sort is stable.
        changes.sort_by_key(|(_, change)| matches!(change, Change::Add(_)));
        Self {
            number,
            goal: study.goals[goal].clone(),
            values,
            changes,
            mode: mode.unwrap_or(study.mode),
            engines,
        }
    }

    /// Its scenario, with its goal alone.
    ///
    /// # Errors
    /// Why there cannot be such a layout.
    pub fn scenario(&self, study: &ResolvedStudy) -> Result<ResolvedScenario, Vec<Finding>> {
        study.family.vary(&self.goal, &self.changes)
    }

    /// Names and values of the factors, for people.
    pub fn in_words(&self, design: &Design) -> Vec<(String, String)> {
        design
            .factors()
            .iter()
            .zip(&self.values)
            .map(|(factor, value)| {
                let text = match (value, &factor.kind) {
                    (FactorValue::Level(index), FactorKind::Levels(levels)) => {
                        levels[*index].label.clone()
                    }
                    (FactorValue::Level(index), FactorKind::Continuous { .. }) => index.to_string(),
                    (FactorValue::Number(number), _) => format!("{number:.4}"),
                };
                let unit = if factor.unit.is_empty() {
                    String::new()
                } else {
                    format!(" {}", factor.unit)
                };
                (factor.name.clone(), format!("{text}{unit}"))
            })
            .collect()
    }
}
