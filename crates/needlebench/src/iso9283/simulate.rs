//! The cycles of one engine.

use std::f64::consts::TAU;
use std::sync::atomic::AtomicBool;

use nalgebra::{Point3, Vector3};
use needlebench_cell::ResolvedScenario;
use needlebench_cell::iso9283::Iso9283Protocol;
use needlebench_cell::scenario::EngineName;
use needlebench_engine::{Actuation, EngineIdentity, Hooks, Plant, Recording, Servo, simulate};
use needlebench_evaluation::iso9283::{Arrival, Attained, CycleMeasurement, Effort, measure_cycle};
use needlebench_kinematics::pose_sets::SplitMix64;
use needlebench_planning::iso9283::{Cycle, ProtocolPlan};

use crate::plants::{Harness, plant};
use crate::progress::Progress;
use crate::reality::{Reality, servo};

/// Cycles whose arrivals are kept: those over which the standard takes the stabilisation time.
const ARRIVAL_CYCLES: u32 = 3;

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

/// Simulates the protocol in one engine.
///
/// # Errors
/// What the engine or its process reports, in words.
#[expect(clippy::too_many_arguments, reason = "what a run is made of, once")]
pub(crate) fn simulate_engine(
    reality: &Reality<'_>,
    resolved: &ResolvedScenario,
    protocol: &Iso9283Protocol,
    plan: &ProtocolPlan,
    engine: EngineName,
    harness: Option<&Harness>,
    cancel: &AtomicBool,
    progress: &Progress,
) -> Result<EngineCycles, String> {
    let cell = reality.cell();
    let engines = &resolved.scenario.engines;
    let timestep_s = engines.timestep_ms * 1e-3;
    let mut process = match harness {
        Some(Ok(process)) => Some(process.lock().expect("one thread uses it")),
        Some(Err(message)) => return Err(message.clone()),
        None => None,
    };
    let mut plant = plant(engine, cell, engines, timestep_s, process.as_deref_mut())
        .map_err(|error| error.to_string())?;
    let mut cycles = Cycles {
        reality,
        resolved,
        protocol,
        servo: servo(resolved),
        cancel,
        effort: Effort::default(),
        path_m: Vec::new(),
    };
    let plain = cycles.repeat(plant.as_mut(), &plan.cycle, 0.0, Some(progress))?;
    let plain_end_s = f64::from(protocol.cycles) * plan.cycle.trajectory.duration_s();
    let directional = match &plan.directional {
        Some(cycle) => Some(cycles.repeat(plant.as_mut(), cycle, plain_end_s, None)?),
        None => None,
    };
    let all = || [Some(&plain), directional.as_ref()].into_iter().flatten();
    Ok(EngineCycles {
        identity: plant.identity(),
        first_attained_m: all()
            .flat_map(|repeated| repeated.attained.iter())
            .filter(|each| each.cycle == 1)
            .map(|each| each.position_m)
            .collect(),
        attained: all()
            .zip([0x9283, 0x9284])
            .flat_map(|(repeated, stream)| cycles.tracked(&repeated.attained, stream))
            .collect(),
        arrivals: plain.arrivals.clone(),
        effort: cycles.effort.clone(),
        simulated: plain.simulated,
        repeats_itself: all().all(|repeated| repeated.repeats_itself),
        path_m: std::mem::take(&mut cycles.path_m),
    })
}

/// All cycles of one kind, by a perfect tracker.
struct Repeated {
    attained: Vec<Attained>,
    arrivals: Vec<Arrival>,
    simulated: u32,
    repeats_itself: bool,
}

struct Cycles<'a> {
    reality: &'a Reality<'a>,
    resolved: &'a ResolvedScenario,
    protocol: &'a Iso9283Protocol,
    servo: Servo,
    cancel: &'a AtomicBool,
    effort: Effort,
    path_m: Vec<Vector3<f64>>,
}

impl Cycles<'_> {
    /// Repeats a cycle as often as the protocol asks for.
    ///
    /// Each one has a seed of its own. If the first two are equal bit for bit all the same, nothing
    /// depends on the seed, and the others need not be simulated.
    fn repeat(
        &mut self,
        plant: &mut dyn Plant,
        cycle: &Cycle,
        start_s: f64,
        progress: Option<&Progress>,
    ) -> Result<Repeated, String> {
        let duration_s = cycle.trajectory.duration_s();
        let mut repeated = Repeated {
            attained: Vec::new(),
            arrivals: Vec::new(),
            simulated: 0,
            repeats_itself: false,
        };
        let stops = cycle.stops.len();
        for number in 1..=self.protocol.cycles {
            let at_s = start_s + f64::from(number - 1) * duration_s;
            if repeated.repeats_itself {
                let again = repeated.attained[..stops].to_vec();
                repeated
                    .attained
                    .extend(again.into_iter().map(|each| Attained {
                        cycle: number,
                        time_s: each.time_s.map(|time_s| time_s - start_s + at_s),
                        ..each
                    }));
            } else {
                let measured = self.measured_cycle(plant, cycle, number, at_s)?;
                repeated.simulated = number;
                repeated.attained.extend(measured.attained);
                if number <= ARRIVAL_CYCLES {
                    repeated.arrivals.extend(measured.arrivals);
                }
                if number == 2 {
                    let (first, second) = repeated.attained.split_at(stops);
                    repeated.repeats_itself = first.iter().zip(second).all(|(a, b)| {
                        a.position_m == b.position_m && a.orientation == b.orientation
                    });
                }
            }
            if let Some(progress) = progress {
                progress.step();
            }
        }
        Ok(repeated)
    }

    fn measured_cycle(
        &mut self,
        plant: &mut dyn Plant,
        cycle: &Cycle,
        number: u32,
        start_s: f64,
    ) -> Result<CycleMeasurement, String> {
        let cell = self.reality.cell();
        let recording = self.simulated_cycle(plant, cycle, number)?;
        self.effort.add(cell, &recording);
        if number == 1 {
            let point = self.protocol.flange_from_point;
            let states = recording.state.iter();
            self.path_m
                .extend(states.map(|state| (state.world_from_flange * point).translation.vector));
        }
        Ok(measure_cycle(
            cell,
            self.protocol,
            &recording,
            &cycle.stops,
            number,
            start_s,
        ))
    }

    /// One cycle, with whatever is random in it drawn from the scenario's seed and its number.
    fn simulated_cycle(
        &self,
        plant: &mut dyn Plant,
        cycle: &Cycle,
        number: u32,
    ) -> Result<Recording, String> {
        let actuation = Actuation {
            seed: cycle_seed(self.resolved.scenario.seed, number),
            ..self.reality.actuation().clone()
        };
        let hooks = Hooks {
            cancel: Some(self.cancel),
            progress: None,
        };
        simulate(plant, &self.servo, &actuation, &cycle.trajectory, hooks)
            .map_err(|error| format!("cycle {number}: {error}"))
    }

    /// The measurements with the tracker's noise, the same in every engine.
    fn tracked(&self, attained: &[Attained], stream: u64) -> Vec<Attained> {
        let sigma_m = self.protocol.tracker_noise_m;
        if sigma_m == 0.0 {
            return attained.to_vec();
        }
        let mut random = SplitMix64::new(self.resolved.scenario.seed ^ (stream << 32));
        let mut normal = || {
            // Box and Muller.
            let radius = (-2.0 * (1.0 - random.uniform(0.0, 1.0)).ln()).sqrt();
            radius * (TAU * random.uniform(0.0, 1.0)).cos()
        };
        attained
            .iter()
            .map(|each| Attained {
                position_m: each.position_m + sigma_m * Vector3::from_fn(|_, _| normal()),
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
