//! Clearances of a whole cell: pruning changes nothing but the time.

use std::sync::Arc;

use crate::common::{Variety, cell};
use nalgebra::{Point3, Vector3};
use needlebench_cell::{Cell, ClearanceClass};
use needlebench_clearance::{AIMS, ClearanceModel, Counts, Nearby, PairClearance};
use needlebench_geometry::{PreparedShape, PreparedSolids, Shape, SolidMesh, separation};
use needlebench_kinematics::{Joints, Pose};

/// The solver's certificate of 1e-10 m and rounding, as in `properties.rs`.
const REPRODUCED_M: f64 = 1e-9;

/// Postures all over the place, and around a working one.
fn postures(count: usize) -> Vec<Joints> {
    let mut variety = Variety::new(21);
    let working = Joints::new(0.3, -1.2, 1.5, -1.5, -1.5, 0.2);
    let mut postures = Vec::new();
    for _ in 0..count / 2 {
        postures.push(variety.joints());
        postures.push(working + Joints::from_fn(|_, _| variety.between(-0.3, 0.3)));
    }
    postures
}

fn least(pairs: &[PairClearance], class: ClearanceClass) -> Option<&PairClearance> {
    pairs
        .iter()
        .filter(|pair| pair.class == class)
        .min_by(|a, b| a.separation.distance_m.total_cmp(&b.separation.distance_m))
}

/// Least distance of a pair of bodies without any pruning.
fn brute_force_m(cell: &Cell, pair: usize, q: &Joints) -> f64 {
    let poses = cell.world_from_bodies(q);
    let pair = cell.pairs[pair];
    let mut least_m = f64::INFINITY;
    for a in &cell.bodies[pair.a].solids {
        for b in &cell.bodies[pair.b].solids {
            let found = separation(
                &PreparedShape::new(&a.shape),
                &(poses[pair.a] * a.parent_from_shape),
                &PreparedShape::new(&b.shape),
                &(poses[pair.b] * b.parent_from_shape),
            );
            least_m = least_m.min(found.distance_m);
        }
    }
    least_m
}

#[test]
fn all_pairs_are_the_least_over_all_their_solids() {
    let cell = cell();
    let model = ClearanceModel::new(&cell);
    let mut penetrating = 0;
    for q in postures(20) {
        let pairs = model.all_pairs(&q);
        assert_eq!(pairs.len(), cell.pairs.len());
        for (i, found) in pairs.iter().enumerate() {
            assert_eq!((found.pair, found.class), (i, cell.pairs[i].class));
            let expected_m = brute_force_m(&cell, i, &q);
            let error_m = found.separation.distance_m - expected_m;
            assert!(error_m.abs() <= REPRODUCED_M, "{error_m:e}");
            penetrating += usize::from(expected_m < 0.0);
        }
    }
    assert!(penetrating > 20, "{penetrating}");
}

#[test]
fn named_solids_and_witnesses_belong_to_the_distance() {
    let cell = cell();
    let model = ClearanceModel::new(&cell);
    for q in postures(20) {
        let poses = cell.world_from_bodies(&q);
        for found in model.all_pairs(&q) {
            let pair = cell.pairs[found.pair];
            let a = &cell.bodies[pair.a].solids[found.solid_a];
            let b = &cell.bodies[pair.b].solids[found.solid_b];
            assert_eq!(found.solid_names(&cell), (a.name.as_str(), b.name.as_str()));
            let alone = separation(
                &PreparedShape::new(&a.shape),
                &(poses[pair.a] * a.parent_from_shape),
                &PreparedShape::new(&b.shape),
                &(poses[pair.b] * b.parent_from_shape),
            );
            let found = found.separation;
            assert!((alone.distance_m - found.distance_m).abs() <= REPRODUCED_M);
            let between = found.point_on_b - found.point_on_a;
            let off = between - found.normal.into_inner() * found.distance_m;
            assert!(off.norm() <= REPRODUCED_M, "{off:?}");
        }
    }
}

#[test]
fn pruned_minima_are_exactly_the_minima_of_all_pairs() {
    let cell = cell();
    let model = ClearanceModel::new(&cell);
    for q in postures(600) {
        let pairs = model.all_pairs(&q);
        let minima = model.minimum_per_class(&q);
        let mut classes = 0;
        for found in minima.iter() {
            let expected = least(&pairs, found.class).expect("the class has pairs");
            assert_eq!(found.separation.distance_m, expected.separation.distance_m);
            assert_eq!(minima.get(found.class), Some(found));
            classes += 1;
        }
        // All but the needle's route, which is no pair of bodies.
        assert_eq!(classes, 8);
        assert_eq!(minima.get(ClearanceClass::NeedleRoute), None);
    }
}

/// Steps of a way through postures, rad: from those of a bisection's end to jumps.
const STEPS_RAD: [f64; 5] = [1e-4, 1e-3, 0.01, 0.1, 1.0];

/// Postures that follow each other by such steps, with jumps in between.
fn walk(variety: &mut Variety, count: usize) -> Vec<Joints> {
    let mut q = Joints::new(0.3, -1.2, 1.5, -1.5, -1.5, 0.2);
    (0..count)
        .map(|k| {
            let step_rad = STEPS_RAD[k / 3 % STEPS_RAD.len()];
            q += Joints::from_fn(|_, _| variety.between(-step_rad, step_rad));
            q
        })
        .collect()
}

/// The same cell with a dented skin, which is a surface.
fn with_dented_skin(mut cell: Cell) -> Cell {
    let mut bodies = cell.bodies.iter_mut();
    let phantom = bodies.find(|body| body.name == "phantom").expect("it has");
    let Shape::Convex(skin) = &phantom.solids[0].shape else {
        panic!("the skin is convex")
    };
    let mut surface = skin.0.clone();
    for dent in &mut surface.vertices_m[50..70] {
        *dent = Point3::from(dent.coords * 0.8);
    }
    phantom.solids[0].shape = Shape::Mesh(Arc::new(SolidMesh::new(surface)));
    cell
}

#[test]
fn what_is_known_from_the_posture_before_changes_no_answer() {
    let limit_m = |class: ClearanceClass| match class {
        ClearanceClass::GuideStandoff => f64::NEG_INFINITY,
        ClearanceClass::SelfCollision => 0.002,
        _ => 0.02,
    };
    // Two groups and each class for itself, all up to somewhere; one class counts for nothing.
    let all = ClearanceClass::ALL;
    // Deep, so that some of the postures are free.
    let floor_m = |class: ClearanceClass| limit_m(class) - 0.1;
    let counts = Counts {
        class_cap_m: all.map(|class| limit_m(class) + 0.001 * (class as usize) as f64),
        aim_of: all.map(|class| match class {
            ClearanceClass::SelfCollision | ClearanceClass::NeedleCorridor => Some(2),
            ClearanceClass::GuideStandoff => None,
            _ => Some(0),
        }),
        aim_cap_m: [0.1, f64::NEG_INFINITY, f64::INFINITY],
        floor_m: all.map(floor_m),
        excess_cap_m: 0.03,
        ends_below_m: f64::NEG_INFINITY,
    };
    for (cell, count) in [(cell(), 900), (with_dented_skin(cell()), 60)] {
        let model = ClearanceModel::new(&cell);
        let mut variety = Variety::new(8);
        let [mut all, mut counted, mut below, mut any, mut mixed] =
            [(); 5].map(|()| Nearby::default());
        let (mut hits, mut free) = (0, 0);
        for (k, q) in walk(&mut variety, count).into_iter().enumerate() {
            let pairs = model.all_pairs(&q);
            let least_m = |class: ClearanceClass| {
                let found = least(&pairs, class).expect("the class has pairs");
                found.separation.distance_m
            };
            let check = |found: &PairClearance| {
                assert_eq!(found.separation.distance_m, least_m(found.class), "{k}");
                // The witness is that of the pair itself.
                assert_eq!(pairs[found.pair].separation, found.separation, "{k}");
            };
            let minima = model.minimum_per_class_near(&q, &mut all);
            assert_eq!(minima.iter().count(), 8);
            minima.iter().for_each(check);
            // As far as it counts.
            let asked =
                |nearby: &mut Nearby| model.what_counts_near(&model.held(&q), nearby, &counts);
            let found = asked(&mut counted);
            let least = |wanted: &dyn Fn(ClearanceClass) -> bool| {
                let classes = minima.iter().map(|each| each.class);
                let wanted_m = classes.filter(|class| wanted(*class)).map(least_m);
                wanted_m.fold(f64::INFINITY, f64::min)
            };
            let excess_m = minima
                .iter()
                .map(|each| each.separation.distance_m - floor_m(each.class))
                .fold(counts.excess_cap_m, f64::min);
            assert_eq!(found.excess_m, excess_m, "{k}");
            let of_pair = found.excess_of.map(|couple| {
                let pair = &pairs[couple.pair];
                pair.separation.distance_m - floor_m(pair.class)
            });
            assert_eq!(of_pair.unwrap_or(counts.excess_cap_m), excess_m, "{k}");
            // Where less than a limit is enough to know.
            for ends_below_m in [-0.05, -0.02, 0.0, 0.05] {
                let counts = Counts {
                    ends_below_m,
                    ..counts
                };
                let ended = model.what_counts_near(&model.held(&q), &mut mixed, &counts);
                if excess_m < ends_below_m {
                    assert!(ended.excess_m < ends_below_m, "{k}");
                } else {
                    assert_eq!(ended.excess_m, excess_m, "{k}");
                }
            }
            if excess_m >= 0.0 {
                for aim in 0..AIMS {
                    let least_m = least(&|class| counts.aim_of[class as usize] == Some(aim));
                    assert_eq!(found.aim_m[aim], least_m.min(counts.aim_cap_m[aim]), "{k}");
                }
                for each in minima.iter() {
                    let (class, least_m) = (each.class as usize, each.separation.distance_m);
                    let cap_m = counts.class_cap_m[class];
                    assert_eq!(
                        found.by_class_m[class].min(cap_m),
                        least_m.min(cap_m),
                        "{k}"
                    );
                }
                free += 1;
            }
            let is_below = |pair: &PairClearance| {
                pair.class.is_physical() && pair.separation.distance_m < limit_m(pair.class)
            };
            let limit_m = |class: ClearanceClass| {
                if class.is_physical() {
                    limit_m(class)
                } else {
                    f64::NEG_INFINITY
                }
            };
            let near = model.below_near(&q, &mut below, limit_m);
            assert_eq!(near.is_some(), pairs.iter().any(is_below), "{k}");
            assert!(near.is_none_or(|pair| is_below(&pair)));
            assert_eq!(
                model.is_below_near(&q, &mut any, limit_m),
                near.is_some(),
                "{k}"
            );
            hits += usize::from(near.is_some());
            // One after the other, whatever was asked before.
            match k % 3 {
                0 => assert_eq!(model.minimum_per_class_near(&q, &mut mixed), minima),
                1 => {
                    let again = asked(&mut mixed);
                    assert_eq!(again.excess_m, found.excess_m);
                    assert!(excess_m < 0.0 || again.aim_m == found.aim_m);
                }
                _ => {
                    let again = model.below_near(&q, &mut mixed, limit_m);
                    assert_eq!(again.is_some(), near.is_some());
                    let again = model.is_below_near(&q, &mut mixed, limit_m);
                    assert_eq!(again, near.is_some());
                }
            }
        }
        assert!(hits > count / 20 && hits < count, "{hits}");
        assert!(free > count / 20, "{free}");
    }
}

#[test]
fn first_below_finds_a_pair_exactly_if_there_is_one() {
    let cell = cell();
    let model = ClearanceModel::new(&cell);
    let limit_m = |class: ClearanceClass| match class {
        ClearanceClass::GuideStandoff => f64::NEG_INFINITY,
        ClearanceClass::SelfCollision => 0.002,
        _ => 0.02,
    };
    let mut hits = 0;
    for q in postures(600) {
        let pairs = model.all_pairs(&q);
        let below = |pair: &&PairClearance| {
            pair.class.is_physical() && pair.separation.distance_m < limit_m(pair.class)
        };
        let expected = pairs.iter().find(below);
        let found = model.first_below(&q, limit_m);
        assert_eq!(found.map(|f| f.pair), expected.map(|e| e.pair));
        if let (Some(found), Some(expected)) = (found, expected) {
            hits += 1;
            assert!(found.separation.distance_m < limit_m(found.class));
            assert!(found.separation.distance_m >= expected.separation.distance_m);
        }
    }
    assert!((100..500).contains(&hits), "{hits}");
}

#[test]
fn recorded_link_poses_give_the_same_as_joint_positions() {
    let cell = cell();
    let model = ClearanceModel::new(&cell);
    let no_limit = |_| 0.01;
    for q in postures(20) {
        let links = cell.robot.world_from_links(&q);
        assert_eq!(model.all_pairs_at(&links), model.all_pairs(&q));
        assert_eq!(
            model.minimum_per_class_at(&links),
            model.minimum_per_class(&q)
        );
        assert_eq!(
            model.first_below_at(&links, no_limit),
            model.first_below(&q, no_limit)
        );
    }
}

#[test]
fn joint_positions_that_are_no_numbers_do_not_pass_for_free() {
    let model = ClearanceModel::new(&cell());
    let q = Joints::repeat(f64::NAN);
    assert!(model.first_below(&q, |_| 0.01).is_some());
    let minima = model.minimum_per_class(&q);
    let table = minima.get(ClearanceClass::RobotTable).expect("a table");
    assert!(table.separation.distance_m.is_nan());
}

#[test]
fn the_model_of_a_like_cell_is_the_one_made_anew() {
    let first = cell();
    let known = ClearanceModel::new(&first);
    let mut moved = first.clone();
    for body in &mut moved.bodies {
        // One that stands still, and one on the wrist.
        if ["phantom", "tool"].contains(&body.name.as_str()) {
            for solid in &mut body.solids {
                solid.parent_from_shape.translation.vector.x += 0.017;
            }
        }
    }
    let mut fewer = first.clone();
    fewer.bodies.last_mut().unwrap().solids.truncate(1);
    for cell in [&first, &moved, &fewer] {
        let [like, anew] = [known.for_cell(cell), ClearanceModel::new(cell)];
        for q in postures(20) {
            assert_eq!(like.all_pairs(&q), anew.all_pairs(&q));
            assert_eq!(like.minimum_per_class(&q), anew.minimum_per_class(&q));
        }
    }
}

#[test]
fn the_nearest_solid_of_a_segment_is_the_least_of_all() {
    let cell = cell();
    let solids: Vec<_> = cell
        .bodies
        .iter()
        .flat_map(|body| body.solids.iter().cloned())
        .collect();
    let prepared = PreparedSolids::new(&solids);
    let mut variety = Variety::new(5);
    let mut point = || Point3::from(Vector3::from_fn(|_, _| variety.between(-1.0, 1.0)));
    let place = Pose::translation(0.1, -0.2, 0.05);
    for _ in 0..50 {
        let (from, to) = (point(), point());
        let all = prepared.segment_clearance(&from, &to, 6e-4, &place);
        let wanted = |index: usize| !index.is_multiple_of(3);
        let found = prepared.nearest_to_segment(&from, &to, 6e-4, &place, wanted);
        let least = (0..all.len())
            .filter(|index| wanted(*index))
            .map(|index| (index, all[index]))
            .min_by(|a, b| a.1.distance_m.total_cmp(&b.1.distance_m));
        assert_eq!(found, least);
    }
}

#[test]
fn pruned_minima_of_a_cell_with_a_mesh_are_exactly_the_minima_of_all_pairs() {
    let cell = with_dented_skin(cell());
    let model = ClearanceModel::new(&cell);
    let mut variety = Variety::new(37);
    let mut inside = 0;
    for _ in 0..20 {
        let q = variety.joints();
        let pairs = model.all_pairs(&q);
        for found in model.minimum_per_class(&q).iter() {
            let least_m = pairs
                .iter()
                .filter(|pair| pair.class == found.class)
                .map(|pair| pair.separation.distance_m)
                .fold(f64::INFINITY, f64::min);
            assert_eq!(found.separation.distance_m, least_m);
            let (_, solid) = found.solid_names(&cell);
            inside += usize::from(solid == "skin" && least_m < 0.0);
        }
    }
    assert!(inside > 0);
}
