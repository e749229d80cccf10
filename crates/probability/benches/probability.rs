//! Balls beside the middle of a needle, 18 G: ends 0.9 and 1.3 mm per axis, bends of 0.7 mm, held and with 5 % of holds
//! that fail; likely to be met (about 4e-2), and rarely (about 1e-4).
//!
//! `cargo bench -p needlebench-probability --bench probability`

#![expect(
    missing_docs,
    reason = "criterion's macros make undocumented functions"
)]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::{Matrix6, Point3, Vector2, Vector3, Vector6};
use needlebench_numerics::random::SplitMix64;
use needlebench_probability::{
    Anatomy, Bend, BendDirection, Body, Case, Draws, Event, HalfPlane, Hold, Law, Needle, Part,
    Structure, at_most, difference, estimate,
};

/// Balls of 1 mm beside half the depth, by the distance of their centres from the axis of the needle, m.
struct Balls(Vec<f64>);

impl Anatomy for Balls {
    fn distance_m(&self, structure: usize, point_m: &Point3<f64>) -> f64 {
        (point_m - Point3::new(0.045, self.0[structure], 0.0)).norm() - 1e-3
    }
}

fn law(breathes: bool) -> Law {
    let covariance_m2 = Matrix6::from_fn(|row, column| {
        let sd_m = |index: usize| if index < 3 { 0.9e-3 } else { 1.3e-3 };
        let share = match row.abs_diff(column) {
            0 => 1.0,
            3 => 0.35,
            _ => 0.0,
        };
        share * sd_m(row) * sd_m(column)
    });
    let parts = ["registration", "arm", "image", "guide"].map(|name| Part {
        name: name.to_owned(),
        covariance_m2: 0.25 * covariance_m2,
    });
    let mut random = SplitMix64::new(5);
    let curves = (0..512).map(|_| {
        let size_m = 0.7e-3 * libm::exp(0.4 * random.standard_normal());
        let curve = (0..=20).map(|k| Vector2::new(size_m * f64::from(k * k) / 400.0, 0.0));
        curve.collect()
    });
    let fractions = (0..=20).map(|k| f64::from(k) / 20.0).collect();
    let bend = Bend::new(fractions, curves.collect(), BendDirection::Unknown).expect("sound");
    let held = Hold {
        weight: 0.95,
        level_sd_m: [Vector3::new(0.0, 0.4e-3, 0.2e-3); 2],
        ..Hold::still(0.0)
    };
    let failed = Hold {
        weight: 0.05,
        failed_m: Some([Vector3::new(1e-3, -6e-3, 3e-3); 2]),
        ..held.clone()
    };
    let holds = if breathes {
        vec![held, failed]
    } else {
        Vec::new()
    };
    Law::new(Vector6::zeros(), parts.to_vec(), Some(bend), holds).expect("sound")
}

fn structures(count: usize, away_m: &[f64]) -> Vec<Structure> {
    (0..count)
        .map(|index| Structure {
            name: "vessel".to_owned(),
            body: Body::Lung,
            boundary_sd_m: 0.3e-3,
            covers: HalfPlane::covers(&[Point3::new(0.045, away_m[index], 0.0)], 1, 1e-3),
        })
        .collect()
}

const NEEDLE: Needle = Needle {
    depth_m: 0.09,
    throw_m: 0.0,
    radius_m: 0.635e-3,
};

fn estimates(c: &mut Criterion) {
    let mut group = c.benchmark_group("one thread");
    group.sample_size(10);
    let draws = |most: u64| Draws {
        seed: 1,
        most,
        threads: 1,
        moves: true,
    };
    for (name, breathes) in [("held", false), ("breath", true)] {
        let law = law(breathes);
        for (of, away_m) in [
            ("likely", 3.2e-3),
            ("rare", if breathes { 8.3e-3 } else { 5.3e-3 }),
        ] {
            let balls = Balls(vec![away_m]);
            let structures = structures(1, &balls.0);
            let case = Case::new(&law, NEEDLE, &structures, &balls).expect("sound");
            let event = Event::Closer {
                structure: 0,
                margin_m: 0.0,
            };
            let events = [event.clone()];
            let found = estimate(&case, &events, &draws(1_000_000)).expect("sound");
            println!(
                "{name}, {of}: {:?} {:?}, {:?}",
                found[0].probability,
                found[0].method,
                at_most(&case, &event)
            );
            group.bench_function(format!("{name}, {of}: estimate"), |b| {
                b.iter(|| estimate(black_box(&case), &events, &draws(1_000_000)));
            });
            group.bench_function(format!("{name}, {of}: at most"), |b| {
                b.iter(|| at_most(black_box(&case), &event));
            });
            group.bench_function(format!("{name}, {of}: twice 1e6 draws"), |b| {
                b.iter(|| {
                    difference(
                        (black_box(&case), &event),
                        (&case, &event),
                        &draws(1_000_000),
                    )
                });
            });
        }
        let balls = Balls((0..30).map(|k| 4e-3 + 0.5e-3 * f64::from(k)).collect());
        let structures = structures(30, &balls.0);
        group.bench_function(format!("{name}: a case of 30 structures"), |b| {
            b.iter(|| Case::new(&law, NEEDLE, black_box(&structures), &balls).is_ok());
        });
        let case = Case::new(&law, NEEDLE, &structures, &balls).expect("sound");
        let any = Event::Any {
            structures: (0..30).collect(),
            margin_m: 1e-3,
        };
        group.bench_function(format!("{name}: any of 30, twice 2000 draws"), |b| {
            b.iter(|| difference((black_box(&case), &any), (&case, &any), &draws(2000)));
        });
    }
    group.finish();
}

criterion_group!(benches, estimates);
criterion_main!(benches);
