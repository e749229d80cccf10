//! Whether the stated errors of a lesion's centre are true: against simulated nodules.
//!
//! The true centre is the centroid of the nodule's solid on the lung's side of the wall, without the vessels that lead to
//! it. The shares in `segment/lesion/accuracy.rs` are from the seeds from 2000 to 2260 and from 7000 to 7300
//! of [`usual`], that for ground glass from those from 11000 to 11300; no test here draws these.

mod simulator;

use std::ops::Range;
use std::sync::atomic::AtomicBool;

use nalgebra::Vector3;
use needlebench_imaging::{MeasuredLesion, ReconstructOptions, reconstruct};
use needlebench_parallel::in_parallel;

use simulator::{Case, Population, Slices};

fn slices(thickness_mm: f64, increment_mm: f64) -> Slices {
    Slices {
        thickness_mm,
        increment_mm,
    }
}

/// Nodules as the shares were measured on.
fn usual() -> Population {
    Population {
        slices: vec![
            slices(1.0, 1.0),
            slices(1.0, 0.7),
            slices(2.5, 2.5),
            slices(2.5, 1.25),
            slices(5.0, 5.0),
            slices(5.0, 2.5),
        ],
        diameters_mm: [6.0, 30.0],
        vessels: [0, 3],
        walls: 0.3,
        ground_glass: 0.2,
        most_elongated: 1.3,
        lobulated: 0.4,
    }
}

/// Others: longer, each with two vessels, in slices of 3 mm.
fn longer() -> Population {
    Population {
        slices: vec![slices(3.0, 3.0), slices(3.0, 1.5)],
        vessels: [2, 2],
        most_elongated: 1.8,
        lobulated: 0.0,
        ..usual()
    }
}

/// A nodule and what came out for it.
struct Outcome {
    seed: u64,
    case: Case,
    /// Error of the centre in m, and its squared distance by the stated covariance; none if there is no goal.
    error: Option<(Vector3<f64>, f64)>,
    /// What is said of it.
    words: String,
}

fn outcome(case: Case, seed: u64) -> Outcome {
    let volume = case.volume();
    let options = ReconstructOptions {
        lesions: vec![case.seed()],
        ..ReconstructOptions::default()
    };
    let made = reconstruct(&volume, &options, 1, &AtomicBool::new(false), &|_, _| {}).unwrap();
    let Some(MeasuredLesion {
        lesion,
        size: Some(size),
    }) = made.lesions.first()
    else {
        return Outcome {
            seed,
            case,
            error: None,
            words: format!("{:?}", made.not_grown),
        };
    };
    let error = size.centroid_m - case.true_centre_m();
    let squared = size
        .centroid_covariance_m2
        .cholesky()
        .map_or(f64::INFINITY, |root| error.dot(&root.solve(&error)));
    let sigma_mm = size
        .centroid_covariance_m2
        .diagonal()
        .map(|it| 1e3 * it.sqrt());
    Outcome {
        seed,
        case,
        error: Some((error, squared)),
        words: format!(
            "sd {:.3} {:.3} {:.3} mm, wall {}, vessels {}, leaked {}, {:.1} mm",
            sigma_mm.x,
            sigma_mm.y,
            sigma_mm.z,
            lesion.cut_at_wall,
            lesion.cut_at_vessels,
            lesion.leaked,
            1e3 * size.equivalent_diameter_m
        ),
    }
}

fn outcomes(population: &Population, seeds: Range<u64>) -> Vec<Outcome> {
    let seeds: Vec<u64> = seeds.collect();
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    in_parallel(threads, &seeds, |&seed| {
        outcome(population.draw(seed), seed)
    })
}

/// 95 % of a normal distribution in three dimensions are within this squared distance.
const WITHIN: f64 = 7.814_727_9;

/// Number of those that are wanted, share of true centres in the stated ellipsoid, and rms error in mm.
fn share(all: &[Outcome], wanted: impl Fn(&Case) -> bool) -> (usize, f64, f64) {
    let some: Vec<&Outcome> = all.iter().filter(|each| wanted(&each.case)).collect();
    let found = || some.iter().filter_map(|each| each.error);
    let within = found().filter(|(_, squared)| *squared <= WITHIN).count();
    let mut errors: Vec<f64> = found().map(|(error, _)| 1e3 * error.norm()).collect();
    errors.sort_by(f64::total_cmp);
    let median = errors.get(errors.len() / 2).copied().unwrap_or(f64::NAN);
    (some.len(), within as f64 / some.len().max(1) as f64, median)
}

type Stratum = (&'static str, fn(&Case) -> bool);

const STRATA: [Stratum; 11] = [
    ("all", |_| true),
    ("slices of 1 mm", |it| it.slices.thickness_mm < 2.0),
    ("slices of 2.5 or 3 mm", |it| {
        (2.0..4.0).contains(&it.slices.thickness_mm)
    }),
    ("slices of 5 mm", |it| it.slices.thickness_mm > 4.0),
    ("overlapping slices", |it| {
        it.slices.increment_mm < it.slices.thickness_mm
    }),
    ("with vessels", Case::has_vessels),
    ("without vessels", |it| !it.has_vessels()),
    ("at a wall", |it| it.at_wall),
    ("at no wall", |it| !it.at_wall),
    ("ground glass", Case::is_ground_glass),
    ("below 10 mm", |it| it.diameter_mm < 10.0),
];

/// Prints the strata of a population, and refuses a share of all that is not 95 +- 3 %, and a stratum of more than 20 below
/// 88 %.
fn judge(population: &str, all: &[Outcome]) {
    for each in all {
        let Some((error, squared)) = each.error else {
            println!("{} no goal: {}", each.seed, each.words);
            continue;
        };
        let mm = error * 1e3;
        if squared > WITHIN || std::env::var_os("ALL").is_some() {
            println!(
                "{} {:.1} mm {:.0} HU, {} of {} mm: {:.3} {:.3} {:.3} mm off, {squared:.1}: {}",
                each.seed,
                each.case.diameter_mm,
                each.case.nodule_hu,
                each.case.slices.increment_mm,
                each.case.slices.thickness_mm,
                mm.x,
                mm.y,
                mm.z,
                each.words
            );
        }
    }
    let rows = STRATA.map(|(name, wanted)| (name, share(all, wanted)));
    for (name, (count, share, median_mm)) in rows {
        println!(
            "{name:<24} {count:>4} {:>6.1} % median {median_mm:.3} mm",
            1e2 * share
        );
    }
    let [(_, (_, of_all, _)), ..] = rows;
    println!(
        "{} {population} nodules: {:.1} % of the true centres in the stated ellipsoid of 95 %",
        all.len(),
        1e2 * of_all
    );
    assert!((0.92..=0.98).contains(&of_all), "{of_all}");
    for (name, (count, share, _)) in rows {
        assert!(count < 20 || share >= 0.88, "{name}: {share}");
    }
}

/// By the check `nodules` of the evidence: 2 s of a core for each nodule, in release mode.
#[test]
#[ignore = "ten minutes of a core: .ci/run nodules"]
fn three_hundred_true_centres_are_as_near_as_stated() {
    judge("usual", &outcomes(&usual(), 15_000..15_300));
}

#[test]
#[ignore = "three minutes of a core: .ci/run nodules"]
fn centres_of_longer_nodules_are_as_near_as_stated() {
    judge("longer", &outcomes(&longer(), 9000..9100));
}

/// A few of each, for every run of the tests.
#[test]
fn some_true_centres_are_as_near_as_stated() {
    let all = outcomes(&usual(), 500..512);
    let (count, share, median_mm) = share(&all, |_| true);
    assert!(share * count as f64 >= 10.0, "{share}");
    assert!(median_mm < 0.3, "{median_mm}");
}

#[test]
fn ground_glass_without_vessels_is_a_goal() {
    let glass = Population {
        slices: vec![slices(2.5, 2.5)],
        diameters_mm: [12.0, 14.0],
        vessels: [0, 0],
        walls: 0.0,
        ground_glass: 1.0,
        ..usual()
    };
    let [one] = &outcomes(&glass, 1..2)[..] else {
        panic!("one");
    };
    let (error, _) = one.error.unwrap();
    assert!(
        one.case.is_ground_glass() && error.norm() < 0.2e-3,
        "{error}"
    );
}

/// Larger than the reach of the first look, and than the ball that carries on the wall. A seed within 10 mm of the wall is
/// refused where the mass is half in it: a ball of 90 mm loses that cap.
#[test]
#[ignore = "two large volumes"]
fn a_mass_of_70_mm_at_the_wall_is_a_goal() {
    let masses = Population {
        slices: vec![slices(2.5, 2.5)],
        diameters_mm: [69.0, 71.0],
        vessels: [1, 1],
        walls: 1.0,
        ground_glass: 0.0,
        ..usual()
    };
    let deep = (1..20).filter(|&seed| masses.draw(seed).seed_depth_mm() > 12.0);
    let seeds: Vec<u64> = deep.take(2).collect();
    for each in seeds.iter().map(|&seed| outcome(masses.draw(seed), seed)) {
        let Some((error, squared)) = each.error else {
            panic!("{} {:?}", each.words, each.case);
        };
        println!(
            "{} {:.1} {squared:.1}: {}",
            each.seed,
            error * 1e3,
            each.words
        );
        assert!(
            error.norm() < 6e-3 && each.words.contains("leaked false"),
            "{}",
            each.words
        );
    }
}
