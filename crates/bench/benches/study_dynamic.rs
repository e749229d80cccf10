//! What dynamic cases of a study cost over the bare engines' steps of the same cases, and what a
//! second core brings.
//!
//! `cargo bench -p needlebench-bench --bench study_dynamic` (Linux). Bare are the same steps of the same
//! plants from the same starts under the recorded torques, without servo, recording or measurements:
//! rapier's own step in a loop, and `mj_step` in a loop inside one Python process, once as it is
//! (with its collision detection) and once with that switched off, as a case has it wherever nothing is
//! near. Costs are times on the processor, of the thread and of its MuJoCo process, which other
//! programs disturb less than wall-clock times; all sides are taken in turn, and figures are the
//! least of the repetitions. Planning is measured by itself.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::sync::Barrier;
use std::time::{Duration, Instant};

use needlebench_bench::study::dynamic_rows;
use needlebench_bench::{RunOptions, run_scenario};
use needlebench_clearance::ClearanceModel;
use needlebench_engine::mujoco::{HarnessProcess, ensure};
use needlebench_engine::{
    ENGINES, Engine, EnginePool, MujocoPlant, MujocoSettings, Plant, RapierPlant, RapierSettings,
    choose_engines,
};
use needlebench_kinematics::Joints;
use needlebench_numerics::random::SplitMix64;
use needlebench_planning::Planner;
use needlebench_scenario::{Change, KeyPath, Overrides, ResolvedScenario, ScenarioFamily};

const REPETITIONS: usize = 5;

/// How far the patient lies from where the scenario has him, mm, at most.
const SHIFT_MM: f64 = 30.0;

/// The two engines, rapier first.
fn both() -> Vec<&'static dyn Engine> {
    choose_engines(ENGINES, Some(&["rapier", "mujoco"])).expect("there are both")
}

fn process_id(pool: &EnginePool) -> Option<u32> {
    pool.process_id(both()[1])
}

/// The motions of a case: where each starts, and its torques.
type Motions = Vec<(Joints, Vec<Joints>)>;

/// The goals of two shipped scenarios, those of the second with the patient elsewhere.
fn cases() -> Vec<ResolvedScenario> {
    let mut cases = Vec::new();
    let mut random = SplitMix64::new(5);
    for (name, shift_mm) in [("table3", 0.0), ("supine_suite", SHIFT_MM)] {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
        let path = folder.join(name).with_extension("toml");
        let family = ScenarioFamily::load(&path, &Overrides::default()).expect("shipped");
        for goal in family.goals() {
            let changes = [0, 1].map(|axis| {
                let key = KeyPath::parse(&format!("phantom.position_mm[{axis}]"));
                let by_mm = random.uniform(-shift_mm, shift_mm);
                (key.expect("a path"), Change::Add(by_mm))
            });
            cases.push(family.vary(goal, &changes).expect("a layout that exists"));
        }
    }
    cases
}

/// Time that a thread has been on a processor.
fn processor_time(schedstat: &str) -> Duration {
    // A call that gives way brings the account of the running thread up to date.
    std::thread::yield_now();
    let text = fs::read_to_string(schedstat).expect("Linux keeps account");
    let ns = text.split(' ').next().and_then(|ns| ns.parse().ok());
    Duration::from_nanos(ns.expect("nanoseconds come first"))
}

/// Time of this thread and of a process of one thread.
fn times(process: Option<u32>) -> Duration {
    let of_process = process.map(|id| processor_time(&format!("/proc/{id}/schedstat")));
    processor_time("/proc/thread-self/schedstat") + of_process.unwrap_or_default()
}

struct Bare {
    case: ResolvedScenario,
    timestep_s: f64,
    rapier: Motions,
    mujoco: Motions,
}

impl Bare {
    fn new(case: ResolvedScenario) -> Self {
        let options = RunOptions {
            engines: Some(vec!["rapier".into(), "mujoco".into()]),
            ..RunOptions::default()
        };
        let run = run_scenario(&case, &options).expect("a shipped scenario");
        let mut made = Self {
            timestep_s: case.scenario.engines.timestep_ms * 1e-3,
            case,
            rapier: Vec::new(),
            mujoco: Vec::new(),
        };
        for run in run.runs.iter().flatten().flatten() {
            let recording = &run.recording;
            let motion = (recording.state[0].position, recording.torque_nm.clone());
            match run.engine {
                "rapier" => made.rapier.push(motion),
                _ => made.mujoco.push(motion),
            }
        }
        made
    }

    fn rapier(&self) -> Duration {
        let settings = RapierSettings::default();
        let plant = RapierPlant::new(&self.case.cell, self.timestep_s, &settings);
        let mut plant = plant.expect("a sound cell");
        let mut total = Duration::ZERO;
        for (start, torques_nm) in &self.rapier {
            plant.reset(start).expect("a sound posture");
            let started = times(None);
            for torque_nm in torques_nm {
                plant.advance(torque_nm).expect("stable before");
            }
            total += times(None).saturating_sub(started);
        }
        total
    }

    /// Without the messages: the time of the process alone.
    fn mujoco(&self, process: &mut HarnessProcess, look: bool) -> Duration {
        let settings = MujocoSettings::default();
        process.clear().expect("a sound process");
        let account = format!("/proc/{}/schedstat", process.process_id());
        let plant = MujocoPlant::new(process, &self.case.cell, self.timestep_s, &settings);
        let mut plant = plant.expect("a sound cell");
        let mut total = Duration::ZERO;
        for (start, torques_nm) in &self.mujoco {
            plant.reset(start).expect("a sound posture");
            let started = processor_time(&account);
            plant
                .replay(start, look, torques_nm)
                .expect("stable before");
            total += processor_time(&account).saturating_sub(started);
        }
        total
    }

    fn planning(&self) -> Duration {
        let started = times(None);
        let model = ClearanceModel::new(&self.case.cell);
        let planner = Planner::new(&self.case, &model).expect("a UR arm");
        std::hint::black_box(planner.plan(&self.case.goals[0]));
        times(None).saturating_sub(started)
    }

    fn case(&self, engine: &'static dyn Engine, pool: &EnginePool) -> Duration {
        let process = pool.process_id(engine);
        let started = times(process);
        dynamic_rows(&self.case, &[engine], pool).expect("a sound case");
        times(process).saturating_sub(started)
    }
}

/// A line of the table: least times in ms.
#[derive(Default)]
struct Line {
    steps: usize,
    planning: f64,
    rapier: [f64; 2],
    mujoco: [f64; 3],
}

impl Line {
    fn print(&self, name: &str) {
        let us = |ms: f64| ms * 1e3 / self.steps as f64;
        let [rapier_bare, rapier] = self.rapier;
        let [looking, blind, mujoco] = self.mujoco;
        println!(
            "{name:42} {:6} {:8.1} | {:5.2} {:5.2} {:6.3} {:6.3} | {:5.2} {:5.2} {:5.2} {:6.3} {:6.3} {:6.3}",
            self.steps,
            self.planning,
            us(rapier_bare),
            us(rapier - self.planning),
            (rapier - self.planning) / rapier_bare,
            rapier / rapier_bare,
            us(looking),
            us(blind),
            us(mujoco - self.planning),
            (mujoco - self.planning) / looking,
            (mujoco - self.planning) / blind,
            mujoco / blind,
        );
    }
}

fn costs(cases: &[ResolvedScenario]) {
    let environment = ensure(&mut |stage| eprintln!("{stage}")).expect("an environment");
    let process = HarnessProcess::start(&environment, Duration::from_mins(1));
    let mut process = process.expect("it starts");
    let pool = EnginePool::new(ENGINES);
    let engines = both();
    let [rapier, mujoco] = engines[..] else {
        unreachable!("they are two");
    };
    // The process starts, so that its time is counted from the first case on.
    dynamic_rows(&cases[0], &engines, &pool).expect("a sound case");
    println!(
        "{:42} {:6} {:8} | rapier: bare, case, ratio, with planning | MuJoCo: bare looking, bare not, \
         case, ratio to either, with planning",
        "us a step", "steps", "plan ms"
    );
    let mut sum = Line::default();
    for case in cases {
        let bare = Bare::new(case.clone());
        let mut least = [Duration::MAX; 6];
        for _ in 0..REPETITIONS {
            let now = [
                bare.planning(),
                bare.rapier(),
                bare.case(rapier, &pool),
                bare.mujoco(&mut process, true),
                bare.mujoco(&mut process, false),
                bare.case(mujoco, &pool),
            ];
            for (least, now) in least.iter_mut().zip(now) {
                *least = now.min(*least);
            }
        }
        let [planning, rapier_bare, rapier_ms, looking, blind, mujoco_ms] =
            least.map(|time| time.as_secs_f64() * 1e3);
        let line = Line {
            steps: bare.rapier.iter().map(|(_, torques)| torques.len()).sum(),
            planning,
            rapier: [rapier_bare, rapier_ms],
            mujoco: [looking, blind, mujoco_ms],
        };
        let (scenario, goal) = (&case.scenario.name, &case.goals[0].name);
        line.print(&format!("{scenario} {goal} ({})", bare.rapier.len()));
        sum.steps += line.steps;
        sum.planning += line.planning;
        for (sum, value) in sum.rapier.iter_mut().zip(line.rapier) {
            *sum += value;
        }
        for (sum, value) in sum.mujoco.iter_mut().zip(line.mujoco) {
            *sum += value;
        }
    }
    sum.print("all");
}

/// Some workers, each tied to a core with its MuJoCo process, do all cases: wall-clock time from the
/// start of the first to the end of the last, and processor time of all.
fn workers(cores: &[usize], cases: &[ResolvedScenario]) -> [f64; 2] {
    let ready = Barrier::new(cores.len());
    let spans: Vec<(Instant, Instant, Duration)> = std::thread::scope(|scope| {
        let workers: Vec<_> = cores
            .iter()
            .map(|core| {
                let ready = &ready;
                scope.spawn(move || {
                    let thread = fs::read_link("/proc/thread-self").expect("Linux has it");
                    let id = thread.file_name().expect("a thread has an id");
                    // What the thread starts is tied with it.
                    let tied = Command::new("taskset")
                        .args(["-pc", &core.to_string()])
                        .arg(id)
                        .output();
                    assert!(tied.is_ok_and(|done| done.status.success()), "taskset");
                    let (pool, engines) = (EnginePool::new(ENGINES), both());
                    dynamic_rows(&cases[0], &engines, &pool).expect("a sound case");
                    ready.wait();
                    let (started, before) = (Instant::now(), times(process_id(&pool)));
                    for case in cases {
                        dynamic_rows(case, &engines, &pool).expect("a sound case");
                    }
                    let spent = times(process_id(&pool)).saturating_sub(before);
                    (started, Instant::now(), spent)
                })
            })
            .collect();
        workers
            .into_iter()
            .map(|worker| worker.join().expect("workers do not panic"))
            .collect()
    });
    let first = spans.iter().map(|span| span.0).min().expect("some");
    let last = spans.iter().map(|span| span.1).max().expect("some");
    let spent: Duration = spans.iter().map(|span| span.2).sum();
    [last - first, spent].map(|time| time.as_secs_f64())
}

fn throughput(cases: &[ResolvedScenario]) {
    let mut one = [f64::INFINITY; 2];
    let mut two = [f64::INFINITY; 2];
    for repetition in 0..REPETITIONS {
        let alone = workers(&[repetition % 2], cases);
        let together = workers(&[0, 1], cases);
        for k in 0..2 {
            one[k] = one[k].min(alone[k]);
            two[k] = two[k].min(together[k]);
        }
    }
    let count = cases.len() as f64;
    println!(
        "both engines, one worker on one core: {:.3} cases/s, {:.3} s of processor a case",
        count / one[0],
        one[1] / count
    );
    println!(
        "two workers on two cores: {:.3} cases/s, {:.3} s of processor a case",
        2.0 * count / two[0],
        0.5 * two[1] / count
    );
    println!(
        "two against one: {:.3} by the clock, {:.3} by processor time",
        2.0 * one[0] / two[0],
        4.0 * one[1] / two[1]
    );
}

fn main() {
    // `cargo test --benches` only asks whether it builds.
    if std::env::args().any(|argument| argument == "--bench") {
        let cases = cases();
        costs(&cases);
        throughput(&cases);
    }
}
