//! Directions judged in the voxels of a whole scan, 512 x 512 x 300 of 0.7 x 0.7 x 1.0 mm, on one thread: 20 000 of them, and
//! beside that their distances from bone alone as they were found before, by steps of a quarter of a millimetre.

#![expect(missing_docs, reason = "what criterion's macro makes")]

use std::hint::black_box;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::{Point3, Vector3};
use needlebench_imaging::{DistanceField, DistanceOptions, IndexBox, Mask};
use needlebench_routing::{RouteRules, VoxelAnatomy, VoxelOptions, evenly, search};
use needlebench_scenario::scenario::OddsSection;
use needlebench_volume::{LabelMap, VoxelGrid};

const SIZE: [usize; 3] = [512, 512, 300];
const SPACING_M: [f64; 3] = [0.7e-3, 0.7e-3, 1e-3];
const DIRECTIONS: usize = 20_000;
const TARGET: [f64; 3] = [0.07, -0.01, 0.0];
const BONE: u16 = 4;
static GO: AtomicBool = AtomicBool::new(false);

/// A trunk of ellipses: lungs with vessels, ribs, a spine, a heart.
fn chest() -> LabelMap {
    let first = Point3::new(-255.5 * 0.7e-3, -255.5 * 0.7e-3, -149.5e-3);
    let grid = VoxelGrid::aligned(SIZE, SPACING_M, first).unwrap();
    let is_in = |x: f64, y: f64, [a, b]: [f64; 2]| libm::hypot(x / a, y / b) <= 1.0;
    let is_bone = |x: f64, y: f64, z: f64| {
        let wall = is_in(x, y, [0.148, 0.1]) && !is_in(x, y, [0.141, 0.094]);
        let rib = ((z + 0.2 * x.abs()) / 0.026).rem_euclid(1.0) < 0.4;
        (wall && rib) || libm::hypot(y - 0.075, x) < 0.018
    };
    let label = |x: f64, y: f64, z: f64| -> u16 {
        if !is_in(x, y, [0.165, 0.115]) {
            0
        } else if is_bone(x, y, z) {
            BONE
        } else if libm::hypot(libm::hypot(x - 0.01, y + 0.01), 0.7 * z) < 0.045 {
            6
        } else if libm::hypot(x.abs() - 0.075, y) < 0.003 {
            5
        } else if is_in(x.abs() - 0.078, y, [0.055, 0.085]) {
            if x > 0.0 { 2 } else { 3 }
        } else {
            1
        }
    };
    let mut labels = Vec::with_capacity(grid.len());
    for k in 0..SIZE[2] {
        for j in 0..SIZE[1] {
            for i in 0..SIZE[0] {
                let at = grid.ct_from_index(&Point3::new(i as f64, j as f64, k as f64));
                labels.push(label(at.x, at.y, at.z));
            }
        }
    }
    let names = [
        "soft_tissue",
        "lung_left",
        "lung_right",
        "bone",
        "vessels",
        "heart",
    ];
    LabelMap {
        grid,
        labels,
        names: (1..).zip(names.map(str::to_owned)).collect(),
    }
}

fn rules() -> RouteRules {
    RouteRules {
        margins_m: [3e-3; 3],
        constant_m: 1e-3,
        sigmas: 2.0,
        floors_m: [2.7e-3; 3],
        needle_radius_m: 0.6e-3,
        longest_m: 0.12,
        outside_m: 0.08,
        max_skin_angle_rad: 1.05,
        max_pleural_crossings: 1,
        cross_fissures: false,
        cross_bullae: false,
        throw_m: 5e-3,
        odds: OddsSection::default(),
        needle: None,
    }
}

fn directions(criterion: &mut Criterion) {
    let labels = chest();
    let rules = rules();
    let make = || {
        let options = VoxelOptions {
            patient: None,
            lesions: &[],
            off: &[],
            needle_m: rules.longest_m,
            markers: &[],
            outside_m: rules.outside_m,
            lung_vessel_m: 3e-3,
            below_rib_m: 3e-3,
            beside_sternum_m: 20e-3,
            hu: None,
            threads: 1,
            cancel: &GO,
        };
        VoxelAnatomy::new(&labels, Vector3::zeros(), Point3::from(TARGET), &options).unwrap()
    };
    let anatomy = make();
    let free = search(&anatomy, &rules, DIRECTIONS, 1, &|| false)
        .free()
        .len();
    assert!(free > 100, "{free} of {DIRECTIONS} are free");
    let bone = Mask::of(SIZE, &labels.labels, |label| label == BONE);
    let distance = DistanceOptions {
        cap_m: 20e-3,
        threads: 1,
        cancel: &GO,
    };
    let field =
        DistanceField::to_boxes(&labels.grid, &bone, IndexBox::whole(SIZE), &distance).unwrap();
    let mut group = criterion.benchmark_group("directions");
    group
        .sample_size(10)
        .measurement_time(Duration::from_secs(10));
    group.bench_function("voxels and distances about a target", |bencher| {
        bencher.iter(|| black_box(make()));
    });
    group.bench_function("20 000 judged by all rules", |bencher| {
        bencher.iter(|| black_box(search(&anatomy, &rules, DIRECTIONS, 1, &|| false)));
    });
    group.bench_function("20 000 from bone alone, step by step", |bencher| {
        bencher.iter(|| {
            let least = evenly(DIRECTIONS).map(|outwards| {
                let along = (0..480).map(|step| 0.25e-3 * f64::from(step));
                let bounds = along
                    .map(|m| field.at_least(&(Point3::from(TARGET) + outwards.into_inner() * m)));
                bounds.fold(f64::INFINITY, f64::min)
            });
            black_box(least.fold(0.0, f64::max))
        });
    });
    group.finish();
}

criterion_group!(benches, directions);
criterion_main!(benches);
