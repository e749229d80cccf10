//! Whole turns within joint limits: found one by one against listing all and sorting.
//!
//! `cargo bench -p needlebench-kinematics --bench wraps`

#![expect(
    missing_docs,
    reason = "criterion's macros make undocumented functions"
)]

use std::f64::consts::TAU;
use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use needlebench_kinematics::ik::{WrapSearch, closed_form};
use needlebench_kinematics::{JOINT_COUNT, JointLimits, Joints, LimitPolicy, UrGeometry, UrModel};

/// All combinations of up to two turns within the limits, sorted by distance.
fn all_sorted(rows: &[Joints], limits: &JointLimits, seed: &Joints) -> Vec<(f64, Joints)> {
    let mut found = Vec::new();
    for row in rows {
        let mut wraps = vec![*row];
        for joint in 0..JOINT_COUNT {
            let limit = &limits.0[joint];
            wraps = wraps
                .iter()
                .flat_map(|wrap| {
                    (-2..=2).filter_map(move |turns| {
                        let mut turned = *wrap;
                        turned[joint] = limit.admit(wrap[joint] + TAU * f64::from(turns))?;
                        Some(turned)
                    })
                })
                .collect();
        }
        found.extend(wraps.into_iter().map(|wrap| ((wrap - seed).norm(), wrap)));
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found
}

fn wraps(c: &mut Criterion) {
    let q =
        Joints::from_column_slice(&[-0.73508, 2.370465, 1.882823, -1.96721, 1.274286, 0.113862]);
    let geometry = UrGeometry::UR3;
    let answer = closed_form(&geometry, &geometry.base_from_flange(&q), None);
    let rows: Vec<Joints> = answer.solutions().map(|row| row.joints).collect();
    let limits = LimitPolicy::FULL_TURNS.limits_of(UrModel::Ur3);
    let endless = LimitPolicy::of_manual(UrModel::Ur3).limits_of(UrModel::Ur3);
    let seed = Joints::new(0.3, -1.2, 4.0, -5.0, 0.1, 6.0);
    let search = WrapSearch::new(&limits, &seed);
    assert_eq!(all_sorted(&rows, &limits, &seed).len(), 512);
    assert_eq!(search.wraps_of_all(rows.iter().copied()).count(), 512);

    let mut group = c.benchmark_group("wraps of one posture");
    group.bench_function("the nearest", |b| b.iter(|| search.nearest(black_box(&q))));
    for count in [1, 10, 64] {
        group.bench_function(format!("the first {count}"), |b| {
            b.iter(|| {
                search
                    .wraps(black_box(&q))
                    .take(count)
                    .map(|wrap| wrap.joints[0])
                    .sum::<f64>()
            });
        });
    }
    group.bench_function("all 64, listed and sorted", |b| {
        b.iter(|| all_sorted(black_box(&[q]), &limits, &seed));
    });
    group.finish();

    let mut group = c.benchmark_group("wraps of all eight solutions");
    for count in [1, 10, 100, 512] {
        group.bench_function(format!("the first {count}"), |b| {
            b.iter(|| {
                let wraps = search.wraps_of_all(black_box(&rows).iter().copied());
                wraps.take(count).map(|wrap| wrap.joints[0]).sum::<f64>()
            });
        });
    }
    group.bench_function("the first 10, wrist 3 endless", |b| {
        let search = WrapSearch::new(&endless, &seed);
        b.iter(|| {
            let wraps = search.wraps_of_all(black_box(&rows).iter().copied());
            wraps.take(10).map(|wrap| wrap.joints[0]).sum::<f64>()
        });
    });
    group.bench_function("all 512, listed and sorted", |b| {
        b.iter(|| all_sorted(black_box(&rows), &limits, &seed));
    });
    group.finish();
}

criterion_group!(benches, wraps);
criterion_main!(benches);
