//! Robustness radii as a table.

use needlebench_bench::study::RobustnessResult;
use needlebench_bench::study::robustness::{Breaking, Robustness, Unaware};
use needlebench_cell::study::RobustnessSection;

use super::document::{Block, table};

/// The radii as a table, with the rule that breaks.
pub fn robustness_blocks(section: &RobustnessSection, results: &[RobustnessResult]) -> Vec<Block> {
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
            let stays = |found: fn(&Unaware) -> &Option<Breaking>, most| {
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
        Block::Heading("robustness: how far the patient of the base scenario may move".to_owned()),
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
        Block::Lines(vec![
            "Smallest shift, and turn about the vertical and the long axis, that breaks the configuration: \
             with its posture solved anew, and with the arm left where it stands. `summary.json` has the \
             breaking cases."
                .to_owned(),
        ]),
    ]
}
