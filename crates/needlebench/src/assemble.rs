//! Plans and recordings into the values of the report.

use std::collections::BTreeMap;

use needlebench_cell::scenario::EngineName;
use needlebench_cell::{ResolvedScenario, enclosures};
use needlebench_clearance::ClearanceModel;
use needlebench_engine::EngineIdentity;
use needlebench_evaluation::ranking::rank_goal;
use needlebench_evaluation::report::{
    ClassClearance, ClearanceReport, ConfigurationReport, EngineFailure, EngineReport, GoalReport,
    MarginsReport, PhaseReport, RejectionReport, Report, SCHEMA_VERSION, ScenarioSummary,
    SearchReport, Status,
};
use needlebench_evaluation::room::RoomModel;
use needlebench_evaluation::{
    add_approach_speeds, engine_difference, judge, measure_motion, measure_needle, needle_route,
    planned_clearance, posture_clearance, tip_of, tip_sensitivity,
};
use needlebench_kinematics::trajectory::JointTrajectory;
use needlebench_planning::{ConfigurationPlan, GoalPlan, Planner};

use crate::budgets::Budgets;
use crate::events::{EventRun, events_report};
use crate::pipeline::EngineRun;
use crate::provenance::provenance;
use crate::reality::Reality;
use crate::trial::Trial;

/// What all parts of a report are made with.
pub(crate) struct Context<'a> {
    pub resolved: &'a ResolvedScenario,
    pub planner: &'a Planner<'a>,
    pub model: &'a ClearanceModel,
    pub reality: &'a Reality<'a>,
    pub budgets: &'a Budgets,
    /// None where nobody asks for the room.
    pub room: Option<RoomModel<'a>>,
    pub events: &'a [EventRun],
}

#[expect(
    clippy::too_many_arguments,
    reason = "gathers the results of all stages, once"
)]
pub(crate) fn assemble(
    resolved: &ResolvedScenario,
    planner: &Planner<'_>,
    model: &ClearanceModel,
    reality: &Reality<'_>,
    plans: &[GoalPlan],
    runs: &[Vec<Vec<EngineRun>>],
    events: &[EventRun],
    budgets: &Budgets,
    trials: &[Vec<Trial>],
    engines: &[EngineName],
    engine_failures: Vec<EngineFailure>,
    identities: Vec<EngineIdentity>,
    timings: BTreeMap<String, f64>,
) -> Report {
    let context = Context {
        resolved,
        planner,
        model,
        reality,
        budgets,
        room: Some(RoomModel::new(resolved)),
        events,
    };
    let mut goals: Vec<GoalReport> = plans
        .iter()
        .zip(runs)
        .zip(trials)
        .enumerate()
        .map(|(index, ((plan, runs), trials))| goal_report(&context, index, plan, runs, trials))
        .collect();
    let both = engines.len() == 2 && engine_failures.is_empty();
    let (verdict, criteria) = judge(
        &mut goals,
        &resolved.goals,
        &resolved.scenario.criteria,
        both,
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
        criteria,
        goals,
        iso9283: None,
        engine_failures,
        enclosure: enclosures(&resolved.cell.robot),
        notes: resolved.notes.clone(),
        truth: reality.report(),
        provenance: provenance(resolved, identities),
        timings,
    }
}

pub(crate) fn goal_report(
    context: &Context<'_>,
    goal_index: usize,
    plan: &GoalPlan,
    runs: &[Vec<EngineRun>],
    trials: &[Trial],
) -> GoalReport {
    let resolved = context.resolved;
    let goal = &resolved.goals[goal_index];
    let route = resolved
        .phantom
        .as_ref()
        .and_then(|placed| needle_route(&resolved.cell, placed, goal));
    GoalReport {
        name: goal.name.clone(),
        lesion: goal.lesion.clone(),
        entry_m: goal.entry_m.map(|point| point.coords.into()),
        target_m: goal.target_m.coords.into(),
        axis: goal.axis.into_inner().into(),
        insertion_length_m: goal.insertion_length_m,
        standoff_m: goal.standoff_m,
        configurations: plan
            .configurations
            .iter()
            .zip(runs)
            .zip(&context.budgets[goal_index])
            .zip(trials)
            .map(|(((plan, runs), budget), trial)| {
                let mut report =
                    configuration_report(context, goal_index, plan, runs, trial, route.as_ref());
                match budget {
                    Some(Ok(budget)) => report.budget = Some(budget.clone()),
                    Some(Err(error)) => report.budget_failure = Some(error.clone()),
                    None => {}
                }
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
    trial: &Trial,
    route: Option<&ClassClearance>,
) -> ConfigurationReport {
    let Context {
        resolved,
        planner,
        model,
        reality,
        room,
        events,
        ..
    } = context;
    let cell = &resolved.cell;
    let goal = &resolved.goals[goal_index];
    let candidate = plan.candidate.as_ref();
    let engines: BTreeMap<String, EngineReport> = runs
        .iter()
        .map(|run| {
            let mut report = engine_report(resolved, reality, goal_index, plan, run);
            let contacts = &mut report.motion.contact.episodes;
            add_approach_speeds(contacts, reality.cell(), reality.model(), &run.recording);
            (run.engine.name().to_owned(), report)
        })
        .collect();
    let mut clearance = overall_clearance(resolved, model, plan, &engines);
    if let Some(route) = route {
        clearance.classes.insert("needle_route", route.clone());
    }
    let engine_difference = match runs {
        [a, b] => {
            let (cell, goal) = (reality.cell(), reality.goal(goal_index));
            Some(engine_difference(cell, goal, &a.recording, &b.recording))
        }
        _ => None,
    };
    ConfigurationReport {
        label: plan.configuration.label(),
        status: Status::Rejected, // `judge` sets it
        rejections: plan
            .rejections
            .iter()
            .map(|rejection| RejectionReport {
                rule: rejection.rule.name(),
                value: rejection.value,
                limit: rejection.limit,
                unit: rejection.unit,
                detail: rejection.detail.clone(),
            })
            .collect(),
        joints_rad: candidate.map(|each| each.joints.into()),
        roll_rad: candidate.map(|each| each.roll_rad),
        wrap: candidate.map(|each| each.wrap),
        ik_residual_m: candidate.map(|each| each.residual_m),
        ik_residual_rad: candidate.map(|each| each.residual_rad),
        free_joint: candidate
            .filter(|each| each.wrist_3_is_free)
            .map(|_| "wrist_3"),
        margins: candidate.map(|each| MarginsReport {
            joint_limit: each.margins.joint_limit,
            wrist_sine: each.margins.wrist_sine,
            elbow_sine: each.margins.elbow_sine,
            shoulder_m: each.margins.shoulder_m,
            manipulability_m3: each.margins.manipulability,
        }),
        motion: phases(plan.trajectory.as_ref()),
        retreat: phases(plan.retreat.as_ref()),
        search: plan.search.map(|effort| SearchReport {
            waypoints: effort.waypoints,
            postures_checked: effort.checks,
            postures_drawn: effort.samples,
            seed: effort.seed,
        }),
        commanded: candidate.map(|each| {
            let base_link_from_flange = planner.kinematics().base_link_from_flange(&each.joints);
            let world_from_flange = cell.robot.world_from_base_link * base_link_from_flange;
            measure_needle(cell, resolved.phantom.as_ref(), goal, &world_from_flange)
        }),
        engines,
        engine_difference,
        adjudication: trial.adjudication.clone(),
        referee: trial.referee.clone(),
        clearance,
        tip_sensitivity_m_per_rad: candidate.map(|each| tip_sensitivity(cell, goal, &each.joints)),
        pareto: false,
        dominated_by: None,
        ranking: None,
        events: events
            .iter()
            .find(|run| run.goal == goal_index && run.configuration == plan.configuration.index())
            .map(|run| events_report(resolved, reality, plan, run)),
        room: room
            .as_ref()
            .zip(candidate)
            .map(|(room, each)| room.measure(goal_index, &each.joints)),
        budget: None,
        budget_failure: None,
        files: Vec::new(),
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
    resolved: &ResolvedScenario,
    reality: &Reality<'_>,
    goal_index: usize,
    plan: &ConfigurationPlan,
    run: &EngineRun,
) -> EngineReport {
    let (cell, goal) = (reality.cell(), reality.goal(goal_index));
    let trajectory = plan
        .trajectory
        .as_ref()
        .expect("what was simulated has a trajectory");
    let settled = run
        .recording
        .state
        .last()
        .expect("a recording has its initial state");
    let band_m = resolved.scenario.criteria.settling_band_mm * 1e-3;
    let rested_m = tip_of(cell, goal, &settled.world_from_flange);
    // An imperfect arm never comes to its commanded place.
    let rests_at_m = reality.is_imperfect().then_some(rested_m);
    EngineReport {
        needle: measure_needle(cell, reality.phantom(), goal, &settled.world_from_flange),
        unexplained_tip_m: reality
            .predicted_tip(goal_index, trajectory)
            .map(|predicted_m| (rested_m - predicted_m).norm()),
        motion: measure_motion(cell, goal, trajectory, &run.recording, band_m, rests_at_m),
        clearance: ClearanceReport::of(&run.clearance.minima),
    }
}

/// Least clearances over all engines; over the planned motion where nothing was simulated, and of
/// the final posture where there is no motion.
fn overall_clearance(
    resolved: &ResolvedScenario,
    model: &ClearanceModel,
    plan: &ConfigurationPlan,
    engines: &BTreeMap<String, EngineReport>,
) -> ClearanceReport {
    let cell = &resolved.cell;
    let mut classes: BTreeMap<&'static str, ClassClearance> = BTreeMap::new();
    if engines.is_empty() {
        let tolerance_m = resolved.scenario.planning.certificate_tolerance_mm * 1e-3;
        let minima = match (&plan.trajectory, &plan.candidate) {
            (Some(trajectory), _) => planned_clearance(cell, model, trajectory, tolerance_m),
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
            if found.minimum_m < known.minimum_m {
                *known = found.clone();
            }
            known.certified_lower_bound_m = bound_m;
        }
    }
    ClearanceReport::new(classes)
}
