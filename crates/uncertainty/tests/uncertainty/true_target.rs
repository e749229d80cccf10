//! Where a lesion really is does not depend on what was believed of it.

use nalgebra::Vector3;
use needlebench_numerics::random::SplitMix64;
use needlebench_scenario::Goal;
use needlebench_uncertainty::{Layout, Truth};

use crate::common::imperfect;

/// How far one draw moves the planned target and a true one beside it, m.
fn moved_m(blocks: &str) -> [Vector3<f64>; 2] {
    let resolved = imperfect(blocks);
    let imperfections = resolved.imperfections.as_ref().expect("given");
    let layout = Layout::new(imperfections);
    let draw = layout.draw(&mut SplitMix64::new(3));
    let place = resolved
        .phantom
        .as_ref()
        .map(|placed| &placed.world_from_phantom);
    let truth = Truth::new(&resolved.cell, place, imperfections, &layout, &draw, 0).unwrap();
    let planned = &resolved.goals[0];
    let lesion_m = planned.target_m + Vector3::new(2e-3, -1e-3, 3e-3);
    let real = truth.goal(&Goal {
        true_target_m: Some(lesion_m),
        ..planned.clone()
    });
    assert_eq!(truth.goal(planned).true_target_m, None);
    [
        real.target_m - planned.target_m,
        real.true_target_m.expect("it is known") - lesion_m,
    ]
}

#[test]
fn what_is_known_of_it_is_not_drawn_again() {
    let beliefs =
        "[imperfections.hand_eye]\n[imperfections.registration]\n[imperfections.imaging]\n";
    let [target_m, lesion_m] = moved_m(beliefs);
    assert!(target_m.norm() > 1e-4, "{target_m}");
    assert_eq!(lesion_m, Vector3::zeros());
}

/// Rounding of places of a metre.
const ROUNDING_M: f64 = 1e-15 * 4.0;

#[test]
fn breathing_and_tissue_move_it_as_they_move_the_target() {
    let tissue = "[imperfections.needle]\n[imperfections.indentation]\n[imperfections.breathing]\nfree = true\n";
    let [target_m, lesion_m] = moved_m(tissue);
    assert!(target_m.norm() > 1e-4, "{target_m}");
    assert!(
        (target_m - lesion_m).norm() < ROUNDING_M,
        "{target_m} {lesion_m}"
    );
}
