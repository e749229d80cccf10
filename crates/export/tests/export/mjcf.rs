//! MJCF.

use std::collections::BTreeSet;

use needlebench_export::mjcf;

use crate::{all_between, hanging, text};

#[test]
fn every_solid_of_the_cell_is_a_geom() {
    let resolved = hanging();
    let files = mjcf(&resolved, "cell").unwrap();
    let geoms: BTreeSet<&str> = all_between(text(&files[0]), "<geom name=\"", "\"")
        .into_iter()
        .collect();
    for body in &resolved.cell.bodies {
        for solid in &body.solids {
            let name = format!("{}/{}", body.name, solid.name);
            // A surface that is not convex is several.
            let first = format!("{name}/1");
            let is_there = geoms.contains(&*name) || geoms.contains(&*first);
            assert!(is_there, "{name} is missing");
        }
    }
}

#[test]
fn the_start_is_the_first_keyframe_and_motors_hold_it() {
    let resolved = hanging();
    let files = mjcf(&resolved, "cell").unwrap();
    let numbers =
        |words: &str| -> Vec<f64> { words.split(' ').map(|word| word.parse().unwrap()).collect() };
    let key = all_between(text(&files[0]), "<key ", "/>")[0];
    assert!(key.starts_with("name=\"start\""));
    let qpos = numbers(all_between(key, "qpos=\"", "\"")[0]);
    let ctrl = numbers(all_between(key, "ctrl=\"", "\"")[0]);
    assert_eq!(qpos, resolved.start.as_slice());
    let held = resolved.cell.dynamics().gravity_torque(&resolved.start);
    assert_eq!(ctrl, held.as_slice());
    // It hangs from the ceiling: something has to be held.
    assert!(held.amax() > 1.0);
}
