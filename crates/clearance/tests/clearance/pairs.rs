//! Pairs of bodies: what is proven about them holds, and what is wrong is found.

use std::f64::consts::PI;
use std::path::Path;

use crate::common::{Variety, cell};
use needlebench_cell::Cell;
use needlebench_clearance::{
    ClearanceModel, PairConcern, PairExamination, PairSettings, PairState, examine_pairs,
};
use needlebench_geometry::{Shape, Solid};
use needlebench_kinematics::{Joints, Pose};
use needlebench_scenario::{Overrides, load_scenario};

/// What proofs take off their bounds for rounding, once on either side.
const ROUNDING_M: f64 = 2e-6;

/// Few enough for a development build; bounds hold for any.
const QUICK: PairSettings = PairSettings {
    samples: 300,
    seed: 3,
    tolerance_m: 2e-3,
    boxes: 5000,
    joints: 2,
};

fn table3() -> Cell {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/table3.toml");
    load_scenario(&path, &Overrides::default()).unwrap().cell
}

fn of<'e>(
    cell: &Cell,
    examined: &'e [PairExamination],
    first: &str,
    second: &str,
) -> &'e PairExamination {
    examined
        .iter()
        .find(|pair| {
            let names = [pair.a, pair.b].map(|body| cell.bodies[body].name.as_str());
            names == [first, second] || names == [second, first]
        })
        .unwrap()
}

/// The arm of `cell` with nothing but a ball on two of its bodies, given in the bodies' frames.
fn two_balls(bodies: [(&str, [f64; 3]); 2], radius_m: f64) -> Cell {
    let mut cell = cell();
    cell.bodies
        .retain(|body| bodies.iter().any(|(name, _)| *name == body.name));
    for body in &mut cell.bodies {
        let (_, [x, y, z]) = bodies.iter().find(|(name, _)| *name == body.name).unwrap();
        body.solids = vec![Solid {
            name: format!("{}.ball", body.name),
            shape: Shape::Sphere { radius_m },
            parent_from_shape: Pose::translation(*x, *y, *z),
        }];
    }
    cell.pairs.clear();
    cell
}

#[test]
fn bounds_hold_the_extremes_of_a_ball_on_a_circle() {
    // The shoulder turns about the z axis, 0.3 m out; the other ball stands 0.5 m out.
    let cell = two_balls(
        [("base", [0.5, 0.0, 0.1]), ("shoulder", [0.0, 0.3, 0.0])],
        0.02,
    );
    let height_m = cell.robot.chain.joints[0].parent_from_joint.translation.z;
    let settings = PairSettings {
        tolerance_m: 1e-5,
        ..QUICK
    };
    let examined = examine_pairs(&cell, &settings);
    let pair = of(&cell, &examined, "base", "shoulder");
    let distance_m = |across_m: f64| libm::hypot(across_m, height_m - 0.1) - 0.04;
    for (bound, expected_m) in [
        (pair.nearest.unwrap(), distance_m(0.2)),
        (pair.farthest.unwrap(), distance_m(0.8)),
    ] {
        assert!(bound.lower_m <= expected_m && expected_m <= bound.upper_m);
        assert!(bound.upper_m - bound.lower_m <= settings.tolerance_m + ROUNDING_M);
    }
}

#[test]
fn random_postures_do_not_refute_what_is_proven() {
    let cell = table3();
    let examined = examine_pairs(&cell, &QUICK);
    let proven: Vec<_> = examined
        .iter()
        .filter(|pair| pair.state.is_measured() && pair.nearest.is_some())
        .collect();
    let never = proven.iter().filter(|pair| pair.state == PairState::Never);
    assert!(never.count() >= 12);
    let model = ClearanceModel::new(&cell);
    let mut variety = Variety::new(5);
    let mut least_m = vec![f64::INFINITY; cell.pairs.len()];
    for _ in 0..3000 {
        // Whole turns more or less are the same posture.
        let q = Joints::from_fn(|_, _| variety.between(-2.0 * PI, 2.0 * PI));
        for (least_m, found) in least_m.iter_mut().zip(model.all_pairs(&q)) {
            *least_m = least_m.min(found.separation.distance_m);
        }
    }
    for pair in proven {
        let bound = pair.nearest.unwrap();
        let at = cell
            .pairs
            .iter()
            .position(|each| {
                (each.a.min(each.b), each.a.max(each.b)) == (pair.a.min(pair.b), pair.a.max(pair.b))
            })
            .unwrap();
        assert!(least_m[at] >= bound.lower_m, "{pair:?}: {}", least_m[at]);
        assert!(pair.least_m >= bound.lower_m, "{pair:?}");
        assert!(bound.lower_m <= bound.upper_m, "{pair:?}");
    }
}

#[test]
fn more_boxes_narrow_a_bound_and_never_contradict_it() {
    let cell = table3();
    let mut before: Option<[f64; 2]> = None;
    for boxes in [50, 500, 5000] {
        let settings = PairSettings {
            samples: 1,
            boxes,
            ..QUICK
        };
        let examined = examine_pairs(&cell, &settings);
        let bound = of(&cell, &examined, "wrist_1", "wrist_3").nearest.unwrap();
        if let Some([lower_m, upper_m]) = before {
            assert!(bound.lower_m >= lower_m && bound.upper_m <= upper_m);
        }
        assert!(bound.boxes <= boxes);
        before = Some([bound.lower_m, bound.upper_m]);
    }
    // Wrist 3 stays clear of wrist 1 by 7 to 10 mm.
    let [lower_m, upper_m] = before.unwrap();
    assert!(lower_m > 0.0 && upper_m < 0.012, "{lower_m} {upper_m}");
}

#[test]
fn bodies_that_always_overlap_are_a_flaw_of_the_model() {
    // Both balls on the shoulder's axis, 1 mm apart and 20 mm thick.
    let chain = cell().robot.chain;
    let height_m = chain.joints[0].parent_from_joint.translation.z;
    let balls = two_balls(
        [
            ("base", [0.0, 0.0, height_m + 0.001]),
            ("upper_arm", [0.0, 0.0, 0.0]),
        ],
        0.02,
    );
    let examined = examine_pairs(&balls, &QUICK);
    let pair = of(&balls, &examined, "base", "upper_arm");
    assert_eq!(pair.state, PairState::Always);
    assert_eq!(pair.concern(), Some(PairConcern::AlwaysInCollision));
    assert!(pair.farthest.unwrap().upper_m < 0.0, "{pair:?}");
}

#[test]
fn neighbours_that_touch_at_some_angles_only_are_a_flaw_of_the_model() {
    let chain = cell().robot.chain;
    let height_m = chain.joints[0].parent_from_joint.translation.z;
    let balls = two_balls(
        [
            ("base", [0.1, 0.0, height_m]),
            ("shoulder", [0.1, 0.0, 0.0]),
        ],
        0.05,
    );
    let examined = examine_pairs(&balls, &QUICK);
    let pair = of(&balls, &examined, "base", "shoulder");
    assert_eq!(pair.state, PairState::Adjacent);
    assert_eq!(
        pair.concern(),
        Some(PairConcern::LeftOutButDependsOnPosture)
    );
    // Within 60 degrees either way, 0.1 m out: a third of the turn; 300 samples.
    assert!((pair.collision_rate - 1.0 / 3.0).abs() < 0.12, "{pair:?}");
}

#[test]
fn the_shipped_arm_has_no_flaws() {
    let cell = table3();
    for pair in examine_pairs(&cell, &QUICK) {
        assert_eq!(pair.concern(), None, "{pair:?}");
    }
}

/// Share of random postures at which the same primitives collide, found over 3000 postures by a
/// program that shares no code with this one.
const KNOWN_RATES: [(&str, &str, f64); 12] = [
    ("upper_arm", "wrist_1", 0.1497),
    ("upper_arm", "wrist_2", 0.1387),
    ("forearm", "shoulder", 0.1283),
    ("base", "forearm", 0.1077),
    ("upper_arm", "wrist_3", 0.099),
    ("forearm", "wrist_3", 0.0873),
    ("shoulder", "wrist_3", 0.0223),
    ("forearm", "wrist_2", 0.019),
    ("base", "wrist_3", 0.0153),
    ("base", "upper_arm", 0.0143),
    ("base", "wrist_2", 0.0087),
    ("shoulder", "wrist_2", 0.001),
];

#[test]
fn collision_rates_are_those_known_of_the_arm() {
    let cell = table3();
    let settings = PairSettings {
        samples: 2000,
        joints: 0,
        ..QUICK
    };
    let examined = examine_pairs(&cell, &settings);
    for (first, second, known) in KNOWN_RATES {
        let found = of(&cell, &examined, first, second).collision_rate;
        // Four standard deviations of the difference of two samples.
        let deviation = (known * (1.0 - known) * (1.0 / 2000.0 + 1.0 / 3000.0)).sqrt();
        assert!(
            (found - known).abs() <= 4.0 * deviation,
            "{first} and {second}: {found} against {known}"
        );
    }
}
