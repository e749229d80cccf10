//! Head and arms of a patient: of measured size, on what the patient lies on, and part of what may be hit.

use std::path::Path;

use needlebench_cell::BodyKind;
use needlebench_geometry::{PreparedShape, Shape, Solid, separation};
use needlebench_input::Finding;
use needlebench_phantom::SIZE_PRESETS;
use needlebench_scenario::{Overrides, ResolvedScenario, resolve_scenario};

/// Rounding of a metre, through a rotation.
const ROUNDING_M: f64 = 1e-9;
const TABLE_M: f64 = 0.78;

fn resolve(phantom: &str) -> Result<ResolvedScenario, Vec<Finding>> {
    let text = format!(
        "name = \"x\"\n[robot]\nbase_position_mm = [-900, 0, 800]\n[phantom]\n{phantom}\n\
         [table]\ntop_height_mm = 780\n[iso9283]\ncube_centre_mm = [0, -300, 150]\n"
    );
    resolve_scenario("x.toml", &text, Path::new(""), &Overrides::default())
}

fn body(resolved: &ResolvedScenario) -> &[Solid] {
    let mut bodies = resolved.cell.bodies.iter();
    let body = bodies.find(|body| body.kind == BodyKind::Phantom);
    &body.unwrap().solids
}

fn solid<'r>(resolved: &'r ResolvedScenario, name: &str) -> &'r Solid {
    let mut solids = body(resolved).iter();
    solids.find(|solid| solid.name == name).unwrap()
}

fn apart_m(a: &Solid, b: &Solid) -> f64 {
    let [first, second] = [a, b].map(|solid| PreparedShape::new(&solid.shape));
    separation(&first, &a.parent_from_shape, &second, &b.parent_from_shape).distance_m
}

fn radius_m(solid: &Solid) -> f64 {
    match solid.shape {
        Shape::Capsule { radius_m, .. } => radius_m,
        _ => panic!("limbs are capsules"),
    }
}

#[test]
fn limbs_lie_no_lower_than_the_chest_in_every_posture() {
    for posture in ["supine", "prone", "left-lateral", "right-lateral"] {
        for arms in ["beside", "overhead"] {
            for model in SIZE_PRESETS {
                for roll in [-20.0, 0.0, 35.0] {
                    let resolved = resolve(&format!(
                        "model = \"{model}\"\nposture = \"{posture}\"\narms = \"{arms}\"\n\
                         head = true\nbody_roll_deg = {roll}"
                    ))
                    .unwrap_or_else(|findings| panic!("{model} {posture} {arms}: {findings:?}"));
                    for solid in body(&resolved) {
                        let (low, _) = solid.bounding_box();
                        assert!(low.z > TABLE_M - 2.0 * ROUNDING_M, "{}", solid.name);
                    }
                }
            }
        }
    }
}

/// Of a patient on the back: the head and the arms touch the table, as they do.
#[test]
fn supine_head_and_arms_rest_on_the_table() {
    for arms in ["beside", "overhead"] {
        let resolved = resolve(&format!("arms = \"{arms}\"\nhead = true")).unwrap();
        for name in ["head", "arm_left.upper", "arm_right.forearm"] {
            let (low, _) = solid(&resolved, name).bounding_box();
            assert!((low.z - TABLE_M).abs() < 3.0 * ROUNDING_M, "{name}");
        }
    }
}

#[test]
fn head_and_arms_have_the_measured_sizes() {
    let resolved = resolve("arms = \"beside\"\nhead = true").unwrap();
    let placed = resolved.phantom.as_ref().unwrap();
    let sizes = &placed.phantom.parameters.as_ref().unwrap().limbs;
    // The patient's head points along world x, the left side along -y.
    let box_of = |name: &str| solid(&resolved, name).bounding_box();
    let (low, high) = box_of("head");
    assert!((high.y - low.y - 1e-3 * sizes.head_breadth_mm).abs() < 3.0 * ROUNDING_M);
    assert!((high.z - low.z - 1e-3 * sizes.head_length_mm).abs() < 3.0 * ROUNDING_M);
    let notch_m = 144.0 / 408.0 * 1e-3 * placed.phantom.parameters.as_ref().unwrap().length_mm;
    assert!((high.x - notch_m - 1e-3 * sizes.notch_to_vertex_mm).abs() < 3.0 * ROUNDING_M);

    let (arm_low, arm_high) = box_of("arm_left.upper");
    let (fore_low, _) = box_of("arm_left.forearm");
    assert!(
        (arm_high.x - notch_m).abs() < 3.0 * ROUNDING_M,
        "shoulder and notch are level"
    );
    let reach_m = arm_high.x - fore_low.x;
    let wanted_mm = sizes.upper_arm_length_mm + sizes.forearm_length_mm + sizes.hand_length_mm;
    assert!((reach_m - 1e-3 * wanted_mm).abs() < 3.0 * ROUNDING_M);
    let around_m = std::f64::consts::TAU * radius_m(solid(&resolved, "arm_left.upper"));
    assert!((around_m - 1e-3 * sizes.upper_arm_circumference_mm).abs() < ROUNDING_M);
    // Shoulders as broad as measured, or farther apart where the chest needs the room.
    assert!(arm_low.y < -0.5e-3 * sizes.shoulder_breadth_mm + ROUNDING_M);
}

#[test]
fn raised_arms_keep_off_the_head_and_leave_no_gap_at_the_armpit() {
    for model in SIZE_PRESETS {
        let phantom = format!("model = \"{model}\"\narms = \"overhead\"\nhead = true");
        let resolved = resolve(&phantom).unwrap();
        let [skin, head] = ["skin", "head"].map(|name| solid(&resolved, name));
        for side in ["left", "right"] {
            let piece = |name: &str| solid(&resolved, &format!("arm_{side}.{name}"));
            assert!(apart_m(piece("upper"), head) > 0.0, "{model}");
            assert!(apart_m(piece("forearm"), head) > 0.0, "{model}");
            for (a, b) in [
                (piece("axilla"), skin),
                (piece("axilla"), piece("upper")),
                (piece("upper"), piece("forearm")),
            ] {
                let depth_m = -apart_m(a, b);
                assert!(depth_m > 0.02, "{model}: {} {}", a.name, b.name);
            }
        }
    }
}

#[test]
fn limbs_are_only_where_they_are_asked_for() {
    let names = |phantom: &str| -> Vec<String> {
        let resolved = resolve(phantom).unwrap();
        body(&resolved)
            .iter()
            .map(|each| each.name.clone())
            .collect()
    };
    assert_eq!(names(""), ["skin"]);
    assert_eq!(names("head = true"), ["skin", "head", "neck"]);
    assert_eq!(names("arms = \"beside\"").len(), 5);
    assert_eq!(names("arms = \"overhead\"\nhead = true").len(), 9);
}

#[test]
fn obstacle_in_an_arm_is_refused() {
    let obstacle = |y_mm: f64| {
        let text = format!(
            "name = \"x\"\n[robot]\nbase_position_mm = [-900, 0, 800]\n[phantom]\narms = \"beside\"\n\
             [table]\ntop_height_mm = 780\n[[obstacles]]\nname = \"pole\"\n\
             position_mm = [0, {y_mm}, 900]\nshape = {{ cylinder = {{ radius_mm = 15, length_mm = 200 }} }}\n\
             [iso9283]\ncube_centre_mm = [0, -300, 150]\n"
        );
        resolve_scenario("x.toml", &text, Path::new(""), &Overrides::default())
    };
    assert!(obstacle(-320.0).is_ok());
    let findings = obstacle(-220.0).unwrap_err();
    assert!(
        findings[0].message.contains("overlaps the patient"),
        "{findings:?}"
    );
}

#[test]
fn standing_chest_on_a_table_is_noted_with_the_lying_one() {
    let notes = |phantom: &str| resolve(phantom).unwrap().notes.join("\n");
    let said = notes("model = \"male-p95\"");
    assert!(said.contains("measured on people standing"), "{said}");
    assert!(said.contains("`male-p95-supine`"), "{said}");
    assert!(!notes("model = \"male-p95-supine\"").contains("standing"));
    assert!(!notes("model = \"male-p95\"\nbreadth_mm = 360\ndepth_mm = 250").contains("standing"));
}
