//! Goals by the direction that the needle comes from.

use std::path::Path;

use needlebench_cell::{Change, Goal, KeyPath, Overrides, ScenarioFamily, Setting};

const GOAL: &str = "right_pleural_lateral";

fn family() -> ScenarioFamily {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/studies/chest.toml");
    ScenarioFamily::load(&path, &Overrides::default()).unwrap()
}

fn set(key: &str, setting: impl Into<Setting>) -> (KeyPath, Change) {
    (KeyPath::parse(key).unwrap(), Change::Set(setting.into()))
}

/// The goal, with entry and target in the phantom frame, mm.
fn goal(changes: &[(KeyPath, Change)]) -> (Goal, [nalgebra::Point3<f64>; 2]) {
    let resolved = family().vary(GOAL, changes).unwrap();
    let goal = resolved.goals[0].clone();
    let place = resolved.phantom.as_ref().unwrap().world_from_phantom;
    let ends = [goal.entry_m.unwrap(), goal.target_m].map(|point| place.inverse() * point * 1e3);
    (goal, ends)
}

#[test]
fn azimuth_turns_from_anterior_to_left_and_elevation_rises_to_superior() {
    // Phantom frame: left, posterior, superior.
    for (direction, expected) in [
        ([0.0, 0.0], [0.0, -1.0, 0.0]),
        ([90.0, 0.0], [1.0, 0.0, 0.0]),
        ([-90.0, 0.0], [-1.0, 0.0, 0.0]),
        ([0.0, 30.0], [0.0, -0.75_f64.sqrt(), 0.5]),
    ] {
        let (_, [entry, target]) = goal(&[
            set("goal.entry_direction_deg", direction),
            set("tool.needle_length_mm", 400.0),
        ]);
        let found = (entry - target).normalize();
        assert!(
            (found - nalgebra::Vector3::from(expected)).norm() < 1e-12,
            "{direction:?}: {found}"
        );
    }
}

/// The same needle by its entry point: the direction's own entry, to rounding.
#[test]
fn a_direction_is_the_same_needle_as_its_entry_point() {
    /// Micrometres: the entry point is written in mm.
    const TOLERANCE_M: f64 = 1e-12;
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/supine_suite.toml");
    let suite = ScenarioFamily::load(&path, &Overrides::default()).unwrap();
    let (by_direction, [entry_mm, _]) = goal(&[]);
    let by_point = suite
        .vary(
            GOAL,
            &[set("goal.entry_mm", [entry_mm.x, entry_mm.y, entry_mm.z])],
        )
        .unwrap()
        .goals[0]
        .clone();
    assert!((by_point.entry_m.unwrap() - by_direction.entry_m.unwrap()).norm() < TOLERANCE_M);
    assert!((by_point.axis.into_inner() - by_direction.axis.into_inner()).norm() < TOLERANCE_M);
    assert!((by_point.insertion_length_m - by_direction.insertion_length_m).abs() < TOLERANCE_M);
}

#[test]
fn every_size_has_an_entry_on_its_skin() {
    for model in [
        "female-p5",
        "female-p50",
        "female-p95",
        "male-p5",
        "male-p50",
        "male-p95",
    ] {
        let family = family();
        for name in family.goals() {
            let resolved = family.vary(name, &[set("phantom.model", model)]).unwrap();
            let placed = resolved.phantom.as_ref().unwrap();
            let entry = placed.world_from_phantom.inverse() * resolved.goals[0].entry_m.unwrap();
            assert!(
                placed.phantom.skin_signed_depth(&entry).abs() < 1e-9,
                "{model} {name}"
            );
        }
    }
}

#[test]
fn an_offset_moves_the_target_and_keeps_the_direction() {
    let (before, [_, target_before]) = goal(&[]);
    let (after, [_, target_after]) = goal(&[set("goal.target_offset_mm", [3.0, -2.0, 1.5])]);
    assert!((target_after - target_before - nalgebra::Vector3::new(3.0, -2.0, 1.5)).norm() < 1e-9);
    assert!((before.axis.into_inner() - after.axis.into_inner()).norm() < 1e-12);
}

#[test]
fn directions_and_offsets_that_make_no_needle_are_refused() {
    let family = family();
    for (change, key, word) in [
        (
            set("goal.entry_mm", [-142.8, 13.4, 15.8]),
            "goals[0].entry_direction_deg",
            "contradicts",
        ),
        (
            set("goal.entry_direction_deg", [0.0, 91.0]),
            "goals[0].entry_direction_deg",
            "91",
        ),
        (
            set("goal.target_offset_mm", [0.0, 0.0, 900.0]),
            "goals[0].target_offset_mm",
            "outside the phantom",
        ),
    ] {
        let found = family.vary(GOAL, &[change]).unwrap_err();
        assert_eq!(found[0].key.as_deref(), Some(key), "{found:?}");
        assert!(found[0].message.contains(word), "{found:?}");
    }
}
