//! Charts of a run as vector graphics in its page's document, and what a test by ISO 9283 adds to the scene.

use needlebench_bench::{EventRun, ScenarioRun};
use needlebench_scenario::ResolvedScenario;
use serde_json::{Value, json};

use super::pack::Pack;
use super::scene::pose;
use crate::chart::budget::budget_figure;
use crate::chart::iso9283::{attained_chart, stabilisation_chart};
use crate::chart::press::press_chart;
use crate::chart::ranking::ranking_chart;

/// The charts of a goal as a whole.
pub(super) fn of_goal(finished: &ScenarioRun, goal: usize) -> Value {
    let report = &finished.report.goals[goal];
    json!({
        "ranking": ranking_chart(report).map(|chart| chart.to_svg()),
    })
}

/// The charts of a configuration.
pub(super) fn of_configuration(finished: &ScenarioRun, goal: usize, configuration: usize) -> Value {
    let report = &finished.report.goals[goal];
    let label = report.configurations[configuration].label;
    let mut runs = finished.events.iter();
    let run = runs.find(|run| run.goal == goal && run.configuration == configuration);
    let title = format!("{}, {label}", report.name);
    json!({
        "budget": budget_figure(report, label).map(|chart| chart.to_svg()),
        "press": run.map(|run| presses(&title, run)),
    })
}

/// The charts of the contacts that were staged, in the order of the scenario.
fn presses(title: &str, run: &EventRun) -> Vec<Option<String>> {
    let charts = run.press.iter().enumerate().map(|(index, press)| {
        let press = press.as_ref().ok()?;
        Some(press_chart(title, press, run, index).to_svg())
    });
    charts.collect()
}

/// Charts of a test by ISO 9283, its poses in the world, and where the arm came to rest about each.
pub(super) fn of_test(
    resolved: &ResolvedScenario,
    finished: &ScenarioRun,
    pack: &mut Pack,
) -> Option<Value> {
    let (run, report) = (
        finished.iso9283.as_ref()?,
        finished.report.iso9283.as_ref()?,
    );
    let world_from_base = resolved.cell.robot.world_from_base();
    let world = |point: nalgebra::Point3<f64>| {
        let at = world_from_base * point;
        [at.x, at.y, at.z]
    };
    let engines: Vec<Value> = run
        .engines
        .iter()
        .filter_map(|(engine, attained, arrivals)| {
            let statistics = &report.engines.get(*engine)?.statistics;
            let heading = format!("{}, {engine}", resolved.scenario.name);
            // Less than 1e-7 of the cell: rounding to single precision would hide it.
            let offsets = run.commanded.iter().map(|commanded| {
                let plain = attained
                    .iter()
                    .filter(|each| each.pose == commanded.pose && each.axis.is_none());
                let from = world(commanded.position_m);
                plain
                    .flat_map(|each| {
                        let at = world(each.position_m);
                        [at[0] - from[0], at[1] - from[1], at[2] - from[2]]
                    })
                    .collect::<Vec<f64>>()
            });
            let offsets: Vec<Value> = offsets.map(|each| pack.f32s(each)).collect();
            Some(json!({
                "engine": engine,
                "attained": attained_chart(&heading, statistics, attained).to_svg(),
                "stabilisation": stabilisation_chart(&heading, arrivals, run.limit_band_m).to_svg(),
                "offsets": offsets,
            }))
        })
        .collect();
    let commanded: Vec<[f64; 3]> = run
        .commanded
        .iter()
        .map(|each| world(each.position_m))
        .collect();
    Some(json!({
        "commanded": commanded,
        "base": pose(&world_from_base),
        "engines": engines,
    }))
}
