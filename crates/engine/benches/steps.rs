//! What control, observation, recording and lock-step cost over the bare engines' steps.
//!
//! `cargo bench -p needlebench-engine`, or for one core `taskset -c 0 cargo bench ...`. All figures
//! are minima over interleaved repetitions of one motion in the cell of Table 3 with the same
//! torques; criterion cannot set the sides of a ratio beside each other like that.

use std::path::Path;
use std::time::{Duration, Instant};

use needlebench_cell::Cell;
use needlebench_engine::mujoco::{HarnessProcess, ensure};
use needlebench_engine::{
    Actuation, Fleet, Hooks, Keep, Motion, MujocoFleet, MujocoPlant, MujocoSettings, Plant,
    RapierPlant, RapierSettings, Recording, Servo, ServoGains, simulate, simulate_fleet,
};
use needlebench_kinematics::Joints;
use needlebench_kinematics::trajectory::{JointTrajectory, MotionLimits, Phase, ProfileLimits};
use needlebench_scenario::{Overrides, load_scenario};

const TIMESTEP_S: f64 = 1e-3;
const REPETITIONS: usize = 25;
/// As many as a goal has configurations.
const ARMS: usize = 8;

/// A posture on the way to Right-Down-Fold of Table 3.
const START: Joints = Joints::new(-0.4, -2.7, 0.6, -1.7, 1.4, 0.05);

fn trajectory() -> JointTrajectory {
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
    JointTrajectory::starting_at(START)
        .then_straight_to(Phase::Transfer, START.add_scalar(0.5), &limits)
        .then_hold(Phase::Hold, 1.0)
}

struct Bench {
    cell: Cell,
    servo: Servo,
    actuation: Actuation,
    trajectory: JointTrajectory,
}

/// Shortest of the times that each of some tasks took, in turn, us a step.
fn minima<const N: usize>(steps: usize, mut tasks: [&mut dyn FnMut() -> Duration; N]) -> [f64; N] {
    let mut shortest = [Duration::MAX; N];
    for _ in 0..REPETITIONS {
        for (task, shortest) in tasks.iter_mut().zip(&mut shortest) {
            *shortest = task().min(*shortest);
        }
    }
    shortest.map(|time| time.as_secs_f64() * 1e6 / steps as f64)
}

fn timed(mut task: impl FnMut()) -> Duration {
    let started = Instant::now();
    task();
    started.elapsed()
}

impl Bench {
    fn new() -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/table3.toml");
        let scenario = load_scenario(&path, &Overrides::default()).expect("a shipped scenario");
        Self {
            servo: Servo {
                dynamics: scenario.cell.dynamics(),
                gains: ServoGains::default(),
                effort_limit_nm: scenario.cell.robot.limits.efforts_nm(),
            },
            cell: scenario.cell,
            actuation: Actuation::default(),
            trajectory: trajectory(),
        }
    }

    fn run(&self, plant: &mut dyn Plant) -> Recording {
        let (servo, actuation) = (&self.servo, &self.actuation);
        let recording = simulate(plant, servo, actuation, &self.trajectory, Hooks::default());
        let recording = recording.expect("a motion in free space");
        let touched = recording.state.iter().any(|state| state.contact.count > 0);
        assert!(!touched, "a motion in free space");
        recording
    }

    fn rapier(&self) {
        let settings = RapierSettings::default();
        let mut plant = RapierPlant::new(&self.cell, TIMESTEP_S, &settings).expect("a sound cell");
        let recording = self.run(&mut plant);
        let mut second = RapierPlant::new(&self.cell, TIMESTEP_S, &settings).expect("a sound cell");
        let [bare_us, full_us] = minima(
            recording.steps(),
            [
                &mut || {
                    second.reset(&START).expect("a sound posture");
                    timed(|| {
                        for torque_nm in &recording.torque_nm {
                            second.advance(torque_nm).expect("stable before");
                        }
                    })
                },
                &mut || self.run(&mut plant).cost.wall,
            ],
        );
        let overhead = 100.0 * (full_us / bare_us - 1.0);
        println!("rapier   bare {bare_us:6.2} us a step");
        println!("rapier   run loop {full_us:6.2} us a step: {overhead:.1} % more");
    }

    fn mujoco(&self) {
        let environment = ensure(&mut |stage| eprintln!("{stage}")).expect("an environment");
        let start = || HarnessProcess::start(&environment, Duration::from_mins(1)).expect("starts");
        let settings = MujocoSettings::default();
        let (mut processes, cell) = ([start(), start(), start()], &self.cell);
        let [first, second, third] = &mut processes;
        let new = |harness| MujocoPlant::new(harness, cell, TIMESTEP_S, &settings).expect("sound");
        let (mut plant, mut bare) = (new(first), new(second));
        let mut fleet = MujocoFleet::new(third, cell, TIMESTEP_S, &settings, ARMS).expect("sound");
        let recording = self.run(&mut plant);
        let torques_nm = &recording.torque_nm;
        let motions = [Motion {
            servo: &self.servo,
            actuation: &self.actuation,
            trajectory: &self.trajectory,
            braking: None,
            keep: Keep::Steps,
        }; ARMS];
        let bare = std::cell::RefCell::new(&mut bare);
        let replay = |look| {
            let replay = bare.borrow_mut().replay(&START, look, torques_nm);
            let replay = replay.expect("stable before");
            let last = recording.state.last().expect("not empty");
            assert_eq!(replay.qpos, last.position.as_slice(), "the same motion");
            Duration::from_secs_f64(replay.elapsed_s)
        };
        let mut group = Vec::new();
        let plant = std::cell::RefCell::new(&mut plant);
        let fleet = std::cell::RefCell::new(&mut fleet);
        let [
            looking_us,
            bare_us,
            alone_us,
            alone_loop_us,
            frame_us,
            frame_loop_us,
        ] = minima(
            recording.steps(),
            [
                &mut || replay(true),
                &mut || replay(false),
                &mut || {
                    let mut plant = plant.borrow_mut();
                    plant.reset(&START).expect("a sound posture");
                    timed(|| {
                        for torque_nm in torques_nm {
                            plant.step(torque_nm).expect("stable before");
                        }
                    })
                },
                &mut || self.run(&mut **plant.borrow_mut()).cost.wall,
                &mut || {
                    let mut fleet = fleet.borrow_mut();
                    for arm in 0..ARMS {
                        fleet.reset(arm, &START).expect("a sound posture");
                    }
                    timed(|| {
                        for torque_nm in torques_nm {
                            group.clear();
                            group.extend((0..ARMS).map(|arm| (arm, *torque_nm)));
                            fleet.step(&group).expect("stable before");
                        }
                    }) / u32::try_from(ARMS).expect("a few")
                },
                &mut || {
                    timed(|| {
                        let mut fleet = fleet.borrow_mut();
                        let mut hooks = Hooks::default();
                        simulate_fleet(&mut **fleet, &motions, &mut hooks, &mut |_, ended| {
                            assert_eq!(ended.expect("stable before").state, recording.state);
                        })
                        .expect("stable before");
                    }) / u32::try_from(ARMS).expect("a few")
                },
            ],
        );
        println!(
            "MuJoCo   bare {bare_us:6.2} us a step, {looking_us:.2} with its collision detection"
        );
        for (what, us) in [
            ("alone, lock-step", alone_us),
            ("alone, run loop", alone_loop_us),
            ("in a frame of eight, lock-step", frame_us),
            ("in a frame of eight, run loop", frame_loop_us),
        ] {
            println!(
                "MuJoCo   {what} {us:6.2} us a step: {:.2} us more",
                us - bare_us
            );
        }
    }
}

fn main() {
    // `cargo test --benches` only asks whether it builds.
    if std::env::args().any(|argument| argument == "--bench") {
        let bench = Bench::new();
        bench.rapier();
        bench.mujoco();
    }
}
