//! Data of a run's page for exploratory postures: the scene, the code that computes with it, and names.

use needlebench_cell::{ClearanceClass, Frame};
use needlebench_kinematics::Pose;
use needlebench_kinematics::ik::Configuration;
use needlebench_live::{Limits, Scene};
use needlebench_planning::ClassLimits;
use needlebench_scenario::{Goal, ResolvedScenario, Roll};
use serde_json::{Value, json};

use super::pack::Pack;

/// `crates/live` for browsers, made by its `build.mjs`.
const CODE: &[u8] = include_bytes!("assets/live.wasm");

/// Decimals of millimetres and degrees that a pose is shown with: more than a scenario gives.
const DECIMALS: i32 = 6;

/// The document's part on exploratory postures.
pub(super) fn explore(resolved: &ResolvedScenario, pack: &mut Pack) -> Value {
    let cell = &resolved.cell;
    let scene = scene(resolved);
    let judged_m = scene.limits.judged_m;
    // JSON has no infinity: a class without a limit has none.
    let classes: Vec<Value> = ClearanceClass::ALL
        .iter()
        .map(|class| {
            let judged_m = judged_m[*class as usize];
            json!({
                "name": class.name(),
                "judged": judged_m.is_finite().then_some(judged_m),
                "unwanted": class.is_unwanted(),
            })
        })
        .collect();
    let bodies: Vec<Value> = cell
        .bodies
        .iter()
        .map(|body| {
            let solids: Vec<&str> = body.solids.iter().map(|solid| &*solid.name).collect();
            let link = match body.frame {
                Frame::World => None,
                Frame::Link(link) => Some(link),
            };
            json!({"name": body.name, "kind": body.kind, "link": link, "solids": solids})
        })
        .collect();
    let pairs: Vec<[usize; 3]> = cell
        .pairs
        .iter()
        .map(|pair| [pair.a, pair.b, pair.class as usize])
        .collect();
    let joints: Vec<[f64; 2]> = cell
        .robot
        .limits
        .0
        .iter()
        .map(|limit| [limit.lower_rad, limit.upper_rad].map(|rad| rad.clamp(-TWO_TURNS, TWO_TURNS)))
        .collect();
    json!({
        "code": pack.u8s(CODE),
        "scene": pack.u8s(&scene.encode()),
        "classes": classes,
        "bodies": bodies,
        "pairs": pairs,
        "joints": joints,
        "base": base(resolved),
        "configurations": Configuration::ALL.map(Configuration::label),
        "goals": resolved.goals.iter().map(|each| goal(resolved, each)).collect::<Vec<_>>(),
    })
}

/// The scene, with the limits of the scenario.
fn scene(resolved: &ResolvedScenario) -> Scene {
    let limits = ClassLimits::of(&resolved.scenario);
    let floor_m = ClearanceClass::ALL.map(|class| limits.get(class).floor_m);
    let judged_m = ClearanceClass::ALL.map(|class| limits.get(class).judged_m);
    let planning = &resolved.scenario.planning;
    Scene::of(resolved, Limits::new(planning, floor_m, judged_m))
}

/// Ends of a slider where a joint turns without limits, rad.
const TWO_TURNS: f64 = 2.0 * std::f64::consts::TAU;

/// Where the base is, as a scenario gives it.
fn base(resolved: &ResolvedScenario) -> Value {
    let section = &resolved.scenario.robot;
    let Pose {
        rotation,
        translation,
    } = resolved.cell.robot.world_from_base_link;
    let (roll, pitch, yaw) = rotation.euler_angles();
    let rounded = |value: f64| (value * 10_f64.powi(DECIMALS)).round() / 10_f64.powi(DECIMALS);
    let position_mm = translation.vector.map(|metres| rounded(metres * 1e3));
    let rpy_deg = [roll, pitch, yaw].map(|rad| rounded(rad.to_degrees()));
    json!({
        "position": section.base_position_mm.unwrap_or(position_mm.into()),
        "rpy": section.base_rpy_deg.unwrap_or(rpy_deg),
    })
}

/// Whether the plan chooses the roll of a goal, and whether the scenario gives it from the robot's base, so
/// that it goes where that goes.
fn goal(resolved: &ResolvedScenario, goal: &Goal) -> Value {
    let mut sections = resolved.scenario.goals.iter();
    let section = sections.find(|section| section.name == goal.name);
    json!({
        "free": goal.roll == Roll::Free,
        "fromBase": section.is_some_and(|section| section.flange_pose.is_some()),
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use needlebench_clearance::ClearanceModel;
    use needlebench_live::{Live, Outcome};
    use needlebench_planning::{Member, Planner};
    use needlebench_scenario::{Overrides, pose_of, resolve_scenario};

    use super::*;

    const ROLLS: u32 = 12;
    const BASE: &str = "base_position_mm = [-60, 330, 1560]\nbase_rpy_deg = [180, 0, 90]";

    fn hanging(base: &str) -> ResolvedScenario {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
        let text = std::fs::read_to_string(folder.join("hanging.toml")).unwrap();
        assert_eq!(text.matches(BASE).count(), 1);
        let text = text.replace(BASE, base);
        resolve_scenario("hanging.toml", &text, &folder, &Overrides::default()).unwrap()
    }

    #[test]
    fn configurations_work_where_the_planner_of_a_scenario_with_that_base_says_so() {
        let mut seen = [0; 2];
        for (position_mm, rpy_deg) in [
            ([-60.0, 330.0, 1560.0], [180.0, 0.0, 90.0]),
            ([-110.0, 290.0, 1610.0], [180.0, 0.0, 65.0]),
            ([-20.0, 360.0, 1500.0], [175.0, 0.0, 90.0]),
        ] {
            let mut live = Live::new(Scene::decode(&scene(&hanging(BASE)).encode()).unwrap());
            live.place_base(&pose_of(position_mm, rpy_deg)).unwrap();
            let base = format!("base_position_mm = {position_mm:?}\nbase_rpy_deg = {rpy_deg:?}");
            let scenario = hanging(&base);
            let model = ClearanceModel::new(&scenario.cell);
            let planner = Planner::new(&scenario, &model).unwrap();
            let goal = &scenario.goals[0];
            let rolls = planner.rolls(goal, ROLLS);
            for (reach, configuration) in live.reach(0, ROLLS).iter().zip(Configuration::ALL) {
                // Where one of the grid works, and nowhere where none does: it may be found beside them.
                let members = planner.members_along(goal, configuration, &rolls);
                let on_grid = members.iter().any(Member::works);
                let works = reach.outcome >= Outcome::Misses;
                assert!(
                    works || !on_grid,
                    "{position_mm:?} {configuration:?} {reach:?}"
                );
                let there = planner.member_at(goal, configuration, reach.roll_rad);
                assert_eq!(
                    there.works(),
                    works,
                    "{position_mm:?} {configuration:?} {reach:?}"
                );
                seen[usize::from(works)] += 1;
                let Some(joints) = reach.joints else { continue };
                let exit = scenario.cell.world_from_guide_exit(&joints);
                let wanted = goal.world_from_guide_exit_at(reach.roll_rad);
                assert!((exit.translation.vector - wanted.translation.vector).norm() < 1e-9);
            }
        }
        assert!(seen.iter().all(|count| *count > 2), "{seen:?}");
    }
}
