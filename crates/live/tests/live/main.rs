//! What a page computes, against what the program computes of the same scenario written out.

use std::path::{Path, PathBuf};

use needlebench_cell::ClearanceClass;
use needlebench_clearance::ClearanceModel;
use needlebench_kinematics::Joints;
use needlebench_live::{Limits, Live, Scene};
use needlebench_numerics::random::SplitMix64;
use needlebench_scenario::{Overrides, ResolvedScenario, pose_of, resolve_scenario};

/// Rounding of some metres, through the angles of a turned base: its solids are moved, and in the program made at
/// their place. Seen: 2.5e-11.
const ROUNDING_M: f64 = 1e-10;

fn scenarios() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios")
}

/// A shipped scenario with a line of it replaced.
fn scenario(name: &str, line: Option<(&str, &str)>) -> ResolvedScenario {
    let folder = scenarios();
    let mut text = std::fs::read_to_string(folder.join(name)).unwrap();
    if let Some((old, new)) = line {
        assert_eq!(text.matches(old).count(), 1, "{old} in {name}");
        text = text.replace(old, new);
    }
    resolve_scenario(name, &text, &folder, &Overrides::default()).unwrap()
}

fn scene(resolved: &ResolvedScenario) -> Scene {
    let limits_m = ClearanceClass::ALL.map(|class| 0.01 * f64::from(class as u8));
    let planning = &resolved.scenario.planning;
    Scene::of(resolved, Limits::new(planning, limits_m, limits_m))
}

/// As in a page: from bytes.
fn live(resolved: &ResolvedScenario) -> Live {
    Live::new(Scene::decode(&scene(resolved).encode()).unwrap())
}

fn postures(resolved: &ResolvedScenario, count: usize) -> Vec<Joints> {
    let mut random = SplitMix64::new(7);
    (0..count)
        .map(|_| resolved.start + Joints::from_fn(|_, _| random.uniform(-1.5, 1.5)))
        .collect()
}

#[test]
fn a_scene_comes_back_from_its_bytes_without_its_names() {
    for name in ["table3.toml", "hanging.toml"] {
        let whole = scene(&scenario(name, None));
        let mut nameless = whole.clone();
        for it in &mut nameless.bodies {
            it.body.name.clear();
            for solid in &mut it.body.solids {
                solid.name.clear();
            }
        }
        let bytes = whole.encode();
        assert_eq!(Scene::decode(&bytes).as_ref(), Some(&nameless));
        assert_eq!(Scene::decode(&bytes[..bytes.len() - 1]), None);
        assert_eq!(Scene::decode(&[&bytes[..], &[0]].concat()), None);
    }
}

#[test]
fn clearances_are_the_programs_bit_for_bit() {
    for name in ["table3.toml", "hanging.toml"] {
        let resolved = scenario(name, None);
        let (live, model) = (live(&resolved), ClearanceModel::new(&resolved.cell));
        for q in postures(&resolved, 50) {
            assert_eq!(live.pairs(&q), model.all_pairs(&q), "{name}");
        }
    }
}

/// A scenario, its lines of the base, another place and turn. Goals are points of the patient: a flange pose would
/// move with the base.
const MOVES: [(&str, &str, [f64; 3], [f64; 3]); 4] = [
    (
        "supine_suite.toml",
        "base_position_mm = [-280, 350, 1050]\nbase_rpy_deg = [0, 0, 270]",
        [-320.0, 385.0, 1120.0],
        [0.0, 0.0, 240.0],
    ),
    (
        "hanging.toml",
        "base_position_mm = [-60, 330, 1560]\nbase_rpy_deg = [180, 0, 90]",
        [-110.0, 290.0, 1610.0],
        [180.0, 0.0, 65.0],
    ),
    (
        "hanging.toml",
        "base_position_mm = [-60, 330, 1560]\nbase_rpy_deg = [180, 0, 90]",
        [-20.0, 360.0, 1500.0],
        [175.0, 0.0, 90.0],
    ),
    (
        "hanging.toml",
        "base_position_mm = [-60, 330, 1560]\nbase_rpy_deg = [180, 0, 90]",
        [-60.0, 330.0, 1560.0],
        [180.0, 0.0, 90.0],
    ),
];

fn moved(to: &(&str, &str, [f64; 3], [f64; 3])) -> (Live, ResolvedScenario) {
    let (name, base, position_mm, rpy_deg) = to;
    let mut live = live(&scenario(name, None));
    live.place_base(&pose_of(*position_mm, *rpy_deg)).unwrap();
    let there = format!("base_position_mm = {position_mm:?}\nbase_rpy_deg = {rpy_deg:?}");
    (live, scenario(name, Some((base, &there))))
}

#[test]
fn a_base_that_was_moved_is_a_scenario_with_that_base() {
    for each in &MOVES {
        let (live, there) = moved(each);
        let model = ClearanceModel::new(&there.cell);
        for q in postures(&there, 30) {
            for (ours, theirs) in live.pairs(&q).iter().zip(model.all_pairs(&q)) {
                let off_m = ours.separation.distance_m - theirs.separation.distance_m;
                assert_eq!(ours.pair, theirs.pair);
                assert!(off_m.abs() < ROUNDING_M, "{each:?}: {off_m}");
            }
        }
        assert!(live.overlaps().is_empty());
    }
}

#[test]
fn a_base_in_something_and_a_mount_that_does_not_reach_are_told() {
    let resolved = scenario("table3.toml", None);
    let mut live = live(&resolved);
    // In the middle of the table, its column through it.
    live.place_base(&pose_of([300.0, -598.0, 800.0], [0.0, 0.0, 0.0]))
        .unwrap();
    let name = |body: usize| &*resolved.cell.bodies[body].name;
    let found: Vec<(&str, &str)> = live
        .overlaps()
        .iter()
        .map(|it| (name(it.body), name(it.other)))
        .collect();
    assert!(found.contains(&("mount", "table")), "{found:?}");
    assert!(found.contains(&("base", "phantom")), "{found:?}");
    let before = live.pairs(&resolved.start);
    let tilted = live.place_base(&pose_of([0.0, 0.0, 800.0], [30.0, 0.0, 0.0]));
    assert!(
        tilted
            .unwrap_err()
            .to_string()
            .contains("tilted by 30.000 deg")
    );
    assert_eq!(live.pairs(&resolved.start), before);
    live.reset_base();
    assert!(live.overlaps().is_empty());
    let model = ClearanceModel::new(&resolved.cell);
    assert_eq!(
        live.pairs(&resolved.start),
        model.all_pairs(&resolved.start)
    );
}

#[test]
fn an_arm_under_the_floor_is_seen() {
    let resolved = scenario("table3.toml", None);
    let mut live = live(&resolved);
    let hanging_down = Joints::new(0.0, 1.5, 0.0, 0.0, 0.0, 0.0);
    assert!(live.lowest_m(&hanging_down) > 0.0);
    live.place_base(&pose_of([0.0, 0.0, 100.0], [0.0, 0.0, 180.0]))
        .unwrap();
    let lowest_m = live.lowest_m(&hanging_down);
    // Shoulder 152 mm over the base, links of 244 and 213 mm, and the wrists with the tool beyond.
    assert!((-0.5..-0.2).contains(&lowest_m), "{lowest_m}");
}
