//! A test by ISO 9283 in place of goals: one cycle, simulated again and again, evaluated.

mod simulate;

use std::collections::{BTreeMap, BTreeSet};
use std::time::Instant;

use needlebench_cell::UNSEEN_BODY;
use needlebench_clearance::ClearanceModel;
use needlebench_engine::{Engine, EngineIdentity, EnginePool, engine_names};
use needlebench_evaluation::iso9283::{
    EngineMeasurement, Iso9283Report, ProtocolSummary, SUBJECT, StabilisationReport, judge,
};
use needlebench_evaluation::report::{
    ClearanceReport, CriterionResult, EngineFailure, NotJudged, Report, SCHEMA_VERSION,
    ScenarioSummary, Verdict,
};
use needlebench_evaluation::{EngineDifference, pairs, planned_clearance};
use needlebench_iso9283::{Commanded, drift, evaluate};
use needlebench_parallel::{Control, in_parallel};
use needlebench_planning::iso9283::{ProtocolError, ProtocolPlan};
use needlebench_robot::ArmInUse;
use needlebench_scenario::ResolvedScenario;
use needlebench_scenario::iso9283::Iso9283Protocol;

use crate::assemble::{assumed, notes};
use crate::provenance::provenance;
use crate::scenario_run::{ProtocolRun, RealArm, RunError, ScenarioRun};
use crate::setup::Setup;
use simulate::{CycleError, Cycles, EngineCycles};

/// Runs the protocol of a scenario that has one.
///
/// A protocol that cannot be carried out is a failed criterion here; commands find it while they read the scenario.
pub(crate) fn run(
    resolved: &ResolvedScenario,
    plan: &Result<ProtocolPlan, ProtocolError>,
    engines: &[&'static dyn Engine],
    control: &Control<'_>,
) -> Result<ScenarioRun, RunError> {
    let started = Instant::now();
    let mut timings = BTreeMap::new();
    let protocol = resolved.iso9283.as_ref();
    let protocol = protocol.expect("what is planned is the scenario's protocol");
    let model = ClearanceModel::new(&resolved.cell);
    let setup = Setup::new(resolved, &model)?;
    timings.insert("planning_s".to_owned(), started.elapsed().as_secs_f64());
    let plan = match plan {
        Ok(plan) => plan,
        Err(error) => return Ok(unplanned(resolved, SUBJECT, &error.to_string(), timings)),
    };
    let chosen = engine_names(engines);
    let outcomes = simulate_engines(&setup, protocol, plan, engines, control);
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
                report.engines.insert(engine.to_owned(), measured);
                identities.push(cycles.identity);
                engines.push((engine, cycles.attained, cycles.arrivals));
            }
            Err(error) if !control.is_cancelled() => failures.push(EngineFailure {
                engine: engine.to_owned(),
                during: Some("ISO 9283".to_owned()),
                message: error.to_string(),
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
    let mut judged = judge(&report, own, &scenario.criteria, &chosen);
    judged
        .not_judged
        .extend(open_at_cuts(resolved, &model, plan));
    let interrupted = control.is_cancelled();
    Ok(ScenarioRun {
        events: Vec::new(),
        stopped: Vec::new(),
        report: Report {
            verdict: judged.verdict(),
            criteria: judged.results,
            not_judged: judged.not_judged,
            truth: setup.real.report(),
            notes: notes(resolved, &chosen),
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
        excitation: None,
        rtde: None,
        interrupted,
        real_arm: RealArm::of(setup.real.cell()),
    })
}

/// Clearances of the cycles that are not known, since the patient may be nearer behind the cuts of its scan.
fn open_at_cuts(
    resolved: &ResolvedScenario,
    model: &ClearanceModel,
    plan: &ProtocolPlan,
) -> Vec<NotJudged> {
    let cell = &resolved.cell;
    if cell.behind_cuts.is_empty() {
        return Vec::new();
    }
    let tolerance_m = resolved.scenario.planning.certificate_tolerance_mm * 1e-3;
    let cycles = plan.directional.iter().chain([&plan.cycle]);
    let unknown: BTreeSet<&str> = cycles
        .flat_map(|cycle| {
            let minima = planned_clearance(cell, model, &cycle.trajectory, tolerance_m);
            let unknown: Vec<&str> = ClearanceReport::of(&minima).unknown().collect();
            unknown
        })
        .collect();
    let open = unknown.into_iter().map(|class| NotJudged {
        goal: SUBJECT.to_owned(),
        label: None,
        engine: None,
        criterion: format!("min_clearance_mm.{class}"),
        reason: UNSEEN_BODY.to_owned(),
        requirement: None,
    });
    open.collect()
}

/// Every engine's cycles, or why there are none.
fn simulate_engines(
    setup: &Setup<'_>,
    protocol: &Iso9283Protocol,
    plan: &ProtocolPlan,
    engines: &[&'static dyn Engine],
    control: &Control<'_>,
) -> Vec<(&'static str, Result<EngineCycles, CycleError>)> {
    let pool = EnginePool::new(engines);
    let settings = &setup.resolved.scenario.engines.settings();
    let sequences = 1 + u64::from(plan.directional.is_some());
    control.progress.message("simulating");
    let cycles = u64::from(protocol.cycles) * sequences;
    control.progress.expect(cycles * engines.len() as u64);
    in_parallel(control.threads, engines, |&engine| {
        let mut tell = |text: &str| control.progress.notice(text);
        // Why it could not start is told again to whoever asks it for a motion.
        let _ = pool.start(engine, settings, &mut tell);
        let cycles = Cycles::new(setup, protocol, &pool, engine, control);
        (engine.name(), cycles.simulate(plan))
    })
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
            "RP = 0 because no random effects are enabled: the first two cycles, each with its own \
             seed, are bit-identical"
                .to_owned(),
        )
    } else if cycles.repeats_itself {
        Some(
            "the robot motion is bit-identical, as no random effects are enabled: the spread is \
             tracker noise only"
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
fn difference(
    outcomes: &[(&'static str, Result<EngineCycles, CycleError>)],
) -> Option<EngineDifference> {
    let finished = outcomes.iter();
    let finished: Vec<(&'static str, &EngineCycles)> = finished
        .filter_map(|(engine, cycles)| Some((*engine, cycles.as_ref().ok()?)))
        .collect();
    let largest = |distances: &mut dyn Iterator<Item = f64>| distances.fold(0.0, f64::max);
    EngineDifference::largest(pairs(&finished).map(|[(first, a), (second, b)]| {
        let paths = a.path_m.iter().zip(&b.path_m);
        let attained = a.first_attained_m.iter().zip(&b.first_attained_m);
        let peak_tip_m = largest(&mut paths.map(|(a, b)| (a - b).norm()));
        let settled_tip_m = largest(&mut attained.map(|(a, b)| (a - b).norm()));
        ([*first, *second], [peak_tip_m, settled_tip_m])
    }))
}

/// The report of a protocol that cannot be carried out.
pub(crate) fn unplanned(
    resolved: &ResolvedScenario,
    subject: &str,
    reason: &str,
    timings: BTreeMap<String, f64>,
) -> ScenarioRun {
    let criterion = CriterionResult {
        goal: subject.to_owned(),
        label: None,
        engine: None,
        criterion: "planned".to_owned(),
        value: None,
        limit: None,
        unit: "1",
        pass: false,
        detail: reason.to_owned(),
        requirement: None,
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
        excitation: None,
        rtde: None,
        interrupted: false,
        real_arm: RealArm::of(&resolved.cell),
    }
}

/// The report of a scenario without goals, as far as it does not depend on what was done.
pub(crate) fn empty_report(
    resolved: &ResolvedScenario,
    identities: Vec<EngineIdentity>,
    timings: BTreeMap<String, f64>,
) -> Report {
    Report {
        expected: None,
        truth: None,
        schema_version: SCHEMA_VERSION,
        scenario: ScenarioSummary {
            name: resolved.scenario.name.clone(),
            description: resolved.scenario.description.clone(),
            file: resolved.source.file.clone(),
        },
        verdict: Verdict::Fail,
        criteria: Vec::new(),
        not_judged: Vec::new(),
        trace: Vec::new(),
        goals: Vec::new(),
        iso9283: None,
        excitation: None,
        judged: None,
        engine_failures: Vec::new(),
        arm: resolved
            .robot_description
            .arm
            .as_ref()
            .map(ArmInUse::report),
        gravity: resolved.gravity.clone(),
        enclosure: Vec::new(),
        assumed: assumed(resolved),
        notes: resolved.notes.clone(),
        provenance: provenance(resolved, identities),
        timings,
    }
}
