//! The weighted fit against the unweighted one, against Fitzpatrick and West, and its covariance against simulation.

use nalgebra::{Matrix3, Point3, UnitQuaternion, Vector3};
use needlebench_numerics::random::NormalPairs;

use super::super::{expected_tre_rms_m, tre_covariance};
use super::*;

/// Rounding of some rounds on coordinates below 1 m.
const ROUNDING: f64 = 1e-13;

/// What simulated and predicted TRE may differ by; 0.9 % is the worst seen.
const TRE_SHARE: f64 = 0.05;

const SAMPLES: usize = 4_000;

fn layout() -> Vec<Point3<f64>> {
    [
        [-0.05, -0.09, 0.091],
        [0.07, -0.08, 0.078],
        [-0.10, -0.05, 0.034],
        [0.11, -0.04, 0.009],
        [0.02, -0.10, -0.071],
        [-0.07, -0.08, -0.048],
    ]
    .map(Point3::from)
    .to_vec()
}

fn pose() -> Pose {
    let rotation = UnitQuaternion::from_euler_angles(0.4, -0.7, 1.9);
    Pose::from_parts(Translation3::new(0.3, -0.2, 0.5), rotation)
}

/// Slices: five times worse along z than across; a tip's reach: worst along one direction that differs by marker.
fn slices_and_reach(count: usize) -> (Vec<Matrix3<f64>>, Vec<Matrix3<f64>>) {
    let slices = Matrix3::from_diagonal(&Vector3::new(2e-5, 2e-5, 1e-4).map(|s| s * s));
    let reach = (0..count)
        .map(|k| {
            let along = UnitQuaternion::from_euler_angles(k as f64, 0.5 * k as f64, 0.0);
            let turn = along.to_rotation_matrix();
            let spread = Vector3::new(3e-4, 1e-4, 5e-5).map(|s| s * s);
            turn * Matrix3::from_diagonal(&spread) * turn.transpose()
        })
        .collect();
    (vec![slices; count], reach)
}

fn drawn(random: &mut NormalPairs, covariance: &Matrix3<f64>) -> Vector3<f64> {
    let root = covariance.cholesky().unwrap().l();
    root * Vector3::from_fn(|_, _| random.next_normal())
}

fn localised(points: &[Point3<f64>], covariances: &[Matrix3<f64>]) -> Vec<Localised> {
    points
        .iter()
        .zip(covariances)
        .map(|(&at_m, &covariance_m2)| Localised {
            at_m,
            covariance_m2,
        })
        .collect()
}

#[test]
fn equal_isotropic_weights_give_the_unweighted_fit_and_fitzpatrick_and_wests_error() {
    let mut random = NormalPairs::new(3);
    let sigma_m = 2e-4;
    let from = layout();
    let noise = Matrix3::from_diagonal_element(sigma_m * sigma_m);
    let to: Vec<_> = from
        .iter()
        .map(|p| pose() * p + drawn(&mut random, &noise))
        .collect();
    let with = |points: &[Point3<f64>], sigma_m| -> Vec<Localised> {
        points
            .iter()
            .map(|&p| Localised::isotropic(p, sigma_m))
            .collect()
    };
    let fit = register_weighted(&with(&from, 0.0), &with(&to, sigma_m)).unwrap();
    let plain = register(&from, &to).unwrap();
    assert!((fit.to_from_from.translation.vector - plain.translation.vector).amax() < ROUNDING);
    assert!(fit.to_from_from.rotation.angle_to(&plain.rotation) < 1e-7);

    // The closed form knows the layout of one set; ours linearises at the fitted one, which is the same up to the noise.
    let target = Point3::new(0.03, 0.04, -0.02);
    let closed = expected_tre_rms_m(&from, &target, sigma_m * 3.0_f64.sqrt()).unwrap();
    let ours = fit.tre_covariance(&target).trace().sqrt();
    assert!((ours / closed - 1.0).abs() < 1e-9, "{ours} {closed}");
    let turn = pose().rotation.to_rotation_matrix();
    let closed = tre_covariance(&from, &target, sigma_m * 3.0_f64.sqrt()).unwrap();
    let closed = turn * closed * turn.transpose();
    assert!((fit.tre_covariance(&target) - closed).amax() < 0.02 * closed.amax());
}

#[test]
fn predicted_error_of_anisotropic_fits_is_the_simulated_one() {
    let from = layout();
    let (slices, reach) = slices_and_reach(from.len());
    let target = Point3::new(0.02, 0.05, -0.03);
    let mut random = NormalPairs::new(11);
    let mut seen = Matrix3::zeros();
    let (mut chi_square, mut fre, mut own_error, mut foretold) = (0.0, 0.0, 0.0, 0.0);
    let mut last = None;
    for _ in 0..SAMPLES {
        let a: Vec<_> = from
            .iter()
            .zip(&slices)
            .map(|(p, c)| p + drawn(&mut random, c))
            .collect();
        let b: Vec<_> = from
            .iter()
            .zip(&reach)
            .map(|(p, c)| pose() * p + drawn(&mut random, c))
            .collect();
        let (a, b) = (localised(&a, &slices), localised(&b, &reach));
        let fit = register_weighted(&a, &b).unwrap();
        let error = fit.to_from_from * target - pose() * target;
        seen += error * error.transpose() / SAMPLES as f64;
        chi_square += fit.chi_square / SAMPLES as f64;
        fre += fit.fre_rms_and_expected_m().0.powi(2) / SAMPLES as f64;
        own_error += fit.residuals[2].error_m.norm_squared() / SAMPLES as f64;
        if last.is_none() {
            foretold = leave_one_out(&a, &b)[2].unwrap().chi_square;
        }
        last = Some(fit);
    }
    assert!(foretold < 20.0, "{foretold}");
    let fit = last.unwrap();
    let predicted = fit.tre_covariance(&target);
    let ratio = (seen.trace() / predicted.trace()).sqrt();
    println!("TRE simulated over predicted {ratio:.4}, chi-square {chi_square:.3} of 12");
    assert!((ratio - 1.0).abs() < TRE_SHARE, "{ratio}");
    assert!((seen - predicted).amax() < 2.0 * TRE_SHARE * predicted.amax());
    // Five standard errors of the mean of chi-squares.
    assert!((chi_square - 12.0).abs() < 5.0 * (24.0 / SAMPLES as f64).sqrt());
    let expected = fit.fre_rms_and_expected_m().1;
    assert!((fre.sqrt() / expected - 1.0).abs() < TRE_SHARE);
    let own = fit.residuals[2].covariance_m2.trace();
    assert!((own_error / own - 1.0).abs() < 2.0 * TRE_SHARE);
}

#[test]
fn a_marker_without_z_helps_across_and_does_not_harm() {
    let from = layout();
    let (mut slices, reach) = slices_and_reach(from.len());
    let target = Point3::new(0.02, 0.05, -0.03);
    let to: Vec<_> = from.iter().map(|p| pose() * p).collect();
    let known = register_weighted(&localised(&from, &slices), &localised(&to, &reach)).unwrap();
    slices[0][(2, 2)] = 2e-3_f64.powi(2);
    let mut moved = from.clone();
    moved[0].z += 2e-3;
    let open = register_weighted(&localised(&moved, &slices), &localised(&to, &reach)).unwrap();
    let without = register_weighted(
        &localised(&from[1..], &slices[1..]),
        &localised(&to[1..], &reach[1..]),
    )
    .unwrap();
    let rms_m = |fit: &WeightedFit| fit.tre_covariance(&target).trace().sqrt();
    assert!(rms_m(&known) < rms_m(&open) && rms_m(&open) < rms_m(&without));
    let off_m = (open.to_from_from * target - pose() * target).norm();
    assert!(off_m < rms_m(&open), "{off_m}");
    let unweighted = register(&moved, &to).unwrap();
    assert!((unweighted * target - pose() * target).norm() > 5.0 * off_m);
}

#[test]
fn leaving_out_points_at_the_one_that_moved() {
    let from = layout();
    let (slices, reach) = slices_and_reach(from.len());
    let mut to: Vec<_> = from.iter().map(|p| pose() * p).collect();
    to[3] += Vector3::new(1e-3, 1e-3, -1e-3);
    let left = leave_one_out(&localised(&from, &slices), &localised(&to, &reach));
    let each: Vec<f64> = left.iter().map(|r| r.unwrap().chi_square).collect();
    assert!(each[3] > 30.0, "{each:?}");
    assert!((left[3].unwrap().error_m + Vector3::new(1e-3, 1e-3, -1e-3)).norm() < 1e-9);
    assert!(each.iter().enumerate().all(|(k, &c)| k == 3 || c < each[3]));
    let three = leave_one_out(
        &localised(&from[..3], &slices[..3]),
        &localised(&to[..3], &reach[..3]),
    );
    assert_eq!(three, vec![None; 3]);
}

#[test]
fn covariances_that_are_none_are_refused() {
    let from = layout();
    let to: Vec<_> = from.iter().map(|p| pose() * p).collect();
    let exact = vec![Matrix3::zeros(); 6];
    let mut bad = vec![Matrix3::identity() * 1e-8; 6];
    let fit = |a: &[Matrix3<f64>], b: &[Matrix3<f64>]| {
        register_weighted(&localised(&from, a), &localised(&to, b)).unwrap_err()
    };
    assert_eq!(
        fit(&exact, &exact),
        RegistrationError::BadCovariance { index: 0 }
    );
    bad[4][(1, 1)] = f64::NAN;
    assert_eq!(
        fit(&exact, &bad),
        RegistrationError::BadCovariance { index: 4 }
    );
    bad[4][(1, 1)] = -1e-8;
    assert_eq!(
        fit(&exact, &bad),
        RegistrationError::BadCovariance { index: 4 }
    );
    let mut open = vec![Matrix3::identity() * 1e-8; 6];
    for covariance in &mut open {
        covariance[(2, 2)] = 1e12;
    }
    assert_eq!(fit(&exact, &open), RegistrationError::Undetermined);
}
