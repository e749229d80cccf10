//! How far the base layout of a study may move.

use needlebench_cell::Finding;
use needlebench_cell::study::{ResolvedStudy, RobustnessSection};
use needlebench_kinematics::ik::Configuration;
use serde::Serialize;

use super::robustness::{Breaking, Robustness, RobustnessSettings, robustness};
use super::tables::{Part, table};
use crate::pipeline::in_parallel;
use crate::progress::Progress;

/// How far the phantom of the base scenario may move before a configuration breaks.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct RobustnessResult {
    goal: String,
    configuration: &'static str,
    #[serde(flatten)]
    found: Robustness,
}

/// Radii of all goals and configurations of the base scenario.
///
/// # Errors
/// What is wrong with the base scenario for one goal alone.
pub(crate) fn robustness_of(
    study: &ResolvedStudy,
    section: &RobustnessSection,
    threads: usize,
    progress: &Progress,
) -> Result<Vec<RobustnessResult>, Vec<Finding>> {
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
        let found = robustness(&study.family, goal, &[], *configuration, &settings);
        progress.step();
        Ok(RobustnessResult {
            goal: (*goal).clone(),
            configuration: configuration.label(),
            found: found?,
        })
    })
    .into_iter()
    .collect()
}

/// The radii as a table, with the rule that breaks.
pub(crate) fn robustness_parts(
    section: &RobustnessSection,
    results: &[RobustnessResult],
) -> Vec<Part> {
    let radius = |found: Option<&Breaking>, most: f64| match found {
        Some(found) if found.radius == 0.0 => "0".to_owned(),
        Some(found) => format!("{:.2}", found.radius),
        None => format!("> {most}"),
    };
    let rows = results
        .iter()
        .map(|result| {
            let Robustness {
                shift,
                tilt,
                unaware,
                ..
            } = &result.found;
            let stays = |found: fn(&super::robustness::Unaware) -> &Option<Breaking>, most| {
                unaware
                    .as_ref()
                    .map_or_else(String::new, |unaware| radius(found(unaware).as_ref(), most))
            };
            vec![
                result.goal.clone(),
                result.configuration.to_owned(),
                radius(shift.as_ref(), section.max_shift_mm),
                radius(tilt.as_ref(), section.max_tilt_deg),
                shift
                    .as_ref()
                    .or(tilt.as_ref())
                    .map_or_else(String::new, |found| found.detail.clone()),
                stays(|unaware| &unaware.shift, section.max_shift_mm),
                stays(|unaware| &unaware.tilt, section.max_tilt_deg),
            ]
        })
        .collect();
    vec![
        Part::Heading("robustness: how far the patient of the base scenario may move".to_owned()),
        table(
            [
                "goal",
                "<configuration",
                "shift\nmm",
                "turn\ndeg",
                "<breaks",
                "arm stays\nmm",
                "arm stays\ndeg",
            ],
            rows,
        ),
        Part::Lines(vec![
            "Smallest shift, and turn about the vertical and the long axis, that breaks the configuration: \
             with its posture solved anew, and with the arm left where it stands. `summary.json` has the \
             breaking cases."
                .to_owned(),
        ]),
    ]
}
