//! Both engines with the shipped models, robot, tool and surroundings as `scenarios/table3.toml` and
//! `scenarios/hanging.toml` have them: against our kinematics and dynamics, and against each other.

use std::f64::consts::PI;
use std::path::Path;
use std::time::Duration;

use nalgebra::{Matrix6, Point3, Vector3};
use needlebench_cell::Cell;
use needlebench_clearance::ClearanceModel;
use needlebench_engine::mujoco::{HarnessProcess, ensure};
use needlebench_engine::{
    Actuation, Hooks, MujocoPlant, MujocoSettings, Plant, PlantState, RapierPlant, RapierSettings,
    Recording, Servo, ServoGains, simulate,
};
use needlebench_kinematics::{Joints, Pose, rotation_angle_between};
use needlebench_planning::Planner;
use needlebench_scenario::{Goal, Overrides, ResolvedScenario, resolve_scenario};

/// Six compositions of poses with coordinates below 2 m, in metres and radians; 1.6e-15 is seen.
const LINK_POSE: f64 = 2e-14;

/// Relative to the largest entry; 2e-15 is seen in mass matrices, 4e-15 in gravity torque, 1e-14 in
/// inverse dynamics.
const DYNAMICS: f64 = 1e-13;

/// 1.8e-14 N m is seen, both in the step from rest and at the end of a motion.
const HOLDING_TORQUE_NM: f64 = 2e-13;

/// 32 nm is seen over all configurations.
const PEAK_TIP_M: f64 = 0.1e-6;

/// 6.5e-16 m is seen.
const SETTLED_TIP_M: f64 = 1e-14;

/// States for each comparison.
const STATES: usize = 100;

/// A robot that stands, and one that hangs.
const SCENARIOS: [&str; 2] = ["table3.toml", "hanging.toml"];

fn scenario(name: &str) -> ResolvedScenario {
    let file = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../scenarios")
        .join(name);
    let text = std::fs::read_to_string(&file).unwrap();
    let base = file.parent().unwrap();
    resolve_scenario(name, &text, base, &Overrides::default()).unwrap()
}

fn harness() -> HarnessProcess {
    let environment = ensure(&mut |stage| println!("{stage}")).unwrap();
    HarnessProcess::start(&environment, Duration::from_mins(1)).unwrap()
}

fn timestep_s(scenario: &ResolvedScenario) -> f64 {
    scenario.scenario.engines.timestep_ms * 1e-3
}

fn rapier(scenario: &ResolvedScenario) -> RapierPlant {
    let settings = RapierSettings::default();
    RapierPlant::new(&scenario.cell, timestep_s(scenario), &settings).unwrap()
}

fn mujoco<'h>(scenario: &ResolvedScenario, harness: &'h mut HarnessProcess) -> MujocoPlant<'h> {
    let settings = MujocoSettings::default();
    MujocoPlant::new(harness, &scenario.cell, timestep_s(scenario), &settings).unwrap()
}

/// Numbers in [-1, 1), the same on every machine (SplitMix64).
struct Random(u64);

impl Random {
    fn number(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn joints(&mut self, amplitude: f64) -> Joints {
        Joints::from_fn(|_, _| amplitude * self.number())
    }
}

fn difference(a: &Pose, b: &Pose) -> f64 {
    let position = (a.translation.vector - b.translation.vector).norm();
    position.max(rotation_angle_between(&a.rotation, &b.rotation))
}

fn worst_pose(cell: &Cell, plant: &mut dyn Plant) -> f64 {
    let mut random = Random(1);
    let mut worst: f64 = 0.0;
    for _ in 0..STATES {
        let q = random.joints(PI);
        let state = plant.reset(&q).unwrap();
        let flange = cell.robot.world_from_flange(&q);
        worst = worst.max(difference(&flange, &state.world_from_flange));
        let theirs = plant.link_poses().unwrap();
        for (ours, theirs) in cell.robot.world_from_links(&q).iter().zip(&theirs) {
            worst = worst.max(difference(ours, theirs));
        }
    }
    worst
}

#[test]
fn engine_bodies_are_where_forward_kinematics_puts_them() {
    let mut harness = harness();
    for name in SCENARIOS {
        let scenario = scenario(name);
        let (mut rapier, mut mujoco) = (rapier(&scenario), mujoco(&scenario, &mut harness));
        let plants: [&mut dyn Plant; 2] = [&mut rapier, &mut mujoco];
        for plant in plants {
            let worst = worst_pose(&scenario.cell, plant);
            let engine = plant.identity().name;
            println!("{name} {engine}: {worst:e} m or rad");
            println!("figure {engine}_pose {worst:e}");
            assert!(worst < LINK_POSE, "{engine}: {worst:e}");
        }
    }
}

#[test]
fn engines_have_the_dynamics_of_arm_and_tool() {
    let mut harness = harness();
    for name in SCENARIOS {
        check_dynamics(&scenario(name), &mut harness);
    }
}

fn check_dynamics(scenario: &ResolvedScenario, harness: &mut HarnessProcess) {
    let dynamics = scenario.cell.dynamics();
    let tool_kg = scenario.cell.tool.body.mass_kg;
    let wrist_3_kg = scenario.cell.robot.bodies[5].mass_kg;
    assert!(tool_kg > 0.1);
    assert!((dynamics.bodies[5].mass_kg - wrist_3_kg - tool_kg).abs() < 1e-15);

    let (mut rapier, mut mujoco) = (rapier(scenario), mujoco(scenario, harness));
    let mut random = Random(2);
    let mut worst = [0.0_f64; 4];
    for _ in 0..STATES {
        let q = random.joints(PI);
        let (qd, qdd) = (random.joints(3.0), random.joints(10.0));
        let mass = dynamics.mass_matrix(&q);
        let gravity = dynamics.gravity_torque(&q);
        let torque = dynamics.inverse_dynamics(&q, &qd, &qdd);
        let theirs = mujoco.inverse_dynamics(&q, &qd, &qdd).unwrap();
        let their_mass = Matrix6::from_fn(|row, column| theirs.mass_matrix[(row, column)]);
        let joints = |v: &nalgebra::DVector<f64>| Joints::from_column_slice(v.as_slice());
        rapier.reset(&q).unwrap();
        let errors = [
            (rapier.mass_matrix() - mass).amax() / mass.amax(),
            (their_mass - mass).amax() / mass.amax(),
            (joints(&theirs.gravity_nm) - gravity).amax() / gravity.amax(),
            (joints(&theirs.torque_nm) - torque).amax() / torque.amax(),
        ];
        for (worst, error) in worst.iter_mut().zip(errors) {
            *worst = worst.max(error);
        }
    }
    let names = [
        "rapier_mass",
        "mujoco_mass",
        "mujoco_gravity",
        "mujoco_torque",
    ];
    for (name, worst) in names.iter().zip(&worst) {
        println!("figure {name} {worst:e}");
    }
    assert!(worst.iter().all(|&error| error < DYNAMICS), "{worst:?}");
}

/// Torque that is missing to keep the arm still under our gravity torque, N m.
fn worst_holding_torque(cell: &Cell, plant: &mut dyn Plant) -> f64 {
    let dynamics = cell.dynamics();
    let mut random = Random(3);
    let mut worst: f64 = 0.0;
    let mut postures = 0;
    while postures < STATES {
        let q = random.joints(PI);
        if plant.reset(&q).unwrap().contact.count > 0 {
            continue; // something touches
        }
        postures += 1;
        let state = plant.step(&dynamics.gravity_torque(&q)).unwrap();
        if state.contact.count == 0 {
            let missing = dynamics.mass_matrix(&q) * state.velocity / plant.timestep_s();
            worst = worst.max(missing.amax());
        }
    }
    worst
}

#[test]
fn gravity_torque_holds_arm_and_tool_still() {
    let mut harness = harness();
    for name in SCENARIOS {
        let scenario = scenario(name);
        let (mut rapier, mut mujoco) = (rapier(&scenario), mujoco(&scenario, &mut harness));
        let plants: [&mut dyn Plant; 2] = [&mut rapier, &mut mujoco];
        for plant in plants {
            let worst = worst_holding_torque(&scenario.cell, plant);
            println!("{name} {}: {worst:e} N m", plant.identity().name);
            println!("figure holding_from_rest_nm {worst:e}");
            assert!(worst < HOLDING_TORQUE_NM, "{worst:e}");
        }
    }
}

fn servo(scenario: &ResolvedScenario) -> Servo {
    let settings = &scenario.servo;
    Servo {
        dynamics: scenario.cell.dynamics(),
        gains: ServoGains {
            kp_nm_per_rad: settings.stiffness_nm_rad,
            kd_nms_per_rad: settings.damping_nms_rad,
        },
        effort_limit_nm: scenario.cell.robot.limits.efforts_nm(),
    }
}

/// Tip of the inserted needle, in the world.
fn tip(cell: &Cell, goal: &Goal, state: &PlantState) -> Vector3<f64> {
    let ahead = Point3::new(0.0, 0.0, goal.insertion_length_m);
    (state.world_from_flange * cell.tool.flange_from_guide_exit * ahead).coords
}

#[test]
fn engines_agree_along_every_planned_motion() {
    let scenario = scenario("table3.toml");
    let clearance = ClearanceModel::new(&scenario.cell);
    let planner = Planner::new(&scenario, &clearance).unwrap();
    let goal = &scenario.goals[0];
    let plan = planner.plan(goal);
    let servo = servo(&scenario);
    let mut harness = harness();
    let (mut rapier, mut mujoco) = (rapier(&scenario), mujoco(&scenario, &mut harness));
    let mut working = 0;
    for configuration in &plan.configurations {
        if !configuration.rejections.is_empty() {
            continue;
        }
        working += 1;
        let trajectory = configuration.trajectory.as_ref().unwrap();
        let plants: [&mut dyn Plant; 2] = [&mut rapier, &mut mujoco];
        let [a, b]: [Recording; 2] = plants.map(|plant| {
            simulate(
                plant,
                &servo,
                &Actuation::default(),
                trajectory,
                Hooks::default(),
            )
            .unwrap()
        });
        let differences: Vec<f64> = a
            .state
            .iter()
            .zip(&b.state)
            .map(|(a, b)| (tip(&scenario.cell, goal, a) - tip(&scenario.cell, goal, b)).norm())
            .collect();
        let peak = differences.iter().copied().fold(0.0, f64::max);
        let settled = differences[differences.len() - 1];
        let name = configuration.configuration;
        println!("{name}: tips differ by at most {peak:e} m, at the end by {settled:e} m");
        println!("figure tips_peak_nm {:e}", peak * 1e9);
        println!("figure tips_settled_m {settled:e}");
        assert!(peak < PEAK_TIP_M, "{name}: {peak:e}");
        assert!(settled < SETTLED_TIP_M, "{name}: {settled:e}");
        for recording in [&a, &b] {
            assert_eq!(recording.saturated_steps, 0, "{name}");
            assert!(recording.state.iter().all(|state| state.contact.count == 0));
            let last = recording.torque_nm[recording.steps() - 1];
            let position = recording.state[recording.steps()].position;
            let holding = (last - servo.dynamics.gravity_torque(&position)).amax();
            println!(
                "  {}: holding torque {holding:e} N m",
                recording.engine.name
            );
            println!("figure holding_at_the_end_nm {holding:e}");
            assert!(holding < HOLDING_TORQUE_NM, "{name}: {holding:e}");
        }
    }
    assert!(working >= 6, "{working} configurations work");
}
