//! A synthetic chest scan, stage by stage: 512 x 512 x 300 voxels of 0.7 x 0.7 x 1.0 mm, about 300 parts, one thread.

#![expect(missing_docs, reason = "what criterion's macro makes")]

use std::hint::black_box;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::{Point3, UnitQuaternion, Vector3};
use needlebench_geometry::{Shape, Solid};
use needlebench_kinematics::Pose;
use needlebench_synthesis::{Kernel, Scanner, Scene, label, synthesise};
use needlebench_volume::write::write_nifti;
use needlebench_volume::{Volume, VoxelGrid};

/// A trunk with lungs, heart, ribs of a shell and an inside, vessels, a spine, lesions and markers.
fn chest() -> Scene {
    let mut scene = Scene::default();
    let mut add = |shape: Shape, pose: Pose, hu: f64| {
        let label = scene.label(&format!("part_{}", scene.parts.len()));
        let solid = Solid {
            name: String::new(),
            shape,
            parent_from_shape: pose,
        };
        scene.push(solid, hu, label);
    };
    let capsule = |radius_m: f64, half_length_m: f64| Shape::Capsule {
        radius_m,
        half_length_m,
    };
    let at = Pose::translation;
    for (radius_m, hu) in [(0.145, 40.0), (0.143, -100.0), (0.133, 50.0)] {
        add(capsule(radius_m, 0.06), at(0.0, 0.0, 0.0), hu);
    }
    for side in [-1.0, 1.0] {
        add(capsule(0.05, 0.05), at(side * 0.058, 0.0, 0.0), -850.0);
    }
    add(
        Shape::Sphere { radius_m: 0.045 },
        at(0.01, -0.03, -0.04),
        45.0,
    );
    for (shell_m, hu) in [(0.0, 900.0), (1e-3, 200.0)] {
        for rib in 0..12 {
            for piece in 0..8 {
                let turn = 0.6 * f64::from(piece) - 2.1;
                let height_m = -0.13 + 0.023 * f64::from(rib) - 0.004 * f64::from(piece);
                let place =
                    Vector3::new(0.118 * libm::cos(turn), 0.118 * libm::sin(turn), height_m);
                let along = UnitQuaternion::from_euler_angles(1.5, 0.0, turn);
                add(
                    capsule(5e-3 - shell_m, 0.036),
                    Pose::from_parts(place.into(), along),
                    hu,
                );
            }
        }
        for vertebra in 0..12 {
            let shape = Shape::Cylinder {
                radius_m: 0.016 - shell_m,
                half_length_m: 0.01 - shell_m,
            };
            add(
                shape,
                at(0.0, 0.075, -0.14 + 0.025 * f64::from(vertebra)),
                hu,
            );
        }
    }
    for vessel in 0..70 {
        let turn = f64::from(vessel);
        let place = Vector3::new(
            0.05 * libm::cos(turn),
            0.04 * libm::sin(turn),
            0.004 * turn - 0.14,
        );
        let along = UnitQuaternion::from_euler_angles(turn, 0.7 * turn, 0.0);
        add(
            capsule(2e-3, 0.02),
            Pose::from_parts(place.into(), along),
            45.0,
        );
    }
    for marker in 0..8 {
        let turn = f64::from(marker) - 4.5;
        let place = [
            0.149 * libm::cos(turn),
            0.149 * libm::sin(turn),
            0.01 * turn,
        ];
        add(
            Shape::Sphere { radius_m: 4e-3 },
            at(place[0], place[1], place[2]),
            1200.0,
        );
    }
    scene
}

fn grid() -> VoxelGrid {
    let size = [512, 512, 300];
    let spacing_m = [0.7e-3, 0.7e-3, 1e-3];
    let first = [0, 1, 2].map(|axis| -0.5 * (size[axis] - 1) as f64 * spacing_m[axis]);
    VoxelGrid::aligned(size, spacing_m, Point3::from(first)).expect("a grid")
}

fn scan(scene: &Scene, scanner: &Scanner, grid: &VoxelGrid) -> Volume {
    synthesise(scene, scanner, grid, 1, 1, &AtomicBool::new(false)).expect("a volume")
}

fn synth(criterion: &mut Criterion) {
    let (scene, grid) = (chest(), grid());
    let mut group = criterion.benchmark_group("synth");
    group.sample_size(10);
    group.measurement_time(Duration::from_secs(40));
    let full = Scanner::new(1e-3, Kernel::Smooth);
    let silent = Scanner {
        noise: None,
        ..full.clone()
    };
    let sharp = Scanner::new(1e-3, Kernel::Sharp);
    for (name, scanner) in [
        ("without_noise", &silent),
        ("smooth", &full),
        ("sharp", &sharp),
    ] {
        group.bench_function(name, |bencher| {
            bencher.iter(|| black_box(scan(&scene, scanner, &grid)));
        });
    }
    group.bench_function("labels", |bencher| {
        bencher.iter(|| label(&scene, &grid, 1, &AtomicBool::new(false)).expect("labels"));
    });
    let volume = scan(&scene, &full, &grid);
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("ct.nii.gz");
    group.bench_function("write_nii_gz", |bencher| {
        bencher.iter(|| write_nifti(&path, &volume, &AtomicBool::new(false)).expect("a file"));
    });
    group.finish();
}

criterion_group!(benches, synth);
criterion_main!(benches);
