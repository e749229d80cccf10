//! An excitation run, in place of goals: once with each payload, in each engine.

use std::collections::BTreeMap;
use std::time::Instant;

use nalgebra::Vector3;
use needlebench_clearance::ClearanceModel;
use needlebench_engine::{
    Actuation, Engine, EngineError, EngineIdentity, EnginePool, Hooks, Motion, MotionJob,
    Recording, engine_names, run_motions,
};
use needlebench_evaluation::excitation::{
    ExcitationReport, LoadMeasurement, LoadReport, MotionReport, SUBJECT, judge,
};
use needlebench_evaluation::iso9283::Effort;
use needlebench_evaluation::report::{ClearanceReport, EngineFailure, Report};
use needlebench_evaluation::{
    EngineDifference, certified_clearance, pairs, recorded_clearance, sample_indices,
};
use needlebench_parallel::{Control, in_parallel};
use needlebench_planning::excitation::{ExcitationError, ExcitationPlan};
use needlebench_scenario::ResolvedScenario;
use needlebench_scenario::excitation::ExcitationProtocol;

use crate::assemble::notes;
use crate::iso9283::{empty_report, unplanned};
use crate::rtde::{RtdeLog, RtdeSource};
use crate::scenario_run::{ExcitationRun, RealArm, RunError, ScenarioRun};
use crate::setup::Setup;

/// What one engine made of the run with one payload.
struct Made {
    measured: LoadMeasurement,
    log: RtdeLog,
    /// The flange at the rows of the log, world, m.
    flange_m: Vec<Vector3<f64>>,
}

/// All payloads in one engine, or why not.
struct EngineMade {
    engine: &'static str,
    identity: Option<EngineIdentity>,
    made: Vec<Option<Made>>,
    failure: Option<EngineFailure>,
}

/// Makes the run of a scenario that has one.
pub(crate) fn run(
    resolved: &ResolvedScenario,
    plan: &Result<ExcitationPlan, ExcitationError>,
    engines: &[&'static dyn Engine],
    control: &Control<'_>,
) -> Result<ScenarioRun, RunError> {
    let started = Instant::now();
    let mut timings = BTreeMap::new();
    let protocol = resolved.excitation.as_ref();
    let protocol = protocol.expect("what is planned is the scenario's run");
    let plan = match plan {
        Ok(plan) => plan,
        Err(error) => return Ok(unplanned(resolved, SUBJECT, &error.to_string(), timings)),
    };
    let carrying: Vec<ResolvedScenario> = protocol
        .loads
        .iter()
        .map(|load| {
            let mut with = resolved.clone();
            with.cell.tool.body = load.with_tool(&resolved.cell.tool);
            with
        })
        .collect();
    let model = ClearanceModel::new(&resolved.cell);
    let setups: Vec<Setup<'_>> = carrying
        .iter()
        .map(|with| Setup::new(with, &model))
        .collect::<Result<_, _>>()?;
    timings.insert("planning_s".to_owned(), started.elapsed().as_secs_f64());
    let made = simulate(&setups, protocol, plan, engines, control);
    timings.insert(
        "simulation_s".to_owned(),
        started.elapsed().as_secs_f64() - timings["planning_s"],
    );
    let chosen = engine_names(engines);
    let mut report = ExcitationReport {
        postures_rad: protocol.postures.iter().map(|q| (*q).into()).collect(),
        dwell_s: protocol.dwell_s,
        duration_s: plan.trajectory.duration_s(),
        clearance_limit_m: protocol.clearance_m,
        self_clearance_limit_m: protocol.self_clearance_m,
        planned: ClearanceReport::of(&certified_clearance(&resolved.cell, &plan.certificate)),
        motions: motions(resolved, plan),
        loads: setups
            .iter()
            .zip(&protocol.loads)
            .map(|(setup, load)| LoadReport {
                added_kg: load.body.mass_kg,
                payload_kg: setup.resolved.cell.tool.body.mass_kg,
                payload_cog_m: setup.resolved.cell.tool.body.com_m.into(),
                truth: setup.real.report(),
            })
            .collect(),
        engines: BTreeMap::new(),
        engine_difference: difference(&made),
        files: Vec::new(),
    };
    let (mut failures, mut identities, mut logs) = (Vec::new(), Vec::new(), Vec::new());
    for each in made {
        identities.extend(each.identity);
        failures.extend(each.failure);
        let mut measured = Vec::new();
        for (load, made) in each.made.into_iter().enumerate() {
            let Some(made) = made else { continue };
            measured.push(LoadMeasurement {
                load: load + 1,
                ..made.measured
            });
            logs.push((each.engine, load, made.log));
        }
        report.engines.insert(each.engine.to_owned(), measured);
    }
    let judged = judge(&report, &resolved.scenario.criteria, &chosen);
    let setup = setups.first().expect("a run has a payload");
    Ok(ScenarioRun {
        report: Report {
            verdict: judged.verdict(),
            criteria: judged.results,
            not_judged: judged.not_judged,
            truth: setup.real.report(),
            notes: notes(resolved, &chosen),
            excitation: Some(report),
            engine_failures: failures,
            ..empty_report(resolved, identities, timings)
        },
        events: Vec::new(),
        stopped: Vec::new(),
        plans: Vec::new(),
        runs: Vec::new(),
        iso9283: None,
        excitation: Some(ExcitationRun { logs }),
        rtde: None,
        interrupted: control.is_cancelled(),
        real_arm: RealArm::of(setup.real.cell()),
    })
}

/// The certified clearances of each motion.
pub fn motions(resolved: &ResolvedScenario, plan: &ExcitationPlan) -> Vec<MotionReport> {
    plan.motions
        .iter()
        .map(|motion| {
            let classes = certified_clearance(&resolved.cell, &motion.certificate);
            MotionReport {
                motion: motion.aim.in_words(),
                clearance: ClearanceReport::of(&classes),
            }
        })
        .collect()
}

fn simulate(
    setups: &[Setup<'_>],
    protocol: &ExcitationProtocol,
    plan: &ExcitationPlan,
    engines: &[&'static dyn Engine],
    control: &Control<'_>,
) -> Vec<EngineMade> {
    let pool = EnginePool::new(engines);
    let settings = &setups[0].resolved.scenario.engines.settings();
    control.progress.message("simulating");
    control
        .progress
        .expect((setups.len() * engines.len()) as u64);
    in_parallel(control.threads, engines, |&engine| {
        let mut tell = |text: &str| control.progress.notice(text);
        // Why it could not start is told again to whoever asks it for a motion.
        let _ = pool.start(engine, settings, &mut tell);
        // One arm, but other noise with each payload.
        let actuations: Vec<Actuation> = setups
            .iter()
            .enumerate()
            .map(|(load, setup)| {
                let actuation = setup.real.actuation();
                Actuation {
                    seed: actuation.seed ^ ((load as u64) << 32),
                    ..actuation.clone()
                }
            })
            .collect();
        let jobs: Vec<MotionJob<'_>> = setups
            .iter()
            .zip(&actuations)
            .map(|(setup, actuation)| MotionJob {
                motion: Motion {
                    actuation,
                    ..setup.motion(&plan.trajectory)
                },
                ..setup.job(&plan.trajectory)
            })
            .collect();
        let hooks = Hooks {
            cancel: Some(control.cancel),
            progress: None,
        };
        let mut made: Vec<Option<Made>> = setups.iter().map(|_| None).collect();
        let mut failed: Option<(usize, EngineError)> = None;
        let mut ended = |index: usize, result: Result<Recording, EngineError>| {
            control.progress.step();
            match result {
                Ok(recording) => {
                    made[index] = Some(measured(
                        &setups[index],
                        &actuations[index],
                        protocol,
                        plan,
                        &recording,
                    ));
                }
                Err(error) if failed.as_ref().is_none_or(|(first, _)| index < *first) => {
                    failed = Some((index, error));
                }
                Err(_) => {}
            }
        };
        let motion_settings = setups[0].motion_settings();
        let done = run_motions(&pool, engine, &jobs, motion_settings, hooks, &mut ended);
        let during = |index: usize| format!("the run with payload {}", index + 1);
        let failure = match (done.error, failed) {
            (Some(EngineError::Cancelled), _) | (None, None) => None,
            (Some(error), _) | (None, Some((_, error @ EngineError::NotMade { .. }))) => {
                Some((None, error))
            }
            (None, Some((index, error))) => Some((Some(during(index)), error)),
        };
        EngineMade {
            engine: engine.name(),
            identity: done.identity,
            made,
            failure: failure.map(|(during, error)| EngineFailure {
                engine: engine.name().to_owned(),
                during,
                message: error.to_string(),
            }),
        }
    })
}

/// A recording as what is kept of it.
fn measured(
    setup: &Setup<'_>,
    actuation: &Actuation,
    protocol: &ExcitationProtocol,
    plan: &ExcitationPlan,
    recording: &Recording,
) -> Made {
    let cell = setup.real.cell();
    let mut effort = Effort::default();
    effort.add(cell, recording);
    let tolerance_m = setup.resolved.scenario.planning.certificate_tolerance_mm * 1e-3;
    let period_s = protocol.period_s;
    let minima = recorded_clearance(
        cell,
        setup.real.model(),
        &plan.trajectory,
        recording,
        period_s,
        tolerance_m,
    );
    let log = RtdeSource::of(setup)
        .driven_by(actuation)
        .log(recording, &plan.trajectory, period_s);
    let errors = || {
        log.rows
            .iter()
            .map(|row| row.actual_q - row.target.position)
    };
    let count = log.rows.len() as f64;
    let mean_square = errors()
        .map(|error| error.component_mul(&error))
        .sum::<needlebench_kinematics::Joints>()
        / count;
    let worst = errors().fold(needlebench_kinematics::Joints::zeros(), |most, error| {
        most.sup(&error.abs())
    });
    let flange_m = sample_indices(recording, period_s)
        .into_iter()
        .map(|index| recording.state[index].world_from_flange.translation.vector)
        .collect();
    Made {
        measured: LoadMeasurement {
            load: 0,
            clearance: ClearanceReport::of(&minima),
            tracking_rms_rad: mean_square.map(f64::sqrt).into(),
            tracking_peak_rad: worst.into(),
            effort,
        },
        log,
        flange_m,
    }
}

/// Largest distance of the flanges of two engines at the same time, and at the end.
fn difference(made: &[EngineMade]) -> Option<EngineDifference> {
    let finished: Vec<(&'static str, &EngineMade)> = made
        .iter()
        .filter(|each| each.made.iter().all(Option::is_some))
        .map(|each| (each.engine, each))
        .collect();
    EngineDifference::largest(pairs(&finished).map(|[(first, a), (second, b)]| {
        let (mut peak_m, mut end_m) = (0.0_f64, 0.0_f64);
        for (a, b) in a.made.iter().flatten().zip(b.made.iter().flatten()) {
            let distances = a
                .flange_m
                .iter()
                .zip(&b.flange_m)
                .map(|(a, b)| (a - b).norm());
            let distances: Vec<f64> = distances.collect();
            peak_m = distances.iter().copied().fold(peak_m, f64::max);
            end_m = end_m.max(distances.last().copied().unwrap_or(0.0));
        }
        ([*first, *second], [peak_m, end_m])
    }))
}
