//! MuJoCo against our own kinematics and dynamics.

use crate::common::Random;
use crate::process as harness;
use needlebench_engine::mujoco::HarnessProcess;
use needlebench_engine::{MujocoPlant, MujocoSettings, Plant};
use needlebench_kinematics::{JOINT_COUNT, Joints};

const TIMESTEP_S: f64 = 1e-3;

fn plant(harness: &mut HarnessProcess) -> MujocoPlant<'_> {
    let cell = crate::common::ur3(Vec::new());
    MujocoPlant::new(harness, &cell, TIMESTEP_S, &MujocoSettings::default()).unwrap()
}

/// Six compositions of poses with coordinates below 2 m; 1e-15 is seen.
const LINK_POSE_M: f64 = 1e-14;

#[test]
fn link_poses_are_those_of_our_forward_kinematics() {
    let cell = crate::common::ur3(Vec::new());
    let mut harness = harness::harness();
    let mut plant = plant(&mut harness);
    let mut random = Random(1);
    let mut worst: f64 = 0.0;
    for _ in 0..200 {
        let q = random.joints(std::f64::consts::PI);
        let state = plant.reset(&q).unwrap();
        let ours = cell.robot.world_from_links(&q);
        let theirs = plant.link_poses().unwrap();
        let flange = cell.robot.world_from_flange(&q);
        for (ours, theirs) in ours
            .iter()
            .zip(&theirs)
            .chain([(&flange, &state.world_from_flange)])
        {
            let position = (ours.translation.vector - theirs.translation.vector).norm();
            worst = worst
                .max(position)
                .max(ours.rotation.angle_to(&theirs.rotation));
        }
    }
    println!("worst link pose difference {worst:e}");
    assert!(worst < LINK_POSE_M, "{worst:e}");
}

/// Relative to the largest entry.
const DYNAMICS: f64 = 1e-10;

#[test]
fn dynamics_are_ours_at_random_states() {
    let dynamics = crate::common::ur3(Vec::new()).dynamics();
    let mut harness = harness::harness();
    let mut plant = plant(&mut harness);
    let mut random = Random(2);
    let mut worst = [0.0_f64; 3];
    for _ in 0..300 {
        let q = random.joints(std::f64::consts::PI);
        let (qd, qdd) = (random.joints(3.0), random.joints(10.0));
        let theirs = plant.inverse_dynamics(&q, &qd, &qdd).unwrap();
        let mass = dynamics.mass_matrix(&q);
        let gravity = dynamics.gravity_torque(&q);
        let torque = dynamics.inverse_dynamics(&q, &qd, &qdd);
        let joints = |v: &nalgebra::DVector<f64>| Joints::from_column_slice(v.as_slice());
        let their_mass =
            nalgebra::Matrix6::from_fn(|row, column| theirs.mass_matrix[(row, column)]);
        worst[0] = worst[0].max((their_mass - mass).amax() / mass.amax());
        worst[1] = worst[1].max((joints(&theirs.gravity_nm) - gravity).amax() / gravity.amax());
        worst[2] = worst[2].max((joints(&theirs.torque_nm) - torque).amax() / torque.amax());
    }
    println!("relative difference of mass matrix, gravity, inverse dynamics: {worst:?}");
    assert!(worst.iter().all(|&error| error < DYNAMICS), "{worst:?}");
}

/// One step of 1 ms turns a torque error of 1e-9 N m into 1e-12/I rad/s.
const HOLDING_TORQUE_NM: f64 = 1e-9;

#[test]
fn gravity_torque_holds_the_arm_still() {
    let dynamics = crate::common::ur3(Vec::new()).dynamics();
    let mut harness = harness::harness();
    let mut plant = plant(&mut harness);
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
fn same_torques_give_the_same_bits() {
    let q = Joints::new(0.3, -1.1, 1.3, 0.4, -0.8, 0.2);
    let run = |plant: &mut MujocoPlant<'_>| {
        let mut random = Random(4);
        plant.reset(&q).unwrap();
        (0..300)
            .map(|_| plant.step(&random.joints(10.0)).unwrap())
            .collect::<Vec<_>>()
    };
    let mut first_process = harness::harness();
    let mut plant_1 = plant(&mut first_process);
    let first = run(&mut plant_1);
    assert_eq!(first, run(&mut plant_1), "after a reset");
    let mut second_process = harness::harness();
    assert_eq!(
        first,
        run(&mut plant(&mut second_process)),
        "in another process"
    );
}

#[test]
fn links_are_found_whatever_the_posture() {
    let mut harness = harness::harness();
    let mut plant = plant(&mut harness);
    plant.reset(&Joints::zeros()).unwrap();
    let state = plant.step(&Joints::repeat(5.0)).unwrap();
    let ours = crate::common::ur3(Vec::new())
        .robot
        .world_from_links(&state.position);
    let theirs = plant.link_poses().unwrap();
    for i in 0..JOINT_COUNT {
        let error = (ours[i].translation.vector - theirs[i].translation.vector).norm();
        assert!(error < LINK_POSE_M, "link {i}: {error:e}");
    }
}
