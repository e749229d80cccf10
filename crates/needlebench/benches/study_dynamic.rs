//! What dynamic cases of a study cost over the bare engines' steps of the same cases.
//!
//! `cargo bench -p needlebench --bench study_dynamic`, or on one core `taskset -c 0 cargo bench ...`.
//! Bare are the same steps of the same plants under the recorded torques, without servo, recording
//! or measurements: rapier's own step in a loop, and `mj_step` in a loop inside one Python process,
//! as it is (with its collision detection) and with that switched off, as it is here wherever nothing
//! is near. All sides are timed in turn; figures are minima over the repetitions.

use std::path::Path;
use std::time::{Duration, Instant};

use needlebench::study::{CaseCost, EngineSet, dynamic_case};
use needlebench::{EngineChoice, RunOptions, run_scenario};
use needlebench_cell::scenario::EngineName;
use needlebench_cell::{Overrides, ResolvedScenario, load_scenario};
use needlebench_engine::mujoco::{HarnessProcess, ensure};
use needlebench_engine::{MujocoPlant, MujocoSettings, Plant, RapierPlant, RapierSettings};
use needlebench_kinematics::Joints;

const REPETITIONS: usize = 5;

/// The motions of a case: where each starts, and its torques.
type Motions = Vec<(Joints, Vec<Joints>)>;

struct Bare {
    case: ResolvedScenario,
    timestep_s: f64,
    rapier: Motions,
    mujoco: Motions,
}

fn cases() -> Vec<ResolvedScenario> {
    let mut cases = Vec::new();
    for name in ["table3", "supine_suite"] {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
        let path = folder.join(name).with_extension("toml");
        let whole = load_scenario(&path, &Overrides::default()).expect("a shipped scenario");
        for index in 0..whole.goals.len() {
            let mut case = whole.clone();
            case.goals = vec![whole.goals[index].clone()];
            case.people.by_goal = vec![whole.people.by_goal[index].clone()];
            cases.push(case);
        }
    }
    cases
}

impl Bare {
    fn new(case: ResolvedScenario) -> Self {
        let options = RunOptions {
            engines: Some(EngineChoice::Both),
            jobs: 1,
            referee: false,
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
                EngineName::Rapier => made.rapier.push(motion),
                EngineName::Mujoco => made.mujoco.push(motion),
            }
        }
        made
    }

    fn rapier(&self) -> Duration {
        let cell = &self.case.cell;
        let settings = RapierSettings::default();
        let mut plant = RapierPlant::new(cell, self.timestep_s, &settings).expect("sound");
        let mut total = Duration::ZERO;
        for (start, torques_nm) in &self.rapier {
            plant.reset(start).expect("a sound posture");
            let started = Instant::now();
            for torque_nm in torques_nm {
                plant.advance(torque_nm).expect("stable before");
            }
            total += started.elapsed();
        }
        total
    }

    fn mujoco(&self, process: &mut HarnessProcess, look: bool) -> Duration {
        let cell = &self.case.cell;
        let settings = MujocoSettings::default();
        process.clear().expect("a sound process");
        let mut plant = MujocoPlant::new(process, cell, self.timestep_s, &settings).expect("sound");
        let elapsed_s = self.mujoco.iter().map(|(start, torques_nm)| {
            let replay = plant.replay(start, look, torques_nm);
            replay.expect("stable before").elapsed_s
        });
        Duration::from_secs_f64(elapsed_s.sum())
    }
}

fn ms(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1e3
}

fn least(known: &mut CaseCost, next: CaseCost) {
    known.planning = known.planning.min(next.planning);
    known.rapier = known.rapier.min(next.rapier);
    known.mujoco = known.mujoco.min(next.mujoco);
    known.other = known.other.min(next.other);
}

fn main() {
    // `cargo test --benches` only asks whether it builds.
    if !std::env::args().any(|argument| argument == "--bench") {
        return;
    }
    let environment = ensure(&mut |stage| eprintln!("{stage}")).expect("an environment");
    let mut process =
        HarnessProcess::start(&environment, Duration::from_mins(1)).expect("it starts");
    let mut set = EngineSet::new();
    println!("times in ms; ratios are over the bare steps, with and without planning");
    let mut sums = [0.0; 8];
    for case in cases() {
        let bare = Bare::new(case);
        let most = CaseCost {
            planning: Duration::MAX,
            rapier: Duration::MAX,
            mujoco: Duration::MAX,
            other: Duration::MAX,
        };
        let mut costs = [most; 2];
        let mut bares = [Duration::MAX; 3];
        for _ in 0..REPETITIONS {
            for (engine, cost) in [EngineName::Rapier, EngineName::Mujoco]
                .into_iter()
                .zip(&mut costs)
            {
                let done = dynamic_case(&bare.case, &[engine], &mut set).expect("a sound case");
                least(cost, done.cost);
            }
            bares[0] = bares[0].min(bare.rapier());
            bares[1] = bares[1].min(bare.mujoco(&mut process, true));
            bares[2] = bares[2].min(bare.mujoco(&mut process, false));
        }
        let [rapier, looking, blind] = bares.map(ms);
        let steps: usize = bare.rapier.iter().map(|(_, torques)| torques.len()).sum();
        println!(
            "{} {}: {} motions, {steps} steps",
            bare.case.scenario.name,
            bare.case.goals[0].name,
            bare.rapier.len()
        );
        let [r, m] = costs;
        let engines = [ms(r.rapier + r.other), ms(m.mujoco + m.other)];
        let planning = ms(r.planning.min(m.planning));
        println!("  planning {planning:.1}");
        println!(
            "  rapier   bare {rapier:7.1} ({:.2} us a step)  engine {:7.1}  other {:5.1}  ratio {:.3}  with planning {:.3}",
            rapier * 1e3 / steps as f64,
            ms(r.rapier),
            ms(r.other),
            engines[0] / rapier,
            (engines[0] + planning) / rapier,
        );
        println!(
            "  MuJoCo   bare {looking:7.1} looking, {blind:.1} not ({:.2} us a step)  engine {:7.1}  other {:5.1}  ratio {:.3} and {:.3}  with planning {:.3} and {:.3}",
            blind * 1e3 / steps as f64,
            ms(m.mujoco),
            ms(m.other),
            engines[1] / looking,
            engines[1] / blind,
            (engines[1] + planning) / looking,
            (engines[1] + planning) / blind,
        );
        let values = [rapier, looking, blind, engines[0], engines[1], planning];
        for (sum, value) in sums.iter_mut().zip(values) {
            *sum += value;
        }
    }
    let [rapier, looking, blind, r, m, planning, ..] = sums;
    println!(
        "all: rapier {:.3}, with planning {:.3}; MuJoCo {:.3} and {:.3}, with planning {:.3} and {:.3}",
        r / rapier,
        (r + planning) / rapier,
        m / looking,
        m / blind,
        (m + planning) / looking,
        (m + planning) / blind,
    );
}
