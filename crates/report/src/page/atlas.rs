//! The page of a roll map.

use std::collections::BTreeMap;

use needlebench_bench::atlas::{AtlasReport, BranchReport, GoalAtlas, GoalAtlasReport};
use needlebench_planning::Member;
use needlebench_scenario::{Goal, ResolvedScenario};
use serde_json::{Value, json};

use super::pack::Pack;
use super::scene::{pose, surroundings};
use super::viewer::Viewer;
use crate::chart::atlas::rule_colors;

const SCRIPT: &str = include_str!("assets/atlas.js");
/// Code of a roll at which nothing rejects the posture.
const WORKS: u8 = u8::MAX;

/// The page of a finished roll map: ranges, reasons, clearances and postures over the roll.
pub(crate) fn atlas_page(
    resolved: &ResolvedScenario,
    atlases: &[(&Goal, GoalAtlas)],
    report: &AtlasReport,
) -> String {
    let mut pack = Pack::default();
    let goals: Vec<Value> = atlases
        .iter()
        .zip(&report.goals)
        .map(|((goal, atlas), report)| self::goal(goal, atlas, report, &mut pack))
        .collect();
    let document = json!({
        "kind": "atlas",
        "scenario": report.scenario,
        "provenance": report.provenance,
        "goals": goals,
        "ruleColors": rule_colors().map(|(name, [red, green, blue])| (name.to_owned(), json!(format!("#{red:02x}{green:02x}{blue:02x}")))).collect::<serde_json::Map<_, _>>(),
        "words": super::words::words(resolved),
        "scene": surroundings(resolved, &mut pack),
    });
    let page = Viewer {
        kind: "roll map",
        name: &report.scenario,
        description: &resolved.scenario.description,
        script: SCRIPT,
        style: "",
    };
    page.html(pack, &document)
}

fn goal(goal: &Goal, atlas: &GoalAtlas, report: &GoalAtlasReport, pack: &mut Pack) -> Value {
    let branches: Vec<Value> = report
        .branches
        .iter()
        .zip(&atlas.members)
        .map(|(branch, members)| self::branch(branch, members, pack))
        .collect();
    let (target, axis) = (goal.target_m, goal.axis.into_inner());
    let entry = goal.entry_m.map(|entry| [entry.x, entry.y, entry.z]);
    json!({
        "name": report.name,
        "fixedRoll": report.fixed_roll_rad,
        "aim": report.aim,
        "target": [target.x, target.y, target.z],
        "axis": [axis.x, axis.y, axis.z],
        "entry": entry,
        "guideExit": pose(&goal.world_from_guide_exit),
        "rolls": report.rolls_rad.len(),
        "branches": branches,
    })
}

fn branch(report: &BranchReport, members: &[Member], pack: &mut Pack) -> Value {
    let mut names: Vec<&'static str> = Vec::new();
    let rules: Vec<u8> = report
        .rule
        .iter()
        .map(|rule| {
            let Some(rule) = rule else { return WORKS };
            let at = names
                .iter()
                .position(|name| name == rule)
                .unwrap_or_else(|| {
                    names.push(rule);
                    names.len() - 1
                });
            u8::try_from(at).expect("there are a dozen rules")
        })
        .collect();
    let mut curves: BTreeMap<&'static str, Vec<f64>> = BTreeMap::new();
    for (at, member) in members.iter().enumerate() {
        let minima = member
            .candidate
            .iter()
            .flat_map(|each| each.clearance.iter());
        for pair in minima {
            let column = curves
                .entry(pair.class.name())
                .or_insert_with(|| vec![f64::NAN; members.len()]);
            column[at] = pair.separation.distance_m;
        }
    }
    let mut packed = serde_json::Map::new();
    for (class, column) in curves {
        packed.insert(class.to_owned(), pack.column(&column, true));
    }
    let joints: Vec<Value> = (0..6)
        .map(|joint| {
            let column: Vec<f64> = report
                .joints_rad
                .iter()
                .map(|joints_rad| joints_rad.map_or(f64::NAN, |joints_rad| joints_rad[joint]))
                .collect();
            pack.column(&column, true)
        })
        .collect();
    let surplus: Vec<f64> = report.surplus_m.clone();
    json!({
        "label": report.label,
        "ranges": report.ranges,
        "ruleNames": names,
        "rules": pack.u8s(&rules),
        "curves": packed,
        "joints": joints,
        "surplus": pack.column(&surplus, true),
    })
}
