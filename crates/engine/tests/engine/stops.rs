//! Emergency stops of category 0 in both engines, against the published ones that their brakes are fitted to.

use crate::process as harness;
use needlebench_cell::{BrakeFigure, BrakeFigures, Cell};
use needlebench_engine::{
    Actuation, Brakes, Braking, Hooks, Keep, Motion, MujocoPlant, MujocoSettings, Plant,
    RapierPlant, RapierSettings, Recording, Servo, ServoGains, loaded, simulate_motion, stretched,
};
use needlebench_kinematics::trajectory::{JointTrajectory, MotionLimits, Phase, ProfileLimits};
use needlebench_kinematics::{Joints, Pose};

const TIMESTEP_S: f64 = 1e-3;

/// Half of the last digit that is published.
const PUBLISHED_DISTANCE_RAD: f64 = 0.005;

/// Three steps; 1 ms is seen for the shoulder: gravity is constant in the derivation.
const PUBLISHED_TIME_S: f64 = 3e-3;

/// 7.4e-10 rad is seen.
const ENGINES_RAD: f64 = 1e-7;

/// The same where another joint gives way and is caught again: dry friction, which jumps at no speed, makes more
/// of the engines' differences of second order. 1.5e-7 rad is seen.
const ENGINES_YIELDING_RAD: f64 = 5e-7;

/// A joint that moved by more than this has given way, rad.
const GIVEN_WAY_RAD: f64 = 1e-4;

/// Speed of a joint that stands, rad/s.
const STANDING_RAD_S: f64 = 1e-3;

fn figures() -> BrakeFigures {
    crate::common::brake_figures("ur3")
}

/// A level UR3 without surroundings, with the load of the published stops.
fn loaded_cell() -> Cell {
    let mut cell = crate::common::ur3(Vec::new());
    cell.robot.world_from_base_link = Pose::translation(0.0, 0.0, 1.0);
    // Touching itself is not the question here.
    cell.pairs.clear();
    let last = cell.robot.bodies.len() - 1;
    let tool = cell
        .tool
        .body
        .transformed(&cell.robot.chain.wrist_3_from_flange);
    let with_load = loaded(&cell.dynamics(), figures().load_kg).bodies[last];
    // The cell adds its tool by itself.
    cell.tool.body.mass_kg = 0.0;
    cell.tool.body.inertia_kgm2 = nalgebra::Matrix3::zeros();
    assert!(tool.mass_kg > 0.0);
    cell.robot.bodies[last] = with_load;
    cell
}

/// A motion of one joint that passes `stretched` at the published speed at the returned time.
fn passing(joint: usize, sign: f64) -> (JointTrajectory, f64) {
    let mut way = Joints::zeros();
    way[joint] = 1.5 * sign;
    let limits = MotionLimits {
        velocity: Joints::repeat(figures().speed_rad_s),
        acceleration: Joints::repeat(10.0),
        jerk: Joints::repeat(200.0),
        line: ProfileLimits {
            velocity: 0.1,
            acceleration: 0.5,
            jerk: 5.0,
        },
    };
    let whole = JointTrajectory::starting_at(stretched() - way).then_straight_to(
        Phase::Transfer,
        stretched() + way,
        &limits,
    );
    // The profile is symmetric.
    let at_s = 0.5 * whole.duration_s();
    let at_s = (at_s / TIMESTEP_S).round() * TIMESTEP_S;
    (whole.stopped(at_s, 0.0).then_hold(Phase::Stop, 0.4), at_s)
}

fn stop(plant: &mut dyn Plant, cell: &Cell, joint: usize, sign: f64) -> Recording {
    let dynamics = cell.dynamics();
    let servo = Servo {
        dynamics,
        gains: ServoGains::default(),
        effort_limit_nm: Joints::repeat(f64::INFINITY),
    };
    let (trajectory, from_s) = passing(joint, sign);
    let braking = Braking {
        from_s,
        brakes: Brakes::of_figures(&figures(), &crate::common::ur3(Vec::new()).dynamics()),
        dynamics: &dynamics,
    };
    let motion = Motion {
        servo: &servo,
        actuation: &Actuation::default(),
        trajectory: &trajectory,
        braking: Some(braking),
        keep: Keep::Steps,
    };
    simulate_motion(plant, &motion, Hooks::default()).unwrap()
}

/// Angle travelled and time taken by one joint from the stop on.
fn measured(recording: &Recording, joint: usize, sign: f64) -> (f64, f64) {
    let from = passing(joint, sign).1;
    let index = recording
        .time_s
        .iter()
        .position(|time_s| *time_s > from - 0.5 * TIMESTEP_S)
        .unwrap();
    let start = &recording.state[index];
    assert!((start.velocity[joint].abs() - figures().speed_rad_s).abs() < 0.01);
    let standing = (index..recording.state.len())
        .find(|&k| recording.state[k].velocity[joint].abs() < STANDING_RAD_S)
        .unwrap();
    let last = recording.state.last().unwrap();
    assert!(last.velocity.amax() < STANDING_RAD_S, "{}", last.velocity);
    (
        (last.position[joint] - start.position[joint]).abs(),
        recording.time_s[standing] - recording.time_s[index],
    )
}

/// What is left of the fit: the brakes' two parameters come from the two figures of each joint, by a closed form of
/// one joint under constant gravity. Here all joints move in two engines.
#[test]
fn stops_that_the_brakes_are_fitted_to_come_out_in_both_engines() {
    let cell = loaded_cell();
    let gravity = cell.dynamics().gravity_torque(&stretched());
    let mut harness = harness::harness();
    let mut rapier = RapierPlant::new(&cell, TIMESTEP_S, &RapierSettings::default()).unwrap();
    let mut mujoco =
        MujocoPlant::new(&mut harness, &cell, TIMESTEP_S, &MujocoSettings::default()).unwrap();
    let mut published = 0;
    for (joint, figure) in figures().joints.iter().enumerate() {
        let BrakeFigure::Published {
            distance_rad: published_rad,
            time_s: published_s,
            ..
        } = *figure
        else {
            continue;
        };
        published += 1;
        // Downwards; either way for the base.
        let sign = if gravity[joint] > 0.0 { -1.0 } else { 1.0 };
        let plants: [&mut dyn Plant; 2] = [&mut rapier, &mut mujoco];
        let recordings = plants.map(|plant| stop(plant, &cell, joint, sign));
        let mut engines_rad = ENGINES_RAD;
        for recording in &recordings {
            let (distance_rad, time_s) = measured(recording, joint, sign);
            println!(
                "{} joint {joint}: {distance_rad:.4} rad in {time_s:.4} s",
                recording.engine.name
            );
            // The other joints stand, though a standing brake holds no more than a slipping one.
            let [start, end] = [0, recording.state.len() - 1].map(|k| recording.state[k].position);
            let mut yielded = end - start;
            yielded[joint] = 0.0;
            println!("others give way by {:.4} rad", yielded.amax());
            assert!(yielded.amax() < PUBLISHED_DISTANCE_RAD);
            if yielded.amax() > GIVEN_WAY_RAD {
                engines_rad = ENGINES_YIELDING_RAD;
            }
            assert!((distance_rad - published_rad).abs() < PUBLISHED_DISTANCE_RAD);
            assert!((time_s - published_s).abs() < PUBLISHED_TIME_S);
        }
        let [a, b] = recordings.map(|recording| recording.state.last().unwrap().position);
        println!("engines differ by {:e} rad", (a - b).amax());
        assert!((a - b).amax() < engines_rad);
    }
    assert_eq!(published, 3, "base, shoulder and elbow");
}

/// The brakes hold what they stopped: no creep under gravity.
#[test]
fn braked_joints_stay_where_they_stopped() {
    /// 1e-16 is seen over 0.2 s.
    const CREEP_RAD: f64 = 1e-12;
    let cell = loaded_cell();
    let mut rapier = RapierPlant::new(&cell, TIMESTEP_S, &RapierSettings::default()).unwrap();
    let recording = stop(&mut rapier, &cell, 1, 1.0);
    let last = recording.state.len() - 1;
    let creep = recording.state[last].position - recording.state[last - 200].position;
    println!("creep {:e}", creep.amax());
    assert!(creep.amax() < CREEP_RAD);
}
