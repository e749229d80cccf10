//! Events of a scenario: staged once, simulated in each engine, put into the report.

use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;

use needlebench_cell::scenario::{EngineName, EventsSection, PressSection, StopSection};
use needlebench_cell::{Cell, Goal, ResolvedScenario};
use needlebench_engine::{
    Brakes, Braking, EngineError, Hooks, Plant, Recording, Servo, simulate_with_stop,
};
use needlebench_evaluation::events::{
    EventsReport, PressReport, StopEnvelope, StopReport, measure_press, measure_retraction,
    measure_stop, press_difference, stopping_envelope,
};
use needlebench_evaluation::report::{CriterionResult, EngineFailure};
use needlebench_kinematics::trajectory::{JointTrajectory, Phase};
use needlebench_planning::{ConfigurationPlan, GoalPlan, PressError, PressPlan, stage_press};

use crate::pipeline::in_parallel;
use crate::plants::{Harness, plant};
use crate::reality::{Reality, servo};

/// Events of one configuration, with what the engines made of them.
#[derive(Debug)]
pub(crate) struct EventRun {
    /// Index of the goal.
    pub goal: usize,
    /// Index of the configuration.
    pub configuration: usize,
    /// The contacts.
    pub press: Vec<Result<PressPlan, PressError>>,
    /// The stop.
    pub stop: Option<StagedStop>,
    /// What each engine recorded.
    pub engines: BTreeMap<EngineName, EngineEvents>,
}

/// A stop that is ready to be simulated.
#[derive(Debug)]
pub(crate) struct StagedStop {
    at_s: f64,
    phase: Phase,
    trajectory: JointTrajectory,
    /// From when on, and with which brakes.
    brakes: Option<(f64, Brakes)>,
    envelope: StopEnvelope,
}

/// Recordings of one engine.
#[derive(Debug, Default)]
pub(crate) struct EngineEvents {
    /// By contact; none where it could not be staged.
    pub press: Vec<Option<Recording>>,
    stop: Option<Recording>,
    retract: Option<Recording>,
}

/// Stages the events of every configuration that works.
pub(crate) fn stage(
    resolved: &ResolvedScenario,
    reality: &Reality<'_>,
    plans: &[GoalPlan],
    threads: usize,
) -> Vec<EventRun> {
    let Some(events) = &resolved.scenario.events else {
        return Vec::new();
    };
    let working: Vec<(usize, usize, &ConfigurationPlan)> = plans
        .iter()
        .enumerate()
        .flat_map(|(goal, plan)| {
            let configurations = plan.configurations.iter().enumerate();
            configurations.map(move |(index, plan)| (goal, index, plan))
        })
        .filter(|(_, _, plan)| plan.rejections.is_empty() && plan.trajectory.is_some())
        .collect();
    in_parallel(threads, &working, |&(goal, configuration, plan)| {
        let trajectory = plan.trajectory.as_ref().expect("filtered");
        EventRun {
            goal,
            configuration,
            press: events
                .press
                .iter()
                .map(|press| stage_one(reality, trajectory, press))
                .collect(),
            stop: events
                .stop
                .as_ref()
                .map(|stop| stage_stop(resolved, reality, goal, trajectory, stop)),
            engines: BTreeMap::new(),
        }
    })
}

fn stage_one(
    reality: &Reality<'_>,
    trajectory: &JointTrajectory,
    press: &PressSection,
) -> Result<PressPlan, PressError> {
    stage_press(
        reality.cell(),
        reality.model(),
        &trajectory.end(),
        press.class.class(),
        (press.gap_mm * 1e-3, press.depth_mm * 1e-3),
        press.speed_mm_s * 1e-3,
        press.hold_s,
    )
}

fn stage_stop(
    resolved: &ResolvedScenario,
    reality: &Reality<'_>,
    goal: usize,
    trajectory: &JointTrajectory,
    stop: &StopSection,
) -> StagedStop {
    let (cell, goal) = (reality.cell(), reality.goal(goal));
    let brakes = Brakes::of_ur3(&cell.dynamics());
    let deceleration_s = stop.deceleration_ms * 1e-3;
    let by_brakes = (stop.category == 0).then_some(&brakes);
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
    let timestep_s = resolved.scenario.engines.timestep_ms * 1e-3;
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
        brakes: (stop.category < 2).then_some((at_s + slowing_s, brakes)),
        envelope,
    }
}

/// What a simulation of events works with.
pub(crate) struct EventSimulation<'a> {
    pub resolved: &'a ResolvedScenario,
    pub reality: &'a Reality<'a>,
    pub plans: &'a [GoalPlan],
    pub harness: Option<&'a Harness>,
    pub cancel: &'a AtomicBool,
}

impl EventSimulation<'_> {
    /// Simulates everything that is staged in one engine; stops at the first failure.
    pub(crate) fn run(
        &self,
        engine: EngineName,
        runs: &[EventRun],
    ) -> (Vec<EngineEvents>, Option<EngineFailure>) {
        let mut done = Vec::new();
        for run in runs {
            match self.run_one(engine, run) {
                Ok(events) => done.push(events),
                Err(EngineError::Cancelled) => break,
                Err(error) => {
                    let goal = &self.resolved.goals[run.goal].name;
                    let plan = &self.plans[run.goal].configurations[run.configuration];
                    let failure = EngineFailure {
                        engine: engine.name().to_owned(),
                        during: Some(format!("events of {goal} {}", plan.configuration)),
                        message: error.to_string(),
                    };
                    return (done, Some(failure));
                }
            }
        }
        (done, None)
    }

    fn run_one(&self, engine: EngineName, run: &EventRun) -> Result<EngineEvents, EngineError> {
        let events = section(self.resolved);
        let cell = self.reality.cell();
        let servo = servo(self.resolved);
        let mut done = EngineEvents::default();
        for (press, asked) in run.press.iter().zip(&events.press) {
            let recording = press
                .as_ref()
                .ok()
                .map(|press| {
                    self.with_plant(engine, &press.cell, asked.friction, &mut |plant| {
                        self.simulate(plant, &servo, &press.trajectory, None)
                    })
                })
                .transpose()?;
            done.press.push(recording);
        }
        let plan = &self.plans[run.goal].configurations[run.configuration];
        let retreat = plan.retreat.as_ref().filter(|_| events.retract);
        if run.stop.is_none() && retreat.is_none() {
            return Ok(done);
        }
        let dynamics = cell.dynamics();
        let (stop, retract) = self.with_plant(engine, cell, None, &mut |plant| {
            let stop = run.stop.as_ref().map(|stop| {
                let braking = stop.brakes.map(|(from_s, brakes)| Braking {
                    from_s,
                    brakes,
                    dynamics: &dynamics,
                });
                self.simulate(plant, &servo, &stop.trajectory, braking)
            });
            let stop = stop.transpose()?;
            let retract = retreat
                .map(|retreat| self.simulate(plant, &servo, retreat, None))
                .transpose()?;
            Ok((stop, retract))
        })?;
        done.stop = stop;
        done.retract = retract;
        Ok(done)
    }

    fn simulate(
        &self,
        plant: &mut dyn Plant,
        servo: &Servo,
        trajectory: &JointTrajectory,
        braking: Option<Braking<'_>>,
    ) -> Result<Recording, EngineError> {
        let hooks = Hooks {
            cancel: Some(self.cancel),
            progress: None,
        };
        let actuation = self.reality.actuation();
        simulate_with_stop(plant, servo, actuation, trajectory, braking, hooks)
    }

    fn with_plant<T>(
        &self,
        engine: EngineName,
        cell: &Cell,
        friction: Option<f64>,
        work: &mut dyn FnMut(&mut dyn Plant) -> Result<T, EngineError>,
    ) -> Result<T, EngineError> {
        let mut engines = self.resolved.scenario.engines.clone();
        engines.friction = friction.unwrap_or(engines.friction);
        let mut process = match (engine, self.harness) {
            (EngineName::Rapier, _) => None,
            (EngineName::Mujoco, Some(Ok(harness))) => {
                Some(harness.lock().expect("one thread uses it"))
            }
            // The planned motions have failed for the same reason, which is reported.
            (EngineName::Mujoco, _) => return Err(EngineError::Cancelled),
        };
        let timestep_s = engines.timestep_ms * 1e-3;
        let mut plant = plant(engine, cell, &engines, timestep_s, process.as_deref_mut())?;
        work(plant.as_mut())
    }
}

fn section(resolved: &ResolvedScenario) -> &EventsSection {
    let events = resolved.scenario.events.as_ref();
    events.expect("events are staged where the scenario has the section")
}

/// The report's part about the events of a configuration.
pub(crate) fn events_report(
    resolved: &ResolvedScenario,
    reality: &Reality<'_>,
    plan: &ConfigurationPlan,
    run: &EventRun,
) -> EventsReport {
    let events = section(resolved);
    let (cell, model, goal) = (reality.cell(), reality.model(), reality.goal(run.goal));
    let scenario = &resolved.scenario;
    let band_m = scenario.criteria.settling_band_mm * 1e-3;
    let settings = (
        scenario.recording.period_ms * 1e-3,
        scenario.planning.certificate_tolerance_mm * 1e-3,
        band_m,
    );
    let press = run
        .press
        .iter()
        .zip(&events.press)
        .enumerate()
        .map(|(index, (staged, asked))| {
            press_report(resolved, goal, staged, asked, index, &run.engines)
        })
        .collect();
    let stop = run.stop.as_ref().map(|stop| {
        let planned = plan.trajectory.as_ref().expect("events follow a motion");
        let engines: BTreeMap<_, _> = run
            .engines
            .iter()
            .filter_map(|(engine, events)| {
                let recording = events.stop.as_ref()?;
                let both = (planned, &stop.trajectory);
                let report = measure_stop(cell, model, goal, both, recording, stop.at_s, settings);
                Some((engine.name().to_owned(), report))
            })
            .collect();
        let last = |events: &EngineEvents| {
            let state = events.stop.as_ref()?.state.last()?;
            let exit = state.world_from_flange * cell.tool.flange_from_guide_exit;
            Some(exit * nalgebra::Point3::new(0.0, 0.0, goal.insertion_length_m))
        };
        let tips: Vec<_> = run.engines.values().filter_map(last).collect();
        StopReport {
            category: events.stop.as_ref().map_or(0, |stop| stop.category),
            at_s: stop.at_s,
            phase: stop.phase.name(),
            engines,
            tip_difference_m: match tips[..] {
                [a, b] => Some((a - b).norm()),
                _ => None,
            },
            envelope: stop.envelope,
        }
    });
    let retract = run
        .engines
        .iter()
        .filter_map(|(engine, events)| {
            let (recording, retreat) = (events.retract.as_ref()?, plan.retreat.as_ref()?);
            let report = measure_retraction(cell, model, goal, retreat, recording, settings);
            Some((engine.name().to_owned(), report))
        })
        .collect();
    let mut report = EventsReport {
        press,
        stop,
        retract,
        checks: Vec::new(),
    };
    report.checks = checks(&goal.name, plan.configuration.label(), events, &report);
    report
}

fn press_report(
    resolved: &ResolvedScenario,
    goal: &Goal,
    staged: &Result<PressPlan, PressError>,
    asked: &PressSection,
    index: usize,
    engines: &BTreeMap<EngineName, EngineEvents>,
) -> PressReport {
    let friction = asked.friction.unwrap_or(resolved.scenario.engines.friction);
    let band_m = resolved.scenario.criteria.settling_band_mm * 1e-3;
    let mut report = PressReport {
        class: asked.class.class().name(),
        solids: Vec::new(),
        depth_m: asked.depth_mm * 1e-3,
        displacement_m: None,
        friction,
        not_staged: None,
        engines: BTreeMap::new(),
        force_difference: None,
        tip_difference_settled_m: None,
        tip_difference_peak_m: None,
    };
    let plan = match staged {
        Ok(plan) => plan,
        Err(error) => {
            report.not_staged = Some(error.to_string());
            return report;
        }
    };
    report.solids = plan.solids.to_vec();
    report.displacement_m = Some(plan.displacement_m.into());
    let recordings: Vec<(&EngineName, &Recording)> = engines
        .iter()
        .filter_map(|(engine, events)| Some((engine, events.press.get(index)?.as_ref()?)))
        .collect();
    for (engine, recording) in &recordings {
        let measured = measure_press(
            &plan.cell,
            &plan.model,
            plan.bodies,
            goal,
            &plan.trajectory,
            recording,
            friction,
            band_m,
        );
        report.engines.insert(engine.name().to_owned(), measured);
    }
    if let [(_, a), (_, b)] = recordings[..] {
        press_difference(&mut report, &plan.cell, goal, a, b);
    }
    report
}

/// Everything that the section sets a limit for.
fn checks(
    goal: &str,
    label: &str,
    events: &EventsSection,
    report: &EventsReport,
) -> Vec<CriterionResult> {
    let mut results = Vec::new();
    let mut check = |key: String,
                     engine: Option<&str>,
                     value: Option<f64>,
                     limit: Option<f64>,
                     unit: &'static str,
                     detail: &str| {
        let Some(limit) = limit else { return };
        results.push(CriterionResult {
            goal: goal.to_owned(),
            label: Some(label.to_owned()),
            engine: engine.map(str::to_owned),
            criterion: key,
            value,
            limit: Some(limit),
            unit,
            // What could not be measured is not met.
            pass: value.is_some_and(|value| value <= limit),
            detail: detail.to_owned(),
        });
    };
    for (index, (press, asked)) in report.press.iter().zip(&events.press).enumerate() {
        let key = |name: &str| format!("events.press[{index}].{name}");
        let detail = match &press.not_staged {
            Some(reason) => format!("{}: {reason}", press.class),
            None => press.solids.join(" and "),
        };
        // One engine alone, on request, cannot differ from the other.
        if press.engines.len() != 1 {
            let limit = asked.max_force_difference;
            let key_of = key("max_force_difference");
            check(key_of, None, press.force_difference, limit, "1", &detail);
            let limit = asked.max_tip_difference_mm.map(|mm| mm * 1e-3);
            let key_of = key("max_tip_difference_mm");
            let value = press.tip_difference_settled_m;
            check(key_of, None, value, limit, "m", &detail);
        }
        for (engine, measured) in &press.engines {
            let engine = Some(engine.as_str());
            let (limit, key_of) = (asked.max_balance_difference, key("max_balance_difference"));
            let value = measured.balance_difference;
            check(key_of, engine, value, limit, "1", &detail);
            let (limit, key_of) = (asked.max_recovery_s, key("max_recovery_s"));
            check(key_of, engine, measured.recovery_s, limit, "s", &detail);
        }
    }
    if let (Some(stop), Some(asked)) = (&report.stop, &events.stop) {
        for (engine, measured) in &stop.engines {
            let engine = Some(engine.as_str());
            let limit = asked.max_tip_distance_mm.map(|mm| mm * 1e-3);
            let (key, value) = ("events.stop.max_tip_distance_mm", measured.tip_distance_m);
            check(key.to_owned(), engine, Some(value), limit, "m", "");
            let (limit, value) = (asked.max_stopping_time_s, measured.stopping_time_s);
            let key = "events.stop.max_stopping_time_s";
            check(key.to_owned(), engine, value, limit, "s", "");
        }
    }
    for (engine, measured) in &report.retract {
        let limit = events.max_retraction_deviation_mm.map(|mm| mm * 1e-3);
        let key = "events.max_retraction_deviation_mm".to_owned();
        let value = Some(measured.largest_lateral_deviation_m);
        check(key, Some(engine), value, limit, "m", "");
    }
    results
}
