//! Where the arm is said to rest is where the engine leaves it.

use crate::common::{ALL, POSTURES, imperfect, motion_to, servo};
use needlebench_engine::{Hooks, RapierPlant, RapierSettings, simulate};
use needlebench_kinematics::random::SplitMix64;
use needlebench_uncertainty::{Layout, Truth, resting_friction, settle};

const TIMESTEP_S: f64 = 1e-3;

/// Largest distance of the needle's tip from where it was predicted, m, over a few arms and both
/// postures.
fn worst_prediction_m(blocks: &str) -> f64 {
    let resolved = imperfect(blocks);
    let imperfections = resolved.imperfections.as_ref().expect("given");
    let servo = servo(&resolved);
    let layout = Layout::new(imperfections);
    let place = resolved
        .phantom
        .as_ref()
        .map(|placed| &placed.world_from_phantom);
    let mut random = SplitMix64::new(11);
    let mut worst_m: f64 = 0.0;
    for posture in POSTURES {
        let trajectory = motion_to(&resolved, posture, 1.0);
        for seed in 0..3 {
            let draw = layout.draw(&mut random);
            let truth =
                Truth::new(&resolved.cell, place, imperfections, &layout, &draw, seed).unwrap();
            let real = truth.cell(&resolved.cell);
            let mut plant =
                RapierPlant::new(&real, TIMESTEP_S, &RapierSettings::default()).unwrap();
            let recording = simulate(
                &mut plant,
                &servo,
                &truth.actuation,
                &trajectory,
                Hooks::default(),
            )
            .unwrap();
            let friction = truth
                .actuation
                .friction
                .as_ref()
                .map(|friction| resting_friction(friction, &trajectory));
            let settled = settle(
                &servo,
                &truth.dynamics(&resolved.cell),
                &truth,
                friction.as_ref(),
                &trajectory.end(),
            )
            .unwrap();
            let depths_m = [0.0, resolved.goals[0].insertion_length_m];
            let tip = |q| truth.needle_points(&resolved.cell, q, depths_m)[1];
            let rested = recording.state.last().expect("there is a start").position;
            worst_m = worst_m.max((tip(&rested) - tip(&settled.position)).norm());
        }
    }
    worst_m
}

/// The engine has not come to rest entirely.
const EXACT_M: f64 = 1e-8;

#[test]
fn without_friction_and_encoders_the_prediction_is_exact() {
    let blocks = "[imperfections.calibration]\n[imperfections.elasticity]\n\
                  [imperfections.payload]\nmass_error_kg = 0.1\n[imperfections.control]\n\
                  [imperfections.guide]\ndiametral_clearance_mm = 0.15\n";
    let worst_m = worst_prediction_m(blocks);
    assert!(worst_m < EXACT_M, "{worst_m:.3e}");
}

/// Four standard deviations of the trembling by 9 urad of noise, half a metre away.
const TREMBLING_M: f64 = 10e-6;

#[test]
fn encoders_leave_the_arm_trembling_about_its_prediction() {
    let worst_m = worst_prediction_m("[imperfections.encoder]\n");
    assert!((1e-8..TREMBLING_M).contains(&worst_m), "{worst_m:.3e}");
    let quiet = "[imperfections.encoder]\nnoise_deg = [0, 0, 0, 0, 0, 0]\n";
    let worst_m = worst_prediction_m(quiet);
    assert!(worst_m < EXACT_M, "{worst_m:.3e}");
}

/// How the joints stop decides on a part of the break-away torque: measured, see the message.
const FRICTION_M: f64 = 30e-6;

#[test]
fn friction_is_predicted_but_for_how_the_joints_stop() {
    let worst_m = worst_prediction_m("[imperfections.friction]\n");
    assert!(worst_m < FRICTION_M, "{worst_m:.3e}");
}

#[test]
fn all_together_the_prediction_holds_as_well() {
    let worst_m = worst_prediction_m(ALL);
    assert!(worst_m < FRICTION_M + TREMBLING_M, "{worst_m:.3e}");
}
