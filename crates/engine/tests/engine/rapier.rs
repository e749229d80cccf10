//! rapier against our own kinematics and dynamics.

use crate::common::Random;
use needlebench_engine::{Plant, RapierPlant, RapierSettings};
use needlebench_kinematics::{JOINT_COUNT, Joints};

const TIMESTEP_S: f64 = 1e-3;

fn plant() -> RapierPlant {
    RapierPlant::new(
        &crate::common::ur3(Vec::new()),
        TIMESTEP_S,
        &RapierSettings::default(),
    )
    .unwrap()
}

/// Six compositions of poses with coordinates below 2 m; 4e-16 is seen.
const LINK_POSE_M: f64 = 1e-14;

#[test]
fn link_poses_are_those_of_our_forward_kinematics() {
    let cell = crate::common::ur3(Vec::new());
    let mut plant = plant();
    let mut random = Random(1);
    let mut worst: f64 = 0.0;
    for _ in 0..200 {
        let q = random.joints(std::f64::consts::PI);
        plant.reset(&q).unwrap();
        let ours = cell.robot.world_from_links(&q);
        let theirs = plant.link_poses().unwrap();
        for i in 0..JOINT_COUNT {
            let position = (ours[i].translation.vector - theirs[i].translation.vector).norm();
            worst = worst
                .max(position)
                .max(ours[i].rotation.angle_to(&theirs[i].rotation));
        }
    }
    println!("worst link pose difference {worst:e}");
    assert!(worst < LINK_POSE_M, "{worst:e}");
}

/// Relative to the largest entry; 1e-15 is seen.
const MASS_MATRIX: f64 = 1e-12;

#[test]
fn mass_matrix_is_that_of_composite_rigid_bodies() {
    let dynamics = crate::common::ur3(Vec::new()).dynamics();
    let mut plant = plant();
    let mut random = Random(2);
    let mut worst: f64 = 0.0;
    for _ in 0..200 {
        let q = random.joints(std::f64::consts::PI);
        plant.reset(&q).unwrap();
        let ours = dynamics.mass_matrix(&q);
        worst = worst.max((plant.mass_matrix() - ours).amax() / ours.amax());
    }
    println!("worst mass matrix difference {worst:e}");
    assert!(worst < MASS_MATRIX, "{worst:e}");
}

/// One step of 1 ms turns a torque error of 1e-9 N m into 1e-12/I rad/s.
const HOLDING_TORQUE_NM: f64 = 1e-9;

#[test]
fn gravity_torque_holds_the_arm_still() {
    let dynamics = crate::common::ur3(Vec::new()).dynamics();
    let mut plant = plant();
    let mut random = Random(3);
    let mut worst: f64 = 0.0;
    let mut postures = 0;
    while postures < 50 {
        let q = random.joints(std::f64::consts::PI);
        if plant.reset(&q).unwrap().contact.count > 0 {
            continue; // a posture that collides with itself
        }
        postures += 1;
        let state = plant.step(&dynamics.gravity_torque(&q)).unwrap();
        let missing = dynamics.mass_matrix(&q) * state.velocity / TIMESTEP_S;
        worst = worst.max(missing.amax());
    }
    println!("worst holding torque difference {worst:e} N m");
    assert!(worst < HOLDING_TORQUE_NM, "{worst:e}");
}

#[test]
fn step_moves_as_inverse_dynamics_demands_from_rest() {
    let dynamics = crate::common::ur3(Vec::new()).dynamics();
    let mut plant = plant();
    let q = Joints::new(0.3, -1.1, 1.3, 0.4, -0.8, 0.2);
    plant.reset(&q).unwrap();
    let qdd = Joints::new(1.0, -2.0, 3.0, -4.0, 5.0, -6.0);
    let state = plant
        .step(&dynamics.inverse_dynamics(&q, &Joints::zeros(), &qdd))
        .unwrap();
    let error = (state.velocity / TIMESTEP_S - qdd).amax();
    println!("acceleration error {error:e}");
    assert!(error < 1e-11, "{error:e}");
}

#[test]
fn same_torques_give_the_same_bits() {
    let mut plant = plant();
    let q = Joints::new(0.3, -1.1, 1.3, 0.4, -0.8, 0.2);
    let mut run = || {
        let mut random = Random(4);
        plant.reset(&q).unwrap();
        (0..300)
            .map(|_| plant.step(&random.joints(10.0)).unwrap())
            .collect::<Vec<_>>()
    };
    let first = run();
    assert_eq!(first, run());
}

#[test]
fn version_is_the_locked_one() {
    let lock =
        std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../Cargo.lock")).unwrap();
    let locked = lock
        .split("[[package]]")
        .find(|package| package.contains("name = \"rapier3d-f64\""))
        .unwrap();
    assert!(locked.contains(&format!("version = \"{}\"", plant().identity().version)));
}
