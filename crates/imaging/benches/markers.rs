//! Markers of a whole scan: 512 x 512 x 300 voxels, eight balls on a body that is an elliptic cylinder.

#![expect(missing_docs, reason = "what criterion's macro makes")]

use std::hint::black_box;
use std::sync::atomic::AtomicBool;

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::{Point3, Vector3};
use needlebench_imaging::markers::{MarkerModel, Options, find_markers};
use needlebench_imaging::registration::{
    MatchOptions, ReferenceFrame, ReferenceMarker, match_markers, register_weighted,
};
use needlebench_numerics::random::SplitMix64;
use needlebench_volume::{Volume, VoxelGrid};

const SIZE: [usize; 3] = [512, 512, 300];

/// Half axes of the body, mm.
const BODY_MM: [f64; 2] = [130.0, 95.0];

/// Azimuth in degrees and height in mm.
const MARKERS: [[f64; 2]; 8] = [
    [-22.0, 91.0],
    [34.0, 78.0],
    [-57.0, 34.0],
    [64.0, 9.0],
    [-84.0, -28.0],
    [90.0, 51.0],
    [9.0, -71.0],
    [-33.0, -48.0],
];

fn centers_mm() -> Vec<Vector3<f64>> {
    MARKERS
        .iter()
        .map(|[azimuth, height]| {
            let (x, y) = libm::sincos(azimuth.to_radians());
            let on_skin = Vector3::new(BODY_MM[0] * x, -BODY_MM[1] * y, *height);
            let normal = Vector3::new(x / BODY_MM[0], -y / BODY_MM[1], 0.0).normalize();
            on_skin + normal * 4.0
        })
        .collect()
}

/// Soft steps instead of a scanner's: what is timed does not depend on it.
fn scan() -> Volume {
    let spacing = [0.7, 0.7, 1.0];
    let first = [-255.5 * 0.7, -255.5 * 0.7, -149.5];
    let centers = centers_mm();
    let mut random = SplitMix64::new(1);
    let mut hu = Vec::with_capacity(SIZE.iter().product());
    let soft = |depth_mm: f64| 0.5 * (1.0 + libm::tanh(depth_mm / 0.5));
    for k in 0..SIZE[2] {
        for j in 0..SIZE[1] {
            for i in 0..SIZE[0] {
                let index = [i, j, k];
                let p =
                    Vector3::from_fn(|axis, _| first[axis] + spacing[axis] * index[axis] as f64);
                let radius = libm::hypot(p.x / BODY_MM[0], p.y / BODY_MM[1]);
                let mut value = -1000.0 + 1040.0 * soft((1.0 - radius) * BODY_MM[1]);
                let lung = libm::hypot((p.x.abs() - 60.0) / 45.0, p.y / 60.0);
                value -= 890.0 * soft((1.0 - lung) * 45.0);
                if (0.95..1.2).contains(&radius) {
                    for center in &centers {
                        let distance = (p - center).norm();
                        if distance < 8.0 {
                            value += 2200.0 * soft(4.0 - distance);
                        }
                    }
                }
                #[expect(clippy::cast_possible_truncation, reason = "within the range of HU")]
                hu.push((value + random.uniform(-35.0, 35.0)) as i16);
            }
        }
    }
    Volume {
        grid: VoxelGrid::aligned(
            SIZE,
            spacing.map(|mm| mm * 1e-3),
            Point3::from(first.map(|mm| mm * 1e-3)),
        )
        .expect("a grid"),
        hu,
        slice_thickness_m: Some(1e-3),
    }
}

fn markers(criterion: &mut Criterion) {
    let volume = scan();
    let model = MarkerModel::bare_sphere(8e-3);
    let go = AtomicBool::new(false);
    let options = Options::default();
    let mut group = criterion.benchmark_group("markers");
    group.sample_size(10);
    group.bench_function("find, 512 x 512 x 300, 8 markers", |bencher| {
        bencher
            .iter(|| find_markers(black_box(&volume), &model, &options, 1, &go).expect("markers"));
    });
    let found = find_markers(&volume, &model, &options, 1, &go).expect("markers");
    assert_eq!(found.markers.len(), 8, "{:?}", found.rejected);
    let detected: Vec<_> = found
        .markers
        .iter()
        .map(needlebench_imaging::markers::DetectedMarker::localised)
        .collect();
    let reference: Vec<_> = centers_mm()
        .iter()
        .enumerate()
        .map(|(k, mm)| {
            ReferenceMarker::from_cad(format!("marker_{}", k + 1), Point3::from(mm * 1e-3), 1e-4)
        })
        .collect();
    let matching = MatchOptions::default();
    group.bench_function("match 8", |bencher| {
        bencher
            .iter(|| match_markers(black_box(&detected), &reference, &matching).expect("a match"));
    });
    let matched = match_markers(&detected, &reference, &matching).expect("a match");
    group.bench_function("register 8", |bencher| {
        bencher.iter(|| {
            register_weighted(
                &matched,
                black_box(&detected),
                &reference,
                ReferenceFrame::Phantom,
            )
            .expect("a registration")
        });
    });
    group.finish();
}

criterion_group!(benches, markers);
criterion_main!(benches);
