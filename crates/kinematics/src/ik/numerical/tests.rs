//! Numerical solvers on every set of poses.

use super::*;
use crate::UrGeometry;
use crate::pose_sets::{PoseSet, rounded_to_f32};

/// Residual after polishing where the solution is isolated: ten times the worst seen, m and rad.
const RESIDUAL: f64 = 1e-13;

/// Residual that counts as converged everywhere, m and rad.
const CONVERGED: f64 = 1e-9;

fn random_start(random: &mut SplitMix64) -> Joints {
    Joints::from_fn(|_, _| random.uniform(-PI, PI))
}

#[test]
fn gauss_newton_returns_from_a_tenth_of_a_radian() {
    let numerical = Numerical::new(&UrGeometry::UR3.chain());
    let mut random = SplitMix64::new(51);
    for set in PoseSet::ALL {
        let mut steps = 0;
        for away_rad in [0.0, 1e-9, 1e-6, 1e-3] {
            for _ in 0..300 {
                let q = set.sample(&UrGeometry::UR3, &mut random, away_rad);
                let pose = numerical.chain.base_link_from_flange(&q);
                let guess = q.map(|joint| joint + random.uniform(-0.1, 0.1));
                let found = numerical.gauss_newton(&pose, &guess, &GaussNewtonOptions::default());
                assert_eq!(
                    found.stop,
                    Stop::Converged,
                    "{set:?} {away_rad:e} {found:?}"
                );
                let (m, rad) = numerical.residuals(&numerical.target(&pose), &found.joints);
                assert!(m.max(rad) <= CONVERGED);
                steps += found.iterations;
            }
        }
        // Singular sets need more steps than a quadratic iteration, but few restarts.
        assert!(steps < 1200 * 20, "{set:?}: {steps} steps");
    }
}

#[test]
fn isolated_solutions_are_reached_to_rounding() {
    let numerical = Numerical::new(&UrGeometry::UR3.chain());
    let mut random = SplitMix64::new(52);
    for _ in 0..1000 {
        let q = PoseSet::Generic.sample(&UrGeometry::UR3, &mut random, 0.0);
        if numerical.chain.jacobian(&q).singular_values().min() < 0.01 {
            continue;
        }
        let pose = numerical.chain.base_link_from_flange(&q);
        let guess = q.map(|joint| joint + random.uniform(-0.02, 0.02));
        for step in [GaussNewtonStep::Regularised, GaussNewtonStep::Undamped] {
            let options = GaussNewtonOptions {
                step,
                ..Default::default()
            };
            let found = numerical.gauss_newton(&pose, &guess, &options);
            assert!(found.converged && found.residual_m.max(found.residual_rad) <= RESIDUAL);
        }
    }
}

#[test]
fn the_restarted_solver_always_converges() {
    let numerical = Numerical::new(&UrGeometry::UR3.chain());
    let mut random = SplitMix64::new(53);
    for set in PoseSet::ALL {
        for away_rad in [0.0, 1e-9, 1e-6, 1e-3] {
            for _ in 0..150 {
                let q = set.sample(&UrGeometry::UR3, &mut random, away_rad);
                let pose = numerical.chain.base_link_from_flange(&q);
                let start = random_start(&mut random);
                let found = numerical.damped(&pose, &start, &DampedOptions::default());
                assert_eq!(
                    found.stop,
                    Stop::Converged,
                    "{set:?} {away_rad:e} {found:?}"
                );
                let (m, rad) = numerical.residuals(&numerical.target(&pose), &found.joints);
                assert!(m.max(rad) <= CONVERGED);
            }
        }
    }
}

#[test]
fn generic_poses_in_single_precision_are_solved_too() {
    let numerical = Numerical::new(&UrGeometry::UR3.chain());
    let mut random = SplitMix64::new(54);
    for _ in 0..500 {
        let q = PoseSet::Generic.sample(&UrGeometry::UR3, &mut random, 0.0);
        let pose = rounded_to_f32(&numerical.chain.base_link_from_flange(&q));
        let start = random_start(&mut random);
        assert!(
            numerical
                .damped(&pose, &start, &DampedOptions::default())
                .converged
        );
    }
}

#[test]
fn limits_are_kept_and_named() {
    let numerical = Numerical::new(&UrGeometry::UR3.chain());
    let out_of_reach = Pose::translation(2.0, 0.0, 0.0);
    let start = Joints::repeat(0.3);
    let options = DampedOptions {
        max_iterations: 100,
        ..Default::default()
    };
    let found = numerical.damped(&out_of_reach, &start, &options);
    assert_eq!(found.stop, Stop::IterationLimit);
    assert!(!found.converged && found.iterations == 100 && found.residual_m > 1.0);
    let options = DampedOptions {
        max_time: Some(Duration::ZERO),
        ..Default::default()
    };
    let found = numerical.damped(&out_of_reach, &start, &options);
    assert_eq!(found.stop, Stop::TimeLimit);
    for bad in [f64::NAN, f64::INFINITY] {
        let found = numerical.damped(&out_of_reach, &Joints::repeat(bad), &options);
        assert_eq!(found.stop, Stop::NotFinite);
        for step in [GaussNewtonStep::Regularised, GaussNewtonStep::Undamped] {
            let options = GaussNewtonOptions {
                step,
                ..Default::default()
            };
            let found = numerical.gauss_newton(&out_of_reach, &Joints::repeat(bad), &options);
            assert_eq!(found.stop, Stop::NotFinite);
        }
    }
}

#[test]
fn the_nearest_posture_to_a_reachable_pose_reaches_it() {
    let numerical = Numerical::new(&UrGeometry::UR3.chain());
    let q = Joints::from_column_slice(&[0.4, -1.0, 1.3, 0.2, 1.1, 0.0]);
    let pose = numerical.chain.base_link_from_flange(&q);
    let found = numerical.nearest(&pose, &q.map(|joint| joint + 0.05), 2.0);
    assert_eq!(found.stop, Stop::Converged);
    let far = numerical.nearest(&Pose::translation(2.0, 0.0, 0.0), &q, 2.0);
    assert_eq!(far.stop, Stop::Stationary);
    assert!(!far.converged && far.residual_m > 1.0);
}

#[test]
fn same_start_same_bytes() {
    let numerical = Numerical::new(&UrGeometry::UR3.chain());
    let pose = numerical
        .chain
        .base_link_from_flange(&Joints::from_column_slice(&[0.1, -1.0, 1.2, 0.3, 0.4, 0.5]));
    let solve = || numerical.damped(&pose, &Joints::repeat(2.0), &DampedOptions::default());
    assert_eq!(solve(), solve());
}
