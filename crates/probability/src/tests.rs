//! The screen leaves out nothing, and threads change nothing.

use nalgebra::{Matrix6, Point3, Vector2, Vector3, Vector6};
use needlebench_numerics::random::SplitMix64;

use crate::estimate::unscreened;
use crate::{
    Anatomy, Bend, BendDirection, Body, Case, Draws, Estimate, Event, Hold, Law, Needle, Part,
    Structure, estimate,
};

/// Balls, their centres and radii in m.
struct Balls(Vec<(Point3<f64>, f64)>);

impl Anatomy for Balls {
    fn distance_m(&self, structure: usize, point_m: &Point3<f64>) -> f64 {
        let (centre_m, radius_m) = self.0[structure];
        (point_m - centre_m).norm() - radius_m
    }
}

fn law() -> Law {
    let covariance_m2 = Matrix6::from_fn(|row, column| match row.abs_diff(column) {
        0 => 1.2e-6,
        3 => 0.5e-6,
        _ => 0.0,
    });
    let parts = ["arm", "image"].map(|name| Part {
        name: name.to_owned(),
        covariance_m2: 0.5 * covariance_m2,
    });
    let mut random = SplitMix64::new(2);
    let curves = (0..40).map(|_| {
        let size_m = random.uniform(0.0, 2e-3);
        (0..=6)
            .map(|k| Vector2::new(size_m * f64::from(k * k) / 36.0, -0.2e-3 * f64::from(k)))
            .collect()
    });
    let fractions = (0..=6).map(|k| f64::from(k) / 6.0).collect();
    let bend = Bend::new(fractions, curves.collect(), BendDirection::Unknown).unwrap();
    let held = Hold {
        weight: 0.9,
        level_sd_m: [
            Vector3::new(0.0, 0.2e-3, 0.0),
            Vector3::new(0.0, 0.5e-3, 0.0),
        ],
        ..Hold::still(0.0)
    };
    let failed = Hold {
        weight: 0.1,
        failed_m: Some([
            Vector3::new(0.0, -2e-3, 0.0),
            Vector3::new(1e-3, -7e-3, 0.0),
        ]),
        ..held.clone()
    };
    Law::new(
        Vector6::repeat(1e-4),
        parts.to_vec(),
        Some(bend),
        vec![held, failed],
    )
    .unwrap()
}

/// Twelve balls at random within 10 mm of the needle, and the events of them all.
fn scene() -> (Vec<Structure>, Balls, Vec<Event>) {
    let mut random = SplitMix64::new(3);
    let balls: Vec<(Point3<f64>, f64)> = (0..12)
        .map(|_| {
            let (sine, cosine) = libm::sincos(random.uniform(-3.0, 3.0));
            let radius_m = random.uniform(0.5e-3, 3e-3);
            let away_m = radius_m + random.uniform(2.5e-3, 10e-3);
            let x_m = random.uniform(0.0, 0.1);
            (Point3::new(x_m, away_m * cosine, away_m * sine), radius_m)
        })
        .collect();
    let structures = (0..balls.len())
        .map(|index| Structure {
            name: format!("vessel {index}"),
            body: if index % 3 == 0 {
                Body::Wall
            } else {
                Body::Lung
            },
            boundary_sd_m: 0.2e-3 * (index % 4) as f64,
            covers: Vec::new(),
        })
        .collect();
    let closer = (0..balls.len()).flat_map(|structure| {
        [0.0, 1e-3].map(|margin_m| Event::Closer {
            structure,
            margin_m,
        })
    });
    let others = [
        Event::Any {
            structures: (0..balls.len()).collect(),
            margin_m: 0.5e-3,
        },
        Event::TipInside { structure: 4 },
        Event::NotchInside {
            structure: 4,
            notch_m: [-0.004, 0.009],
            least_m: 0.002,
        },
        Event::TipWithin {
            radius_m: 2e-3,
            body: Body::Lung,
        },
    ];
    let events = closer.chain(others).collect();
    (structures, Balls(balls), events)
}

const NEEDLE: Needle = Needle {
    depth_m: 0.09,
    throw_m: 0.01,
    radius_m: 0.6e-3,
};

fn asked(
    draws: Draws,
    ask: fn(&Case<'_, Balls>, &[Event], &Draws) -> Vec<Estimate>,
) -> Vec<Estimate> {
    let law = law();
    let (structures, balls, events) = scene();
    let case = Case::new(&law, NEEDLE, &structures, &balls).unwrap();
    ask(&case, &events, &draws)
}

const DRAWS: Draws = Draws {
    seed: 11,
    most: 20_000,
    threads: 1,
    moves: true,
};

#[test]
fn the_screen_changes_no_bit() {
    let screened = asked(DRAWS, |case, events, draws| {
        estimate(case, events, draws).unwrap()
    });
    let all = asked(DRAWS, |case, events, draws| {
        unscreened(case, events, draws).unwrap()
    });
    assert_eq!(screened, all);
    // Enough of them happen, and are sampled either way.
    let happening = screened.iter().filter(|each| each.hits > 0).count();
    assert!(happening >= 15, "{happening}");
}

#[test]
fn threads_change_no_bit() {
    let ask = |threads: usize| {
        asked(Draws { threads, ..DRAWS }, |case, events, draws| {
            estimate(case, events, draws).unwrap()
        })
    };
    let one = ask(1);
    for threads in [2, 3, 8] {
        assert_eq!(ask(threads), one, "{threads}");
    }
}

#[test]
fn an_estimate_does_not_depend_on_the_others() {
    let together = asked(DRAWS, |case, events, draws| {
        estimate(case, events, draws).unwrap()
    });
    let apart = asked(DRAWS, |case, events, draws| {
        let each = events.chunks(1);
        each.map(|event| estimate(case, event, draws).unwrap().remove(0))
            .collect()
    });
    assert_eq!(together, apart);
}
