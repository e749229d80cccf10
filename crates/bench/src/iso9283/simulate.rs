//! The cycles of one engine.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use nalgebra::{Point3, Vector3};
use needlebench_engine::{
    Actuation, Engine, EngineError, EngineIdentity, EnginePool, Hooks, Motion, MotionJob,
    Recording, run_motions,
};
use needlebench_evaluation::iso9283::{Effort, measure_cycle};
use needlebench_iso9283::{Arrival, Attained};
use needlebench_numerics::random::{NormalPairs, SplitMix64};
use needlebench_parallel::Control;
use needlebench_planning::iso9283::{Cycle, ProtocolPlan};
use needlebench_scenario::iso9283::Iso9283Protocol;

use crate::setup::Setup;

/// Cycles whose arrivals are kept: those over which the standard takes the stabilisation time.
const ARRIVAL_CYCLES: u32 = 3;

/// Cycles that are compared before the others are made.
const COMPARED_CYCLES: u32 = 2;

/// What the cycles of one engine gave.
#[derive(Debug)]
pub(crate) struct EngineCycles {
    pub identity: EngineIdentity,
    /// Measurements of all cycles, as the tracker sees them.
    pub attained: Vec<Attained>,
    /// Arrivals of the first cycles.
    pub arrivals: Vec<Arrival>,
    pub effort: Effort,
    /// Cycles of the plain sequence that were simulated.
    pub simulated: u32,
    /// The first two cycles were equal bit for bit, and stand for all.
    pub repeats_itself: bool,
    /// The measured point at every step of the first cycles, world, m.
    pub path_m: Vec<Vector3<f64>>,
    /// Positions attained in the first cycles, m.
    pub first_attained_m: Vec<Point3<f64>>,
}

/// Why an engine has no cycles.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CycleError {
    /// It could not simulate one of them.
    #[error("cycle {cycle}: {source}")]
    Cycle {
        /// Number of the cycle, from 1.
        cycle: usize,
        /// What it reports.
        source: EngineError,
    },
    /// It could not begin.
    #[error(transparent)]
    Engine(#[from] EngineError),
}

/// All cycles of one kind, by a perfect tracker.
struct Repeated {
    attained: Vec<Attained>,
    arrivals: Vec<Arrival>,
    simulated: u32,
    repeats_itself: bool,
}

/// The protocol in one engine.
pub(crate) struct Cycles<'a> {
    setup: &'a Setup<'a>,
    protocol: &'a Iso9283Protocol,
    pool: &'a EnginePool,
    engine: &'static dyn Engine,
    control: &'a Control<'a>,
    identity: Option<EngineIdentity>,
    effort: Effort,
    path_m: Vec<Vector3<f64>>,
}

impl<'a> Cycles<'a> {
    pub fn new(
        setup: &'a Setup<'a>,
        protocol: &'a Iso9283Protocol,
        pool: &'a EnginePool,
        engine: &'static dyn Engine,
        control: &'a Control<'a>,
    ) -> Self {
        Self {
            setup,
            protocol,
            pool,
            engine,
            control,
            identity: None,
            effort: Effort::default(),
            path_m: Vec::new(),
        }
    }

    /// Simulates the protocol.
    ///
    /// # Errors
    /// What the engine or its process reports, with the cycle if it is one's.
    pub fn simulate(mut self, plan: &ProtocolPlan) -> Result<EngineCycles, CycleError> {
        let plain = self.repeat(&plan.cycle, 0.0)?;
        let plain_end_s = f64::from(self.protocol.cycles) * plan.cycle.trajectory.duration_s();
        let directional = match &plan.directional {
            Some(cycle) => Some(self.repeat(cycle, plain_end_s)?),
            None => None,
        };
        let all = || [Some(&plain), directional.as_ref()].into_iter().flatten();
        Ok(EngineCycles {
            first_attained_m: all()
                .flat_map(|repeated| repeated.attained.iter())
                .filter(|each| each.cycle == 1)
                .map(|each| each.position_m)
                .collect(),
            attained: all()
                .zip([0x9283, 0x9284])
                .flat_map(|(repeated, stream)| self.tracked(&repeated.attained, stream))
                .collect(),
            arrivals: plain.arrivals.clone(),
            simulated: plain.simulated,
            repeats_itself: all().all(|repeated| repeated.repeats_itself),
            identity: self.identity.expect("cycles were made"),
            effort: self.effort,
            path_m: self.path_m,
        })
    }

    /// Repeats a cycle as often as the protocol asks for.
    ///
    /// Each one has a seed of its own. If the first two are equal bit for bit all the same, nothing
    /// depends on the seed, and the others need not be simulated.
    fn repeat(&mut self, cycle: &Cycle, start_s: f64) -> Result<Repeated, CycleError> {
        let count = self.protocol.cycles;
        let mut repeated = Repeated {
            attained: Vec::new(),
            arrivals: Vec::new(),
            simulated: 0,
            repeats_itself: false,
        };
        self.measure(
            cycle,
            1..=count.min(COMPARED_CYCLES),
            start_s,
            &mut repeated,
        )?;
        if count >= COMPARED_CYCLES {
            let (first, second) = repeated.attained.split_at(cycle.stops.len());
            repeated.repeats_itself = first
                .iter()
                .zip(second)
                .all(|(a, b)| a.position_m == b.position_m && a.orientation == b.orientation);
        }
        if !repeated.repeats_itself {
            self.measure(cycle, COMPARED_CYCLES + 1..=count, start_s, &mut repeated)?;
            return Ok(repeated);
        }
        let duration_s = cycle.trajectory.duration_s();
        for number in COMPARED_CYCLES + 1..=count {
            let at_s = start_s + f64::from(number - 1) * duration_s;
            let again = repeated.attained[..cycle.stops.len()].to_vec();
            repeated
                .attained
                .extend(again.into_iter().map(|each| Attained {
                    cycle: number,
                    time_s: each.time_s.map(|time_s| time_s - start_s + at_s),
                    ..each
                }));
            self.control.progress.step();
        }
        Ok(repeated)
    }

    /// Simulates some cycles, each with whatever is random in it drawn from the scenario's seed and
    /// its number.
    fn measure(
        &mut self,
        cycle: &Cycle,
        numbers: RangeInclusive<u32>,
        start_s: f64,
        repeated: &mut Repeated,
    ) -> Result<(), CycleError> {
        let first = *numbers.start();
        let setup = self.setup;
        let seeded = |number| Actuation {
            seed: cycle_seed(setup.resolved.scenario.seed, number),
            ..setup.real.actuation().clone()
        };
        let actuations: Vec<Actuation> = numbers.map(seeded).collect();
        let jobs: Vec<MotionJob<'_>> = actuations
            .iter()
            .map(|actuation| MotionJob {
                motion: Motion {
                    actuation,
                    ..setup.motion(&cycle.trajectory)
                },
                ..setup.job(&cycle.trajectory)
            })
            .collect();
        let (pool, engine, control) = (self.pool, self.engine, self.control);
        let hooks = Hooks {
            cancel: Some(control.cancel),
            progress: None,
        };
        // Several at a time do not end in their order, in which they are taken.
        let mut early: BTreeMap<usize, Recording> = BTreeMap::new();
        let mut next = 0;
        let mut failed: Option<(usize, EngineError)> = None;
        let settings = setup.motion_settings();
        let mut ended = |index: usize, result: Result<Recording, EngineError>| {
            control.progress.step();
            match result {
                Ok(recording) => {
                    early.insert(index, recording);
                    while let Some(recording) = early.remove(&next) {
                        let number = first + u32::try_from(next).expect("few cycles");
                        self.take(cycle, &recording, number, start_s, repeated);
                        next += 1;
                    }
                }
                Err(error) if failed.as_ref().is_none_or(|(first, _)| index < *first) => {
                    failed = Some((index, error));
                }
                Err(_) => {}
            }
        };
        let done = run_motions(pool, engine, &jobs, settings, hooks, &mut ended);
        let of_number = |index: usize, source: EngineError| CycleError::Cycle {
            cycle: first as usize + index,
            source,
        };
        match (done.error, failed) {
            (Some(error), _) if done.identity.is_some() => Err(of_number(next, error)),
            (Some(error), _) | (None, Some((_, error @ EngineError::NotMade { .. }))) => {
                Err(error.into())
            }
            (None, Some((index, error))) => Err(of_number(index, error)),
            (None, None) => {
                if self.identity.is_none() {
                    self.identity = done.identity;
                }
                Ok(())
            }
        }
    }

    /// Measures a cycle.
    fn take(
        &mut self,
        cycle: &Cycle,
        recording: &Recording,
        number: u32,
        start_s: f64,
        repeated: &mut Repeated,
    ) {
        let cell = self.setup.real.cell();
        let at_s = start_s + f64::from(number - 1) * cycle.trajectory.duration_s();
        self.effort.add(cell, recording);
        if number == 1 {
            let point = self.protocol.flange_from_point;
            let states = recording.state.iter();
            self.path_m
                .extend(states.map(|state| (state.world_from_flange * point).translation.vector));
        }
        let measured = measure_cycle(cell, self.protocol, recording, &cycle.stops, number, at_s);
        repeated.simulated = number;
        repeated.attained.extend(measured.attained);
        if number <= ARRIVAL_CYCLES {
            repeated.arrivals.extend(measured.arrivals);
        }
    }

    /// The measurements with the tracker's noise, the same in every engine.
    fn tracked(&self, attained: &[Attained], stream: u64) -> Vec<Attained> {
        let sigma_m = self.protocol.tracker_noise_m;
        if sigma_m == 0.0 {
            return attained.to_vec();
        }
        let mut noise = NormalPairs::new(self.setup.resolved.scenario.seed ^ (stream << 32));
        attained
            .iter()
            .map(|each| Attained {
                position_m: each.position_m
                    + sigma_m * Vector3::from_fn(|_, _| noise.next_normal()),
                ..each.clone()
            })
            .collect()
    }
}

/// Seed of one cycle.
fn cycle_seed(scenario_seed: u64, cycle: u32) -> u64 {
    let scenario = SplitMix64::new(scenario_seed).next_u64();
    SplitMix64::new(scenario ^ u64::from(cycle)).next_u64()
}
