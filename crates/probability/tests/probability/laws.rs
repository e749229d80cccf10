//! Draws of a law have its moments, and are the same for every law.

use nalgebra::{Matrix6, Vector2, Vector3, Vector6};
use needlebench_probability::{Bend, BendDirection, Body, Hold, Law, draw};

use crate::common::{correlated, failing, linear, part, quadratic};

const DRAWS: u64 = 100_000;

/// Five standard errors of a mean and of a covariance of so many draws, relative to the standard deviation.
fn tolerance() -> f64 {
    5.0 / (DRAWS as f64).sqrt()
}

#[test]
fn entry_and_tip_have_their_mean_and_covariance() {
    let mean = Vector6::new(1e-3, -2e-3, 0.5e-3, 0.0, 1e-3, 2e-3);
    // One axis of the tip does not move at all.
    let covariance = correlated([0.9e-3, 0.5e-3, 0.7e-3], [1.3e-3, 0.0, 1e-3], 0.6);
    let law = linear(mean, &covariance);
    let mut sum = Vector6::zeros();
    let mut squares = Matrix6::zeros();
    for index in 0..DRAWS {
        let found = draw(&law, 3, index);
        let mut off = Vector6::zeros();
        off.fixed_rows_mut::<3>(0).copy_from(&found.entry_m);
        off.fixed_rows_mut::<3>(3).copy_from(&found.tip_m);
        sum += off - mean;
        squares += (off - mean) * (off - mean).transpose();
    }
    let sd = covariance.diagonal().map(f64::sqrt);
    let count = DRAWS as f64;
    for row in 0..6 {
        assert!(
            (sum[row] / count).abs() <= tolerance() * sd[row] + 1e-15,
            "{row}"
        );
        for column in 0..6 {
            let off = squares[(row, column)] / count - covariance[(row, column)];
            // The variance of a product of two normal variables is at most twice that of independent ones.
            let allowed = 2.0_f64.sqrt() * tolerance() * sd[row] * sd[column] + 1e-18;
            assert!(off.abs() <= allowed, "{row} {column}: {off:e}");
        }
    }
}

/// sin^4 of a uniform phase has mean 3/8 and mean square 35/128.
#[test]
fn failed_holds_have_the_moments_of_sin_4_and_their_weight() {
    let full = Vector3::new(1e-3, -6e-3, 3e-3);
    let level = Vector3::new(0.0, 0.4e-3, 0.0);
    let covariance = correlated([1e-3; 3], [1e-3; 3], 0.0);
    let holds = failing(level, full);
    let law = Law::new(
        Vector6::zeros(),
        vec![part("arm", &covariance)],
        None,
        holds,
    )
    .unwrap();
    let (mut sum, mut squares) = (0.0, 0.0);
    for index in 0..DRAWS {
        let moved =
            draw(&law, 4, index).breath_m[Body::Lung as usize].dot(&full) / full.norm_squared();
        sum += moved;
        squares += moved * moved;
    }
    let count = DRAWS as f64;
    let level_square = (level.dot(&full) / full.norm_squared()).powi(2);
    let (mean, square) = (0.05 * 0.375, level_square + 0.05 * 35.0 / 128.0);
    // Standard errors from the moments of second and fourth order, of which sin^16 has the mean 6435/32768.
    let error = (square / count).sqrt();
    assert!((sum / count - mean).abs() < 5.0 * error, "{}", sum / count);
    let fourth = 0.05 * 6435.0 / 32768.0 + 6.0 * 0.05 * level_square + 3.0 * level_square.powi(2);
    assert!((squares / count - square).abs() < 5.0 * (fourth / count).sqrt());
}

#[test]
fn bends_turn_as_they_are_known() {
    let covariance = correlated([1e-3; 3], [1e-3; 3], 0.0);
    let law = |direction| {
        let bend = Some(quadratic(1e-3, direction));
        Law::new(
            Vector6::zeros(),
            vec![part("arm", &covariance)],
            bend,
            Vec::new(),
        )
        .unwrap()
    };
    let spread_rad = 0.4;
    let known = law(BendDirection::Known { spread_rad });
    let unknown = law(BendDirection::Unknown);
    // Mean cosine of the turn: exp(-s^2 / 2), and 0.
    for (law, expected) in [
        (&known, libm::exp(-0.5 * spread_rad * spread_rad)),
        (&unknown, 0.0),
    ] {
        let mut cosines = 0.0;
        for index in 0..DRAWS {
            let found = draw(law, 5, index);
            let bent = found.at(law, 1.0, Body::Wall) - found.tip_m;
            // A quarter at half the depth.
            let half = found.at(law, 0.5, Body::Wall) - 0.5 * (found.entry_m + found.tip_m);
            assert!((half - 0.25 * bent).norm() < 1e-12);
            cosines += bent.y / bent.norm();
        }
        let mean = cosines / DRAWS as f64;
        assert!((mean - expected).abs() < tolerance(), "{mean} {expected}");
    }
}

#[test]
fn a_draw_depends_on_seed_and_number_alone() {
    let covariance = correlated([1e-3; 3], [1.2e-3; 3], 0.3);
    let arm = linear(Vector6::zeros(), &covariance);
    let shifted = linear(Vector6::repeat(1e-3), &covariance);
    let bend = Some(quadratic(1e-3, BendDirection::Unknown));
    let holds = failing(Vector3::zeros(), Vector3::x());
    let parts = vec![part("arm", &covariance)];
    let all = Law::new(Vector6::zeros(), parts, bend, holds).unwrap();
    for index in [0, 1, 77, 1 << 40] {
        let [a, b, c] = [&arm, &shifted, &all].map(|law| draw(law, 9, index));
        assert_eq!(a.entry_m, c.entry_m);
        assert_eq!(a.tip_m, c.tip_m);
        assert!((b.tip_m - a.tip_m - Vector3::repeat(1e-3)).norm() < 1e-15);
        assert_ne!(a.tip_m, draw(&arm, 10, index).tip_m);
        assert_ne!(a.tip_m, draw(&arm, 9, index + 1).tip_m);
    }
}

#[test]
fn beyond_the_last_fraction_a_bend_goes_on_straight() {
    let curve = vec![
        Vector2::zeros(),
        Vector2::new(1e-3, 0.0),
        Vector2::new(3e-3, 0.0),
    ];
    let direction = BendDirection::Known { spread_rad: 0.0 };
    let bend = Bend::new(vec![0.0, 0.5, 1.0], vec![curve], direction).unwrap();
    let covariance = correlated([1e-3; 3], [1e-3; 3], 0.0);
    let law = Law::new(
        Vector6::zeros(),
        vec![part("arm", &covariance)],
        Some(bend),
        vec![Hold::still(1.0)],
    )
    .unwrap();
    let found = draw(&law, 1, 0);
    let straight = found.entry_m * -0.25 + found.tip_m * 1.25;
    let bent = found.at(&law, 1.25, Body::Lung) - straight;
    assert!(
        (bent - Vector3::new(0.0, 4e-3, 0.0)).norm() < 1e-15,
        "{bent}"
    );
}
