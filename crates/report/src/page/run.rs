//! The page of a run.

use needlebench_bench::ScenarioRun;
use needlebench_cell::ClearanceClass;
use needlebench_engine::ENGINES;
use needlebench_evaluation::metric::{Heading, Show};
use needlebench_evaluation::report::{GoalReport, Report};
use needlebench_evaluation::room::RoomModel;
use needlebench_kinematics::Joints;
use needlebench_scenario::ResolvedScenario;
use needlebench_show::{Block, heading};
use serde_json::{Value, json};

use super::charts;
use super::explore::explore;
use super::motion::motion;
use super::pack::Pack;
use super::room;
use super::scene::{chain, pose, surroundings};
use super::viewer::Viewer;
use crate::table::engine_headings::{EngineHeading, engine_headings};
use crate::table::judged::judged_blocks;
use crate::table::shown::{Shown, shown_metrics};
use crate::table::true_target::true_target_in_words;
use crate::table::verdict::{counts, missed_as_expected, qualifying};

/// The script of the page, after those of what it has in it.
const SCRIPT: &str = concat!(
    include_str!("assets/run_sections.js"),
    include_str!("assets/iso9283.js"),
    include_str!("assets/explore.js"),
    include_str!("assets/run.js")
);

/// The page of a finished run: everything of its report but the timings, the cell, and all recorded
/// motions.
pub(crate) fn run_page(
    resolved: &ResolvedScenario,
    finished: &ScenarioRun,
    report: &Report,
) -> String {
    let mut pack = Pack::default();
    let mut document = json!({
        "kind": "run",
        "report": serde_json::to_value(report).expect("reports are plain data"),
        "scene": surroundings(resolved, &mut pack),
        "start": Vec::from(resolved.start.as_slice()),
        "realChain": chain(&finished.real_arm.world_from_base_link, &finished.real_arm.chain),
    });
    // They differ from run to run, and the page should not.
    if let Some(report) = document["report"].as_object_mut() {
        report.remove("timings");
    }
    let around = ClearanceClass::ALL.into_iter();
    let around = around.filter(|class| class.is_surroundings());
    document["classesAround"] = json!(around.map(ClearanceClass::name).collect::<Vec<_>>());
    if !resolved.goals.is_empty() {
        document["explore"] = explore(resolved, &mut pack);
    }
    let room = RoomModel::new(resolved);
    let goals: Vec<Value> = (0..resolved.goals.len())
        .map(|goal| self::goal(resolved, finished, &room, goal, &mut pack))
        .collect();
    document["goals"] = json!(goals);
    document["counts"] = json!(counts(report));
    document["qualifying"] = json!(qualifying(report).collect::<Vec<_>>());
    document["judged"] = json!(report.judged.as_ref().map(|judged| {
        let blocks = judged_blocks(judged);
        let parts = blocks.iter().map(|block| match block {
            Block::Table { header, rows } => {
                let header: Vec<&str> = header.iter().map(|name| heading(name)).collect();
                json!({ "header": header, "rows": rows })
            }
            Block::Lines(lines) => json!({ "lines": lines }),
            Block::Answer(line) | Block::Heading(line) => json!({ "lines": [line] }),
        });
        parts.collect::<Vec<Value>>()
    }));
    let expected = report.criteria.iter().enumerate();
    let expected = expected.filter(|(_, result)| missed_as_expected(report, result));
    document["missedAsExpected"] = json!(expected.map(|(index, _)| index).collect::<Vec<_>>());
    document["iso9283"] = json!(charts::of_test(resolved, finished, &mut pack));
    document["words"] = super::words::words(resolved);
    for (source, words) in localisations(report) {
        document["words"][source] = json!(words);
    }
    let page = Viewer {
        kind: "run",
        name: &report.scenario.name,
        description: &report.scenario.description,
        script: SCRIPT,
        style: "",
    };
    page.html(pack, &document)
}

/// Names of sources of error budgets that have a basis, with it in words.
fn localisations(report: &Report) -> impl Iterator<Item = (&'static str, &'static str)> {
    let configurations = report.goals.iter().flat_map(|goal| &goal.configurations);
    let budgets = configurations.filter_map(|each| each.budget.as_ref());
    let sources = budgets.flat_map(|budget| &budget.sources);
    sources.filter_map(|each| {
        each.basis?;
        Some((each.source?.name(), each.in_words()))
    })
}

/// Columns of metrics that any configuration has, as the page shows them.
fn columns(
    goal: &GoalReport,
    engines: &[EngineHeading],
    heading: impl Fn(&Heading) -> Option<(u8, &'static str)>,
) -> Vec<Value> {
    let is_measured = |shown: &Shown| {
        let mut all = goal.configurations.iter();
        all.any(|each| shown.value(each).is_some())
    };
    shown_metrics(engines, heading)
        .filter(|(_, shown)| is_measured(shown))
        .map(|(title, shown)| {
            let (format, unit) = match shown.metric().show {
                Show::Millimetres => ("millimetres", "mm"),
                Show::SmallLength => ("length", ""),
                Show::Seconds => ("number", "s"),
                Show::Percent => ("percent", "%"),
                Show::Degrees => ("degrees", "\u{b0}"),
                Show::Number => ("number", ""),
            };
            json!({
                "title": title,
                "format": format,
                "unit": unit,
                "keys": shown.keys(),
                "help": shown.description(),
            })
        })
        .collect()
}

/// What the report does not have of a goal.
fn goal(
    resolved: &ResolvedScenario,
    finished: &ScenarioRun,
    room: &RoomModel<'_>,
    goal: usize,
    pack: &mut Pack,
) -> Value {
    let engines = engine_headings(&finished.report, ENGINES);
    let report = &finished.report.goals[goal];
    let configurations: Vec<Value> = report
        .configurations
        .iter()
        .enumerate()
        .map(|(index, configuration)| {
            let mut runs: Vec<Value> = finished.runs[goal][index]
                .iter()
                .enumerate()
                .map(|(at, run)| motion(run, at == 0, false, pack))
                .collect();
            let stopped = finished
                .stopped
                .iter()
                .filter(|each| each.goal == goal && each.configuration == index);
            runs.extend(stopped.map(|each| motion(&each.run, false, true, pack)));
            let flange = configuration.joints_rad.map(|joints_rad| {
                let q = Joints::from_column_slice(&joints_rad);
                pose(&resolved.cell.robot.world_from_flange(&q))
            });
            json!({
                "runs": runs,
                "flange": flange,
                "charts": charts::of_configuration(finished, goal, index),
                "room": room::configuration(resolved, room, goal, configuration, pack),
            })
        })
        .collect();
    json!({
        "columns": {
            "table": columns(report, &engines, |heading| heading.page),
            "side": columns(report, &engines, |heading| heading.page_side),
        },
        "trueTarget": true_target_in_words(report),
        "guideExit": pose(&resolved.goals[goal].world_from_guide_exit),
        "charts": charts::of_goal(finished, goal),
        "room": room::people(resolved, room, goal),
        "configurations": configurations,
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use needlebench_scenario::{Overrides, ResolvedScenario, load_scenario, resolve_scenario};

    use super::*;
    use crate::page::pack::unpack::of_page;
    use needlebench_bench::{RunOptions, run_scenario};

    /// Markers of which one is hardly seen along the slices, beside a target that is assumed to be seen.
    const MEASURED: &str = "[imperfections]\nbudget_samples = 0\n[imperfections.imaging]\n\
        [imperfections.registration]\nmarkers_mm = [[-90, -80, 60], [90, -80, 60], [0, -110, -70]]\n\
        covariance_mm2 = [[0.01, 0.01, 0.5, 0, 0, 0], [0.01, 0.02, 0.1, 0, 0, 0], [0.03, 0.01, 0.1, 0, 0, 0]]\n";

    #[test]
    fn the_true_lesion_and_what_was_measured_are_said() {
        const SMALL: &str = include_str!("../../../needlebench/tests/cli/small.toml");
        let resolve = |text: &str| -> ResolvedScenario {
            let (folder, overrides) = (Path::new("."), Overrides::default());
            resolve_scenario("s.toml", text, folder, &overrides).unwrap()
        };
        let planned = resolve(SMALL);
        let to_phantom = planned.phantom.unwrap().world_from_phantom.inverse();
        let [x, y, z]: [f64; 3] = ((to_phantom * planned.goals[0].target_m).coords * 1e3).into();
        let length = "insertion_length_mm = 86";
        let lesion = format!("{length}\ntrue_target_mm = [{x}, {y}, {}]", z + 4.0);
        let options = RunOptions {
            engines: Some(vec!["rapier".into()]),
            ..RunOptions::default()
        };
        let page_of = |text: &str| {
            let resolved = resolve(text);
            let finished = run_scenario(&resolved, &options).unwrap();
            of_page(&run_page(&resolved, &finished, &finished.report)).document
        };
        let page = page_of(&format!("{}\n{MEASURED}", SMALL.replace(length, &lesion)));
        let said = page["goals"][0]["trueTarget"].as_str().unwrap();
        assert!(
            said.starts_with("true lesion: tip error 4.00 mm, "),
            "{said}"
        );
        assert_eq!(
            page["words"]["registration"],
            "marker localisation, measured"
        );
        assert_eq!(page["words"]["imaging"], "target localisation, assumed");
        let columns = page["goals"][0]["columns"]["table"].to_string();
        assert!(columns.contains("Distance to true lesion"), "{columns}");
        let page = page_of(SMALL);
        assert!(page["goals"][0]["trueTarget"].is_null());
        assert!(page["words"].get("registration").is_none());
    }

    #[test]
    fn recorded_motions_and_clearances_come_back() {
        let path =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("../needlebench/tests/cli/small.toml");
        let resolved = load_scenario(&path, &Overrides::default()).unwrap();
        let options = RunOptions {
            engines: Some(vec!["rapier".into()]),
            ..RunOptions::default()
        };
        let finished = run_scenario(&resolved, &options).unwrap();
        let back = of_page(&run_page(&resolved, &finished, &finished.report));
        assert!(back.document["report"].get("timings").is_none());
        let mut seen = 0;
        for (index, runs) in finished.runs[0].iter().enumerate() {
            let configuration = &back.document["goals"][0]["configurations"][index];
            for (at, run) in runs.iter().enumerate() {
                let page = &configuration["runs"][at];
                assert_eq!(page["engine"], "rapier");
                let times = back.column(&page["time"]);
                assert_eq!(
                    times.last().map(|t| (t * 1e4).round()),
                    run.recording.time_s.last().map(|t| (t * 1e4).round())
                );
                for joint in 0..6 {
                    let reference = &page["joints"][joint];
                    let half_step = 0.5001 * reference["step"].as_f64().unwrap();
                    for (time_s, q) in times.iter().zip(back.column(reference)) {
                        let state = run.recording.time_s.partition_point(|t| *t < time_s - 1e-4);
                        let expected = run.recording.state[state].position[joint];
                        assert!((q - expected).abs() <= half_step, "{q} for {expected}");
                    }
                }
                for (class, distances_m) in &run.clearance.distance_m {
                    let reference = &page["curves"][class.name()];
                    let least = |values: &[f64]| values.iter().copied().fold(f64::MAX, f64::min);
                    // Least values are the ends of ranges, which are kept; JSON rounds the last bit.
                    let away_m = least(&back.column(reference)) - least(distances_m);
                    assert!(away_m.abs() < 1e-15, "{away_m}");
                }
                seen += 1;
            }
        }
        assert!(seen >= 4, "{seen} motions");
    }
}
