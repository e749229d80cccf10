//! The one driver of motions, in every engine.

use std::process::Command;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use needlebench_cell::{BodyKind, Cell, CollisionBody, EngineSettings, Frame};
use needlebench_engine::{
    Actuation, ArmSpec, ENGINES, Engine, EngineError, EngineIdentity, EnginePool, EngineSession,
    Hooks, Keep, Motion, MotionJob, MotionSettings, MotionsDone, Plant, PlantState, Recording,
    Servo, ServoGains, run_motions, simulate_motion,
};
use needlebench_kinematics::trajectory::{JointTrajectory, MotionLimits, Phase, ProfileLimits};
use needlebench_kinematics::{JOINT_COUNT, Joints, Pose};
use needlebench_scenario::scenario::EnginesSection;

use crate::common;
use crate::replay::Replay;

const START: Joints = Joints::new(0.2, -1.6, 1.5, -1.2, -1.4, 0.3);

/// A motion of its own length, through every joint.
fn trajectory(way_rad: f64) -> JointTrajectory {
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
        .then_straight_to(Phase::Transfer, START.add_scalar(way_rad), &limits)
        .then_hold(Phase::Hold, 0.1)
}

fn servo(cell: &Cell) -> Servo {
    Servo {
        dynamics: cell.dynamics(),
        gains: ServoGains::default(),
        effort_limit_nm: cell.robot.limits.efforts_nm(),
    }
}

/// An arm above a table that its motions do not reach.
fn beside_a_table() -> Cell {
    let solid = common::cuboid("table", [0.3, -0.2, 0.1], [1.5, 1.5, 0.1]);
    common::ur3(vec![CollisionBody {
        name: "table".into(),
        kind: BodyKind::Table,
        frame: Frame::World,
        solids: vec![solid],
    }])
}

/// Jobs in two cells and with two frictions, none of them as long as another.
struct Jobs {
    cells: [Cell; 2],
    servo: Servo,
    actuation: Actuation,
    trajectories: Vec<JointTrajectory>,
}

impl Jobs {
    fn new(count: u32) -> Self {
        let cells = [common::ur3(Vec::new()), beside_a_table()];
        Self {
            servo: servo(&cells[0]),
            actuation: Actuation::default(),
            trajectories: (1..=count)
                .map(|k| trajectory(0.05 * f64::from(k)))
                .collect(),
            cells,
        }
    }

    fn all(&self) -> Vec<MotionJob<'_>> {
        let jobs = self.trajectories.iter().enumerate();
        jobs.map(|(at, trajectory)| MotionJob {
            cell: &self.cells[at % 2],
            friction: (at % 3 == 0).then_some(0.2),
            motion: Motion {
                servo: &self.servo,
                actuation: &self.actuation,
                trajectory,
                braking: None,
                keep: Keep::Steps,
            },
        })
        .collect()
    }
}

type Ends = Vec<Option<Result<Recording, EngineError>>>;

/// Everything that is made of the jobs, by job.
fn run(
    pool: &EnginePool,
    engine: &'static dyn Engine,
    jobs: &[MotionJob<'_>],
    restart: bool,
    hooks: Hooks<'_>,
) -> (MotionsDone, Ends) {
    let engines = EnginesSection::default().settings();
    let settings = MotionSettings {
        restart,
        ..MotionSettings::new(&engines)
    };
    let mut ends: Ends = jobs.iter().map(|_| None).collect();
    let done = run_motions(pool, engine, jobs, settings, hooks, &mut |index, result| {
        assert!(ends[index].replace(result).is_none(), "{index} ended twice");
    });
    (done, ends)
}

fn recordings(ends: Ends) -> Vec<Recording> {
    ends.into_iter().map(|end| end.unwrap().unwrap()).collect()
}

fn engine(name: &str) -> &'static dyn Engine {
    *ENGINES.iter().find(|engine| engine.name() == name).unwrap()
}

#[test]
fn motions_are_those_of_single_plants_bit_for_bit_in_every_engine() {
    let all = Jobs::new(10);
    let (jobs, engines) = (all.all(), EnginesSection::default().settings());
    let pool = EnginePool::new(ENGINES);
    for &engine in ENGINES {
        let (done, ends) = run(&pool, engine, &jobs, false, Hooks::default());
        assert!(done.error.is_none());
        let together = recordings(ends);
        assert_eq!(done.identity.as_ref(), Some(&together[0].engine));
        for (job, together) in jobs.iter().zip(&together) {
            let arm = ArmSpec {
                friction: job.friction.unwrap_or(engines.friction),
                ..ArmSpec::new(job.cell, &engines)
            };
            let alone = pool.lend(engine, &engines, |session| {
                let mut plant = session.make_plant(&arm)?;
                simulate_motion(plant.as_mut(), &job.motion, Hooks::default())
            });
            let alone = alone.unwrap();
            assert_eq!(alone.engine, together.engine);
            let friction = &alone
                .engine
                .settings
                .iter()
                .find(|(key, _)| key == "friction");
            assert_eq!(friction.unwrap().1, arm.friction.to_string());
            assert_eq!(alone.state, together.state);
            assert_eq!(alone.torque_nm, together.torque_nm);
        }
    }
}

#[test]
fn further_engine_is_driven_as_all_others_are() {
    let all = Jobs::new(3);
    let pool = EnginePool::new(&[&Replay]);
    let (done, ends) = run(&pool, &Replay, &all.all(), false, Hooks::default());
    assert!(done.error.is_none());
    for (recording, trajectory) in recordings(ends).iter().zip(&all.trajectories) {
        assert_eq!(recording.engine.name, "replay");
        assert!(recording.time_s.last().unwrap() >= &(trajectory.duration_s() - 1e-9));
        for (state, reference) in recording.state.iter().zip(&recording.reference) {
            assert_eq!(state.position, reference.position);
        }
    }
}

#[test]
fn servo_that_cannot_hold_the_arm_moves_nothing_and_others_go_on() {
    let all = Jobs::new(3);
    let mut stiff = all.servo;
    stiff.gains.kp_nm_per_rad = [5e5; JOINT_COUNT];
    let mut jobs = all.all();
    jobs[1].motion.servo = &stiff;
    let pool = EnginePool::new(ENGINES);
    let (done, ends) = run(&pool, engine("rapier"), &jobs, false, Hooks::default());
    assert!(done.error.is_none());
    let unstable = ends[1].as_ref().unwrap().as_ref().unwrap_err();
    assert!(
        matches!(unstable, EngineError::UnstableServo(_)),
        "{unstable}"
    );
    assert!(unstable.to_string().contains("stable below"), "{unstable}");
    assert!(ends[0].as_ref().unwrap().is_ok() && ends[2].as_ref().unwrap().is_ok());
}

#[test]
fn cancelled_motions_end_at_the_next_step() {
    let all = Jobs::new(2);
    let pool = EnginePool::new(ENGINES);
    for &engine in ENGINES {
        let cancel = AtomicBool::new(false);
        let mut simulated_s = 0.0;
        let mut progress = |time_s: f64| {
            simulated_s = time_s;
            cancel.store(time_s > 0.1, Ordering::Relaxed);
        };
        let hooks = Hooks {
            cancel: Some(&cancel),
            progress: Some(&mut progress),
        };
        let (done, ends) = run(&pool, engine, &all.all(), false, hooks);
        assert!(matches!(done.error, Some(EngineError::Cancelled)));
        assert!(ends.iter().all(Option::is_none));
        assert!(simulated_s < 0.11, "{simulated_s}");
    }
}

fn kill(process: u32) {
    let killed = Command::new("kill")
        .args(["-9", &process.to_string()])
        .status();
    assert!(killed.unwrap().success());
}

#[test]
fn process_that_dies_is_started_again_where_that_is_asked_for() {
    let all = Jobs::new(4);
    let (jobs, mujoco) = (all.all(), engine("mujoco"));
    let pool = EnginePool::new(ENGINES);
    let (_, undisturbed) = run(&pool, mujoco, &jobs, false, Hooks::default());
    let undisturbed = recordings(undisturbed);
    let first = pool.process_id(mujoco).unwrap();
    // When one motion has ended and another is under way.
    let half_s = 1.5 * undisturbed[0].time_s.last().unwrap();
    let mut killed = false;
    let mut progress = |time_s: f64| {
        if time_s > half_s && !std::mem::replace(&mut killed, true) {
            kill(first);
        }
    };
    let hooks = Hooks {
        cancel: None,
        progress: Some(&mut progress),
    };
    let (done, ends) = run(&pool, mujoco, &jobs, true, hooks);
    assert!(killed && done.error.is_none(), "{:?}", done.error);
    for (before, after) in undisturbed.iter().zip(&recordings(ends)) {
        assert_eq!(before.state, after.state);
    }
    let second = pool.process_id(mujoco).unwrap();
    assert_ne!(first, second);

    kill(second);
    let (done, ends) = run(&pool, mujoco, &jobs, false, Hooks::default());
    let error = done.error.unwrap();
    assert!(
        error.is_fatal() && error.to_string().contains("died"),
        "{error}"
    );
    assert!(ends.iter().all(Option::is_none));
}

/// An engine whose second start succeeds, and whose arms break down after some steps.
#[derive(Debug)]
struct Frail;

static STARTS: AtomicUsize = AtomicUsize::new(0);
const LAST_STEP: usize = 40;

impl Engine for Frail {
    fn name(&self) -> &'static str {
        "frail"
    }

    fn title(&self) -> &'static str {
        "Frail"
    }

    fn start(
        &self,
        settings: &EngineSettings,
        tell: &mut dyn FnMut(&str),
    ) -> Result<Box<dyn EngineSession>, EngineError> {
        if STARTS.fetch_add(1, Ordering::Relaxed) == 0 {
            return Err(EngineError::NotStarted {
                reason: "not in the mood".to_owned(),
            });
        }
        Ok(Box::new(FrailSession(Replay.start(settings, tell)?)))
    }
}

struct FrailSession(Box<dyn EngineSession>);

impl EngineSession for FrailSession {
    fn make_plant<'s>(&'s mut self, arm: &ArmSpec<'_>) -> Result<Box<dyn Plant + 's>, EngineError> {
        let plant = self.0.make_plant(arm)?;
        Ok(Box::new(FrailPlant { plant, steps: 0 }))
    }
}

struct FrailPlant<'s> {
    plant: Box<dyn Plant + 's>,
    steps: usize,
}

impl Plant for FrailPlant<'_> {
    fn identity(&self) -> EngineIdentity {
        self.plant.identity()
    }

    fn reset(&mut self, position: &Joints) -> Result<PlantState, EngineError> {
        self.plant.reset(position)
    }

    fn begin(&mut self, motion: &JointTrajectory) -> Result<PlantState, EngineError> {
        self.steps = 0;
        self.plant.begin(motion)
    }

    fn step(&mut self, torque_nm: &Joints) -> Result<PlantState, EngineError> {
        if self.steps == LAST_STEP {
            return Err(EngineError::Unstable {
                engine: "frail",
                reason: "tired".to_owned(),
            });
        }
        self.steps += 1;
        self.plant.step(torque_nm)
    }

    fn timestep_s(&self) -> f64 {
        self.plant.timestep_s()
    }

    fn link_poses(&mut self) -> Result<[Pose; JOINT_COUNT], EngineError> {
        self.plant.link_poses()
    }
}

#[test]
fn engine_that_does_not_start_says_why_until_it_is_started_anew_and_breaks_keep_their_recordings() {
    let all = Jobs::new(2);
    let jobs = all.all();
    let pool = EnginePool::new(&[&Frail]);
    for _ in 0..2 {
        let (done, ends) = run(&pool, &Frail, &jobs, false, Hooks::default());
        assert_eq!(done.error.unwrap().to_string(), "not in the mood");
        assert!(pool.could_not_start(&Frail) && ends.iter().all(Option::is_none));
    }
    assert_eq!(STARTS.load(Ordering::Relaxed), 1);
    pool.discard(&Frail);
    let (done, ends) = run(&pool, &Frail, &jobs, false, Hooks::default());
    assert!(done.error.is_none());
    for end in ends {
        let Err(EngineError::Stopped { error, recording }) = end.unwrap() else {
            panic!("a motion of {LAST_STEP} steps");
        };
        assert_eq!(error.to_string(), "frail became unstable: tired");
        assert_eq!(recording.state.len(), LAST_STEP + 1);
        assert_eq!(recording.torque_nm.len(), LAST_STEP);
    }
}
