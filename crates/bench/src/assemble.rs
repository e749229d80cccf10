//! The last stage: plans, recordings and what was found out about them into the values of the report.

use std::collections::BTreeMap;

use nalgebra::Point3;
use needlebench_cell::{ClearanceClass, Rule};
use needlebench_engine::{EngineIdentity, Recording, pieces_in_words};
use needlebench_evaluation::metric::set_measured;
use needlebench_evaluation::ranking::rank_goal;
use needlebench_evaluation::report::{
    ClassClearance, ClassMarginReport, ClearanceReport, ConfigurationReport, EngineFailure,
    EngineReport, ExpectedReport, GoalReport, MarginReport, MarginsReport, PhaseReport,
    RejectionReport, Report, RouteReport, SCHEMA_VERSION, ScenarioSummary, SearchReport,
    StraightReport,
};
use needlebench_evaluation::room::RoomModel;
use needlebench_evaluation::{
    add_approach_speeds, certified_clearance, engine_difference, judge, measure_motion,
    measure_needle, planned_clearance, posture_clearance, route_clearance, tip_of, tip_sensitivity,
};
use needlebench_kinematics::trajectory::JointTrajectory;
use needlebench_planning::{
    ConfigurationPlan, GoalPlan, Margin, Planner, PostureMargins, Rejection, crossed_fissures,
    judge_route, needle_route,
};
use needlebench_robot::{ArmInUse, enclosures};
use needlebench_scenario::imperfections::{ArmClass, BreathState, Imperfections};
use needlebench_scenario::{Expected, Goal, ResolvedScenario};
use needlebench_uncertainty::Source;

use crate::adjudication::Adjudicated;
use crate::budgets::{Budgets, measured_and_assumed};
use crate::events::{EventRun, events_report};
use crate::needle::needle_report;
use crate::probability::Probabilities;
use crate::provenance::provenance;
use crate::setup::Setup;
use crate::simulate::EngineRun;

/// What the stages of a run made.
pub(crate) struct Results<'a> {
    pub plans: &'a [GoalPlan],
    /// By goal, configuration and engine.
    pub runs: &'a [Vec<Vec<EngineRun>>],
    pub events: &'a [EventRun],
    pub budgets: &'a Budgets,
    pub probabilities: &'a Probabilities,
    /// By goal and configuration.
    pub adjudicated: &'a [Vec<Adjudicated>],
    /// Engines that were to measure everything.
    pub engines: &'a [&'static str],
    pub failures: Vec<EngineFailure>,
    pub identities: Vec<EngineIdentity>,
    pub timings: BTreeMap<String, f64>,
}

/// What the report of a goal is made with besides its plan and its motions.
pub(crate) struct Context<'a> {
    pub setup: &'a Setup<'a>,
    pub budgets: &'a Budgets,
    /// None if they are not requested.
    pub probabilities: Option<&'a Probabilities>,
    /// None if the room is not requested.
    pub room: Option<RoomModel<'a>>,
    pub events: &'a [EventRun],
    /// Engines that were to measure everything.
    pub engines: &'a [&'static str],
}

/// The report of a run.
pub(crate) fn assemble(setup: &Setup<'_>, results: Results<'_>) -> Report {
    let resolved = setup.resolved;
    let context = Context {
        setup,
        budgets: results.budgets,
        probabilities: Some(results.probabilities),
        room: Some(RoomModel::new(resolved)),
        events: results.events,
        engines: results.engines,
    };
    let mut goals: Vec<GoalReport> = results
        .plans
        .iter()
        .zip(results.runs)
        .zip(results.adjudicated)
        .enumerate()
        .map(|(index, ((plan, runs), adjudicated))| GoalReport {
            needle: needle_report(resolved, &resolved.goals[index]),
            ..goal_report(&context, index, plan, runs, adjudicated)
        })
        .collect();
    let (verdict, judged) = judge(
        &mut goals,
        &resolved.goals,
        &resolved.scenario.criteria,
        results.engines,
    );
    for goal in &mut goals {
        rank_goal(goal, &resolved.scenario.ranking);
    }
    Report {
        schema_version: SCHEMA_VERSION,
        scenario: ScenarioSummary {
            name: resolved.scenario.name.clone(),
            description: resolved.scenario.description.clone(),
            file: resolved.source.file.clone(),
        },
        verdict,
        criteria: judged.results,
        not_judged: judged.not_judged,
        trace: Vec::new(), // when all is judged
        goals,
        iso9283: None,
        excitation: None,
        judged: None,
        engine_failures: results.failures,
        arm: resolved
            .robot_description
            .arm
            .as_ref()
            .map(ArmInUse::report),
        gravity: resolved.gravity.clone(),
        enclosure: enclosures(&resolved.cell.robot, &resolved.robot_description),
        assumed: assumed(resolved),
        notes: notes(resolved, results.engines),
        expected: resolved.expected.as_ref().map(expected_report),
        truth: setup.real.report(),
        provenance: provenance(resolved, results.identities),
        timings: results.timings,
    }
}

/// Values of the arm that are assumed.
pub(crate) fn assumed(resolved: &ResolvedScenario) -> BTreeMap<String, String> {
    let arm = resolved.robot_description.arm.as_ref();
    arm.map_or_else(BTreeMap::new, |arm| arm.arm.data.assumed())
}

/// The notes of a scenario, and where engines ran of what they collide with.
pub(crate) fn notes(resolved: &ResolvedScenario, engines: &[&str]) -> Vec<String> {
    let mut notes = resolved.notes.clone();
    let expected = resolved.expected.as_ref();
    notes.extend(expected.and_then(|expected| bases_in_words(&expected.imperfections)));
    if !engines.is_empty() {
        notes.extend(pieces_in_words(&resolved.cell));
    }
    notes
}

/// Arm and patient population of the RMS tip errors.
fn expected_report(expected: &Expected) -> ExpectedReport {
    ExpectedReport {
        arm: expected.class.map(ArmClass::name),
        arm_in_words: match expected.class {
            Some(ArmClass::FactoryCalibrated) => {
                "factory calibration applied; residual calibration error and load-dependent \
                 deflection remain"
            }
            Some(ArmClass::NominalKinematics) => {
                "inverse kinematics with nominal lengths; the full calibration error remains"
            }
            Some(ArmClass::CalibratedHere) => {
                "calibrated on site with the tool mounted; residual calibration error and the \
                 deflection that a calibration cannot represent remain"
            }
            None => own_in_words(&expected.imperfections),
        },
        breath: match expected.breath {
            BreathState::Hold => "hold",
            BreathState::Free => "free",
        },
    }
}

/// Arm and patient population from the scenario, with what was measured.
fn own_in_words(imperfections: &Imperfections) -> &'static str {
    let [markers, target] = [Source::Registration, Source::Imaging]
        .map(|source| source.is_measured_in(imperfections) == Some(true));
    match (markers, target) {
        (false, false) => "from the scenario's [imperfections]",
        (true, false) => "from the scenario's [imperfections], measured marker localisation",
        (false, true) => "from the scenario's [imperfections], measured target localisation",
        (true, true) => {
            "from the scenario's [imperfections], measured marker and target localisation"
        }
    }
}

/// Which sources of the error budget were measured, and which are assumed; none where none was measured.
fn bases_in_words(imperfections: &Imperfections) -> Option<String> {
    let (measured, assumed) = measured_and_assumed(imperfections);
    if measured.is_empty() {
        return None;
    }
    let listed = |sources: &[Source]| {
        let names: Vec<&str> = sources.iter().map(|source| source.name()).collect();
        names.join(", ")
    };
    let others = if assumed.is_empty() {
        String::new()
    } else {
        format!(
            "; assumed by the scenario and its defaults: {}",
            listed(&assumed)
        )
    };
    let measured = listed(&measured);
    Some(format!(
        "error budget from measured covariances: {measured}{others}"
    ))
}

/// Clearance of a goal's planned needle path.
pub(crate) fn route_report(resolved: &ResolvedScenario, goal: &Goal) -> Option<RouteReport> {
    let judged = judge_route(resolved, goal)?;
    Some(RouteReport {
        part: judged.nearest.part.name.clone(),
        tissue: judged.nearest.part.tissue.to_string(),
        distance_m: judged.distance_m,
        margin_m: judged.margin_m,
        kept: judged.is_kept(),
        is_bent: judged.nearest.is_bent,
    })
}

/// The report of one goal, neither evaluated nor ranked.
pub(crate) fn goal_report(
    context: &Context<'_>,
    goal_index: usize,
    plan: &GoalPlan,
    runs: &[Vec<EngineRun>],
    adjudicated: &[Adjudicated],
) -> GoalReport {
    let resolved = context.setup.resolved;
    let goal = &resolved.goals[goal_index];
    let route = resolved
        .phantom
        .as_ref()
        .and_then(|placed| needle_route(resolved, placed, goal))
        .map(|nearest| route_clearance(&nearest.part.name, &nearest.separation));
    GoalReport {
        name: goal.name.clone(),
        lesion: goal.lesion.clone(),
        entry_m: goal.entry_m.map(|point| point.coords.into()),
        target_m: goal.target_m.coords.into(),
        true_target_m: goal.true_target_m.map(|point| point.coords.into()),
        axis: goal.axis.into_inner().into(),
        insertion_length_m: goal.insertion_length_m,
        standoff_m: goal.standoff_m,
        needle_route: route_report(resolved, goal),
        fissures_crossed: crossed_fissures(resolved, goal),
        needle: None,
        configurations: plan
            .configurations
            .iter()
            .zip(runs)
            .zip(&context.budgets[goal_index])
            .zip(adjudicated)
            .enumerate()
            .map(|(index, (((plan, runs), budget), judged))| {
                let mut report =
                    configuration_report(context, goal_index, plan, runs, judged, route.as_ref());
                match budget {
                    Some(Ok(budget)) => report.budget = Some(budget.clone()),
                    Some(Err(error)) => report.budget_failure = Some(error.clone()),
                    None => {}
                }
                let probabilities = context.probabilities;
                match probabilities.and_then(|all| all[goal_index][index].as_ref()) {
                    Some(Ok(found)) => report.probability = Some(found.clone()),
                    Some(Err(error)) => report.probability_failure = Some(error.clone()),
                    None => {}
                }
                set_measured(&mut report);
                report
            })
            .collect(),
        recommended: None,
        ranking: None,
    }
}

fn configuration_report(
    context: &Context<'_>,
    goal_index: usize,
    plan: &ConfigurationPlan,
    runs: &[EngineRun],
    judged: &Adjudicated,
    route: Option<&ClassClearance>,
) -> ConfigurationReport {
    let Context {
        setup,
        room,
        events,
        ..
    } = context;
    let Setup { resolved, real, .. } = setup;
    let cell = &resolved.cell;
    let goal = &resolved.goals[goal_index];
    let candidate = plan.candidate.as_ref();
    let motion = plan.trajectory.as_ref();
    let predicted = motion.and_then(|motion| real.predicted(goal_index, motion));
    let engines: BTreeMap<String, EngineReport> = runs
        .iter()
        .map(|run| {
            let predicted_m = predicted.as_ref().map(|each| each.tip_m);
            let mut report = engine_report(setup, goal_index, plan, run, predicted_m);
            let contacts = &mut report.motion.contact.episodes;
            add_approach_speeds(contacts, real.cell(), real.model(), &run.recording);
            (run.engine.to_owned(), report)
        })
        .collect();
    let mut clearance = overall_clearance(setup, plan, &engines);
    let mut posture = ConfigurationReport::new(plan.configuration.label());
    if let Some(candidate) = candidate {
        posture.set_posture_clearances(&candidate.clearance);
    }
    if let Some(route) = route {
        let class = ClearanceClass::NeedleRoute.name();
        clearance.classes.insert(class, route.clone());
        posture.posture_clearance_m.insert(class, route.minimum_m);
    }
    let commanded = candidate.map(|each| {
        let kinematics = setup.planner.kinematics();
        let base_link_from_flange = kinematics.base_link_from_flange(&each.joints);
        let world_from_flange = cell.robot.world_from_base_link * base_link_from_flange;
        measure_needle(cell, resolved.phantom.as_ref(), goal, &world_from_flange)
    });
    let recordings: Vec<&Recording> = runs.iter().map(|run| &run.recording).collect();
    let engine_difference = engine_difference(real.cell(), real.goal(goal_index), &recordings);
    ConfigurationReport {
        rejections: plan.rejections.iter().map(rejection_report).collect(),
        joints_rad: candidate.map(|each| each.joints.into()),
        roll_rad: candidate.map(|each| each.roll_rad),
        wrap: candidate.map(|each| each.wrap),
        ik_residual_m: candidate.map(|each| each.residual_m),
        ik_residual_rad: candidate.map(|each| each.residual_rad),
        free_joint: candidate
            .filter(|each| each.wrist_3_is_free)
            .map(|_| "wrist_3"),
        margins: candidate.map(|each| margins_report(&each.margins)),
        motion: phases(plan.trajectory.as_ref()),
        retreat: phases(plan.retreat.as_ref()),
        retreat_clearance: retreat_clearance(setup, plan),
        margin: plan.margin.as_ref().map(margin_report),
        search: plan.search.map(|effort| SearchReport {
            waypoints: effort.waypoints,
            postures_checked: effort.checks,
            postures_drawn: effort.samples,
            seed: effort.seed,
        }),
        entry_to_target_m: candidate.and(goal.entry_to_target_m()),
        commanded,
        engines,
        engine_difference,
        adjudication: judged.adjudication.clone(),
        referee: judged.referee.clone(),
        clearance,
        surplus_m: surplus_m(&setup.planner, plan),
        predicted: if real.is_imperfect() {
            predicted.map(|each| each.needle)
        } else {
            commanded
        },
        tip_sensitivity_m_per_rad: candidate.map(|each| tip_sensitivity(cell, goal, &each.joints)),
        events: events
            .iter()
            .find(|run| run.goal == goal_index && run.configuration == plan.configuration.index())
            .map(|run| events_report(setup, plan, run, context.engines)),
        room: room
            .as_ref()
            .zip(candidate)
            .map(|(room, each)| room.measure(goal_index, &each.joints)),
        // `judge` sets the status; the budget and what is measured with it follow.
        ..posture
    }
}

/// Margins of a posture.
pub(crate) fn margins_report(margins: &PostureMargins) -> MarginsReport {
    MarginsReport {
        joint_limit: margins.joint_limit,
        wrist_sine: margins.wrist_sine,
        elbow_sine: margins.elbow_sine,
        shoulder_m: margins.shoulder_m,
        manipulability_m3: margins.manipulability,
    }
}

/// Constraint margin of the posture; of one out of reach, by how much it misses.
fn surplus_m(planner: &Planner<'_>, plan: &ConfigurationPlan) -> Option<f64> {
    match (&plan.candidate, plan.rejections.first()) {
        (Some(candidate), _) => Some(planner.surplus(candidate, &plan.rejections)),
        (None, Some(rejection)) if rejection.rule == Rule::Unreachable => Some(-rejection.value),
        _ => None,
    }
}

fn phases(trajectory: Option<&JointTrajectory>) -> Vec<PhaseReport> {
    trajectory
        .into_iter()
        .flat_map(JointTrajectory::phases)
        .map(|(phase, start_s, end_s)| PhaseReport {
            phase: phase.name(),
            start_s,
            end_s,
        })
        .collect()
}

fn engine_report(
    setup: &Setup<'_>,
    goal_index: usize,
    plan: &ConfigurationPlan,
    run: &EngineRun,
    predicted_m: Option<Point3<f64>>,
) -> EngineReport {
    let real = &setup.real;
    let (cell, goal) = (real.cell(), real.goal(goal_index));
    let trajectory = plan
        .trajectory
        .as_ref()
        .expect("what was simulated has a trajectory");
    let settled = run
        .recording
        .state
        .last()
        .expect("a recording has its initial state");
    let band_m = setup.resolved.scenario.criteria.settling_band_mm * 1e-3;
    let rested_m = tip_of(cell, goal, &settled.world_from_flange);
    // An imperfect arm never comes to its commanded place.
    let rests_at_m = real.is_imperfect().then_some(rested_m);
    EngineReport {
        needle: measure_needle(cell, real.phantom(), goal, &settled.world_from_flange),
        unexplained_tip_m: predicted_m.map(|predicted_m| (rested_m - predicted_m).norm()),
        motion: measure_motion(cell, goal, trajectory, &run.recording, band_m, rests_at_m),
        clearance: ClearanceReport::of(&run.clearance.minima),
    }
}

/// Least clearances over all engines; over the planned motion where nothing was simulated, and of
/// the final posture where there is no motion.
fn overall_clearance(
    setup: &Setup<'_>,
    plan: &ConfigurationPlan,
    engines: &BTreeMap<String, EngineReport>,
) -> ClearanceReport {
    let cell = &setup.resolved.cell;
    let mut classes: BTreeMap<&'static str, ClassClearance> = BTreeMap::new();
    if engines.is_empty() {
        let minima = match (&plan.certificate, &plan.candidate) {
            (Some(certificate), _) => certified_clearance(cell, certificate),
            (None, Some(candidate)) => posture_clearance(cell, &candidate.clearance),
            (None, None) => BTreeMap::new(),
        };
        classes.extend(
            minima
                .into_iter()
                .map(|(class, found)| (class.name(), found)),
        );
    }
    for report in engines.values() {
        for (class, found) in &report.clearance.classes {
            let Some(known) = classes.get_mut(class) else {
                classes.insert(class, found.clone());
                continue;
            };
            // The bound over all engines, whichever comes nearest.
            let bound_m = known
                .certified_lower_bound_m
                .zip(found.certified_lower_bound_m)
                .map(|(one, other)| one.min(other));
            let behind_cuts_m = known.behind_cuts_m.zip(found.behind_cuts_m);
            let behind_cuts_m = behind_cuts_m.map(|(one, other)| one.min(other));
            if found.minimum_m < known.minimum_m {
                *known = found.clone();
            }
            known.certified_lower_bound_m = bound_m;
            known.behind_cuts_m = behind_cuts_m;
        }
    }
    ClearanceReport::new(classes)
}

/// Certified clearances of the retreat.
fn retreat_clearance(setup: &Setup<'_>, plan: &ConfigurationPlan) -> ClearanceReport {
    let Setup {
        resolved, model, ..
    } = setup;
    let tolerance_m = resolved.scenario.planning.certificate_tolerance_mm * 1e-3;
    plan.retreat
        .as_ref()
        .map_or_else(ClearanceReport::default, |retreat| {
            ClearanceReport::of(&planned_clearance(
                &resolved.cell,
                model,
                retreat,
                tolerance_m,
            ))
        })
}

/// Margins of a motion, as a value of the report.
fn margin_report(margin: &Margin) -> MarginReport {
    let least = margin.least();
    MarginReport {
        attainable_m: margin.attainable_m(),
        achieved_m: margin.achieved_m(),
        class: least.map(|each| each.class.name()),
        limited_by: least.map(|each| each.limited_by.name()),
        search: margin.end.name(),
        straight: margin.straight.map(|straight| StraightReport {
            clearance_m: straight.clearance_m,
            instead_m: straight.instead_m,
            duration_s: straight.duration_s,
        }),
        classes: margin
            .classes
            .iter()
            .map(|each| {
                let report = ClassMarginReport {
                    limit_m: each.limit_m,
                    attainable_m: each.attainable_m,
                    achieved_m: each.achieved_m,
                    limited_by: each.limited_by.name(),
                };
                (each.class.name(), report)
            })
            .collect(),
    }
}

/// A violated rule, as a value of the report.
pub(crate) fn rejection_report(rejection: &Rejection) -> RejectionReport {
    RejectionReport {
        rule: rejection.rule.name(),
        value: rejection.value,
        limit: rejection.limit,
        unit: rejection.unit,
        detail: rejection.detail.clone(),
    }
}
