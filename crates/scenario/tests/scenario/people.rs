//! Where people stand, and their bodies.

use std::path::Path;

use nalgebra::{Point3, Vector3};
use needlebench_cell::BodyKind;
use needlebench_scenario::{Overrides, ResolvedScenario, load_scenario};

fn shipped(name: &str) -> ResolvedScenario {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
    load_scenario(&folder.join(name), &Overrides::default()).unwrap()
}

#[test]
fn a_body_is_as_deep_and_as_wide_as_it_is_said_to_be() {
    let resolved = shipped("table3.toml");
    let people = &resolved.people.by_goal[0];
    let bodies = resolved.cell.bodies.iter();
    let bodies: Vec<_> = bodies
        .filter(|body| body.kind == BodyKind::Person)
        .collect();
    assert_eq!(bodies.len(), people.len());
    let entry = resolved.goals[0].entry_m.unwrap();
    for (body, person) in bodies.iter().zip(people) {
        let [solid] = &body.solids[..] else {
            panic!("one goal, one place")
        };
        let ahead = (entry - person.position_m).xy().normalize();
        let (ahead, beside) = (
            Vector3::new(ahead.x, ahead.y, 0.0),
            Vector3::new(-ahead.y, ahead.x, 0.0),
        );
        let stature_m = person.statures_m.iter().copied().fold(0.0, f64::max);
        // The corners of the outline are outside of it by 2 % of its radius of 150 mm at most.
        for (way, half_m, height_m) in [
            (ahead, 0.15, 1.0),
            (-ahead, 0.15, 1.0),
            (beside, 0.25, 1.0),
            (-beside, 0.25, 1.0),
            (beside, 0.25, stature_m),
        ] {
            let at = |way_m: f64| -> Point3<f64> {
                person.position_m + way * way_m + Vector3::z() * height_m
            };
            assert!(solid.contains(&at(half_m - 1e-6)), "{}", body.name);
            assert!(!solid.contains(&at(half_m + 0.004)), "{}", body.name);
        }
        let over = person.position_m + Vector3::z() * (stature_m + 0.04);
        assert!(!solid.contains(&over));
    }
}

#[test]
fn who_finds_a_place_has_the_needle_ahead() {
    let resolved = shipped("far_side.toml");
    let needle_m = resolved.cell.tool.needle.length_m;
    for (goal, people) in resolved.goals.iter().zip(&resolved.people.by_goal) {
        let entry = goal.entry_m.unwrap();
        for person in people {
            // Along the needle whose tip is on the skin, seen from above: half a body and 250 mm.
            for step in 0..=100 {
                let way_m = needle_m * f64::from(step) / 100.0;
                let on_needle = entry - goal.axis.into_inner() * way_m;
                let level_m = (on_needle - person.position_m).xy().norm();
                assert!(level_m > 0.4 - 1e-9, "{}: {level_m}", goal.name);
            }
        }
    }
}
