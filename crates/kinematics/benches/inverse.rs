//! Inverse kinematics of the UR3.
//!
//! `cargo bench -p needlebench-kinematics`

#![expect(
    missing_docs,
    reason = "criterion's macros make undocumented functions"
)]

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use needlebench_kinematics::ik::{
    ClosedForm, GaussNewtonOptions, Kinematics, Preference, Rows, closed_form, closed_form_batch,
    closed_form_into, gauss_newton,
};
use needlebench_kinematics::pose_sets::PoseSet;
use needlebench_kinematics::{Joints, Pose, UrGeometry};
use needlebench_numerics::random::SplitMix64;

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
    group.bench_function("closed form, into a place", |b| {
        let mut out = ClosedForm::BLANK;
        b.iter(|| {
            let preference = Preference::default();
            closed_form_into(
                &geometry,
                black_box(&base_from_flange),
                preference,
                &mut out,
            );
            black_box(out.count())
        });
    });
    group.bench_function("closed form, checked by forward kinematics", |b| {
        b.iter(|| kinematics.solve(black_box(&base_link_from_flange), None));
    });
    group.bench_function("rows, into a place", |b| {
        let mut rows = Rows::new();
        b.iter(|| {
            kinematics.rows_into(black_box(&base_link_from_flange), None, &mut rows);
            black_box(rows.count())
        });
    });
    group.finish();
    // Per pose, over 1024 different ones: generic, then singular, where more care is taken.
    let mut group = c.benchmark_group("1024 poses");
    group.throughput(Throughput::Elements(1024));
    for set in [
        PoseSet::Generic,
        PoseSet::Wrist,
        PoseSet::Elbow,
        PoseSet::Shoulder,
        PoseSet::QuarterTurns,
    ] {
        let mut random = SplitMix64::new(1);
        let poses: Vec<Pose> = (0..1024)
            .map(|_| geometry.base_from_flange(&set.sample(&geometry, &mut random, 0.0)))
            .collect();
        let mut out = vec![ClosedForm::BLANK; poses.len()];
        group.bench_function(format!("one by one, {}", set.name()), |b| {
            b.iter(|| {
                for (pose, out) in poses.iter().zip(&mut out) {
                    closed_form_into(&geometry, pose, Preference::default(), out);
                }
                black_box(&out);
            });
        });
        group.bench_function(format!("batch, {}", set.name()), |b| {
            b.iter(|| {
                closed_form_batch(
                    &geometry,
                    black_box(&poses),
                    Preference::default(),
                    &mut out,
                );
                black_box(&out);
            });
        });
    }
    let poses: Vec<Pose> = {
        let mut random = SplitMix64::new(1);
        (0..1024)
            .map(|_| PoseSet::Generic.sample(&geometry, &mut random, 0.0))
            .map(|q| kinematics.base_link_from_flange(&q))
            .collect()
    };
    let mut rows = vec![Rows::new(); poses.len()];
    group.bench_function("rows, batch, generic", |b| {
        b.iter(|| {
            kinematics.rows_batch(black_box(&poses), None, &mut rows);
            black_box(&rows);
        });
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
