//! The page of a run.

use needlebench_cell::ResolvedScenario;
use needlebench_evaluation::room::RoomModel;
use needlebench_kinematics::Joints;
use serde_json::{Value, json};

use super::document::Page;
use super::motion::motion;
use super::pack::Pack;
use super::room;
use super::scene::{chain, pose, surroundings};
use crate::pipeline::ScenarioRun;

const SCRIPT: &str = include_str!("assets/run.js");

/// The page of a finished run: everything of its report but the timings, the cell, and all recorded
/// motions.
pub(crate) fn run_page(resolved: &ResolvedScenario, finished: &ScenarioRun) -> String {
    let mut pack = Pack::default();
    let report = &finished.report;
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
    let room = RoomModel::new(resolved);
    let goals: Vec<Value> = (0..resolved.goals.len())
        .map(|goal| self::goal(resolved, finished, &room, goal, &mut pack))
        .collect();
    document["goals"] = json!(goals);
    let page = Page {
        kind: "run",
        name: &report.scenario.name,
        description: &report.scenario.description,
        script: SCRIPT,
    };
    page.html(pack, &document)
}

/// What the report does not have of a goal.
fn goal(
    resolved: &ResolvedScenario,
    finished: &ScenarioRun,
    room: &RoomModel<'_>,
    goal: usize,
    pack: &mut Pack,
) -> Value {
    let report = &finished.report.goals[goal];
    let configurations: Vec<Value> = report
        .configurations
        .iter()
        .enumerate()
        .map(|(index, configuration)| {
            let mut runs: Vec<Value> = finished.runs[goal][index]
                .iter()
                .map(|run| motion(run, false, pack))
                .collect();
            let stopped = finished
                .stopped
                .iter()
                .filter(|each| each.goal == goal && each.configuration == index);
            runs.extend(stopped.map(|each| motion(&each.run, true, pack)));
            let flange = configuration.joints_rad.map(|joints_rad| {
                let q = Joints::from_column_slice(&joints_rad);
                pose(&resolved.cell.robot.world_from_flange(&q))
            });
            json!({
                "runs": runs,
                "flange": flange,
                "room": room::configuration(resolved, room, goal, configuration, pack),
            })
        })
        .collect();
    json!({
        "guideExit": pose(&resolved.goals[goal].world_from_guide_exit),
        "room": room::people(resolved, room, goal),
        "configurations": configurations,
    })
}
