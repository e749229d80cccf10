//! Work for an instruction counter: `instructions OPERATION COUNT` does one operation so often.
//!
//! `.ci/instructions` runs it under valgrind with two counts and divides the difference. Run at the top of the checkout.

mod inverse;

use std::hint::black_box;
use std::path::Path;

use needlebench_bench::study::StaticWorker;
use needlebench_clearance::{CertificateOptions, ClearanceModel, certify};
use needlebench_engine::{
    Actuation, Hooks, Plant, RapierPlant, RapierSettings, Servo, ServoGains, simulate,
};
use needlebench_kinematics::Joints;
use needlebench_kinematics::trajectory::{JointTrajectory, MotionLimits, Phase, ProfileLimits};
use needlebench_scenario::{
    Change, KeyPath, Overrides, ResolvedScenario, ScenarioFamily, load_scenario,
};

const SCENARIO: &str = "scenarios/table3.toml";
const TIMESTEP_S: f64 = 1e-3;

/// A posture on the way to Right-Down-Fold of Table 3.
const ON_THE_WAY: Joints = Joints::new(-0.4, -2.7, 0.6, -1.7, 1.4, 0.05);

fn table3() -> ResolvedScenario {
    load_scenario(Path::new(SCENARIO), &Overrides::default())
        .expect("the shipped scenario is sound")
}

/// Half a radian in every joint, and then as long a rest as is asked for.
fn motion(rest_s: f64) -> JointTrajectory {
    let limits = MotionLimits {
        velocity: Joints::repeat(1.0),
        acceleration: Joints::repeat(2.0),
        jerk: Joints::repeat(20.0),
        line: ProfileLimits {
            velocity: 0.1,
            acceleration: 0.5,
            jerk: 5.0,
        },
    };
    JointTrajectory::starting_at(ON_THE_WAY)
        .then_straight_to(Phase::Transfer, ON_THE_WAY.add_scalar(0.5), &limits)
        .then_hold(Phase::Hold, rest_s)
}

fn postures(count: u32) {
    let resolved = table3();
    let model = ClearanceModel::new(&resolved.cell);
    for k in 0..count {
        let q = ON_THE_WAY.add_scalar(1e-3 * f64::from(k));
        black_box(model.minimum_per_class(black_box(&q)));
    }
}

fn certificates(count: u32) {
    let resolved = table3();
    let model = ClearanceModel::new(&resolved.cell);
    let motion = motion(0.5);
    for _ in 0..count {
        black_box(certify(
            &model,
            black_box(&motion),
            &CertificateOptions::default(),
        ));
    }
}

/// Cases of the goal of Table 3 with the phantom moved.
fn static_cases(count: u32) {
    let family = ScenarioFamily::load(Path::new(SCENARIO), &Overrides::default())
        .expect("the shipped scenario is sound");
    let key = KeyPath::parse("phantom.position_mm[0]").expect("a path");
    let mut worker = StaticWorker::default();
    for k in 0..count {
        let change = (key.clone(), Change::Add(0.1 * f64::from(k)));
        let resolved = family.vary("pose", &[change]).expect("a sound layout");
        black_box(worker.rows(&resolved));
    }
}

/// Steps of a rest at the end of a motion, under the servo.
fn rapier_steps(count: u32) {
    let cell = table3().cell;
    let servo = Servo {
        dynamics: cell.dynamics(),
        gains: ServoGains::default(),
        effort_limit_nm: cell.robot.limits.efforts_nm(),
    };
    let mut plant = RapierPlant::new(&cell, TIMESTEP_S, &RapierSettings::default())
        .expect("the shipped cell has a model");
    let plant: &mut dyn Plant = &mut plant;
    let motion = motion(TIMESTEP_S * f64::from(count));
    let actuation = Actuation::default();
    black_box(simulate(plant, &servo, &actuation, &motion, Hooks::default()).expect("it runs"));
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [operation, count] = arguments.as_slice() else {
        eprintln!("instructions OPERATION COUNT");
        std::process::exit(2);
    };
    let count: u32 = count.parse().expect("a count");
    match operation.as_str() {
        "posture" => postures(count),
        "certificate" => certificates(count),
        "static_case" => static_cases(count),
        "rapier_step" => rapier_steps(count),
        other => inverse::run(other, count as usize),
    }
}
