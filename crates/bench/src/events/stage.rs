//! What is to happen, without any engine.

use needlebench_engine::Brakes;
use needlebench_evaluation::events::stopping_envelope;
use needlebench_kinematics::trajectory::{JointTrajectory, Phase};
use needlebench_parallel::in_parallel;
use needlebench_planning::{PressError, PressPlan, stage_press};
use needlebench_robot::ArmInUse;
use needlebench_scenario::scenario::{PressSection, StopSection};

use super::{EventRun, StagedStop};
use crate::plan::{Job, Planned};
use crate::real_cell::RealCell;
use crate::setup::Setup;

/// Stages the events of every feasible configuration.
pub(crate) fn stage(setup: &Setup<'_>, planned: &Planned, threads: usize) -> Vec<EventRun> {
    let Some(events) = &setup.resolved.scenario.events else {
        return Vec::new();
    };
    in_parallel(threads, &planned.feasible, |&job| {
        let trajectory = job.plan(&planned.goals).trajectory.as_ref();
        let trajectory = trajectory.expect("what works has a motion");
        let Job {
            goal,
            configuration,
        } = job;
        let press = events.press.iter();
        EventRun {
            goal,
            configuration,
            press: press
                .map(|press| stage_one(&setup.real, trajectory, press))
                .collect(),
            stop: events
                .stop
                .as_ref()
                .map(|stop| stage_stop(setup, goal, trajectory, stop)),
            engines: Vec::new(),
        }
    })
}

fn stage_one(
    real: &RealCell<'_>,
    trajectory: &JointTrajectory,
    press: &PressSection,
) -> Result<PressPlan, PressError> {
    stage_press(
        real.cell(),
        real.model(),
        &trajectory.end(),
        press.class.class(),
        (press.gap_mm * 1e-3, press.depth_mm * 1e-3),
        press.speed_mm_s * 1e-3,
        press.hold_s,
    )
}

fn stage_stop(
    setup: &Setup<'_>,
    goal: usize,
    trajectory: &JointTrajectory,
    stop: &StopSection,
) -> StagedStop {
    let (cell, goal) = (setup.real.cell(), setup.real.goal(goal));
    let figures = setup
        .resolved
        .robot_description
        .arm
        .as_ref()
        .and_then(ArmInUse::brakes);
    let figures = figures.filter(|_| stop.category < 2);
    let brakes = figures
        .as_ref()
        .map(|figures| Brakes::of_figures(figures, &cell.dynamics()));
    let deceleration_s = stop.deceleration_ms * 1e-3;
    let by_brakes = brakes.as_ref().filter(|_| stop.category == 0);
    let envelope = stopping_envelope(cell, goal, trajectory, by_brakes, deceleration_s);
    let arrival_s = trajectory
        .phases()
        .iter()
        .filter(|(phase, _, _)| *phase != Phase::Hold)
        .map(|(_, _, end_s)| *end_s)
        .fold(0.0, f64::max);
    let at_s = match (stop.at_s, stop.at_progress) {
        (Some(at_s), _) => at_s.min(trajectory.duration_s()),
        (None, Some(progress)) => progress * arrival_s,
        (None, None) => envelope.worst_at_s,
    };
    // Between two steps the controller knows of nothing.
    let timestep_s = setup.resolved.scenario.engines.timestep_ms * 1e-3;
    let at_s = (at_s / timestep_s).round() * timestep_s;
    let slowing_s = if stop.category == 0 {
        0.0
    } else {
        deceleration_s
    };
    StagedStop {
        at_s,
        phase: trajectory.phase_at(at_s),
        trajectory: trajectory
            .stopped(at_s, slowing_s)
            .then_hold(Phase::Stop, stop.observe_s - slowing_s),
        brakes: brakes.map(|brakes| (at_s + slowing_s, brakes)),
        figures,
        envelope,
    }
}
