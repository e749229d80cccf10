//! One needle through a chest, one thread: its tip alone, as budgets ask for, and all of it.
//!
//! `cargo bench -p needlebench-insertion --bench insertion`

#![expect(
    missing_docs,
    reason = "criterion's macros make undocumented functions"
)]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use needlebench_insertion::{Bevel, Gauge, Guide, Holder, Layers, Tissue, ends, insert};

/// Layers of `guide/examples/tissue.toml`, whole millimetres.
const CHEST_M: [(Tissue, f64); 4] = [
    (Tissue::Fat, 0.010),
    (Tissue::Wall, 0.020),
    (Tissue::Lung, 0.038),
    (Tissue::Lesion, 0.010),
];

const STAND_OFF_M: f64 = 0.015;

fn insertions(c: &mut Criterion) {
    let mut group = c.benchmark_group("an insertion");
    for number in [18, 22] {
        let needle = Gauge::new(number).expect("in the chart").needle();
        let chest = CHEST_M.map(|(tissue, length_m)| tissue.layer(length_m, needle.outer_m));
        let layers = Layers::new(chest.to_vec()).expect("sound layers");
        for (name, play_m, turn_at_m) in [
            ("no play", 0.0, None),
            ("play", 6.5e-5, None),
            ("play, turned", 6.5e-5, Some(0.05)),
        ] {
            let holder = Holder::Guide(Guide {
                length_m: 0.05,
                play_m,
            });
            let bevel = Bevel {
                towards: [1.0, 0.0],
                angle_rad: 25.0_f64.to_radians(),
                turn_at_m,
            };
            group.bench_function(format!("ends, {number} G, {name}"), |b| {
                b.iter(|| ends(&needle, &holder, STAND_OFF_M, black_box(&layers), &bevel));
            });
            group.bench_function(format!("insert, {number} G, {name}"), |b| {
                b.iter(|| insert(&needle, &holder, STAND_OFF_M, black_box(&layers), &bevel));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, insertions);
criterion_main!(benches);
