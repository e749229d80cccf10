//! Engines against the referee on a tracked motion of two seconds.

use crate::process as harness;
use nalgebra::{Point3, Vector3};
use needlebench_cell::Cell;
use needlebench_engine::{
    Actuation, EngineError, Hooks, MujocoPlant, MujocoSettings, Plant, PlantState, RapierPlant,
    RapierSettings, Recording, RefereePlant, RefereeSettings, Servo, ServoGains, TorqueHold,
    retrace, simulate,
};
use needlebench_kinematics::Joints;
use needlebench_kinematics::trajectory::{JointTrajectory, MotionLimits, Phase, ProfileLimits};

const START: Joints = Joints::new(0.2, -1.6, 1.5, -1.2, -1.4, 0.3);

/// At up to 1.5 rad/s and 4 rad/s^2.
fn trajectory() -> JointTrajectory {
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
    JointTrajectory::starting_at(START)
        .then_straight_to(
            Phase::Transfer,
            Joints::new(1.4, -1.0, 0.9, -2.0, -0.4, 1.3),
            &limits,
        )
        .then_hold(Phase::Hold, 0.725)
}

fn servo(cell: &Cell) -> Servo {
    Servo {
        dynamics: cell.dynamics(),
        gains: ServoGains::default(),
        effort_limit_nm: cell.robot.limits.efforts_nm(),
    }
}

fn referee(cell: &Cell, timestep_s: f64, hold: TorqueHold) -> RefereePlant {
    let settings = RefereeSettings {
        hold,
        ..RefereeSettings::default()
    };
    RefereePlant::new(cell, timestep_s, &settings).unwrap()
}

/// A point 0.25 m before the flange, where the tip of a long needle may be.
fn tip(state: &PlantState) -> Vector3<f64> {
    (state.world_from_flange * Point3::new(0.0, 0.06, 0.25)).coords
}

fn peak_m(a: &[PlantState], b: &[PlantState]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter()
        .zip(b)
        .map(|(a, b)| (tip(a) - tip(b)).norm())
        .fold(0.0, f64::max)
}

/// Recordings of rapier and MuJoCo.
fn engines(cell: &Cell, timestep_s: f64) -> [Recording; 2] {
    let servo = servo(cell);
    let mut harness = harness::harness();
    let mut rapier = RapierPlant::new(cell, timestep_s, &RapierSettings::default()).unwrap();
    let mut mujoco =
        MujocoPlant::new(&mut harness, cell, timestep_s, &MujocoSettings::default()).unwrap();
    let plants: [&mut dyn Plant; 2] = [&mut rapier, &mut mujoco];
    plants.map(|plant| {
        simulate(
            plant,
            &servo,
            &Actuation::default(),
            &trajectory(),
            Hooks::default(),
        )
        .unwrap()
    })
}

/// The figure that was asked for; 0.06 um is seen.
const PEAK_AT_TENTH_OF_MS_M: f64 = 0.5e-6;

#[test]
fn engines_stay_with_the_referee_under_the_same_torques() {
    let cell = crate::common::ur3(Vec::new());
    let timestep_s = 1e-4;
    let mut plant = referee(&cell, timestep_s, TorqueHold::AroundSample);
    for recording in engines(&cell, timestep_s) {
        let gains = ServoGains::default();
        let steps = recording.steps();
        let held = retrace(&mut plant, &recording, steps, Some(&gains)).unwrap();
        let peak = peak_m(&recording.state, &held);
        let settled = (tip(&recording.state[steps]) - tip(&held[steps])).norm();
        println!(
            "{} at 0.1 ms: peak {peak:e} m, settled {settled:e} m",
            recording.engine.name
        );
        assert!(peak < PEAK_AT_TENTH_OF_MS_M);
        // Both rest where the torque is gravity's; 3e-14 m is seen.
        assert!(settled < 1e-12);
    }
}

/// Measured at 1, 0.5 and 0.25 ms: 1.03 and 1.01.
const ORDER_TOLERANCE: f64 = 0.1;

#[test]
fn engines_converge_to_the_referee_with_first_order() {
    let cell = crate::common::ur3(Vec::new());
    let servo = servo(&cell);
    // Tip under centred torques, velocity under torques from their sample on.
    let mut errors = [[0.0; 2]; 2].map(|each| [each; 3]);
    for (which, timestep_s) in [1e-3, 5e-4, 2.5e-4].into_iter().enumerate() {
        let [centred, plain] = [TorqueHold::AroundSample, TorqueHold::FromSample].map(|hold| {
            let mut plant = referee(&cell, timestep_s, hold);
            simulate(
                &mut plant,
                &servo,
                &Actuation::default(),
                &trajectory(),
                Hooks::default(),
            )
            .unwrap()
        });
        for (engine, recording) in engines(&cell, timestep_s).iter().enumerate() {
            let speed = recording
                .state
                .iter()
                .zip(&plain.state)
                .map(|(a, b)| (a.velocity - b.velocity).amax())
                .fold(0.0, f64::max);
            errors[engine][which] = [peak_m(&recording.state, &centred.state), speed];
        }
    }
    for (name, [coarse, middle, fine]) in ["rapier", "mujoco"].into_iter().zip(errors) {
        for quantity in 0..2 {
            let what = ["tip (m)", "velocity (rad/s)"][quantity];
            let orders = [
                (coarse[quantity] / middle[quantity]).log2(),
                (middle[quantity] / fine[quantity]).log2(),
            ];
            println!(
                "{name}, {what}: {:.3e}, {:.3e}, {:.3e}: order {:.3}, {:.3}",
                coarse[quantity], middle[quantity], fine[quantity], orders[0], orders[1]
            );
            for order in orders {
                assert!(
                    (order - 1.0).abs() < ORDER_TOLERANCE,
                    "{name} {what} {order}"
                );
            }
        }
    }
}

#[test]
fn closed_loop_and_held_back_torques_are_the_same_comparison() {
    let cell = crate::common::ur3(Vec::new());
    let servo = servo(&cell);
    let mut rapier = RapierPlant::new(&cell, 1e-3, &RapierSettings::default()).unwrap();
    let recording = simulate(
        &mut rapier,
        &servo,
        &Actuation::default(),
        &trajectory(),
        Hooks::default(),
    )
    .unwrap();
    let mut plant = referee(&cell, 1e-3, TorqueHold::AroundSample);
    let closed = simulate(
        &mut plant,
        &servo,
        &Actuation::default(),
        &trajectory(),
        Hooks::default(),
    )
    .unwrap();
    let steps = recording.steps();
    let held = retrace(&mut plant, &recording, steps, Some(&servo.gains)).unwrap();
    // The same torques in another order of summation, over 2000 steps; 2e-14 m is seen.
    assert!(peak_m(&closed.state, &held) < 1e-12);
    // Without anything to hold it the raised arm leaves the motion.
    let unaided = retrace(&mut plant, &recording, steps, None).unwrap();
    let lost = peak_m(&recording.state, &unaided);
    println!("unaided: {lost:e} m");
    assert!(lost > 1e-3);
    // A part of the recording is a part of the motion.
    let part = retrace(&mut plant, &recording, 100, Some(&servo.gains)).unwrap();
    assert_eq!(part, held[..=100]);
}

#[test]
fn the_half_step_ahead_is_never_in_the_state() {
    // Torques that alternate would add up if the look ahead were kept.
    let cell = crate::common::ur3(Vec::new());
    let mut ahead = referee(&cell, 1e-3, TorqueHold::AroundSample);
    let mut exact = referee(&cell, 5e-4, TorqueHold::FromSample);
    ahead.reset(&START).unwrap();
    exact.reset(&START).unwrap();
    let rest = cell.dynamics().gravity_torque(&START);
    let torque = |k: u32| rest + Joints::repeat(if k.is_multiple_of(2) { 1.0 } else { -1.0 });
    let mut middle = exact.step(&torque(0)).unwrap();
    for k in 0..100 {
        let state = ahead.step(&torque(k)).unwrap();
        // Velocities belong to the middle of the step, just before the next torque.
        assert!((state.velocity - middle.velocity).amax() < 1e-11);
        exact.step(&torque(k + 1)).unwrap();
        middle = exact.step(&torque(k + 1)).unwrap();
    }
}

#[test]
fn bad_settings_and_torques_are_refused() {
    let cell = crate::common::ur3(Vec::new());
    for tolerance in [0.0, -1.0, f64::NAN, 1.0] {
        let settings = RefereeSettings {
            tolerance,
            ..RefereeSettings::default()
        };
        let error = RefereePlant::new(&cell, 1e-3, &settings).unwrap_err();
        assert!(matches!(error, EngineError::BadSetting { .. }), "{error}");
    }
    let error = RefereePlant::new(&cell, 0.0, &RefereeSettings::default()).unwrap_err();
    assert!(matches!(error, EngineError::BadTimestep { .. }), "{error}");
    let mut plant = referee(&cell, 1e-3, TorqueHold::FromSample);
    plant.reset(&START).unwrap();
    let mut torque = Joints::zeros();
    torque[3] = f64::NAN;
    let error = plant.step(&torque).unwrap_err();
    assert!(
        matches!(
            error,
            EngineError::Diverged {
                joint: "wrist_1",
                ..
            }
        ),
        "{error}"
    );
}
