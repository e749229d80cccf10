//! Robustness radii as a table.

use needlebench_bench::study::RobustnessResult;
use needlebench_bench::study::robustness::{RESOLUTION, Robustness, SmallestFound, Unaware};
use needlebench_show::Block;
use needlebench_study::statistics::Method;

/// All radii of a result.
fn radii(found: &Robustness) -> impl Iterator<Item = &SmallestFound> {
    let stays = found.unaware.iter();
    [&found.shift, &found.tilt]
        .into_iter()
        .chain(stays.flat_map(|unaware| [&unaware.shift, &unaware.tilt]))
}

/// `35.51`, `none up to 150`, with a mark where layouts in between are invalid.
fn radius(found: &SmallestFound) -> String {
    let text = match &found.found {
        Some(breaking) if breaking.radius == 0.0 => "0".to_owned(),
        Some(breaking) => format!("{:.2}", breaking.radius),
        None => format!("none up to {}", found.limit),
    };
    let gap = if found.impossible > 0 { "*" } else { "" };
    let open = if found.settled { "" } else { "?" };
    format!("{text}{gap}{open}")
}

/// The search method of the radii, in words.
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
            "the smallest displacement found that makes a configuration infeasible, not a bound: first failure along \
             {} directions of translation and {} of rotation, pattern search around the nearest to {RESOLUTION} mm \
             or deg, then evenly spread points of the ball inside, repeated around each failure until none of {} \
             points fails; invalid layouts count neither as failures nor as feasible",
            first.shift.directions,
            first.tilt.directions,
            most(|found| found.points)
        ),
        source: "points: Roberts' additive recurrence (2018); directions: a Fibonacci lattice"
            .to_owned(),
    })
}

/// The radii as a table, with the rule or criterion that fails.
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
        "Smallest shift, and rotation about the vertical and the long axis, found to make the configuration \
         infeasible: with the posture recomputed, and with the arm fixed. `summary.json` has the failing cases."
            .to_owned(),
    ];
    if let Some(method) = robustness_method(results) {
        lines.push(format!("Search method: {}.", method.method));
    }
    let any = |pick: fn(&SmallestFound) -> bool| {
        let mut all = results.iter().flat_map(|result| radii(&result.found));
        all.any(pick)
    };
    if any(|found| found.impossible > 0) {
        lines.push(
            "*: range contains invalid layouts (ignored); `summary.json` has their number."
                .to_owned(),
        );
    }
    if any(|found| !found.settled) {
        lines.push("?: search not converged; a smaller value may exist.".to_owned());
    }
    vec![
        Block::Heading(
            "robustness: smallest patient displacement found to cause failure, base scenario"
                .to_owned(),
        ),
        Block::table(
            [
                "goal",
                "<configuration",
                "shift\n(mm)",
                "rotation\n(deg)",
                "<failure",
                "arm fixed,\nshift (mm)",
                "arm fixed,\nrotation (deg)",
            ],
            rows,
        ),
        Block::Lines(lines),
    ]
}
