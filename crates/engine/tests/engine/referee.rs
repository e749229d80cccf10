//! Engines against the referee on a tracked motion of two seconds.

use crate::process as harness;
use nalgebra::{Point3, Vector3};
use needlebench_cell::Cell;
use needlebench_engine::{
    Actuation, EngineError, Hooks, MujocoPlant, MujocoSettings, Plant, PlantState, RapierPlant,
    RapierSettings, Recording, RefereePlant, RefereeSettings, Servo, ServoGains, TorqueHold,
    simulate,
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

/// A window of held torques, s.
const WINDOW_S: f64 = 0.05;

/// Largest distance of the tips at the end of a window of held torques, and the largest growth.
fn held_peak_m(plant: &RefereePlant, recording: &Recording) -> (f64, f64) {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "some steps"
    )]
    let window_steps = (WINDOW_S / recording.timestep_s).round() as usize;
    let windows = plant
        .held_windows(recording, recording.steps(), window_steps)
        .unwrap();
    assert_eq!(windows.last().unwrap().last, recording.steps());
    windows.iter().fold((0.0, 1.0), |(peak_m, growth), window| {
        let apart_m = (tip(&recording.state[window.last]) - tip(&window.state)).norm();
        (f64::max(peak_m, apart_m), f64::max(growth, window.growth))
    })
}

/// The trajectory in rapier.
fn in_rapier(cell: &Cell, servo: &Servo, timestep_s: f64) -> Recording {
    let mut plant = RapierPlant::new(cell, timestep_s, &RapierSettings::default()).unwrap();
    let actuation = Actuation::default();
    simulate(
        &mut plant,
        servo,
        &actuation,
        &trajectory(),
        Hooks::default(),
    )
    .unwrap()
}

/// Most that gravity may enlarge a difference by over a window; 1.02 is seen.
const MOST_GROWTH: f64 = 1.1;

#[test]
fn engines_converge_to_the_referee_under_held_torques_with_first_order() {
    let cell = crate::common::ur3(Vec::new());
    let mut errors = [[0.0; 3]; 2];
    for (which, timestep_s) in [1e-3, 5e-4, 2.5e-4].into_iter().enumerate() {
        let plant = referee(&cell, timestep_s, TorqueHold::default());
        for (engine, recording) in engines(&cell, timestep_s).iter().enumerate() {
            let (peak_m, growth) = held_peak_m(&plant, recording);
            println!(
                "{} at {timestep_s} s: {peak_m:.3e} m in a window, growth {growth:.3}",
                recording.engine.name
            );
            errors[engine][which] = peak_m;
            assert!(growth < MOST_GROWTH, "{growth}");
        }
    }
    for [coarse, middle, fine] in errors {
        for order in [libm::log2(coarse / middle), libm::log2(middle / fine)] {
            assert!((order - 1.0).abs() < ORDER_TOLERANCE, "{order}");
        }
    }
}

/// A fault of 1 % has to stand out of the integration's own error by this at least.
const STANDS_OUT: f64 = 20.0;

/// What the same fault may change by between two servos: the windows start from other states.
const WHATEVER_THE_SERVO: f64 = 0.1;

#[test]
fn a_percent_of_mass_or_gravity_shows_under_held_torques_whatever_the_servo() {
    let timestep_s = 2.5e-4;
    let cell = crate::common::ur3(Vec::new());
    let plant = referee(&cell, timestep_s, TorqueHold::default());
    let mut heavier = cell.clone();
    for body in &mut heavier.robot.bodies {
        body.mass_kg *= 1.01;
        body.inertia_kgm2 *= 1.01;
    }
    let mut faster_fall = cell.clone();
    faster_fall.gravity_m_s2 *= 1.01;
    let soft = servo(&cell);
    let stiff = {
        let mut gains = soft.gains;
        gains.kp_nm_per_rad = gains.kp_nm_per_rad.map(|kp| 16.0 * kp);
        gains.kd_nms_per_rad = gains.kd_nms_per_rad.map(|kd| 4.0 * kd);
        Servo { gains, ..soft }
    };
    let closed_loop_m = |recording: &Recording, servo: &Servo| {
        let mut plant = referee(&cell, timestep_s, TorqueHold::default());
        let actuation = Actuation::default();
        let closed = simulate(
            &mut plant,
            servo,
            &actuation,
            &trajectory(),
            Hooks::default(),
        )
        .unwrap();
        peak_m(&recording.state, &closed.state)
    };
    let (right_m, _) = held_peak_m(&plant, &in_rapier(&cell, &soft, timestep_s));
    for (fault, wrong) in [("mass", &heavier), ("gravity", &faster_fall)] {
        let [held, closed]: [Vec<f64>; 2] = {
            let runs = [&soft, &stiff].map(|servo| {
                let recording = in_rapier(wrong, servo, timestep_s);
                (
                    held_peak_m(&plant, &recording).0,
                    closed_loop_m(&recording, servo),
                )
            });
            [
                runs.map(|(held_m, _)| held_m).to_vec(),
                runs.map(|(_, closed_m)| closed_m).to_vec(),
            ]
        };
        println!(
            "{fault} off by 1 %: held torques {:.3e} and {:.3e} m, closed loop {:.3e} and {:.3e} m; \
             right: {right_m:.3e} m",
            held[0], held[1], closed[0], closed[1]
        );
        assert!(held.iter().all(|each| *each > STANDS_OUT * right_m));
        assert!((held[1] / held[0] - 1.0).abs() < WHATEVER_THE_SERVO);
        // In closed loop the same fault goes with the servo's compliance: 16 times stiffer, about a 16th.
        assert!(closed[1] < closed[0] / 8.0);
    }
}

/// What the tolerance of 1e-12 per step and the search for the start of a window leave, m.
const OWN_WINDOW_M: f64 = 1e-10;

#[test]
fn windows_of_the_referees_own_motion_end_where_it_is() {
    let cell = crate::common::ur3(Vec::new());
    let servo = servo(&cell);
    for hold in [TorqueHold::AroundSample, TorqueHold::FromSample] {
        let mut plant = referee(&cell, 1e-3, hold);
        let actuation = Actuation::default();
        let recording = simulate(
            &mut plant,
            &servo,
            &actuation,
            &trajectory(),
            Hooks::default(),
        )
        .unwrap();
        let (peak_m, _) = held_peak_m(&plant, &recording);
        println!("{hold:?}: {peak_m:e} m");
        assert!(peak_m < OWN_WINDOW_M, "{peak_m:e}");
        // A motion that is shorter than a window has none.
        assert_eq!(plant.held_windows(&recording, 49, 50).unwrap(), []);
    }
}

/// Part of the growth that the linearization leaves out, for a difference of a microradian.
const LINEARIZED: f64 = 1e-5;

#[test]
fn gravity_enlarges_no_difference_by_more_than_the_growth() {
    let cell = crate::common::ur3(Vec::new());
    let plant = referee(&cell, 1e-3, TorqueHold::default());
    let dynamics = cell.dynamics();
    let still = JointTrajectory::starting_at(START).then_hold(Phase::Hold, 0.3);
    let mut recording = {
        let mut plant = referee(&cell, 1e-3, TorqueHold::default());
        let actuation = Actuation::default();
        simulate(
            &mut plant,
            &servo(&cell),
            &actuation,
            &still,
            Hooks::default(),
        )
        .unwrap()
    };
    let steps = recording.steps();
    let window = |recording: &Recording| plant.held_windows(recording, steps, steps).unwrap()[0];
    let undisturbed = window(&recording);
    let root = dynamics.mass_matrix(&START).cholesky().unwrap().l();
    let mut most = 0.0_f64;
    let mut random = needlebench_numerics::random::SplitMix64::new(2);
    for _ in 0..40 {
        let difference = Joints::from_fn(|_, _| 1e-6 * random.uniform(-1.0, 1.0));
        recording.state[0].position = START + difference;
        let moved = window(&recording).state.position - undisturbed.state.position;
        let size = |each: &Joints| (root.transpose() * each).norm();
        most = most.max(size(&moved) / size(&difference));
    }
    println!("grown {most:.5} of {:.5} times", undisturbed.growth);
    assert!(most < undisturbed.growth * (1.0 + LINEARIZED));
    // Random directions come near to the worst one.
    assert!(most - 1.0 > 0.3 * (undisturbed.growth - 1.0));
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
                libm::log2(coarse[quantity] / middle[quantity]),
                libm::log2(middle[quantity] / fine[quantity]),
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
