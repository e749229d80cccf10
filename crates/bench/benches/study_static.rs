//! Static cases of the default cell with a moved phantom or base, against resolving the scenario's
//! text and preparing the cell anew for every case.
//!
//! `cargo bench -p needlebench-bench --bench study_static`; times are per case of eight configurations.

#![expect(
    missing_docs,
    reason = "criterion's macros make undocumented functions"
)]

use std::hint::black_box;
use std::path::{Path, PathBuf};

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use needlebench_bench::study::{CaseRow, StaticWorker, StudyColumns, static_rows};
use needlebench_scenario::study::StudyMode;
use needlebench_scenario::{Change, KeyPath, Overrides, ScenarioFamily, Setting, resolve_scenario};

/// Scenario, its goal, and what fixes the roll where the goal does not.
const CELLS: [(&str, &str, bool); 2] = [
    ("table3", "pose", false),
    ("supine_suite", "right_pleural_lateral", true),
];

/// Configurations of a case.
const CONFIGURATIONS: u64 = 8;

fn path_of(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../scenarios/{name}.toml"))
}

/// What the k-th case adds to a coordinate, mm.
fn offset(k: u32) -> f64 {
    f64::from(k % 199) * 0.1 - 10.0
}

/// A roll at which the goal is reached: that of the configuration with the most room.
fn best_roll_deg(family: &ScenarioFamily, goal: &str) -> f64 {
    let resolved = family.vary(goal, &[]).expect("shipped scenarios are sound");
    let rows = static_rows(&resolved);
    let best = rows.iter().max_by(|a, b| {
        let surplus = |row: &CaseRow| row.get("surplus_static").unwrap_or(f64::NEG_INFINITY);
        surplus(a).total_cmp(&surplus(b))
    });
    best.and_then(|row| row.get("roll_static"))
        .unwrap_or(0.0)
        .to_degrees()
}

fn cases(c: &mut Criterion) {
    let mut group = c.benchmark_group("static_case");
    group.throughput(Throughput::Elements(CONFIGURATIONS));
    let columns = StudyColumns::new(&[StudyMode::Static], &[]);
    for (name, goal, fix_roll) in CELLS {
        let path = path_of(name);
        let family = ScenarioFamily::load(&path, &Overrides::default())
            .expect("shipped scenarios are sound");
        let key = |text| KeyPath::parse(text).expect("a path");
        let fixed = [(
            key("goal.roll_deg"),
            Change::Set(Setting::from(best_roll_deg(&family, goal))),
        )];
        let fixed = if fix_roll { &fixed[..] } else { &[] };
        for (what, text) in [
            ("phantom", "phantom.position_mm[0]"),
            ("base", "robot.base_position_mm[1]"),
        ] {
            let mut worker = StaticWorker::default();
            let mut k = 0;
            group.bench_function(format!("{name}/{what}"), |b| {
                b.iter(|| {
                    k += 1;
                    let mut changes = fixed.to_vec();
                    changes.push((key(text), Change::Add(offset(k))));
                    let resolved = family.vary(goal, &changes).expect("a sound layout");
                    black_box(columns.rows(&worker.rows(&resolved)))
                });
            });
        }
        let mut k = 0;
        group.bench_function(format!("{name}/phantom, vary alone"), |b| {
            b.iter(|| {
                k += 1;
                let change = (key("phantom.position_mm[0]"), Change::Add(offset(k)));
                black_box(family.vary(goal, &[change]).expect("a sound layout"))
            });
        });
        let mut worker = StaticWorker::default();
        let mut k = 0;
        group.bench_function(format!("{name}/phantom size"), |b| {
            b.iter(|| {
                k += 1;
                let mut changes = fixed.to_vec();
                let breadth_mm = 305.0 + 0.01 * f64::from(k % 1000);
                changes.push((
                    key("phantom.breadth_mm"),
                    Change::Set(Setting::from(breadth_mm)),
                ));
                black_box(family.vary(goal, &changes).map(|each| worker.rows(&each)))
            });
        });
        let text = std::fs::read_to_string(&path).expect("a readable scenario");
        let folder = path.parent().expect("a folder");
        group.sample_size(10);
        group.bench_function(format!("{name}/anew"), |b| {
            b.iter(|| {
                let overrides = Overrides::default();
                let mut resolved =
                    resolve_scenario(name, &text, folder, &overrides).expect("shipped, sound");
                resolved.goals.retain(|each| each.name == goal);
                black_box(static_rows(&resolved))
            });
        });
    }
    group.finish();
}

/// The guide's angle about the needle is free: 36 directions and searches between them.
fn free_roll(c: &mut Criterion) {
    let family = ScenarioFamily::load(&path_of("supine_suite"), &Overrides::default())
        .expect("shipped scenarios are sound");
    let mut worker = StaticWorker::default();
    let mut group = c.benchmark_group("static_case");
    group.throughput(Throughput::Elements(CONFIGURATIONS));
    let columns = StudyColumns::new(&[StudyMode::Static], &[]);
    group.sample_size(10);
    let mut k = 0;
    group.bench_function("supine_suite/free roll", |b| {
        b.iter(|| {
            k += 1;
            let key = KeyPath::parse("phantom.position_mm[0]").expect("a path");
            let changes = [(key, Change::Add(offset(k)))];
            let resolved = family.vary("right_pleural_lateral", &changes);
            black_box(columns.rows(&worker.rows(&resolved.expect("a sound layout"))))
        });
    });
    group.finish();
}

criterion_group!(benches, cases, free_roll);
criterion_main!(benches);
