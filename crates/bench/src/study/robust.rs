//! How far the base layout of a study may move.

use std::sync::atomic::AtomicBool;

use needlebench_input::Finding;
use needlebench_kinematics::ik::Configuration;
use needlebench_parallel::{Progress, in_parallel};
use needlebench_scenario::study::{ResolvedStudy, RobustnessSection};
use serde::Serialize;

use super::robustness::{Robustness, RobustnessSettings, robustness};

/// How far the phantom of the base scenario may move before a configuration breaks.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RobustnessResult {
    /// Name of the goal.
    pub goal: String,
    /// Label of the configuration.
    pub configuration: &'static str,
    /// Its radii.
    #[serde(flatten)]
    pub found: Robustness,
}

/// Radii of all goals and configurations of the base scenario; `None` if it was cancelled.
///
/// # Errors
/// What is wrong with the base scenario for one goal alone.
pub fn robustness_of(
    study: &ResolvedStudy,
    section: &RobustnessSection,
    threads: usize,
    cancel: Option<&AtomicBool>,
    progress: &dyn Progress,
) -> Result<Option<Vec<RobustnessResult>>, Vec<Finding>> {
    let settings = RobustnessSettings {
        max_shift_mm: section.max_shift_mm,
        max_tilt_deg: section.max_tilt_deg,
        ..RobustnessSettings::default()
    };
    let jobs: Vec<(&String, Configuration)> = study
        .goals
        .iter()
        .flat_map(|goal| Configuration::ALL.map(|configuration| (goal, configuration)))
        .collect();
    progress.message("robustness");
    progress.at(0, jobs.len() as u64);
    in_parallel(threads, &jobs, |(goal, configuration)| {
        let found = robustness(&study.family, goal, &[], *configuration, &settings, cancel);
        progress.step();
        Ok(found?.map(|found| RobustnessResult {
            goal: (*goal).clone(),
            configuration: configuration.label(),
            found,
        }))
    })
    .into_iter()
    .collect()
}
