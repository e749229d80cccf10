//! Registration against an independent computation, and its error against simulation.

use std::f64::consts::TAU;

use nalgebra::{Matrix3, Point3, UnitQuaternion, Vector3};
use needlebench_numerics::random::SplitMix64;

use super::*;
use crate::rotation_angle_between;

/// Rounding of some hundred operations on coordinates below 1 m.
const ROUNDING: f64 = 1e-14;

/// Relative difference that simulated and predicted TRE may have.
const TRE_SHARE: f64 = 0.03;

/// Worst seen with this many samples: 0.5 % of the rms, 0.9 % of the covariance.
const SAMPLES: usize = 40_000;

fn points(coordinates: &[[f64; 3]]) -> Vec<Point3<f64>> {
    coordinates.iter().map(|&each| each.into()).collect()
}

fn five_fiducials() -> Vec<Point3<f64>> {
    points(&[
        [0.0329, 0.1118, 0.0666],
        [0.1109, 0.0102, -0.1048],
        [0.0071, 0.0193, -0.0534],
        [0.0023, 0.0003, -0.0938],
        [0.0742, -0.0143, -0.0835],
    ])
}

/// Numpy's singular value decomposition (Kabsch), numpy 2: an algorithm that is not ours.
#[test]
fn registration_equals_kabsch_by_singular_values() {
    let from = five_fiducials();
    let to = points(&[
        [0.2658, -0.2874, 0.8996],
        [0.4188, -0.2724, 1.0494],
        [0.4124, -0.257, 0.9339],
        [0.4499, -0.2391, 0.9498],
        [0.4356, -0.285, 1.0064],
    ]);
    let rotation = Matrix3::new(
        -0.2872825580327023,
        -0.7784275243871647,
        -0.5581391592843646,
        -0.42222858589991535,
        0.6259500424240785,
        -0.655674893249888,
        0.8597626143879166,
        0.047298347389358265,
        -0.5084988822358324,
    );
    let translation = Vector3::new(
        0.39936765152391135,
        -0.30017592775236784,
        0.9001667104864615,
    );
    let fitted = register(&from, &to).unwrap();
    assert!((fitted.rotation.to_rotation_matrix().matrix() - rotation).amax() < ROUNDING);
    assert!((fitted.translation.vector - translation).amax() < ROUNDING);
    assert!((fre_rms_m(&fitted, &from, &to) - 0.0009047650304123377).abs() < ROUNDING);
}

/// Numpy's inverse of the information matrix of all six parameters about the origin.
#[test]
fn covariance_equals_the_inverse_of_the_information() {
    let at_m = Point3::new(0.03, 0.05, -0.11);
    let expected = Matrix3::new(
        4.569969562011076e-08,
        1.0022878114702334e-08,
        -3.6191721676364108e-09,
        1.0022878114702339e-08,
        3.0143069682455656e-08,
        3.122674791744391e-09,
        -3.619172167636408e-09,
        3.122674791744392e-09,
        1.9026240208901077e-08,
    );
    let found = tre_covariance(&five_fiducials(), &at_m, 0.0005).unwrap();
    assert!((found - expected).amax() < 1e-12 * expected.amax());
}

#[test]
fn trace_of_the_covariance_is_the_closed_form() {
    let fiducials = five_fiducials();
    let mut random = SplitMix64::new(3);
    for _ in 0..100 {
        let at_m = Point3::from(Vector3::from_fn(|_, _| random.uniform(-0.3, 0.3)));
        let rms_m = expected_tre_rms_m(&fiducials, &at_m, 7e-4).unwrap();
        let trace = tre_covariance(&fiducials, &at_m, 7e-4).unwrap().trace();
        assert!((trace / (rms_m * rms_m) - 1.0).abs() < 1e-12);
    }
}

/// Equilateral triangle at its centre: sqrt(1/3) of the FLE; four corners of a square, at a
/// distance `d` along the normal: `<TRE^2> = FLE^2/4 (1 + 1/3 (2 d^2/f^2))`, `f^2 = 1/2` of the
/// half diagonal squared.
#[test]
fn textbook_layouts_have_their_textbook_error() {
    let triangle: Vec<Point3<f64>> = (0..3)
        .map(|k| {
            let (sine, cosine) = libm::sincos(TAU * f64::from(k) / 3.0);
            Point3::new(0.05 * cosine, 0.05 * sine, 0.2)
        })
        .collect();
    let centre = expected_tre_rms_m(&triangle, &Point3::new(0.0, 0.0, 0.2), 1.0).unwrap();
    assert!((centre - (1.0_f64 / 3.0).sqrt()).abs() < 1e-12);

    let (half_m, d_m) = (0.06, 0.09);
    let square = points(&[
        [half_m, 0.0, 0.0],
        [0.0, half_m, 0.0],
        [-half_m, 0.0, 0.0],
        [0.0, -half_m, 0.0],
    ]);
    let found = expected_tre_rms_m(&square, &Point3::new(0.0, 0.0, d_m), 1.0).unwrap();
    let expected = (0.25 * (1.0 + 2.0 / 3.0 * d_m * d_m / (half_m * half_m / 2.0))).sqrt();
    assert!((found - expected).abs() < 1e-12);
}

#[test]
fn exact_points_are_registered_exactly() {
    let from = five_fiducials();
    let mut random = SplitMix64::new(5);
    for _ in 0..200 {
        let truth = random_pose(&mut random);
        let to: Vec<Point3<f64>> = from.iter().map(|point| truth * point).collect();
        let fitted = register(&from, &to).unwrap();
        assert!(rotation_angle_between(&fitted.rotation, &truth.rotation) < ROUNDING);
        let at_m = Point3::new(0.1, 0.2, 0.3);
        assert!(target_registration_error_m(&fitted, &truth, &at_m).norm() < ROUNDING);
    }
}

/// A needle guide's frame of four balls, markers round a chest, a flat triangle, a nearly straight
/// row: at the centroid, inside and outside.
#[test]
fn simulated_error_is_that_of_the_closed_form() {
    let layouts = [
        five_fiducials(),
        points(&[
            [0.0, 0.0, 0.0],
            [0.05, 0.0, 0.0],
            [0.0, 0.085, 0.0],
            [-0.03, 0.02, 0.025],
        ]),
        points(&[
            [-0.12, 0.0, 0.1],
            [0.12, 0.0, 0.1],
            [0.0, 0.09, 0.2],
            [-0.1, 0.07, -0.1],
            [0.1, 0.07, -0.1],
            [0.0, 0.1, 0.0],
        ]),
        points(&[[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.03, 0.08, 0.0]]),
        points(&[
            [-0.1, 0.003, 0.0],
            [-0.03, -0.004, 0.002],
            [0.04, 0.005, -0.003],
            [0.1, -0.004, 0.001],
        ]),
    ];
    let fle_rms_m = 0.2e-3;
    let mut random = SplitMix64::new(20_251_121);
    for (index, fiducials) in layouts.iter().enumerate() {
        let centroid = transform_covariance(fiducials, fle_rms_m).unwrap().0;
        let targets = [
            centroid,
            centroid + Vector3::new(0.02, -0.03, 0.04),
            centroid + Vector3::new(-0.05, 0.2, -0.1),
        ];
        let mut sum = [Matrix3::zeros(); 3];
        let mut fre_squared_m2 = 0.0;
        for _ in 0..SAMPLES {
            let truth = random_pose(&mut random);
            let to: Vec<Point3<f64>> = fiducials
                .iter()
                .map(|point| truth * point + fle_rms_m / 3.0_f64.sqrt() * normal(&mut random))
                .collect();
            let fitted = register(fiducials, &to).unwrap();
            fre_squared_m2 += fre_rms_m(&fitted, fiducials, &to).powi(2) / SAMPLES as f64;
            for (sum, target) in sum.iter_mut().zip(&targets) {
                let error_m = target_registration_error_m(&fitted, &truth, target);
                // In the axes of the fiducials, which turn from sample to sample.
                let error_m = truth.rotation.inverse() * error_m;
                *sum += error_m * error_m.transpose() / SAMPLES as f64;
            }
        }
        for (sum, target) in sum.iter().zip(&targets) {
            let predicted = tre_covariance(fiducials, target, fle_rms_m).unwrap();
            let rms_m = expected_tre_rms_m(fiducials, target, fle_rms_m).unwrap();
            let ratio = sum.trace().sqrt() / rms_m;
            assert!((ratio - 1.0).abs() < TRE_SHARE, "layout {index}: {ratio}");
            let difference = (sum - predicted).amax() / predicted.trace();
            assert!(difference < TRE_SHARE, "layout {index}: {difference}");
        }
        let predicted_m = expected_fre_rms_m(fiducials.len(), fle_rms_m).unwrap();
        let ratio = fre_squared_m2.sqrt() / predicted_m;
        assert!((ratio - 1.0).abs() < TRE_SHARE, "layout {index}: {ratio}");
        let fle_m = fle_rms_from_fre_m(fiducials.len(), predicted_m).unwrap();
        assert!((fle_m / fle_rms_m - 1.0).abs() < ROUNDING);
    }
}

#[test]
fn a_mirrored_planar_set_still_gets_a_proper_rotation() {
    let from = points(&[[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.03, 0.08, 0.0]]);
    let to: Vec<Point3<f64>> = from.iter().map(|p| Point3::new(-p.x, p.y, p.z)).collect();
    let fitted = register(&from, &to).unwrap();
    assert!(fre_rms_m(&fitted, &from, &to) < ROUNDING);
    assert!((fitted.rotation.to_rotation_matrix().matrix().determinant() - 1.0).abs() < ROUNDING);
}

#[test]
fn points_that_determine_nothing_are_refused() {
    let line = points(&[[0.0, 0.1, 0.2], [0.1, 0.1, 0.2], [0.35, 0.1, 0.2]]);
    let slanted: Vec<Point3<f64>> = (0..5)
        .map(|k| {
            Point3::from(
                Vector3::new(300.0, -200.0, 1.0)
                    + 0.1 * f64::from(k) * Vector3::new(1.0, 0.7, -0.3),
            )
        })
        .collect();
    let same = points(&[[0.1, 0.2, 0.3]; 4]);
    for points in [&line, &slanted, &same] {
        let refused = register(points, points);
        assert!(
            matches!(refused, Err(RegistrationError::Collinear { .. })),
            "{refused:?}"
        );
        let refused = tre_covariance(points, &Point3::origin(), 1e-4);
        assert!(
            matches!(refused, Err(RegistrationError::Collinear { .. })),
            "{refused:?}"
        );
    }
    let two = &five_fiducials()[..2];
    assert_eq!(
        register(two, two),
        Err(RegistrationError::TooFew { count: 2 })
    );
    assert_eq!(
        register(&five_fiducials(), two),
        Err(RegistrationError::Unmatched { from: 5, to: 2 })
    );
    let mut broken = five_fiducials();
    broken[3].y = f64::NAN;
    let refused = register(&five_fiducials(), &broken);
    assert!(matches!(
        refused,
        Err(RegistrationError::BadCoordinate {
            index: 3,
            axis: 'y',
            ..
        })
    ));
    let refused = tre_covariance(&five_fiducials(), &Point3::origin(), -1e-4);
    assert_eq!(
        refused,
        Err(RegistrationError::BadLocalisationError { fle_rms_m: -1e-4 })
    );
}

#[test]
fn the_mirror_image_of_a_regular_solid_is_ambiguous() {
    let from = points(&[
        [0.1, 0.1, 0.1],
        [0.1, -0.1, -0.1],
        [-0.1, 0.1, -0.1],
        [-0.1, -0.1, 0.1],
    ]);
    let to: Vec<Point3<f64>> = from.iter().map(|point| -point).collect();
    assert_eq!(register(&from, &to), Err(RegistrationError::Ambiguous));
}

fn random_pose(random: &mut SplitMix64) -> Pose {
    let q = normal(random).push(normal(random).x);
    let translation = Vector3::from_fn(|_, _| random.uniform(-1.0, 1.0));
    Pose::from_parts(
        translation.into(),
        UnitQuaternion::from_quaternion(q.into()),
    )
}

/// Three standard normal numbers.
fn normal(random: &mut SplitMix64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| random.standard_normal())
}
