//! A test by ISO 9283 in place of goals: plan one cycle, simulate it again and again, evaluate.

mod picture;
mod simulate;
mod text;
mod write;

pub(crate) use picture::{attained_picture, stabilisation_picture};
pub(crate) use simulate::{EngineCycles, simulate_engine};
pub(crate) use text::{measured_text, report_markdown, report_text};
pub(crate) use write::write_results;

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use needlebench_cell::ResolvedScenario;
use needlebench_cell::iso9283::Iso9283Protocol;
use needlebench_cell::scenario::EngineName;
use needlebench_clearance::ClearanceModel;
use needlebench_engine::EngineIdentity;
use needlebench_evaluation::EngineDifference;
use needlebench_evaluation::iso9283::{
    Arrival, Attained, Commanded, EngineMeasurement, Iso9283Report, ProtocolSummary, SUBJECT,
    StabilisationReport, drift, evaluate, judge,
};
use needlebench_evaluation::report::{
    CriterionResult, EngineFailure, Report, SCHEMA_VERSION, ScenarioSummary, Verdict,
};
use needlebench_planning::iso9283::{ProtocolPlan, plan_protocol};

use crate::pipeline::{EngineChoice, RealArm, RunError, RunOptions, ScenarioRun};
use crate::plants::start_harness;
use crate::progress::Progress;
use crate::provenance::provenance;
use crate::reality::Reality;

/// What a simulated test leaves besides its report.
#[derive(Debug)]
pub struct ProtocolRun {
    /// Commanded poses.
    pub commanded: Vec<Commanded>,
    /// Measurements and arrivals of each engine that finished.
    pub engines: Vec<(EngineName, Vec<Attained>, Vec<Arrival>)>,
    /// Half-width of the band of the stabilisation time, m.
    pub limit_band_m: f64,
}

/// Runs the protocol of a scenario that has one.
///
/// A protocol that cannot be carried out is a missed criterion here; commands find it while they
/// read the scenario.
pub(crate) fn run(
    resolved: &ResolvedScenario,
    protocol: &Iso9283Protocol,
    options: &RunOptions,
    cancel: &AtomicBool,
    progress: &Progress,
) -> Result<ScenarioRun, RunError> {
    let started = Instant::now();
    let mut timings = BTreeMap::new();
    progress.message("planning");
    let model = ClearanceModel::new(&resolved.cell);
    let reality = Reality::new(resolved, &model)?;
    let plan = plan_protocol(resolved, protocol, &model);
    timings.insert("planning_s".to_owned(), started.elapsed().as_secs_f64());
    let plan = match plan {
        Ok(plan) => plan,
        Err(error) => return Ok(unplanned(resolved, &error.to_string(), timings)),
    };
    let outcomes = simulate_engines(
        &reality, resolved, protocol, &plan, options, cancel, progress,
    );
    timings.insert(
        "simulation_s".to_owned(),
        started.elapsed().as_secs_f64() - timings["planning_s"],
    );

    let commanded = commanded(protocol);
    let mut report = Iso9283Report {
        protocol: ProtocolSummary::new(
            protocol,
            &plan.joints,
            plan.cycle.trajectory.duration_s(),
            plan.directional
                .as_ref()
                .map(|cycle| cycle.trajectory.duration_s()),
        ),
        engines: BTreeMap::new(),
        engine_difference: difference(&outcomes),
        files: Vec::new(),
    };
    let (mut failures, mut identities, mut engines) = (Vec::new(), Vec::new(), Vec::new());
    for (engine, outcome) in outcomes {
        match outcome {
            Ok(cycles) => {
                let measured = measurement(protocol, &commanded, &cycles);
                report.engines.insert(engine.name().to_owned(), measured);
                identities.push(cycles.identity);
                engines.push((engine, cycles.attained, cycles.arrivals));
            }
            Err(message) if !cancel.load(Ordering::Relaxed) => failures.push(EngineFailure {
                engine: engine.name().to_owned(),
                during: Some("ISO 9283".to_owned()),
                message,
            }),
            Err(_) => {}
        }
    }
    let scenario = &resolved.scenario;
    let own = &scenario
        .iso9283
        .as_ref()
        .expect("a resolved protocol has its section")
        .criteria;
    let (verdict, criteria) = judge(&report, own, &scenario.criteria);
    let interrupted = cancel.load(Ordering::Relaxed);
    Ok(ScenarioRun {
        events: Vec::new(),
        stopped: Vec::new(),
        report: Report {
            verdict,
            criteria,
            truth: reality.report(),
            iso9283: Some(report),
            engine_failures: failures,
            ..empty_report(resolved, identities, timings)
        },
        plans: Vec::new(),
        runs: Vec::new(),
        iso9283: Some(ProtocolRun {
            commanded,
            engines,
            limit_band_m: protocol.limit_band_m,
        }),
        interrupted,
        real_arm: RealArm::of(reality.cell()),
    })
}

/// Every engine's cycles, or why there are none.
fn simulate_engines(
    reality: &Reality<'_>,
    resolved: &ResolvedScenario,
    protocol: &Iso9283Protocol,
    plan: &ProtocolPlan,
    options: &RunOptions,
    cancel: &AtomicBool,
    progress: &Progress,
) -> Vec<(EngineName, Result<EngineCycles, String>)> {
    let engines = EngineChoice::engines(options.engines, resolved);
    progress.message("simulating");
    progress.expect(u64::from(protocol.cycles) * engines.len() as u64);
    let one = |engine: EngineName| {
        let harness = (engine == EngineName::Mujoco).then(|| start_harness(resolved, progress));
        simulate_engine(
            reality,
            resolved,
            protocol,
            plan,
            engine,
            harness.as_ref(),
            cancel,
            progress,
        )
    };
    if options.jobs > 1 {
        std::thread::scope(|scope| {
            let one = &one;
            let threads: Vec<_> = engines
                .iter()
                .map(|&engine| (engine, scope.spawn(move || one(engine))))
                .collect();
            threads
                .into_iter()
                .map(|(engine, thread)| (engine, thread.join().expect("plants do not panic")))
                .collect()
        })
    } else {
        engines
            .iter()
            .map(|&engine| (engine, one(engine)))
            .collect()
    }
}

fn commanded(protocol: &Iso9283Protocol) -> Vec<Commanded> {
    (1_u32..)
        .zip(&protocol.base_from_point)
        .map(|(pose, base_from_point)| Commanded {
            pose,
            position_m: base_from_point.translation.vector.into(),
            orientation: Some(base_from_point.rotation),
        })
        .collect()
}

fn measurement(
    protocol: &Iso9283Protocol,
    commanded: &[Commanded],
    cycles: &EngineCycles,
) -> EngineMeasurement {
    let statistics = evaluate(commanded, &cycles.attained)
        .expect("every pose is commanded and visited at least twice");
    let remark = if statistics.nothing_random {
        Some(
            "RP = 0 because nothing random is switched on: the first two cycles, each with its own \
             seed, are equal bit for bit"
                .to_owned(),
        )
    } else if cycles.repeats_itself {
        Some(
            "the robot repeats itself bit for bit, since nothing random is switched on: the spread \
             is the tracker's noise alone"
                .to_owned(),
        )
    } else {
        None
    };
    EngineMeasurement {
        statistics,
        stabilisation: StabilisationReport::of_arrivals(&cycles.arrivals, protocol.limit_band_m),
        drift: drift(&commanded[0], &cycles.attained),
        cycles_simulated: cycles.simulated,
        effort: cycles.effort.clone(),
        remark,
    }
}

/// Over the first cycles: largest distance at the same time, and between the attained positions.
fn difference(outcomes: &[(EngineName, Result<EngineCycles, String>)]) -> Option<EngineDifference> {
    let [(_, Ok(a)), (_, Ok(b))] = outcomes else {
        return None;
    };
    let largest = |distances: &mut dyn Iterator<Item = f64>| distances.fold(0.0, f64::max);
    Some(EngineDifference {
        peak_tip_m: largest(&mut a.path_m.iter().zip(&b.path_m).map(|(a, b)| (a - b).norm())),
        settled_tip_m: largest(
            &mut a
                .first_attained_m
                .iter()
                .zip(&b.first_attained_m)
                .map(|(a, b)| (a - b).norm()),
        ),
    })
}

/// The report of a protocol that cannot be carried out.
fn unplanned(
    resolved: &ResolvedScenario,
    reason: &str,
    timings: BTreeMap<String, f64>,
) -> ScenarioRun {
    let criterion = CriterionResult {
        goal: SUBJECT.to_owned(),
        label: None,
        engine: None,
        criterion: "planned".to_owned(),
        value: None,
        limit: None,
        unit: "1",
        pass: false,
        detail: reason.to_owned(),
    };
    ScenarioRun {
        events: Vec::new(),
        stopped: Vec::new(),
        report: Report {
            criteria: vec![criterion],
            ..empty_report(resolved, Vec::new(), timings)
        },
        plans: Vec::new(),
        runs: Vec::new(),
        iso9283: None,
        interrupted: false,
        real_arm: RealArm::of(&resolved.cell),
    }
}

fn empty_report(
    resolved: &ResolvedScenario,
    identities: Vec<EngineIdentity>,
    timings: BTreeMap<String, f64>,
) -> Report {
    Report {
        truth: None,
        schema_version: SCHEMA_VERSION,
        scenario: ScenarioSummary {
            name: resolved.scenario.name.clone(),
            description: resolved.scenario.description.clone(),
            file: resolved.source.file.clone(),
        },
        verdict: Verdict::Fail,
        criteria: Vec::new(),
        goals: Vec::new(),
        iso9283: None,
        engine_failures: Vec::new(),
        enclosure: Vec::new(),
        notes: resolved.notes.clone(),
        provenance: provenance(resolved, identities),
        timings,
    }
}
