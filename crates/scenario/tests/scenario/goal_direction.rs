//! Goals by a direction from the target, and targets off a lesion's centre.

use std::path::Path;

use nalgebra::{Point3, Vector3};
use needlebench_input::Finding;
use needlebench_scenario::{Overrides, ResolvedScenario, resolve_scenario};

/// Rounding of a metre.
const ROUNDING_M: f64 = 1e-12;

fn resolve(model: &str, goal: &str) -> Result<ResolvedScenario, Vec<Finding>> {
    let text = format!(
        "name = \"x\"\n[robot]\nbase_position_mm = [-900, 0, 800]\n[tool]\nneedle_length_mm = 400\n\
         [phantom]\nmodel = \"{model}\"\nrest_on_table = false\nposition_mm = [0, 0, 1000]\n\
         [[goals]]\nname = \"g\"\n{goal}\n"
    );
    resolve_scenario("x.toml", &text, Path::new(""), &Overrides::default())
}

/// Entry, target and axis in the phantom frame.
fn needle(resolved: &ResolvedScenario) -> (Point3<f64>, Point3<f64>, Vector3<f64>) {
    let to_phantom = resolved
        .phantom
        .as_ref()
        .unwrap()
        .world_from_phantom
        .inverse();
    let goal = &resolved.goals[0];
    (
        to_phantom * goal.entry_m.unwrap(),
        to_phantom * goal.target_m,
        to_phantom.rotation * goal.axis.into_inner(),
    )
}

#[test]
fn azimuth_turns_from_the_front_to_the_left_and_elevation_towards_the_head() {
    let (left, front, head) = (Vector3::x(), -Vector3::y(), Vector3::z());
    let half = 0.5_f64.sqrt();
    for (angles, outwards) in [
        ("[0, 0]", front),
        ("[90, 0]", left),
        ("[-90, 0]", -left),
        ("[45, 0]", (front + left) * half),
        ("[0, 30]", front * 0.75_f64.sqrt() + head * 0.5),
    ] {
        let goal = format!("lesion = \"pleural_based\"\nentry_direction_deg = {angles}");
        let resolved = resolve("male-p50", &goal).unwrap();
        let (entry, target, axis) = needle(&resolved);
        assert!((axis + outwards).norm() < ROUNDING_M, "{angles}");
        let way = entry - target;
        assert!((way - outwards * way.norm()).norm() < ROUNDING_M);
        let phantom = &resolved.phantom.as_ref().unwrap().phantom;
        assert!(phantom.skin_signed_depth(&entry).abs() < ROUNDING_M);
        assert!(resolved.notes.iter().all(|note| !note.contains("moved")));
    }
}

#[test]
fn one_direction_suits_all_sizes() {
    for model in needlebench_phantom::SIZE_PRESETS {
        let goal = "lesion = \"pleural_based\"\nentry_direction_deg = [-90, 0]";
        let resolved = resolve(model, goal).unwrap();
        let (entry, target, _) = needle(&resolved);
        assert!(entry.x < target.x, "from the right");
    }
}

#[test]
fn a_direction_is_the_goal_by_its_entry_point() {
    let by_direction = resolve(
        "male-p50",
        "lesion = \"pleural_based\"\nentry_direction_deg = [-80, 10]",
    )
    .unwrap();
    let entry_mm = needle(&by_direction).0.coords * 1e3;
    let by_point = resolve(
        "male-p50",
        &format!(
            "lesion = \"pleural_based\"\nentry_mm = [{}, {}, {}]",
            entry_mm.x, entry_mm.y, entry_mm.z
        ),
    )
    .unwrap();
    let [a, b] = [&by_direction, &by_point].map(|each| each.goals[0].world_from_guide_exit);
    assert!((a.to_homogeneous() - b.to_homogeneous()).norm() < ROUNDING_M);
}

#[test]
fn an_offset_moves_the_target() {
    let goal = "lesion = \"pleural_based\"\nentry_direction_deg = [-90, 0]";
    let centre = needle(&resolve("male-p50", goal).unwrap()).1;
    let off = resolve(
        "male-p50",
        &format!("{goal}\ntarget_offset_mm = [1, -2, 3]"),
    )
    .unwrap();
    let moved = needle(&off).1 - centre;
    assert!((moved - Vector3::new(1e-3, -2e-3, 3e-3)).norm() < ROUNDING_M);
    assert_eq!(off.goals[0].lesion.as_deref(), Some("pleural_based"));
}

#[test]
fn contradictions_and_wild_angles_are_refused_with_a_hint() {
    let refuse = |goal: &str| resolve("male-p50", goal).unwrap_err().remove(0);
    let lesion = "lesion = \"pleural_based\"\n";
    let finding = refuse(&format!(
        "{lesion}entry_mm = [0, 0, 0]\nentry_direction_deg = [0, 0]"
    ));
    assert_eq!(finding.key.as_deref(), Some("goals[0].entry_direction_deg"));
    assert!(finding.message.contains("contradicts `entry_mm`"));
    let finding = refuse(&format!("{lesion}entry_direction_deg = [0, 91]"));
    assert_eq!(
        finding.key.as_deref(),
        Some("goals[0].entry_direction_deg[1]")
    );
    assert!(finding.hint.unwrap().contains("degrees"));
    let finding = refuse(&format!(
        "{lesion}entry_direction_deg = [0, 0]\ntarget_offset_mm = [900, 0, 0]"
    ));
    assert_eq!(finding.key.as_deref(), Some("goals[0].target_offset_mm"));
    assert!(finding.message.contains("outside the phantom"));
    let finding = refuse(lesion);
    assert!(finding.hint.unwrap().contains("`entry_direction_deg = ["));
}
