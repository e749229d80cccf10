//! Clearance of a posture, and of single pairs beside parry, on the cell of Table 3.
//!
//! `cargo bench -p needlebench-clearance`

#![expect(
    missing_docs,
    reason = "criterion's macros make undocumented functions"
)]

use std::hint::black_box;
use std::path::Path;

use criterion::{Criterion, criterion_group, criterion_main};
use needlebench_clearance::ClearanceModel;
use needlebench_geometry::{PreparedShape, Shape, separation};
use needlebench_kinematics::{Joints, Pose};
use needlebench_scenario::{Overrides, ResolvedScenario, load_scenario};
use parry3d_f64::math::{Pose as ParryPose, Vector};
use parry3d_f64::shape::SharedShape;

fn table3() -> ResolvedScenario {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/table3.toml");
    load_scenario(&path, &Overrides::default()).expect("the shipped scenario is sound")
}

/// Right-Down-Fold of Table 3, and a posture on the way to it.
const POSTURES: [[f64; 6]; 2] = [
    [-0.73508, 2.370465, 1.882823, -1.96721, 1.274286, 0.113862],
    [-0.4, -2.7, 0.6, -1.7, 1.4, 0.05],
];

fn postures(c: &mut Criterion) {
    let resolved = table3();
    let model = ClearanceModel::new(&resolved.cell);
    let postures = POSTURES.map(|q| Joints::from_column_slice(&q));
    let mut group = c.benchmark_group("posture");
    group.bench_function("minimum_per_class", |b| {
        b.iter(|| {
            for q in &postures {
                black_box(model.minimum_per_class(black_box(q)));
            }
        });
    });
    group.bench_function("all_pairs", |b| {
        b.iter(|| {
            for q in &postures {
                black_box(model.all_pairs(black_box(q)));
            }
        });
    });
    group.finish();
}

/// parry in millimetres, because its tolerances are absolute.
fn parry_shape(shape: &Shape) -> SharedShape {
    match shape {
        Shape::Cylinder {
            radius_m,
            half_length_m,
        } => SharedShape::cylinder(half_length_m * 1e3, radius_m * 1e3),
        Shape::Convex(mesh) => {
            let points: Vec<Vector> = mesh
                .0
                .vertices_m
                .iter()
                .map(|v| Vector::new(v.x * 1e3, v.y * 1e3, v.z * 1e3))
                .collect();
            SharedShape::convex_hull(&points).expect("the skin has a volume")
        }
        _ => unreachable!("only cylinders and the skin are compared"),
    }
}

fn cylinder_against_skin(c: &mut Criterion) {
    let resolved = table3();
    let placed = resolved
        .phantom
        .as_ref()
        .expect("the scenario has a phantom");
    let skin = &placed.phantom.skin().shape;
    let cylinder = Shape::Cylinder {
        radius_m: 0.0327,
        half_length_m: 0.0937,
    };
    let at = Pose::translation(0.05, -0.32, 0.1);
    let mut group = c.benchmark_group("cylinder against skin");
    let (ours_a, ours_b) = (PreparedShape::new(&cylinder), PreparedShape::new(skin));
    group.bench_function("needlebench", |b| {
        b.iter(|| separation(&ours_a, black_box(&at), &ours_b, &Pose::identity()));
    });
    let (theirs_a, theirs_b) = (parry_shape(&cylinder), parry_shape(skin));
    let theirs_at = ParryPose::translation(50.0, -320.0, 100.0);
    group.bench_function("parry", |b| {
        b.iter(|| {
            parry3d_f64::query::contact(
                black_box(&theirs_at),
                theirs_a.as_ref(),
                &ParryPose::IDENTITY,
                theirs_b.as_ref(),
                f64::MAX,
            )
        });
    });
    group.finish();
}

criterion_group!(benches, postures, cylinder_against_skin);
criterion_main!(benches);
