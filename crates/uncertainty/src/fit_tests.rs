//! Errors of weighted fits against the closed form, against the fit's own covariance, and against simulation.

use needlebench_kinematics::registration::{expected_tre_rms_m, tre_covariance};
use needlebench_numerics::random::NormalPairs;

use super::*;

/// Rounding of inverses of information over a layout of 0.1 m.
const ROUNDING: f64 = 1e-12;

fn places_m() -> Vec<Point3<f64>> {
    [
        [-0.110, -0.090, -0.090],
        [0.110, -0.090, -0.090],
        [-0.130, -0.070, 0.080],
        [0.130, -0.070, 0.080],
        [0.0, -0.115, -0.120],
        [0.0, -0.110, 0.110],
    ]
    .map(Point3::from)
    .to_vec()
}

fn markers(covariances_m2: Vec<Matrix3<f64>>) -> Markers {
    Markers {
        places_m: places_m(),
        localisation: Localisation::Measured { covariances_m2 },
    }
}

/// Standard deviations of millimetres that differ by marker, three of them wide along the slices and turned: large
/// enough for what is of second order to show.
fn uneven() -> Vec<Matrix3<f64>> {
    (0..6)
        .map(|k| {
            let wide = if k < 3 { 4e-3 } else { 1e-3 };
            let spread = Vector3::new(1e-3, 0.5e-3, wide).map(|each| each * each);
            let turn = nalgebra::Rotation3::from_euler_angles(0.4 * f64::from(k), 0.3, 0.0);
            turn * Matrix3::from_diagonal(&spread) * turn.inverse()
        })
        .collect()
}

const TARGET_M: [f64; 3] = [0.06, 0.02, -0.03];

fn covariance_at(fit: &FitError, point: &Point3<f64>) -> Matrix3<f64> {
    let moves = fit.moves_at(point);
    moves * fit.covariance() * moves.transpose()
}

#[test]
fn equal_isotropic_covariances_give_the_closed_form_of_fitzpatrick_and_west() {
    let fle_rms_m = 0.7e-3;
    let equal = Matrix3::from_diagonal_element(fle_rms_m * fle_rms_m / 3.0);
    let target = Point3::from(TARGET_M);
    let found = FitError::of_localisation(&markers(vec![equal; 6])).unwrap();
    let closed = tre_covariance(&places_m(), &target, fle_rms_m).unwrap();
    let off = (covariance_at(&found, &target) - closed).norm() / closed.norm();
    assert!(off < ROUNDING, "{off:e}");
    let rms_m = expected_tre_rms_m(&places_m(), &target, fle_rms_m).unwrap();
    let trace_m = covariance_at(&found, &target).trace().sqrt();
    assert!((trace_m / rms_m - 1.0).abs() < ROUNDING);
    // And the mean that the closed form has.
    let unweighted = FitError::unweighted(&markers(vec![equal; 6]), fle_rms_m).unwrap();
    let off_m = (found.mean_at(&target) - unweighted.mean_at(&target)).norm();
    assert!(
        off_m < ROUNDING * unweighted.mean_at(&target).norm(),
        "{off_m:e}"
    );
}

#[test]
fn covariance_is_that_of_the_weighted_fit_itself() {
    let (found, target) = (
        FitError::of_localisation(&markers(uneven())).unwrap(),
        Point3::from(TARGET_M),
    );
    let exact: Vec<Localised> = places_m()
        .into_iter()
        .map(|at_m| Localised::isotropic(at_m, 0.0))
        .collect();
    let seen: Vec<Localised> = places_m()
        .into_iter()
        .zip(uneven())
        .map(|(at_m, covariance_m2)| Localised {
            at_m,
            covariance_m2,
        })
        .collect();
    let fit = register_weighted(&exact, &seen).unwrap();
    let stated = fit.tre_covariance(&target);
    let off = (covariance_at(&found, &target) - stated).norm() / stated.norm();
    assert!(off < ROUNDING, "{off:e}");
}

/// Rows of the simulations: a mean of second order (tens of micrometres here) has to stand out of errors of millimetres.
const DRAWS: usize = 20_000;

/// Error of a covariance from that many rows: four times `sqrt(2 / DRAWS)`, and what first order leaves out: the square
/// of errors of millimetres over a decimetre.
const COVARIANCE: f64 = 0.04 + 0.01;

/// What the third and fourth order leave of the mean: the square of errors of millimetres over a decimetre, as a share.
const HIGHER_ORDERS: f64 = 0.05;

/// Mean and covariance at the target of simulated fits, each drawn row beside its mirror image: their mean has no error of
/// first order.
fn simulated(
    markers: &Markers,
    off_m: impl Fn(&[f64]) -> Vec<Vector3<f64>>,
) -> (Vector3<f64>, Matrix3<f64>, f64) {
    let target = Point3::from(TARGET_M);
    let mut random = NormalPairs::new(5);
    let error_m = |off_m: &[Vector3<f64>], sign: f64| {
        let own = markers.places_m.iter();
        let seen: Vec<_> = own.zip(off_m).map(|(at, off)| at + off * sign).collect();
        target - fitted(markers, &seen).unwrap().inverse() * target
    };
    let (mut mean, mut square, mut scatter) = (Vector3::zeros(), 0.0, Matrix3::zeros());
    for _ in 0..DRAWS / 2 {
        let values: Vec<f64> = (0..3 * markers.places_m.len())
            .map(|_| random.next_normal())
            .collect();
        let off_m = off_m(&values);
        let both = [1.0, -1.0].map(|sign| error_m(&off_m, sign));
        let middle = (both[0] + both[1]) * 0.5;
        mean += middle;
        square += middle.norm_squared();
        for each in both {
            scatter += each * each.transpose();
        }
    }
    let pairs = (DRAWS / 2) as f64;
    let mean = mean / pairs;
    let standard_error = ((square / pairs - mean.norm_squared()) / pairs).sqrt();
    (mean, scatter / (2.0 * pairs), standard_error)
}

fn agrees(found: &FitError, (mean, scatter, standard_error): (Vector3<f64>, Matrix3<f64>, f64)) {
    let target = Point3::from(TARGET_M);
    let covariance = covariance_at(found, &target);
    let off = (scatter - covariance).norm() / covariance.norm();
    let expected = found.mean_at(&target);
    println!(
        "covariance off by {off:.4}; mean {mean:e}, expected {expected:e}, +- {standard_error:e}"
    );
    assert!(off < COVARIANCE, "{off}");
    assert!(
        expected.norm() > 10.0 * standard_error,
        "the mean does not stand out"
    );
    let allowed_m = 4.0 * standard_error + HIGHER_ORDERS * expected.norm();
    assert!((mean - expected).norm() < allowed_m);
}

#[test]
fn simulated_fits_have_the_covariance_and_the_mean_of_second_order() {
    let markers = markers(uneven());
    let found = FitError::of_localisation(&markers).unwrap();
    agrees(
        &found,
        simulated(&markers, |values| seen_off_m(&markers, values)),
    );
}

/// Markers that moved otherwise than the fit assumes: its weights are wrong then, and what it leaves goes with its
/// turn.
#[test]
fn simulated_fits_of_shifted_markers_do_as_well() {
    let shift_m = 3e-3;
    let markers = markers(uneven());
    let found = FitError::of_shifts(&markers, shift_m).unwrap();
    let shifts = |values: &[f64]| {
        let each = values.chunks_exact(3).map(Vector3::from_column_slice);
        each.map(|values| values * shift_m).collect()
    };
    agrees(&found, simulated(&markers, shifts));
}
