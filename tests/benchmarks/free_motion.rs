//! Pendulum and free fall.

use nalgebra::Vector3;
use needlebench_engine::Plant;
use needlebench_kinematics::Joints;

use super::elliptic::pendulum_rad;
use super::mechanism::{GRAVITY_M_S2, Mechanism, RESTING_KGM2};
use super::{referee, with_engines};

const STEPS_PER_S: u32 = 1000;
const TIMESTEP_S: f64 = 1.0 / STEPS_PER_S as f64;

pub fn lever(lever_m: f64) -> Mechanism {
    Mechanism {
        // Turning about y takes x downwards.
        free_joints: vec![Vector3::y_axis()],
        lever_m,
        ball_kg: 1.5,
        gravity_m_s2: Vector3::new(0.0, 0.0, -GRAVITY_M_S2),
        has_table: false,
        resting_kgm2: RESTING_KGM2,
    }
}

/// Largest difference of the first joint from `exact(t)` over `steps` steps without torque.
fn worst(plant: &mut dyn Plant, start_rad: f64, steps: u32, exact: impl Fn(f64) -> f64) -> f64 {
    let mut start = Joints::zeros();
    start[0] = start_rad;
    plant.reset(&start).unwrap();
    (1..=steps)
        .map(|k| {
            let state = plant.step(&Joints::zeros()).unwrap();
            (state.position[0] - exact(f64::from(k) * TIMESTEP_S)).abs()
        })
        .fold(0.0, f64::max)
}

#[test]
fn a_pendulum_swings_as_the_elliptic_functions_say() {
    const LEVER_M: f64 = 0.4;
    /// From the lowest point.
    const START_RAD: f64 = 2.0;
    const STEPS: u32 = 2 * STEPS_PER_S;
    /// Ten times what is seen: rounding and a tolerance of 1e-12 in each of 2000 steps.
    const REFEREE_RAD: f64 = 2e-11;
    let mechanism = lever(LEVER_M);
    let rate_rad_s = (mechanism.ball_kg * GRAVITY_M_S2 * LEVER_M / mechanism.moment_kgm2()).sqrt();
    // Hanging straight down is a quarter turn from x.
    let lowest = std::f64::consts::FRAC_PI_2;
    let exact = |t: f64| lowest + pendulum_rad(START_RAD, rate_rad_s, t);
    let cell = mechanism.cell();

    let error = worst(
        &mut referee(&cell, TIMESTEP_S),
        lowest + START_RAD,
        STEPS,
        exact,
    );
    println!("pendulum, 2 s from {START_RAD} rad: referee {error:.1e} rad");
    assert!(error < REFEREE_RAD, "{error:e}");

    // From rest the engine's first velocity is a whole step's instead of half a step's, so that it
    // runs half a step early: first order. Apart from that it is leapfrog: its frequency is off by
    // (rate h)^2 / 24, and its first position by a h^2 / 8, of which the largest swing remembers no
    // more than the product of rate and time.
    let fastest_rad_s = 2.0 * rate_rad_s * libm::sin(0.5 * START_RAD);
    let phase = rate_rad_s * f64::from(STEPS) * TIMESTEP_S;
    let second_order = (rate_rad_s * TIMESTEP_S).powi(2) * (1.0 + phase) * START_RAD;
    let first_order = 0.5 * TIMESTEP_S * fastest_rad_s + second_order;
    with_engines(&cell, TIMESTEP_S, 0.0, |name, plant| {
        let plain = worst(plant, lowest + START_RAD, STEPS, exact);
        let early = worst(plant, lowest + START_RAD, STEPS, |t| {
            exact(t + 0.5 * TIMESTEP_S)
        });
        println!(
            "    {name}: {plain:.2e} rad (bound {first_order:.2e}), half a step early {early:.2e} rad \
             (bound {second_order:.2e})"
        );
        assert!(plain < first_order && early < second_order);
        // It is the half step that the engine is off by, and nothing less.
        assert!(plain > 0.4 * TIMESTEP_S * fastest_rad_s);
    });
}

#[test]
fn a_ball_on_a_long_lever_falls_freely() {
    const LEVER_M: f64 = 1000.0;
    const STEPS: u32 = STEPS_PER_S;
    let mechanism = lever(LEVER_M);
    let cell = mechanism.cell();
    let drop = |angle_rad: f64| LEVER_M * libm::sin(angle_rad);
    let free_fall = |t: f64| 0.5 * GRAVITY_M_S2 * t * t;
    // The arc differs from the straight line by the angle squared, 2.4e-5 after 1 s; the small
    // bodies in the pivot hold the ball up by their share of the moment of inertia, 1e-8.
    let last_angle = free_fall(1.0) / LEVER_M;
    let arc_m = free_fall(1.0) * last_angle.powi(2);
    let worst_drop = |plant: &mut dyn Plant, exact: &dyn Fn(f64) -> f64| {
        plant.reset(&Joints::zeros()).unwrap();
        (1..=STEPS)
            .map(|k| {
                let state = plant.step(&Joints::zeros()).unwrap();
                // From the plant's own pose of the flange, which is the ball's centre.
                let fallen = -state.world_from_flange.translation.z;
                assert!((fallen - drop(state.position[0])).abs() < 1e-9);
                (fallen - exact(f64::from(k) * TIMESTEP_S)).abs()
            })
            .fold(0.0, f64::max)
    };
    let error = worst_drop(&mut referee(&cell, TIMESTEP_S), &free_fall);
    println!("free fall, 1 s: referee {error:.2e} m of 4.905 m (arc {arc_m:.1e})");
    assert!(error < arc_m, "{error:e}");
    with_engines(&cell, TIMESTEP_S, 0.0, |name, plant| {
        // h^2 g (1 + 2 + ... + n) = g t (t + h) / 2.
        let summed = |t: f64| 0.5 * GRAVITY_M_S2 * t * (t + TIMESTEP_S);
        let plain = worst_drop(plant, &free_fall);
        let discrete = worst_drop(plant, &summed);
        println!("    {name}: {plain:.3e} m, from g t (t + h) / 2 {discrete:.2e} m");
        assert!(discrete < arc_m, "{discrete:e}");
        // First order: g t h / 2.
        assert!((plain - 0.5 * GRAVITY_M_S2 * TIMESTEP_S).abs() < arc_m);
    });
}
