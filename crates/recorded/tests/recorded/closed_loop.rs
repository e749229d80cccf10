//! Logs that were made with known values give them back.
//!
//! Torques are made with `Dynamics`, which the identification does not use.

use nalgebra::{Matrix3, Vector3};
use needlebench_cell::Robot;
use needlebench_kinematics::trajectory::JointState;
use needlebench_kinematics::{
    Body, Chain, Dynamics, Joints, Pose, base_from_base_link, rotation_vector,
};
use needlebench_numerics::random::SplitMix64;
use needlebench_recorded::{KnownArm, ReadOptions, calibrate, identify};

use crate::common::{read_text, robot};

const ROTORS: [f64; 6] = [0.55, 0.65, 0.25, 0.08, 0.06, 0.05];
const CONSTANTS: [f64; 6] = [10.0, 11.0, 7.0, 4.0, 3.5, 3.0];
const COULOMB: [f64; 6] = [3.0, 4.0, 2.0, 1.0, 0.8, 0.6];
const VISCOUS: [f64; 6] = [4.0, 5.0, 2.0, 0.9, 0.7, 0.5];
/// The controller believes in a load of 1 kg; the true one has 0.15 kg more.
const BELIEVED_KG: f64 = 1.0;
const TRUE_KG: f64 = 1.15;
const CENTRE_M: [f64; 3] = [0.01, -0.02, 0.06];
const BELIEVED_GRAVITY: f64 = 9.82;
const GRAVITY: f64 = 9.80665;

/// Joints on sines of their own, which pass through all speeds and both directions.
fn state(t: f64) -> JointState {
    let of = |k: u32| {
        Joints::from_fn(|i, _| {
            let (a, w, p) = (0.9 - 0.08 * i as f64, 0.7 + 0.23 * i as f64, 0.5 * i as f64);
            let turn = f64::from(k) * std::f64::consts::FRAC_PI_2;
            let second = 0.3 * (2.3 * w).powi(k.cast_signed()) * libm::sin(2.3 * w * t + turn);
            a * w.powi(k.cast_signed()) * libm::sin(w * t + p + turn) + second
        })
    };
    JointState {
        position: of(0) + Joints::new(0.3, -1.4, 1.2, -0.6, 0.9, 0.2),
        velocity: of(1),
        acceleration: of(2),
    }
}

fn dynamics(robot: &Robot, mass_kg: f64, gravity: f64) -> Dynamics {
    let load = Body {
        mass_kg,
        com_m: CENTRE_M.into(),
        inertia_kgm2: Matrix3::zeros(),
    };
    let mut bodies = robot.bodies;
    bodies[5] = bodies[5].combined_with(&load.transformed(&robot.chain.wrist_3_from_flange));
    Dynamics {
        chain: robot.chain,
        bodies,
        armature_kgm2: ROTORS.into(),
        gravity_m_s2: Vector3::new(0.0, 0.0, -gravity),
    }
}

/// An arm whose origins are off like those of a real one.
fn miscalibrated(chain: &Chain) -> Chain {
    let mut random = SplitMix64::new(9);
    let mut chain = *chain;
    for joint in &mut chain.joints {
        let mut draw = |most: f64| Vector3::from_fn(|_, _| random.uniform(-most, most));
        let off = Pose::new(draw(0.4e-3), draw(2e-3));
        joint.parent_from_joint *= off;
    }
    chain
}

fn log(robot: &Robot, noise_a: f64) -> String {
    use std::fmt::Write;
    let mut random = SplitMix64::new(4);
    let mut text = String::from("timestamp");
    for name in [
        "target_q",
        "target_qd",
        "target_qdd",
        "target_moment",
        "target_current",
        "actual_q",
        "actual_qd",
        "actual_current",
        "actual_TCP_pose",
    ] {
        for joint in 0..6 {
            write!(text, " {name}_{joint}").unwrap();
        }
    }
    text += " payload payload_cog_0 payload_cog_1 payload_cog_2 robot_mode\n";
    let (believed, real) = (
        dynamics(robot, BELIEVED_KG, BELIEVED_GRAVITY),
        dynamics(robot, TRUE_KG, GRAVITY),
    );
    let chain = miscalibrated(&robot.chain);
    let tool = Pose::new(Vector3::new(0.01, 0.0, 0.15), Vector3::new(0.1, 0.2, 0.3));
    for row in 0..6000 {
        let t = 0.008 * f64::from(row);
        let target = state(t);
        let friction =
            |v: &Joints| Joints::from_fn(|i, _| COULOMB[i] * v[i].signum() + VISCOUS[i] * v[i]);
        let of = |dynamics: &Dynamics| {
            dynamics.inverse_dynamics(&target.position, &target.velocity, &target.acceleration)
        };
        let moment = of(&believed);
        let friction = friction(&target.velocity);
        let constants = Joints::from(CONSTANTS);
        let target_current = (moment + friction).component_div(&constants);
        let noise = Joints::from_fn(|_, _| random.uniform(-noise_a, noise_a));
        let actual_current = (of(&real) + friction).component_div(&constants) + noise;
        // 0.8 ms behind.
        let actual = state(t - 0.8e-3);
        let tcp = base_from_base_link() * chain.base_link_from_flange(&actual.position) * tool;
        let rotation = rotation_vector(&tcp.rotation);
        write!(text, "{t}").unwrap();
        for values in [
            target.position,
            target.velocity,
            target.acceleration,
            moment,
            target_current,
            actual.position,
            actual.velocity,
            actual_current,
        ] {
            for value in values.iter() {
                write!(text, " {value}").unwrap();
            }
        }
        for value in tcp.translation.vector.iter().chain(rotation.iter()) {
            write!(text, " {value}").unwrap();
        }
        let [x, y, z] = CENTRE_M;
        writeln!(text, " {BELIEVED_KG} {x} {y} {z} 7").unwrap();
    }
    text
}

fn near(found: Option<f64>, wanted: f64, tolerance: f64) {
    let found = found.unwrap_or_else(|| panic!("{wanted} is not identifiable"));
    assert!((found - wanted).abs() <= tolerance, "{found} {wanted}");
}

#[test]
fn loads_rotors_friction_and_constants_come_back() {
    let robot = robot("ur3e");
    let run = read_text(&log(&robot, 0.05), &ReadOptions::default()).unwrap();
    let known = KnownArm {
        robot: &robot,
        rotor_inertia_kgm2: None,
        torque_constant_nm_a: None,
        gravity_m_s2: GRAVITY,
    };
    let found = identify(&run, &known);
    let controller = found.controller.unwrap();
    assert!(controller.has_tensors);
    // Without noise: rounding of the sums.
    near(controller.gravity_m_s2.known(), BELIEVED_GRAVITY, 1e-5);
    near(controller.loads[0].mass_kg.known(), BELIEVED_KG, 1e-5);
    for (found, rotor) in controller.rotor_inertia_kgm2.iter().zip(ROTORS) {
        near(found.known(), rotor, 1e-5);
    }
    let law = found.current.unwrap();
    for joint in 0..6 {
        near(
            law.joints[joint].torque_constant_nm_a.known(),
            CONSTANTS[joint],
            1e-6,
        );
        near(law.joints[joint].coulomb_nm.known(), COULOMB[joint], 1e-6);
        near(
            law.joints[joint].viscous_nms_rad.known(),
            VISCOUS[joint],
            1e-6,
        );
    }
    // With noise: within the intervals that are stated, nineteen times of twenty.
    let measured = found.measured.unwrap();
    let mut outside = 0;
    let mut check = |found: &needlebench_recorded::Estimate, wanted: f64| {
        let (value, half) = (found.known().unwrap(), found.half_width.unwrap());
        outside += usize::from((value - wanted).abs() > half);
        // None is off by more than twice its interval.
        assert!((value - wanted).abs() < 2.0 * half, "{found:?} {wanted}");
    };
    check(&measured.loads[0].mass_kg, TRUE_KG);
    for (found, centre_m) in measured.loads[0].centre_m.iter().zip(CENTRE_M) {
        check(found, centre_m);
    }
    for joint in 0..6 {
        check(&measured.rotor_inertia_kgm2[joint], ROTORS[joint]);
        check(&measured.coulomb_nm[joint], COULOMB[joint]);
        check(&measured.viscous_nms_rad[joint], VISCOUS[joint]);
    }
    assert!(outside <= 3, "{outside} of 22");
}

#[test]
fn calibration_and_tool_come_back() {
    /// Far from the poses of the run the prior of weakly shown numbers is left, m.
    const ELSEWHERE_M: f64 = 1e-6;
    let robot = robot("ur3e");
    let run = read_text(&log(&robot, 0.0), &ReadOptions::default()).unwrap();
    let found = calibrate(&run, &robot.chain).unwrap();
    assert!(
        found.is_worth && found.held_out.rms_m < 1e-8,
        "{:?}",
        found.held_out
    );
    // Origins may slide along their axes: what counts is where the tool is, elsewhere too.
    let real = miscalibrated(&robot.chain);
    let tool = Pose::new(Vector3::new(0.01, 0.0, 0.15), Vector3::new(0.1, 0.2, 0.3));
    let fitted_tool = Pose::new(found.tool_position_m.into(), found.tool_rotation_rad.into());
    let mut random = SplitMix64::new(17);
    for _ in 0..200 {
        let q = Joints::from_fn(|_, _| random.uniform(-3.0, 3.0));
        let off = (real.base_link_from_flange(&q) * tool).inverse()
            * (found.chain.base_link_from_flange(&q) * fitted_tool);
        assert!(
            off.translation.vector.norm() < ELSEWHERE_M,
            "{}",
            off.translation.vector.norm()
        );
    }
}

/// What does not move is not identified, whatever the numbers say.
#[test]
fn a_joint_that_stands_is_not_identified() {
    let robot = robot("ur3e");
    let text = log(&robot, 0.0);
    let run = read_text(&text, &ReadOptions::default()).unwrap();
    let mut held = run.clone();
    for (state, q) in held
        .target
        .as_mut()
        .unwrap()
        .iter_mut()
        .zip(&mut held.actual_q)
    {
        state.position[3] = 0.4;
        q[3] = 0.4;
        state.velocity[3] = 0.0;
        state.acceleration[3] = 0.0;
    }
    let known = KnownArm {
        robot: &robot,
        rotor_inertia_kgm2: None,
        torque_constant_nm_a: Some(CONSTANTS),
        gravity_m_s2: GRAVITY,
    };
    let found = identify(&held, &known);
    let measured = found.measured.unwrap();
    for figure in [
        found.controller.unwrap().rotor_inertia_kgm2[3],
        measured.rotor_inertia_kgm2[3],
        measured.coulomb_nm[3],
        measured.viscous_nms_rad[3],
    ] {
        assert_eq!(figure.known(), None, "{figure:?}");
    }
}

/// One posture has three numbers of a load, and a load has four.
#[test]
fn an_arm_at_rest_shows_no_load() {
    let robot = robot("ur3e");
    let mut run = read_text(&log(&robot, 0.0), &ReadOptions::default()).unwrap();
    let posture = run.actual_q[0];
    let held_nm = run.target_moment_nm.as_ref().unwrap()[0];
    run.target_moment_nm.as_mut().unwrap().fill(held_nm);
    run.actual_q.fill(posture);
    let target = run.target.as_mut().unwrap();
    for state in target {
        state.position = posture;
        state.velocity.fill(0.0);
        state.acceleration.fill(0.0);
    }
    let known = KnownArm {
        robot: &robot,
        rotor_inertia_kgm2: None,
        torque_constant_nm_a: Some(CONSTANTS),
        gravity_m_s2: GRAVITY,
    };
    let load = identify(&run, &known).controller.unwrap().loads[0];
    assert_eq!(load.mass_kg.value, None, "{load:?}");
    for centre in load.centre_m {
        assert_eq!(centre.value, None, "{load:?}");
    }
}

/// As many rows as unknowns are fitted whatever they hold.
#[test]
fn a_few_rows_determine_no_torque_constant() {
    let robot = robot("ur3e");
    let run = read_text(&log(&robot, 0.0), &ReadOptions::default()).unwrap();
    let mut few = run.clone();
    for (row, state) in few.target.as_mut().unwrap().iter_mut().enumerate() {
        // All rows but three of joint 1 are too slow to count, and not at rest.
        if ![10, 200, 400].contains(&row) {
            state.velocity[1] = 1e-3;
        }
    }
    let known = KnownArm {
        robot: &robot,
        rotor_inertia_kgm2: None,
        torque_constant_nm_a: None,
        gravity_m_s2: GRAVITY,
    };
    let constant = identify(&few, &known).current.unwrap().joints[1].torque_constant_nm_a;
    assert_eq!(constant.known(), None, "{constant:?}");
    let constant = identify(&run, &known).current.unwrap().joints[1].torque_constant_nm_a;
    assert!(constant.known().is_some());
}
