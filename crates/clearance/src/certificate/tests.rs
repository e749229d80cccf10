//! Attempts to refute certificates by sampling, and the proof that the attempts can succeed.

use std::sync::Arc;

use needlebench_cell::{Cell, ClearanceClass};
use needlebench_geometry::{Shape, SolidMesh};
use needlebench_kinematics::Joints;
use needlebench_kinematics::trajectory::{JointTrajectory, Phase};
use needlebench_numerics::random::SplitMix64;

use super::motion::{Motion, RecordedMotion, Span};
use super::search;
use super::{
    CertificateOptions, ClassCertificate, MotionBound, MotionCertificate, certify, certify_enough,
};
use crate::model::{CLASS_COUNT, ClearanceModel};

#[path = "../../tests/clearance/common/motions.rs"]
mod motions;

use motions::{motions, shipped};

/// Random times per motion.
const SAMPLES: usize = 700;

/// Steps of the local search around the worst sample of each class.
const DESCENTS: usize = 60;

/// The distances' own error: certificates and samples come from the same solver.
const DISTANCE_M: f64 = 1e-9;

/// Least clearances that sampling finds, per class, with its time.
fn sampled(
    model: &ClearanceModel,
    motion: &impl Motion,
    certificate: &MotionCertificate,
    samples: usize,
    seed: u64,
) -> Vec<(ClassCertificate, f64)> {
    let mut random = SplitMix64::new(seed);
    let spans = motion.spans();
    let end_s = spans.last().expect("a motion has spans").end_s;
    let is_hold = |time_s: f64| {
        spans
            .iter()
            .any(|span| span.phase == Phase::Hold && span.start_s <= time_s)
    };
    let at = |time_s: f64, class: ClearanceClass| {
        if class == ClearanceClass::NeedleCorridor && !is_hold(time_s) {
            return f64::INFINITY;
        }
        let minima = model.minimum_per_class(&motion.position(time_s));
        minima
            .get(class)
            .map_or(f64::INFINITY, |found| found.separation.distance_m)
    };
    let mut least: Vec<(ClearanceClass, f64, f64)> = certificate
        .iter()
        .map(|(class, _)| (class, f64::INFINITY, 0.0))
        .collect();
    for _ in 0..samples {
        let time_s = random.uniform(0.0, end_s);
        let minima = model.minimum_per_class(&motion.position(time_s));
        for (class, least_m, least_s) in &mut least {
            let found = minima.get(*class).expect("certified classes have pairs");
            let counts = *class != ClearanceClass::NeedleCorridor || is_hold(time_s);
            if counts && found.separation.distance_m < *least_m {
                (*least_m, *least_s) = (found.separation.distance_m, time_s);
            }
        }
    }
    least
        .into_iter()
        .map(|(class, mut least_m, mut least_s)| {
            let mut step_s = 2.0 * end_s / samples as f64;
            for _ in 0..DESCENTS {
                let better = [least_s - step_s, least_s + step_s]
                    .map(|time_s| time_s.clamp(0.0, end_s))
                    .map(|time_s| (at(time_s, class), time_s))
                    .into_iter()
                    .min_by(|a, b| a.0.total_cmp(&b.0))
                    .expect("two of them");
                if better.0 < least_m {
                    (least_m, least_s) = better;
                } else {
                    step_s *= 0.6;
                }
            }
            let certified = certificate.get(class).expect("it was listed");
            (*certified, least_m)
        })
        .collect()
}

/// By how much a sample undercuts a bound at most, m; negative if none does.
fn refutation_m(found: &[(ClassCertificate, f64)]) -> f64 {
    found
        .iter()
        .map(|(certified, least_m)| certified.lower_bound_m - least_m)
        .fold(f64::NEG_INFINITY, f64::max)
}

/// What holds for every certificate that reached its tolerance.
fn check(
    model: &ClearanceModel,
    motion: &impl Motion,
    certificate: &MotionCertificate,
    tolerance_m: f64,
    seed: u64,
) {
    let found = sampled(model, motion, certificate, SAMPLES, seed);
    assert!(refutation_m(&found) < 0.0, "{}", refutation_m(&found));
    for (certified, least_m) in found {
        let class = certified.attained.class;
        let attained_m = certified.attained.separation.distance_m;
        assert!(certified.lower_bound_m < attained_m, "{class:?}");
        assert!(
            certified.width_m() <= tolerance_m + super::ROUNDING_M,
            "{class:?} {}",
            certified.width_m()
        );
        assert!(attained_m <= least_m + tolerance_m, "{class:?}");
        // What is said to be attained is, at that time.
        let minima = model.minimum_per_class(&motion.position(certified.time_s));
        let there_m = minima
            .get(class)
            .expect("the class has pairs")
            .separation
            .distance_m;
        assert!((there_m - attained_m).abs() < DISTANCE_M, "{class:?}");
    }
}

#[test]
fn no_sample_of_any_motion_is_below_its_certificate() {
    let options = CertificateOptions::default();
    let (mut checked, mut penetrating) = (0, 0);
    for (k, name) in [
        "table3.toml",
        "lateral.toml",
        "supine_suite.toml",
        // Hanging, among obstacles that are not all convex.
        "hanging.toml",
    ]
    .into_iter()
    .enumerate()
    {
        let resolved = shipped(name);
        let model = ClearanceModel::new(&resolved.cell);
        let rolls_rad = [0.4, 2.9];
        let all = motions(&resolved, &rolls_rad);
        // Evenly over goals, directions and configurations.
        let stride = all.len().div_ceil(20);
        for motion in all.iter().step_by(stride) {
            let certificate = certify(&model, motion, &options);
            check(&model, motion, &certificate, options.tolerance_m, k as u64);
            checked += 1;
            penetrating += usize::from(
                certificate
                    .iter()
                    .any(|(_, class)| class.attained.separation.distance_m < 0.0),
            );
        }
    }
    assert!(checked > 40, "{checked}");
    assert!(penetrating > 5, "{penetrating}");
}

#[test]
fn executed_motions_are_certified_with_their_tracking_errors() {
    let resolved = shipped("table3.toml");
    let model = ClearanceModel::new(&resolved.cell);
    let options = CertificateOptions::default();
    let mut random = SplitMix64::new(8);
    for trajectory in &motions(&resolved, &[])[..4] {
        let time_s: Vec<f64> = std::iter::successors(Some(0.0), |time_s| Some(time_s + 1e-3))
            .take_while(|time_s| *time_s < trajectory.duration_s() + 1e-3)
            .collect();
        // An oscillation of 5 mrad and a jitter of 0.02 mrad, far beyond what the engines show.
        let position = time_s
            .iter()
            .map(|&time_s| {
                trajectory.sample(time_s).position
                    + Joints::repeat(5e-3 * libm::sin(7.0 * time_s))
                    + Joints::from_fn(|_, _| random.uniform(-2e-5, 2e-5))
            })
            .collect();
        let motion = RecordedMotion::new(time_s, position, trajectory);
        let certificate = certify(&model, &motion, &options);
        check(&model, &motion, &certificate, options.tolerance_m, 9);
        let planned = certify(&model, trajectory, &options);
        let differs = certificate
            .iter()
            .zip(planned.iter())
            .any(|((_, one), (_, other))| one.lower_bound_m < other.lower_bound_m - 1e-3);
        assert!(differs, "the tracking error is part of it");
    }
}

/// A single joint swings the outstretched arm: a way without detours, on which bounds are tight.
fn swings(resolved: &needlebench_scenario::ResolvedScenario, count: usize) -> Vec<JointTrajectory> {
    let mut random = SplitMix64::new(17);
    (0..count)
        .map(|k| {
            let from = Joints::from_fn(|_, _| random.uniform(-3.0, 3.0));
            let mut to = from;
            to[k % 3] += random.uniform(0.5, 1.5);
            JointTrajectory::starting_at(from).then_straight_to(
                Phase::Transfer,
                to,
                &resolved.motion,
            )
        })
        .collect()
}

#[test]
fn lengths_that_are_too_short_are_refuted() {
    let resolved = shipped("table3.toml");
    let model = ClearanceModel::new(&resolved.cell);
    // Wide, so that intervals are long and what is wrong with their bounds shows.
    let options = CertificateOptions {
        tolerance_m: 0.02,
        ..CertificateOptions::default()
    };
    let swings = swings(&resolved, 40);
    let unlimited = [f64::INFINITY; CLASS_COUNT];
    let worst_m = |length_scale: f64| {
        swings
            .iter()
            .map(|motion| {
                let certificate =
                    search::certify(&model, motion, &options, &[], unlimited, length_scale);
                refutation_m(&sampled(&model, motion, &certificate, 60, 4))
            })
            .fold(f64::NEG_INFINITY, f64::max)
    };
    assert!(worst_m(1.0) < 0.0);
    let refuted_m = worst_m(0.8);
    assert!(refuted_m > 1e-6, "{refuted_m:e}");
}

/// Fineness of round solids as surfaces, m.
const CHORD_ERROR_M: f64 = 1e-3;

/// The same cell with every second solid drawn as a surface, whose box shows no plane by itself.
fn of_surfaces(mut cell: Cell) -> Cell {
    let solids = cell.bodies.iter_mut().flat_map(|body| &mut body.solids);
    for solid in solids.step_by(2) {
        let surface = solid.shape.surface(CHORD_ERROR_M);
        solid.shape = Shape::Mesh(Arc::new(SolidMesh::new(surface)));
    }
    cell
}

#[test]
fn no_sample_is_below_a_certificate_of_surfaces() {
    let options = CertificateOptions::default();
    let mut penetrating = 0;
    for name in ["table3.toml", "supine_suite.toml"] {
        let resolved = shipped(name);
        let model = ClearanceModel::new(&of_surfaces(resolved.cell.clone()));
        let all = motions(&resolved, &[0.4]);
        for motion in all.iter().step_by(all.len().div_ceil(5)) {
            let certificate = certify(&model, motion, &options);
            let found = sampled(&model, motion, &certificate, SAMPLES, 3);
            assert!(refutation_m(&found) < 0.0, "{}", refutation_m(&found));
            for (certified, _) in found {
                // The depth of surfaces jumps, so that a bound of it may stay wide.
                if certified.attained.separation.distance_m < 0.0 {
                    penetrating += 1;
                } else {
                    let width_m = certified.width_m();
                    assert!(
                        width_m <= options.tolerance_m + super::ROUNDING_M,
                        "{width_m}"
                    );
                }
            }
        }
    }
    assert!(penetrating > 0);
}

#[test]
fn lengths_that_are_too_short_are_refuted_between_surfaces() {
    let resolved = shipped("table3.toml");
    let model = ClearanceModel::new(&of_surfaces(resolved.cell.clone()));
    let options = CertificateOptions {
        tolerance_m: 0.02,
        ..CertificateOptions::default()
    };
    let swings = swings(&resolved, 20);
    let unlimited = [f64::INFINITY; CLASS_COUNT];
    let worst_m = |length_scale: f64| {
        let refuted = swings.iter().map(|motion| {
            let found = search::certify(&model, motion, &options, &[], unlimited, length_scale);
            refutation_m(&sampled(&model, motion, &found, 60, 4))
        });
        refuted.fold(f64::NEG_INFINITY, f64::max)
    };
    assert!(worst_m(1.0) < 0.0);
    let refuted_m = worst_m(0.7);
    assert!(refuted_m > 1e-6, "{refuted_m:e}");
}

#[test]
fn the_lipschitz_lemma_alone_agrees() {
    let resolved = shipped("table3.toml");
    let model = ClearanceModel::new(&resolved.cell);
    let options = CertificateOptions {
        tolerance_m: 1e-3,
        bound: MotionBound::Lipschitz,
    };
    for motion in &motions(&resolved, &[])[..3] {
        let certificate = certify(&model, motion, &options);
        check(&model, motion, &certificate, options.tolerance_m, 2);
    }
}

#[test]
fn positions_that_are_no_numbers_get_no_bound() {
    struct Broken;
    impl Motion for Broken {
        fn position(&self, time_s: f64) -> Joints {
            Joints::repeat(if time_s > 0.5 { f64::NAN } else { 0.1 })
        }
        fn chord_deviation(&self, _: f64, _: f64) -> Joints {
            Joints::zeros()
        }
        fn spans(&self) -> Vec<Span> {
            vec![Span {
                phase: Phase::Transfer,
                start_s: 0.0,
                end_s: 1.0,
            }]
        }
    }
    let model = ClearanceModel::new(&shipped("table3.toml").cell);
    let certificate = certify(&model, &Broken, &CertificateOptions::default());
    assert!(certificate.iter().count() > 3);
    for (class, found) in certificate.iter() {
        assert_eq!(found.lower_bound_m, f64::NEG_INFINITY, "{class:?}");
    }
}

#[test]
fn what_is_enough_is_proven_and_what_is_nearer_is_known() {
    let resolved = shipped("table3.toml");
    let model = ClearanceModel::new(&resolved.cell);
    let options = CertificateOptions::default();
    let (mut nearer, mut farther) = (0, 0);
    for motion in &swings(&resolved, 12) {
        let whole = certify(&model, motion, &options);
        for enough_m in [0.0, 0.02, 0.1] {
            let part = certify_enough(&model, motion, &options, |_| enough_m);
            for (class, known) in whole.iter() {
                let found = part.get(class).unwrap();
                let least_m = known.attained.separation.distance_m;
                // Two proofs of the same motion: no bound is above what the other has seen.
                assert!(found.lower_bound_m <= least_m);
                assert!(found.lower_bound_m >= least_m.min(enough_m) - 2.0 * options.tolerance_m);
                if least_m < enough_m - options.tolerance_m {
                    nearer += 1;
                    let attained_m = found.attained.separation.distance_m;
                    assert!((attained_m - least_m).abs() <= options.tolerance_m);
                } else {
                    farther += 1;
                }
            }
            assert!(part.effort.distances <= whole.effort.distances);
        }
    }
    assert!(nearer > 5 && farther > 5, "{nearer} {farther}");
}

#[test]
fn certificates_of_two_motions_together_say_what_the_nearer_one_does() {
    let resolved = shipped("table3.toml");
    let model = ClearanceModel::new(&resolved.cell);
    let options = CertificateOptions::default();
    let swings = swings(&resolved, 2);
    let [one, two] = [0, 1].map(|k| certify(&model, &swings[k], &options));
    let later = two.clone().later_by(3.0);
    let both = one.clone().and(&later);
    for (class, found) in both.iter() {
        let (a, b) = (one.get(class).unwrap(), later.get(class).unwrap());
        let nearer = if b.attained.separation.distance_m < a.attained.separation.distance_m {
            b
        } else {
            a
        };
        assert_eq!(found.attained, nearer.attained);
        assert_eq!(found.time_s.to_bits(), nearer.time_s.to_bits());
        let least_m = a.lower_bound_m.min(b.lower_bound_m);
        assert_eq!(found.lower_bound_m.to_bits(), least_m.to_bits());
        assert!((two.get(class).unwrap().time_s + 3.0 - b.time_s).abs() < 1e-12);
    }
}
