//! Known deviations of the engines: each test fails when its deviation disappears.

use needlebench_engine::{
    Actuation, Hooks, KNOWN_DEVIATIONS, MujocoIntegrator, MujocoPlant, MujocoSettings, Plant,
    RapierPlant, RapierSettings, Recording, RefereePlant, RefereeSettings, Servo, ServoGains,
    simulate,
};
use needlebench_kinematics::Joints;
use needlebench_kinematics::trajectory::{JointTrajectory, MotionLimits, Phase, ProfileLimits};

use super::contact::{BALL_KG, LEVER_M, STEPS_PER_S, TIMESTEP_S, mechanism, run};
use super::mechanism::GRAVITY_M_S2;
use super::{harness, ur3, with_engines};

/// Every test below, by its key.
const TESTED: [&str; 6] = [
    "engines_run_half_a_step_early",
    "engines_lag_in_velocity_dependent_forces",
    "mujoco_euler_has_other_coriolis_forces_than_rapier",
    "rapier_sinks_into_a_contact",
    "mujoco_sinks_into_a_contact",
    "rapier_loses_friction_where_the_point_cannot_yield",
];

fn check(key: &str, value: f64) {
    let known = KNOWN_DEVIATIONS
        .iter()
        .find(|known| known.key == key)
        .unwrap();
    println!("{key}: {value:.4e} {}", known.unit);
    let [least, most] = known.range;
    assert!(
        (least..=most).contains(&value),
        "{key} is {value} {}, outside {least} to {most}",
        known.unit
    );
}

#[test]
fn every_known_deviation_has_its_test() {
    assert_eq!(KNOWN_DEVIATIONS.map(|known| known.key), TESTED);
}

#[test]
fn engines_run_half_a_step_early() {
    let cell = super::free_motion::lever(0.4).cell();
    with_engines(&cell, TIMESTEP_S, 0.0, |_, plant| {
        plant.reset(&Joints::zeros()).unwrap();
        // One step from rest: a h^2 instead of a h^2 / 2. Later ones keep the lead of h / 2.
        let first_rad = plant.step(&Joints::zeros()).unwrap().position[0];
        let state = run(plant, 21, &Joints::zeros());
        let acceleration = first_rad / TIMESTEP_S.powi(2);
        let elapsed_s = 22.0 * TIMESTEP_S;
        let ahead_rad = state.position[0] - 0.5 * acceleration * elapsed_s.powi(2);
        check(
            "engines_run_half_a_step_early",
            ahead_rad / (acceleration * elapsed_s * TIMESTEP_S),
        );
    });
}

fn fast_motion() -> JointTrajectory {
    let limits = MotionLimits {
        velocity: Joints::repeat(1.5),
        acceleration: Joints::repeat(4.0),
        jerk: Joints::repeat(40.0),
        line: ProfileLimits {
            velocity: 0.1,
            acceleration: 0.5,
            jerk: 5.0,
        },
    };
    JointTrajectory::starting_at(Joints::new(0.2, -1.6, 1.5, -1.2, -1.4, 0.3))
        .then_straight_to(
            Phase::Transfer,
            Joints::new(1.4, -1.0, 0.9, -2.0, -0.4, 1.3),
            &limits,
        )
        .then_hold(Phase::Hold, 0.5)
}

/// Largest distance of a point 0.25 m before the flange.
fn peak_m(a: &Recording, b: &Recording) -> f64 {
    let tip = |recording: &Recording, k: usize| {
        recording.state[k].world_from_flange * nalgebra::Point3::new(0.0, 0.06, 0.25)
    };
    (0..a.state.len())
        .map(|k| (tip(a, k) - tip(b, k)).norm())
        .fold(0.0, f64::max)
}

fn driven(plant: &mut dyn Plant) -> Recording {
    let cell = ur3();
    let servo = Servo {
        dynamics: cell.dynamics(),
        gains: ServoGains::default(),
        effort_limit_nm: cell.robot.limits.efforts_nm(),
    };
    simulate(
        plant,
        &servo,
        &Actuation::default(),
        &fast_motion(),
        Hooks::default(),
    )
    .unwrap()
}

#[test]
fn engines_lag_in_velocity_dependent_forces() {
    let cell = ur3();
    let settings = RefereeSettings::default();
    let referee = driven(&mut RefereePlant::new(&cell, TIMESTEP_S, &settings).unwrap());
    with_engines(&cell, TIMESTEP_S, 0.0, |_, plant| {
        check(
            "engines_lag_in_velocity_dependent_forces",
            peak_m(&driven(plant), &referee),
        );
    });
}

#[test]
fn mujoco_euler_has_other_coriolis_forces_than_rapier() {
    let cell = ur3();
    let rapier = RapierPlant::new(&cell, TIMESTEP_S, &RapierSettings::default());
    let rapier = driven(&mut rapier.unwrap());
    let mut harness = harness();
    let settings = MujocoSettings {
        integrator: MujocoIntegrator::Euler,
        ..MujocoSettings::default()
    };
    let mut mujoco = MujocoPlant::new(&mut harness, &cell, TIMESTEP_S, &settings).unwrap();
    check(
        "mujoco_euler_has_other_coriolis_forces_than_rapier",
        peak_m(&rapier, &driven(&mut mujoco)),
    );
}

#[test]
fn rapier_sinks_into_a_contact() {
    sinks("rapier", "rapier_sinks_into_a_contact");
}

#[test]
fn mujoco_sinks_into_a_contact() {
    sinks("mujoco", "mujoco_sinks_into_a_contact");
}

fn sinks(engine: &str, key: &str) {
    with_engines(&mechanism().cell(), TIMESTEP_S, 0.0, |name, plant| {
        if name == engine {
            plant.reset(&Joints::zeros()).unwrap();
            let state = run(plant, STEPS_PER_S, &Joints::zeros());
            check(key, state.contact.deepest_penetration_m);
        }
    });
}

#[test]
fn rapier_loses_friction_where_the_point_cannot_yield() {
    const FRICTION: f64 = 0.3;
    const SWEEP_NM: f64 = 10.0;
    const SWEEP_STEPS: u32 = 300;
    let mechanism = mechanism();
    let settings = RapierSettings {
        friction: FRICTION,
        ..RapierSettings::default()
    };
    let mut plant = RapierPlant::new(&mechanism.cell(), TIMESTEP_S, &settings).unwrap();
    plant.reset(&Joints::zeros()).unwrap();
    run(&mut plant, STEPS_PER_S / 2, &Joints::zeros());
    let mut torque = Joints::zeros();
    torque[0] = SWEEP_NM;
    let speed_rad_s = run(&mut plant, SWEEP_STEPS, &torque).velocity[0];
    let lost_nm =
        SWEEP_NM - speed_rad_s / (f64::from(SWEEP_STEPS) * TIMESTEP_S) * mechanism.moment_kgm2();
    let coulomb_nm = FRICTION * BALL_KG * GRAVITY_M_S2 * LEVER_M;
    check(
        "rapier_loses_friction_where_the_point_cannot_yield",
        lost_nm / coulomb_nm,
    );
}
