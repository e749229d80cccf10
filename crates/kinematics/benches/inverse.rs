//! Inverse kinematics and dynamics of the UR3.
//!
//! `cargo bench -p needlebench-kinematics`

#![expect(
    missing_docs,
    reason = "criterion's macros make undocumented functions"
)]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use needlebench_kinematics::ik::{GaussNewtonOptions, Kinematics, closed_form, gauss_newton};
use needlebench_kinematics::{Joints, UrGeometry};

fn inverse(c: &mut Criterion) {
    let q =
        Joints::from_column_slice(&[-0.73508, 2.370465, 1.882823, -1.96721, 1.274286, 0.113862]);
    let geometry = UrGeometry::UR3;
    let kinematics = Kinematics::new(geometry.chain()).expect("the UR3 is a UR arm");
    let base_from_flange = geometry.base_from_flange(&q);
    let base_link_from_flange = kinematics.base_link_from_flange(&q);
    let near = q + Joints::repeat(0.05);
    let mut group = c.benchmark_group("all eight of one pose");
    group.bench_function("closed form", |b| {
        b.iter(|| closed_form(&geometry, black_box(&base_from_flange), None));
    });
    group.bench_function("closed form, checked by forward kinematics", |b| {
        b.iter(|| kinematics.solve(black_box(&base_link_from_flange), None));
    });
    group.finish();
    c.bench_function("Gauss-Newton from 0.05 rad", |b| {
        b.iter(|| {
            gauss_newton(
                &kinematics.chain,
                black_box(&base_link_from_flange),
                &near,
                &GaussNewtonOptions::default(),
            )
        });
    });
}

criterion_group!(benches, inverse);
criterion_main!(benches);
