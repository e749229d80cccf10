//! Margins of the needle as tissue bends it: point by point among a phantom's parts, and against a plate in voxels.

use std::path::Path;

use nalgebra::{Point3, UnitVector3, Vector3};
use needlebench_phantom::{Passed, PassedLayer};
use needlebench_routing::{
    Anatomy, Obstacle, Ray, RouteNeedle, RouteRule, RouteRules, SolidAnatomy, VoxelAnatomy,
    VoxelOptions, bent_reason, judge, search,
};
use needlebench_scenario::imperfections::TissueNeedle;
use needlebench_scenario::scenario::NeedleRouteSection;
use needlebench_scenario::{
    BevelFacing, NeedlePath, Overrides, ResolvedScenario, bevel_clock, load_scenario,
};
use needlebench_volume::{LabelMap, VoxelGrid};

use crate::solids::{counts, rules};
use crate::voxels::{self, usual};

const STANDOFF_M: f64 = 0.015;

fn scenario() -> ResolvedScenario {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../guide/examples/tissue.toml");
    load_scenario(&file, &Overrides::default()).unwrap()
}

/// The needle of the example, with so many times the force across its tip.
fn needle(times: f64) -> TissueNeedle {
    let expected = scenario().expected.unwrap();
    let mut needle = expected.imperfections.tissue().unwrap().clone();
    needle.wall_force_n.median *= times;
    needle
}

fn with_needle(rules: &RouteRules, needle: TissueNeedle, facing: BevelFacing) -> RouteRules {
    RouteRules {
        needle: Some(RouteNeedle {
            needle,
            facing,
            standoff_m: STANDOFF_M,
            insertion_length_m: None,
        }),
        ..rules.clone()
    }
}

fn bend_m(needle: &TissueNeedle, layers: Vec<PassedLayer>) -> f64 {
    let path = NeedlePath::new(layers, None, [[1.0, 0.0], [0.0, 1.0]]);
    let [_, tip_m] = needle
        .bends_m(&needle.medians(), &path, STANDOFF_M)
        .unwrap();
    tip_m
}

/// The bend of a 22 G of 89 mm that is held by its hub, 80 mm deep in ballistic gel: 8.9 mm (Rand et al. 2016), which the force
/// of a bevel was inverted from. The guide of the example leaves much less of it.
#[test]
fn a_needle_held_by_its_hub_bends_as_published() {
    let mut needle = needle(1.0);
    needle.needle.outer_m = 0.718e-3;
    let gel = vec![PassedLayer {
        tissue: Passed::Wall,
        length_m: 80e-3,
    }];
    let path = NeedlePath::new(gel.clone(), None, [[1.0, 0.0], [0.0, 1.0]]);
    let by_hub_m = needle.bend_by_hub_m(&path, 89e-3).unwrap();
    assert!((by_hub_m - 8.9e-3).abs() < 0.1e-3, "{by_hub_m} m");
    let in_guide_m = bend_m(&needle, gel);
    assert!(in_guide_m < 0.5 * by_hub_m, "{in_guide_m} m");
    assert!(needle.bend_by_hub_m(&path, 80e-3).is_err());
}

#[test]
fn bent_needles_of_free_routes_keep_their_margins_point_by_point() {
    let resolved = scenario();
    let phantom = &resolved.phantom.as_ref().unwrap().phantom;
    let straight_rules = rules();
    // Strong enough that some routes are lost.
    let needle = needle(3.0);
    let lesion = &phantom.lesions[0];
    let own = lesion.organ.as_deref();
    let anatomy = SolidAnatomy::new(
        phantom,
        lesion.center_m,
        true,
        &NeedleRouteSection::default(),
    );
    let straight = search(&anatomy, &straight_rules, 400, 2, &|| false);
    let mut lost = 0;
    for facing in [BevelFacing::Unknown, BevelFacing::Along(-Vector3::z())] {
        let rules = with_needle(&straight_rules, needle.clone(), facing);
        let found = search(&anatomy, &rules, 400, 2, &|| false);
        for (bent, straight) in found.candidates.iter().zip(&straight.candidates) {
            let ray = Ray {
                target: lesion.center_m,
                outwards: bent.outwards,
            };
            let Some(depth_m) = bent.depth_m else {
                continue;
            };
            let [entry, tip] = [ray.at(depth_m), ray.target];
            let nearer = |towards: &[Vector3<f64>], path_m: &[[f64; 2]], margins_m: [f64; 3]| {
                let mut met = Vec::new();
                for towards in towards {
                    for ends in path_m.windows(2) {
                        let at = |[along_m, off_m]: [f64; 2]| ray.at(along_m) + towards * off_m;
                        let (from, to) = (at(ends[0]), at(ends[1]));
                        for place in [from, from + 0.5 * (to - from), to] {
                            met.extend(phantom.parts.iter().filter_map(|part| {
                                let obstacle = counts(part, own)?;
                                let margin_m = margins_m[obstacle as usize] + rules.needle_radius_m;
                                let ring = (0..6).map(|turn| {
                                    let turn = f64::from(turn) * std::f64::consts::FRAC_PI_3;
                                    let [a, b] = bevel_clock(&entry, &tip);
                                    let (sine, cosine) = libm::sincos(turn);
                                    place + (a * cosine + b * sine) * margin_m * 0.998
                                });
                                let mut ring = ring;
                                ring.any(|at| part.solid.contains(&at))
                                    .then_some(&part.name)
                            }));
                        }
                    }
                }
                met
            };
            match (&bent.outcome, &straight.outcome) {
                (Ok(route), Ok(_)) => {
                    // To a side that is not known it breaks no rule, and is as far away as it says.
                    let needle_of = rules.needle.as_ref().unwrap();
                    assert_eq!(route.bend.is_some(), needle_of.has_side());
                    let any_side = || needle_of.bend(&anatomy, &ray, depth_m, rules.throw_m);
                    let bend = route.bend.clone().or_else(any_side).unwrap();
                    let kept_m = match bend.towards {
                        Some(_) => rules.margins_m,
                        None => bend.distances_m.map(|m| m.min(20e-3)),
                    };
                    let layers = anatomy.layers(&ray, [0.0, depth_m]).unwrap();
                    assert!((bend.tip_m - bend_m(&needle, layers)).abs() < 1e-12);
                    let [twelve, three] = bevel_clock(&entry, &tip);
                    let hours: Vec<Vector3<f64>> = match bend.towards {
                        Some(towards) => vec![towards],
                        None => (0..12)
                            .map(|hour| {
                                libm::sincos(f64::from(hour) * std::f64::consts::TAU / 12.0)
                            })
                            .map(|(sine, cosine)| -(twelve * cosine + three * sine))
                            .collect(),
                    };
                    let met = nearer(&hours, &bend.path_m, kept_m);
                    assert!(met.is_empty(), "{facing:?} {met:?}");
                }
                (Err(refusal), Ok(_)) => {
                    lost += 1;
                    assert_ne!(facing, BevelFacing::Unknown);
                    assert_eq!(refusal.rule, RouteRule::Bent);
                    assert!(refusal.value < refusal.limit);
                    let route = bent.straight.as_ref().unwrap();
                    let reason = bent_reason(&anatomy, &rules, route).unwrap();
                    assert!(reason.contains("asked for"), "{reason}");
                }
                (bent, straight) => assert_eq!(bent, straight),
            }
        }
    }
    assert!(lost > 0);
}

const SPACING_M: f64 = 0.5e-3;

/// A box of soft tissue with a plate of bone on the left of what is deeper than 40 mm: the body begins at 10 mm along
/// x, the plate at `plate_m` along y.
fn beside_a_plate(plate_m: f64) -> LabelMap {
    let size = [200, 60, 40];
    let grid = VoxelGrid::aligned(size, [SPACING_M; 3], Point3::origin()).unwrap();
    let mut labels = vec![0_u16; grid.len()];
    for k in 0..size[2] {
        for j in 0..size[1] {
            for i in 20..size[0] {
                let at = grid.ct_from_index(&Point3::new(i as f64, j as f64, k as f64));
                let is_bone = at.x > 0.05 && at.y > plate_m;
                labels[grid.offset([i, j, k])] = if is_bone { 6 } else { 1 };
            }
        }
    }
    LabelMap {
        grid,
        labels,
        names: vec![(1, "soft_tissue".to_owned()), (6, "rib_left_5".to_owned())],
    }
}

#[test]
fn a_needle_that_bends_towards_bone_is_refused_by_what_it_bends() {
    // 5 mm from the axis.
    const PLATE_M: f64 = 0.02;
    let labels = beside_a_plate(PLATE_M);
    let target = Point3::new(0.095, 0.015, 0.01);
    let options = VoxelOptions {
        off: &[NeedleRouteSection::MEDIASTINUM.to_owned()],
        below_rib_m: 0.0,
        beside_sternum_m: 0.0,
        ..usual()
    };
    let anatomy = VoxelAnatomy::new(&labels, Vector3::zeros(), target, &options).unwrap();
    let outwards: UnitVector3<f64> = -Vector3::x_axis();
    // Slices end beside it.
    let rules = RouteRules {
        margins_m: [3.5e-3; 3],
        throw_m: 0.0,
        outside_m: 0.0,
        ..rules()
    };
    let straight = judge(&anatomy, &rules, &outwards).outcome.unwrap();
    let needle = needle(1.0);
    let skin_m = 0.01 - 0.5 * SPACING_M;
    let depth_m = target.x - skin_m;
    let wall = PassedLayer {
        tissue: Passed::Wall,
        length_m: depth_m - 0.01,
    };
    let fat = PassedLayer {
        tissue: Passed::Fat,
        length_m: 0.01,
    };
    let bend_m = bend_m(&needle, vec![fat, wall]);
    assert!(bend_m > 1e-3, "{bend_m}");
    let judged = |facing| {
        judge(
            &anatomy,
            &with_needle(&rules, needle.clone(), facing),
            &outwards,
        )
    };
    let bone = Obstacle::Bone as usize;
    // It bends away from where its face looks.
    let towards = judged(BevelFacing::Along(-Vector3::y()))
        .outcome
        .unwrap_err();
    assert_eq!(towards.rule, RouteRule::Bent);
    let off_m = (straight.distances_m[bone] - towards.value - bend_m).abs();
    assert!(off_m < SPACING_M, "{off_m}");
    assert_eq!(judged(BevelFacing::Unknown).outcome.unwrap().bend, None);
    let ray = Ray { target, outwards };
    let any_side = with_needle(&rules, needle.clone(), BevelFacing::Unknown).needle;
    let any_side = any_side
        .unwrap()
        .bend(&anatomy, &ray, depth_m, 0.0)
        .unwrap();
    assert!((any_side.distances_m[bone] - towards.value).abs() < SPACING_M);
    let away = judged(BevelFacing::Along(Vector3::y())).outcome.unwrap();
    let bend = away.bend.unwrap();
    assert!(bend.distances_m[bone] >= straight.distances_m[bone] - 0.5 * SPACING_M);
    assert!((away.spare_m - straight.spare_m).abs() < SPACING_M);
    // Along the needle, no bevel can face anything.
    let along = judged(BevelFacing::Along(Vector3::x())).outcome.unwrap();
    let off_m = along.bend.unwrap().distances_m[bone] - any_side.distances_m[bone];
    assert!(off_m.abs() < 1e-12, "{off_m}");
    let refused = judged(BevelFacing::Along(-Vector3::y()));
    let with_it = with_needle(&rules, needle.clone(), BevelFacing::Along(-Vector3::y()));
    let reason = bent_reason(&anatomy, &with_it, &refused.straight.unwrap()).unwrap();
    assert!(
        reason.contains("left 5th rib") && reason.contains("3.5 mm asked for"),
        "{reason}"
    );
    // Aimed against the bend, the bent tip is where that of a straight needle was, and the straight one is beside it.
    let aimed = TissueNeedle {
        is_aimed: true,
        ..needle.clone()
    };
    let judged = |facing| {
        let rules = with_needle(&rules, aimed.clone(), facing);
        judge(&anatomy, &rules, &outwards).outcome
    };
    let from_plate = judged(BevelFacing::Along(-Vector3::y())).unwrap();
    let bend = from_plate.bend.unwrap();
    let [along_m, off_m] = bend.path_m[bend.path_m.len() - 1];
    // The median needle, aimed by the mean.
    assert!(
        along_m.abs() < 1e-4 && off_m.abs() < 0.1 * bend_m,
        "{along_m} {off_m}"
    );
    let nearer_m = straight.distances_m[bone] - bend.distances_m[bone];
    assert!(nearer_m < 0.3 * bend_m, "{nearer_m}");
    let to_plate = judged(BevelFacing::Along(Vector3::y())).unwrap_err();
    assert_eq!(to_plate.rule, RouteRule::Bent);
    let off_m = straight.distances_m[bone] - to_plate.value - bend_m;
    assert!(off_m.abs() < SPACING_M + 0.1 * bend_m, "{off_m}");
}

#[test]
fn bent_needles_of_free_routes_are_as_far_from_every_voxel_as_they_say() {
    let labels = voxels::chest(false);
    let anatomy = voxels::anatomy(&labels, 1);
    let needle = needle(1.0);
    let facing = BevelFacing::Along(Vector3::z());
    let rules = with_needle(&voxels::rules(), needle.clone(), facing);
    let found = search(&anatomy, &rules, 1500, 2, &|| false);
    let straight = search(&anatomy, &voxels::rules(), 1500, 2, &|| false);
    let bent = found
        .candidates
        .iter()
        .filter(|each| each.straight.is_some());
    assert_eq!(found.free().len() + bent.count(), straight.free().len());
    let boxes = voxels::boxes_of(&labels, Obstacle::Bone);
    let free = found.free();
    assert!(free.len() > 10, "{}", free.len());
    for (number, route) in free.iter().enumerate() {
        let ray = Ray {
            target: anatomy.target(),
            outwards: route.outwards,
        };
        let bend = route.bend.as_ref().unwrap();
        let layers = anatomy.layers(&ray, [0.0, route.depth_m]).unwrap();
        assert!((bend.tip_m - bend_m(&needle, layers)).abs() < 1e-12);
        // Bends of an 18 G at such depths, whatever the layers are.
        assert!((1e-4..4e-3).contains(&bend.tip_m), "{}", bend.tip_m);
        let told_m = bend.distances_m[Obstacle::Bone as usize];
        assert!(told_m >= rules.margins_m[Obstacle::Bone as usize]);
        if number % 10 > 0 {
            continue;
        }
        let towards = bend.towards.unwrap();
        for ends in bend.path_m.windows(2) {
            let at = |[along_m, off_m]: [f64; 2]| ray.at(along_m) + towards * off_m;
            let (outwards, length_m) = UnitVector3::new_and_get(at(ends[0]) - at(ends[1]));
            let stretch = Ray {
                target: at(ends[1]),
                outwards,
            };
            let brute_m = voxels::brute_m(&boxes, &stretch, [0.0, length_m]);
            assert!(
                brute_m - 0.5 * needle.needle.outer_m >= told_m,
                "{brute_m} {told_m}"
            );
        }
    }
}
