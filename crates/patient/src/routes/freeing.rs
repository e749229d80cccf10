//! Changes that make an infeasible needle path feasible.

use std::fmt::Write as _;
use std::path::Path;

use needlebench_clearance::ClearanceModel;
use needlebench_kinematics::ik::Configuration;
use needlebench_parallel::{Control, in_parallel};
use needlebench_planning::Planner;
use needlebench_scenario::scenario::GoalSection;
use needlebench_scenario::{Change, KeyPath, Overrides, ResolvedScenario, ScenarioFamily, Setting};

use super::RouteTask;
use super::joint::ROLLS;
use super::report::{Freed, Freeing, RoutePlan};
use crate::proposal::SuggestError;

/// Step of a base or a table that is moved, mm.
const STEP_MM: f64 = 25.0;
/// Steps in each direction: 300 mm.
const STEPS: u32 = 12;

struct Try {
    kind: &'static str,
    /// How much is changed, m, or the number of a tool.
    size: f64,
    moved_mm: Option<[f64; 3]>,
    toml: String,
    changes: Vec<(KeyPath, Change)>,
}

/// Searches the smallest changes that make the best path of a plan feasible, if it is not; `folder` is that of the
/// scenario's file.
///
/// # Errors
/// Interrupted.
pub fn free(
    task: &RouteTask<'_>,
    plan: &mut RoutePlan,
    folder: &Path,
    overrides: &Overrides,
    control: &Control<'_>,
) -> Result<(), SuggestError> {
    let wanted = plan.wanted;
    let Some(why_not) = &mut plan.why_not else {
        return Ok(());
    };
    let section = task.section_at(plan.routes[why_not.route].direction_deg);
    let Some(family) = family(task.resolved, section, folder, overrides) else {
        return Ok(());
    };
    let tries = tries(task.resolved);
    control.progress.message("changes that make it feasible");
    control.progress.expect(tries.len() as u64);
    let found = in_parallel(control.threads, &tries, |each| {
        let working = (!control.is_cancelled()).then(|| working(&family, each));
        control.progress.step();
        working
    });
    let mut freed: Vec<(f64, Freed)> = Vec::new();
    for (each, working) in tries.into_iter().zip(found) {
        let working = working.ok_or(SuggestError::Interrupted)?;
        if working < wanted {
            continue;
        }
        let candidate = Freed {
            kind: each.kind,
            toml: each.toml,
            moved_m: each.moved_mm.map(|mm| mm.map(|mm| mm * 1e-3)),
            working,
        };
        match freed.iter_mut().find(|(_, other)| other.kind == each.kind) {
            Some((size, best)) => {
                let is_smaller = each.size < *size;
                if is_smaller || (each.size <= *size && working > best.working) {
                    (*size, *best) = (each.size, candidate);
                }
            }
            None => freed.push((each.size, candidate)),
        }
    }
    why_not.freeing = Some(Freeing {
        tried: format!(
            "base along each axis and table height, by up to {:.0} mm in steps of {STEP_MM} mm, \
             and each bundled tool",
            STEP_MM * f64::from(STEPS)
        ),
        freed: freed.into_iter().map(|(_, freed)| freed).collect(),
    });
    Ok(())
}

/// The scenario with the route as its only goal, ready to be changed; none if it cannot be.
fn family(
    resolved: &ResolvedScenario,
    section: GoalSection,
    folder: &Path,
    overrides: &Overrides,
) -> Option<ScenarioFamily> {
    let goal = needlebench_scenario::GoalPlacer::new(resolved)
        .place(&section)
        .ok()?;
    let mut with_goal = resolved.clone();
    with_goal.goals = vec![goal];
    with_goal.scenario.goals = vec![section];
    ScenarioFamily::of(with_goal, folder, overrides).ok()
}

fn set(key: &str, value: Setting) -> Vec<(KeyPath, Change)> {
    let path = KeyPath::parse(key).expect("it is the path of a key");
    vec![(path, Change::Set(value))]
}

fn tries(resolved: &ResolvedScenario) -> Vec<Try> {
    let base_mm = resolved.cell.robot.world_from_base_link.translation.vector * 1e3;
    let mut tries = Vec::new();
    for step in 1..=STEPS {
        let way_mm = STEP_MM * f64::from(step);
        for axis in 0..3 {
            for sign in [1.0, -1.0] {
                let mut moved_mm = [0.0; 3];
                moved_mm[axis] = sign * way_mm;
                let at: [f64; 3] =
                    std::array::from_fn(|k| ((base_mm[k] + moved_mm[k]) * 1e3).round() / 1e3 + 0.0);
                tries.push(Try {
                    kind: "base",
                    size: way_mm,
                    moved_mm: Some(moved_mm),
                    toml: format!("[robot]\nbase_position_mm = {at:?}"),
                    changes: set("robot.base_position_mm", Setting::from(at)),
                });
            }
        }
        for sign in [1.0, -1.0] {
            tries.extend(moved_table(resolved, sign * way_mm));
        }
    }
    for tool in needlebench_scenario::scenario::shipped_tools() {
        if tool != resolved.scenario.tool.urdf {
            tries.push(Try {
                kind: "tool",
                size: 0.0,
                moved_mm: None,
                toml: format!("[tool]\nurdf = \"{tool}\""),
                changes: set("tool.urdf", Setting::from(tool.as_str())),
            });
        }
    }
    tries
}

/// Table and patient so much higher, mm.
fn moved_table(resolved: &ResolvedScenario, by_mm: f64) -> Option<Try> {
    let table = resolved.scenario.table.as_ref()?;
    let phantom = resolved.scenario.phantom.as_ref()?;
    let height_mm = table.top_height_mm + by_mm;
    let mut toml = format!("[table]\ntop_height_mm = {height_mm:?}");
    let mut changes = set("table.top_height_mm", Setting::from(height_mm));
    if !phantom.rest_on_table {
        let [x, y, z] = phantom.position_mm;
        let at = [x, y, z + by_mm];
        let _ = write!(toml, "\n[phantom]\nposition_mm = {at:?}");
        changes.extend(set("phantom.position_mm", Setting::from(at)));
    }
    Some(Try {
        kind: "table",
        size: by_mm.abs(),
        moved_mm: Some([0.0, 0.0, by_mm]),
        toml,
        changes,
    })
}

/// Configurations whose postures work after a change; 0 where there can be no such cell.
fn working(family: &ScenarioFamily, each: &Try) -> usize {
    let name = family.goals().next().unwrap_or_default().to_owned();
    let Ok(resolved) = family.vary(&name, &each.changes) else {
        return 0;
    };
    let model = ClearanceModel::new(&resolved.cell);
    let Ok(planner) = Planner::new(&resolved, &model) else {
        return 0;
    };
    let Some(goal) = resolved.goals.first() else {
        return 0;
    };
    let rolls = planner.rolls(goal, ROLLS);
    let works = Configuration::ALL.into_iter().filter(|configuration| {
        let member = planner.best_of_rolls(goal, *configuration, &rolls);
        member.works() && super::joint::meets_criteria(&resolved, &member)
    });
    works.count()
}
