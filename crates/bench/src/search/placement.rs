//! The placement of a candidate: the scenario with its values, and the best posture in it.

use needlebench_kinematics::ik::Configuration;
use needlebench_scenario::study::FactorValues;
use needlebench_scenario::{Change, ResolvedScenario, Setting};
use needlebench_study::search::SearchLog;
use needlebench_study::{FactorValue, Role};

use super::PreparedSearch;
use crate::study::{StaticWorker, counted_classes};

/// A candidate in the scenario as its file has it, all else unchanged.
#[derive(Debug)]
pub struct Placement {
    /// The scenario, with one goal.
    pub resolved: ResolvedScenario,
    /// Joint positions of the configuration with the most margin, rad.
    pub joints_rad: [f64; 6],
    /// Its label.
    pub configuration: &'static str,
    /// Its margin, m.
    pub margin_m: f64,
}

/// The placement of a candidate of a search, by its number, at the first goal that any configuration reaches; none where
/// there is no such goal.
pub fn placement(search: &PreparedSearch, id: usize, log: &SearchLog) -> Option<Placement> {
    let study = &search.study;
    let choice = &log.candidates.get(id)?.choice;
    let mut changes = Vec::new();
    let mut chosen = search.candidate_of(choice)?.into_iter();
    for factor in &study.factors {
        let value = match factor.role {
            Role::Control => chosen.next(),
            // What all layouts have in common.
            Role::Noise => match &factor.values {
                FactorValues::Levels(levels) if levels.len() == 1 => Some(FactorValue::Level(0)),
                _ => None,
            },
        };
        match (&factor.values, value) {
            (FactorValues::Levels(levels), Some(FactorValue::Level(level))) => {
                changes.extend(levels[level].changes.iter().cloned());
            }
            (FactorValues::Continuum { key, relative, .. }, Some(FactorValue::Number(number))) => {
                let change = if *relative {
                    Change::Add(number)
                } else {
                    Change::Set(Setting::from(number))
                };
                changes.push((key.clone(), change));
            }
            _ => {}
        }
    }
    changes.sort_by_key(|(_, change)| matches!(change, Change::Add(_)));
    study.goals.iter().find_map(|goal| {
        let resolved = study.family.vary(goal, &changes).ok()?;
        let rows = StaticWorker::counting(counted_classes(study)).rows(&resolved);
        let placed = rows
            .iter()
            .zip(Configuration::ALL)
            .filter_map(|(row, configuration)| {
                let joints_rad = row.measured.joints_rad?;
                Some((row.margin_m?, joints_rad, configuration.label()))
            });
        let best = placed.reduce(|best, each| if each.0 > best.0 { each } else { best });
        let (margin_m, joints_rad, configuration) = best?;
        Some(Placement {
            resolved,
            joints_rad,
            configuration,
            margin_m,
        })
    })
}
