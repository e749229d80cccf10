//! A ball that rests and slides on a table.

use nalgebra::Vector3;
use needlebench_engine::{Plant, PlantState};
use needlebench_kinematics::Joints;

use super::mechanism::{GRAVITY_M_S2, Mechanism, RESTING_KGM2};
use super::with_engines;

pub const STEPS_PER_S: u32 = 1000;
pub const TIMESTEP_S: f64 = 1.0 / STEPS_PER_S as f64;
pub const LEVER_M: f64 = 0.5;
pub const BALL_KG: f64 = 2.0;

/// A ball on a lever that can be swept about z and lifted about y; at rest it just touches a table.
pub fn mechanism() -> Mechanism {
    Mechanism {
        free_joints: vec![Vector3::z_axis(), Vector3::y_axis()],
        lever_m: LEVER_M,
        ball_kg: BALL_KG,
        gravity_m_s2: Vector3::new(0.0, 0.0, -GRAVITY_M_S2),
        has_table: true,
        resting_kgm2: RESTING_KGM2,
    }
}

pub fn run(plant: &mut dyn Plant, steps: u32, torque_nm: &Joints) -> PlantState {
    let mut state = plant.step(torque_nm).unwrap();
    for _ in 1..steps {
        state = plant.step(torque_nm).unwrap();
    }
    state
}

#[test]
fn a_resting_ball_is_borne_by_its_weight_and_what_presses_it() {
    /// Both engines solve for the force that stops the ball, whatever the softness; 1e-9 is seen.
    const FORCE_RELATIVE: f64 = 1e-6;
    let cell = mechanism().cell();
    println!("resting contact:");
    with_engines(&cell, TIMESTEP_S, 0.0, |name, plant| {
        plant.reset(&Joints::zeros()).unwrap();
        for pressing_nm in [0.0, 5.0, 20.0] {
            let mut torque = Joints::zeros();
            torque[1] = pressing_nm;
            let state = run(plant, STEPS_PER_S, &torque);
            let expected_n = BALL_KG * GRAVITY_M_S2 + pressing_nm / LEVER_M;
            let force_n = state.contact.normal_force_n;
            println!(
                "    {name}: {force_n:.9} N of {expected_n:.9} N, {:.3} um deep",
                state.contact.deepest_penetration_m * 1e6
            );
            assert_eq!(state.contact.count, 1);
            assert!((force_n / expected_n - 1.0).abs() < FORCE_RELATIVE);
        }
    });
}

#[test]
fn a_ball_slides_over_a_smooth_table_as_through_nothing() {
    const SWEEP_NM: f64 = 5.0;
    const STEPS: u32 = 400;
    /// The ball lies half a micrometre below the pivot, so that its centrifugal force lifts it by
    /// `rate^2 depth / g`, 1e-6 of its weight, half as much again for the lag of half a step; 1.5e-6
    /// is seen, and 6e-8 in the speed.
    const RELATIVE: f64 = 5e-6;
    let mechanism = mechanism();
    let moment = mechanism.moment_kgm2();
    let cell = mechanism.cell();
    println!("sliding contact:");
    with_engines(&cell, TIMESTEP_S, 0.0, |name, plant| {
        plant.reset(&Joints::zeros()).unwrap();
        run(plant, STEPS_PER_S / 2, &Joints::zeros());
        let mut torque = Joints::zeros();
        torque[0] = SWEEP_NM;
        let speed = SWEEP_NM / moment * f64::from(STEPS) * TIMESTEP_S;
        let pushed = run(plant, STEPS, &torque);
        // Then on by itself for a second.
        let coasted = run(plant, STEPS_PER_S, &Joints::zeros());
        let weight_n = BALL_KG * GRAVITY_M_S2;
        println!(
            "    {name}: {:.9} and {:.9} rad/s of {speed:.9} rad/s, {:.9} N of {weight_n:.9} N",
            pushed.velocity[0], coasted.velocity[0], coasted.contact.normal_force_n
        );
        let travelled = coasted.position[0] - pushed.position[0];
        assert!((pushed.velocity[0] / speed - 1.0).abs() < RELATIVE);
        assert!((coasted.velocity[0] / speed - 1.0).abs() < RELATIVE);
        assert!((travelled / speed - 1.0).abs() < RELATIVE);
        assert!((coasted.contact.normal_force_n / weight_n - 1.0).abs() < RELATIVE);
    });
}
