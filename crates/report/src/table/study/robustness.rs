//! Robustness radii as a table.

use needlebench_bench::study::RobustnessResult;
use needlebench_bench::study::robustness::{RESOLUTION, Robustness, SmallestFound, Unaware};
use needlebench_study::statistics::Method;

use crate::table::Block;

/// All radii of a result.
fn radii(found: &Robustness) -> impl Iterator<Item = &SmallestFound> {
    let stays = found.unaware.iter();
    [&found.shift, &found.tilt]
        .into_iter()
        .chain(stays.flat_map(|unaware| [&unaware.shift, &unaware.tilt]))
}

/// `35.51`, `none to 150`, with a mark where layouts in between cannot exist.
fn radius(found: &SmallestFound) -> String {
    let text = match &found.found {
        Some(breaking) if breaking.radius == 0.0 => "0".to_owned(),
        Some(breaking) => format!("{:.2}", breaking.radius),
        None => format!("none to {}", found.limit),
    };
    let gap = if found.impossible > 0 { "*" } else { "" };
    let open = if found.settled { "" } else { "?" };
    format!("{text}{gap}{open}")
}

/// How the radii were searched for, in words.
pub(crate) fn robustness_method(results: &[RobustnessResult]) -> Option<Method> {
    let first = &results.first()?.found;
    // Where it is broken as it stands nothing is searched.
    let most = |pick: fn(&SmallestFound) -> u32| {
        let all = results.iter().flat_map(|result| radii(&result.found));
        all.map(pick).max().unwrap_or_default()
    };
    Some(Method {
        numbers: "robustness radii".to_owned(),
        method: format!(
            "the smallest move found to break a configuration, no bound: the first break along {} directions \
             of shifts and {} of turns, a pattern search about the nearest, to {RESOLUTION} mm or deg, and \
             evenly spread points of the ball within, repeated about each that breaks until none of {} does; \
             layouts that cannot exist are neither breaks nor places where nothing breaks",
            first.shift.directions,
            first.tilt.directions,
            most(|found| found.points)
        ),
        source: "points: Roberts' additive recurrence (2018); directions: a Fibonacci lattice"
            .to_owned(),
    })
}

/// The radii as a table, with the rule that breaks.
pub(crate) fn robustness_blocks(results: &[RobustnessResult]) -> Vec<Block> {
    let rows = results
        .iter()
        .map(|result| {
            let Robustness {
                shift,
                tilt,
                unaware,
                ..
            } = &result.found;
            let stays = |found: fn(&Unaware) -> &SmallestFound| {
                let unaware = unaware.as_ref();
                unaware.map_or_else(String::new, |unaware| radius(found(unaware)))
            };
            let breaking = shift.found.as_ref().or(tilt.found.as_ref());
            vec![
                result.goal.clone(),
                result.configuration.to_owned(),
                radius(shift),
                radius(tilt),
                breaking.map_or_else(String::new, |found| found.detail.clone()),
                stays(|unaware| &unaware.shift),
                stays(|unaware| &unaware.tilt),
            ]
        })
        .collect();
    let mut lines = vec![
        "Smallest shift, and turn about the vertical and the long axis, found to break the configuration: with \
         its posture solved anew, and with the arm left where it stands. `summary.json` has the breaking cases."
            .to_owned(),
    ];
    if let Some(method) = robustness_method(results) {
        lines.push(format!("Found by search: {}.", method.method));
    }
    let any = |pick: fn(&SmallestFound) -> bool| {
        let mut all = results.iter().flat_map(|result| radii(&result.found));
        all.any(pick)
    };
    if any(|found| found.impossible > 0) {
        lines.push(
            "*: some of the layouts within cannot exist, and count neither way; `summary.json` says how many."
                .to_owned(),
        );
    }
    if any(|found| !found.settled) {
        lines.push(
            "?: nearer breaks were still being found when the search was given up.".to_owned(),
        );
    }
    vec![
        Block::Heading(
            "robustness: smallest moves of the patient of the base scenario found to break"
                .to_owned(),
        ),
        Block::table(
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
        Block::Lines(lines),
    ]
}
